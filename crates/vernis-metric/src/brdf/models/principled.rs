//! The principled model of Disney, as Mitsuba 3 has it: a diffuse, a specular, a sheen and a clear-coat lobe, without anisotropy and
//! transmission.
//!
//! f = (1 - metallic) (base_color/pi lerp(fd + fr, fss, flatness) + sheen Sd S) + F D G / (4 cos_i cos_o) + clearcoat/4 Fc Dc Gc
//!
//! with W(x) = (1 - x)^5, Wi = W(cos_i), Wo = W(cos_o), Sd = W(cos_d), R = 2 roughness cos_d^2:
//!   fd  = (1 - Wi/2)(1 - Wo/2), fr = R (Wo + Wi + Wo Wi (R - 1))
//!   fss = 1.25 ((1 + Wi (R/2 - 1))(1 + Wo (R/2 - 1)) (1/(cos_i + cos_o) - 1/2) + 1/2)
//!   S   = lerp(1, T, sheen_tint), T = base_color/luminance(base_color), 1 where it is black
//!   D, G: GGX with alpha = max(roughness^2, 0.001), both directions masked independently
//!   F   = (1 - metallic)((1 - spec_tint) Fe + spec_tint schlick(T R0)) + metallic schlick(base_color), Fe the exact dielectric of
//!         index eta = 2/(1 - sqrt(0.08 specular)) - 1, R0 its value at normal incidence
//!   Fc  = schlick(0.04), Dc = (a^2 - 1)/(pi ln(a^2) (1 + (a^2 - 1) cos_h^2)), a = lerp(0.1, 0.001, clearcoat_gloss),
//!   Gc: Smith's for GGX with alpha 0.25
//!
//! All parameters are dimensionless, from 0 to 1, and mean what they mean in Mitsuba. Reciprocal; may reflect more than it receives.
//! Luminance is that of linear sRGB.
//! Source: Burley 2012, *Physically Based Shading at Disney*, section 5; Burley 2015, *Extending the Disney BRDF to a BSDF with
//! Integrated Subsurface Scattering*, for `flatness`; the Fresnel term and the parameters: `principled` of Mitsuba 3.9. Difference: with
//! specular = 0, Mitsuba drops the specular lobe of metals too, and this model does not.
//! Cost: a logarithm and five square roots. The colour of one channel tints the others through the luminance, so that it has
//! twelve derivatives a channel.

use super::fresnel::{dielectric, schlick};
use super::microfacet::{ggx_distribution, ggx_visibility};
use super::{AnalyticBrdf, DifferentiableBrdf, HalfVector, ModelError, Parameter, checked};
use crate::math::dual::{Dual, Scalar};
use crate::math::{Rgb, Vec3};
use std::borrow::Cow;
use std::f64::consts::{FRAC_1_PI, PI};
use std::sync::Arc;

/// Number of parameters.
const COUNT: usize = 12;
/// Names and starts; every one ranges from 0 to 1.
const PARAMETERS: [(&str, f64); COUNT] = [
    ("base_color.r", 0.2),
    ("base_color.g", 0.2),
    ("base_color.b", 0.2),
    ("roughness", 0.4),
    ("metallic", 0.0),
    ("specular", 0.5),
    ("spec_tint", 0.0),
    ("sheen", 0.0),
    ("sheen_tint", 0.0),
    ("flatness", 0.0),
    ("clearcoat", 0.0),
    ("clearcoat_gloss", 0.0),
];
/// Luminance of linear sRGB, the numbers of Mitsuba.
const LUMINANCE: Rgb = [0.212671, 0.715160, 0.072169];
/// Smallest alpha of GGX in Mitsuba's `principled`.
const LEAST_ALPHA: f64 = 1e-3;
/// Keeps the slope of the index finite at `specular` = 0.
const LEAST_SPECULAR: f64 = 1e-9;

/// Disney's principled model with the parameters of Mitsuba 3, isotropic and opaque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Principled<S = f64> {
    /// Albedo of the diffuse lobe, and reflectance of a metal at normal incidence.
    pub base_color: [S; 3],
    /// Its square is alpha of GGX.
    pub roughness: S,
    /// 0: a dielectric over a diffuse base; 1: a metal.
    pub metallic: S,
    /// Reflectance of the dielectric at normal incidence, over 0.08.
    pub specular: S,
    /// How much the colour tints the specular lobe of the dielectric.
    pub spec_tint: S,
    /// Weight of the sheen towards grazing angles.
    pub sheen: S,
    /// How much the colour tints the sheen.
    pub sheen_tint: S,
    /// From the diffuse lobe to an approximation of subsurface scattering.
    pub flatness: S,
    /// Weight of the clear coat.
    pub clearcoat: S,
    /// From 0, a coat of alpha 0.1, to 1, one of alpha 0.001.
    pub clearcoat_gloss: S,
}

impl<S: Copy> Principled<S> {
    fn of(p: [S; COUNT]) -> Self {
        let [
            r,
            g,
            b,
            roughness,
            metallic,
            specular,
            spec_tint,
            sheen,
            sheen_tint,
            flatness,
            clearcoat,
            clearcoat_gloss,
        ] = p;
        let base_color = [r, g, b];
        Self {
            base_color,
            roughness,
            metallic,
            specular,
            spec_tint,
            sheen,
            sheen_tint,
            flatness,
            clearcoat,
            clearcoat_gloss,
        }
    }

    fn vector(&self) -> [S; COUNT] {
        let [r, g, b] = self.base_color;
        [
            r,
            g,
            b,
            self.roughness,
            self.metallic,
            self.specular,
            self.spec_tint,
            self.sheen,
            self.sheen_tint,
            self.flatness,
            self.clearcoat,
            self.clearcoat_gloss,
        ]
    }
}

impl Principled {
    /// The model, if each of its parameters lies from 0 to 1.
    ///
    /// # Errors
    /// [`ModelError::OutOfBounds`].
    pub fn checked(self) -> Result<Self, ModelError> {
        checked(self)
    }

    /// Names, units, bounds and starts of the parameters.
    pub(super) fn parameter_schema() -> Vec<Parameter> {
        let one = |(name, start)| Parameter { name: Cow::Borrowed(name), unit: "1", bounds: (0.0, 1.0), start };
        PARAMETERS.into_iter().map(one).collect()
    }

    /// The checked model of a parameter vector of the schema's length.
    pub(super) fn shared(p: &[f64]) -> Result<Arc<dyn AnalyticBrdf>, ModelError> {
        Ok(Arc::new(Self::of(std::array::from_fn(|k| p[k])).checked()?))
    }
}

impl<S: Scalar> Principled<S> {
    fn formula(&self, wi: Vec3, wo: Vec3) -> [S; 3] {
        let h = HalfVector::new(wi, wo);
        let one = S::from(1.0);
        let lerp = |a: S, b: S, t: S| a + (b - a) * t;
        let weight = |cos: f64| (1.0 - cos).powi(5);
        let (weight_i, weight_o) = (weight(wi.z), weight(wo.z));
        let dielectric_part = one - self.metallic;

        let diffuse = (1.0 - 0.5 * weight_i) * (1.0 - 0.5 * weight_o);
        let retro = self.roughness * (2.0 * h.cos_theta_d * h.cos_theta_d);
        let rough = retro * (retro * (weight_i * weight_o) + (weight_i + weight_o - weight_i * weight_o)) + diffuse;
        let flat = |w: f64| (retro * 0.5 - 1.0) * w + 1.0;
        let flat = (flat(weight_i) * flat(weight_o) * (1.0 / (wi.z + wo.z) - 0.5) + 0.5) * 1.25;
        let base = lerp(rough, flat, self.flatness) * FRAC_1_PI * dielectric_part;

        let luminance =
            self.base_color[0] * LUMINANCE[0] + self.base_color[1] * LUMINANCE[1] + self.base_color[2] * LUMINANCE[2];
        let tint = |c: usize| if luminance.value() > 0.0 { self.base_color[c] / luminance } else { one };
        let sheen = self.sheen * dielectric_part * weight(h.cos_theta_d);

        // sqrt of the reflectance at normal incidence.
        let root = (self.specular * 0.08 + LEAST_SPECULAR).sqrt();
        let eta = (one + root) / (one - root);
        let exact = dielectric(eta, h.cos_theta_d);
        let alpha = (self.roughness * self.roughness).max(S::from(LEAST_ALPHA));
        let lobe = ggx_distribution(alpha, &h) * ggx_visibility(alpha, wi, wo);

        let a = lerp(S::from(0.1), S::from(0.001), self.clearcoat_gloss);
        let a2 = a * a;
        let spread = (a2 - 1.0) / (a2.ln() * ((a2 - 1.0) * (h.cos_theta_h * h.cos_theta_h) + 1.0) * PI);
        // Visibility is G/(4 cos_i cos_o); the coat is not divided by the cosines.
        let masking = 4.0 * wi.z * wo.z * ggx_visibility(0.25, wi, wo);
        let coat = self.clearcoat * spread * (0.25 * schlick(0.04, h.cos_theta_d) * masking);

        std::array::from_fn(|c| {
            let tinted = schlick(tint(c) * root * root, h.cos_theta_d);
            let fresnel = dielectric_part * lerp(exact, tinted, self.spec_tint)
                + self.metallic * schlick(self.base_color[c], h.cos_theta_d);
            self.base_color[c] * base + sheen * lerp(one, tint(c), self.sheen_tint) + lobe * fresnel + coat
        })
    }
}

impl AnalyticBrdf for Principled {
    fn model(&self) -> &str {
        "principled"
    }

    fn schema(&self) -> Vec<Parameter> {
        Self::parameter_schema()
    }

    fn parameters(&self) -> Vec<f64> {
        self.vector().to_vec()
    }

    fn value(&self, wi: Vec3, wo: Vec3) -> Rgb {
        self.formula(wi, wo)
    }

    fn reciprocal(&self) -> bool {
        true
    }

    fn as_differentiable(&self) -> Option<&dyn DifferentiableBrdf> {
        Some(self)
    }
}

impl DifferentiableBrdf for Principled {
    fn value_and_gradient(&self, wi: Vec3, wo: Vec3, d: &mut [Rgb]) -> Rgb {
        let p = self.vector();
        let lifted = Principled::of(std::array::from_fn(|k| Dual::<COUNT>::variable(p[k], k)));
        let value = lifted.formula(wi, wo);
        for (k, entry) in d.iter_mut().enumerate() {
            *entry = value.map(|channel| channel.derivatives[k]);
        }
        value.map(|channel| channel.value)
    }
}
