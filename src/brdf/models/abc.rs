//! ABC microfacet model: an inverse power of the half vector's cosine, with Fresnel and V-groove masking.
//!
//! f = kd/pi + F(eta, cos theta_d) G D / (pi cos theta_i cos theta_o)
//! D = A / (1 + B (1 - cos theta_h))^C
//! G = min(1, 2 cos theta_h cos theta_i / cos theta_d, 2 cos theta_h cos theta_o / cos theta_d)
//! F: unpolarised Fresnel reflectance of a dielectric
//!
//! kd: diffuse albedo per channel, dimensionless; A: height of the lobe per channel; B: inverse width; C: fall-off;
//! eta: refractive index relative to air; all dimensionless. Reciprocal; energy is not conserved by construction.
//! Source: Loew et al. 2012, the microfacet form, doi:10.1145/2077341.2077350. Cost: one power.

use super::{AnalyticBrdf, HalfVector, ModelError, Parameter, checked, colour, scalar};
use crate::math::{Rgb, Vec3};
use std::f64::consts::FRAC_1_PI;

/// Diffuse albedo `kd`, lobe height `a`, inverse width `b`, fall-off `c`, refractive index `eta`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Abc {
    pub kd: Rgb,
    pub a: Rgb,
    pub b: f64,
    pub c: f64,
    pub eta: f64,
}

impl Abc {
    pub fn new(kd: Rgb, a: Rgb, b: f64, c: f64, eta: f64) -> Result<Self, ModelError> {
        checked(Self { kd, a, b, c, eta })
    }
}

pub(super) fn schema() -> Vec<Parameter> {
    let mut all = [colour!("kd", "1", 0.0, 1.0), colour!("a", "1", 0.0, 1e6)].concat();
    all.extend([scalar("b", "1", 0.0, 1e9), scalar("c", "1", 0.0, 10.0), scalar("eta", "1", 1.0, 1e3)]);
    all
}

/// Reflectance of unpolarised light at a dielectric of relative index `eta` >= 1 (Cook & Torrance 1982,
/// doi:10.1145/357290.357293).
fn fresnel_dielectric(eta: f64, cos: f64) -> f64 {
    let g = (eta * eta - 1.0 + cos * cos).sqrt();
    let (minus, plus) = (g - cos, g + cos);
    let polarisation = (cos * plus - 1.0) / (cos * minus + 1.0);
    0.5 * (minus * minus) / (plus * plus) * (1.0 + polarisation * polarisation)
}

impl AnalyticBrdf for Abc {
    fn model(&self) -> &'static str {
        "abc"
    }

    fn schema(&self) -> Vec<Parameter> {
        schema()
    }

    fn parameters(&self) -> Vec<f64> {
        [&self.kd[..], &self.a, &[self.b, self.c, self.eta]].concat()
    }

    fn value(&self, wi: Vec3, wo: Vec3) -> Rgb {
        let h = HalfVector::new(wi, wo);
        let shape = (1.0 + self.b * (1.0 - h.cos_theta_h)).powf(-self.c);
        let masking = (2.0 * h.cos_theta_h * wi.z.min(wo.z) / h.cos_theta_d).min(1.0);
        let fresnel = fresnel_dielectric(self.eta, h.cos_theta_d);
        let lobe = fresnel * masking * shape / (wi.z * wo.z);
        std::array::from_fn(|c| FRAC_1_PI * (self.kd[c] + self.a[c] * lobe))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At normal incidence the reflectance is ((eta - 1) / (eta + 1))^2; at grazing incidence it is 1.
    #[test]
    fn fresnel_at_both_ends() {
        for eta in [1.0f64, 1.5, 2.5, 99.0] {
            let normal = ((eta - 1.0) / (eta + 1.0)).powi(2);
            assert!((fresnel_dielectric(eta, 1.0) - normal).abs() < 1e-14);
        }
        assert!((fresnel_dielectric(1.5, 0.0) - 1.0).abs() < 1e-14);
    }
}
