//! Materials of pbrt-v4 that have a closed form: a rough conductor, and a mix of a diffuse surface and a rough conductor.
//!
//! `pbrt-conductor`: f = F D V, F the exact conductor of index eta and extinction k, per channel
//! `pbrt-mix`:       f = (1 - amount) reflectance/pi + amount F D V, F the conductor of index 1 that reflects `specular` at normal
//!                   incidence: k = 2 sqrt(specular/(1 - specular))
//! D: GGX; V: visibility with both directions masked at the same height, as in `gltf.rs`
//!
//! alpha is pbrt's roughness with `remaproughness` false; all parameters are dimensionless. Reciprocal, and at most what they receive
//! comes back. pbrt renders spectra: it makes them of the colours here, which changes colours a little.
//! Source: Pharr, Jakob & Humphreys 2023, *Physically Based Rendering*, 4th edition, sections 9.2, 9.3.6 and 9.6, and its `conductor`,
//! `diffuse` and `mix` materials. Cost: that of the Fresnel term, and two square roots.

use super::fresnel::conductor;
use super::microfacet::{ggx_distribution, ggx_visibility_of_one_height};
use super::{HalfVector, model};
use crate::math::Vec3;
use crate::math::dual::Scalar;
use std::f64::consts::FRAC_1_PI;

model! {
    /// Refractive index `eta` and extinction `k` of a conductor, roughness `alpha`.
    PbrtConductor = "pbrt-conductor" {
        eta: Colour("1", (0.01, 100.0), 1.0),
        k: Colour("1", (1e-3, 100.0), 3.0),
        alpha: Number("1", (1e-3, 1.0), 0.2),
    }
}

model! {
    /// A diffuse surface of albedo `reflectance`, of which the share `amount` is covered by a conductor that reflects `specular`.
    PbrtMix = "pbrt-mix" {
        reflectance: Colour("1", (0.0, 1.0), 0.2),
        specular: Colour("1", (1e-4, 0.9999), 0.5),
        amount: Number("1", (0.0, 1.0), 0.1),
        alpha: Number("1", (1e-3, 1.0), 0.2),
    }
}

impl<S: Scalar> PbrtConductor<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let lobe = ggx_distribution(self.alpha, &h) * ggx_visibility_of_one_height(self.alpha, wi, wo);
        std::array::from_fn(|c| lobe * conductor(self.eta[c], self.k[c], h.cos_theta_d))
    }
}

impl<S: Scalar> PbrtMix<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let one = S::from(1.0);
        let lobe = ggx_distribution(self.alpha, &h) * ggx_visibility_of_one_height(self.alpha, wi, wo) * self.amount;
        std::array::from_fn(|c| {
            let k = (self.specular[c] / (one - self.specular[c])).sqrt() * 2.0;
            (one - self.amount) * self.reflectance[c] * FRAC_1_PI + lobe * conductor(one, k, h.cos_theta_d)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::AnalyticBrdf;

    /// Towards the normal D V is 1/(4 pi alpha^2), and the conductor reflects `specular`.
    #[test]
    fn the_conductor_of_a_mix_reflects_what_it_says() {
        let n = Vec3::new(0.0, 0.0, 1.0);
        let model = PbrtMix { reflectance: [0.4; 3], specular: [0.2, 0.5, 0.9], amount: 0.25, alpha: 0.5 }.value(n, n);
        for (found, specular) in model.into_iter().zip([0.2, 0.5, 0.9]) {
            let expected = FRAC_1_PI * (0.75 * 0.4 + 0.25 * specular / (4.0 * 0.25));
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
    }
}
