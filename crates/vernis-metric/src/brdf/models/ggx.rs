//! GGX microfacet models with Schlick's, the dielectric and the conductor Fresnel term, over a diffuse base.
//!
//! f = kd/pi + ks D F G / (4 cos theta_i cos theta_o)
//! D = alpha^2 / (pi cos^4 theta_h (alpha^2 + tan^2 theta_h)^2)
//! G = G1(theta_i) G1(theta_o), G1 = 2 / (1 + sqrt(1 + alpha^2 tan^2 theta))
//! F = f0 + (1 - f0)(1 - cos theta_d)^5 in `ggx`; those of `fresnel.rs` in `ggx-dielectric` and `ggx-conductor`
//!
//! kd: diffuse albedo, ks: specular albedo (1 where the model has none), f0: reflectance at normal incidence, all per
//! channel; eta, k: refractive index and extinction relative to air; alpha: roughness; all dimensionless.
//! Reciprocal; the specular part with ks = 1 reflects at most what it receives. `ggx-dielectric` has the eight parameters
//! that the paper on the study counts for GGX.
//! Source: Walter et al. 2007, eqs. 20, 33, 34, doi:10.2312/EGWR/EGSR07/195-206; Schlick 1994,
//! doi:10.1111/1467-8659.1330233. Cost: two square roots, and those of the Fresnel term.

use super::fresnel::{conductor, dielectric, schlick};
use super::microfacet::{ggx_distribution, ggx_visibility};
use super::{HalfVector, diffuse_plus, model};
use crate::math::Vec3;
use crate::math::dual::Scalar;
use std::f64::consts::FRAC_1_PI;

model! {
    /// Diffuse albedo `kd`, reflectance at normal incidence `f0`, roughness `alpha`; Schlick's Fresnel term.
    Ggx = "ggx" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        f0: Colour("1", (0.0, 1.0), 0.05),
        alpha: Number("1", (1e-3, 1.0), 0.2),
    }
}

model! {
    /// Diffuse albedo `kd`, specular albedo `ks`, roughness `alpha`, refractive index `eta` of a dielectric.
    GgxDielectric = "ggx-dielectric" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        ks: Colour("1", (0.0, 100.0), 1.0),
        alpha: Number("1", (1e-3, 1.0), 0.2),
        eta: Number("1", (1.0, 1e3), 1.5),
    }
}

model! {
    /// Diffuse albedo `kd`, refractive index `eta` and extinction `k` of a conductor, roughness `alpha`.
    GgxConductor = "ggx-conductor" {
        kd: Colour("1", (0.0, 1.0), 0.0),
        eta: Colour("1", (0.01, 100.0), 1.0),
        k: Colour("1", (1e-3, 100.0), 3.0),
        alpha: Number("1", (1e-3, 1.0), 0.2),
    }
}

impl<S: Scalar> Ggx<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let lobe = ggx_distribution(self.alpha, &h) * ggx_visibility(self.alpha, wi, wo);
        std::array::from_fn(|c| self.kd[c] * FRAC_1_PI + lobe * schlick(self.f0[c], h.cos_theta_d))
    }
}

impl<S: Scalar> GgxDielectric<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let lobe = ggx_distribution(self.alpha, &h) * ggx_visibility(self.alpha, wi, wo);
        diffuse_plus(self.kd, self.ks, lobe * dielectric(self.eta, h.cos_theta_d))
    }
}

impl<S: Scalar> GgxConductor<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let lobe = ggx_distribution(self.alpha, &h) * ggx_visibility(self.alpha, wi, wo);
        std::array::from_fn(|c| self.kd[c] * FRAC_1_PI + lobe * conductor(self.eta[c], self.k[c], h.cos_theta_d))
    }
}
