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

use super::standardizer::Standardizer;
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
    #[error(
        "feature {feature} of a saturated distance is {input}, which describes the reference alone; it must compare the two BRDFs"
    )]
    Context { feature: usize, input: String },
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

    /// The factor of a - b in the gradient of [`Kernel::radial`] by a. The exponential has a kink at a = b: 0 is taken there.
    pub(super) fn radial_slope(&self, distance: f64, d: f64) -> f64 {
        let unit = self.length * d.sqrt();
        let r = distance / unit;
        match self.radial {
            Radial::Exponential if distance == 0.0 => 0.0,
            Radial::Exponential => -(-r).exp() / (unit * distance),
            Radial::Matern32 => -3.0 * (-3f64.sqrt() * r).exp() / (unit * unit),
            Radial::Gaussian => -(-0.5 * r * r).exp() / (unit * unit),
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
    /// g(z) = -A (1 - exp(-s/A)) with s = sum_k v_k |z_k|: minus a weighted city-block distance that saturates at A.
    ///
    /// Features compare the two BRDFs, have mean 0 and power 1, and no v_k is negative. With z_k the change of a number that
    /// belongs to one BRDF, s is a city-block distance (Shepard 1964, doi:10.1007/BF02289621, with p = 1), and a concave
    /// increasing function of a distance that is 0 at 0 keeps symmetry and the triangle inequality.
    Saturated {
        /// v_k, one weight a feature.
        weights: Vec<f64>,
        /// A, the largest distance, on the scale of the ratings before the weight of the term.
        limit: f64,
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
        Self::check_terms(&self.terms, &self.inputs)
    }

    /// The same for the terms alone, which take `inputs`.
    pub(super) fn check_terms(terms: &[Term], inputs: &[Input]) -> Result<(), RegressorError> {
        if terms.is_empty() {
            return Err(RegressorError::Empty { what: "term" });
        }
        for (i, term) in terms.iter().enumerate() {
            learned(&format!("weight of term {i}"), [term.weight])?;
            term.standardizer.check(inputs.len())?;
            term.function.check(term.standardizer.features.len())?;
            if matches!(term.function, Function::Saturated { .. }) {
                check_distance(&term.standardizer, inputs)?;
            }
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
                round(&mut f.softening);
            }
            match &mut term.function {
                Function::Linear { weights } => weights.iter_mut().for_each(round),
                Function::Saturated { weights, limit } => weights.iter_mut().chain([limit]).for_each(round),
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
            Function::Kernel { kernel, weights, landmarks } => {
                let origin = self.standardizer.origin(inputs);
                let landmarks = weights.iter().zip(landmarks.chunks_exact(z.len()));
                landmarks
                    .map(|(w, b)| {
                        let b0 = at_identity(b, &origin);
                        let centred = |a: &[f64]| kernel.value(a, b) - kernel.value(a, &b0);
                        w * (centred(&z) - centred(&z0))
                    })
                    .sum()
            }
            Function::Saturated { weights, limit } => {
                let g = |z: &[f64]| saturated(weights.iter().zip(z).map(|(v, z)| v * z.abs()).sum(), *limit);
                g(&z) - g(&z0)
            }
            Function::Network { activation, members } => {
                let mean = |z: &[f64]| {
                    members.iter().map(|layers| forward(layers, *activation, z)[0]).sum::<f64>() / members.len() as f64
                };
                mean(&z) - mean(&z0)
            }
        }
    }
}

/// A landmark with every difference at zero; `origin` is that of the standardizer.
pub(super) fn at_identity(landmark: &[f64], origin: &[Option<f64>]) -> Vec<f64> {
    landmark.iter().zip(origin).map(|(&z, origin)| origin.unwrap_or(z)).collect()
}

/// -A (1 - exp(-s/A)).
pub(super) fn saturated(s: f64, limit: f64) -> f64 {
    limit * (-s / limit).exp_m1()
}

/// That the features of a saturated distance compare the two BRDFs and are 0 where these are the same.
fn check_distance(standardizer: &Standardizer, inputs: &[Input]) -> Result<(), RegressorError> {
    within("the power of a saturated distance", standardizer.power, (1.0, 1.0))?;
    for (i, f) in standardizer.features.iter().enumerate() {
        within(&format!("mean of feature {i} of a saturated distance"), f.mean, (0.0, 0.0))?;
        let input = &inputs[f.input];
        if input.role != Role::Difference {
            return Err(RegressorError::Context { feature: i, input: input.name.clone() });
        }
    }
    Ok(())
}

impl Function {
    fn weight_count(&self) -> usize {
        match self {
            Function::Linear { weights } | Function::Kernel { weights, .. } | Function::Saturated { weights, .. } => {
                weights.len()
            }
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
            Function::Saturated { weights, limit } => {
                shape("weights of the saturated distance", weights.len(), features)?;
                positive("the limit of the saturated distance", *limit, LARGEST)?;
                weights.iter().try_for_each(|&v| within("a weight of the saturated distance", v, (0.0, LARGEST)))
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

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
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
pub(super) fn positive(what: &str, value: f64, high: f64) -> Result<(), RegressorError> {
    within(what, value, (1.0 / LARGEST, high))
}

pub(super) fn within(what: &str, found: f64, (low, high): (f64, f64)) -> Result<(), RegressorError> {
    if !found.is_finite() {
        return Err(RegressorError::NotFinite { what: what.to_owned() });
    }
    if (low..=high).contains(&found) {
        return Ok(());
    }
    Err(RegressorError::Range { what: what.to_owned(), found, low, high })
}
