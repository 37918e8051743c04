//! Ashikhmin-Shirley, isotropic: a cosine power of the half vector with a Fresnel term, as two papers fitted it.
//!
//! f = kd/pi + ks (n + 1)/(8 pi) cos^n theta_h F / (cos theta_d max(cos theta_i, cos theta_o))
//!
//! `ashikhmin-shirley` (Ngan 2005): F is Schlick's; `ashikhmin-shirley-dielectric` (Loew 2012): F is the exact dielectric.
//! kd: diffuse albedo, ks: specular albedo, per channel; n: sharpness; f0: reflectance at normal incidence; eta: refractive
//! index relative to air; all dimensionless. Reciprocal. Difference: the diffuse base is Lambert's, as in the fits, not
//! the one of the original, which takes away what the lobe reflects.
//! Source: Ashikhmin & Shirley 2000, eq. 4 with nu = nv, doi:10.1080/10867651.2000.10487522; Ngan et al. 2005,
//! doi:10.2312/EGWR/EGSR05/117-126; Loew et al. 2012, doi:10.1145/2077341.2077350. Cost: one power.

use super::fresnel::{dielectric, schlick};
use super::{HalfVector, diffuse_plus, model};
use crate::math::Vec3;
use crate::math::dual::Scalar;
use std::f64::consts::PI;

model! {
    /// Diffuse albedo `kd`, specular albedo `ks`, reflectance at normal incidence `f0`, sharpness `n`.
    AshikhminShirley = "ashikhmin-shirley" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        ks: Colour("1", (0.0, 100.0), 0.5),
        f0: Number("1", (0.0, 1.0), 0.1),
        n: Number("1", (0.0, 1e7), 100.0),
    }
}

model! {
    /// Diffuse albedo `kd`, specular albedo `ks`, refractive index `eta`, sharpness `n`.
    AshikhminShirleyDielectric = "ashikhmin-shirley-dielectric" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        ks: Colour("1", (0.0, 100.0), 0.5),
        eta: Number("1", (1.0, 1e3), 1.5),
        n: Number("1", (0.0, 1e7), 100.0),
    }
}

/// The lobe without the Fresnel term.
fn lobe<S: Scalar>(n: S, h: &HalfVector, wi: Vec3, wo: Vec3) -> S {
    let power = S::from(h.cos_theta_h).powf(n);
    (n + 1.0) * power / (8.0 * PI * h.cos_theta_d * wi.z.max(wo.z))
}

impl<S: Scalar> AshikhminShirley<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let lobe = lobe(self.n, &h, wi, wo) * schlick(self.f0, h.cos_theta_d);
        diffuse_plus(self.kd, self.ks, lobe)
    }
}

impl<S: Scalar> AshikhminShirleyDielectric<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let lobe = lobe(self.n, &h, wi, wo) * dielectric(self.eta, h.cos_theta_d);
        diffuse_plus(self.kd, self.ks, lobe)
    }
}
