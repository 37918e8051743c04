//! Lambert: the ideal diffuse reflector.
//!
//! f = kd / pi
//!
//! kd: albedo per channel, dimensionless, 0 to 1.
//! Source: Lambert 1760, *Photometria*. Cost: none.

use super::{AnalyticBrdf, ModelError, Parameter, checked, colour};
use crate::math::{Rgb, Vec3};
use std::f64::consts::FRAC_1_PI;

/// Diffuse reflector of albedo `kd`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lambert {
    pub kd: Rgb,
}

impl Lambert {
    pub fn new(kd: Rgb) -> Result<Self, ModelError> {
        checked(Self { kd })
    }
}

pub(super) fn schema() -> Vec<Parameter> {
    colour!("kd", "1", 0.0, 1.0).to_vec()
}

impl AnalyticBrdf for Lambert {
    fn model(&self) -> &'static str {
        "lambert"
    }

    fn schema(&self) -> Vec<Parameter> {
        schema()
    }

    fn parameters(&self) -> Vec<f64> {
        self.kd.to_vec()
    }

    fn value(&self, _wi: Vec3, _wo: Vec3) -> Rgb {
        self.kd.map(|k| k * FRAC_1_PI)
    }
}
