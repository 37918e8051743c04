//! The base of OpenPBR Surface, isotropic: a metal, a dielectric over a diffuse base, and a mix of both.
//!
//! `openpbr-metal`:      f = specular_weight F82 D G / (4 cos_i cos_o)
//! `openpbr-dielectric`: f = specular_color F D G / (4 cos_i cos_o) + (1 - E(cos_i)) (1 - E(cos_o)) / (1 - Em) f_diffuse
//! `openpbr`:            the metal and the dielectric, mixed by base_metalness
//!
//!   D, G: GGX with alpha = max(specular_roughness^2, 0.001), both directions masked independently; single scattering
//!   F82 = schlick(base_color) - cos (1 - cos)^6 / (m (1 - m)^6) (1 - specular_color) schlick(base_color, m), m = 1/7
//!   F: the exact dielectric of index (1 + e)/(1 - e), e^2 = specular_weight ((specular_ior - 1)/(specular_ior + 1))^2
//!   f_diffuse = base_color/pi A (1 + r s/t) + ms/pi (1 - Ed(cos_i)) (1 - Ed(cos_o)) / (1 - Edm): rough diffuse reflection, r =
//!     base_diffuse_roughness, A = 1/(1 + (1/2 - 2/(3 pi)) r), s = wi.wo - cos_i cos_o, t = max(cos_i, cos_o) where s > 0, else 1,
//!     ms = base_color^2 Edm / (1 - base_color (1 - Edm)), with Ed and Edm the albedos of the first term in closed form
//!   E, Em: directional albedo of the specular lobe, and its mean
//!
//! All parameters are dimensionless and have the names of OpenPBR; `base_weight` is 1. Reciprocal: of the two layerings that the
//! specification allows, this is the symmetric one. It keeps the specification's meaning of `base_color`: towards the normal,
//! (1 - E) base_color comes back from below. E is a rational fit of Schlick's lobe, E = e^2 a + e/(e + 0.02) b: within 0.05 of a
//! quadrature for indices from 1.2 to 2, alpha from 0.09 and angles to 80 degrees, and at most twice that beyond. Renderers differ in the
//! layering, and some add light that is scattered twice.
//! Source: OpenPBR Surface 1.1, sections *Metal*, *Glossy-diffuse* and *Microfacet model*
//! (<https://academysoftwarefoundation.github.io/OpenPBR/>); F82: Kutz, Hasan & Edmondson 2021, *Novel aspects of the Adobe Standard
//! Material*; diffuse: Portsmouth, Kutz & Hill 2025, *EON: a practical energy-preserving rough diffuse BRDF*,
//! <https://jcgt.org/published/0014/01/06/>; the fit of E: MaterialX 1.39, `mx_ggx_dir_albedo_analytic`.
//! Cost: a dielectric evaluates the fit ten times.

use super::fresnel::{dielectric, schlick};
use super::microfacet::{ggx_distribution, ggx_visibility};
use super::{HalfVector, model};
use crate::math::Vec3;
use crate::math::dual::Scalar;
use std::f64::consts::{FRAC_1_PI, PI};

model! {
    /// Metal and dielectric mixed by `base_metalness`.
    OpenPbr = "openpbr" {
        base_color: Colour("1", (0.0, 1.0), 0.2),
        base_metalness: Number("1", (0.0, 1.0), 0.0),
        base_diffuse_roughness: Number("1", (0.0, 1.0), 0.0),
        specular_weight: Number("1", (0.0, 1.0), 0.9),
        specular_color: Colour("1", (0.0, 1.0), 0.9),
        specular_roughness: Number("1", (0.0, 1.0), 0.4),
        specular_ior: Number("1", (1.0, 3.0), 1.5),
    }
}

model! {
    /// A metal: `base_color` at normal incidence, tinted by `specular_color` towards 82 degrees.
    OpenPbrMetal = "openpbr-metal" {
        base_color: Colour("1", (0.0, 1.0), 0.2),
        specular_weight: Number("1", (0.0, 1.0), 0.9),
        specular_color: Colour("1", (0.0, 1.0), 0.9),
        specular_roughness: Number("1", (0.0, 1.0), 0.4),
    }
}

model! {
    /// A dielectric over a diffuse base.
    OpenPbrDielectric = "openpbr-dielectric" {
        base_color: Colour("1", (0.0, 1.0), 0.2),
        base_diffuse_roughness: Number("1", (0.0, 1.0), 0.0),
        specular_weight: Number("1", (0.0, 1.0), 0.9),
        specular_color: Colour("1", (0.0, 1.0), 0.9),
        specular_roughness: Number("1", (0.0, 1.0), 0.4),
        specular_ior: Number("1", (1.0, 3.0), 1.5),
    }
}

/// Smallest alpha of GGX: below it a pair of directions says nothing of a lobe.
const LEAST_ALPHA: f64 = 1e-3;
/// Keeps the slope of the index finite where it is 1.
const LEAST_REFLECTANCE: f64 = 1e-16;

impl<S: Scalar> OpenPbr<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let metal = OpenPbrMetal {
            base_color: self.base_color,
            specular_weight: self.specular_weight,
            specular_color: self.specular_color,
            specular_roughness: self.specular_roughness,
        };
        let dielectric = OpenPbrDielectric {
            base_color: self.base_color,
            base_diffuse_roughness: self.base_diffuse_roughness,
            specular_weight: self.specular_weight,
            specular_color: self.specular_color,
            specular_roughness: self.specular_roughness,
            specular_ior: self.specular_ior,
        };
        let (metal, dielectric) = (metal.formula(wi, wo), dielectric.formula(wi, wo));
        std::array::from_fn(|c| dielectric[c] + (metal[c] - dielectric[c]) * self.base_metalness)
    }
}

impl<S: Scalar> OpenPbrMetal<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let alpha = alpha(self.specular_roughness);
        let lobe = ggx_distribution(alpha, &h) * ggx_visibility(alpha, wi, wo) * self.specular_weight;
        std::array::from_fn(|c| lobe * schlick_f82(self.base_color[c], self.specular_color[c], h.cos_theta_d))
    }
}

impl<S: Scalar> OpenPbrDielectric<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let one = S::from(1.0);
        let alpha = alpha(self.specular_roughness);
        let unmodulated = (self.specular_ior - 1.0) / (self.specular_ior + 1.0);
        // The square root of the reflectance at normal incidence.
        let root = (self.specular_weight * unmodulated * unmodulated + LEAST_REFLECTANCE).sqrt();
        let index = (one + root) / (one - root);
        let lobe = ggx_distribution(alpha, &h) * ggx_visibility(alpha, wi, wo) * dielectric(index, h.cos_theta_d);
        let through = |cos: f64| one - albedo(alpha, root, cos);
        let mean: S = GAUSS_4.iter().fold(S::from(0.0), |sum, &(cos, weight)| {
            sum + (through(cos) * (cos * weight) + through(1.0 - cos) * ((1.0 - cos) * weight)) * 2.0
        });
        let layer = through(wi.z) * through(wo.z) / mean;
        let diffuse = RoughDiffuse::of(self.base_diffuse_roughness, wi, wo);
        std::array::from_fn(|c| lobe * self.specular_color[c] + layer * diffuse.value(self.base_color[c]))
    }
}

fn alpha<S: Scalar>(roughness: S) -> S {
    (roughness * roughness).max(S::from(LEAST_ALPHA))
}

/// Schlick's reflectance of a metal, lowered at 82 degrees to `tint` times itself.
fn schlick_f82<S: Scalar>(f0: S, tint: S, cos: f64) -> S {
    const EDGE: f64 = 1.0 / 7.0;
    let share = cos * (1.0 - cos).powi(6) / (EDGE * (1.0 - EDGE).powi(6));
    schlick(f0, cos) - schlick(f0, EDGE) * (S::from(1.0) - tint) * share
}

/// Nodes below 1/2 and weights of an eight-point Gauss-Legendre rule from 0 to 1; the other nodes mirror them.
const GAUSS_4: [(f64, f64); 4] = [
    (0.019855071751231884, 0.05061426814518813),
    (0.10166676129318664, 0.11119051722668724),
    (0.2372337950418355, 0.15685332293894363),
    (0.4082826787521751, 0.181341891689181),
];

/// How much light a lobe of GGX facets sends back, all directions together; `root` is the square root of their reflectance at normal
/// incidence.
fn albedo<S: Scalar>(alpha: S, root: S, cos: f64) -> S {
    /// Coefficients of 1, x, y, xy, x^2, y^2, x^2 y, x y^2, x^2 y^2 with x the cosine and y alpha, of two numerators and denominators.
    const FIT: [[f64; 4]; 9] = [
        [0.1003, 0.9345, 1.0, 1.0],
        [-0.6303, -2.323, -1.765, 0.2281],
        [9.748, 2.229, 8.263, 15.94],
        [-2.038, -3.748, 11.53, -55.83],
        [29.34, 1.424, 28.96, 13.08],
        [-8.245, -0.7684, -7.507, 41.26],
        [-26.44, 1.436, -36.11, 54.9],
        [19.99, 0.2913, 15.86, 300.2],
        [-5.448, 0.6286, 33.37, -285.1],
    ];
    let (x, x2, y, y2) = (cos, cos * cos, alpha, alpha * alpha);
    let sum = |k: usize| {
        let at = |j: usize| FIT[j][k];
        let constant = at(0) + at(1) * x + at(4) * x2;
        y * (at(2) + at(3) * x + at(6) * x2) + y2 * (at(5) + at(7) * x + at(8) * x2) + constant
    };
    let clamped = |v: S| v.max(S::from(0.0)).min(S::from(1.0));
    let (at_normal, at_grazing) = (clamped(sum(0) / sum(2)), clamped(sum(1) / sum(3)));
    root * root * at_normal + root / (root + 0.02) * at_grazing
}

/// The diffuse lobe without its colour.
struct RoughDiffuse<S> {
    /// 1/pi A (1 + r s/t)
    single: S,
    /// What is scattered more than once, for a colour whose `ms` is 1.
    multiple: S,
    mean_albedo: S,
}

impl<S: Scalar> RoughDiffuse<S> {
    fn of(roughness: S, wi: Vec3, wo: Vec3) -> Self {
        let one = S::from(1.0);
        let scale = one / (roughness * (0.5 - 2.0 / (3.0 * PI)) + 1.0);
        let s = wi.dot(wo) - wi.z * wo.z;
        let bent = if s > 0.0 { s / wi.z.max(wo.z) } else { s };
        let missing = |cos: f64| one - scale * (roughness * (interreflection(cos) * FRAC_1_PI) + 1.0);
        let mean_albedo = scale * (roughness * (2.0 / 3.0 - 28.0 / (15.0 * PI)) + 1.0);
        let lost = one - mean_albedo;
        // Without roughness nothing is scattered twice, and the quotient of its parts is 0/0.
        let multiple =
            if lost.value() > 1e-12 { missing(wi.z) * missing(wo.z) / lost * FRAC_1_PI } else { S::from(0.0) };
        Self { single: scale * (roughness * bent + 1.0) * FRAC_1_PI, multiple, mean_albedo }
    }

    fn value(&self, colour: S) -> S {
        let one = S::from(1.0);
        let scattered = colour * colour * self.mean_albedo / (one - colour * (one - self.mean_albedo));
        self.single * colour + self.multiple * scattered
    }
}

/// G of the directional albedo A + B G/pi of Fujii's diffuse lobe (Portsmouth et al. 2025, eq. 17).
fn interreflection(cos: f64) -> f64 {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    sin * (cos.min(1.0).acos() - sin * cos) + 2.0 / 3.0 * (sin / cos * (1.0 - sin.powi(3)) - sin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::AnalyticBrdf;
    use crate::math::coordinates::standard_directions;

    /// Light that comes back for a direction of incidence, by midpoint quadrature over the hemisphere.
    fn reflected(model: &dyn AnalyticBrdf, cos: f64) -> f64 {
        let (rings, sectors) = (600, 180);
        let (d_theta, d_phi) = (0.5 * PI / f64::from(rings), PI / f64::from(sectors));
        let mut sum = 0.0;
        for ring in 0..rings {
            let theta = (f64::from(ring) + 0.5) * d_theta;
            for sector in 0..sectors {
                let (wi, wo) = standard_directions(cos.acos(), theta, (f64::from(sector) + 0.5) * d_phi);
                sum += 2.0 * model.value(wi, wo)[0] * wo.z * theta.sin() * d_theta * d_phi;
            }
        }
        sum
    }

    fn dielectric_of(base: f64, roughness: f64, ior: f64, diffuse_roughness: f64) -> OpenPbrDielectric {
        OpenPbrDielectric {
            base_color: [base; 3],
            base_diffuse_roughness: diffuse_roughness,
            specular_weight: 1.0,
            specular_color: [1.0; 3],
            specular_roughness: roughness,
            specular_ior: ior,
        }
    }

    #[test]
    fn the_fit_of_the_albedo_is_near_a_quadrature() {
        for ior in [1.2, 1.33, 1.5, 2.0] {
            for roughness in [0.3f64, 0.5, 0.8, 1.0] {
                for cos in [0.15, 0.4, 0.7, 0.95] {
                    let quadrature = reflected(&dielectric_of(0.0, roughness, ior, 0.0), cos);
                    let fit = albedo(roughness * roughness, (ior - 1.0) / (ior + 1.0), cos);
                    assert!((quadrature - fit).abs() < 0.05, "{ior} {roughness} {cos}: {quadrature} {fit}");
                }
            }
        }
    }

    /// With nothing absorbed everything comes back, but for the error of the fit and what facets scatter twice.
    #[test]
    fn a_white_dielectric_keeps_the_light() {
        for (roughness, diffuse_roughness) in [(0.3, 0.0), (0.3, 1.0), (0.6, 0.5)] {
            for cos in [0.3, 0.6, 0.95] {
                let found = reflected(&dielectric_of(1.0, roughness, 1.5, diffuse_roughness), cos);
                assert!((found - 1.0).abs() < 0.04, "{roughness} {diffuse_roughness} {cos}: {found}");
            }
        }
    }

    /// Towards the normal, base_color of what passes the surface comes back: the specification's definition of the colour.
    #[test]
    fn the_colour_is_the_share_that_comes_back_from_below() {
        let black = reflected(&dielectric_of(0.0, 0.4, 1.5, 0.0), 1.0 - 1e-9);
        for base in [0.2, 0.5, 0.9] {
            let below = reflected(&dielectric_of(base, 0.4, 1.5, 0.0), 1.0 - 1e-9) - black;
            assert!((below / ((1.0 - black) * base) - 1.0).abs() < 0.01, "{base}: {below}");
        }
    }

    #[test]
    fn rough_diffuse_reflection_has_the_albedo_of_its_closed_form() {
        for roughness in [0.2, 1.0] {
            let model = OpenPbrDielectric { specular_weight: 0.0, ..dielectric_of(1.0, 0.5, 1.5, roughness) };
            for cos in [0.2, 0.7] {
                // White light comes back whole, whatever the roughness.
                let found = reflected(&model, cos);
                assert!((found - 1.0).abs() < 2e-3, "{roughness} {cos}: {found}");
            }
        }
    }

    #[test]
    fn a_metal_has_the_tinted_reflectance_at_82_degrees() {
        let f = |cos| schlick_f82(0.6, 0.3, cos);
        assert!((f(1.0) - 0.6).abs() < 1e-14 && (f(0.0) - 1.0).abs() < 1e-14);
        assert!((f(1.0 / 7.0) - 0.3 * schlick(0.6, 1.0 / 7.0)).abs() < 1e-14);
    }
}
