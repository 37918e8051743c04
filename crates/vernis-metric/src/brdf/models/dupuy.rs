//! Dupuy: a microfacet model read off a measured BRDF, its facets from the light that comes straight back.
//!
//! f = F(theta_d) D(theta_h) / (4 (cos theta_i A(theta_o) + cos theta_o A(theta_i) - cos theta_i cos theta_o))
//! D = p(tan theta_h)/cos^4 theta_h
//! A(theta) = integral of max(w.h, 0) D(h) dh: Smith's masking with correlated heights
//!
//! p: density of slopes, 90 values at theta_h = (k/89)^2 90 deg, the last one zero; F: reflectance per channel, 90 values at
//! theta_d = 90 k/89 deg; A: area of the facets seen from a direction w, per unit of surface; all dimensionless; tables are
//! interpolated linearly. Reciprocal. There is no diffuse part: facets and Fresnel term take it over. Between the last two nodes p falls
//! to zero linearly, as in the authors' program, and D grows like 1/cos^3 theta_h: values have no bound at grazing angles.
//!
//! Extraction: for wi = wo = w the masking is cos theta/A, so that p = c f(w, w) cos^5 theta A(theta), linear in p: an
//! eigenvector with positive entries, here after four steps of the power iteration from a constant. Then
//! F = mean over theta_h < 90 deg - theta_d at phi_d = 90 deg of f over f with F = 1 (where that exceeds 1e-4), at most 1.
//! [`Dupuy::ggx`] and [`Dupuy::beckmann`] replace p by those of E|x| = alpha and E x^2 = alpha^2/2, x a slope along an axis.
//!
//! Source: Dupuy et al. 2015, doi:10.1111/cgf.12675, and its program dj_brdf, with which the study made these candidates;
//! masking: Heitz 2014, eq. 99, <http://jcgt.org/published/0003/02/03/>. Difference: missing retro-reflections take the
//! nearest value towards the normal; the integral over azimuth is closed. Cost: three look-ups; an extraction, 8,000
//! square roots and arc cosines.

use super::microfacet::{beckmann_area, beckmann_distribution, ggx_area, ggx_distribution};
use super::{AnalyticBrdf, HalfVector, ModelError, Parameter, check};
use crate::brdf::Brdf;
use crate::math::color::luminance;
use crate::math::coordinates::{HalfDifference, half_difference_directions};
use crate::math::{Rgb, Vec3};
use std::borrow::Cow;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

const NODES: usize = 90;
/// Number of steps between nodes.
const STEPS: f64 = (NODES - 1) as f64;

pub(super) const TABULATED: &str = "dupuy";
pub(super) const GGX: &str = "dupuy-ggx";
pub(super) const BECKMANN: &str = "dupuy-beckmann";

/// The slopes of the facets.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SlopeDistribution {
    /// The density at the 90 nodes.
    Tabulated(Vec<f64>),
    /// Walter et al. 2007, roughness alpha.
    Ggx(f64),
    /// Beckmann, roughness alpha.
    Beckmann(f64),
}

/// Slopes, and the Fresnel term at the 90 nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Dupuy {
    slopes: SlopeDistribution,
    fresnel: Vec<Rgb>,
    /// A at theta = 90 k/89 deg, for tabulated slopes.
    area: Vec<f64>,
}

/// theta_h of a node, radians.
fn node(k: usize) -> f64 {
    (k as f64 / STEPS).powi(2) * FRAC_PI_2
}

/// The weights of the nodes but the last in an integral over r dr, r = tan theta_h: tan/cos^2 dtheta.
fn weights() -> Vec<f64> {
    let weight = |k| node(k).tan() / node(k).cos().powi(2) * PI * (k as f64 / STEPS) / STEPS;
    (0..NODES - 1).map(weight).collect()
}

/// The integral over azimuth of max(cos theta + sin theta tan theta_h cos phi, 0).
fn azimuthal(theta: f64, theta_h: f64) -> f64 {
    let (sin, cos) = theta.sin_cos();
    let reach = sin * theta_h.tan();
    if reach <= cos {
        return 2.0 * PI * cos;
    }
    2.0 * (cos * (-cos / reach).acos() + (reach * reach - cos * cos).sqrt())
}

/// The value at the position `x` of a table, 0 at its first node and 1 at its last.
fn interpolated<T: Copy, U>(table: &[T], x: f64, mix: impl Fn(T, T, f64) -> U) -> U {
    let position = (x * STEPS).clamp(0.0, STEPS);
    let low = (position as usize).min(NODES - 2);
    mix(table[low], table[low + 1], position - low as f64)
}

fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

impl Dupuy {
    /// The models that an extraction gives: the facets as they are, and GGX and Beckmann facets of the same roughness.
    pub const MODELS: [&'static str; 3] = [TABULATED, GGX, BECKMANN];

    /// Of the parameters that an extraction finds in a reference.
    pub const EXTRACTION_VERSION: &'static str = "1";

    /// The model of [`Dupuy::MODELS`] called `model`, read off `reference`.
    ///
    /// # Errors
    /// [`ModelError::UnknownModel`]; a reference that sends no light straight back, or whose roughness is out of bounds.
    pub fn extracted(model: &str, reference: &dyn Brdf) -> Result<Self, ModelError> {
        if !Self::MODELS.contains(&model) {
            return Err(ModelError::UnknownModel { found: model.to_owned() });
        }
        let tabulated = Self::from_retroreflection(reference)?;
        match model {
            GGX => tabulated.ggx(),
            BECKMANN => tabulated.beckmann(),
            _ => Ok(tabulated),
        }
    }

    /// A density of slopes and 90 Fresnel values per channel, checked against the bounds of the schema.
    pub fn new(slopes: SlopeDistribution, fresnel: Vec<Rgb>) -> Result<Self, ModelError> {
        let mut model = Self { slopes, fresnel, area: Vec::new() };
        let (schema, p) = (model.schema(), model.parameters());
        if p.len() != schema.len() {
            return Err(ModelError::Count { model: model.model().to_owned(), found: p.len(), expected: schema.len() });
        }
        check(model.model(), &schema, &p)?;
        if let SlopeDistribution::Tabulated(density) = &model.slopes {
            model.area = area(density);
        }
        Ok(model)
    }

    /// The model that reflects as much light straight back as `reference` does.
    pub fn from_retroreflection(reference: &dyn Brdf) -> Result<Self, ModelError> {
        let density = slope_density(&retroreflection(reference)?);
        let plain = Self::new(SlopeDistribution::Tabulated(density), vec![[1.0; 3]; NODES])?;
        let fresnel = plain.fresnel_of(reference);
        Self::new(plain.slopes, fresnel)
    }

    /// The distribution of the facets' slopes.
    pub fn slopes(&self) -> &SlopeDistribution {
        &self.slopes
    }

    /// The same Fresnel term over GGX facets of the same mean absolute slope.
    pub fn ggx(&self) -> Result<Self, ModelError> {
        Self::new(SlopeDistribution::Ggx(self.ggx_alpha()), self.fresnel.clone())
    }

    /// The same Fresnel term over Beckmann facets of the same mean squared slope.
    pub fn beckmann(&self) -> Result<Self, ModelError> {
        Self::new(SlopeDistribution::Beckmann(self.beckmann_alpha()), self.fresnel.clone())
    }

    /// E|x| of the slopes along an axis, which is alpha for GGX.
    pub fn ggx_alpha(&self) -> f64 {
        match &self.slopes {
            SlopeDistribution::Tabulated(p) => 4.0 * moment(p, 1),
            SlopeDistribution::Ggx(alpha) => *alpha,
            // A Gaussian of variance alpha^2/2.
            SlopeDistribution::Beckmann(alpha) => alpha / PI.sqrt(),
        }
    }

    /// sqrt(2 E x^2) of the slopes along an axis, which is alpha for Beckmann; infinite for GGX.
    pub fn beckmann_alpha(&self) -> f64 {
        match &self.slopes {
            SlopeDistribution::Tabulated(p) => (2.0 * PI * moment(p, 2)).sqrt(),
            SlopeDistribution::Ggx(_) => f64::INFINITY,
            SlopeDistribution::Beckmann(alpha) => *alpha,
        }
    }

    fn area(&self, cos: f64) -> f64 {
        match &self.slopes {
            SlopeDistribution::Tabulated(_) => interpolated(&self.area, cos.min(1.0).acos() / FRAC_PI_2, mix).max(cos),
            SlopeDistribution::Ggx(alpha) => 0.5 * ggx_area(*alpha, cos),
            SlopeDistribution::Beckmann(alpha) => 0.5 * beckmann_area(*alpha, cos),
        }
    }

    /// f with F = 1.
    fn facets(&self, h: &HalfVector, wi: Vec3, wo: Vec3) -> f64 {
        let d = match &self.slopes {
            SlopeDistribution::Tabulated(p) => {
                let theta_h = h.tan2_theta_h.sqrt().atan();
                interpolated(p, (theta_h / FRAC_PI_2).sqrt(), mix) / h.cos_theta_h.powi(4)
            }
            SlopeDistribution::Ggx(alpha) => ggx_distribution(*alpha, h),
            SlopeDistribution::Beckmann(alpha) => beckmann_distribution(*alpha, h),
        };
        d / (4.0 * (wi.z * self.area(wo.z) + wo.z * self.area(wi.z) - wi.z * wo.z))
    }

    /// The mean ratio of `reference` to this model with F = 1, for each node of theta_d.
    fn fresnel_of(&self, reference: &dyn Brdf) -> Vec<Rgb> {
        let mut fresnel: Vec<Rgb> = (0..NODES - 1).map(|k| self.mean_ratio(reference, k)).collect();
        fresnel.extend(fresnel.last().copied());
        fresnel
    }

    fn mean_ratio(&self, reference: &dyn Brdf, k: usize) -> Rgb {
        let theta_d = k as f64 / STEPS * FRAC_PI_2;
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for theta_h in (0..NODES).map(node).take_while(|theta_h| *theta_h < FRAC_PI_2 - theta_d) {
            let (wi, wo) = half_difference_directions(HalfDifference { theta_h, theta_d, phi_d: FRAC_PI_2 });
            let facets = self.facets(&HalfVector::new(wi, wo), wi, wo);
            if let (Some(value), true) = (reference.eval(wi, wo), facets > 1e-4) {
                value.iter().zip(&mut sum).for_each(|(v, s)| *s += v.max(0.0) / facets);
                count += 1.0;
            }
        }
        if count == 0.0 { [1.0; 3] } else { sum.map(|s| (s / count).min(1.0)) }
    }
}

/// Luminance of `reference` for wi = wo at each node but the last, 1/sr.
fn retroreflection(reference: &dyn Brdf) -> Result<Vec<f64>, ModelError> {
    let at = |k| {
        let w = Vec3::from_spherical(node(k), 0.0);
        reference.eval(w, w).map(|value| luminance(value.map(|v| v.max(0.0))))
    };
    let measured: Vec<Option<f64>> = (0..NODES - 1).map(at).collect();
    let mut last = measured.iter().flatten().next().copied().ok_or(ModelError::NoRetroreflection)?;
    let filled: Vec<f64> = measured
        .into_iter()
        .map(|value| {
            last = value.unwrap_or(last);
            last.max(0.0)
        })
        .collect();
    if filled.iter().all(|v| *v == 0.0) { Err(ModelError::NoRetroreflection) } else { Ok(filled) }
}

/// The density of slopes at all nodes, by power iteration.
fn slope_density(retroreflection: &[f64]) -> Vec<f64> {
    let weights = weights();
    let row = |k: usize| -> Vec<f64> {
        let theta = node(k);
        let front = retroreflection[k] * theta.cos().powi(5);
        weights.iter().enumerate().map(|(j, w)| front * w * azimuthal(theta, node(j))).collect()
    };
    let kernel: Vec<Vec<f64>> = (0..NODES - 1).map(row).collect();
    let mut density = vec![1.0; NODES - 1];
    for _ in 0..4 {
        let next = kernel.iter().map(|row| row.iter().zip(&density).map(|(a, b)| a * b).sum::<f64>());
        density = next.collect();
        // The density integrates to 1 over the plane of slopes.
        let total: f64 = 2.0 * PI * density.iter().zip(&weights).map(|(p, w)| p * w).sum::<f64>();
        density.iter_mut().for_each(|p| *p /= total);
    }
    density.push(0.0);
    density
}

/// The area that tabulated facets project towards theta = 90 k/89 deg.
fn area(density: &[f64]) -> Vec<f64> {
    let weights = weights();
    let towards = |k| {
        let theta = k as f64 / STEPS * FRAC_PI_2;
        let area: f64 = (0..NODES - 1).map(|j| density[j] * weights[j] * azimuthal(theta, node(j))).sum();
        area.max(theta.cos())
    };
    (0..NODES).map(towards).collect()
}

/// The integral of r^n p r dr.
fn moment(density: &[f64], n: i32) -> f64 {
    weights().iter().enumerate().map(|(k, w)| density[k] * w * node(k).tan().powi(n)).sum()
}

pub(super) fn schema(model: &str) -> Vec<Parameter> {
    let parameter = |name: String, bounds, start| Parameter { name: Cow::Owned(name), unit: "1", bounds, start };
    // GGX of roughness 0.2.
    let density = |k: usize| if k + 1 == NODES { 0.0 } else { 0.04 / (PI * (0.04 + node(k).tan().powi(2)).powi(2)) };
    let mut all: Vec<Parameter> = match model {
        TABULATED => (0..NODES).map(|k| parameter(format!("p{k}"), (0.0, 1e12), density(k))).collect(),
        _ => vec![parameter("alpha".to_owned(), (1e-4, 100.0), 0.2)],
    };
    let channels = |k| ["r", "g", "b"].map(|c| parameter(format!("f{k}.{c}"), (0.0, 1.0), 0.1));
    all.extend((0..NODES).flat_map(channels));
    all
}

/// The checked model of a parameter vector of the schema's length.
pub(super) fn shared(model: &str, p: &[f64]) -> Result<Arc<dyn AnalyticBrdf>, ModelError> {
    let (slopes, fresnel) = match model {
        TABULATED => (SlopeDistribution::Tabulated(p[..NODES].to_vec()), &p[NODES..]),
        GGX => (SlopeDistribution::Ggx(p[0]), &p[1..]),
        _ => (SlopeDistribution::Beckmann(p[0]), &p[1..]),
    };
    Ok(Arc::new(Dupuy::new(slopes, fresnel.as_chunks::<3>().0.to_vec())?))
}

impl AnalyticBrdf for Dupuy {
    fn model(&self) -> &str {
        match self.slopes {
            SlopeDistribution::Tabulated(_) => TABULATED,
            SlopeDistribution::Ggx(_) => GGX,
            SlopeDistribution::Beckmann(_) => BECKMANN,
        }
    }

    fn schema(&self) -> Vec<Parameter> {
        schema(self.model())
    }

    fn parameters(&self) -> Vec<f64> {
        let slopes = match &self.slopes {
            SlopeDistribution::Tabulated(p) => &p[..],
            SlopeDistribution::Ggx(alpha) | SlopeDistribution::Beckmann(alpha) => std::slice::from_ref(alpha),
        };
        slopes.iter().chain(self.fresnel.iter().flatten()).copied().collect()
    }

    fn value(&self, wi: Vec3, wo: Vec3) -> Rgb {
        let h = HalfVector::new(wi, wo);
        let facets = self.facets(&h, wi, wo);
        let fresnel = |a: Rgb, b: Rgb, t: f64| std::array::from_fn(|c| facets * mix(a[c], b[c], t));
        interpolated(&self.fresnel, h.cos_theta_d.acos() / FRAC_PI_2, fresnel)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{BeckmannSchlick, Ggx};
    use super::*;
    use crate::math::coordinates::standard_directions;

    /// A reference that is a microfacet surface without a diffuse part gives its own roughness back; GGX only roughly:
    /// independent masking, which the reference has, hides its many steep facets twice, and they carry the mean slope.
    #[test]
    fn the_roughness_of_a_microfacet_surface_is_found() {
        for alpha in [0.05, 0.2, 0.4] {
            let (kd, f0) = ([0.0; 3], [0.3, 0.6, 0.9]);
            let found = Dupuy::from_retroreflection(&BeckmannSchlick { kd, f0, alpha }).expect("reflects");
            assert!((found.beckmann_alpha() / alpha - 1.0).abs() < 0.03, "{alpha}: {}", found.beckmann_alpha());
            let found = Dupuy::from_retroreflection(&Ggx { kd, f0, alpha }).expect("reflects");
            assert!((found.ggx_alpha() / alpha - 1.0).abs() < 0.12, "{alpha}: {}", found.ggx_alpha());
        }
    }

    #[test]
    fn a_microfacet_surface_is_rebuilt_with_its_fresnel_term() {
        let reference = BeckmannSchlick { kd: [0.0; 3], f0: [0.3, 0.6, 0.9], alpha: 0.25 };
        let found = Dupuy::from_retroreflection(&reference).expect("reflects");
        for model in [&found, &found.beckmann().expect("a roughness")] {
            for (ti, to, phi) in [(0.0, 0.3, 0.0), (0.5, 0.4, 3.0), (0.7, 0.7, PI)] {
                let (wi, wo) = standard_directions(ti, to, phi);
                let (a, b) = (model.value(wi, wo), reference.value(wi, wo));
                for c in 0..3 {
                    assert!((a[c] / b[c] - 1.0).abs() < 0.06, "{} {ti} {to}: {a:?} {b:?}", model.model());
                }
            }
        }
    }

    /// The density of the extraction integrates to 1 over the plane of slopes.
    #[test]
    fn slopes_are_a_density() {
        let reference = Ggx { kd: [0.2; 3], f0: [0.3; 3], alpha: 0.3 };
        let found = Dupuy::from_retroreflection(&reference).expect("reflects");
        let SlopeDistribution::Tabulated(p) = found.slopes() else { panic!("an extraction is a table") };
        assert!((2.0 * PI * moment(p, 0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_black_reference_has_no_facets() {
        let black = crate::brdf::models::Lambert { kd: [0.0; 3] };
        assert_eq!(Dupuy::from_retroreflection(&black), Err(ModelError::NoRetroreflection));
    }
}
