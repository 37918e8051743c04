//! The two parameterisations of an isotropic BRDF, and the way between them.
//!
//! * *standard*: (theta_i, theta_o, phi_d), the polar angles of the incident and outgoing directions and the
//!   difference of their azimuths, with phi_i = 0;
//! * *half/difference* (Rusinkiewicz 1998, doi:10.1007/978-3-7091-6453-2_2): (theta_h, theta_d, phi_d), the polar
//!   angle of the half vector and the incident direction seen in the frame of the half vector.
//!
//! All angles are in radians. The name `phi_d` means the azimuth difference in the first and the azimuth of the
//! difference vector in the second, as the field uses it.

use super::Vec3;
use std::f64::consts::PI;

/// Half/difference coordinates of a pair of directions, radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfDifference {
    /// Polar angle of the half vector, 0 to pi/2.
    pub theta_h: f64,
    /// Angle between the half vector and either direction, 0 to pi/2.
    pub theta_d: f64,
    /// Azimuth of the incident direction around the half vector, -pi to pi.
    pub phi_d: f64,
}

/// The pair of unit directions at standard coordinates (radians), with phi_i = 0.
pub fn standard_directions(theta_i: f64, theta_o: f64, phi_d: f64) -> (Vec3, Vec3) {
    (Vec3::from_spherical(theta_i, 0.0), Vec3::from_spherical(theta_o, phi_d))
}

/// Half and difference vectors of `wi`, `wo`, the whole pair rotated about the normal so that phi_h = 0.
///
/// The difference vector is `wi` in the frame of the half vector. Opposite grazing directions, whose half vector
/// vanishes, are given the normal as their half vector. Where the half vector is the normal its azimuth is undefined:
/// it is taken across the plane of incidence (phi_d = -90 degrees), where rounding leads a naive `atan2` as well.
pub fn half_and_difference_vectors(wi: Vec3, wo: Vec3) -> (Vec3, Vec3) {
    let sum = wi + wo;
    let length = sum.length();
    let h = if length > 1e-12 { sum * (1.0 / length) } else { Vec3::new(0.0, 0.0, 1.0) };
    let sin_h = (h.x * h.x + h.y * h.y).sqrt();
    let sin_i = (wi.x * wi.x + wi.y * wi.y).sqrt();
    let (cos_phi, sin_phi) = if sin_h > 1e-12 {
        (h.x / sin_h, h.y / sin_h)
    } else if sin_i > 1e-12 {
        (-wi.y / sin_i, wi.x / sin_i)
    } else {
        (1.0, 0.0)
    };
    // Rotate by -phi_h about the normal, then by -theta_h about the bitangent.
    let x = cos_phi * wi.x + sin_phi * wi.y;
    let y = cos_phi * wi.y - sin_phi * wi.x;
    let d = Vec3::new(h.z * x - sin_h * wi.z, y, sin_h * x + h.z * wi.z);
    (Vec3::new(sin_h, 0.0, h.z), d)
}

/// Half/difference angles of a pair of unit directions.
pub fn half_difference(wi: Vec3, wo: Vec3) -> HalfDifference {
    let (h, d) = half_and_difference_vectors(wi, wo);
    HalfDifference {
        theta_h: h.x.atan2(h.z),
        theta_d: (d.x * d.x + d.y * d.y).sqrt().atan2(d.z),
        phi_d: d.y.atan2(d.x),
    }
}

/// The pair of unit directions at half/difference coordinates, with phi_h = 0. Either may lie below the horizon.
pub fn half_difference_directions(c: HalfDifference) -> (Vec3, Vec3) {
    let d = Vec3::from_spherical(c.theta_d, c.phi_d);
    let (sin_h, cos_h) = c.theta_h.sin_cos();
    let rotate = |v: Vec3| Vec3::new(cos_h * v.x + sin_h * v.z, v.y, cos_h * v.z - sin_h * v.x);
    (rotate(d), rotate(Vec3::new(-d.x, -d.y, d.z)))
}

/// Folds an azimuth of the difference vector into [0, pi): reciprocity makes phi_d and phi_d + pi the same.
pub fn fold_reciprocal(phi_d: f64) -> f64 {
    let folded = if phi_d < 0.0 { phi_d + PI } else { phi_d };
    if folded >= PI { folded - PI } else { folded }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_difference_round_trip() {
        for (theta_h, theta_d, phi_d) in [(0.1, 0.7, 0.4), (0.9, 0.2, -2.0), (0.01, 0.5, 1.0), (1.2, 0.1, 3.0)] {
            let c = HalfDifference { theta_h, theta_d, phi_d };
            let (wi, wo) = half_difference_directions(c);
            let back = half_difference(wi, wo);
            assert!((back.theta_h - theta_h).abs() < 1e-12);
            assert!((back.theta_d - theta_d).abs() < 1e-12);
            assert!((back.phi_d - phi_d).abs() < 1e-12);
        }
    }

    #[test]
    fn mirror_directions_have_their_half_vector_at_the_normal() {
        let (wi, wo) = standard_directions(0.6, 0.6, PI);
        let c = half_difference(wi, wo);
        assert!(c.theta_h.abs() < 1e-12);
        assert!((c.theta_d - 0.6).abs() < 1e-12);
        assert!((c.phi_d + 0.5 * PI).abs() < 1e-12);
    }

    #[test]
    fn turning_the_pair_about_the_normal_changes_nothing() {
        for (theta_h, phi_d) in [(0.0, -0.5 * PI), (0.4, 2.0)] {
            let (wi, wo) = half_difference_directions(HalfDifference { theta_h, theta_d: 0.7, phi_d });
            let (sin, cos) = 1.1f64.sin_cos();
            let turn = |v: Vec3| Vec3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z);
            assert!((half_difference(turn(wi), turn(wo)).phi_d - phi_d).abs() < 1e-12);
        }
    }

    #[test]
    fn swapping_directions_turns_phi_d_by_pi() {
        let (wi, wo) = standard_directions(0.3, 1.0, 0.8);
        let a = half_difference(wi, wo).phi_d;
        let b = half_difference(wo, wi).phi_d;
        assert!((fold_reciprocal(a) - fold_reciprocal(b)).abs() < 1e-12);
    }
}
