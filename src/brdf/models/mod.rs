//! Published reflectance models, one file each.

use super::Brdf;
use crate::math::{Rgb, Vec3};

/// One scalar parameter of a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    pub name: &'static str,
    /// `"1"` for a dimensionless number, `"1/sr"`, `"rad"`...
    pub unit: &'static str,
    /// Smallest and largest allowed value.
    pub bounds: (f64, f64),
}

/// A model given by a formula and a parameter vector.
pub trait AnalyticBrdf: Send + Sync {
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
    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        if wi.z <= 0.0 || wo.z <= 0.0 { Some([0.0; 3]) } else { Some(self.value(wi, wo)) }
    }
}
