//! He, Torrance, Sillion & Greenberg: the directional-diffuse lobe of a Gaussian random surface by physical optics.
//!
//! f = kd/pi + ks F S G D / (pi cos theta_i cos theta_o)
//! D = pi^2 tau^2/(4 lambda^2) sum over m >= 1 of g^m exp(-g - (pi tau |p|/lambda)^2/m) / (m! m)
//! g = (2 pi sigma'/lambda)^2 (cos theta_i + cos theta_o)^2, sigma' = sigma/sqrt(1 + z^2)
//! z exp(z^2/2) = (K(theta_i) + K(theta_o))/sqrt(8 pi), K = tan theta erfc(tau cot theta/(2 sigma))
//! S = S1(theta_i) S1(theta_o), S1 = (1 - erfc(x)/2)/(1 + L), L = exp(-x^2)/(2 x sqrt pi) - erfc(x)/2,
//!   x = tau cot theta/(2 sigma)
//! G = (|wi + wo|^2/(cos theta_i + cos theta_o))^2
//!
//! kd: diffuse albedo, ks: scale of the lobe, per channel, dimensionless; sigma: root mean square height, tau:
//! autocorrelation length, lambda: wavelength, micrometres; eta: refractive index relative to air; p: sum of the two
//! directions projected onto the surface. F: the dielectric. Reciprocal; energy is not conserved by construction.
//! Source: He et al. 1991, eqs. 23-25 and 76-84, doi:10.1145/127719.122738, with the exponential that the authors' erratum
//! adds to eq. 25. The polarisation sum of eq. 76 is (1 - (wi.wo)^2)^2, which its denominator cancels: what is left is G.
//! Difference: no mirror term (a table cannot hold one) and one wavelength, 0.55 um, for all channels, as Ngan et al. 2005,
//! doi:10.2312/EGWR/EGSR05/117-126, fit one lobe to all three; other wavelengths from 0.5 to 0.65 um move the median
//! log error of their fits, 0.45, by less than 0.01. Above g = 18 the sum is its limit exp(-(pi tau |p|/lambda)^2/g)/g, blended in up
//! to g = 19: the Beckmann lobe of slope 2 sigma'/tau. Cost: up to 70 exponentials.

use super::fresnel::dielectric;
use super::{HalfVector, diffuse_plus, model};
use crate::math::Vec3;
use crate::math::dual::Scalar;
use std::f64::consts::PI;

/// Wavelength, micrometres.
const LAMBDA: f64 = 0.55;

/// Above this g the sum has reached its limit within a few per cent.
const ROUGH: f64 = 18.0;

model! {
    /// Diffuse albedo `kd`, scale `ks`, root mean square height `sigma`, autocorrelation length `tau`, index `eta`.
    He = "he" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        // The published fits compensate for an index next to 1.
        ks: Colour("1", (0.0, 1e10), 1.0),
        sigma: Number("um", (1e-3, 20.0), 0.5),
        tau: Number("um", (0.1, 1e3), 10.0),
        eta: Number("1", (1.0, 1e3), 1.5),
    }
}

impl<S: Scalar> He<S> {
    /// x = tau cot theta / (2 sigma), where that is small enough to matter.
    fn steepness(&self, cos: f64) -> Option<S> {
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        // Where x > 6 both erfc and the Gaussian are below 1e-15.
        let x = self.tau / self.sigma * (0.5 * cos / sin.max(1e-300));
        (x.value() < 6.0).then_some(x)
    }

    /// S1, eqs. 24 and 25.
    fn masking(&self, cos: f64) -> S {
        let one = S::from(1.0);
        let Some(x) = self.steepness(cos) else { return one };
        let half = (one - x.erf()) * 0.5;
        let lambda = (-(x * x)).exp() / (x * (2.0 * PI.sqrt())) - half;
        (one - half) / (lambda + 1.0)
    }

    /// The height that is neither masked nor shadowed, sigma' (eqs. 80 to 83).
    fn apparent_height(&self, cos_i: f64, cos_o: f64) -> S {
        let one = S::from(1.0);
        let k = |cos: f64| match self.steepness(cos) {
            Some(x) => (one - x.erf()) * ((1.0 - cos * cos).sqrt() / cos),
            None => S::from(0.0),
        };
        let target = (k(cos_i) + k(cos_o)) / (8.0 * PI).sqrt();
        let mut z = if target.value() <= 1.0 { target } else { (target.ln() * 2.0).sqrt() };
        // Newton's steps double the digits; from these starts six reach the last one.
        for _ in 0..6 {
            let e = (z * z * 0.5).exp();
            z = z - (z * e - target) / ((z * z + 1.0) * e);
        }
        self.sigma / (z * z + 1.0).sqrt()
    }

    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let v = wi + wo;
        let root = self.apparent_height(wi.z, wo.z) * (2.0 * PI / LAMBDA * v.z);
        let spread = self.tau * (PI / LAMBDA);
        let series = interference(root * root, spread * spread * (v.x * v.x + v.y * v.y));
        let d = series * spread * spread * 0.25;
        let s = self.masking(wi.z) * self.masking(wo.z);
        let g = (v.dot(v) / v.z).powi(2);
        let lobe = d * s * dielectric(self.eta, h.cos_theta_d) * (g / (PI * wi.z * wo.z));
        diffuse_plus(self.kd, self.ks, lobe)
    }
}

/// The sum over m of eq. 78, for g and (pi tau |p|/lambda)^2.
fn interference<S: Scalar>(g: S, spread: S) -> S {
    let rough = || (-(spread / g)).exp() / g;
    let weight = (g.value() - ROUGH).clamp(0.0, 1.0);
    if weight == 1.0 {
        return rough();
    }
    let mut sum = S::from(0.0);
    let mut power = (-g).exp();
    for m in 1..=64 {
        let m = f64::from(m);
        power = power * g / m;
        sum = sum + power * (-(spread / m)).exp() / m;
        // Beyond m = g the terms fall faster than geometrically.
        if m > 2.0 * g.value() && power.value() < 1e-18 * sum.value() {
            break;
        }
    }
    if weight == 0.0 { sum } else { sum + (rough() - sum) * (g - ROUGH) }
}

#[cfg(test)]
mod tests {
    use super::super::microfacet::beckmann_distribution;
    use super::*;
    use crate::math::coordinates::standard_directions;

    /// Geometric optics: a very rough surface seen from above, where nothing is hidden, is Beckmann's of slope
    /// 2 sigma/tau.
    #[test]
    fn a_rough_surface_is_a_microfacet_surface() {
        let (wi, wo) = standard_directions(0.3, 0.5, 2.9);
        let (sigma, tau, eta) = (5.0, 100.0, 1.7);
        let h = HalfVector::new(wi, wo);
        let he = He { kd: [0.0; 3], ks: [1.0; 3], sigma, tau, eta }.formula(wi, wo)[0];
        let beckmann = beckmann_distribution(2.0 * sigma / tau, &h) * dielectric(eta, h.cos_theta_d);
        let expected = beckmann / (4.0 * wi.z * wo.z);
        assert!((he / expected - 1.0f64).abs() < 1e-9, "{he} {expected}");
    }

    /// The sum over m of g^m e^-g/(m! m) tends to 1/g + 1/g^2 + 2/g^3 + ... (the moments of 1/m of a Poisson variable).
    #[test]
    fn the_sum_meets_its_limit() {
        let g = 17.9f64;
        let expected = 1.0 / g + 1.0 / (g * g) + 2.0 / g.powi(3) + 6.0 / g.powi(4) + 24.0 / g.powi(5);
        assert!((interference(g, 0.0) / expected - 1.0).abs() < 3e-4);
        let (below, above) = (interference(18.0, 3.0), interference(19.0, 3.0));
        assert!((interference(18.0 + 1e-9, 3.0) / below - 1.0f64).abs() < 1e-8);
        assert!((interference(19.0 - 1e-9, 3.0) / above - 1.0f64).abs() < 1e-8);
    }

    /// K is implicit in z: the equation is met.
    #[test]
    fn the_apparent_height_solves_its_equation() {
        for (sigma, cos) in [(1.0, 0.3), (8.0, 0.1), (0.5, 0.02)] {
            let he = He { kd: [0.0; 3], ks: [1.0; 3], sigma, tau: 3.0, eta: 1.5 };
            let z2 = (sigma / he.apparent_height(cos, cos)).powi(2) - 1.0;
            let tan = (1.0 - cos * cos).sqrt() / cos;
            let k = tan * crate::math::erf::erfc(3.0 / (2.0 * sigma * tan));
            let expected = 2.0 * k / (8.0 * PI).sqrt();
            assert!((z2.sqrt() * (0.5 * z2).exp() / expected - 1.0).abs() < 1e-9, "{sigma} {cos}");
        }
    }
}
