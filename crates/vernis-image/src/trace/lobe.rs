//! Where a BRDF is sampled: half vectors by its own retro-reflective slice, mixed with a cosine lobe and a uniform one.
//!
//! The slice r(t) = luminance of f(w, w), w at angle t from the normal, is D(t) G F0 / (4 cos^2 t) plus a diffuse part for a surface of
//! facets (Dupuy et al. 2015, doi:10.1111/cgf.12758). With its least value over t < 75 degrees taken away, (r - r_min) cos^3 t is near the
//! projected distribution of facets D cos t. It is tabulated in 256 bins of equal steps of sqrt(tan(t/2)), and a half vector is
//! chosen from it uniformly in solid angle inside a bin. The density of the light's direction is p(h) / (4 h.wo).
//!
//! The share of the half vectors is that of the energy which the BRDF reflects above its diffuse part, by the angle of the viewer, from
//! 0.05 to 0.95; a BRDF that is the same everywhere has none. A tenth of the rest is uniform over the hemisphere: the cosine lobe goes
//! to zero at grazing angles, where some BRDFs are thousands of times brighter than elsewhere, and single samples would decide a pixel.
//! This decides the noise of a picture and never its mean.

use super::reflectance::{Value, luminance};
use super::sampler::{Sampler, unit};
use glam::Vec3A;
use std::f32::consts::{FRAC_1_PI, TAU};

/// Bins of the angle of the half vector.
const BINS: usize = 256;
/// Angles of the viewer at which the share is known, equal steps of the cosine.
const ANGLES: usize = 9;
/// Samples that an albedo is estimated from.
const SAMPLES: u32 = 512;

/// Of the directions that no half vector gives, the share that is uniform over the hemisphere.
const UNIFORM: f32 = 0.1;
/// Density of a direction that is uniform over the hemisphere, 1/sr.
const FRAC_1_TAU: f32 = 0.5 * FRAC_1_PI;

/// The lobe of half vectors.
pub struct Lobe {
    /// Density of each bin, 1/sr.
    density: Vec<f32>,
    /// 1 - cos t at the edges of the bins.
    edges: Vec<f32>,
    /// Share of its slot that is a bin's own, of 2^32, and the bin that has the rest.
    alias: Vec<(u32, u32)>,
    /// Share of the half vectors, by the cosine of the viewer.
    share: [f32; ANGLES],
}

/// 1 - cos t at the upper edge of `bin` bins.
fn edge(bin: f64) -> f64 {
    let t = (bin / BINS as f64).powi(2);
    2.0 * t * t / (1.0 + t * t)
}

impl Lobe {
    /// The lobe of a BRDF; `None` where its slice is flat.
    pub fn new(value: &Value) -> Option<Self> {
        let slice: Vec<f64> = (0..BINS)
            .map(|bin| {
                let cos = (1.0 - edge(bin as f64 + 0.5)) as f32;
                let w = Vec3A::new(((1.0 - cos) * (1.0 + cos)).sqrt(), 0.0, cos);
                f64::from(luminance(value.at(w, w)))
            })
            .collect();
        let cos = |bin: usize| 1.0 - edge(bin as f64 + 0.5);
        let base =
            (0..BINS).filter(|&bin| cos(bin) > 0.26).map(|bin| slice[bin]).fold(f64::INFINITY, f64::min).max(0.0);
        let weight: Vec<f64> = (0..BINS).map(|bin| (slice[bin] - base).max(0.0) * cos(bin).powi(3)).collect();
        let solid_angle = |bin: usize| std::f64::consts::TAU * (edge(bin as f64 + 1.0) - edge(bin as f64));
        let mass: Vec<f64> = (0..BINS).map(|bin| weight[bin] * solid_angle(bin)).collect();
        let total: f64 = mass.iter().sum();
        // A peak of nearly no energy is left to the cosine lobe.
        if !(total > 1e-4 * base.max(1e-9) && total.is_finite()) {
            return None;
        }
        let mut lobe = Self {
            density: weight.iter().map(|w| (w / total) as f32).collect(),
            edges: (0..=BINS).map(|bin| edge(bin as f64) as f32).collect(),
            alias: super::light::alias(&mass, total),
            share: [0.5; ANGLES],
        };
        lobe.share = std::array::from_fn(|k| lobe.best_share(value, k as f32 / (ANGLES - 1) as f32));
        Some(lobe)
    }

    /// The share of the energy above the least value of f, which a cosine lobe samples well.
    fn best_share(&self, value: &Value, cos: f32) -> f32 {
        let cos = cos.max(0.05);
        let wo = Vec3A::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        let (mut total, mut least) = (0.0, f32::INFINITY);
        for k in 0..SAMPLES {
            let mut sampler = Sampler::new(Sampler::pixel(0, 0), k);
            let wi = self.sample(wo, 0.5, sampler.pair(0), sampler.next());
            if wi.z > 0.0 {
                let f = luminance(value.at(wi, wo));
                total += f * wi.z / self.density(wi, wo, 0.5) / SAMPLES as f32;
                least = least.min(f);
            }
        }
        let above = 1.0 - least / (FRAC_1_PI * total).max(1e-20);
        if above.is_finite() { above.clamp(0.05, 0.95) } else { 0.5 }
    }

    /// The share of half vectors for a viewer.
    #[inline]
    pub fn share(&self, cos: f32) -> f32 {
        let at = cos.clamp(0.0, 1.0) * (ANGLES - 1) as f32;
        let k = (at as usize).min(ANGLES - 2);
        self.share[k] + (at - k as f32) * (self.share[k + 1] - self.share[k])
    }

    /// A direction of the light in the frame of the normal; below the horizon where nothing is reflected.
    #[inline]
    pub fn sample(&self, wo: Vec3A, share: f32, place: [u32; 2], choice: u64) -> Vec3A {
        let [a, b] = place;
        let picked = unit(choice as u32);
        if picked >= share {
            // The upper half of `choice` is free here: below it tells where in a bin a half vector lies.
            return if unit((choice >> 32) as u32) < UNIFORM { uniform(a, b) } else { cosine(a, b) };
        }
        let wide = u64::from(a) * BINS as u64;
        let (slot, rest) = ((wide >> 32) as usize, wide as u32);
        let (own, other) = self.alias[slot];
        let (bin, inside) = if rest < own {
            (slot, unit((choice >> 32) as u32))
        } else {
            (other as usize, unit((choice >> 32) as u32))
        };
        let e = self.edges[bin] + inside * (self.edges[bin + 1] - self.edges[bin]);
        let sin = (e * (2.0 - e)).max(0.0).sqrt();
        let (sin_p, cos_p) = (TAU * unit(b)).sin_cos();
        let h = Vec3A::new(sin * cos_p, sin * sin_p, 1.0 - e);
        2.0 * wo.dot(h) * h - wo
    }

    /// Density of [`Lobe::sample`], 1/sr.
    #[inline]
    pub fn density(&self, wi: Vec3A, wo: Vec3A, share: f32) -> f32 {
        let broad = UNIFORM * FRAC_1_TAU + (1.0 - UNIFORM) * FRAC_1_PI * wi.z.max(0.0);
        let sum = wi + wo;
        let length = sum.length();
        let h = sum / length;
        let cos_d = h.dot(wo);
        // tan(t/2) = sin t / (1 + cos t): exact where t is small.
        let tan = (h.x * h.x + h.y * h.y).sqrt() / (1.0 + h.z);
        let bin = ((tan.sqrt() * BINS as f32) as usize).min(BINS - 1);
        let half = if cos_d > 0.0 { self.density[bin] / (4.0 * cos_d) } else { 0.0 };
        share * half + (1.0 - share) * broad
    }
}

/// A direction with density cos t / pi.
#[inline]
pub fn cosine(a: u32, b: u32) -> Vec3A {
    let r2 = unit(a);
    let r = r2.sqrt();
    let (sin, cos) = (TAU * unit(b)).sin_cos();
    Vec3A::new(r * cos, r * sin, (1.0 - r2).max(0.0).sqrt())
}

/// A direction of the hemisphere with density 1 / (2 pi).
#[inline]
fn uniform(a: u32, b: u32) -> Vec3A {
    let z = unit(a);
    let r = ((1.0 - z) * (1.0 + z)).sqrt();
    let (sin, cos) = (TAU * unit(b)).sin_cos();
    Vec3A::new(r * cos, r * sin, z)
}
