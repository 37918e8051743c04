//! Moduli, roots and agreements without kinks, each with its derivative: what descriptors of version 2 are made of.
//!
//!   soft modulus     |x|        ->  sqrt(|x|^2 + d^2) - d            x a number or a vector
//!   soft 4th root    S^(1/4)    ->  (S + d^4)^(1/4) - d              S a mean of fourth powers
//!   soft product     s_A s_B    ->  p q - 1,  p = sqrt(s_A^2 + 1),  q = sqrt(s_B^2 + 1)
//!
//! d is where the kink is rounded off, in the unit of x; with d = 0 these are the plain forms, and the derivative at 0 is taken as 0.
//! Every form is written so that it is exactly 0 where x is 0 or the two sides are equal.
//!
//! Agreement of two pictures: with v the variance of their difference, the covariance is (s_A^2 + s_B^2 - v) / 2, hence
//!
//!   1 - (cov + c) / (p q - 1 + c) = (v - (p - q)^2) / (2 (p q - 1 + c)),
//!
//! never negative, as sqrt(s^2 + 1) changes no faster than s. The constant c and the two terms, structure and contrast, are those
//! of SSIM (Wang et al. 2004, doi:10.1109/TIP.2003.819861, eqs. 9 and 10).

/// sqrt(x^2 + d^2) - d, from the square of x.
pub(super) fn soft(square: f64, d: f64) -> f64 {
    // x^2 / (sqrt(x^2 + d^2) + d) is the same without cancellation.
    if square == 0.0 { 0.0 } else { square / ((square + d * d).sqrt() + d) }
}

/// The derivative of [`soft`] by a component of x is that component times this.
pub(super) fn soft_slope(square: f64, d: f64) -> f64 {
    let root = (square + d * d).sqrt();
    if root > 0.0 { 1.0 / root } else { 0.0 }
}

/// (S + d^4)^(1/4) - d.
pub(super) fn soft_fourth_root(fourth: f64, d: f64) -> f64 {
    if fourth == 0.0 {
        return 0.0;
    }
    let root = (fourth + d.powi(4)).sqrt();
    fourth / ((root.sqrt() + d) * (root + d * d))
}

/// Derivative of [`soft_fourth_root`] by S.
pub(super) fn soft_fourth_root_slope(fourth: f64, d: f64) -> f64 {
    let sum = fourth + d.powi(4);
    if sum > 0.0 { 0.25 / (sum.sqrt() * sum.sqrt().sqrt()) } else { 0.0 }
}

/// sqrt(variance + 1), the p or q of the header.
pub(super) fn spread(variance: f64) -> f64 {
    (variance + 1.0).sqrt()
}

/// 1 - (cov + c) / (p q - 1 + c), from the variance of the difference.
pub(super) fn disagreement(p: f64, q: f64, of_difference: f64, c: f64) -> f64 {
    0.5 * (of_difference - (p - q) * (p - q)) / (p * q - 1.0 + c)
}

/// Derivatives of [`disagreement`] by the candidate's variance (q^2 - 1) and by the variance of the difference.
pub(super) fn disagreement_slopes(p: f64, q: f64, of_difference: f64, c: f64) -> [f64; 2] {
    let below = p * q - 1.0 + c;
    let by_q = (p - q - disagreement(p, q, of_difference, c) * p) / below;
    [0.5 * by_q / q, 0.5 / below]
}

/// 1 - (2 (p q - 1) + c) / (s_A^2 + s_B^2 + c) = (p - q)^2 / (p^2 + q^2 - 2 + c).
pub(super) fn contrast(p: f64, q: f64, c: f64) -> f64 {
    (p - q) * (p - q) / (p * p + q * q - 2.0 + c)
}

/// Derivative of [`contrast`] by the candidate's variance (q^2 - 1).
pub(super) fn contrast_slope(p: f64, q: f64, c: f64) -> f64 {
    ((q - p) / q - contrast(p, q, c)) / (p * p + q * q - 2.0 + c)
}

/// sum w x.
pub(super) fn weighted_mean(weights: &[f64], values: impl Iterator<Item = f64>) -> f64 {
    weights.iter().zip(values).map(|(w, v)| w * v).sum()
}

/// Plain mean; 0 of nothing.
pub(super) fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len().max(1) as f64;
    values.sum::<f64>() / n
}

#[cfg(test)]
mod tests {
    use super::*;

    fn central(f: impl Fn(f64) -> f64, x: f64) -> f64 {
        let h = 1e-5 * x.abs().max(1e-3);
        (f(x + h) - f(x - h)) / (2.0 * h)
    }

    #[test]
    fn slopes_are_those_of_central_differences() {
        let same = |found: f64, expected: f64| {
            assert!((found - expected).abs() < 1e-7 * expected.abs().max(1e-3), "{found} {expected}");
        };
        for d in [0.0, 0.02, 0.5] {
            for x in [-3.0, 0.1, 40.0] {
                same(x * soft_slope(x * x, d), central(|x| soft(x * x, d), x));
                let fourth = f64::powi(x, 4);
                same(soft_fourth_root_slope(fourth, d), central(|s| soft_fourth_root(s, d), fourth));
            }
        }
        for (p, q, v) in [(1.0, 3.0, 5.0), (4.0, 2.0, 9.0), (2.0, 2.0, 0.5)] {
            let [by_b, by_v] = disagreement_slopes(p, q, v, 9.0);
            same(by_b, central(|b| disagreement(p, spread(b), v, 9.0), q * q - 1.0));
            same(by_v, central(|v| disagreement(p, q, v, 9.0), v));
            same(contrast_slope(p, q, 9.0), central(|b| contrast(p, spread(b), 9.0), q * q - 1.0));
        }
    }

    #[test]
    fn forms_are_exactly_zero_where_nothing_differs_and_plain_far_away() {
        assert_eq!((soft(0.0, 0.5), soft(0.0, 0.0), soft_slope(0.0, 0.0)), (0.0, 0.0, 0.0));
        assert_eq!((soft_fourth_root(0.0, 0.5), soft_fourth_root_slope(0.0, 0.0)), (0.0, 0.0));
        let p = spread(7.3);
        assert_eq!((disagreement(p, p, 0.0, 9.0), contrast(p, p, 9.0)), (0.0, 0.0));
        assert!((soft(1e4, 0.5) - 99.5).abs() < 2e-3 && (soft_fourth_root(1e8, 0.5) - 99.5).abs() < 1e-6);
        assert_eq!((soft(9.0, 0.0), soft_fourth_root(81.0, 0.0)), (3.0, 3.0));
    }

    #[test]
    fn agreement_is_that_of_the_definition() {
        // s_A^2 = 8, s_B^2 = 3, cov = 2: v = 7, p q = 6.
        assert!((disagreement(3.0, 2.0, 7.0, 9.0) - (1.0 - 11.0 / 14.0)).abs() < 1e-12);
        assert!((contrast(3.0, 2.0, 9.0) - (1.0 - 19.0 / 20.0)).abs() < 1e-12);
    }
}
