//! ABC for smooth surfaces: an inverse power of the distance between the projected directions, as scattering theory has it.
//!
//! f = kd/pi + F(eta, theta) A / (1 + B |p|^2)^C
//! p: sum of the two directions projected onto the surface, so zero in the mirror direction
//! F: unpolarised Fresnel reflectance of a dielectric at cos theta = sqrt(1 - |q|^2/4), q: difference of the projections
//!
//! kd: diffuse albedo per channel, dimensionless; A: height of the lobe per channel, 1/sr; B: inverse width; C: fall-off;
//! eta: refractive index relative to air; all dimensionless. Reciprocal; no masking; energy is not conserved by
//! construction.
//! Source: Loew et al. 2012, eqs. 10, 12, 14, doi:10.1145/2077341.2077350. Cost: one power.

use super::fresnel::dielectric;
use super::{diffuse_plus, model};
use crate::math::Vec3;
use crate::math::dual::Scalar;

model! {
    /// Diffuse albedo `kd`, lobe height `a`, inverse width `b`, fall-off `c`, refractive index `eta`.
    AbcSmooth = "abc-smooth" {
        kd: Colour("1", (0.0, 1.0), 0.2),
        a: Colour("1/sr", (0.0, 1e6), 10.0),
        b: Number("1", (0.0, 1e9), 1000.0),
        c: Number("1", (0.0, 10.0), 1.0),
        eta: Number("1", (1.0, 1e3), 1.5),
    }
}

impl<S: Scalar> AbcSmooth<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let squared = |x: f64, y: f64| x * x + y * y;
        let sum = squared(wi.x + wo.x, wi.y + wo.y);
        let cos = (1.0 - 0.25 * squared(wi.x - wo.x, wi.y - wo.y)).max(0.0).sqrt();
        let shape = (self.b * sum + 1.0).powf(-self.c);
        diffuse_plus(self.kd, self.a, shape * dielectric(self.eta, cos))
    }
}
