//! Blinn-Phong: a cosine power of the half vector.
//!
//! f = kd/pi + ks (n + 2)/(2 pi) cos^n theta_h
//!
//! kd, ks: diffuse and specular albedo per channel, dimensionless; n: sharpness, dimensionless. Reciprocal.
//! Source: Blinn 1977, doi:10.1145/563858.563893, in the normalisation of Ngan et al. 2005,
//! doi:10.2312/EGWR/EGSR05/117-126. The published fits are read with the half vector, not the reflected direction:
//! the median log error against the measured data is 0.49 against 0.55. Cost: one power.

use super::{AnalyticBrdf, HalfVector, ModelError, Parameter, checked, colour, diffuse_plus, scalar};
use crate::math::{Rgb, Vec3};
use std::f64::consts::PI;

/// Diffuse albedo `kd`, specular albedo `ks`, sharpness `n`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlinnPhong {
    pub kd: Rgb,
    pub ks: Rgb,
    pub n: f64,
}

impl BlinnPhong {
    pub fn new(kd: Rgb, ks: Rgb, n: f64) -> Result<Self, ModelError> {
        checked(Self { kd, ks, n })
    }
}

pub(super) fn schema() -> Vec<Parameter> {
    let mut all = [colour!("kd", "1", 0.0, 1.0), colour!("ks", "1", 0.0, 10.0)].concat();
    all.push(scalar("n", "1", 0.0, 1e7));
    all
}

impl AnalyticBrdf for BlinnPhong {
    fn model(&self) -> &'static str {
        "blinn-phong"
    }

    fn schema(&self) -> Vec<Parameter> {
        schema()
    }

    fn parameters(&self) -> Vec<f64> {
        [&self.kd[..], &self.ks, &[self.n]].concat()
    }

    fn value(&self, wi: Vec3, wo: Vec3) -> Rgb {
        let h = HalfVector::new(wi, wo);
        diffuse_plus(self.kd, self.ks, (self.n + 2.0) / (2.0 * PI) * h.cos_theta_h.powf(self.n))
    }
}
