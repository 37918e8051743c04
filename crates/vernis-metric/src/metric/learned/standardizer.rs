//! From raw descriptors to the units of a learned function: a power that tames tails, a standard scale, a limit.
//!
//! Each step has a smooth form with an exact derivative, for fits that follow the gradient; the plain forms are those of files
//! of format 1.

use super::regressor::{
    Input, LARGEST, LARGEST_POWER, LARGEST_SCALE, RegressorError, SMALLEST_SCALE, positive, within,
};
use crate::descriptor::Role;
use serde::{Deserialize, Serialize};

/// How one input enters a term.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Feature {
    /// Position among the regressor's inputs.
    pub input: usize,
    /// Mean of p(x) over the training rows.
    pub mean: f64,
    /// Standard deviation of p(x) over the training rows.
    pub scale: f64,
    /// How much the feature counts beside the others.
    pub gain: f64,
    /// c of the smooth power, in raw units; 0 for the plain one.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub softening: f64,
}

fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

/// How features far from the mean are held back.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Clip {
    /// clip(z) = min(max(z, -limit), limit).
    #[default]
    Hard,
    /// clip(z) = z / (1 + (z/limit)^8)^(1/8), which has a derivative everywhere.
    Smooth,
}

impl Clip {
    fn is_hard(&self) -> bool {
        *self == Self::Hard
    }

    /// `z` between -`limit` and `limit`.
    fn apply(self, z: f64, limit: f64) -> f64 {
        match self {
            Self::Hard => z.clamp(-limit, limit),
            Self::Smooth => {
                let u = z / limit;
                // Written so that no power leaves the range of f64.
                if u.abs() <= 1.0 {
                    z / (1.0 + u.powi(8)).sqrt().sqrt().sqrt()
                } else {
                    limit.copysign(u) / (1.0 + u.powi(-8)).sqrt().sqrt().sqrt()
                }
            }
        }
    }

    /// Its derivative; that of the hard clip is 0 where it clips.
    fn slope(self, z: f64, limit: f64) -> f64 {
        let u = z / limit;
        match self {
            Self::Hard => f64::from(u.abs() <= 1.0),
            Self::Smooth if u.abs() <= 1.0 => (1.0 + u.powi(8)).powf(-1.125),
            Self::Smooth => u.abs().powi(-9) * (1.0 + u.powi(-8)).powf(-1.125),
        }
    }
}

/// z = gain clip((p(x) - mean) / scale), one feature at a time, with p(x) = x (x^2 + c^2)^((power - 1)/2): sign(x) |x|^power
/// where the feature's softening c is 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Standardizer {
    /// Largest magnitude of a feature before its gain, in standard deviations.
    pub limit: f64,
    /// Exponent of |x|.
    pub power: f64,
    /// How features beyond the limit are held back.
    #[serde(default, skip_serializing_if = "Clip::is_hard")]
    pub clip: Clip,
    /// The features of the term, in order.
    pub features: Vec<Feature>,
}

/// sign(x) |x|^power: tames the tails of descriptors that span orders of magnitude.
pub fn sign_power(x: f64, power: f64) -> f64 {
    x.signum() * x.abs().powf(power)
}

/// x (x^2 + c^2)^((power - 1)/2), which behaves as sign(x) |x|^power far from 0 and as a line near it; the plain power for c = 0.
pub fn soft_power(x: f64, power: f64, c: f64) -> f64 {
    if c == 0.0 { sign_power(x, power) } else { x * x.hypot(c).powf(power - 1.0) }
}

/// The derivative of [`soft_power`] by x. The plain power below 1 has an infinite slope at 0: 0 is taken there.
fn soft_power_slope(x: f64, power: f64, c: f64) -> f64 {
    let h = x.hypot(c);
    if h == 0.0 {
        return f64::from(power == 1.0);
    }
    let slope = h.powf(power - 1.0) * ((c / h).powi(2) + power * (x / h).powi(2));
    if slope.is_finite() { slope } else { 0.0 }
}

impl Standardizer {
    /// z = x / scale for each of `(input, scale)`: what a saturated distance takes. The limit is too far to be reached.
    pub fn scaled(features: impl IntoIterator<Item = (usize, f64)>) -> Self {
        let feature = |(input, scale)| Feature { input, mean: 0.0, scale, gain: 1.0, softening: 0.0 };
        let features = features.into_iter().map(feature).collect();
        Self { limit: LARGEST, power: 1.0, clip: Clip::Hard, features }
    }

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

    /// The value of each feature that compares where it is zero; `None` for those of the reference alone.
    pub(super) fn origin(&self, inputs: &[Input]) -> Vec<Option<f64>> {
        let at = |f: &Feature| (inputs[f.input].role == Role::Difference).then(|| self.one(f, 0.0));
        self.features.iter().map(at).collect()
    }

    /// dz/dx of every feature at its raw input.
    pub(super) fn slopes(&self, raw: &[f64]) -> Vec<f64> {
        let slope = |f: &Feature| {
            let x = raw[f.input];
            let z = (soft_power(x, self.power, f.softening) - f.mean) / f.scale;
            f.gain * self.clip.slope(z, self.limit) * soft_power_slope(x, self.power, f.softening) / f.scale
        };
        self.features.iter().map(slope).collect()
    }

    fn one(&self, f: &Feature, x: f64) -> f64 {
        f.gain * self.clip.apply((soft_power(x, self.power, f.softening) - f.mean) / f.scale, self.limit)
    }

    pub(super) fn check(&self, inputs: usize) -> Result<(), RegressorError> {
        positive("the clipping limit", self.limit, LARGEST)?;
        positive("the power", self.power, LARGEST_POWER)?;
        if self.features.is_empty() {
            return Err(RegressorError::Empty { what: "feature" });
        }
        for (i, f) in self.features.iter().enumerate() {
            within(&format!("mean of feature {i}"), f.mean, (-LARGEST_SCALE, LARGEST_SCALE))?;
            within(&format!("scale of feature {i}"), f.scale, (SMALLEST_SCALE, LARGEST_SCALE))?;
            positive(&format!("gain of feature {i}"), f.gain, LARGEST)?;
            within(&format!("softening of feature {i}"), f.softening, (0.0, LARGEST_SCALE))?;
            if f.input >= inputs {
                return Err(RegressorError::Input { feature: i, found: f.input, last: inputs.saturating_sub(1) });
            }
        }
        Ok(())
    }
}
