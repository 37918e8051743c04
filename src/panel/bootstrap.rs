//! How sure a statistic of ratings is: the bootstrap over groups of materials.
//!
//! The ratings of one material hang together, so whole groups (a material with its sisters) are drawn with replacement,
//! as many as there are; the interval holds the central 95 % of the resampled statistic (Efron & Tibshirani 1993,
//! doi:10.1201/9780429246593, 13.3). Drawing rows instead would make it too narrow. Cost: resamples x statistic, in
//! parallel, the same bytes whatever the number of threads.

use super::error::{StudyError, at_least};
use rand::Rng;
use rayon::prelude::*;
use std::collections::BTreeMap;
use vernis_metric::math::quantile::Interval;
use vernis_metric::math::seed;

/// Fewer resamples have no 2.5 % tail to speak of.
pub const MIN_RESAMPLES: usize = 40;

/// How often each row stands in each resample.
#[derive(Debug, Clone)]
pub struct Resamples {
    counts: Vec<Vec<u32>>,
}

impl Resamples {
    /// Draws from rows of which the i-th belongs to `groups[i]`.
    pub fn draw(groups: &[&str], resamples: usize, seed: u64) -> Result<Self, StudyError> {
        at_least("resamples of a bootstrap", resamples, MIN_RESAMPLES)?;
        let mut rows: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (row, group) in groups.iter().enumerate() {
            rows.entry(group).or_default().push(row);
        }
        let rows: Vec<Vec<usize>> = rows.into_values().collect();
        at_least("groups of materials in a bootstrap", rows.len(), 2)?;
        let draw = |index| {
            let mut rng = seed::stream(seed, "study-bootstrap", index as u64);
            let mut counts = vec![0; groups.len()];
            for _ in 0..rows.len() {
                for &row in &rows[rng.random_range(0..rows.len())] {
                    counts[row] += 1;
                }
            }
            counts
        };
        Ok(Self { counts: (0..resamples).into_par_iter().map(draw).collect() })
    }

    /// The interval of `statistic`, which takes how often each row counts. `None` where fewer than half of the
    /// resamples have the statistic.
    pub fn interval(&self, statistic: impl Fn(&[u32]) -> Option<f64> + Sync) -> Option<Interval> {
        let found: Vec<f64> = self.counts.par_iter().filter_map(|counts| statistic(counts)).collect();
        if 2 * found.len() < self.counts.len() { None } else { Interval::percentile(found) }
    }
}

/// Mean of the values of which the i-th counts `counts[i]` times, over the rows at `rows`.
pub fn mean(values: &[f64], rows: &[usize], counts: &[u32]) -> Option<f64> {
    let n: u32 = rows.iter().map(|&r| counts[r]).sum();
    let sum: f64 = rows.iter().map(|&r| f64::from(counts[r]) * values[r]).sum();
    (n > 0).then(|| sum / f64::from(n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_of_a_mean_cover_the_truth_although_rows_hang_together() {
        // 40 groups of 5 rows that share most of their deviation from 3.
        let names: Vec<String> = (0..200).map(|i| format!("m{}", i / 5)).collect();
        let groups: Vec<&str> = names.iter().map(String::as_str).collect();
        let all: Vec<usize> = (0..200).collect();
        let mut rng = seed::stream(2, "bootstrap", 0);
        let covered = (0..100)
            .filter(|&i| {
                let shared: Vec<f64> = (0..40).map(|_| rng.random_range(-1.0..1.0)).collect();
                let values: Vec<f64> = (0..200).map(|r| 3.0 + shared[r / 5] + rng.random_range(-0.3..0.3)).collect();
                let resamples = Resamples::draw(&groups, 200, i).unwrap();
                resamples.interval(|counts| mean(&values, &all, counts)).unwrap().contains(3.0)
            })
            .count();
        // Binomial(100, .94): 86 to 99 with probability > .99. Drawing rows covers about 65.
        assert!((86..=100).contains(&covered), "{covered}");
    }

    #[test]
    fn one_group_cannot_be_resampled() {
        assert!(matches!(Resamples::draw(&["a"; 5], 100, 0), Err(StudyError::TooFew { found: 1, .. })));
        assert!(matches!(Resamples::draw(&["a", "b"], 3, 0), Err(StudyError::TooFew { found: 3, .. })));
        // A statistic that hardly any resample has.
        let resamples = Resamples::draw(&["a", "b"], 100, 0).unwrap();
        assert_eq!(resamples.interval(|counts| (counts[0] == 2).then_some(1.0)), None);
    }
}
