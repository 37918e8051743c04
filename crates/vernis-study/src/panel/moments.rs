//! Number, mean and variance of a list: what every test below starts from. Two passes, so that a small spread around
//! a large mean keeps its digits.

use serde::{Deserialize, Serialize};

/// Number, mean, and sample variance (divided by n - 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    /// Number of values.
    pub n: usize,
    /// Mean, in the unit of the values.
    pub mean: f64,
    /// `None` for one value.
    pub variance: Option<f64>,
}

impl Moments {
    /// `None` for no value.
    pub fn of(values: &[f64]) -> Option<Self> {
        let n = values.len();
        if n == 0 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / n as f64;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        Some(Self { n, mean, variance: (n > 1).then(|| squares / (n - 1) as f64) })
    }
}

/// Whether a variance is no more than what rounding leaves of numbers of the size `scale` that are all equal.
pub fn negligible(variance: f64, scale: f64) -> bool {
    variance <= (1e-12 * scale).powi(2)
}

/// A mean over repetitions and their standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MeanAndDeviation {
    /// Mean, in the unit of the values.
    pub mean: f64,
    /// Standard deviation, in the unit of the values.
    pub deviation: f64,
}

impl MeanAndDeviation {
    /// `None` for fewer than two values.
    pub fn of(values: &[f64]) -> Option<Self> {
        let Moments { mean, variance, .. } = Moments::of(values)?;
        Some(Self { mean, deviation: variance?.sqrt() })
    }
}
