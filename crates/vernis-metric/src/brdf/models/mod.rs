//! Published reflectance models, one file each.
//!
//! Every model is a plain structure of its published parameters. `new` checks them against the bounds of the
//! schema; a structure written out field by field in code is not checked. [`build`] makes a model from its
//! identifier and parameter vector, which is how files, the source notation and fits make theirs.

mod abc;
mod abc_smooth;
mod ashikhmin_shirley;
mod beckmann;
mod blinn_phong;
mod cook_torrance;
mod declare;
mod dupuy;
pub(crate) mod foreign;
mod fresnel;
mod ggx;
mod gltf;
mod he;
mod lafortune;
mod lambert;
mod list;
mod microfacet;
mod named;
mod openpbr;
mod pbrt;
mod principled;
mod rational;
mod sgd;
mod sum;
mod ward;

pub use abc::{Abc, AbcStudy, STUDY_ETA};
pub use abc_smooth::AbcSmooth;
pub use ashikhmin_shirley::{AshikhminShirley, AshikhminShirleyDielectric};
pub use beckmann::{Beckmann, BeckmannConductor, BeckmannSchlick};
pub use blinn_phong::BlinnPhong;
pub use cook_torrance::{CookTorrance, CookTorranceDielectric};
pub use dupuy::{Dupuy, SlopeDistribution};
pub use ggx::{Ggx, GgxConductor, GgxDielectric};
pub use gltf::Gltf;
pub use he::He;
pub use lafortune::Lafortune;
pub use lambert::Lambert;
pub use list::{Built, MODELS, ModelEntry, names, register};
pub use named::{Field, FieldError, NamedParameters};
pub use openpbr::{OpenPbr, OpenPbrDielectric, OpenPbrMetal};
pub use pbrt::{PbrtConductor, PbrtMix};
pub use principled::Principled;
pub use rational::{Basis, Rational};
pub use sgd::Sgd;
pub use sum::Sum;
pub use ward::{Ward, WardForm};

use super::Brdf;
use crate::io::{counted, number};
use crate::math::dual::Scalar;
use crate::math::{Rgb, Vec3};
use declare::model;
use list::entry;
use rational::Form;
use std::borrow::Cow;
use std::sync::Arc;
use thiserror::Error;

/// One scalar parameter of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// `alpha`, or `kd.r` for one channel of a colour; `2.alpha` for that of the second term of a sum.
    pub name: Cow<'static, str>,
    /// `"1"` for a dimensionless number, `"1/sr"`, `"rad"`...
    pub unit: &'static str,
    /// Smallest and largest allowed value.
    pub bounds: (f64, f64),
    /// Where a fit begins: a plain, slightly glossy grey.
    pub start: f64,
}

/// What is wrong with the parameters of a model.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum ModelError {
    #[error("{model}: {parameter} is {}; it must be {} to {}", number(*found), number(allowed.0), number(allowed.1))]
    OutOfBounds { model: String, parameter: String, found: f64, allowed: (f64, f64) },
    #[error("{model}: {} {} given; the model has {expected}", counted(*found, "parameter"), if *found == 1 { "was" } else { "were" })]
    Count { model: String, found: usize, expected: usize },
    #[error(
        "{model}: {term} has no lobe; each term of a sum must be a model with a lobe, and only the first may be lambert"
    )]
    Term { model: String, term: String },
    #[error("the reference sends no light back to its source, so it has no distribution of facets")]
    NoRetroreflection,
    #[error("unknown model `{found}`; the models are {}, and sums such as ggx+ward", names().join(", "))]
    UnknownModel { found: String },
    #[error("the model name `{found}` is taken")]
    NameTaken { found: String },
    #[error("`{found}` is not a name for a model; it must consist of lower-case letters, digits and -")]
    Name { found: String },
}

/// A model given by a formula and a parameter vector.
pub trait AnalyticBrdf: Brdf {
    /// The identifier used in the source notation, such as `ward-duer`.
    fn model(&self) -> &str;

    /// Names, units, bounds and starts of the entries of [`AnalyticBrdf::parameters`], in order.
    fn schema(&self) -> Vec<Parameter>;

    /// The parameter vector.
    fn parameters(&self) -> Vec<f64>;

    /// Value for two directions above the horizon (linear RGB, 1/sr, cosine NOT included).
    fn value(&self, wi: Vec3, wo: Vec3) -> Rgb;

    /// [`Brdf::is_reciprocal`] of this model: whether its formula is, and has no steps that rounding could cross.
    fn reciprocal(&self) -> bool {
        false
    }

    /// The model with its parameter gradient, if it has one.
    fn as_differentiable(&self) -> Option<&dyn DifferentiableBrdf> {
        None
    }
}

/// A model whose value can be differentiated by its parameters.
pub trait DifferentiableBrdf: AnalyticBrdf {
    /// The value of [`AnalyticBrdf::value`], and its derivatives: `d[k][c]` is that of channel `c` by parameter `k`, in
    /// 1/sr per unit of the parameter. `d` has one entry a parameter. At a kink of the formula (a clamp, a branch of the
    /// masking) it is the derivative of the side on which the value lies.
    fn value_and_gradient(&self, wi: Vec3, wo: Vec3, d: &mut [Rgb]) -> Rgb;
}

impl<M: AnalyticBrdf> Brdf for M {
    fn is_mirror_symmetric(&self) -> bool {
        true
    }

    fn is_reciprocal(&self) -> bool {
        self.reciprocal()
    }

    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        if wi.z <= 0.0 || wo.z <= 0.0 { Some([0.0; 3]) } else { Some(self.value(wi, wo)) }
    }

    fn as_model(&self) -> Option<&dyn AnalyticBrdf> {
        Some(self)
    }
}

/// Names, units, bounds and starts of the parameters of `model`: one of [`MODELS`], a rational function of another size
/// such as `rational-legendre-20-15`, or a sum of models such as `ggx+blinn-phong`.
pub fn schema(model: &str) -> Result<Vec<Parameter>, ModelError> {
    if model.contains('+') {
        return sum::schema(model);
    }
    match Form::parse(model) {
        Some(form) => Ok(form.schema()),
        None => Ok((entry(model)?.schema)()),
    }
}

/// The model called `model` (see [`schema`]) with the parameter vector `p`, checked against the schema: the inverse of
/// [`AnalyticBrdf::model`] and [`AnalyticBrdf::parameters`].
pub fn build(model: &str, p: &[f64]) -> Result<Arc<dyn AnalyticBrdf>, ModelError> {
    let expected = schema(model)?.len();
    if p.len() != expected {
        return Err(ModelError::Count { model: model.to_owned(), found: p.len(), expected });
    }
    if model.contains('+') {
        return sum::shared(model, p);
    }
    match Form::parse(model) {
        Some(form) => form.shared(p),
        None => (entry(model)?.build)(p),
    }
}

/// Hands the model back if each of its parameters lies within its bounds (NaN never does).
fn checked<M: AnalyticBrdf>(model: M) -> Result<M, ModelError> {
    check(model.model(), &model.schema(), &model.parameters())?;
    Ok(model)
}

fn check(model: &str, schema: &[Parameter], p: &[f64]) -> Result<(), ModelError> {
    match schema.iter().zip(p).find(|(s, x)| !(s.bounds.0..=s.bounds.1).contains(*x)) {
        None => Ok(()),
        Some((s, x)) => Err(ModelError::OutOfBounds {
            model: model.to_owned(),
            parameter: s.name.to_string(),
            found: *x,
            allowed: s.bounds,
        }),
    }
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
fn diffuse_plus<S: Scalar>(kd: [S; 3], ks: [S; 3], lobe: S) -> [S; 3] {
    std::array::from_fn(|c| kd[c] * std::f64::consts::FRAC_1_PI + ks[c] * lobe)
}

#[cfg(test)]
mod tests;
