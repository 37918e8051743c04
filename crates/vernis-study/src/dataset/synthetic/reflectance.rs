//! Reflectance of the synthetic materials: a rough diffuse body, microfacet lobes, sheen and retroreflection, under an
//! optional clear coat.
//!
//! f = c + t(i) t(o) [ diffuse + sum of lobes + sheen + retro ],   c and t present with a coat only
//!
//! * diffuse: kd/pi times Oren and Nayar's qualitative factor A + B max(0, cos dphi) sin a tan b, with
//!   A = 1 - s2/(2 s2 + 0.66), B = 0.45 s2/(s2 + 0.09), s2 = sigma^2 (sigma in radians; 0 is Lambert). Oren and Nayar
//!   1994, doi:10.1145/192161.192213;
//! * lobe: weight D(theta_h) F(theta_d) V(i, o); D is GGX, Beckmann, or the Trowbridge-Reitz form of exponent 3/2 in
//!   its longer-tailed normalisation (Burley 2012), all of slope width alpha; V is the height-uncorrelated Smith term
//!   of GGX over 4 cos cos; F is Schlick's f0 + g (1 - f0)(1 - cos theta_d)^5, g = 1, or 0 where the Fresnel effect is
//!   lost;
//! * sheen: colour (2 + 1/a) sin^(1/a) theta_h/(2 pi) / (4 (ci + co - ci co)), a the width. Estevez and Kulla 2017;
//! * retro: colour (n + 1)/(2 pi) cos^n of the angle between light and viewer;
//! * coat: a GGX lobe c of its own f0 and alpha; t = (1 - F(theta)) exp(-absorption/cos theta'), with theta' refracted
//!   at index 1.5. The body is evaluated for the unrefracted directions: no inter-reflection under the coat.
//!
//! Colours are linear RGB; everything is dimensionless but the values of f, 1/sr. Reciprocal. Cost: a few powers.

use multiversion::multiversion;
use serde::Serialize;
use std::f64::consts::{FRAC_1_PI, PI};
use vernis_metric::brdf::Brdf;
use vernis_metric::math::{Rgb, Vec3};

/// Shape of a lobe's distribution of half vectors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Distribution {
    Ggx,
    Beckmann,
    /// Trowbridge-Reitz of exponent 3/2: a tail longer than that of GGX.
    LongTail,
}

/// A microfacet lobe.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Lobe {
    pub distribution: Distribution,
    pub alpha: f64,
    pub f0: Rgb,
    /// Strength g of the Fresnel rise, 0 to 1.
    pub fresnel: f64,
    pub weight: f64,
}

/// Light scattered by fibres that stand out of a surface.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sheen {
    pub colour: Rgb,
    pub width: f64,
}

/// Light sent back to where it came from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Retro {
    pub colour: Rgb,
    pub exponent: f64,
}

/// A clear or absorbing dielectric layer on top.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coat {
    pub alpha: f64,
    pub f0: f64,
    /// Strength of the Fresnel rise of what the coat reflects and keeps from the body, 0 to 1.
    pub fresnel: f64,
    /// Optical depth at normal incidence.
    pub absorption: Rgb,
}

/// Parameters of a synthetic material; see the formulas above.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Material {
    pub kd: Rgb,
    /// Roughness of the diffuse body, radians.
    pub sigma: f64,
    pub lobes: Vec<Lobe>,
    pub sheen: Option<Sheen>,
    pub retro: Option<Retro>,
    pub coat: Option<Coat>,
}

/// Pairs of directions that are evaluated at once where many have the same polar angles.
const MANY: usize = 32;

/// What the parts need of `N` pairs of directions.
struct Geometry<const N: usize> {
    ci: [f64; N],
    co: [f64; N],
    /// cos theta_h
    ch: [f64; N],
    /// cos theta_d
    cd: [f64; N],
    /// wi . wo
    cos_angle: [f64; N],
    /// sin theta_i sin theta_o cos of the azimuth difference
    tangential: [f64; N],
}

impl<const N: usize> Geometry<N> {
    /// Of at most `N` pairs; the others are like the last.
    #[inline(always)]
    fn new(wi: &[Vec3], wo: &[Vec3]) -> Self {
        let [mut ix, mut iy, mut iz, mut ox, mut oy, mut oz] = [[0.0; N]; 6];
        let last = wi.len() - 1;
        for k in 0..N {
            let (i, o) = (wi[k.min(last)], wo[k.min(last)]);
            (ix[k], iy[k], iz[k]) = (i.x, i.y, i.z);
            (ox[k], oy[k], oz[k]) = (o.x, o.y, o.z);
        }
        let [mut ch, mut cd, mut cos_angle, mut tangential] = [[0.0; N]; 4];
        for k in 0..N {
            let (x, y, z) = (ix[k] + ox[k], iy[k] + oy[k], iz[k] + oz[k]);
            let length = (x * x + y * y + z * z).sqrt();
            ch[k] = (z / length).min(1.0);
            cd[k] = (0.5 * length).min(1.0);
            tangential[k] = ix[k] * ox[k] + iy[k] * oy[k];
            cos_angle[k] = tangential[k] + iz[k] * oz[k];
        }
        Self { ci: iz, co: oz, ch, cd, cos_angle, tangential }
    }
}

impl Distribution {
    /// D for cos^2 theta_h and alpha^2, 1/sr.
    #[inline(always)]
    fn density(self, ch2: f64, a2: f64) -> f64 {
        match self {
            Self::Ggx => {
                let s = 1.0 + (a2 - 1.0) * ch2;
                a2 / (PI * s * s)
            }
            Self::Beckmann => ((1.0 - 1.0 / ch2) / a2).exp() / (PI * a2 * ch2 * ch2),
            // c/(1 + (a2 - 1) ch2)^(3/2); the integral of D cos over the hemisphere is 1.
            Self::LongTail => {
                let s = 1.0 + (a2 - 1.0) * ch2;
                let a = a2.sqrt();
                a * (1.0 + a) / (2.0 * PI * s * s.sqrt())
            }
        }
    }
}

/// (1 - c)^5
#[inline(always)]
fn schlick(c: f64) -> f64 {
    let m = 1.0 - c;
    m * m * m * m * m
}

/// V of a lobe.
fn visibility(alpha: f64, [ci, co]: [f64; 2]) -> f64 {
    let a2 = alpha * alpha;
    let masking = |c: f64| 1.0 / (c + (a2 + (1.0 - a2) * c * c).sqrt());
    masking(ci) * masking(co)
}

/// What depends on the polar angles alone, and so stays along an azimuth.
struct Polar {
    /// Of each lobe.
    visibility: Vec<f64>,
    /// Visibility of the coat's own lobe, and what the coat lets through on the way in and out.
    coat: Option<(f64, [Rgb; 2])>,
}

impl Material {
    fn polar(&self, cosines: [f64; 2]) -> Polar {
        let of_coat = |c: &Coat| (visibility(c.alpha, cosines), cosines.map(|cos| c.transmittance(cos)));
        Polar {
            visibility: self.lobes.iter().map(|l| visibility(l.alpha, cosines)).collect(),
            coat: self.coat.as_ref().map(of_coat),
        }
    }
}

/// Of at most `N` pairs above the horizon that have the polar angles of `polar`.
///
/// Compiled once for every x86-64 processor and once for those with AVX2; nothing is multiplied and added in one instruction, so that
/// both give the same bits.
#[multiversion(targets("x86_64+avx2"))]
fn values<const N: usize>(m: &Material, wi: &[Vec3], wo: &[Vec3], polar: &Polar) -> [[f64; N]; 3] {
    let g = Geometry::<N>::new(wi, wo);
    let mut f = [[0.0; N]; 3];
    let oren_nayar = oren_nayar(m.sigma, &g);
    for (f, kd) in f.iter_mut().zip(m.kd) {
        f.iter_mut().zip(oren_nayar).for_each(|(f, factor)| *f = kd * FRAC_1_PI * factor);
    }
    for (lobe, &visibility) in m.lobes.iter().zip(&polar.visibility) {
        let a2 = lobe.alpha * lobe.alpha;
        let mut shape = [0.0; N];
        match lobe.distribution {
            Distribution::Ggx => densities(|ch2| Distribution::Ggx.density(ch2, a2), &g, &mut shape),
            Distribution::Beckmann => densities(|ch2| Distribution::Beckmann.density(ch2, a2), &g, &mut shape),
            Distribution::LongTail => densities(|ch2| Distribution::LongTail.density(ch2, a2), &g, &mut shape),
        }
        let mut rise = [0.0; N];
        for ((shape, rise), cd) in shape.iter_mut().zip(&mut rise).zip(g.cd) {
            *shape = lobe.weight * *shape * visibility;
            *rise = lobe.fresnel * schlick(cd);
        }
        for (f, f0) in f.iter_mut().zip(lobe.f0) {
            for ((f, shape), rise) in f.iter_mut().zip(shape).zip(rise) {
                *f += shape * (f0 + (1.0 - f0) * rise);
            }
        }
    }
    let [red, green, blue] = &mut f;
    let mut add = |k: usize, colour: Rgb, shape: f64| {
        red[k] += colour[0] * shape;
        green[k] += colour[1] * shape;
        blue[k] += colour[2] * shape;
    };
    if let Some(s) = &m.sheen {
        let n = 1.0 / s.width;
        for k in 0..N {
            let sin2 = (1.0 - g.ch[k] * g.ch[k]).max(0.0);
            let cosines = 4.0 * (g.ci[k] + g.co[k] - g.ci[k] * g.co[k]);
            add(k, s.colour, (2.0 + n) * sin2.powf(0.5 * n) / (2.0 * PI) / cosines);
        }
    }
    if let Some(r) = &m.retro {
        for (k, cos_angle) in g.cos_angle.into_iter().enumerate() {
            add(k, r.colour, (r.exponent + 1.0) / (2.0 * PI) * cos_angle.max(0.0).powf(r.exponent));
        }
    }
    if let (Some(coat), Some((visibility, [ti, to]))) = (&m.coat, &polar.coat) {
        let a2 = coat.alpha * coat.alpha;
        let mut gloss = [0.0; N];
        for ((gloss, ch), cd) in gloss.iter_mut().zip(g.ch).zip(g.cd) {
            let shape = Distribution::Ggx.density(ch * ch, a2) * visibility;
            *gloss = shape * (coat.f0 + coat.fresnel * (1.0 - coat.f0) * schlick(cd));
        }
        for (c, f) in f.iter_mut().enumerate() {
            let through = ti[c] * to[c];
            f.iter_mut().zip(gloss).for_each(|(f, gloss)| *f = gloss + through * *f);
        }
    }
    f
}

/// A loop for each distribution, of which the compiler makes vectors.
#[inline(always)]
fn densities<const N: usize>(density: impl Fn(f64) -> f64, g: &Geometry<N>, to: &mut [f64; N]) {
    for (to, ch) in to.iter_mut().zip(g.ch) {
        *to = density(ch * ch);
    }
}

/// A + B max(0, cos dphi) sin alpha tan beta.
#[inline(always)]
fn oren_nayar<const N: usize>(sigma: f64, g: &Geometry<N>) -> [f64; N] {
    let s2 = sigma * sigma;
    let (a, b) = (1.0 - s2 / (2.0 * s2 + 0.66), 0.45 * s2 / (s2 + 0.09));
    // sin a tan b = sin theta_i sin theta_o / max(cos): the sines are in `tangential`.
    let mut factors = [0.0; N];
    for (((factor, tangential), ci), co) in factors.iter_mut().zip(g.tangential).zip(g.ci).zip(g.co) {
        *factor = a + b * tangential.max(0.0) / ci.max(co);
    }
    factors
}

impl Coat {
    fn transmittance(&self, cos: f64) -> Rgb {
        const ETA: f64 = 1.5;
        let passed = 1.0 - self.f0 - self.fresnel * (1.0 - self.f0) * schlick(cos);
        let refracted = (1.0 - (1.0 - cos * cos) / (ETA * ETA)).sqrt();
        self.absorption.map(|a| if a == 0.0 { passed } else { passed * (-a / refracted).exp() })
    }
}

impl Brdf for Material {
    fn is_mirror_symmetric(&self) -> bool {
        true
    }

    fn is_reciprocal(&self) -> bool {
        true
    }

    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        let mut out = [None];
        self.eval_batch(&[wi], &[wo], &mut out);
        out[0]
    }

    fn eval_batch(&self, wi: &[Vec3], wo: &[Vec3], out: &mut [Option<Rgb>]) {
        let mut first = 0;
        while first < out.len() {
            let (ci, co) = (wi[first].z, wo[first].z);
            if ci <= 0.0 || co <= 0.0 {
                out[first] = Some([0.0; 3]);
                first += 1;
                continue;
            }
            // Batches run along azimuths.
            let directions = wi[first..].iter().zip(&wo[first..]).take(MANY);
            let alike = directions.take_while(|(wi, wo)| wi.z == ci && wo.z == co).count();
            let (polar, range) = (self.polar([ci, co]), first..first + alike);
            let (wi, wo, out) = (&wi[range.clone()], &wo[range.clone()], &mut out[range]);
            if alike > MANY / 8 {
                let [red, green, blue] = values::<MANY>(self, wi, wo, &polar);
                for (((out, red), green), blue) in out.iter_mut().zip(red).zip(green).zip(blue) {
                    *out = Some([red, green, blue]);
                }
            } else {
                for (k, out) in out.iter_mut().enumerate() {
                    let [[red], [green], [blue]] = values::<1>(self, &wi[k..=k], &wo[k..=k], &polar);
                    *out = Some([red, green, blue]);
                }
            }
            first += alike;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::materials;
    use super::*;

    #[test]
    fn distributions_are_normalised() {
        // The integral of D cos theta_h over the hemisphere is 1 for a microfacet distribution.
        for distribution in [Distribution::Ggx, Distribution::Beckmann, Distribution::LongTail] {
            for alpha in [0.1f64, 0.4] {
                let n = 20_000;
                let sum: f64 = (0..n)
                    .map(|i| {
                        let u = (f64::from(i) + 0.5) / f64::from(n);
                        let theta = u * u * PI / 2.0;
                        let (sin, cos) = theta.sin_cos();
                        distribution.density(cos * cos, alpha * alpha) * cos * sin * u * PI / f64::from(n)
                    })
                    .sum();
                assert!((2.0 * PI * sum - 1.0).abs() < 1e-3, "{distribution:?} {alpha}: {}", 2.0 * PI * sum);
            }
        }
    }

    #[test]
    fn a_batch_has_the_bits_of_single_values() {
        // Circles of three lengths, one direction at a time, and some below the horizon.
        let at = |k: usize| match k {
            0..100 => (0.3, 0.8, k as f64 * 0.06),
            100..103 => (0.4, 0.1, k as f64),
            _ => (0.01 * k as f64, 0.5, 1.0),
        };
        let wo: Vec<Vec3> = (0..200).map(|k| Vec3::from_spherical(at(k).0, at(k).2)).collect();
        let wi: Vec<Vec3> = (0..200).map(|k| Vec3::from_spherical(at(k).1, 0.0)).collect();
        for m in materials::all() {
            let mut found = vec![None; wi.len()];
            m.material.eval_batch(&wi, &wo, &mut found);
            for k in 0..wi.len() {
                assert_eq!(found[k], m.material.eval(wi[k], wo[k]), "{} {k}", m.name);
            }
            assert_eq!((found[199], found[0] != found[1]), (Some([0.0; 3]), true));
        }
    }

    #[test]
    fn every_material_is_reciprocal_finite_and_reflects_less_than_it_receives() {
        for m in materials::all() {
            let f = |i, o| m.material.eval(i, o).unwrap();
            for theta in [0.1, 0.7, 1.2] {
                let wi = Vec3::from_spherical(theta, 0.0);
                let wo = Vec3::from_spherical(0.9, 2.0);
                for (a, b) in f(wi, wo).iter().zip(f(wo, wi)) {
                    assert!(a.is_finite() && *a >= 0.0 && (a - b).abs() <= 1e-12 * a.abs(), "{}", m.name);
                }
            }
            // Directional albedo at 20 degrees, half vectors spaced by the square as in `studio`.
            let wi = Vec3::from_spherical(0.35, 0.0);
            let mut albedo = [0.0; 3];
            let (n, k) = (400, 64);
            for i in 0..n {
                let u = (f64::from(i) + 0.5) / f64::from(n);
                let theta = u * u * PI / 2.0;
                for j in 0..k {
                    let h = Vec3::from_spherical(theta, (f64::from(j) + 0.5) * 2.0 * PI / f64::from(k));
                    let wo = h * (2.0 * wi.dot(h)) - wi;
                    if wi.dot(h) <= 0.0 || wo.z <= 0.0 {
                        continue;
                    }
                    let dh = theta.sin() * PI * u / f64::from(n) * 2.0 * PI / f64::from(k);
                    let value = f(wi, wo);
                    (0..3).for_each(|c| albedo[c] += value[c] * wo.z * 4.0 * wi.dot(h) * dh);
                }
            }
            assert!(albedo.iter().all(|a| *a > 0.005 && *a < 1.0), "{}: {albedo:?}", m.name);
        }
    }
}
