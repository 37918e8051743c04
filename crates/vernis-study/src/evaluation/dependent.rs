//! The difference between two correlations with the same ratings, by closed formulas: a cross-check of the bootstrap.
//!
//! With r_a, r_b the correlations of two metrics with the ratings, r_ab that between the metrics, n rows:
//!
//! * interval (Zou 2007, doi:10.1037/1082-989X.12.4.399, overlapping correlations):
//!   low = d - sqrt((r_a - l_a)^2 + (u_b - r_b)^2 - 2 c (r_a - l_a)(u_b - r_b)), high likewise with l and u swapped,
//!   where d = r_a - r_b, l and u are the limits of each correlation by Fisher's z at 95 %, and
//!   c = ((r_ab - r_a r_b / 2)(1 - r_a^2 - r_b^2 - r_ab^2) + r_ab^3) / ((1 - r_a^2)(1 - r_b^2));
//! * test (Steiger 1980, doi:10.1037/0033-2909.87.2.245, equation 14): z = (atanh r_a - atanh r_b)
//!   sqrt((n - 3) / (2 - 2 s)), s the correlation of the two estimates at the mean of r_a and r_b.
//!
//! Both take the rows for independent, which ratings of one material are not: expect them narrower than the
//! bootstrap. For rank correlations they are approximations. Cost: constant.

use super::bootstrap::Interval;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_1_SQRT_2;
use vernis_metric::math::erf::erfc;

/// The 97.5 % quantile of the normal distribution.
const Z_95: f64 = 1.959963984540054;

/// Zou's interval and Steiger's test of one difference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DependentCorrelations {
    /// 95 % interval of r_a - r_b.
    pub zou: Interval,
    /// z of Steiger's test.
    pub steiger_z: f64,
    /// Two-sided.
    pub steiger_p: f64,
}

impl DependentCorrelations {
    /// Compares `r_a` with `r_b`, given `r_ab` and the number of rows; `None` where a correlation is +-1 or undefined
    /// or n < 4, for which neither formula is defined.
    pub fn compare(r_a: f64, r_b: f64, r_ab: f64, n: usize) -> Option<Self> {
        if n < 4 || ![r_a, r_b, r_ab].iter().all(|r| r.abs() < 1.0) {
            return None;
        }
        let spread = ((n - 3) as f64).sqrt();
        let fisher = |r: f64, sign: f64| (r.atanh() + sign * Z_95 / spread).tanh();
        let (va, vb) = (1.0 - r_a * r_a, 1.0 - r_b * r_b);
        let c = ((r_ab - 0.5 * r_a * r_b) * (1.0 - r_a * r_a - r_b * r_b - r_ab * r_ab) + r_ab.powi(3)) / (va * vb);
        // Correlations that no data can have together would make the root imaginary.
        let root = |p: f64, q: f64| (p * p + q * q - 2.0 * c * p * q).max(0.0).sqrt();
        let d = r_a - r_b;
        let low = d - root(r_a - fisher(r_a, -1.0), fisher(r_b, 1.0) - r_b);
        let high = d + root(fisher(r_a, 1.0) - r_a, r_b - fisher(r_b, -1.0));
        let mean2 = (0.5 * (r_a + r_b)).powi(2);
        let s = (r_ab * (1.0 - 2.0 * mean2) - 0.5 * mean2 * (1.0 - 2.0 * mean2 - r_ab * r_ab)) / (1.0 - mean2).powi(2);
        let steiger_z = (r_a.atanh() - r_b.atanh()) * spread / (2.0 - 2.0 * s).sqrt();
        steiger_z.is_finite().then(|| Self {
            zou: Interval { low, high },
            steiger_z,
            steiger_p: two_sided_normal_tail(steiger_z),
        })
    }
}

/// P(|Z| >= |z|) for a standard normal Z: erfc(|z|/sqrt 2), Abramowitz & Stegun 1964, 26.2.29.
fn two_sided_normal_tail(z: f64) -> f64 {
    // At 0 erfc may exceed 1 by its rounding.
    erfc(z.abs() * FRAC_1_SQRT_2).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_zou_2007() {
        // The paper's worked example of overlapping correlations: 0.396, 0.179, 0.088, n = 66 gives (-0.093, 0.517). The
        // digits beyond are the paper's formula in numpy 2.
        let found = DependentCorrelations::compare(0.396, 0.179, 0.088, 66).unwrap();
        assert!((found.zou.low - -0.09290192167481043).abs() < 1e-12, "{found:?}");
        assert!((found.zou.high - 0.5167599724816172).abs() < 1e-12, "{found:?}");
        // Steiger's formula in numpy, the tail by 2 scipy.stats.norm.sf (SciPy 1.17.1)
        assert!((found.steiger_z - 1.3677728634741075).abs() < 1e-12);
        assert!((found.steiger_p - 0.1713831843513537).abs() < 1e-12);
        let found = DependentCorrelations::compare(0.9, 0.77, 0.8, 474).unwrap();
        assert!((found.steiger_p / 2.349536663474299e-22 - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_normal_tail_agrees_with_scipy() {
        // SciPy 1.17.1: 2 stats.norm.sf(z)
        for (z, expected) in [
            (0.0, 1.0),
            (0.1, 0.920344325445942),
            (1.5, 0.13361440253771614),
            (1.96, 0.04999579029644087),
            (2.5, 0.012419330651552265),
            (3.0, 0.0026997960632601866),
            (-4.0, 6.334248366623973e-05),
            (10.0, 1.523970604832094e-23),
        ] {
            let found = two_sided_normal_tail(z);
            assert!((found / expected - 1.0).abs() < 1e-11, "{z}: {found}");
        }
    }

    #[test]
    fn perfect_or_missing_correlations_have_no_comparison() {
        assert_eq!(DependentCorrelations::compare(1.0, 0.5, 0.5, 100), None);
        assert_eq!(DependentCorrelations::compare(0.6, 0.5, 1.0, 100), None);
        assert_eq!(DependentCorrelations::compare(0.6, f64::NAN, 0.5, 100), None);
        assert_eq!(DependentCorrelations::compare(0.6, 0.5, 0.5, 3), None);
    }
}
