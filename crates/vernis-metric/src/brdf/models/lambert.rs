//! Lambert: the ideal diffuse reflector.
//!
//! f = kd / pi
//!
//! kd: albedo per channel, dimensionless, 0 to 1.
//! Source: Lambert 1760, *Photometria*. Cost: none.

use super::model;
use crate::math::Vec3;
use crate::math::dual::Scalar;
use std::f64::consts::FRAC_1_PI;

model! {
    /// Diffuse reflector of albedo `kd`.
    Lambert = "lambert" {
        kd: Colour("1", (0.0, 1.0), 0.2),
    }
}

impl<S: Scalar> Lambert<S> {
    fn formula(&self, _wi: Vec3, _wo: Vec3) -> [S; 3] {
        self.kd.map(|k| k * FRAC_1_PI)
    }
}
