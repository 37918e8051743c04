//! A BRDF for tests: one value in every direction.

use crate::brdf::Brdf;
use crate::math::{Rgb, Vec3};

pub(super) struct Constant(pub Rgb);

impl Brdf for Constant {
    fn eval(&self, _: Vec3, _: Vec3) -> Option<Rgb> {
        Some(self.0)
    }
}
