//! Cook-Torrance: Beckmann facets in symmetric grooves, as two papers fitted it.
//!
//! f = kd/pi + ks F D G / (pi cos theta_i cos theta_o)
//! D = exp(-tan^2 theta_h / m^2) / (N m^2 cos^4 theta_h)
//! G = min(1, 2 cos theta_h cos theta_i / cos theta_d, 2 cos theta_h cos theta_o / cos theta_d)
//!
//! `cook-torrance` (Ngan 2005): F is Schlick's and N = pi; `cook-torrance-dielectric` (Loew 2012): F is the exact
//! dielectric and N = 1, as in the original.
//! kd: diffuse albedo, ks: specular albedo, per channel; m: root mean square slope times sqrt 2; f0: reflectance at normal
//! incidence; eta: refractive index relative to air; all dimensionless. Reciprocal; energy is not conserved by
//! construction.
//! Source: Cook & Torrance 1982, doi:10.1145/357290.357293; Ngan et al. 2005, doi:10.2312/EGWR/EGSR05/117-126; Loew et
//! al. 2012, doi:10.1145/2077341.2077350. With these N the published fits are nearest to the measured materials: exchanged,
//! the median log error grows from 0.41 to 0.61 (Ngan) and from 0.33 to 0.46 (Loew, E2). Cost: one exponential.

use super::fresnel::{dielectric, schlick};
use super::microfacet::{beckmann_distribution, v_groove};
use super::{HalfVector, diffuse_plus, model};
use crate::math::Vec3;
use crate::math::dual::Scalar;
use std::f64::consts::FRAC_1_PI;

model! {
    /// Diffuse albedo `kd`, specular albedo `ks`, reflectance at normal incidence `f0`, roughness `m`.
    CookTorrance = "cook-torrance" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        ks: Colour("1", (0.0, 100.0), 0.5),
        f0: Number("1", (0.0, 1.0), 0.1),
        m: Number("1", (1e-3, 5.0), 0.2),
    }
}

model! {
    /// Diffuse albedo `kd`, specular albedo `ks`, refractive index `eta`, roughness `m`.
    CookTorranceDielectric = "cook-torrance-dielectric" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        ks: Colour("1", (0.0, 100.0), 0.5),
        eta: Number("1", (1.0, 1e3), 1.5),
        m: Number("1", (1e-3, 5.0), 0.2),
    }
}

/// D G / (cos theta_i cos theta_o) with N = pi.
fn facets<S: Scalar>(m: S, h: &HalfVector, wi: Vec3, wo: Vec3) -> S {
    beckmann_distribution(m, h) * (v_groove(h, wi, wo) / (wi.z * wo.z))
}

impl<S: Scalar> CookTorrance<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let lobe = facets(self.m, &h, wi, wo) * schlick(self.f0, h.cos_theta_d) * FRAC_1_PI;
        diffuse_plus(self.kd, self.ks, lobe)
    }
}

impl<S: Scalar> CookTorranceDielectric<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        // The division by pi is what N = 1 takes back.
        let lobe = facets(self.m, &h, wi, wo) * dielectric(self.eta, h.cos_theta_d);
        diffuse_plus(self.kd, self.ks, lobe)
    }
}
