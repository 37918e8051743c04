//! A four-parameter logistic curve through points (x, y), the usual map from a metric's scale to that of the ratings.
//!
//!   y(x) = low + (high - low) / (1 + exp(-slope (x - centre))),   slope > 0
//!
//! with `low` and `high` the asymptotes (in units of y; `low > high` for a decreasing curve), `centre` in units of x
//! and `slope` in 1/x. This is the map recommended for objective quality metrics by ITU-T P.1401 (2020), 7.3, and
//! Sheikh, Sabir & Bovik (2006), doi:10.1109/TIP.2006.881959.
//!
//! Fitted by least squares. Given centre and slope the asymptotes are a linear regression (variable projection, Golub
//! & Pereyra 1973, doi:10.1137/0710036), so only two parameters are searched: a fixed grid of starts in robust units
//! of x, then the simplex of [`super::nelder_mead`] from the best two. The search is bounded: a straight line or a step
//! would otherwise send the parameters to infinity. Deterministic. Cost: about 200 passes over the points.

use super::nelder_mead::{Factors, Mean, Settings, Stop, minimise};
use std::convert::Infallible;
use thiserror::Error;

/// Bounds of the slope in robust units of x: from nearly a straight line to nearly a step.
const SLOPE_RANGE: (f64, f64) = (0.05, 1000.0);
/// First step of the search along the centre, in robust units of x, and along the logarithm of the slope.
const EDGES: [f64; 2] = [0.5, 0.5];
const SEARCH: Settings =
    Settings { factors: Factors::CLASSIC, stop: Stop::Spread(1e-12), mean: Mean::Running, most_steps: 120 };

/// Why no logistic curve could be fitted.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum LogisticError {
    #[error("a logistic fit has {x} x and {y} y; it must have as many x as y")]
    Lengths { x: usize, y: usize },
    #[error("the number of points of a logistic fit is {found}; it must be at least 4")]
    TooFewPoints { found: usize },
    #[error("point {index} of a logistic fit is ({x}, {y}); both must be finite")]
    NotFinite { index: usize, x: f64, y: f64 },
    #[error("all {what} of a logistic fit are {value}; they must differ")]
    Constant { what: &'static str, value: f64 },
}

/// A fitted curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Logistic4 {
    /// Value at x = -infinity, in units of y.
    pub low: f64,
    /// Value at x = +infinity, in units of y.
    pub high: f64,
    /// Where the curve is half way, in units of x.
    pub centre: f64,
    /// Steepness, 1/x, positive.
    pub slope: f64,
}

impl Logistic4 {
    /// The least-squares curve through the points.
    pub fn fit(x: &[f64], y: &[f64]) -> Result<Self, LogisticError> {
        check(x, y)?;
        let (origin, unit) = robust_scale(x);
        let t: Vec<f64> = x.iter().map(|x| (x - origin) / unit).collect();
        let (min, max) = t.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &t| (a.min(t), b.max(t)));
        let clamp =
            |p: [f64; 2]| [p[0].clamp(min - 2.0, max + 2.0), p[1].clamp(SLOPE_RANGE.0.ln(), SLOPE_RANGE.1.ln())];
        let loss = |p: [f64; 2]| {
            let [centre, log_slope] = clamp(p);
            regress(&t, y, centre, log_slope.exp()).2
        };
        let search = |start: [f64; 2]| {
            let value = |p: &mut [f64]| Ok::<_, Infallible>(loss([p[0], p[1]]));
            let Ok((p, least)) = minimise(start.to_vec(), &EDGES, &SEARCH, value);
            ([p[0], p[1]], least)
        };
        let mut starts: Vec<([f64; 2], f64)> = [-2.0, -1.0, 0.0, 1.0, 2.0, 4.0]
            .iter()
            .flat_map(|&centre| [-1.0, 0.5, 2.0].map(|log_slope| clamp([centre, log_slope])))
            .map(|p| (p, loss(p)))
            .collect();
        starts.sort_by(|a, b| a.1.total_cmp(&b.1));
        let best = starts
            .iter()
            .take(2)
            .map(|(start, _)| search(*start))
            .fold(starts[0], |a, b| if b.1 < a.1 { b } else { a });
        let [centre, log_slope] = clamp(best.0);
        let (low, amplitude, _) = regress(&t, y, centre, log_slope.exp());
        Ok(Self { low, high: low + amplitude, centre: origin + unit * centre, slope: log_slope.exp() / unit })
    }

    /// The curve at `x`.
    pub fn predict(&self, x: f64) -> f64 {
        self.low + (self.high - self.low) * sigmoid(self.slope * (x - self.centre))
    }
}

fn check(x: &[f64], y: &[f64]) -> Result<(), LogisticError> {
    if x.len() != y.len() {
        return Err(LogisticError::Lengths { x: x.len(), y: y.len() });
    }
    if x.len() < 4 {
        return Err(LogisticError::TooFewPoints { found: x.len() });
    }
    if let Some(index) = (0..x.len()).find(|&i| !(x[i].is_finite() && y[i].is_finite())) {
        return Err(LogisticError::NotFinite { index, x: x[index], y: y[index] });
    }
    for (what, values) in [("x", x), ("y", y)] {
        if values.iter().all(|v| *v == values[0]) {
            return Err(LogisticError::Constant { what, value: values[0] });
        }
    }
    Ok(())
}

/// Median, and interquartile range over that of a unit normal; the standard deviation where half the points coincide.
fn robust_scale(x: &[f64]) -> (f64, f64) {
    let mut sorted = x.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |q: f64| sorted[((sorted.len() - 1) as f64 * q).round() as usize];
    let spread = (at(0.75) - at(0.25)) / 1.349;
    if spread > 0.0 {
        return (at(0.5), spread);
    }
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    (at(0.5), (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len() as f64).sqrt())
}

fn sigmoid(u: f64) -> f64 {
    1.0 / (1.0 + (-u).exp())
}

/// Asymptote, amplitude and sum of squared residuals of the best curve with this centre and slope.
fn regress(t: &[f64], y: &[f64], centre: f64, slope: f64) -> (f64, f64, f64) {
    let n = t.len() as f64;
    let p: Vec<f64> = t.iter().map(|t| sigmoid(slope * (t - centre))).collect();
    let (mean_p, mean_y) = (p.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (mut pp, mut py) = (0.0, 0.0);
    for (p, y) in p.iter().zip(y) {
        pp += (p - mean_p).powi(2);
        py += (p - mean_p) * (y - mean_y);
    }
    // A curve that is flat over all points explains nothing.
    let amplitude = if pp > 1e-12 { py / pp } else { 0.0 };
    let low = mean_y - amplitude * mean_p;
    let loss = p.iter().zip(y).map(|(p, y)| (y - low - amplitude * p).powi(2)).sum();
    (low, amplitude, loss)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ss(curve: &Logistic4, x: &[f64], y: &[f64]) -> f64 {
        x.iter().zip(y).map(|(x, y)| (curve.predict(*x) - y).powi(2)).sum()
    }

    #[test]
    fn recovers_a_decreasing_curve() {
        let truth = Logistic4 { low: 4.6, high: 1.2, centre: 0.3, slope: 9.0 };
        let x: Vec<f64> = (0..60).map(|i| (i as f64 / 59.0).powi(3)).collect();
        let y: Vec<f64> = x.iter().map(|x| truth.predict(*x)).collect();
        let fit = Logistic4::fit(&x, &y).unwrap();
        assert!((fit.low - truth.low).abs() < 1e-3, "{fit:?}");
        assert!((fit.high - truth.high).abs() < 1e-3, "{fit:?}");
        assert!((fit.centre - truth.centre).abs() < 1e-3, "{fit:?}");
        assert!((fit.slope - truth.slope).abs() < 1e-2, "{fit:?}");
    }

    #[test]
    fn agrees_with_scipy() {
        // x = 0.37 i mod 3, y = 4.5 - 3 / (1 + exp(-2 (x - 1.2))) + 0.3 sin(5 i), i = 0..40:
        // scipy.optimize.curve_fit (SciPy 1.17.1) from (4.5, 1.5, 1.2, 2).
        let x: Vec<f64> = (0..40).map(|i| (0.37 * i as f64) % 3.0).collect();
        let y: Vec<f64> =
            (0..40).map(|i| 4.5 - 3.0 / (1.0 + (-2.0 * (x[i] - 1.2)).exp()) + 0.3 * (5.0 * i as f64).sin()).collect();
        let fit = Logistic4::fit(&x, &y).unwrap();
        let scipy = Logistic4 {
            low: 4.647417875401263,
            high: 1.4423038869391607,
            centre: 1.159544859506824,
            slope: 1.7727739349047091,
        };
        assert!((ss(&fit, &x, &y) - ss(&scipy, &x, &y)).abs() < 1e-8, "{fit:?}");
        assert!((fit.centre - scipy.centre).abs() < 1e-4, "{fit:?}");
        assert!((fit.slope - scipy.slope).abs() < 1e-4, "{fit:?}");
    }

    #[test]
    fn units_of_x_do_not_matter() {
        let x: Vec<f64> = (0..50).map(|i| ((i * 37) % 50) as f64 / 10.0).collect();
        let y: Vec<f64> = x.iter().enumerate().map(|(i, x)| 5.0 - x.sqrt() + 0.1 * (i % 3) as f64).collect();
        let a = Logistic4::fit(&x, &y).unwrap();
        let scaled: Vec<f64> = x.iter().map(|x| 1e-6 * x - 3.0).collect();
        let b = Logistic4::fit(&scaled, &y).unwrap();
        for (x, s) in x.iter().zip(&scaled) {
            assert!((a.predict(*x) - b.predict(*s)).abs() < 1e-4);
        }
    }

    #[test]
    fn straight_lines_and_steps_stay_finite() {
        let x: Vec<f64> = (0..20).map(f64::from).collect();
        let step: Vec<f64> = x.iter().map(|x| if *x < 9.5 { 1.0 } else { 5.0 }).collect();
        let line: Vec<f64> = x.iter().map(|x| 1.0 + 0.2 * x).collect();
        for (y, tolerance) in [(step, 1e-3), (line, 1e-2)] {
            let fit = Logistic4::fit(&x, &y).unwrap();
            assert!(fit.low.is_finite() && fit.high.is_finite());
            assert!(x.iter().zip(&y).all(|(x, y)| (fit.predict(*x) - y).abs() < tolerance), "{fit:?}");
        }
    }

    #[test]
    fn refuses_what_cannot_be_fitted() {
        assert_eq!(Logistic4::fit(&[1.0], &[]), Err(LogisticError::Lengths { x: 1, y: 0 }));
        assert_eq!(Logistic4::fit(&[1.0; 3], &[1.0; 3]), Err(LogisticError::TooFewPoints { found: 3 }));
        let x = [1.0, 2.0, 3.0, 4.0];
        assert_eq!(Logistic4::fit(&x, &[2.0; 4]), Err(LogisticError::Constant { what: "y", value: 2.0 }));
        assert_eq!(Logistic4::fit(&[2.0; 4], &x), Err(LogisticError::Constant { what: "x", value: 2.0 }));
        let nan = Logistic4::fit(&[1.0, f64::NAN, 3.0, 4.0], &x);
        assert!(matches!(nan, Err(LogisticError::NotFinite { index: 1, .. })));
    }
}
