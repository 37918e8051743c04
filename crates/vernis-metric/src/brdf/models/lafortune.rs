//! Lafortune, isotropic with one lobe: a cosine power of a weighted dot product of the two directions.
//!
//! f = kd/pi + ks (n + 2)/(2 pi) (max(cxy (wi.x wo.x + wi.y wo.y) + cz wi.z wo.z, 0) / max(|cxy|, |cz|))^n
//!
//! kd, ks: diffuse and specular albedo per channel, dimensionless; cxy (negative for a mirror-like lobe), cz: weights
//! of the tangential and normal parts; n: sharpness; all dimensionless. Reciprocal.
//! Source: Lafortune et al. 1997, doi:10.1145/258734.258801, in the normalisation of Ngan et al. 2005,
//! doi:10.2312/EGWR/EGSR05/117-126. The weights are divided by the larger one before the power is taken:
//! (1/sqrt 3)^n underflows for the published n of several thousand. Cost: one power.

use super::{diffuse_plus, model};
use crate::math::Vec3;
use crate::math::dual::Scalar;
use std::f64::consts::PI;

model! {
    /// Diffuse albedo `kd`, specular albedo `ks`, lobe weights `cxy` and `cz`, sharpness `n`.
    Lafortune = "lafortune" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        ks: Colour("1", (0.0, 10.0), 0.05),
        // cxy stays away from zero so that the larger weight is never zero.
        cxy: Number("1", (-2.0, -1e-3), -0.577),
        cz: Number("1", (0.0, 2.0), 0.577),
        n: Number("1", (0.0, 1e7), 50.0),
    }
}

impl<S: Scalar> Lafortune<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let dot = self.cxy * (wi.x * wo.x + wi.y * wo.y) + self.cz * wi.z * wo.z;
        let base = dot.max(S::from(0.0)) / self.cxy.abs().max(self.cz.abs());
        diffuse_plus(self.kd, self.ks, (self.n + 2.0) / (2.0 * PI) * base.powf(self.n))
    }
}
