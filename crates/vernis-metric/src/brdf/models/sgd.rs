//! SGD: the shifted-gamma microfacet distribution, every parameter per colour channel.
//!
//! f = (kd + ks F D G1(theta_i) G1(theta_o) / (cos theta_i cos theta_o)) / pi
//! F = f0 - f1 cos theta_d + (1 - cos theta_d)^5 (1 - f0)
//! D = kappa exp(-x) / (pi x^p cos^4 theta_h), x = alpha + tan^2 theta_h / alpha
//! G1 = clamp(1 + lambda (1 - exp(c max(theta - theta0, 0)^k)), 0, 1)
//!
//! kd, ks: diffuse and specular albedo; f0, f1: Fresnel coefficients; alpha, p, kappa: width, fall-off and
//! normalisation of the distribution (kappa is the paper's K_ap); lambda, c, k, theta0 (rad): masking. All but theta0
//! are dimensionless. Reciprocal.
//! Source: Bagher et al. 2012, doi:10.1111/j.1467-8659.2012.03147.x.
//! Difference: three published Fresnel fits (blue-fabric, white-fabric2, white-paint) dip below zero; the lobe is clamped
//! at zero, since no reflectance is negative. Cost: at most six exponentials, powers or logarithms a channel, skipped where they round to nothing.

use super::{HalfVector, ModelError, model};
use crate::math::dual::Scalar;
use crate::math::{Rgb, Vec3};
use std::f64::consts::{FRAC_1_PI, PI};

// The bounds are wide enough for the published fits, whose masking coefficient c reaches 1e109 where it switches a lobe
// off.
model! {
    /// The eleven parameters of each channel; the symbols are those of the module documentation.
    Sgd = "sgd" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        ks: Colour("1", (0.0, 10.0), 0.1),
        f0: Colour("1", (-20.0, 20.0), 0.2),
        f1: Colour("1", (-20.0, 20.0), 0.0),
        alpha: Colour("1", (1e-8, 10.0), 0.1),
        p: Colour("1", (0.0, 100.0), 0.5),
        kappa: Colour("1", (0.0, 1e7), 10.0),
        lambda: Colour("1", (1e-12, 1e9), 3.0),
        c: Colour("1", (1e-120, 1e120), 0.1),
        k: Colour("1", (1e-3, 1e4), 10.0),
        theta0: Colour("rad", (-PI, PI), 0.0),
    }
}

impl Sgd {
    /// From the eleven colours in the order of the fields.
    pub fn from_rows(rows: [Rgb; 11]) -> Result<Self, ModelError> {
        let [kd, ks, f0, f1, alpha, p, kappa, lambda, c, k, theta0] = rows;
        Self::new(kd, ks, f0, f1, alpha, p, kappa, lambda, c, k, theta0)
    }
}

impl<S: Scalar> Sgd<S> {
    /// Smith-like masking of one direction at polar angle `theta` (radians) in one channel.
    fn masking(&self, channel: usize, theta: f64) -> S {
        let one = S::from(1.0);
        let beyond = S::from(theta) - self.theta0[channel];
        if beyond.value() <= 0.0 {
            return one;
        }
        let loss = self.c[channel] * beyond.powf(self.k[channel]);
        // lambda is at most 1e9: below this the masking rounds to 1.
        if loss.value() < 1e-26 {
            return one;
        }
        (one - self.lambda[channel] * (loss.exp() - 1.0)).max(S::from(0.0)).min(one)
    }

    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let (theta_i, theta_o) = (wi.z.min(1.0).acos(), wo.z.min(1.0).acos());
        let grazing = (1.0 - h.cos_theta_d).powi(5);
        let cos4 = h.cos_theta_h.powi(4);
        std::array::from_fn(|c| {
            let x = self.alpha[c] + S::from(h.tan2_theta_h) / self.alpha[c];
            let exponent = -x - self.p[c] * x.ln();
            let mut lobe = S::from(0.0);
            // exp(-700) times any allowed factor is nothing.
            if exponent.value() > -700.0 {
                let fresnel = self.f0[c] - self.f1[c] * h.cos_theta_d + (S::from(1.0) - self.f0[c]) * grazing;
                let d = self.kappa[c] * exponent.exp() * FRAC_1_PI / cos4;
                let g = self.masking(c, theta_i) * self.masking(c, theta_o);
                lobe = (self.ks[c] * fresnel * d * g / (wi.z * wo.z)).max(S::from(0.0));
            }
            (self.kd[c] + lobe) * FRAC_1_PI
        })
    }
}
