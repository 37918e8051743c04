//! Paths: what comes back along a ray.
//!
//! At each surface, one direction is chosen by the light's texels and one by the BRDF, weighted by the balance heuristic (Veach 1997,
//! eq. 9.8); the path goes on along the second. A path has at most `bounces` surfaces. From the second surface on, a path goes on
//! with a probability of the largest channel of its weight (Russian roulette, divided out).
//!
//! Sides: the geometric and the shading normal are each turned towards the viewer; a light counts if it is in front of both.

use super::geometry::{Geometry, Hit};
use super::light::Lighting;
use super::reflectance::Surface;
use super::sampler::{Sampler, unit};
use glam::Vec3A;
use std::sync::Arc;

/// Surfaces before paths may end by chance.
const SURE: usize = 1;
/// The footprint of a path that has been scattered, on wood.
const SCATTERED_FOOTPRINT: f32 = 0.25;

/// What is the same whatever the BRDF of the shape and the camera.
pub struct Stage {
    pub geometry: Geometry,
    pub table: Option<Surface>,
    pub light: Lighting,
}

/// A scene as it is traced.
pub struct World {
    pub stage: Arc<Stage>,
    pub shape: Surface,
    pub bounces: usize,
    pub background: bool,
    /// Width of a pixel at distance 1.
    pub pixel: f32,
}

/// Two vectors that complete a unit vector (Duff et al. 2017, JCGT 6:1).
#[inline]
fn tangents(n: Vec3A) -> (Vec3A, Vec3A) {
    let sign = 1.0f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vec3A::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3A::new(b, sign + n.y * n.y * a, -n.y))
}

#[inline]
fn towards(normal: Vec3A, viewer: Vec3A) -> Vec3A {
    if normal.dot(viewer) < 0.0 { -normal } else { normal }
}

impl World {
    /// Radiance that comes back along a ray from the camera.
    #[inline]
    pub fn radiance(&self, from: Vec3A, direction: Vec3A, sampler: &mut Sampler) -> Vec3A {
        sampler.rays += 1;
        match self.stage.geometry.closest(from, direction) {
            Some(hit) => self.reflected(hit, direction, sampler),
            None if self.background => self.stage.light.towards(direction).0,
            None => Vec3A::ZERO,
        }
    }

    fn reflected(&self, mut hit: Hit, mut direction: Vec3A, sampler: &mut Sampler) -> Vec3A {
        let mut sum = Vec3A::ZERO;
        let mut weight = Vec3A::ONE;
        for surface in 1..=self.bounces {
            let viewer = -direction;
            let geometric = towards(hit.geometric, viewer);
            let normal = towards(hit.shading, viewer);
            let (s, t) = tangents(normal);
            let local = |w: Vec3A| Vec3A::new(w.dot(s), w.dot(t), w.dot(normal));
            let wo = local(viewer);
            if wo.z <= 1e-6 {
                break;
            }
            let first = surface == 1;
            let footprint =
                if !first { SCATTERED_FOOTPRINT } else { self.pixel * hit.distance / wo.z.max(0.02).sqrt() };
            let material = if hit.is_table { self.stage.table.as_ref().unwrap_or(&self.shape) } else { &self.shape };
            let at = material.at(wo, hit.point, footprint);
            let start = self.stage.geometry.start(hit.point, geometric);

            if let Lighting::Texels(texels) = &self.stage.light {
                let choice =
                    if first { u64::from(sampler.pair(1)[0]) << 32 | sampler.next() >> 32 } else { sampler.next() };
                let light = texels.sample(choice, sampler.two());
                let wi = local(light.direction);
                if wi.z > 0.0 && light.direction.dot(geometric) > 0.0 {
                    let value = at.value(wi) * (wi.z / (light.density + at.density(wi)));
                    let found = weight * value * light.radiance;
                    if found.max_element() > 0.0 {
                        sampler.rays += 1;
                        if !self.stage.geometry.blocks(start, light.direction) {
                            sum += found;
                        }
                    }
                }
            }

            let place = if first { sampler.pair(2) } else { sampler.two() };
            let (wi, density) = at.sample(place, sampler.next());
            if wi.z <= 0.0 || density <= 0.0 {
                break;
            }
            direction = wi.x * s + wi.y * t + wi.z * normal;
            if direction.dot(geometric) <= 0.0 {
                break;
            }
            weight *= at.value(wi) * (wi.z / density);
            if weight.max_element() <= 0.0 {
                break;
            }
            let seen = |weight: Vec3A| {
                let (radiance, by_light) = self.stage.light.towards(direction);
                weight * radiance * (density / (density + by_light))
            };
            sampler.rays += 1;
            if surface == self.bounces {
                if !self.stage.geometry.blocks(start, direction) {
                    sum += seen(weight);
                }
                break;
            }
            match self.stage.geometry.closest(start, direction) {
                None => {
                    sum += seen(weight);
                    break;
                }
                Some(next) => hit = next,
            }
            if surface >= SURE {
                let stay = weight.max_element().clamp(0.05, 1.0);
                if stay < 1.0 {
                    if unit(sampler.next() as u32) >= stay {
                        break;
                    }
                    weight /= stay;
                }
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tangents_complete_a_frame() {
        for n in [Vec3A::Z, Vec3A::NEG_Z, Vec3A::X, Vec3A::new(0.6, -0.64, -0.48), Vec3A::new(0.1, 0.2, -0.97468)] {
            let (s, t) = tangents(n);
            for (a, b, expected) in [(s, s, 1.0), (t, t, 1.0), (s, t, 0.0), (s, n, 0.0), (t, n, 0.0)] {
                assert!((a.dot(b) - expected).abs() < 1e-4, "{n}");
            }
            assert!((s.cross(t) - n).length() < 1e-4);
        }
    }
}
