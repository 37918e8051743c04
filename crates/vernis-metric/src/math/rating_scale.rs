//! Scales on which people rate: where their worst and best ends lie.
//!
//! What learns from ratings, and what judges, works in *grades*, 1 (worst) to 5 (best), whatever a study's own scale:
//!
//!   grade = 1 + 4 (x - worst) / (best - worst),   x = worst + (grade - 1) (best - worst) / 4
//!
//! so that a study gives the same metric on whichever scale it is stated. `best` may be the smaller number, as for
//! differences of opinion scores (DMOS). A scale that is *open* has no worst end of its own, as one of just objectionable
//! differences (JOD): its `worst` is where the ratings of a study end.

use serde::{Deserialize, Serialize};
use std::fmt;

/// The ends of a scale of ratings, which are finite and differ.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Ends", into = "Ends")]
pub struct RatingScale {
    worst: f64,
    best: f64,
    open: bool,
}

/// A scale as files hold it.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Ends {
    worst: f64,
    best: f64,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    open: bool,
}

impl TryFrom<Ends> for RatingScale {
    type Error = String;

    fn try_from(ends: Ends) -> Result<Self, String> {
        let scale = Self::new(ends.worst, ends.best)?;
        Ok(Self { open: ends.open, ..scale })
    }
}

impl From<RatingScale> for Ends {
    fn from(RatingScale { worst, best, open }: RatingScale) -> Self {
        Self { worst, best, open }
    }
}

impl Default for RatingScale {
    fn default() -> Self {
        Self::GRADES
    }
}

impl RatingScale {
    /// 1 (very poor) to 5 (excellent).
    pub const GRADES: Self = Self { worst: 1.0, best: 5.0, open: false };

    /// # Errors
    /// Ends that are not finite, or equal.
    pub fn new(worst: f64, best: f64) -> Result<Self, String> {
        if worst != best && (best - worst).is_finite() && (best - worst).abs() >= f64::MIN_POSITIVE {
            return Ok(Self { worst, best, open: false });
        }
        Err(format!("the scale has worst {worst} and best {best}; they must be finite and differ"))
    }

    /// The same ends, of which the worst is only where ratings ended.
    #[must_use]
    pub fn opened(self) -> Self {
        Self { open: true, ..self }
    }

    /// Whether it is that of grades, 1 to 5.
    pub fn is_grades(&self) -> bool {
        *self == Self::GRADES
    }

    /// The worst end.
    pub fn worst(self) -> f64 {
        self.worst
    }

    /// The best end.
    pub fn best(self) -> f64 {
        self.best
    }

    /// Whether the worst end is only where ratings ended.
    pub fn is_open(self) -> bool {
        self.open
    }

    /// The end with the smaller number.
    pub fn low(self) -> f64 {
        self.worst.min(self.best)
    }

    /// The end with the larger number.
    pub fn high(self) -> f64 {
        self.worst.max(self.best)
    }

    /// 1 where larger is better, -1 where larger is worse.
    pub fn direction(self) -> f64 {
        if self.best > self.worst { 1.0 } else { -1.0 }
    }

    /// What a grade is on this scale; negative where larger is worse.
    pub fn unit(self) -> f64 {
        (self.best - self.worst) / 4.0
    }

    /// A score of this scale as a grade, exactly 1 and 5 at its ends.
    pub fn grade(self, score: f64) -> f64 {
        if self.is_grades() { score } else { 1.0 + 4.0 * ((score - self.worst) / (self.best - self.worst)) }
    }

    /// A grade as a score of this scale.
    pub fn score(self, grade: f64) -> f64 {
        if self.is_grades() { grade } else { self.worst + (grade - 1.0) * self.unit() }
    }

    /// As [`RatingScale::score`], to 13 digits, which gives a decimal number back that became a grade.
    pub fn stated(self, grade: f64) -> f64 {
        if self.is_grades() {
            return grade;
        }
        let score = self.score(grade);
        // What is left of a zero by rounding is no digit.
        let score = if score.abs() < 1e-13 * (self.best - self.worst).abs() { 0.0 } else { score };
        format!("{score:.12e}").parse().unwrap_or(score)
    }

    /// A difference of grades as a difference of scores.
    pub fn difference(self, grades: f64) -> f64 {
        if self.is_grades() { grades } else { grades * self.unit() }
    }

    /// A width in grades as a width on this scale, at least 0.
    pub fn width(self, grades: f64) -> f64 {
        if self.is_grades() { grades } else { grades * self.unit().abs() }
    }

    /// The score, or the end that it lies beyond.
    pub fn clamp(self, score: f64) -> f64 {
        score.clamp(self.low(), self.high())
    }

    /// Whether a score lies on the scale, ends included.
    pub fn contains(self, score: f64) -> bool {
        self.low() <= score && score <= self.high()
    }

    /// Decimals that show a 400th of the scale: 2 for grades, 1 for 0 to 100.
    pub fn decimals(self) -> usize {
        (2.0 - (self.unit().abs() * (1.0 + 1e-12)).log10().floor()).clamp(0.0, 12.0) as usize
    }

    /// A score with as many decimals as tell on this scale.
    pub fn show(self, score: f64) -> String {
        format!("{score:.0$}", self.decimals())
    }
}

/// Such as `1 (very poor) to 5 (excellent)`, `0 (worst) to 100 (best)`.
impl fmt::Display for RatingScale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            scale if scale.is_grades() => f.write_str("1 (very poor) to 5 (excellent)"),
            Self { worst, best, open: false } => write!(f, "{worst} (worst) to {best} (best)"),
            Self { worst, best, open: true } => write!(f, "{worst} (worst rated) to {best} (best)"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(worst: f64, best: f64) -> RatingScale {
        RatingScale::new(worst, best).unwrap()
    }

    #[test]
    fn scores_become_grades_and_come_back() {
        for (scale, score, grade) in
            [(scale(0.0, 100.0), 75.0, 4.0), (scale(100.0, 0.0), 75.0, 2.0), (scale(-3.0, 1.0), -2.0, 2.0)]
        {
            assert_eq!((scale.grade(score), scale.score(grade)), (grade, score));
            assert_eq!([scale.worst(), scale.best()].map(|end| scale.grade(end)), [1.0, 5.0]);
        }
        let percent = scale(0.0, 100.0);
        assert!([82.0, 61.3, 0.1, 99.99, 33.333].iter().all(|&x| percent.stated(percent.grade(x)) == x));
        assert_eq!(scale(-1.0, 2.0).stated(scale(-1.0, 2.0).grade(0.0)), 0.0);
        // Grades are left as they are, to the last bit.
        assert_eq!(RatingScale::GRADES.grade(0.1 + 0.2), 0.1 + 0.2);
        assert_eq!((scale(100.0, 0.0).difference(0.1), scale(100.0, 0.0).width(0.1)), (-2.5, 2.5));
        assert_eq!((percent.clamp(101.0), percent.contains(100.0), percent.contains(-0.1)), (100.0, true, false));
        assert!(!percent.contains(f64::NAN));
    }

    #[test]
    fn scales_are_told_with_the_decimals_that_tell() {
        let decimals =
            [(1.0, 5.0), (0.0, 100.0), (0.0, 10.0), (1.0, 0.0), (0.0, 1000.0)].map(|(a, b)| scale(a, b).decimals());
        assert_eq!(decimals, [2, 1, 2, 3, 0]);
        assert_eq!(scale(0.0, 100.0).show(78.12), "78.1");
        assert_eq!(scale(1.0, 5.0).to_string(), "1 (very poor) to 5 (excellent)");
        assert_eq!(scale(100.0, 0.0).to_string(), "100 (worst) to 0 (best)");
        assert_eq!(scale(4.0, 10.0).opened().to_string(), "4 (worst rated) to 10 (best)");
    }

    #[test]
    fn files_hold_scales_that_are_some() {
        let read = |text: &str| serde_json::from_str::<RatingScale>(text).map_err(|e| e.to_string());
        assert_eq!(read(r#"{"worst":0,"best":100}"#).unwrap(), scale(0.0, 100.0));
        let open = scale(4.0, 10.0).opened();
        assert_eq!(read(&serde_json::to_string(&open).unwrap()).unwrap(), open);
        assert_eq!(serde_json::to_string(&scale(0.0, 100.0)).unwrap(), r#"{"worst":0.0,"best":100.0}"#);
        assert!(
            read(r#"{"worst":3,"best":3}"#).unwrap_err().contains("worst 3 and best 3; they must be finite and differ")
        );
        assert!(read(r#"{"worst":0,"best":1,"mid":2}"#).is_err());
        assert!(RatingScale::new(f64::NAN, 1.0).is_err() && RatingScale::new(0.0, f64::INFINITY).is_err());
        assert!(RatingScale::new(-1e308, 1e308).is_err());
    }
}
