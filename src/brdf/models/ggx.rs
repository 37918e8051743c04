//! GGX microfacet model with Schlick's Fresnel term, over a diffuse base.
//!
//! f = kd/pi + D F G / (4 cos theta_i cos theta_o)
//! D = alpha^2 / (pi cos^4 theta_h (alpha^2 + tan^2 theta_h)^2)
//! F = f0 + (1 - f0)(1 - cos theta_d)^5
//! G = G1(theta_i) G1(theta_o), G1 = 2 / (1 + sqrt(1 + alpha^2 tan^2 theta))
//!
//! kd: diffuse albedo, f0: reflectance at normal incidence, both per channel; alpha: roughness; all dimensionless.
//! Reciprocal; the specular part alone reflects at most what it receives.
//! Source: Walter et al. 2007, eqs. 20, 33, 34, doi:10.2312/EGWR/EGSR07/195-206; Schlick 1994,
//! doi:10.1111/1467-8659.1330233. Cost: two square roots.

use super::{AnalyticBrdf, HalfVector, ModelError, Parameter, checked, colour, scalar};
use crate::math::{Rgb, Vec3};
use std::f64::consts::{FRAC_1_PI, PI};

/// Diffuse albedo `kd`, reflectance at normal incidence `f0`, roughness `alpha`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ggx {
    pub kd: Rgb,
    pub f0: Rgb,
    pub alpha: f64,
}

impl Ggx {
    pub fn new(kd: Rgb, f0: Rgb, alpha: f64) -> Result<Self, ModelError> {
        checked(Self { kd, f0, alpha })
    }
}

pub(super) fn schema() -> Vec<Parameter> {
    let mut all = [colour!("kd", "1", 0.0, 1.0), colour!("f0", "1", 0.0, 1.0)].concat();
    all.push(scalar("alpha", "1", 1e-3, 1.0));
    all
}

impl AnalyticBrdf for Ggx {
    fn model(&self) -> &'static str {
        "ggx"
    }

    fn schema(&self) -> Vec<Parameter> {
        schema()
    }

    fn parameters(&self) -> Vec<f64> {
        [&self.kd[..], &self.f0, &[self.alpha]].concat()
    }

    fn value(&self, wi: Vec3, wo: Vec3) -> Rgb {
        let h = HalfVector::new(wi, wo);
        let alpha2 = self.alpha * self.alpha;
        let cos2 = h.cos_theta_h * h.cos_theta_h;
        let slope = cos2 * (alpha2 + h.tan2_theta_h);
        let d = alpha2 / (PI * slope * slope);
        // G1(c) / (2 c), which stays finite at grazing angles.
        let masking = |cos: f64| 1.0 / (cos + (alpha2 + (1.0 - alpha2) * cos * cos).sqrt());
        let visibility = masking(wi.z) * masking(wo.z);
        let grazing = (1.0 - h.cos_theta_d).powi(5);
        std::array::from_fn(|c| self.kd[c] * FRAC_1_PI + d * visibility * (self.f0[c] + (1.0 - self.f0[c]) * grazing))
    }
}
