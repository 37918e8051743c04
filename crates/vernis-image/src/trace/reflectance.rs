//! How a surface reflects, as it is evaluated and sampled.
//!
//! A BRDF that is not reciprocal, such as a network, is asked with its first direction towards the viewer: `eval(viewer, light)`. So do the
//! renderers that its authors use (Mitsuba's `wi` is the viewer's side), and the pictures that ours are checked against; the other way
//! round, the blue of a gold paint differs by 5 % in places. For reciprocal BRDFs nothing changes.

use super::TraceError;
use super::brdf_table::{BrdfTable, SIZE};
use super::lobe::{Lobe, cosine};
use super::sampler::Sampler;
use crate::scene::{Reflectance, Wood};
use glam::Vec3A;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;
use vernis_metric::brdf::models::{AnalyticBrdf, build};
use vernis_metric::brdf::{Brdf, ContentHash};
use vernis_metric::math::Vec3;
use vernis_metric::math::color::LUMINANCE_REC709;

/// Models whose formulas take longer than a look-up in a table.
const SLOW_MODELS: [&str; 3] = ["he", "dupuy", "rational"];

/// Luminance of linear RGB.
#[inline]
pub fn luminance(v: Vec3A) -> f32 {
    const WEIGHTS: Vec3A =
        Vec3A::new(LUMINANCE_REC709[0] as f32, LUMINANCE_REC709[1] as f32, LUMINANCE_REC709[2] as f32);
    WEIGHTS.dot(v)
}

/// The value of a BRDF.
pub enum Value {
    /// The same for all directions.
    Constant(Vec3A),
    /// By its formula.
    Exact(Arc<dyn Brdf>),
    /// From a table.
    Table(BrdfTable),
}

impl Value {
    /// Linear RGB, 1/sr, cosine not included, for unit directions above the horizon. Values below zero count as 0.
    #[inline]
    pub fn at(&self, wi: Vec3A, wo: Vec3A) -> Vec3A {
        match self {
            Self::Constant(value) => *value,
            Self::Table(table) => table.at(wi, wo),
            Self::Exact(brdf) => {
                let wide = |w: Vec3A| Vec3::new(f64::from(w.x), f64::from(w.y), f64::from(w.z));
                let [r, g, b] = brdf.eval(wide(wo), wide(wi)).unwrap_or_default();
                Vec3A::new(r as f32, g as f32, b as f32).max(Vec3A::ZERO)
            }
        }
    }
}

/// How well a table stands for a BRDF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tabulation {
    /// Mean difference of the luminance, as a share of its mean, over directions chosen as the light is followed.
    pub mean_error: f64,
    /// Difference of the mean luminance, as a share of it.
    pub bias: f64,
}

/// A surface.
pub struct Surface {
    value: Value,
    lobe: Option<Lobe>,
    wood: Option<Wood>,
}

/// What a surface is at a point.
#[derive(Clone, Copy)]
pub struct At<'a> {
    surface: &'a Surface,
    /// Of wood.
    albedo: Vec3A,
    share: f32,
    wo: Vec3A,
}

impl Surface {
    /// The surface, and how well it was tabulated if it was.
    ///
    /// # Errors
    /// A BRDF with a value that is not finite, or without any.
    pub fn new(reflectance: &Reflectance) -> Result<(Self, Option<Tabulation>), TraceError> {
        match reflectance {
            Reflectance::Wood(wood) => {
                let value = Value::Constant(Vec3A::ZERO);
                Ok((Self { value, lobe: None, wood: Some(*wood) }, None))
            }
            Reflectance::Brdf(brdf, _) => Self::made_of(&**brdf, |_| Some(brdf.clone())),
        }
    }

    /// The surface of a BRDF that is borrowed: models of this library are built anew from their parameters, others are tabulated.
    ///
    /// # Errors
    /// Those of [`Surface::new`].
    pub fn of(brdf: &dyn Brdf) -> Result<(Self, Option<Tabulation>), TraceError> {
        Self::made_of(brdf, |model| Some(build(model.model(), &model.parameters()).ok()? as Arc<dyn Brdf>))
    }

    /// `owned` gives a model to keep; where it cannot, the model is tabulated.
    fn made_of(
        brdf: &dyn Brdf,
        owned: impl FnOnce(&dyn AnalyticBrdf) -> Option<Arc<dyn Brdf>>,
    ) -> Result<(Self, Option<Tabulation>), TraceError> {
        let slow = |name: &str| name.split('+').any(|term| SLOW_MODELS.iter().any(|slow| term.starts_with(slow)));
        let exact = match brdf.as_model() {
            Some(model) if model.model() == "lambert" => {
                let up = Vec3::new(0.0, 0.0, 1.0);
                let [r, g, b] = brdf.eval(up, up).unwrap_or_default();
                Some(Value::Constant(Vec3A::new(r as f32, g as f32, b as f32)))
            }
            Some(model) if !slow(model.model()) => owned(model).map(Value::Exact),
            _ => None,
        };
        let (value, is_exact) = match exact {
            Some(value) => (value, true),
            None => (Value::Table(BrdfTable::new(brdf, SIZE)?), false),
        };
        let lobe = if let Value::Constant(_) = value { None } else { Lobe::new(&value) };
        let surface = Self { value, lobe, wood: None };
        let tabulation = if is_exact { None } else { Some(surface.compared_to(brdf)?) };
        Ok((surface, tabulation))
    }

    /// SHA-256 of all that decides how it reflects.
    pub fn content(&self) -> ContentHash {
        let mut bytes = match &self.value {
            Value::Constant(value) => format!("constant {:?}", value.to_array().map(f32::to_bits)).into_bytes(),
            Value::Exact(brdf) => {
                let model = brdf.as_model();
                let parameters = model.map(|m| m.parameters().into_iter().map(f64::to_bits).collect::<Vec<_>>());
                format!("model {} {parameters:?}", model.map_or("", |m| m.model())).into_bytes()
            }
            Value::Table(table) => table.bytes(),
        };
        bytes.extend(format!("{:?}", self.wood).bytes());
        ContentHash::of(&bytes)
    }

    /// The error of a table over directions that paths take.
    fn compared_to(&self, brdf: &dyn Brdf) -> Result<Tabulation, TraceError> {
        const PAIRS: u32 = 8192;
        let (mut wi, mut wo, mut density) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..PAIRS {
            let mut sampler = Sampler::new(Sampler::pixel(1, 0), k);
            let [a, b] = sampler.pair(0);
            let view = cosine(a, b);
            if view.z < 0.02 {
                continue;
            }
            let at = self.at(view, Vec3A::ZERO, 1.0);
            let (light, p) = at.sample(sampler.pair(1), sampler.next());
            if light.z > 0.02 && p > 0.0 {
                wi.push(light);
                wo.push(view);
                density.push(p);
            }
        }
        let wide = |w: &Vec3A| Vec3::new(f64::from(w.x), f64::from(w.y), f64::from(w.z));
        let mut exact = vec![None; wi.len()];
        let (wide_wi, wide_wo): (Vec<Vec3>, Vec<Vec3>) = (wi.iter().map(wide).collect(), wo.iter().map(wide).collect());
        brdf.eval_in_gamut(&wide_wo, &wide_wi, &mut exact);
        let (mut error, mut bias, mut total) = (0.0, 0.0, 0.0);
        for (k, value) in exact.iter().enumerate() {
            let Some([r, g, b]) = value else { continue };
            let weight = f64::from(wi[k].z / density[k]);
            let exact = f64::from(luminance(Vec3A::new(*r as f32, *g as f32, *b as f32).max(Vec3A::ZERO)));
            let difference = f64::from(luminance(self.value.at(wi[k], wo[k]))) - exact;
            error += weight * difference.abs();
            bias += weight * difference;
            total += weight * exact;
        }
        let total = if total > 0.0 { total } else { 1.0 };
        Ok(Tabulation { mean_error: error / total, bias: bias / total })
    }

    /// The surface at a point of the table, seen from `wo` in the frame of the normal.
    #[inline]
    pub fn at(&self, wo: Vec3A, point: Vec3A, footprint: f32) -> At<'_> {
        let albedo = match self.wood {
            Some(wood) => {
                let [r, g, b] = wood.albedo(f64::from(point.x), f64::from(point.z), f64::from(footprint));
                Vec3A::new(r as f32, g as f32, b as f32)
            }
            None => Vec3A::ZERO,
        };
        let share = self.lobe.as_ref().map_or(0.0, |lobe| lobe.share(wo.z));
        At { surface: self, albedo, share, wo }
    }
}

impl At<'_> {
    /// Linear RGB, 1/sr, for a light above the horizon.
    #[inline]
    pub fn value(&self, wi: Vec3A) -> Vec3A {
        if self.surface.wood.is_some() { FRAC_1_PI * self.albedo } else { self.surface.value.at(wi, self.wo) }
    }

    /// Density of [`At::sample`], 1/sr.
    #[inline]
    pub fn density(&self, wi: Vec3A) -> f32 {
        match &self.surface.lobe {
            Some(lobe) => lobe.density(wi, self.wo, self.share),
            None => FRAC_1_PI * wi.z.max(0.0),
        }
    }

    /// A direction of the light, and its density.
    #[inline]
    pub fn sample(&self, place: [u32; 2], choice: u64) -> (Vec3A, f32) {
        let wi = match &self.surface.lobe {
            Some(lobe) => lobe.sample(self.wo, self.share, place, choice),
            None => cosine(place[0], place[1]),
        };
        (wi, if wi.z > 0.0 { self.density(wi) } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::super::brdf_table::{BrdfTable, SIZE};
    use super::*;

    /// A table keeps the energy of a lobe, broad or narrow, and a diffuse part with it.
    #[test]
    fn a_table_stands_for_its_brdf() {
        for (alpha, allowed) in [(0.05, 0.01), (0.1, 0.003), (0.3, 0.002), (0.8, 0.002)] {
            let brdf = build("ggx", &[0.1, 0.15, 0.2, 0.5, 0.4, 0.2, alpha]).expect("valid");
            let value = Value::Table(BrdfTable::new(&*brdf, SIZE).expect("finite"));
            let surface = Surface { lobe: Lobe::new(&value), value, wood: None };
            let found = surface.compared_to(&*brdf).expect("comparable");
            assert!(found.mean_error < allowed && found.bias.abs() < 0.5 * allowed, "{alpha}: {found:?}");
        }
    }

    /// The share of directions that are chosen in a part of the sphere is the integral of the density there.
    #[test]
    fn directions_are_chosen_with_the_density_that_is_stated() {
        let brdf = build("ggx", &[0.1, 0.15, 0.2, 0.5, 0.4, 0.2, 0.15]).expect("valid");
        let value = Value::Exact(brdf);
        let surface = Surface { lobe: Lobe::new(&value), value, wood: None };
        for cos in [0.95f32, 0.5, 0.1] {
            let wo = Vec3A::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let at = surface.at(wo, Vec3A::ZERO, 0.0);
            // Cells of equal solid angle above the horizon.
            const CELLS: (usize, usize) = (8, 8);
            let n = 40_000;
            let (mut chosen, mut stated) = ([0.0f64; 64], [0.0f64; 64]);
            let cell = |w: Vec3A| {
                let turn = f64::from(w.y).atan2(f64::from(w.x)) / std::f64::consts::TAU;
                let column = ((turn - turn.floor()) * CELLS.1 as f64) as usize;
                (f64::from(w.z) * CELLS.0 as f64).min(7.0) as usize * CELLS.1 + column.min(7)
            };
            for k in 0..n {
                let mut sampler = Sampler::new(Sampler::pixel(5, 0), k);
                let (wi, density) = at.sample(sampler.two(), sampler.next());
                if density > 0.0 {
                    chosen[cell(wi)] += 1.0 / f64::from(n);
                }
                // The integral by directions uniform over the hemisphere.
                let [a, b] = sampler.pair(7).map(|x| f64::from(x) / (1u64 << 32) as f64);
                let (z, phi) = (a as f32, (std::f64::consts::TAU * b) as f32);
                let w = Vec3A::new((1.0 - z * z).sqrt() * phi.cos(), (1.0 - z * z).sqrt() * phi.sin(), z);
                stated[cell(w)] += f64::from(at.density(w)) * std::f64::consts::TAU / f64::from(n);
            }
            for k in 0..64 {
                let allowed = 5.0 * (stated[k].max(1e-4) / f64::from(n)).sqrt() + 0.03 * stated[k];
                assert!((chosen[k] - stated[k]).abs() < allowed, "{cos} {k}: {} {}", chosen[k], stated[k]);
            }
        }
    }
}
