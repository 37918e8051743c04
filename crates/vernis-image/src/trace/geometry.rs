//! Rays against the shape and the table.

use super::tree::Tree;
use crate::scene::{Mesh, Scene, Shape};
use glam::Vec3A;
use obvhs::triangle::Triangle;

/// A distance that rays start off a surface, as a share of the largest coordinate there: some 80 roundings.
const OFFSET: f32 = 1e-5;

/// What can be hit.
pub struct Geometry {
    shape: Body,
    /// Half the side of the table.
    table: Option<f32>,
    /// Size of the shape, for offsets about the origin.
    size: f32,
}

enum Body {
    Sphere { center: Vec3A, radius: f32 },
    Mesh(Triangles),
}

/// A mesh and its tree.
struct Triangles {
    tree: Tree,
    /// Normals at the corners; empty where faces are flat.
    normals: Vec<[Vec3A; 3]>,
}

/// Where a ray ends.
#[derive(Clone, Copy)]
pub struct Hit {
    /// Distance along the ray, whose direction is a unit vector.
    pub distance: f32,
    /// The point.
    pub point: Vec3A,
    /// Unit normal of the surface, on either side.
    pub geometric: Vec3A,
    /// Unit normal to shade with, on either side.
    pub shading: Vec3A,
    /// Whether it is the table.
    pub is_table: bool,
}

fn vector(p: [f64; 3]) -> Vec3A {
    Vec3A::new(p[0] as f32, p[1] as f32, p[2] as f32)
}

impl Triangles {
    fn new(mesh: &Mesh) -> Self {
        let kept: Vec<usize> = (0..mesh.len()).filter(|&face| mesh.area_vector(face) != [0.0; 3]).collect();
        let all: Vec<Triangle> = kept
            .iter()
            .map(|&face| {
                let [v0, v1, v2] = mesh.corners(face).map(vector);
                Triangle { v0, v1, v2 }
            })
            .collect();
        let normals = kept.iter().filter_map(|&face| mesh.corner_normals(face)).map(|n| n.map(vector)).collect();
        Self { tree: Tree::new(&all), normals }
    }

    #[inline]
    fn closest(&self, from: Vec3A, direction: Vec3A, most: f32) -> Option<Hit> {
        let found = self.tree.closest(from, direction, most)?;
        let geometric = found.normal.normalize();
        let [u, v] = found.weights;
        let shading = self
            .normals
            .get(found.triangle)
            .map_or(geometric, |[a, b, c]| ((1.0 - u - v) * *a + u * *b + v * *c).normalize_or(geometric));
        Some(Hit { distance: found.distance, point: found.point, geometric, shading, is_table: false })
    }
}

/// Distance to a sphere from outside or inside, beyond 0.
#[inline]
fn sphere_distance(center: Vec3A, radius: f32, from: Vec3A, direction: Vec3A) -> Option<f32> {
    let to = center - from;
    let middle = to.dot(direction);
    // The part of `to` across the ray: no difference of large squares.
    let across = to - middle * direction;
    let half = radius * radius - across.dot(across);
    if half < 0.0 {
        return None;
    }
    let half = half.sqrt();
    [middle - half, middle + half].into_iter().find(|t| *t > 0.0)
}

impl Geometry {
    /// The shape and the table of a scene.
    pub fn new(scene: &Scene) -> Self {
        let table = scene.table.as_ref().map(|table| table.half_side as f32);
        let (shape, size) = match &scene.shape {
            Shape::Sphere { center, radius } => {
                (Body::Sphere { center: vector(*center), radius: *radius as f32 }, *radius as f32)
            }
            Shape::Mesh(mesh) => {
                let (low, high) = mesh.bounds();
                let size = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
                (Body::Mesh(Triangles::new(mesh)), size as f32)
            }
        };
        Self { shape, table, size }
    }

    /// The first thing that a ray meets.
    #[inline]
    pub fn closest(&self, from: Vec3A, direction: Vec3A) -> Option<Hit> {
        let table = self.table_hit(from, direction);
        let most = table.map_or(f32::MAX, |hit| hit.distance);
        match &self.shape {
            Body::Mesh(triangles) => triangles.closest(from, direction, most).or(table),
            Body::Sphere { center, radius } => {
                let Some(distance) = sphere_distance(*center, *radius, from, direction).filter(|t| *t < most) else {
                    return table;
                };
                let normal = (from + distance * direction - *center).normalize();
                let point = *center + *radius * normal;
                Some(Hit { distance, point, geometric: normal, shading: normal, is_table: false })
            }
        }
    }

    /// Whether anything is in the way to infinity.
    #[inline]
    pub fn blocks(&self, from: Vec3A, direction: Vec3A) -> bool {
        if self.table_hit(from, direction).is_some() {
            return true;
        }
        match &self.shape {
            Body::Mesh(triangles) => triangles.tree.blocks(from, direction),
            Body::Sphere { center, radius } => sphere_distance(*center, *radius, from, direction).is_some(),
        }
    }

    #[inline]
    fn table_hit(&self, from: Vec3A, direction: Vec3A) -> Option<Hit> {
        let half_side = self.table?;
        let distance = -from.y / direction.y;
        if !(distance > 0.0 && distance < f32::MAX) {
            return None;
        }
        let mut point = from + distance * direction;
        point.y = 0.0;
        let inside = point.x.abs() <= half_side && point.z.abs() <= half_side;
        inside.then_some(Hit { distance, point, geometric: Vec3A::Y, shading: Vec3A::Y, is_table: true })
    }

    /// Where a ray starts that leaves a surface on the side of `normal`.
    #[inline]
    pub fn start(&self, point: Vec3A, normal: Vec3A) -> Vec3A {
        let scale = point.abs().max_element().max(self.size * 0.1);
        point + OFFSET * scale * normal
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against every triangle in turn, for rays in all directions from inside and outside.
    #[test]
    fn the_tree_finds_what_a_search_of_all_finds() {
        let mesh = crate::scene::blob();
        let triangles = Triangles::new(&mesh);
        for k in 0..300 {
            let u = |step: f32| (0.5 + k as f32 * step).fract();
            let (z, phi) = (2.0 * u(0.618) - 1.0, std::f32::consts::TAU * u(0.4142));
            let direction = Vec3A::new((1.0 - z * z).sqrt() * phi.cos(), (1.0 - z * z).sqrt() * phi.sin(), z);
            let from = if k % 2 == 0 { Vec3A::new(0.0, 1.0, 0.0) } else { Vec3A::new(0.1, 1.2, 0.1) - 4.0 * direction };
            let expected =
                (0..mesh.len()).map(|face| meets(&mesh, face, from, direction)).fold(f64::INFINITY, f64::min);
            let found = triangles.closest(from, direction, f32::MAX);
            let distance = found.map_or(f64::INFINITY, |hit| f64::from(hit.distance));
            assert!(distance == expected || (distance - expected).abs() < 1e-4, "ray {k}: {distance} {expected}");
            assert_eq!(triangles.tree.blocks(from, direction), expected.is_finite());
            if let Some(hit) = found {
                assert!((hit.point - (from + hit.distance * direction)).length() < 1e-5);
                assert!((hit.shading.length() - 1.0).abs() < 1e-5 && hit.shading.dot(hit.geometric) > 0.0);
                assert!(triangles.closest(from, direction, 0.99 * hit.distance).is_none());
            }
        }
    }

    /// Distance to a face in double precision.
    fn meets(mesh: &Mesh, face: usize, from: Vec3A, direction: Vec3A) -> f64 {
        let wide = |v: Vec3A| v.to_array().map(f64::from);
        let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let minus = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| a[k] - b[k]);
        let [a, b, c] = mesh.corners(face);
        let (e1, e2, s) = (minus(b, a), minus(c, a), minus(wide(from), a));
        let p = cross(wide(direction), e2);
        let q = cross(s, e1);
        let det = dot(e1, p);
        let (u, v, t) = (dot(s, p) / det, dot(wide(direction), q) / det, dot(e2, q) / det);
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 { t } else { f64::INFINITY }
    }

    #[test]
    fn spheres_and_the_table_are_met_where_they_are() {
        let sphere = |from: Vec3A, d: Vec3A| sphere_distance(Vec3A::ZERO, 1.0, from, d);
        assert_eq!(sphere(Vec3A::new(0.0, 0.0, 5.0), Vec3A::NEG_Z), Some(4.0));
        assert_eq!(sphere(Vec3A::ZERO, Vec3A::X), Some(1.0));
        assert_eq!(sphere(Vec3A::new(0.0, 0.0, 5.0), Vec3A::Z), None);
        assert_eq!(sphere(Vec3A::new(0.0, 2.0, 5.0), Vec3A::NEG_Z), None);
        let geometry =
            Geometry { shape: Body::Sphere { center: Vec3A::ZERO, radius: 0.1 }, table: Some(3.0), size: 0.1 };
        let down = |x: f32| geometry.closest(Vec3A::new(x, 1.0, 0.0), Vec3A::NEG_Y);
        assert!(down(2.9).is_some_and(|hit| hit.is_table && hit.distance == 1.0));
        assert!(down(0.0).is_some_and(|hit| !hit.is_table && (hit.distance - 0.9).abs() < 1e-6));
        assert!(down(3.1).is_none());
        let from = geometry.start(Vec3A::new(2.9, 0.0, 0.0), Vec3A::Y);
        assert!(!geometry.blocks(from, Vec3A::Y) && geometry.blocks(from, Vec3A::NEG_Y));
    }
}
