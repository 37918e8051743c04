//! Reflectance of a smooth boundary against the cosine of the angle of incidence, unpolarised light.
//!
//! Dimensionless; each is 1 at grazing incidence. Cost: none (Schlick), one square root (dielectric), two (conductor).

use crate::math::dual::Scalar;

/// F = f0 + (1 - f0)(1 - cos theta)^5, `f0` the reflectance at normal incidence (Schlick 1994, eq. 15,
/// doi:10.1111/1467-8659.1330233).
pub(super) fn schlick<S: Scalar>(f0: S, cos: f64) -> S {
    f0 + (S::from(1.0) - f0) * (1.0 - cos).powi(5)
}

/// F = (g - c)^2 / (2 (g + c)^2) (1 + ((c (g + c) - 1) / (c (g - c) + 1))^2), g^2 = eta^2 - 1 + c^2: the exact value for
/// a dielectric of relative index `eta` >= 1 (Cook & Torrance 1982, doi:10.1145/357290.357293).
pub(super) fn dielectric<S: Scalar>(eta: S, cos: f64) -> S {
    let g = (eta * eta - 1.0 + cos * cos).sqrt();
    let (minus, plus) = (g - cos, g + cos);
    let polarisation = (plus * cos - 1.0) / (minus * cos + 1.0);
    minus * minus * 0.5 / (plus * plus) * (polarisation * polarisation + 1.0)
}

/// The exact value for a conductor of relative index `eta` and extinction `k`, as the mean of
///
///   Rs = (m - 2 a c + c^2) / (m + 2 a c + c^2),  Rp = Rs (m c^2 - 2 a c s^2 + s^4) / (m c^2 + 2 a c s^2 + s^4),
///   m = sqrt(t^2 + 4 eta^2 k^2), t = eta^2 - k^2 - s^2, a = sqrt((m + t)/2)
///
/// with c, s cosine and sine of the angle of incidence (Born & Wolf 1999, *Principles of Optics*, section 14.2, written
/// without complex numbers). With k = 0 it is the dielectric.
pub(super) fn conductor<S: Scalar>(eta: S, k: S, cos: f64) -> S {
    let cos2 = cos * cos;
    let sin2 = 1.0 - cos2;
    let t = eta * eta - k * k - sin2;
    let m = (t * t + eta * eta * k * k * 4.0).sqrt();
    let ac2 = ((m + t) * 0.5).max(S::from(0.0)).sqrt() * (2.0 * cos);
    let rs = (m + cos2 - ac2) / (m + cos2 + ac2);
    let (even, odd) = (m * cos2 + sin2 * sin2, ac2 * sin2);
    rs * ((even - odd) / (even + odd) + 1.0) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At normal incidence the reflectance is ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2); at grazing incidence it is 1.
    #[test]
    fn both_ends() {
        for eta in [1.0f64, 1.5, 2.5, 99.0] {
            let normal = ((eta - 1.0) / (eta + 1.0)).powi(2);
            assert!((dielectric(eta, 1.0) - normal).abs() < 1e-14);
            assert!((conductor(eta, 0.0, 1.0) - normal).abs() < 1e-14);
            for k in [0.5f64, 7.0] {
                let normal = ((eta - 1.0).powi(2) + k * k) / ((eta + 1.0).powi(2) + k * k);
                assert!((conductor(eta, k, 1.0) - normal).abs() < 1e-14);
                assert!((conductor(eta, k, 0.0) - 1.0).abs() < 1e-14);
            }
        }
        assert!((dielectric(1.5, 0.0) - 1.0).abs() < 1e-14);
        assert_eq!((schlick(0.04, 1.0), schlick(0.04, 0.0)), (0.04, 1.0));
    }

    #[test]
    fn a_conductor_that_does_not_absorb_is_a_dielectric() {
        for cos in [0.1, 0.4, 0.9] {
            assert!((conductor(1.7, 0.0, cos) - dielectric(1.7, cos)).abs() < 1e-14);
        }
    }

    /// Brewster's angle, tan theta = eta: the parallel part vanishes and F = ((eta^2 - 1) / (eta^2 + 1))^2 / 2.
    #[test]
    fn brewsters_angle() {
        let eta = 1.5f64;
        let cos = 1.0 / (1.0 + eta * eta).sqrt();
        let expected = 0.5 * ((eta * eta - 1.0) / (eta * eta + 1.0)).powi(2);
        assert!((dielectric(eta, cos) - expected).abs() < 1e-14);
        assert!((conductor(eta, 0.0, cos) - expected).abs() < 1e-14);
    }
}
