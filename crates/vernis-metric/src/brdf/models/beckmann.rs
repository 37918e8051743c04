//! Beckmann microfacet models with the dielectric, Schlick's and the conductor Fresnel term, over a diffuse base.
//!
//! f = kd/pi + ks D F G / (4 cos theta_i cos theta_o)
//! D = exp(-tan^2 theta_h / alpha^2) / (pi alpha^2 cos^4 theta_h)
//! G = G1(theta_i) G1(theta_o), G1 = 2 / (1 + erf a + exp(-a^2) / (a sqrt pi)), a = 1/(alpha tan theta)
//! F: the dielectric in `beckmann`, Schlick's in `beckmann-schlick`, the conductor in `beckmann-conductor`
//!
//! kd: diffuse albedo, ks: specular albedo (1 where the model has none), f0: reflectance at normal incidence, all per
//! channel; eta, k: refractive index and extinction relative to air; alpha: root mean square slope times sqrt 2; all
//! dimensionless. Reciprocal; the specular part with ks = 1 reflects at most what it receives. `beckmann` has the eight
//! parameters that the paper on the study counts.
//! Source: Beckmann & Spizzichino 1963, *The Scattering of Electromagnetic Waves from Rough Surfaces*; Walter et al. 2007,
//! eqs. 20, 25, 26, doi:10.2312/EGWR/EGSR07/195-206. Difference: the masking is exact, not their rational approximation.
//! Cost: five exponentials.

use super::fresnel::{conductor, dielectric, schlick};
use super::microfacet::{beckmann_distribution, beckmann_visibility};
use super::{HalfVector, diffuse_plus, model};
use crate::math::Vec3;
use crate::math::dual::Scalar;
use std::f64::consts::FRAC_1_PI;

model! {
    /// Diffuse albedo `kd`, specular albedo `ks`, roughness `alpha`, refractive index `eta` of a dielectric.
    Beckmann = "beckmann" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        ks: Colour("1", (0.0, 100.0), 1.0),
        alpha: Number("1", (1e-3, 2.0), 0.2),
        eta: Number("1", (1.0, 1e3), 1.5),
    }
}

model! {
    /// Diffuse albedo `kd`, reflectance at normal incidence `f0`, roughness `alpha`; Schlick's Fresnel term.
    BeckmannSchlick = "beckmann-schlick" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        f0: Colour("1", (0.0, 1.0), 0.05),
        alpha: Number("1", (1e-3, 2.0), 0.2),
    }
}

model! {
    /// Diffuse albedo `kd`, refractive index `eta` and extinction `k` of a conductor, roughness `alpha`.
    BeckmannConductor = "beckmann-conductor" {
        kd: Colour("1", (0.0, 1.0), 0.0),
        eta: Colour("1", (0.01, 100.0), 1.0),
        k: Colour("1", (1e-3, 100.0), 3.0),
        alpha: Number("1", (1e-3, 2.0), 0.2),
    }
}

impl<S: Scalar> Beckmann<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let lobe = beckmann_distribution(self.alpha, &h) * beckmann_visibility(self.alpha, wi, wo);
        diffuse_plus(self.kd, self.ks, lobe * dielectric(self.eta, h.cos_theta_d))
    }
}

impl<S: Scalar> BeckmannSchlick<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let lobe = beckmann_distribution(self.alpha, &h) * beckmann_visibility(self.alpha, wi, wo);
        std::array::from_fn(|c| self.kd[c] * FRAC_1_PI + lobe * schlick(self.f0[c], h.cos_theta_d))
    }
}

impl<S: Scalar> BeckmannConductor<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let lobe = beckmann_distribution(self.alpha, &h) * beckmann_visibility(self.alpha, wi, wo);
        std::array::from_fn(|c| self.kd[c] * FRAC_1_PI + lobe * conductor(self.eta[c], self.k[c], h.cos_theta_d))
    }
}
