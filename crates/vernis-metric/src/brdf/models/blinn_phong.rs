//! Blinn-Phong: a cosine power of the half vector.
//!
//! f = kd/pi + ks (n + 2)/(2 pi) cos^n theta_h
//!
//! kd, ks: diffuse and specular albedo per channel, dimensionless; n: sharpness, dimensionless. Reciprocal.
//! Source: Blinn 1977, doi:10.1145/563858.563893, in the normalisation of Ngan et al. 2005,
//! doi:10.2312/EGWR/EGSR05/117-126. The published fits are read with the half vector, not the reflected direction:
//! the median log error against the measured data is 0.49 against 0.55. Cost: one power.

use super::{HalfVector, diffuse_plus, model};
use crate::math::Vec3;
use crate::math::dual::Scalar;
use std::f64::consts::PI;

model! {
    /// Diffuse albedo `kd`, specular albedo `ks`, sharpness `n`.
    BlinnPhong = "blinn-phong" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        ks: Colour("1", (0.0, 10.0), 0.05),
        n: Number("1", (0.0, 1e7), 100.0),
    }
}

impl<S: Scalar> BlinnPhong<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let lobe = (self.n + 2.0) / (2.0 * PI) * S::from(h.cos_theta_h).powf(self.n);
        diffuse_plus(self.kd, self.ks, lobe)
    }
}
