//! Ward's isotropic model: a Gaussian lobe around the normal in the half vector's slope.
//!
//! f = kd/pi + ks exp(-tan^2 theta_h / alpha^2) / (4 pi alpha^2 N)
//!
//! N = sqrt(cos theta_i cos theta_o) (Ward) or cos theta_i cos theta_o (Duer);
//! kd, ks: diffuse and specular albedo per channel, dimensionless; alpha: standard deviation of the slope,
//! dimensionless. Both forms are reciprocal; neither bounds the albedo at grazing angles.
//! Source: Ward 1992 (isotropic form), doi:10.1145/133994.134078; Duer 2006, doi:10.1080/2151237X.2006.10129215.
//! Cost: one exponential.

use super::{AnalyticBrdf, HalfVector, ModelError, Parameter, checked, colour, diffuse_plus, scalar};
use crate::math::{Rgb, Vec3};
use std::f64::consts::PI;

/// What the lobe is divided by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WardForm {
    /// sqrt(cos theta_i cos theta_o), as published in 1992.
    Ward,
    /// cos theta_i cos theta_o, which loses less energy towards grazing angles.
    Duer,
}

/// Diffuse albedo `kd`, specular albedo `ks`, roughness `alpha`, normalisation `form`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ward {
    pub kd: Rgb,
    pub ks: Rgb,
    pub alpha: f64,
    pub form: WardForm,
}

impl Ward {
    pub fn new(kd: Rgb, ks: Rgb, alpha: f64, form: WardForm) -> Result<Self, ModelError> {
        checked(Self { kd, ks, alpha, form })
    }
}

pub(super) fn schema() -> Vec<Parameter> {
    let mut all = [colour!("kd", "1", 0.0, 1.0), colour!("ks", "1", 0.0, 10.0)].concat();
    all.push(scalar("alpha", "1", 1e-3, 2.0));
    all
}

impl AnalyticBrdf for Ward {
    fn model(&self) -> &'static str {
        match self.form {
            WardForm::Ward => "ward",
            WardForm::Duer => "ward-duer",
        }
    }

    fn schema(&self) -> Vec<Parameter> {
        schema()
    }

    fn parameters(&self) -> Vec<f64> {
        [&self.kd[..], &self.ks, &[self.alpha]].concat()
    }

    fn value(&self, wi: Vec3, wo: Vec3) -> Rgb {
        let h = HalfVector::new(wi, wo);
        let alpha2 = self.alpha * self.alpha;
        let cosines = wi.z * wo.z;
        let norm = match self.form {
            WardForm::Ward => cosines.sqrt(),
            WardForm::Duer => cosines,
        };
        diffuse_plus(self.kd, self.ks, (-h.tan2_theta_h / alpha2).exp() / (4.0 * PI * alpha2 * norm))
    }
}
