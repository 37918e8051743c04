//! From descriptors to a mean opinion score, exactly the model's zero where candidate and reference are identical.
//!
//! With f the descriptors that compare candidate and reference, c those that describe the reference alone, and g any
//! of the functions below, the prediction is
//!
//!   mos = identity_mos + g(f, c) - g(0, c),
//!
//! so that identical BRDFs (f = 0) get `identity_mos` by construction, whatever was learned. Every weight is f64.
//! Cost: two evaluations of g, a few thousand multiplications.

use crate::dataset::samples::Role;
use serde::{Deserialize, Serialize};
use thiserror::Error;

#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RegressorError {
    #[error("{what}: found {found}, expected {expected}")]
    Shape { what: String, found: usize, expected: usize },
    #[error("{what} is not a finite number")]
    NotFinite { what: String },
    #[error("the ensemble has no member")]
    Empty,
}

/// One input of a regressor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Feature {
    /// Name of the descriptor.
    pub name: String,
    pub role: Role,
    /// Mean and standard deviation of sign(x) sqrt|x| over the training rows.
    pub mean: f64,
    pub scale: f64,
}

/// z = clip((sign(x) sqrt|x| - mean) / scale, -limit, limit), one feature at a time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Standardizer {
    pub features: Vec<Feature>,
    pub limit: f64,
}

fn sign_root(x: f64) -> f64 {
    x.signum() * x.abs().sqrt()
}

impl Standardizer {
    /// Raw descriptors to inputs.
    pub fn apply(&self, raw: &[f64]) -> Vec<f64> {
        self.features.iter().zip(raw).map(|(f, &x)| self.one(f, x)).collect()
    }

    /// The inputs of a candidate identical to the reference that `raw` describes: differences 0, context kept.
    pub fn apply_identity(&self, raw: &[f64]) -> Vec<f64> {
        let zeroed = |f: &Feature, x: f64| if f.role == Role::Difference { 0.0 } else { x };
        self.features.iter().zip(raw).map(|(f, &x)| self.one(f, zeroed(f, x))).collect()
    }

    fn one(&self, f: &Feature, x: f64) -> f64 {
        ((sign_root(x) - f.mean) / f.scale).clamp(-self.limit, self.limit)
    }
}

/// One dense layer: `weights[o * inputs + i]`, `bias[o]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Dense {
    pub inputs: usize,
    pub outputs: usize,
    pub weights: Vec<f64>,
    pub bias: Vec<f64>,
}

/// What follows every layer but the last.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Activation {
    /// max(x, slope x).
    LeakyRelu { slope: f64 },
}

/// The function g of the module documentation, and how several are averaged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Regressor {
    /// g(z) = w . z.
    Linear { standardizer: Standardizer, weights: Vec<f64> },
    /// g(z) = sum_m w_m k(z, z_m), k(a, b) = exp(-|a - b| / (length sqrt d)) + linear a.b / d, d the number of inputs;
    /// `landmarks[m * d + i]` are in standardised units.
    Kernel { standardizer: Standardizer, landmarks: Vec<f64>, weights: Vec<f64>, length: f64, linear: f64 },
    /// A multi-layer perceptron with one output.
    Network { standardizer: Standardizer, layers: Vec<Dense>, activation: Activation },
    /// The mean of its members.
    Ensemble { members: Vec<Regressor> },
}
