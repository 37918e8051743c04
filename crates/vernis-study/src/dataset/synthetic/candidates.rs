//! The candidates of the embedded study: each reference spoilt in the ways in which approximations fail.
//!
//! | method | family | what happens to the reference |
//! | --- | --- | --- |
//! | ROUGHER, SHARPER | ROUGHNESS | every lobe's width times or divided by 1.2 to 4 |
//! | COLOUR-SHIFT | COLOUR-SHIFT | channels times (e^a, e^b, e^c), a + b + c = 0, up to 0.7 each |
//! | LOST-FRESNEL | LOST-FRESNEL | no rise of lobes and coat towards grazing angles |
//! | LOST-HAZE | LOST-HAZE | the widest of several lobes gone; on cloth, sheen and retroreflection too |
//! | WRONG-LOBE | WRONG-LOBE | another distribution of the same width at half maximum |
//! | NOISE | NOISE | times exp(smooth noise over half/difference angles) |
//! | STEP.1, STEP.2 | STEPS | (f + 0.001)^(1-t) (g + 0.001)^t - 0.001, g another reference, t = 0.06, 0.75 |
//!
//! Strengths are drawn from a fixed stream, so the candidates are always the same.

use super::materials::NamedMaterial;
use super::reflectance::{Distribution, Lobe, Material};
use rand::{Rng, RngCore};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::f64::consts::PI;
use std::sync::Arc;
use vernis_metric::brdf::models::ModelError;
use vernis_metric::brdf::{Brdf, ContentHash, OpenBrdf};
use vernis_metric::math::coordinates::{fold_reciprocal, half_difference};
use vernis_metric::math::{Rgb, Vec3, seed};

/// What defines a BRDF of the study; its JSON form is what its content hash is taken of.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Recipe {
    Material(Material),
    Noisy { base: Material, amplitude: f64, seed: u64 },
    Blend { from: Material, to: Material, t: f64 },
}

/// A candidate with its method and the method's family.
#[derive(Debug, Clone)]
pub struct Candidate {
    pub method: &'static str,
    pub family: &'static str,
    pub recipe: Recipe,
}

/// Part of every content hash: goes up when the formulas of this folder change a value.
const VERSION: &str = "vernis synthetic 2";

impl Recipe {
    /// The BRDF under `name`, as `BrdfSource::Generated` wants it.
    pub fn open(&self, name: &str) -> Result<OpenBrdf, String> {
        let canonical = serde_json::to_string(self).map_err(|e| format!("{name}: {e}"))?;
        let brdf = self.brdf().map_err(|e| format!("{name}: {e}"))?;
        let content = ContentHash::of(format!("{VERSION}\n{canonical}").as_bytes());
        Ok(OpenBrdf { notation: format!("synthetic:{name}"), content, brdf })
    }

    fn brdf(&self) -> Result<Arc<dyn Brdf>, ModelError> {
        Ok(match self.clone() {
            Self::Material(m) => Arc::new(m),
            Self::Noisy { base, amplitude, seed } => Arc::new(Noisy { base, amplitude, lattice: Lattice::new(seed) }),
            Self::Blend { from, to, t } => Arc::new(Blend { from, to, t }),
        })
    }
}

/// The candidates of `reference`; steps lead towards `target`.
pub fn of(reference: &NamedMaterial, target: &Material, rng: &mut ChaCha8Rng) -> Vec<Candidate> {
    let m = &reference.material;
    let made = |method, family, recipe| Candidate { method, family, recipe };
    let material = |method, family, m: Material| made(method, family, Recipe::Material(m));
    let strength = |rng: &mut ChaCha8Rng| 1.2 + 2.8 * rng.random::<f64>().powi(2);
    let (rougher, sharper) = (strength(rng), strength(rng));
    let mut all = vec![
        material("ROUGHER", "ROUGHNESS", scaled_width(m, rougher)),
        material("SHARPER", "ROUGHNESS", scaled_width(m, 1.0 / sharper)),
        material("COLOUR-SHIFT", "COLOUR-SHIFT", shifted_colour(m, rng)),
        material("LOST-FRESNEL", "LOST-FRESNEL", without_fresnel(m)),
        material("WRONG-LOBE", "WRONG-LOBE", other_lobe(m)),
    ];
    if let Some(hazeless) = without_haze(m) {
        all.push(material("LOST-HAZE", "LOST-HAZE", hazeless));
    }
    let amplitude = 0.2 + 1.3 * rng.random::<f64>();
    all.push(made("NOISE", "NOISE", Recipe::Noisy { base: m.clone(), amplitude, seed: rng.next_u64() }));
    for (method, t) in [("STEP.1", 0.06), ("STEP.2", 0.75)] {
        all.push(made(method, "STEPS", Recipe::Blend { from: m.clone(), to: target.clone(), t }));
    }
    all
}

fn scaled_width(m: &Material, factor: f64) -> Material {
    let scaled = |alpha: f64| (alpha * factor).clamp(0.012, 1.0);
    let mut m = m.clone();
    m.lobes.iter_mut().for_each(|l| l.alpha = scaled(l.alpha));
    if let Some(coat) = &mut m.coat {
        coat.alpha = scaled(coat.alpha);
    }
    m
}

fn shifted_colour(m: &Material, rng: &mut ChaCha8Rng) -> Material {
    let size = 0.1 + 0.6 * rng.random::<f64>();
    let angle = rng.random_range(0.0..2.0 * PI);
    let gain: Rgb = std::array::from_fn(|c| (size * (angle + c as f64 * 2.0 * PI / 3.0).cos()).exp());
    let shift = |colour: Rgb| std::array::from_fn(|c| (colour[c] * gain[c]).min(1.0));
    let mut m = m.clone();
    m.kd = shift(m.kd);
    m.lobes.iter_mut().for_each(|l| l.f0 = shift(l.f0));
    if let Some(s) = &mut m.sheen {
        s.colour = shift(s.colour);
    }
    if let Some(r) = &mut m.retro {
        r.colour = shift(r.colour);
    }
    m
}

fn without_fresnel(m: &Material) -> Material {
    let mut m = m.clone();
    m.lobes.iter_mut().for_each(|l| l.fresnel = 0.0);
    if let Some(coat) = &mut m.coat {
        coat.fresnel = 0.0;
    }
    m
}

/// `None` for a material without haze.
fn without_haze(m: &Material) -> Option<Material> {
    let mut m = m.clone();
    let fibres = m.sheen.take().is_some() | m.retro.take().is_some();
    if m.lobes.len() > 1 {
        let widest = (0..m.lobes.len()).max_by(|&a, &b| m.lobes[a].alpha.total_cmp(&m.lobes[b].alpha))?;
        m.lobes.remove(widest);
    } else if !fibres {
        return None;
    }
    Some(m)
}

fn other_lobe(m: &Material) -> Material {
    // Slope at half maximum over alpha: sqrt(sqrt 2 - 1) for GGX, sqrt(ln 2) for Beckmann, sqrt(2^(2/3) - 1) for the
    // long tail.
    let half_width = |d: Distribution| match d {
        Distribution::Ggx => 0.6436,
        Distribution::Beckmann => 0.8326,
        Distribution::LongTail => 0.7664,
    };
    let swapped = |l: &Lobe| {
        let distribution =
            if l.distribution == Distribution::Beckmann { Distribution::Ggx } else { Distribution::Beckmann };
        let alpha = (l.alpha * half_width(l.distribution) / half_width(distribution)).min(1.0);
        Lobe { distribution, alpha, ..l.clone() }
    };
    Material { lobes: m.lobes.iter().map(swapped).collect(), ..m.clone() }
}

/// Geometric blend of two materials, offset so that black stays finite.
struct Blend {
    from: Material,
    to: Material,
    t: f64,
}

impl Blend {
    fn between(&self, a: Rgb, b: Rgb) -> Rgb {
        const OFFSET: f64 = 1e-3;
        std::array::from_fn(|c| {
            let ratio = (b[c] + OFFSET) / (a[c] + OFFSET);
            ((a[c] + OFFSET) * ratio.powf(self.t) - OFFSET).max(0.0)
        })
    }
}

impl Brdf for Blend {
    fn is_mirror_symmetric(&self) -> bool {
        true
    }

    fn is_reciprocal(&self) -> bool {
        true
    }

    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        Some(self.between(self.from.eval(wi, wo)?, self.to.eval(wi, wo)?))
    }

    fn eval_batch(&self, wi: &[Vec3], wo: &[Vec3], out: &mut [Option<Rgb>]) {
        let mut to = vec![None; out.len()];
        self.from.eval_batch(wi, wo, out);
        self.to.eval_batch(wi, wo, &mut to);
        for (out, to) in out.iter_mut().zip(to) {
            *out = out.zip(to).map(|(a, b)| self.between(a, b));
        }
    }
}

/// A material times exp(amplitude noise).
struct Noisy {
    base: Material,
    amplitude: f64,
    lattice: Lattice,
}

impl Brdf for Noisy {
    fn is_mirror_symmetric(&self) -> bool {
        true
    }

    fn is_reciprocal(&self) -> bool {
        true
    }

    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        self.base.eval(wi, wo).map(|f| self.spoilt(f, wi, wo))
    }

    fn eval_batch(&self, wi: &[Vec3], wo: &[Vec3], out: &mut [Option<Rgb>]) {
        self.base.eval_batch(wi, wo, out);
        for ((out, &wi), &wo) in out.iter_mut().zip(wi).zip(wo) {
            *out = out.map(|f| self.spoilt(f, wi, wo));
        }
    }
}

impl Noisy {
    fn spoilt(&self, f: Rgb, wi: Vec3, wo: Vec3) -> Rgb {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return f;
        }
        let c = half_difference(wi, wo);
        let noise = self.lattice.at(c.theta_h, c.theta_d, c.phi_d);
        std::array::from_fn(|k| f[k] * (self.amplitude * noise[k]).exp())
    }
}

/// Normally distributed values on a lattice over (sqrt theta_h, theta_d, phi_d), linear between; two thirds of the
/// variance are common to the channels.
struct Lattice {
    values: Vec<Rgb>,
}

impl Lattice {
    const SHAPE: [usize; 3] = [11, 7, 4];

    fn new(seed: u64) -> Self {
        let mut rng = seed::stream(seed, "synthetic-noise", 0);
        let [a, b, c] = Self::SHAPE;
        let values = (0..a * b * c)
            .map(|_| {
                let common = normal(&mut rng) * (2.0f64 / 3.0).sqrt();
                std::array::from_fn(|_| common + normal(&mut rng) * (1.0f64 / 3.0).sqrt())
            })
            .collect();
        Self { values }
    }

    fn at(&self, theta_h: f64, theta_d: f64, phi_d: f64) -> Rgb {
        let folded = fold_reciprocal(phi_d);
        // Mirror images about the plane of reflection look the same.
        let phi = folded.min(PI - folded);
        let unit = [(theta_h * 2.0 / PI).sqrt(), theta_d * 2.0 / PI, phi * 2.0 / PI];
        let split = |axis: usize| {
            let x = unit[axis].clamp(0.0, 1.0) * (Self::SHAPE[axis] - 1) as f64;
            let i = (x as usize).min(Self::SHAPE[axis] - 2);
            (i, x - i as f64)
        };
        let axes = [split(0), split(1), split(2)];
        let mut sum = [0.0; 3];
        for corner in 0..8usize {
            let mut weight = 1.0;
            let mut index = 0;
            for (axis, &(i, t)) in axes.iter().enumerate() {
                let upper = corner >> axis & 1;
                weight *= if upper == 1 { t } else { 1.0 - t };
                index = index * Self::SHAPE[axis] + i + upper;
            }
            (0..3).for_each(|c| sum[c] += weight * self.values[index][c]);
        }
        sum
    }
}

/// A standard normal variate (Box and Muller 1958, doi:10.1214/aoms/1177706645).
pub fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (1.0 - rng.random::<f64>(), rng.random());
    (-2.0 * u.ln()).sqrt() * (2.0 * PI * v).cos()
}

#[cfg(test)]
mod tests {
    use super::super::materials;
    use super::*;
    use vernis_metric::brdf::Grid;

    #[test]
    fn every_reference_has_at_least_eight_kinds_that_differ_from_it() {
        let all = materials::all();
        for (i, m) in all.iter().enumerate() {
            let candidates = of(m, &all[(i + 7) % all.len()].material, &mut seed::stream(1, "test", i as u64));
            let kinds: std::collections::BTreeSet<_> = candidates.iter().map(|c| c.method).collect();
            assert!(kinds.len() >= 8, "{}: {kinds:?}", m.name);
            let reference = Recipe::Material(m.material.clone());
            assert!(candidates.iter().all(|c| c.recipe != reference), "{}", m.name);
            for c in &candidates {
                let open = c.recipe.open(m.name).unwrap();
                let f = open.brdf.eval(Vec3::from_spherical(1.3, 0.0), Vec3::from_spherical(0.4, 2.0)).unwrap();
                assert!(f.iter().all(|v| v.is_finite() && *v >= 0.0), "{} {}", m.name, c.method);
            }
        }
    }

    /// Lp distances take half of their cells from the other half, to 1e-10 of a value.
    #[test]
    fn everything_is_reciprocal_on_the_grid() {
        let all = materials::all();
        let directions = Grid::TITOPO.all_directions();
        for (i, m) in all.iter().enumerate().step_by(3) {
            let candidates = of(m, &all[(i + 7) % all.len()].material, &mut seed::stream(1, "test", i as u64));
            for recipe in candidates.into_iter().map(|c| c.recipe).chain([Recipe::Material(m.material.clone())]) {
                let brdf = recipe.brdf().unwrap();
                assert!(brdf.is_reciprocal());
                for (theta, other) in [(0, 7), (3, 60), (20, 21), (45, 88), (80, 89), (12, 70)] {
                    for k in (0..360).step_by(9) {
                        let at = |i, o| {
                            let (wi, wo) = directions.at([i, o, k]);
                            brdf.eval(wi, wo).unwrap()
                        };
                        for (a, b) in at(theta, other).into_iter().zip(at(other, theta)) {
                            assert!((a - b).abs() <= 1e-10 * a, "{} {theta} {other} {k}: {a} {b}", m.name);
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn noise_is_reciprocal_and_a_blend_of_nothing_is_its_start() {
        let m = materials::all()[3].material.clone();
        let noisy = Noisy { base: m.clone(), amplitude: 0.5, lattice: Lattice::new(3) };
        let (wi, wo) = (Vec3::from_spherical(0.4, 0.3), Vec3::from_spherical(1.0, 2.0));
        let (a, b) = (noisy.eval(wi, wo).unwrap(), noisy.eval(wo, wi).unwrap());
        assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-9 * a[c]));
        let blend = Blend { from: m.clone(), to: materials::all()[9].material.clone(), t: 0.0 };
        let (a, b) = (blend.eval(wi, wo).unwrap(), m.eval(wi, wo).unwrap());
        assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-12));
    }
}
