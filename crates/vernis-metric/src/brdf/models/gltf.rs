//! The metallic-roughness material of glTF 2.0, with index of refraction and specular weight.
//!
//! f = (1 - metallic) ((1 - F) base_color/pi + F D V) + metallic schlick(base_color) D V
//! F = specular (R0 + (1 - R0)(1 - cos_d)^5), R0 = ((ior - 1)/(ior + 1))^2
//! D: GGX with alpha = max(roughness^2, 0.001)
//! V = 1/2 / (cos_i sqrt(a + (1 - a) cos_o^2) + cos_o sqrt(a + (1 - a) cos_i^2)), a = alpha^2: both directions masked at the same height
//!
//! All parameters are dimensionless and have the names of glTF: `base_color` is baseColorFactor, `metallic` and `roughness` are
//! metallicFactor and roughnessFactor, `ior` and `specular` those of KHR_materials_ior and KHR_materials_specular (specularFactor).
//! Reciprocal; reflects a little more than it receives where it is white and rough.
//! Source: glTF 2.0, appendix B, <https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html#appendix-b-brdf-implementation>. Difference:
//! the specification leaves the smallest alpha open. Cost: two square roots.

use super::fresnel::schlick;
use super::microfacet::{ggx_distribution, ggx_visibility_of_one_height};
use super::{HalfVector, model};
use crate::math::Vec3;
use crate::math::dual::Scalar;
use std::f64::consts::FRAC_1_PI;

/// Smallest alpha of GGX.
const LEAST_ALPHA: f64 = 1e-3;

model! {
    /// Colour, metalness, roughness, index of refraction, and weight of the dielectric's specular lobe.
    Gltf = "gltf" {
        base_color: Colour("1", (0.0, 1.0), 0.2),
        metallic: Number("1", (0.0, 1.0), 0.0),
        roughness: Number("1", (0.0, 1.0), 0.4),
        ior: Number("1", (1.0, 3.0), 1.5),
        specular: Number("1", (0.0, 1.0), 0.9),
    }
}

impl<S: Scalar> Gltf<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let one = S::from(1.0);
        let alpha = (self.roughness * self.roughness).max(S::from(LEAST_ALPHA));
        let lobe = ggx_distribution(alpha, &h) * ggx_visibility_of_one_height(alpha, wi, wo);
        let root = (self.ior - 1.0) / (self.ior + 1.0);
        let fresnel = schlick(root * root, h.cos_theta_d) * self.specular;
        let dielectric_part = one - self.metallic;
        std::array::from_fn(|c| {
            let dielectric = (one - fresnel) * self.base_color[c] * FRAC_1_PI + fresnel * lobe;
            let metal = schlick(self.base_color[c], h.cos_theta_d) * lobe;
            dielectric_part * dielectric + self.metallic * metal
        })
    }
}
