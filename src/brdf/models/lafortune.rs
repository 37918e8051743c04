//! Lafortune, isotropic with one lobe: a cosine power of a weighted dot product of the two directions.
//!
//! f = kd/pi + ks (n + 2)/(2 pi) (max(cxy (wi.x wo.x + wi.y wo.y) + cz wi.z wo.z, 0) / max(|cxy|, |cz|))^n
//!
//! kd, ks: diffuse and specular albedo per channel, dimensionless; cxy (negative for a mirror-like lobe), cz: weights
//! of the tangential and normal parts; n: sharpness; all dimensionless. Reciprocal.
//! Source: Lafortune et al. 1997, doi:10.1145/258734.258801, in the normalisation of Ngan et al. 2005,
//! doi:10.2312/EGWR/EGSR05/117-126. The weights are divided by the larger one before the power is taken:
//! (1/sqrt 3)^n underflows for the published n of several thousand. Cost: one power.

use super::{AnalyticBrdf, ModelError, Parameter, checked, colour, diffuse_plus, scalar};
use crate::math::{Rgb, Vec3};
use std::f64::consts::PI;

/// Diffuse albedo `kd`, specular albedo `ks`, lobe weights `cxy` and `cz`, sharpness `n`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lafortune {
    pub kd: Rgb,
    pub ks: Rgb,
    pub cxy: f64,
    pub cz: f64,
    pub n: f64,
}

impl Lafortune {
    pub fn new(kd: Rgb, ks: Rgb, cxy: f64, cz: f64, n: f64) -> Result<Self, ModelError> {
        checked(Self { kd, ks, cxy, cz, n })
    }
}

pub(super) fn schema() -> Vec<Parameter> {
    let mut all = [colour!("kd", "1", 0.0, 1.0), colour!("ks", "1", 0.0, 10.0)].concat();
    // cxy stays away from zero so that the larger weight is never zero.
    all.extend([scalar("cxy", "1", -2.0, -1e-3), scalar("cz", "1", 0.0, 2.0), scalar("n", "1", 0.0, 1e7)]);
    all
}

impl AnalyticBrdf for Lafortune {
    fn model(&self) -> &'static str {
        "lafortune"
    }

    fn schema(&self) -> Vec<Parameter> {
        schema()
    }

    fn parameters(&self) -> Vec<f64> {
        [&self.kd[..], &self.ks, &[self.cxy, self.cz, self.n]].concat()
    }

    fn value(&self, wi: Vec3, wo: Vec3) -> Rgb {
        let dot = self.cxy * (wi.x * wo.x + wi.y * wo.y) + self.cz * wi.z * wo.z;
        let base = dot.max(0.0) / self.cxy.abs().max(self.cz.abs());
        diffuse_plus(self.kd, self.ks, (self.n + 2.0) / (2.0 * PI) * base.powf(self.n))
    }
}
