//! ABC microfacet model: an inverse power of the half vector's cosine, with Fresnel and V-groove masking.
//!
//! f = kd/pi + F(eta, cos theta_d) G D / (pi cos theta_i cos theta_o)
//! D = A / (1 + B (1 - cos theta_h))^C
//! G = min(1, 2 cos theta_h cos theta_i / cos theta_d, 2 cos theta_h cos theta_o / cos theta_d)
//! F: unpolarised Fresnel reflectance of a dielectric
//!
//! kd: diffuse albedo per channel, dimensionless; A: height of the lobe per channel; B: inverse width; C: fall-off;
//! eta: refractive index relative to air; all dimensionless. Reciprocal; energy is not conserved by construction.
//! The paper on the study counts eight parameters for ABC, one less: its candidates behave as if one refractive index,
//! about 2.5, had been used for all materials (inferred from the ratings). [`AbcStudy`] is that form.
//! Source: Loew et al. 2012, the microfacet form, doi:10.1145/2077341.2077350. Cost: one power.

use super::fresnel::dielectric;
use super::microfacet::v_groove;
use super::{HalfVector, model};
use crate::math::Vec3;
use crate::math::dual::Scalar;
use std::f64::consts::FRAC_1_PI;

model! {
    /// Diffuse albedo `kd`, lobe height `a`, inverse width `b`, fall-off `c`, refractive index `eta`.
    Abc = "abc" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        a: Colour("1", (0.0, 1e6), 10.0),
        b: Number("1", (0.0, 1e9), 1000.0),
        c: Number("1", (0.0, 10.0), 1.0),
        eta: Number("1", (1.0, 1e3), 1.5),
    }
}

model! {
    /// [`Abc`] without the refractive index, which is [`STUDY_ETA`].
    AbcStudy = "abc-study" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        a: Colour("1", (0.0, 1e6), 10.0),
        b: Number("1", (0.0, 1e9), 1000.0),
        c: Number("1", (0.0, 10.0), 1.0),
    }
}

/// The refractive index of [`AbcStudy`].
pub const STUDY_ETA: f64 = 2.5;

impl<S: Scalar> Abc<S> {
    pub(super) fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let shape = (self.b * (1.0 - h.cos_theta_h) + 1.0).powf(-self.c);
        let fresnel = dielectric(self.eta, h.cos_theta_d);
        let lobe = fresnel * v_groove(&h, wi, wo) * shape / (wi.z * wo.z);
        std::array::from_fn(|c| (self.kd[c] + self.a[c] * lobe) * FRAC_1_PI)
    }
}

impl<S: Scalar> AbcStudy<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let Self { kd, a, b, c } = *self;
        Abc { kd, a, b, c, eta: S::from(STUDY_ETA) }.formula(wi, wo)
    }
}
