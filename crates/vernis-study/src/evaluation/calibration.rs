//! Do the intervals that come with a score hold the ratings as often as they say?
//!
//! Coverage = share of held-out ratings inside [low, high]; with it the shares below and above and the mean width, in
//! MOS. An interval from the spread of an ensemble's members speaks of what was learned, not of the noise of one
//! rating: coverage below the nominal level is expected where the members agree on the same mistake. Cost: O(n).

use super::EvaluationError;
use super::bootstrap::Interval;
use serde::{Deserialize, Serialize};

/// How often intervals held ratings of one kind.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    /// Number of held-out ratings.
    pub rows: usize,
    /// The share of ratings inside their interval.
    pub covered: f64,
    /// Ratings below their interval.
    pub below: f64,
    /// Ratings above their interval.
    pub above: f64,
    /// In MOS.
    pub mean_width: f64,
}

impl From<Calibration> for Coverage {
    fn from(found: Calibration) -> Self {
        let Calibration { rows, covered, below, above, mean_width, .. } = found;
        Self { rows, covered, below, above, mean_width }
    }
}

/// How often intervals held the ratings of materials that the metric has not seen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Number of held-out ratings.
    pub rows: usize,
    /// The share that the intervals promise.
    pub nominal: f64,
    /// The share of ratings inside their interval.
    pub covered: f64,
    /// Ratings below their interval: the candidate looks worse than any member says.
    pub below: f64,
    /// Ratings above their interval.
    pub above: f64,
    /// In MOS.
    pub mean_width: f64,
    /// How often the same intervals held ratings of which neither the material nor the method was seen; `None` where the study has
    /// one family of methods, and in records of before it was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unseen_method: Option<Coverage>,
}

impl Calibration {
    /// `intervals[i]` was predicted for the row whose rating is `mos[i]`.
    pub fn of(mos: &[f64], intervals: &[Interval], nominal: f64) -> Result<Self, EvaluationError> {
        if mos.len() != intervals.len() {
            let what = "score intervals to calibrate";
            return Err(EvaluationError::Lengths { what, found: intervals.len(), expected: mos.len() });
        }
        if mos.is_empty() {
            return Err(EvaluationError::TooFew { what: "rows to calibrate on", found: 0, least: 1 });
        }
        let rows = mos.len() as f64;
        let share = |is: fn(f64, &Interval) -> bool| {
            mos.iter().zip(intervals).filter(|&(&m, i)| is(m, i)).count() as f64 / rows
        };
        Ok(Self {
            rows: mos.len(),
            nominal,
            covered: share(|m, i| i.contains(m)),
            below: share(|m, i| m < i.low),
            above: share(|m, i| m > i.high),
            mean_width: intervals.iter().map(|i| i.high - i.low).sum::<f64>() / rows,
            unseen_method: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_both_sides() {
        let interval = Interval { low: 2.0, high: 3.0 };
        let found = Calibration::of(&[1.5, 2.0, 2.5, 3.0, 3.5], &[interval; 5], 0.95).unwrap();
        let counts = Coverage { rows: 5, covered: 0.6, below: 0.2, above: 0.2, mean_width: 1.0 };
        assert_eq!((found.nominal, Coverage::from(found)), (0.95, counts));
        // Records of before the second figure was kept are read.
        let old = r#"{"rows":5,"nominal":0.95,"covered":0.6,"below":0.2,"above":0.2,"mean_width":1.0}"#;
        assert_eq!(serde_json::from_str::<Calibration>(old).unwrap(), found);
        assert_eq!(serde_json::to_string(&found).unwrap(), old);
    }

    #[test]
    fn needs_one_interval_a_row() {
        assert!(Calibration::of(&[1.0], &[], 0.95).is_err());
        assert!(Calibration::of(&[], &[], 0.95).is_err());
    }
}
