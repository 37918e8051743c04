//! Distributions of microfacet normals, and how much of a facet is lit and seen.
//!
//! D: facets per unit of solid angle and of area (1/sr); visibility: G / (4 cos theta_i cos theta_o), written so that it
//! stays finite at grazing angles (dimensionless).
//! Source: Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206; Smith's masking as the projected area of the facets:
//! Heitz 2014, eqs. 72, 73, <http://jcgt.org/published/0003/02/03/>. Both directions are masked independently.

use super::HalfVector;
use crate::math::Vec3;
use crate::math::dual::Scalar;
use std::f64::consts::PI;

/// D = alpha^2 / (pi cos^4 theta_h (alpha^2 + tan^2 theta_h)^2) (Walter et al. 2007, eq. 33).
pub(super) fn ggx_distribution<S: Scalar>(alpha: S, h: &HalfVector) -> S {
    let alpha2 = alpha * alpha;
    let slope = (alpha2 + h.tan2_theta_h) * (h.cos_theta_h * h.cos_theta_h);
    alpha2 / (slope * PI * slope)
}

/// Smith's visibility for GGX, G1 = 2 / (1 + sqrt(1 + alpha^2 tan^2 theta)) (Walter et al. 2007, eq. 34).
pub(super) fn ggx_visibility<S: Scalar>(alpha: S, wi: Vec3, wo: Vec3) -> S {
    // G1(c) / (2 c)
    let masking = |cos: f64| S::from(1.0) / ggx_area(alpha, cos);
    masking(wi.z) * masking(wo.z)
}

/// Smith's visibility for GGX where facets that are high are both lit and seen: 1 / (2 (cos_i a(cos_o) + cos_o a(cos_i))), a(cos) =
/// sqrt(alpha^2 + (1 - alpha^2) cos^2) (Heitz 2014, eq. 99).
pub(super) fn ggx_visibility_of_one_height<S: Scalar>(alpha: S, wi: Vec3, wo: Vec3) -> S {
    let slant = |cos: f64| ggx_area(alpha, cos) - cos;
    S::from(0.5) / (slant(wo.z) * wi.z + slant(wi.z) * wo.z)
}

/// Twice the area that GGX facets project towards a direction, per unit of surface: G1 = 2 cos theta / area.
pub(super) fn ggx_area<S: Scalar>(alpha: S, cos: f64) -> S {
    let alpha2 = alpha * alpha;
    ((S::from(1.0) - alpha2) * cos * cos + alpha2).sqrt() + cos
}

/// D = exp(-tan^2 theta_h / alpha^2) / (pi alpha^2 cos^4 theta_h) (Walter et al. 2007, eq. 25).
pub(super) fn beckmann_distribution<S: Scalar>(alpha: S, h: &HalfVector) -> S {
    let alpha2 = alpha * alpha;
    let cos2 = h.cos_theta_h * h.cos_theta_h;
    (S::from(-h.tan2_theta_h) / alpha2).exp() / (alpha2 * (PI * cos2 * cos2))
}

/// Smith's visibility for Beckmann (Walter et al. 2007, eq. 26; exact, not their rational approximation).
pub(super) fn beckmann_visibility<S: Scalar>(alpha: S, wi: Vec3, wo: Vec3) -> S {
    let masking = |cos: f64| S::from(1.0) / beckmann_area(alpha, cos);
    masking(wi.z) * masking(wo.z)
}

/// Twice the area that Beckmann facets project towards a direction, per unit of surface: with a = 1/(alpha tan theta),
/// cos theta (1 + erf a) + alpha sin theta exp(-a^2)/sqrt pi.
pub(super) fn beckmann_area<S: Scalar>(alpha: S, cos: f64) -> S {
    let stretched = alpha * (1.0 - cos * cos).max(0.0).sqrt();
    // erfc(6) is 2e-17.
    if stretched.value() * 6.0 <= cos {
        return S::from(2.0 * cos);
    }
    let a = S::from(cos) / stretched;
    (a.erf() + 1.0) * cos + (-(a * a)).exp() * stretched / PI.sqrt()
}

/// Masking by symmetric grooves, G = min(1, 2 n.h n.wi / h.wi, 2 n.h n.wo / h.wo) (Cook & Torrance 1982,
/// doi:10.1145/357290.357293); not yet divided by the cosines.
pub(super) fn v_groove(h: &HalfVector, wi: Vec3, wo: Vec3) -> f64 {
    (2.0 * h.cos_theta_h * wi.z.min(wo.z) / h.cos_theta_d).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(theta_h: f64) -> HalfVector {
        HalfVector { cos_theta_h: theta_h.cos(), tan2_theta_h: theta_h.tan().powi(2), cos_theta_d: 1.0 }
    }

    /// Facets cover the surface: the integral of D cos theta over the hemisphere is 1.
    #[test]
    fn distributions_are_normalised() {
        for alpha in [0.1, 0.5] {
            let n = 200_000;
            let step = 0.5 * PI / f64::from(n);
            let integral = |d: &dyn Fn(&HalfVector) -> f64| -> f64 {
                let ring = |k| {
                    let theta = (f64::from(k) + 0.5) * step;
                    2.0 * PI * theta.sin() * theta.cos() * d(&at(theta)) * step
                };
                (0..n).map(ring).sum()
            };
            assert!((integral(&|h| ggx_distribution(alpha, h)) - 1.0).abs() < 1e-6);
            assert!((integral(&|h| beckmann_distribution(alpha, h)) - 1.0).abs() < 1e-6);
        }
    }

    /// Smith's masking keeps the visible area: the integral of G1 D max(w.h, 0) over the facets is cos theta.
    #[test]
    fn visible_facets_cover_the_projected_surface() {
        let (rings, sectors) = (2000, 360);
        let (d_theta, d_phi) = (0.5 * PI / rings as f64, 2.0 * PI / sectors as f64);
        for (alpha, theta) in [(0.3f64, 0.5f64), (0.6, 1.2), (0.2, 1.45)] {
            let w = Vec3::from_spherical(theta, 0.0);
            let up = Vec3::new(0.0, 0.0, 1.0);
            // Towards the normal G1 is 1, so that the visibility of the pair is that of w times 1/2.
            let (ggx, beckmann) = (ggx_visibility(alpha, w, up) * 2.0, beckmann_visibility(alpha, w, up) * 2.0);
            let (mut area_ggx, mut area_beckmann) = (0.0, 0.0);
            for ring in 0..rings {
                let theta_h = (ring as f64 + 0.5) * d_theta;
                for sector in 0..sectors {
                    let h = Vec3::from_spherical(theta_h, (sector as f64 + 0.5) * d_phi);
                    let weight = w.dot(h).max(0.0) * theta_h.sin() * d_theta * d_phi;
                    area_ggx += weight * ggx_distribution(alpha, &at(theta_h));
                    area_beckmann += weight * beckmann_distribution(alpha, &at(theta_h));
                }
            }
            // G1 = 2 cos(theta) * visibility
            assert!((2.0 * ggx * area_ggx - 1.0).abs() < 2e-3, "GGX {alpha} {theta}: {}", 2.0 * ggx * area_ggx);
            let found = 2.0 * beckmann * area_beckmann;
            assert!((found - 1.0).abs() < 1e-4, "Beckmann {alpha} {theta}: {found}");
        }
    }
}
