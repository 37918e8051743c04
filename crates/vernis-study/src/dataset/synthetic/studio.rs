//! Pictures of a material: a bumpy ball in a photographer's studio, seen from above at an angle.
//!
//! L_o(p) = sum_k E(l_k) f(l_k, v) (n.l_k) 4 (v.h_k) sin theta_h dtheta_h dphi_h
//!
//! v: direction to the viewer; n: normal of pixel p; h_k: half vectors on a grid in the frame of n, theta_h =
//! (pi/2) u^2 with u at the middles of 16 cells, phi_h at the middles of 12 from the plane of view; l_k = 2 (v.h_k)
//! h_k - v; the factor 4 (v.h) turns solid angle of h into solid angle of l (Walter et al. 2007, eq. 14,
//! doi:10.2312/EGWR/EGSR07/195-206). The grid is fine where lobes are narrow, so one set of weights serves every
//! material from chalk to chrome. Directions mirrored at the plane of view have one value in every BRDF of the study,
//! so their weights are added.
//!
//! Light, shape and view are those of no descriptor. Cost: about 30,000 evaluations of the BRDF a picture.

use std::f64::consts::PI;
use vernis_metric::brdf::Brdf;
use vernis_metric::math::{Rgb, Vec3};

/// Pixels along a side.
pub const SIDE: usize = 24;
const THETA_CELLS: usize = 16;
const PHI_CELLS: usize = 12;
/// Elevation of the viewer above the horizon of the studio.
const VIEW_ELEVATION: f64 = 0.45;

/// Linear RGB radiance; `None` outside the ball. Row by row, top first.
pub type Picture = Vec<Option<Rgb>>;

/// Weights of the sum above, once for all materials.
pub struct Studio {
    pixels: Vec<Option<Pixel>>,
}

/// Directions in the frame of the pixel's normal and what they weigh.
struct Pixel {
    wi: Vec<Vec3>,
    wo: Vec<Vec3>,
    weight: Vec<Rgb>,
}

impl Studio {
    pub fn new() -> Self {
        let pixels = (0..SIDE * SIDE).map(|k| Pixel::new(k / SIDE, k % SIDE)).collect();
        Self { pixels }
    }

    /// The picture of a ball of `brdf`.
    pub fn picture(&self, brdf: &dyn Brdf) -> Picture {
        self.pixels.iter().map(|p| p.as_ref().map(|p| p.radiance(brdf))).collect()
    }
}

impl Pixel {
    /// `None` where the pixel misses the ball or its normal turns away.
    fn new(row: usize, column: usize) -> Option<Self> {
        let at = |i: usize| (i as f64 + 0.5) * 2.0 / SIDE as f64 - 1.0;
        let (x, y) = (at(column), -at(row));
        let r2 = x * x + y * y;
        if r2 > 0.97 {
            return None;
        }
        // Camera frame: x right, y up, z to the viewer.
        let normal = bumpy_normal(Vec3::new(x, y, (1.0 - r2).sqrt()));
        if normal.z < 0.08 {
            return None;
        }
        let view = Vec3::new(0.0, 0.0, 1.0);
        let frame = Frame::new(normal, view);
        let wo = frame.to_local(view);
        let mut pixel = Self { wi: Vec::new(), wo: Vec::new(), weight: Vec::new() };
        for i in 0..THETA_CELLS {
            let u = (i as f64 + 0.5) / THETA_CELLS as f64;
            let theta = 0.5 * PI * u * u;
            let solid = theta.sin() * PI * u / THETA_CELLS as f64 * 2.0 * PI / PHI_CELLS as f64;
            for j in 0..PHI_CELLS / 2 {
                let h = Vec3::from_spherical(theta, (j as f64 + 0.5) * 2.0 * PI / PHI_CELLS as f64);
                let vh = wo.dot(h);
                let wi = h * (2.0 * vh) - wo;
                if vh > 0.0 && wi.z > 0.0 {
                    let light = |w: Vec3| light(to_world(frame.to_camera(w)));
                    let (one, other) = (light(wi), light(Vec3::new(wi.x, -wi.y, wi.z)));
                    pixel.wi.push(wi);
                    pixel.wo.push(wo);
                    pixel.weight.push(std::array::from_fn(|c| (one[c] + other[c]) * wi.z * 4.0 * vh * solid));
                }
            }
        }
        Some(pixel)
    }

    fn radiance(&self, brdf: &dyn Brdf) -> Rgb {
        let mut values = vec![None; self.wi.len()];
        brdf.eval_batch(&self.wi, &self.wo, &mut values);
        let mut sum = [0.0; 3];
        for (f, w) in values.iter().flatten().zip(&self.weight) {
            (0..3).for_each(|c| sum[c] += f[c] * w[c]);
        }
        sum
    }
}

/// An orthonormal frame around a normal whose tangent lies in the plane of view.
struct Frame {
    tangent: Vec3,
    bitangent: Vec3,
    normal: Vec3,
}

impl Frame {
    fn new(normal: Vec3, view: Vec3) -> Self {
        let projected = view - normal * normal.dot(view);
        // Seen head on, every plane is the plane of view.
        let across = if projected.length() > 1e-9 { projected } else { Vec3::new(normal.z, 0.0, -normal.x) };
        let tangent = across.normalized();
        Self { tangent, bitangent: normal.cross(tangent), normal }
    }

    fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(self.tangent.dot(v), self.bitangent.dot(v), self.normal.dot(v))
    }

    fn to_camera(&self, v: Vec3) -> Vec3 {
        self.tangent * v.x + self.bitangent * v.y + self.normal * v.z
    }
}

/// Normal of the ball at `p` on the unit sphere: the sphere raised by five waves.
fn bumpy_normal(p: Vec3) -> Vec3 {
    const WAVES: [(f64, Vec3, f64); 5] = [
        (0.060, Vec3::new(2.1, 3.3, -1.2), 0.4),
        (0.045, Vec3::new(-4.0, 1.7, 2.6), 1.9),
        (0.030, Vec3::new(1.5, -5.2, 3.1), 4.1),
        (0.022, Vec3::new(6.3, 2.2, 1.4), 2.7),
        (0.016, Vec3::new(-2.4, 4.9, 6.6), 5.3),
    ];
    // Gradient of the height; its tangential part tilts the normal.
    let gradient = WAVES.iter().fold(Vec3::default(), |g, &(a, w, phase)| g + w * (a * (w.dot(p) + phase).cos()));
    (p - (gradient - p * gradient.dot(p))).normalized()
}

/// From the camera's frame to the studio's, whose y is up: the camera looks down by its elevation.
fn to_world(v: Vec3) -> Vec3 {
    let (s, c) = VIEW_ELEVATION.sin_cos();
    Vec3::new(v.x, c * v.y + s * v.z, c * v.z - s * v.y)
}

/// Radiance of the studio from direction `d`: a backdrop, three soft boxes and two bulbs.
fn light(d: Vec3) -> Rgb {
    // A warm floor fades into a cool backdrop.
    let t = smoothstep(-0.3, 0.5, d.y);
    let mut e: Rgb = std::array::from_fn(|c| [0.10, 0.085, 0.07][c] * (1.0 - t) + [0.16, 0.18, 0.22][c] * t);
    // Soft boxes: centre, half width and half height (tangents of angles), radiance. The key light is a window of four
    // panes, whose bars tell a sharp reflection from a blurred one.
    let boxes = [
        (Vec3::new(-0.62, 0.62, 0.48), 0.38, 0.38, [9.0, 8.7, 8.2], true),
        (Vec3::new(0.85, 0.25, 0.46), 0.16, 0.55, [2.4, 2.6, 3.2], false),
        (Vec3::new(0.25, 0.45, -0.86), 0.7, 0.22, [6.5, 5.9, 4.8], false),
    ];
    for (centre, half_width, half_height, radiance, panes) in boxes {
        let forward = centre.normalized();
        let depth = forward.dot(d);
        if depth <= 0.05 {
            continue;
        }
        let right = Vec3::new(0.0, 1.0, 0.0).cross(forward).normalized();
        let (x, y) = (right.dot(d) / depth, forward.cross(right).dot(d) / depth);
        let edge = |x: f64, half: f64| 1.0 - smoothstep(half - 0.03, half + 0.03, x.abs());
        let bars = if panes { smoothstep(0.01, 0.05, x.abs()) * smoothstep(0.01, 0.05, y.abs()) } else { 1.0 };
        let covered = edge(x, half_width) * edge(y, half_height) * bars;
        (0..3).for_each(|c| e[c] += radiance[c] * covered);
    }
    // Bulbs: spherical Gaussians exp(sharpness (cos - 1)).
    let bulbs =
        [(Vec3::new(0.35, 0.90, 0.25), 900.0, [90.0, 80.0, 62.0]), (Vec3::new(-0.2, 0.3, 0.93), 400.0, [22.0; 3])];
    for (centre, sharpness, radiance) in bulbs {
        let lobe = (sharpness * (centre.normalized().dot(d) - 1.0)).exp();
        (0..3).for_each(|c| e[c] += radiance[c] * lobe);
    }
    e
}

fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use vernis_metric::brdf::models::Lambert;

    /// A diffuse ball's radiance is kd/pi times the irradiance, here by plain quadrature over directions.
    #[test]
    fn a_lambertian_pixel_shows_the_irradiance_at_its_normal() {
        let brdf = Lambert::new([1.0; 3]).unwrap();
        let (row, column) = (9, 8);
        let found = Pixel::new(row, column).unwrap().radiance(&brdf);
        let at = |i: usize| (i as f64 + 0.5) * 2.0 / SIDE as f64 - 1.0;
        let (x, y) = (at(column), -at(row));
        let normal = bumpy_normal(Vec3::new(x, y, (1.0 - x * x - y * y).sqrt()));
        let frame = Frame::new(normal, Vec3::new(0.0, 0.0, 1.0));
        let n = 600;
        let mut expected = 0.0;
        for i in 0..n {
            let theta = (f64::from(i) + 0.5) * PI / 2.0 / f64::from(n);
            for j in 0..n {
                let wi = Vec3::from_spherical(theta, (f64::from(j) + 0.5) * 2.0 * PI / f64::from(n));
                let e = light(to_world(frame.to_camera(wi)))[1];
                expected += e * theta.cos() * theta.sin() * PI * PI / f64::from(n * n) / PI;
            }
        }
        // The half-vector grid is coarse for a flat lobe; a tenth is far below what observers notice.
        assert!((found[1] / expected - 1.0).abs() < 0.1, "{} {expected}", found[1]);
    }

    #[test]
    fn the_ball_fills_most_of_the_picture() {
        let inside = Studio::new().pixels.iter().flatten().count();
        assert!(inside > 380 && inside < 460, "{inside}");
    }
}
