//! How the spread of opinions depends on their mean: the SOS hypothesis.
//!
//!   v_s = a (-x_s^2 + 6 x_s - 5) = a (x_s - 1)(5 - x_s),   a = sum v g / sum g^2
//!
//! x_s: MOS of stimulus s, a grade from 1 to 5 (on another scale a is the same, for both sides carry its unit squared); v_s:
//! sample variance of its scores; g = (x - 1)(5 - x); a from 0 (everybody
//! agrees) to 1 (only ends of the scale are used), by least squares through the origin. Source: Hossfeld, Schatz &
//! Egger 2011 (doi:10.1109/QoMEX.2011.6065690), equations 3 and 4. The noise of x_s biases a by about -a^2/n (n
//! scores a stimulus), which is left as it is. Cost: linear.

use super::error::{StudyError, at_least};
use serde::{Deserialize, Serialize};
use vernis_metric::math::quantile::Interval;
use vernis_metric::math::rating_scale::RatingScale;

/// The `a` that reproduces the published split-half agreement of Lavoue et al. 2021; stands in where a study has no
/// raw scores.
pub const ASSUMED_A: f64 = 0.20;
/// Raters of a stimulus that are assumed with it: 30.1 in that study's section 4.3.
pub const ASSUMED_RATERS: usize = 30;

/// Largest variance, but for a factor, of scores whose mean is `x`, 1 to 5.
pub fn parabola(x: f64) -> f64 {
    (x - 1.0) * (5.0 - x)
}

/// A fitted SOS curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SosFit {
    /// From 0 (everybody agrees) to 1 (only ends of the scale are used).
    pub a: f64,
    /// 95 %, by bootstrap of materials.
    pub interval: Option<Interval>,
    /// Root mean square difference between found and fitted standard deviations; in a record, on the study's scale.
    pub rmse: f64,
    /// Number of stimuli.
    pub stimuli: usize,
}

/// `a` of means and variances of which the i-th counts `counts[i]` times; `None` where every mean is an end of the
/// scale.
pub fn slope(means: &[f64], variances: &[f64], counts: &[u32]) -> Option<f64> {
    let (mut products, mut squares) = (0.0, 0.0);
    for ((&x, &v), &c) in means.iter().zip(variances).zip(counts) {
        let g = parabola(x);
        products += f64::from(c) * v * g;
        squares += f64::from(c) * g * g;
    }
    (squares > 0.0).then(|| products / squares)
}

/// Fits means (1 to 5) and sample variances by stimulus; the interval is left open.
pub fn fit(means: &[f64], variances: &[f64]) -> Result<SosFit, StudyError> {
    at_least("stimuli with at least 2 scores for an SOS fit", means.len(), 2)?;
    let a = slope(means, variances, &vec![1; means.len()]).ok_or(StudyError::NoSpread { what: "the scores" })?;
    let error = |(&x, &v): (&f64, &f64)| (v.sqrt() - (a * parabola(x)).sqrt()).powi(2);
    let rmse = (means.iter().zip(variances).map(error).sum::<f64>() / means.len() as f64).sqrt();
    Ok(SosFit { a, interval: None, rmse, stimuli: means.len() })
}

/// Such as `-x^2 + 6x - 5`: what the variance of scores with mean x is a part of, written so that it stands in parentheses.
pub fn formula(scale: RatingScale) -> String {
    if scale.is_grades() { "-x^2 + 6x - 5".to_owned() } else { format!("x - {})({} - x", scale.low(), scale.high()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::panel::moments::Moments;
    use rand::Rng;
    use vernis_metric::math::seed;

    #[test]
    fn the_slope_agrees_with_numpy() {
        // numpy 2.4.6: x = [1.5,2.2,3,4.1]; v = [0.4,0.5,0.9,0.6]; g = -x**2+6*x-5; numpy.linalg.lstsq(g[:,None], v)[0]
        let fit = fit(&[1.5, 2.2, 3.0, 4.1], &[0.4, 0.5, 0.9, 0.6]).unwrap();
        assert!((fit.a - 0.20070169550191164).abs() < 1e-14, "{}", fit.a);
    }

    #[test]
    fn the_true_a_is_recovered() {
        // Scores 1 + 4 K/m, K binomial(m, p), have variance (x - 1)(5 - x)/m: a = 1/m = 0.2.
        let (m, raters) = (5u8, 30);
        let mut rng = seed::stream(1, "sos", 0);
        let (mut means, mut variances) = (Vec::new(), Vec::new());
        for i in 0..2000 {
            let p = f64::from(i) / 2000.0;
            let mut score = || {
                let hits: u8 = (0..m).map(|_| u8::from(rng.random::<f64>() < p)).sum();
                1.0 + 4.0 * f64::from(hits) / f64::from(m)
            };
            let scores: Vec<f64> = (0..raters).map(|_| score()).collect();
            let moments = Moments::of(&scores).unwrap();
            means.push(moments.mean);
            variances.push(moments.variance.unwrap());
        }
        let found = fit(&means, &variances).unwrap();
        // 2,000 variances of 30 scores, each with a relative error of about 0.26: a to 0.2 * 0.26/sqrt 2000 * 1.1 = 0.0013.
        assert!((found.a - 0.2).abs() < 0.004, "{found:?}");
        assert!(found.rmse < 0.15, "{found:?}");
    }

    #[test]
    fn nothing_can_be_fitted_to_the_ends_of_the_scale() {
        assert!(matches!(fit(&[1.0, 5.0], &[0.0, 0.0]), Err(StudyError::NoSpread { .. })));
        assert!(matches!(fit(&[3.0], &[0.5]), Err(StudyError::TooFew { found: 1, .. })));
    }
}
