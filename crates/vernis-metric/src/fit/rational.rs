//! Rational functions by quadratic programming: through an interval at every sample.
//!
//! With P = sum p_i b_i, Q = sum q_j b_j and the intervals [l, u] around the values of one channel,
//!
//!   min |(p, q)|^2  subject to  u Q - P >= |row|,  P - l Q >= |row|,
//!
//! |row| the length of the row of coefficients: the shortest vector whose P/Q stays inside every interval with a margin. Q is
//! positive at all samples, for u > l. The intervals are f -+ t (f + 0.001 1/sr); t is the smallest of [`WIDTHS`] that has a
//! solution, channel by channel. Sharp lobes have none at any width: then the fit is infeasible, which is a result
//! ([`FitError::Infeasible`]).
//!
//! f: the reference, mean over phi_d, at 32 half angles theta_h = 90 ((k + 1/2)/32)^2 degrees and 12 difference angles up to
//! 78 degrees; b: the basis of [`Rational`].
//! Source: Pacanowski et al. 2012, section 4, doi:10.1109/TVCG.2012.73. Differences: they widen the intervals by hand and add
//! coefficients until there is a solution; here the number of coefficients is the model's. Cost: three or more quadratic
//! programmes of NP + NQ unknowns and 700 inequalities, 10 ms each.

use super::FitError;
use super::least_distance;
use crate::brdf::Brdf;
use crate::brdf::models::{AnalyticBrdf, Basis, DifferentiableBrdf, Rational, schema};
use crate::math::coordinates::{HalfDifference, half_difference_directions};
use crate::math::{Rgb, Vec3};
use crate::metric::{MetricError, Side};
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

/// Half-widths of the intervals that are tried, relative to the value.
pub const WIDTHS: [f64; 9] = [0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 0.9];
/// Added to a value before the width is taken, 1/sr.
const FLOOR: f64 = 1e-3;
/// That of the model itself.
const LARGEST_VALUE: f64 = 1e9;
const HALF_ANGLES: usize = 32;
const DIFFERENCE_ANGLES: usize = 12;
const LAST_DIFFERENCE_ANGLE: f64 = 78.0;
const AZIMUTHS: usize = 16;

/// Mean value of the reference at one pair of angles, and directions that have them.
struct Sample {
    wi: Vec3,
    wo: Vec3,
    value: Rgb,
}

/// The rational function `model` (see [`schema`]) of `reference`.
///
/// # Errors
/// [`FitError::Infeasible`]; [`MetricError::NoValidCell`] for a reference without measurements; an unknown model.
pub fn fit(model: &str, reference: &dyn Brdf) -> Result<Arc<dyn AnalyticBrdf>, FitError> {
    let schema = schema(model).map_err(FitError::from_model)?;
    let count = |letter: char| schema.iter().filter(|p| p.name.starts_with(letter)).count() / 3;
    let (numerators, denominators) = (count('p'), count('q') + 1);
    let basis = if model.starts_with("rational-legendre") { Basis::Legendre } else { Basis::Chebyshev };
    let samples = samples(reference)?;
    let bases = basis_values(basis, numerators.max(denominators), &samples)?;
    let (mut p, mut q) = (vec![[0.0; 3]; numerators], vec![[0.0; 3]; denominators - 1]);
    for c in 0..3 {
        let values: Vec<f64> = samples.iter().map(|s| s.value[c]).collect();
        let solve = |width: &f64| channel(&values, &bases, numerators, denominators, *width);
        let solution = WIDTHS.iter().find_map(solve).ok_or_else(|| FitError::Infeasible {
            model: model.to_owned(),
            channel: ["red", "green", "blue"][c],
            width: WIDTHS[WIDTHS.len() - 1],
        })?;
        // q_0 is 1 by definition of the model.
        let q_0 = solution[numerators];
        (0..numerators).for_each(|k| p[k][c] = solution[k] / q_0);
        (1..denominators).for_each(|k| q[k - 1][c] = solution[numerators + k] / q_0);
    }
    Ok(Arc::new(Rational::new(basis, p, q).map_err(FitError::Model)?))
}

fn samples(reference: &dyn Brdf) -> Result<Vec<Sample>, FitError> {
    let mut all = Vec::new();
    for i in 0..HALF_ANGLES {
        let theta_h = ((i as f64 + 0.5) / HALF_ANGLES as f64).powi(2) * FRAC_PI_2;
        for j in 0..DIFFERENCE_ANGLES {
            let theta_d = ((j as f64 + 0.5) / DIFFERENCE_ANGLES as f64 * LAST_DIFFERENCE_ANGLE).to_radians();
            let at = |k: usize| {
                let phi_d = (k as f64 + 0.5) / AZIMUTHS as f64 * PI;
                half_difference_directions(HalfDifference { theta_h, theta_d, phi_d })
            };
            // Towards the horizon there is little light and much noise.
            let visible = |(wi, wo): &(Vec3, Vec3)| wi.z > 0.1 && wo.z > 0.1;
            let found: Vec<_> = (0..AZIMUTHS)
                .map(at)
                .filter(visible)
                .filter_map(|(wi, wo)| reference.eval(wi, wo).map(|value| (wi, wo, value.map(|v| v.max(0.0)))))
                .collect();
            if let Some((.., value)) = found.iter().find(|f| f.2.iter().any(|v| !v.is_finite() || *v > LARGEST_VALUE)) {
                let reason =
                    format!("a value is {value:?}; it must be at most {LARGEST_VALUE:e} for a rational function");
                return Err(MetricError::Unusable { side: Side::Reference, reason }.into());
            }
            let Some(&(wi, wo, _)) = found.first() else { continue };
            let mean = |c: usize| found.iter().map(|f| f.2[c]).sum::<f64>() / found.len() as f64;
            all.push(Sample { wi, wo, value: [0, 1, 2].map(mean) });
        }
    }
    if all.is_empty() { Err(MetricError::NoValidCell { side: Side::Reference }.into()) } else { Ok(all) }
}

/// b_k at each sample: the derivatives of P/Q by the coefficients of P where Q = 1.
fn basis_values(basis: Basis, count: usize, samples: &[Sample]) -> Result<Vec<Vec<f64>>, FitError> {
    let mut p = vec![[0.0; 3]; count];
    p[0] = [1.0; 3];
    let one = Rational::new(basis, p, Vec::new()).map_err(FitError::Model)?;
    let mut d = vec![[0.0; 3]; 3 * count];
    let values = |s: &Sample| {
        one.value_and_gradient(s.wi, s.wo, &mut d);
        (0..count).map(|k| d[3 * k][0]).collect()
    };
    Ok(samples.iter().map(values).collect())
}

/// p and q of one channel, q_0 among them, if there are any.
fn channel(values: &[f64], bases: &[Vec<f64>], numerators: usize, denominators: usize, width: f64) -> Option<Vec<f64>> {
    let mut rows = Vec::with_capacity(2 * values.len());
    for (value, basis) in values.iter().zip(bases) {
        let half = width * (value + FLOOR);
        let (low, high) = ((value - half).max(0.0), value + half);
        for (sign, bound) in [(-1.0, high), (1.0, low)] {
            let p = basis[..numerators].iter().map(|b| sign * b);
            let q = basis[..denominators].iter().map(|b| -sign * bound * b);
            let row: Vec<f64> = p.chain(q).collect();
            let length = row.iter().map(|x| x * x).sum::<f64>().sqrt();
            // 0 >= 0 asks for nothing.
            if length > 0.0 {
                rows.push(row.into_iter().map(|x| x / length).collect());
            }
        }
    }
    let margins = vec![1.0; rows.len()];
    least_distance::solve(&rows, &margins).filter(|x| x[numerators].abs() > 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::{BlinnPhong, Lambert};
    use crate::math::coordinates::standard_directions;

    #[test]
    fn a_smooth_reference_is_met_within_the_narrowest_interval() {
        let reference = BlinnPhong::new([0.3, 0.1, 0.5], [0.1, 0.2, 0.05], 6.0).unwrap();
        for model in ["rational-chebyshev", "rational-legendre-10-6"] {
            let fitted = fit(model, &reference).unwrap();
            assert_eq!(fitted.model(), model);
            for (ti, to, phi) in [(0.2, 0.3, 3.0), (0.7, 0.6, 2.9), (0.4, 0.9, 1.0), (0.1, 0.8, 0.2)] {
                let (wi, wo) = standard_directions(ti, to, phi);
                let (a, b) = (fitted.value(wi, wo), reference.value(wi, wo));
                for c in 0..3 {
                    assert!((a[c] / b[c] - 1.0).abs() < 0.03, "{model} {ti} {to} {phi}: {a:?} {b:?}");
                }
            }
        }
    }

    /// Rows of zeros, whose margin is zero, say nothing: two samples of which one has no basis give what the other gives alone.
    #[test]
    fn a_row_of_zeros_does_not_end_the_programme() {
        let (values, bases) = ([0.2, 0.3, 0.25], [vec![1.0, 0.5], vec![1.0, -0.5], vec![1.0, 0.1]]);
        let expected = channel(&values, &bases, 2, 2, 0.1).unwrap();
        for place in 0..4 {
            let (mut values, mut bases) = (values.to_vec(), bases.to_vec());
            values.insert(place, 0.7);
            bases.insert(place, vec![0.0; 2]);
            assert_eq!(channel(&values, &bases, 2, 2, 0.1).unwrap(), expected, "{place}");
        }
        // A black channel, and one black in places, have a solution.
        for values in [[0.0; 3], [0.2, 0.0, 0.1]] {
            assert!(channel(&values, &bases, 2, 2, 0.9).is_some(), "{values:?}");
        }
    }

    #[test]
    fn what_no_rational_function_meets_is_infeasible() {
        // A mirror-like lobe against a polynomial of degree one.
        let reference = BlinnPhong::new([0.3; 3], [0.5; 3], 1e4).unwrap();
        let error = fit("rational-chebyshev-3-1", &reference).err().unwrap();
        assert!(matches!(error, FitError::Infeasible { channel: "red", .. }), "{error}");
        assert!(error.to_string().contains("within 90 % of every red value"), "{error}");
        let matte = Lambert::new([0.5; 3]).unwrap();
        let fitted = fit("rational-chebyshev-1-1", &matte).unwrap();
        assert!((fitted.parameters()[0] * PI / 0.5 - 1.0).abs() < 0.02);
    }
}
