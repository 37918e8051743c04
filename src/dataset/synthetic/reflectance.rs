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

/// What the parts need of a pair of directions.
struct Geometry {
    ci: f64,
    co: f64,
    /// cos theta_h
    ch: f64,
    /// cos theta_d
    cd: f64,
    /// wi . wo
    cos_angle: f64,
    /// sin theta_i sin theta_o cos of the azimuth difference
    tangential: f64,
}

impl Geometry {
    fn new(wi: Vec3, wo: Vec3) -> Self {
        let sum = wi + wo;
        let length = sum.length();
        Self {
            ci: wi.z,
            co: wo.z,
            ch: (sum.z / length).min(1.0),
            cd: (0.5 * length).min(1.0),
            cos_angle: wi.dot(wo),
            tangential: wi.x * wo.x + wi.y * wo.y,
        }
    }
}

impl Distribution {
    /// D for cos^2 theta_h and alpha^2, 1/sr.
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
    /// cos theta_i, cos theta_o
    cosines: [f64; 2],
    /// Of each lobe.
    visibility: Vec<f64>,
    /// Visibility of the coat's own lobe, and what the coat lets through on the way in and out.
    coat: Option<(f64, [Rgb; 2])>,
}

impl Material {
    fn polar(&self, cosines: [f64; 2]) -> Polar {
        let of_coat = |c: &Coat| (visibility(c.alpha, cosines), cosines.map(|cos| c.transmittance(cos)));
        Polar {
            cosines,
            visibility: self.lobes.iter().map(|l| visibility(l.alpha, cosines)).collect(),
            coat: self.coat.as_ref().map(of_coat),
        }
    }

    fn body(&self, g: &Geometry, polar: &Polar) -> Rgb {
        let mut f = self.kd.map(|k| k * FRAC_1_PI * oren_nayar(self.sigma, g));
        for (lobe, visibility) in self.lobes.iter().zip(&polar.visibility) {
            let density = lobe.distribution.density(g.ch * g.ch, lobe.alpha * lobe.alpha);
            let shape = lobe.weight * density * visibility;
            let rise = lobe.fresnel * schlick(g.cd);
            (0..3).for_each(|c| f[c] += shape * (lobe.f0[c] + (1.0 - lobe.f0[c]) * rise));
        }
        if let Some(s) = &self.sheen {
            let sin2 = (1.0 - g.ch * g.ch).max(0.0);
            let n = 1.0 / s.width;
            let shape = (2.0 + n) * sin2.powf(0.5 * n) / (2.0 * PI) / (4.0 * (g.ci + g.co - g.ci * g.co));
            (0..3).for_each(|c| f[c] += s.colour[c] * shape);
        }
        if let Some(r) = &self.retro {
            let shape = (r.exponent + 1.0) / (2.0 * PI) * g.cos_angle.max(0.0).powf(r.exponent);
            (0..3).for_each(|c| f[c] += r.colour[c] * shape);
        }
        f
    }

    /// Above the horizon.
    fn value(&self, wi: Vec3, wo: Vec3, polar: &Polar) -> Rgb {
        let g = Geometry::new(wi, wo);
        let body = self.body(&g, polar);
        let (Some(coat), Some((visibility, [ti, to]))) = (&self.coat, &polar.coat) else { return body };
        let shape = Distribution::Ggx.density(g.ch * g.ch, coat.alpha * coat.alpha) * visibility;
        let gloss = shape * (coat.f0 + coat.fresnel * (1.0 - coat.f0) * schlick(g.cd));
        std::array::from_fn(|c| gloss + ti[c] * to[c] * body[c])
    }
}

/// A + B max(0, cos dphi) sin alpha tan beta.
fn oren_nayar(sigma: f64, g: &Geometry) -> f64 {
    let s2 = sigma * sigma;
    let (a, b) = (1.0 - s2 / (2.0 * s2 + 0.66), 0.45 * s2 / (s2 + 0.09));
    // sin a tan b = sin theta_i sin theta_o / max(cos): the sines are in `tangential`.
    a + b * g.tangential.max(0.0) / g.ci.max(g.co)
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

    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return Some([0.0; 3]);
        }
        Some(self.value(wi, wo, &self.polar([wi.z, wo.z])))
    }

    fn eval_batch(&self, wi: &[Vec3], wo: &[Vec3], out: &mut [Option<Rgb>]) {
        // Batches run along azimuths.
        let mut polar = self.polar([1.0; 2]);
        for ((out, &wi), &wo) in out.iter_mut().zip(wi).zip(wo) {
            let cosines = [wi.z, wo.z];
            if wi.z <= 0.0 || wo.z <= 0.0 {
                *out = Some([0.0; 3]);
                continue;
            }
            if cosines != polar.cosines {
                polar = self.polar(cosines);
            }
            *out = Some(self.value(wi, wo, &polar));
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
