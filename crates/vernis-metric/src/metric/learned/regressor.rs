//! From descriptors to a mean opinion score, exactly the model's zero where candidate and reference are identical.
//!
//! With f the descriptors that compare candidate and reference, c those that describe the reference alone, and g_t the
//! functions of the terms below, the prediction is
//!
//!   mos = identity_mos + sum_t weight_t (g_t(z) - g_t(z0)),   z = standardise(f, c),   z0 = standardise(0, c),
//!
//! so that identical BRDFs (f = 0) get `identity_mos` bit for bit, whatever was learned: both evaluations are then the
//! same operations on the same numbers. Every weight is f64. The magnitudes of all numbers are bounded ([`LARGEST`] and the
//! others), far beyond what training gives, so that no sum leaves the range of f64: a prediction is always a number. Cost: two
//! evaluations of each g, 1e4 to 1e5
//! multiplications.

use crate::descriptor::{Column, Role};
use crate::math::layers::{Activation, Dense, LayerMismatch, check_layers, forward};
use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Largest magnitude of a learned number: weights, biases, landmarks, gains, the clipping limit, slopes. Of those that must be
/// positive, 1 / this is the smallest.
pub const LARGEST: f64 = 1e6;
/// Largest magnitude of the mean of a feature, and largest scale.
pub const LARGEST_SCALE: f64 = 1e12;
/// Smallest scale of a feature.
pub const SMALLEST_SCALE: f64 = 1e-30;
/// Largest exponent of a feature.
pub const LARGEST_POWER: f64 = 8.0;
/// Most layers of a network.
pub const MOST_LAYERS: usize = 8;

/// Why a regressor cannot be used.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum RegressorError {
    #[error("the number of {what} is {found}; it must be {expected}")]
    Shape { what: String, found: usize, expected: usize },
    #[error("the input of feature {feature} is number {found}; it must be at most {last}")]
    Input { feature: usize, found: usize, last: usize },
    #[error("{what} is not a finite number")]
    NotFinite { what: String },
    #[error("{what} is {found:?}; it must be {low:?} to {high:?}")]
    Range { what: String, found: f64, low: f64, high: f64 },
    #[error("the regressor has no {what}")]
    Empty { what: &'static str },
}

impl From<LayerMismatch> for RegressorError {
    fn from(LayerMismatch { what, found, expected }: LayerMismatch) -> Self {
        Self::Shape { what, found, expected }
    }
}

/// One input of a regressor, in raw units.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// Name of the descriptor.
    pub name: String,
    /// Whether it compares the two BRDFs or describes the reference.
    pub role: Role,
}

impl From<&Column> for Input {
    fn from(column: &Column) -> Self {
        Self { name: column.name.clone(), role: column.role }
    }
}

/// How one input enters a term.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Feature {
    /// Position among the regressor's inputs.
    pub input: usize,
    /// Mean of sign(x) |x|^power over the training rows.
    pub mean: f64,
    /// Standard deviation of sign(x) |x|^power over the training rows.
    pub scale: f64,
    /// How much the feature counts beside the others.
    pub gain: f64,
}

/// z = gain clip((sign(x) |x|^power - mean) / scale, -limit, limit), one feature at a time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Standardizer {
    /// Largest magnitude of a feature before its gain, in standard deviations.
    pub limit: f64,
    /// Exponent of |x|.
    pub power: f64,
    /// The features of the term, in order.
    pub features: Vec<Feature>,
}

/// sign(x) |x|^power: tames the tails of descriptors that span orders of magnitude.
pub fn sign_power(x: f64, power: f64) -> f64 {
    x.signum() * x.abs().powf(power)
}

impl Standardizer {
    /// Raw inputs to the term's own units.
    pub fn apply(&self, raw: &[f64]) -> Vec<f64> {
        self.features.iter().map(|f| self.one(f, raw[f.input])).collect()
    }

    /// The same with every difference at zero: what identical BRDFs give for this reference.
    pub fn apply_at_identity(&self, raw: &[f64], inputs: &[Input]) -> Vec<f64> {
        self.features
            .iter()
            .map(|f| self.one(f, if inputs[f.input].role == Role::Difference { 0.0 } else { raw[f.input] }))
            .collect()
    }

    /// A point already in the term's units, moved to where every difference is zero.
    fn to_identity(&self, z: &[f64], inputs: &[Input]) -> Vec<f64> {
        let at = |(f, &z): (&Feature, &f64)| {
            if inputs[f.input].role == Role::Difference { self.one(f, 0.0) } else { z }
        };
        self.features.iter().zip(z).map(at).collect()
    }

    fn one(&self, f: &Feature, x: f64) -> f64 {
        f.gain * ((sign_power(x, self.power) - f.mean) / f.scale).clamp(-self.limit, self.limit)
    }

    fn check(&self, inputs: usize) -> Result<(), RegressorError> {
        positive("the clipping limit", self.limit, LARGEST)?;
        positive("the power", self.power, LARGEST_POWER)?;
        if self.features.is_empty() {
            return Err(RegressorError::Empty { what: "feature" });
        }
        for (i, f) in self.features.iter().enumerate() {
            within(&format!("mean of feature {i}"), f.mean, (-LARGEST_SCALE, LARGEST_SCALE))?;
            within(&format!("scale of feature {i}"), f.scale, (SMALLEST_SCALE, LARGEST_SCALE))?;
            positive(&format!("gain of feature {i}"), f.gain, LARGEST)?;
            if f.input >= inputs {
                return Err(RegressorError::Input { feature: i, found: f.input, last: inputs.saturating_sub(1) });
            }
        }
        Ok(())
    }
}

/// How a kernel falls off with r = |a - b| / (length sqrt d), d the number of features.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Radial {
    /// exp(-r).
    Exponential,
    /// (1 + sqrt(3) r) exp(-sqrt(3) r): Matern's with nu = 3/2 (Rasmussen & Williams 2006, eq. 4.17).
    Matern32,
    /// exp(-r^2 / 2).
    Gaussian,
}

/// k(a, b) = radial(|a - b| / (length sqrt d)) + linear a.b / d.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kernel {
    /// How the kernel falls off with distance.
    pub radial: Radial,
    /// Length scale for each feature, in units of the standardised features.
    pub length: f64,
    /// Factor of the linear part a.b / d.
    pub linear: f64,
}

impl Kernel {
    /// k(a, b) for two points of the same dimension.
    pub fn value(&self, a: &[f64], b: &[f64]) -> f64 {
        let d = a.len() as f64;
        let squared: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
        self.radial(squared.sqrt(), d) + self.linear * dot(a, b) / d
    }

    /// The part that depends on the distance alone, in `d` dimensions.
    pub fn radial(&self, distance: f64, d: f64) -> f64 {
        let r = distance / (self.length * d.sqrt());
        match self.radial {
            Radial::Exponential => (-r).exp(),
            Radial::Matern32 => {
                let r = 3f64.sqrt() * r;
                (1.0 + r) * (-r).exp()
            }
            Radial::Gaussian => (-0.5 * r * r).exp(),
        }
    }
}

/// The function g of a term, of standardised features.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
#[non_exhaustive]
pub enum Function {
    /// g(z) = w . z.
    Linear {
        /// w, one weight a feature.
        weights: Vec<f64>,
    },
    /// g(z) = sum_m w_m (k(z, z_m) - k(z, z_m0)), z_m0 being landmark m with every difference at zero;
    /// `landmarks[m * d + i]`.
    Kernel {
        /// k, the kernel between points and landmarks.
        kernel: Kernel,
        /// w_m, one weight a landmark.
        weights: Vec<f64>,
        /// Standardised features of the landmarks, landmark by landmark.
        landmarks: Vec<f64>,
    },
    /// The mean of multi-layer perceptrons with one output.
    Network {
        /// Follows every layer but the last.
        activation: Activation,
        /// The layers of each perceptron.
        members: Vec<Vec<Dense>>,
    },
}

/// One learned function and its weight in the sum.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Term {
    /// Factor of the function in the sum.
    pub weight: f64,
    /// From raw inputs to the features of the function.
    pub standardizer: Standardizer,
    /// g, a function of the standardised features.
    pub function: Function,
}

/// A learned map from raw descriptors to a mean opinion score.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Regressor {
    /// The score of identical BRDFs, on the scale of the ratings.
    pub identity_mos: f64,
    /// The descriptors that it takes, in order.
    pub inputs: Vec<Input>,
    /// The learned functions that are summed.
    pub terms: Vec<Term>,
}

impl Regressor {
    /// The score of one pair from its raw descriptors, in the order of `inputs`; not limited to the scale.
    ///
    /// # Panics
    /// If `raw` has another length than `inputs`, or the regressor does not pass [`check`](Self::check).
    pub fn predict(&self, raw: &[f64]) -> f64 {
        assert_eq!(raw.len(), self.inputs.len(), "descriptors and inputs of the regressor");
        self.identity_mos + difference(&self.terms, &self.inputs, raw)
    }

    /// One score a row of rows x inputs.
    pub fn predict_rows(&self, raw: ArrayView2<'_, f64>) -> Vec<f64> {
        raw.outer_iter().map(|row| self.predict(&row.to_vec())).collect()
    }

    /// Shapes agree and every number is within its bounds: after this, `predict` gives a finite number for finite descriptors.
    pub fn check(&self) -> Result<(), RegressorError> {
        learned("identity_mos", [self.identity_mos])?;
        Self::check_terms(&self.terms, self.inputs.len())
    }

    /// The same for the terms alone, which take `inputs` numbers.
    pub(super) fn check_terms(terms: &[Term], inputs: usize) -> Result<(), RegressorError> {
        if terms.is_empty() {
            return Err(RegressorError::Empty { what: "term" });
        }
        for (i, term) in terms.iter().enumerate() {
            learned(&format!("weight of term {i}"), [term.weight])?;
            term.standardizer.check(inputs)?;
            term.function.check(term.standardizer.features.len())?;
        }
        Ok(())
    }

    /// Number of learned weights: how much the regressor can remember of the ratings it was trained on.
    pub fn weight_count(&self) -> usize {
        self.terms.iter().map(|t| t.function.weight_count()).sum()
    }

    /// Every number rounded to `digits` significant decimal digits, so that files stay short; a rounded regressor is
    /// written and read back without further change.
    pub fn rounded(mut self, digits: usize) -> Self {
        let round = |x: &mut f64| *x = format!("{:.*e}", digits.saturating_sub(1), *x).parse().unwrap_or(*x);
        for term in &mut self.terms {
            for f in &mut term.standardizer.features {
                round(&mut f.mean);
                round(&mut f.scale);
            }
            match &mut term.function {
                Function::Linear { weights } => weights.iter_mut().for_each(round),
                Function::Kernel { weights, landmarks, .. } => {
                    weights.iter_mut().chain(landmarks).for_each(round);
                }
                Function::Network { members, .. } => {
                    members.iter_mut().flatten().for_each(|l| l.bias.iter_mut().chain(&mut l.weights).for_each(round));
                }
            }
        }
        self
    }
}

/// sum_t weight_t (g_t(z) - g_t(z0)).
pub(super) fn difference(terms: &[Term], inputs: &[Input], raw: &[f64]) -> f64 {
    terms.iter().map(|t| t.weight * t.difference(raw, inputs)).sum()
}

impl Term {
    /// g(z) - g(z0), exactly 0 where z = z0.
    fn difference(&self, raw: &[f64], inputs: &[Input]) -> f64 {
        let z = self.standardizer.apply(raw);
        let z0 = self.standardizer.apply_at_identity(raw, inputs);
        match &self.function {
            Function::Linear { weights } => dot(weights, &z) - dot(weights, &z0),
            Function::Kernel { kernel, weights, landmarks } => weights
                .iter()
                .zip(landmarks.chunks_exact(z.len()))
                .map(|(w, b)| {
                    let b0 = self.standardizer.to_identity(b, inputs);
                    let centred = |a: &[f64]| kernel.value(a, b) - kernel.value(a, &b0);
                    w * (centred(&z) - centred(&z0))
                })
                .sum(),
            Function::Network { activation, members } => {
                let mean = |z: &[f64]| {
                    members.iter().map(|layers| forward(layers, *activation, z)[0]).sum::<f64>() / members.len() as f64
                };
                mean(&z) - mean(&z0)
            }
        }
    }
}

impl Function {
    fn weight_count(&self) -> usize {
        match self {
            Function::Linear { weights } | Function::Kernel { weights, .. } => weights.len(),
            Function::Network { members, .. } => members.iter().flatten().map(|l| l.weights.len() + l.bias.len()).sum(),
        }
    }

    fn check(&self, features: usize) -> Result<(), RegressorError> {
        match self {
            Function::Linear { weights } => {
                shape("linear weights", weights.len(), features)?;
                learned("a linear weight", weights.iter().copied())
            }
            Function::Kernel { kernel, weights, landmarks } => {
                within("the kernel's length", kernel.length, (1.0 / LARGEST, LARGEST))?;
                learned("the kernel's linear part", [kernel.linear])?;
                shape("values in the landmarks", landmarks.len(), weights.len() * features)?;
                learned("a kernel weight", weights.iter().copied())?;
                learned("a landmark", landmarks.iter().copied())
            }
            Function::Network { activation, members } => {
                let Activation::LeakyRelu { slope } = activation;
                learned("the activation's slope", [*slope])?;
                if members.is_empty() {
                    return Err(RegressorError::Empty { what: "network" });
                }
                members.iter().try_for_each(|layers| check_network(layers, features))
            }
        }
    }
}

fn check_network(layers: &[Dense], features: usize) -> Result<(), RegressorError> {
    let outputs = check_layers(layers, features)?;
    shape("outputs of the network", if layers.is_empty() { 0 } else { outputs }, 1)?;
    if layers.len() > MOST_LAYERS {
        let (what, found) = ("the number of layers".to_owned(), layers.len() as f64);
        return Err(RegressorError::Range { what, found, low: 1.0, high: MOST_LAYERS as f64 });
    }
    layers.iter().enumerate().try_for_each(|(i, layer)| learned(&format!("a number of layer {i}"), layer.numbers()))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn shape(what: &str, found: usize, expected: usize) -> Result<(), RegressorError> {
    if found == expected {
        return Ok(());
    }
    Err(RegressorError::Shape { what: what.to_owned(), found, expected })
}

/// Numbers that were learned.
fn learned(what: &str, values: impl IntoIterator<Item = f64>) -> Result<(), RegressorError> {
    values.into_iter().try_for_each(|value| within(what, value, (-LARGEST, LARGEST)))
}

/// A number from 1 / [`LARGEST`] to `high`.
fn positive(what: &str, value: f64, high: f64) -> Result<(), RegressorError> {
    within(what, value, (1.0 / LARGEST, high))
}

fn within(what: &str, found: f64, (low, high): (f64, f64)) -> Result<(), RegressorError> {
    if !found.is_finite() {
        return Err(RegressorError::NotFinite { what: what.to_owned() });
    }
    if (low..=high).contains(&found) {
        return Ok(());
    }
    Err(RegressorError::Range { what: what.to_owned(), found, low, high })
}
