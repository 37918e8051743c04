//! Whether two means differ: Welch's test of two samples and the paired test.
//!
//! * Welch: t = (ma - mb)/sqrt(va/na + vb/nb), degrees of freedom (va/na + vb/nb)^2 / ((va/na)^2/(na - 1) +
//!   (vb/nb)^2/(nb - 1)), m means, v sample variances, n numbers (Welch 1947, doi:10.1093/biomet/34.1-2.28);
//! * paired: t = md/sqrt(vd/n) of the differences, n - 1 degrees of freedom.
//!
//! p is two-sided; the 95 % interval of the difference is m +- t_.975 times the denominator. Cost: linear.

use super::distribution::{t_975, t_two_sided};
use super::error::{StudyError, at_least};
use super::moments::{Moments, negligible};
use serde::{Deserialize, Serialize};
use vernis_metric::math::quantile::Interval;

/// A difference between two means, first minus second.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TTest {
    /// Number of values in each sample.
    pub numbers: [usize; 2],
    /// Mean of each sample.
    pub means: [f64; 2],
    /// First mean minus second.
    pub difference: f64,
    /// 95 %, of the difference.
    pub interval: Interval,
    /// t of the test.
    pub t: f64,
    /// Degrees of freedom.
    pub freedom: f64,
    /// Two-sided.
    pub p: f64,
}

/// Welch's test: the samples are independent and their variances may differ.
pub fn welch(a: &[f64], b: &[f64]) -> Result<TTest, StudyError> {
    let what = "values in each sample of a t-test";
    let few = || StudyError::TooFew { what, found: a.len().min(b.len()), least: 2 };
    let (ma, mb) = (Moments::of(a).ok_or_else(few)?, Moments::of(b).ok_or_else(few)?);
    let (va, vb) = (ma.variance.ok_or_else(few)?, mb.variance.ok_or_else(few)?);
    let (na, nb) = (ma.n as f64, mb.n as f64);
    let (sa, sb) = (va / na, vb / nb);
    let freedom = (sa + sb).powi(2) / (sa * sa / (na - 1.0) + sb * sb / (nb - 1.0));
    finish([ma, mb], (sa + sb).sqrt(), freedom)
}

/// The paired test: `a[i]` and `b[i]` are of the same thing. The lists are equally long.
pub fn paired(a: &[f64], b: &[f64]) -> Result<TTest, StudyError> {
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    at_least("pairs of values in a t-test", differences.len(), 2)?;
    let n = differences.len();
    match (Moments::of(&a[..n]), Moments::of(&b[..n]), Moments::of(&differences).and_then(|m| m.variance)) {
        (Some(ma), Some(mb), Some(v)) => finish([ma, mb], (v / n as f64).sqrt(), n as f64 - 1.0),
        _ => Err(StudyError::NoSpread { what: "paired values" }),
    }
}

fn finish([a, b]: [Moments; 2], error: f64, freedom: f64) -> Result<TTest, StudyError> {
    let difference = a.mean - b.mean;
    let t = difference / error;
    let spread = !negligible(error * error, a.mean.abs().max(b.mean.abs()));
    let (true, Some(p), Some(width)) = (spread, t_two_sided(t, freedom), t_975(freedom)) else {
        return Err(StudyError::NoSpread { what: "the values" });
    };
    let interval = Interval { low: difference - width * error, high: difference + width * error };
    Ok(TTest { numbers: [a.n, b.n], means: [a.mean, b.mean], difference, interval, t, freedom, p })
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: [f64; 7] = [3.1, 4.2, 2.8, 3.9, 4.4, 3.3, 2.5];
    const B: [f64; 5] = [2.2, 2.9, 2.4, 3.0, 1.7];
    const C: [f64; 7] = [2.9, 4.3, 2.2, 3.1, 4.0, 3.6, 2.4];

    fn check(test: &TTest, expected: [f64; 5]) {
        let found = [test.t, test.freedom, test.p, test.interval.low, test.interval.high];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        assert!(test.interval.contains(test.difference));
    }

    #[test]
    fn tests_agree_with_scipy() {
        // scipy 1.17.1: r = stats.ttest_ind(A, B, equal_var=False); r.statistic, r.df, r.pvalue, r.confidence_interval(0.95)
        let expected =
            [2.807111841816682, 9.959876823521594, 0.01863463003896458, 0.2093468738092974, 1.8249388404764182];
        check(&welch(&A, &B).unwrap(), expected);
        // r = stats.ttest_rel(A, C)
        let expected = [1.6616697917502405, 6.0, 0.14764289807930958, -0.11476506580467982, 0.6004793515189656];
        check(&paired(&A, &C).unwrap(), expected);
    }

    #[test]
    fn a_true_difference_is_found_as_often_as_it_should() {
        // 400 pairs of samples from the same uniform distribution: 5 % of the tests find p < 0.05.
        use rand::Rng;
        let mut rng = vernis_metric::math::seed::stream(1, "t-test", 0);
        let mut draw = |n: usize, shift: f64| (0..n).map(|_| shift + rng.random_range(0.0..1.0)).collect::<Vec<_>>();
        let null = (0..400).filter(|_| welch(&draw(20, 0.0), &draw(35, 0.0)).unwrap().p < 0.05).count();
        // Binomial(400, 0.05): 10 to 32 with probability > 0.99.
        assert!((10..=32).contains(&null), "{null}");
        let covered =
            (0..400).filter(|_| welch(&draw(20, 0.3), &draw(35, 0.0)).unwrap().interval.contains(0.3)).count();
        assert!((368..=390).contains(&covered), "{covered}");
    }

    #[test]
    fn samples_without_spread_or_size_are_refused() {
        assert!(matches!(welch(&[1.0], &A), Err(StudyError::TooFew { found: 1, .. })));
        assert!(matches!(welch(&[2.0; 3], &[2.0; 4]), Err(StudyError::NoSpread { .. })));
        assert!(matches!(paired(&A, &A), Err(StudyError::NoSpread { .. })));
        // A shift that rounds a little differently in each pair is no noise.
        assert!(matches!(paired(&A.map(|a| a + 0.1), &A), Err(StudyError::NoSpread { .. })));
        assert!(matches!(paired(&[], &[]), Err(StudyError::TooFew { found: 0, .. })));
    }
}
