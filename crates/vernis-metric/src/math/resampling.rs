//! Resamples of rows that hang together: the bootstrap over groups.
//!
//! Rows of one group (the ratings of a material and its sisters) share much of their deviation from the mean, so whole
//! groups are drawn with replacement, as many as there are; drawing rows would make intervals too narrow. Source: Davison &
//! Hinkley 1997, doi:10.1017/CBO9780511802843, 3.8; percentile intervals: Efron & Tibshirani 1993,
//! doi:10.1201/9780429246593, 13.3. Cost: resamples x statistic, in parallel, the same bytes whatever the number of
//! threads: every resample has a random stream of its own.

use super::parallel;
use super::quantile::Interval;
use super::seed;
use rand::Rng;
use std::collections::BTreeMap;
use thiserror::Error;

/// Fewer resamples have no 2.5 % tail to speak of.
pub const MIN_RESAMPLES: usize = 40;

/// Why nothing can be drawn.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum ResamplingError {
    #[error("the number of {what} is {found}; it must be at least {least}")]
    TooFew { what: &'static str, found: usize, least: usize },
}

/// The rows of each name, in the order of the names; the i-th of `names` is that of row i.
pub fn rows_by_name<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<Vec<usize>> {
    let mut rows: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (row, name) in names.into_iter().enumerate() {
        rows.entry(name).or_default().push(row);
    }
    rows.into_values().collect()
}

/// `n` places below `n`, drawn with replacement: resample number `index` of the stream `label`.
pub fn places(n: usize, seed: u64, label: &str, index: u64) -> impl Iterator<Item = usize> {
    let mut rng = seed::stream(seed, label, index);
    (0..n).map(move |_| rng.random_range(0..n))
}

/// How often each row stands in each resample.
#[derive(Debug, Clone)]
pub struct Resamples {
    counts: Vec<Vec<u32>>,
}

impl Resamples {
    /// Draws from `groups`, lists of rows that together hold each of 0 .. rows once. Resamples of another `label` are
    /// independent of these.
    ///
    /// # Errors
    /// Fewer than [`MIN_RESAMPLES`] resamples or than two groups.
    pub fn draw(groups: &[Vec<usize>], resamples: usize, seed: u64, label: &str) -> Result<Self, ResamplingError> {
        at_least("resamples of a bootstrap", resamples, MIN_RESAMPLES)?;
        at_least("groups of materials in a bootstrap", groups.len(), 2)?;
        let rows = groups.iter().map(Vec::len).sum();
        let draw = |index: usize| {
            let mut counts = vec![0; rows];
            for group in places(groups.len(), seed, label, index as u64) {
                groups[group].iter().for_each(|&row| counts[row] += 1);
            }
            counts
        };
        Ok(Self { counts: parallel::map(resamples, draw) })
    }

    /// How often each row counts, resample by resample.
    pub fn counts(&self) -> &[Vec<u32>] {
        &self.counts
    }

    /// The interval of `statistic`, which takes how often each row counts. `None` where fewer than half of the
    /// resamples have the statistic.
    pub fn interval(&self, statistic: impl Fn(&[u32]) -> Option<f64> + Sync) -> Option<Interval> {
        let found = parallel::map(self.counts.len(), |k| statistic(&self.counts[k]));
        let found: Vec<f64> = found.into_iter().flatten().collect();
        if 2 * found.len() < self.counts.len() { None } else { Interval::percentile(found) }
    }
}

fn at_least(what: &'static str, found: usize, least: usize) -> Result<(), ResamplingError> {
    if found < least { Err(ResamplingError::TooFew { what, found, least }) } else { Ok(()) }
}

/// Mean of the values of which the i-th counts `counts[i]` times, over the rows at `rows`; `None` where none counts.
pub fn mean(values: &[f64], rows: &[usize], counts: &[u32]) -> Option<f64> {
    let n: u32 = rows.iter().map(|&r| counts[r]).sum();
    let sum: f64 = rows.iter().map(|&r| f64::from(counts[r]) * values[r]).sum();
    (n > 0).then(|| sum / f64::from(n))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `groups` of `size` rows each.
    fn blocks(groups: usize, size: usize) -> Vec<Vec<usize>> {
        (0..groups).map(|g| (g * size..(g + 1) * size).collect()).collect()
    }

    #[test]
    fn rows_are_found_by_name() {
        assert_eq!(rows_by_name(["b", "a", "b", "c", "a"]), [vec![1, 4], vec![0, 2], vec![3]]);
    }

    #[test]
    fn whole_groups_are_drawn_and_every_label_draws_its_own() {
        let groups = blocks(12, 4);
        let drawn = Resamples::draw(&groups, 100, 7, "a").unwrap();
        assert_eq!(drawn.counts().len(), 100);
        for counts in drawn.counts() {
            assert_eq!(counts.iter().sum::<u32>(), 48);
            assert!(groups.iter().all(|rows| rows.iter().all(|&r| counts[r] == counts[rows[0]])));
        }
        assert!(drawn.counts().windows(2).any(|pair| pair[0] != pair[1]));
        assert_eq!(Resamples::draw(&groups, 100, 7, "a").unwrap().counts(), drawn.counts());
        assert_ne!(Resamples::draw(&groups, 100, 7, "b").unwrap().counts(), drawn.counts());
    }

    /// Records hold intervals of these draws: another generator or order would change them all.
    #[test]
    fn draws_stay_what_they_were() {
        let draw = |label| places(8, 1, label, 3).collect::<Vec<_>>();
        assert_eq!(draw("material-bootstrap"), [0, 1, 4, 2, 4, 5, 3, 6]);
        assert_eq!(draw("study-bootstrap"), [2, 4, 5, 1, 3, 5, 7, 7]);
    }

    #[test]
    fn intervals_of_a_mean_cover_the_truth_although_rows_hang_together() {
        // 40 groups of 5 rows that share most of their deviation from 3.
        let groups = blocks(40, 5);
        let all: Vec<usize> = (0..200).collect();
        let mut rng = seed::stream(2, "bootstrap", 0);
        let covered = (0..100)
            .filter(|&i| {
                let shared: Vec<f64> = (0..40).map(|_| rng.random_range(-1.0..1.0)).collect();
                let values: Vec<f64> = (0..200).map(|r| 3.0 + shared[r / 5] + rng.random_range(-0.3..0.3)).collect();
                let resamples = Resamples::draw(&groups, 200, i, "study-bootstrap").unwrap();
                resamples.interval(|counts| mean(&values, &all, counts)).unwrap().contains(3.0)
            })
            .count();
        // Binomial(100, 0.94): 86 to 99 with probability > 0.99. Drawing rows covers about 65.
        assert!((86..=100).contains(&covered), "{covered}");
    }

    #[test]
    fn what_cannot_be_resampled_is_refused() {
        let error = Resamples::draw(&blocks(1, 5), 100, 0, "a").unwrap_err().to_string();
        assert_eq!(error, "the number of groups of materials in a bootstrap is 1; it must be at least 2");
        let error = Resamples::draw(&blocks(2, 1), 3, 0, "a").unwrap_err().to_string();
        assert_eq!(error, "the number of resamples of a bootstrap is 3; it must be at least 40");
        // A statistic that hardly any resample has.
        let resamples = Resamples::draw(&blocks(2, 1), 100, 0, "a").unwrap();
        assert_eq!(resamples.interval(|counts| (counts[0] == 2).then_some(1.0)), None);
    }
}
