//! How much of the variance of scores is between stimuli: intra-class correlations.
//!
//! With n stimuli, k scores each, MSB and MSW the mean squares between and within stimuli:
//!
//! * one way, any raters: ICC(1,1) = (MSB - MSW)/(MSB + (k - 1) MSW), of the mean ICC(1,k) = (MSB - MSW)/MSB;
//! * two way, each of the k raters rated everything: ICC(2,1) = (MSR - MSE)/(MSR + (k - 1) MSE + k (MSC - MSE)/n), of
//!   the mean ICC(2,k) = (MSR - MSE)/(MSR + (MSC - MSE)/n), MSR, MSC, MSE the mean squares of stimuli, raters, rest.
//!
//! 95 % intervals from F distributions as in Shrout & Fleiss 1979 (doi:10.1037/0033-2909.86.2.420), whose numbering
//! this is. Where stimuli have different numbers of scores, k is (N - sum n_s^2/N)/(n - 1) in the one-way forms
//! (Donner 1986, doi:10.2307/1403259, 2.1), which makes their intervals approximate. Cost: linear.

use super::distribution::{f_975, f_upper};
use super::error::{StudyError, at_least};
use super::moments::{Moments, negligible};
use serde::{Deserialize, Serialize};
use vernis_metric::math::quantile::Interval;

/// A correlation, at most 1, with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Correlation {
    /// The correlation.
    pub value: f64,
    /// Its 95 % interval.
    pub interval: Interval,
}

/// The intra-class correlations of one model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Intraclass {
    /// Of one score: ICC(1,1) or ICC(2,1).
    pub single: Correlation,
    /// Of the mean of `raters` scores: ICC(1,k) or ICC(2,k).
    pub average: Correlation,
    /// k; an effective number where stimuli have different ones.
    pub raters: f64,
    /// Number of stimuli.
    pub stimuli: usize,
    /// Of the test that stimuli do not differ, with its degrees of freedom and probability.
    pub f: f64,
    /// Degrees of freedom of `f`: numerator, denominator.
    pub freedom: [f64; 2],
    /// Probability of so large an `f` if stimuli do not differ.
    pub p: f64,
}

fn no_spread() -> StudyError {
    StudyError::NoSpread { what: "the scores of a stimulus" }
}

/// ICC(1,1) and ICC(1,k) of the scores of each stimulus, whoever gave them. Stimuli without a score are left out.
pub fn one_way(scores: &[Vec<f64>]) -> Result<Intraclass, StudyError> {
    let groups: Vec<Moments> = scores.iter().filter_map(|s| Moments::of(s)).collect();
    at_least("stimuli for an intra-class correlation", groups.len(), 2)?;
    let total: usize = groups.iter().map(|g| g.n).sum();
    let (n, all) = (groups.len() as f64, total as f64);
    if total == groups.len() {
        return Err(StudyError::TooFew {
            what: "scores of a stimulus for an intra-class correlation",
            found: 1,
            least: 2,
        });
    }
    let mean = groups.iter().map(|g| g.n as f64 * g.mean).sum::<f64>() / all;
    let between = groups.iter().map(|g| g.n as f64 * (g.mean - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let within = groups.iter().map(|g| g.variance.unwrap_or(0.0) * (g.n as f64 - 1.0)).sum::<f64>() / (all - n);
    let k = (all - groups.iter().map(|g| (g.n * g.n) as f64).sum::<f64>() / all) / (n - 1.0);
    if negligible(within, mean) {
        return Err(no_spread());
    }
    let (f, freedom) = (between / within, [n - 1.0, all - n]);
    let p = f_upper(f, freedom[0], freedom[1]).ok_or_else(no_spread)?;
    let low = f / f_975(freedom[0], freedom[1]).ok_or_else(no_spread)?;
    let high = f * f_975(freedom[1], freedom[0]).ok_or_else(no_spread)?;
    let single = |f: f64| (f - 1.0) / (f + k - 1.0);
    let average = |f: f64| 1.0 - 1.0 / f;
    let of =
        |icc: &dyn Fn(f64) -> f64| Correlation { value: icc(f), interval: Interval { low: icc(low), high: icc(high) } };
    Ok(Intraclass { single: of(&single), average: of(&average), raters: k, stimuli: groups.len(), f, freedom, p })
}

/// ICC(2,1) and ICC(2,k) of a complete design: `scores[s][i]` is the score of rater i for stimulus s. Rows are equally
/// long.
pub fn two_way(scores: &[Vec<f64>]) -> Result<Intraclass, StudyError> {
    at_least("stimuli for an intra-class correlation", scores.len(), 2)?;
    let raters = scores.iter().map(Vec::len).min().unwrap_or(0);
    at_least("raters for an intra-class correlation", raters, 2)?;
    let (n, k) = (scores.len() as f64, raters as f64);
    let rows: Vec<f64> = scores.iter().map(|s| s.iter().sum::<f64>() / k).collect();
    let columns: Vec<f64> = (0..raters).map(|i| scores.iter().map(|s| s[i]).sum::<f64>() / n).collect();
    let mean = rows.iter().sum::<f64>() / n;
    let squares = |means: &[f64]| means.iter().map(|m| (m - mean).powi(2)).sum::<f64>();
    let msr = k * squares(&rows) / (n - 1.0);
    let msc = n * squares(&columns) / (k - 1.0);
    let rest = |(s, row): (&Vec<f64>, &f64)| -> f64 {
        s.iter().zip(&columns).map(|(x, column)| (x - row - column + mean).powi(2)).sum()
    };
    let mse = scores.iter().zip(&rows).map(rest).sum::<f64>() / ((n - 1.0) * (k - 1.0));
    if negligible(mse, mean) {
        return Err(no_spread());
    }
    let single = (msr - mse) / (msr + (k - 1.0) * mse + k * (msc - mse) / n);
    let (f, freedom) = (msr / mse, [n - 1.0, (n - 1.0) * (k - 1.0)]);
    let p = f_upper(f, freedom[0], freedom[1]).ok_or_else(no_spread)?;

    // Satterthwaite's degrees of freedom of the raters' and the residual variance together.
    let (a, b) = (k * single / (n * (1.0 - single)), 1.0 + k * single * (n - 1.0) / (n * (1.0 - single)));
    let v = (a * msc + b * mse).powi(2) / ((a * msc).powi(2) / (k - 1.0) + (b * mse).powi(2) / ((n - 1.0) * (k - 1.0)));
    let below = f_975(n - 1.0, v).ok_or_else(no_spread)?;
    let above = f_975(v, n - 1.0).ok_or_else(no_spread)?;
    let noise = k * msc + (k * n - k - n) * mse;
    let low = n * (msr - below * mse) / (below * noise + n * msr);
    let high = n * (above * msr - mse) / (noise + n * above * msr);
    let average = |icc: f64| k * icc / (1.0 + (k - 1.0) * icc);
    Ok(Intraclass {
        single: Correlation { value: single, interval: Interval { low, high } },
        average: Correlation { value: average(single), interval: Interval { low: average(low), high: average(high) } },
        raters: k,
        stimuli: scores.len(),
        f,
        freedom,
        p,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;
    use rand_chacha::ChaCha8Rng;
    use vernis_metric::math::seed;

    /// Table 2 of Shrout & Fleiss 1979: six targets, four judges.
    fn shrout_and_fleiss() -> Vec<Vec<f64>> {
        [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]]
            .map(|row| row.map(f64::from).to_vec())
            .to_vec()
    }

    fn check(found: &Correlation, expected: [f64; 3]) {
        for (found, expected) in [found.value, found.interval.low, found.interval.high].into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }

    #[test]
    fn correlations_agree_with_the_paper_and_pingouin() {
        // Table 4 of the paper: 0.17, 0.29 for single scores; 0.44, 0.62 for means of four. All digits: pingouin 0.7.0,
        // pingouin.intraclass_corr(long, "target", "judge", "score"), its rounding of the intervals off.
        let one = one_way(&shrout_and_fleiss()).unwrap();
        check(&one.single, [0.1657417684, -0.1329323249, 0.7225600623]);
        check(&one.average, [0.4427971337, -0.8844421552, 0.9124154203]);
        let two = two_way(&shrout_and_fleiss()).unwrap();
        check(&two.single, [0.2897637795, 0.0187865134, 0.7610843696]);
        check(&two.average, [0.6200505476, 0.0711368153, 0.9272320402]);
        assert_eq!((one.raters, one.freedom, two.freedom), (4.0, [5.0, 18.0], [5.0, 15.0]));
        assert!((one.p - 0.1647688083).abs() < 1e-6 && (two.p - 0.0001345665).abs() < 1e-6, "{} {}", one.p, two.p);
    }

    /// A sum of twelve uniform numbers: variance 1.
    fn normal(rng: &mut ChaCha8Rng) -> f64 {
        (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
    }

    /// Score = stimulus (variance 0.9) + rater (0.1) + noise (0.5).
    fn panel(stimuli: usize, raters: usize, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
        let of_raters: Vec<f64> = (0..raters).map(|_| 0.1f64.sqrt() * normal(rng)).collect();
        (0..stimuli)
            .map(|_| {
                let stimulus = 0.9f64.sqrt() * normal(rng);
                of_raters.iter().map(|r| stimulus + r + 0.5f64.sqrt() * normal(rng)).collect()
            })
            .collect()
    }

    #[test]
    fn true_variance_components_are_recovered() {
        let mut rng = seed::stream(1, "intraclass", 0);
        // One score: 0.9/(0.9 + 0.1 + 0.5) = 0.6; a mean of 30: 0.9/(0.9 + 0.6/30) = 0.9783.
        let covered = (0..200)
            .filter(|_| {
                let found = two_way(&panel(60, 30, &mut rng)).unwrap();
                found.single.interval.contains(0.6) && found.average.interval.contains(0.9 / 0.92)
            })
            .count();
        // Binomial(200, 0.95): 182 to 198 with probability > 0.99.
        assert!((182..=199).contains(&covered), "{covered}");
        let large = panel(3000, 30, &mut rng);
        assert!((two_way(&large).unwrap().single.value - 0.6).abs() < 0.03);
        // One way, raters are part of the noise; unequal numbers of scores change nothing but their effective number.
        let ragged: Vec<Vec<f64>> = large.iter().enumerate().map(|(i, s)| s[..26 + i % 5].to_vec()).collect();
        let one = one_way(&ragged).unwrap();
        assert!((one.single.value - 0.6).abs() < 0.03 && (one.raters - 28.0).abs() < 0.1, "{one:?}");
    }

    #[test]
    fn what_has_no_noise_or_no_size_is_refused() {
        assert!(matches!(one_way(&[vec![1.0, 1.0], vec![2.0, 2.0]]), Err(StudyError::NoSpread { .. })));
        assert!(matches!(one_way(&[vec![1.0], vec![2.0]]), Err(StudyError::TooFew { found: 1, .. })));
        // Raters who differ by a constant alone.
        assert!(matches!(two_way(&[vec![1.1, 2.1], vec![2.3, 3.3]]), Err(StudyError::NoSpread { .. })));
        assert!(matches!(two_way(&[vec![1.0], vec![2.0]]), Err(StudyError::TooFew { found: 1, .. })));
        assert!(matches!(two_way(&[vec![1.0, 2.0]]), Err(StudyError::TooFew { found: 1, .. })));
    }
}
