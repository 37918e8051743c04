//! Published reflectance models, one file each.
//!
//! Every model is a plain structure of its published parameters. `new` checks them against the bounds of the
//! schema; a structure written out field by field in code is not checked. [`build`] makes a model from its
//! identifier and parameter vector, which is how files, the source notation and fits make theirs.

mod abc;
mod blinn_phong;
mod ggx;
mod lafortune;
mod lambert;
mod named;
mod sgd;
mod ward;

pub use abc::Abc;
pub use blinn_phong::BlinnPhong;
pub use ggx::Ggx;
pub use lafortune::Lafortune;
pub use lambert::Lambert;
pub use named::{FieldError, NamedParameters};
pub use sgd::Sgd;
pub use ward::{Ward, WardForm};

use super::Brdf;
use crate::math::{Rgb, Vec3};
use std::sync::Arc;
use thiserror::Error;

/// One scalar parameter of a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// `alpha`, or `kd.r` for one channel of a colour.
    pub name: &'static str,
    /// `"1"` for a dimensionless number, `"1/sr"`, `"rad"`...
    pub unit: &'static str,
    /// Smallest and largest allowed value.
    pub bounds: (f64, f64),
}

/// What is wrong with the parameters of a model.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ModelError {
    #[error("{model}: {parameter} is {found}, allowed is {} to {}", allowed.0, allowed.1)]
    OutOfBounds { model: &'static str, parameter: &'static str, found: f64, allowed: (f64, f64) },
    #[error("{model}: {found} parameters were given, the model has {expected}")]
    Count { model: &'static str, found: usize, expected: usize },
    #[error("unknown model `{found}`; the models are {}", MODELS.join(", "))]
    UnknownModel { found: String },
}

/// A model given by a formula and a parameter vector.
pub trait AnalyticBrdf: Brdf {
    /// The identifier used in the source notation, such as `ward-duer`.
    fn model(&self) -> &'static str;

    /// Names, units and bounds of the entries of [`AnalyticBrdf::parameters`], in order.
    fn schema(&self) -> Vec<Parameter>;

    /// The parameter vector.
    fn parameters(&self) -> Vec<f64>;

    /// Value for two directions above the horizon (linear RGB, 1/sr, cosine NOT included).
    fn value(&self, wi: Vec3, wo: Vec3) -> Rgb;
}

impl<M: AnalyticBrdf> Brdf for M {
    fn is_mirror_symmetric(&self) -> bool {
        true
    }

    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        if wi.z <= 0.0 || wo.z <= 0.0 { Some([0.0; 3]) } else { Some(self.value(wi, wo)) }
    }
}

/// Identifiers of all models.
pub const MODELS: [&str; 8] = ["lambert", "ward", "ward-duer", "blinn-phong", "lafortune", "abc", "sgd", "ggx"];

/// Names, units and bounds of the parameters of `model`.
pub fn schema(model: &str) -> Result<Vec<Parameter>, ModelError> {
    Ok(match model {
        "lambert" => lambert::schema(),
        "ward" | "ward-duer" => ward::schema(),
        "blinn-phong" => blinn_phong::schema(),
        "lafortune" => lafortune::schema(),
        "abc" => abc::schema(),
        "sgd" => sgd::schema(),
        "ggx" => ggx::schema(),
        _ => return Err(ModelError::UnknownModel { found: model.to_owned() }),
    })
}

/// The model called `model` with the parameter vector `p`, checked against the schema: the inverse of
/// [`AnalyticBrdf::model`] and [`AnalyticBrdf::parameters`].
pub fn build(model: &str, p: &[f64]) -> Result<Arc<dyn AnalyticBrdf>, ModelError> {
    let schema = schema(model)?;
    let known = MODELS.into_iter().find(|m| *m == model).unwrap_or("model");
    if p.len() != schema.len() {
        return Err(ModelError::Count { model: known, found: p.len(), expected: schema.len() });
    }
    let rgb = |k: usize| [p[k], p[k + 1], p[k + 2]];
    Ok(match model {
        "lambert" => Arc::new(Lambert::new(rgb(0))?),
        "ward" => Arc::new(Ward::new(rgb(0), rgb(3), p[6], WardForm::Ward)?),
        "ward-duer" => Arc::new(Ward::new(rgb(0), rgb(3), p[6], WardForm::Duer)?),
        "blinn-phong" => Arc::new(BlinnPhong::new(rgb(0), rgb(3), p[6])?),
        "lafortune" => Arc::new(Lafortune::new(rgb(0), rgb(3), p[6], p[7], p[8])?),
        "abc" => Arc::new(Abc::new(rgb(0), rgb(3), p[6], p[7], p[8])?),
        "sgd" => Arc::new(Sgd::from_rows(std::array::from_fn(|k| rgb(3 * k)))?),
        _ => Arc::new(Ggx::new(rgb(0), rgb(3), p[6])?),
    })
}

/// Three parameters, one for each channel of the colour `name`.
macro_rules! colour {
    ($name:literal, $unit:literal, $low:expr, $high:expr) => {
        [
            $crate::brdf::models::Parameter { name: concat!($name, ".r"), unit: $unit, bounds: ($low, $high) },
            $crate::brdf::models::Parameter { name: concat!($name, ".g"), unit: $unit, bounds: ($low, $high) },
            $crate::brdf::models::Parameter { name: concat!($name, ".b"), unit: $unit, bounds: ($low, $high) },
        ]
    };
}
use colour;

fn scalar(name: &'static str, unit: &'static str, low: f64, high: f64) -> Parameter {
    Parameter { name, unit, bounds: (low, high) }
}

/// Hands the model back if each of its parameters lies within its bounds (NaN never does).
fn checked<M: AnalyticBrdf>(model: M) -> Result<M, ModelError> {
    for (p, found) in model.schema().iter().zip(model.parameters()) {
        if !(p.bounds.0..=p.bounds.1).contains(&found) {
            return Err(ModelError::OutOfBounds { model: model.model(), parameter: p.name, found, allowed: p.bounds });
        }
    }
    Ok(model)
}

/// What most models need of the half vector h of two unit directions above the horizon.
struct HalfVector {
    /// n.h
    cos_theta_h: f64,
    /// tan^2 of the angle between normal and h.
    tan2_theta_h: f64,
    /// wi.h = wo.h
    cos_theta_d: f64,
}

impl HalfVector {
    fn new(wi: Vec3, wo: Vec3) -> Self {
        let sum = wi + wo;
        // |wi + wo| = 2 cos theta_d for unit vectors.
        let length = sum.length();
        Self {
            cos_theta_h: (sum.z / length).min(1.0),
            tan2_theta_h: (sum.x * sum.x + sum.y * sum.y) / (sum.z * sum.z),
            cos_theta_d: (0.5 * length).min(1.0),
        }
    }
}

/// `kd / pi + ks * lobe`, the common shape of the empirical models.
fn diffuse_plus(kd: Rgb, ks: Rgb, lobe: f64) -> Rgb {
    std::array::from_fn(|c| kd[c] * std::f64::consts::FRAC_1_PI + ks[c] * lobe)
}

#[cfg(test)]
mod tests;
