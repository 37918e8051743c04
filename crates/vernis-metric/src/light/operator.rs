//! The linear map from a node table to pictures.
//!
//! The radiance that leaves a shape under fixed light is linear in its BRDF. For pixel p with sub-normals n (unit, viewer
//! v = (0, 0, 1)) and light cells l:
//!
//!   picture_p = sum_n sum_l E(l) (n.l)^+ domega(l) f(n, l, v) / #n   (the rendering equation, Kajiya 1986,
//!   doi:10.1145/15886.15902, without interreflection or shadows),
//!
//! and f is read from the table by trilinear interpolation in node coordinates at
//!
//!   h = (l + v) / |l + v|, cos theta_h = n.h, cos theta_d = v.h,
//!   cos phi_d = |cos theta_h cos theta_d - n.l| / (sin theta_h sin theta_d)   (folded to 0..90 deg).
//!
//! For a table of averages ([`Sampling::Averages`]) every pair of a sub-normal and a light cell is a disc of half vectors of radius
//! 1 deg, spread over the nodes of theta_h near the mirror direction (`footprint.rs`), and no lobe falls between two of them.
//!
//! Collecting the weights of each node gives one sparse row a pixel, about 950 of 3,840 nodes. The lights share the
//! nodes of a row (they never go dark) and differ in the weights.
//!
//! Cost: building for four lights visits 29 million (normal, cell) pairs, once a process or read from a cache;
//! applying takes about 10 million multiplications. Memory: 50 bytes a weight with four lights.

use super::footprint::{LIMIT, shares};
use super::node_table::{NODES, PHI_D, THETA_D, THETA_H, theta_d_coordinate, theta_h_coordinate};
use super::sites::Sampling;
use super::source::{COLUMNS, Light, ROWS};
use crate::math::parallel;
use crate::math::{Rgb, Vec3};
use std::f64::consts::FRAC_PI_2;

/// Pixels in one parallel task of the transpose.
const TRANSPOSED: usize = 100;

/// A sparse matrix from nodes to the pixels of one picture a light; colour channels do not mix.
#[derive(Debug, Clone, PartialEq)]
pub struct Operator {
    pub(crate) lights: usize,
    /// The entries of pixel p are `start[p]..start[p + 1]`.
    pub(crate) start: Vec<u32>,
    /// Node of each entry, ascending within a pixel.
    pub(crate) node: Vec<u16>,
    /// `weight[(entry * lights + light) * 3 + channel]`, sr times radiance.
    pub(crate) weight: Vec<f32>,
}

/// What a light cell contributes whatever the normal.
struct Cell {
    direction: Vec3,
    half: Vec3,
    cos_d: f64,
    sin_d: f64,
    /// Node coordinate of theta_d: whole part and fraction.
    j: (usize, f64),
    /// Radiance times solid angle, three channels a light.
    power: Vec<f64>,
}

/// Whole part and fraction of a node coordinate, so that both neighbours exist.
fn split(coordinate: f64, nodes: usize) -> (usize, f64) {
    let whole = (coordinate as usize).min(nodes - 2);
    (whole, (coordinate - whole as f64).min(1.0))
}

fn cells(lights: &[Light]) -> Vec<Cell> {
    let view = Vec3::new(0.0, 0.0, 1.0);
    (0..ROWS * COLUMNS)
        .map(|cell| {
            let direction = Light::cell_direction(cell);
            let half = (direction + view).normalized();
            let solid_angle = Light::cell_solid_angle(cell);
            let cos_d = half.z;
            Cell {
                direction,
                half,
                cos_d,
                sin_d: half.x.hypot(half.y),
                j: split(theta_d_coordinate(cos_d.acos()), THETA_D),
                power: lights.iter().flat_map(|l| l.radiance()[cell].map(|e| e * solid_angle)).collect(),
            }
        })
        .collect()
}

impl Operator {
    /// One row for each element of `pixels`, whose normals (unit, z > 0) it averages, under each of `lights`, for tables that were
    /// sampled so.
    pub fn build(pixels: &[Vec<Vec3>], lights: &[Light], sampling: Sampling) -> Self {
        let cells = cells(lights);
        let channels = 3 * lights.len();
        let rows = rows(pixels, &cells, channels, sampling);
        let mut operator = Self { lights: lights.len(), start: vec![0], node: vec![], weight: vec![] };
        for (node, weight) in rows {
            operator.node.extend(node);
            operator.weight.extend(weight);
            operator.start.push(operator.node.len() as u32);
        }
        operator
    }

    /// Number of pictures that [`Operator::apply`] gives.
    pub fn lights(&self) -> usize {
        self.lights
    }

    /// Number of pixels of each.
    pub fn pixels(&self) -> usize {
        self.start.len() - 1
    }

    /// The pictures of a table of [`NODES`] values: one a light, linear RGB radiance, one entry a pixel.
    pub fn apply(&self, table: &[Rgb]) -> Vec<Vec<Rgb>> {
        let row = |p| match self.lights {
            // The usual number, in registers.
            4 => self.row::<12>(p, table),
            _ => self.row_of_any(p, table),
        };
        let rows = parallel::map(self.pixels(), row);
        (0..self.lights)
            .map(|l| rows.iter().map(|row| [row[3 * l], row[3 * l + 1], row[3 * l + 2]]).collect())
            .collect()
    }

    /// The derivative of a number by the table, from its derivative by the pictures: the transpose of [`Operator::apply`].
    ///
    /// # Panics
    /// If there are not as many pictures as lights, or pixels as the operator has.
    pub fn transpose(&self, by_picture: &[Vec<Rgb>]) -> Vec<Rgb> {
        assert_eq!(by_picture.len(), self.lights, "pictures and lights");
        // Fixed chunks, summed in order: the same bytes on any number of threads.
        let part = |chunk: usize| {
            let mut sum = vec![[0.0; 3]; NODES];
            for p in chunk * TRANSPOSED..((chunk + 1) * TRANSPOSED).min(self.pixels()) {
                let (nodes, weights, channels) = self.entries(p);
                let slopes: Vec<f64> = by_picture.iter().flat_map(|picture| picture[p]).collect();
                for (&node, weights) in nodes.iter().zip(weights.chunks_exact(channels)) {
                    let sum = &mut sum[node as usize];
                    for (weights, slopes) in weights.as_chunks::<3>().0.iter().zip(slopes.as_chunks::<3>().0) {
                        (0..3).for_each(|c| sum[c] += f64::from(weights[c]) * slopes[c]);
                    }
                }
            }
            sum
        };
        let parts = parallel::map(self.pixels().div_ceil(TRANSPOSED), part);
        let mut total = vec![[0.0; 3]; NODES];
        for part in parts {
            total.iter_mut().zip(part).for_each(|(t, p)| (0..3).for_each(|c| t[c] += p[c]));
        }
        total
    }

    /// Nodes and weights of pixel `p`, with the number of weights a node.
    fn entries(&self, p: usize) -> (&[u16], &[f32], usize) {
        let channels = 3 * self.lights;
        let (start, end) = (self.start[p] as usize, self.start[p + 1] as usize);
        (&self.node[start..end], &self.weight[start * channels..end * channels], channels)
    }

    /// Pixel `p` under each light, three channels a light, `CHANNELS` in all.
    fn row<const CHANNELS: usize>(&self, p: usize, table: &[Rgb]) -> Vec<f64> {
        let (nodes, weights, _) = self.entries(p);
        let mut sum = [0.0f64; CHANNELS];
        for (&node, weights) in nodes.iter().zip(weights.as_chunks::<CHANNELS>().0) {
            let f = table[node as usize];
            for c in 0..CHANNELS {
                sum[c] += f64::from(weights[c]) * f[c % 3];
            }
        }
        sum.to_vec()
    }

    /// [`Operator::row`] for any number of lights.
    fn row_of_any(&self, p: usize, table: &[Rgb]) -> Vec<f64> {
        let (nodes, weights, channels) = self.entries(p);
        let mut sum = vec![0.0f64; channels];
        for (&node, weights) in nodes.iter().zip(weights.chunks_exact(channels)) {
            let f = table[node as usize];
            for (c, (sum, w)) in sum.iter_mut().zip(weights).enumerate() {
                *sum += f64::from(*w) * f[c % 3];
            }
        }
        sum
    }
}

/// Nodes and weights of one row.
type Row = (Vec<u16>, Vec<f32>);

/// The rows of all pixels, in order.
///
/// On threads of its own: a pool that steals work could come back to the lock that waits for these rows.
fn rows(pixels: &[Vec<Vec3>], cells: &[Cell], channels: usize, sampling: Sampling) -> Vec<Row> {
    let threads = rayon::current_num_threads().clamp(1, pixels.len().max(1));
    let every = |first: usize| -> Vec<Row> {
        let mut dense = vec![0.0f64; NODES * channels];
        let of_pixel = |normals: &Vec<Vec3>| row(normals, cells, channels, sampling, &mut dense);
        pixels.iter().skip(first).step_by(threads).map(of_pixel).collect()
    };
    let mut parts: Vec<std::vec::IntoIter<Row>> = std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads).map(|first| scope.spawn(move || every(first))).collect();
        let own = every(0);
        // A panic there is a defect here, and goes on as one.
        let join = |handle: std::thread::ScopedJoinHandle<'_, Vec<Row>>| match handle.join() {
            Ok(rows) => rows,
            Err(panic) => std::panic::resume_unwind(panic),
        };
        std::iter::once(own).chain(others.into_iter().map(join)).map(Vec::into_iter).collect()
    });
    (0..pixels.len()).filter_map(|p| parts[p % threads].next()).collect()
}

fn row(normals: &[Vec3], cells: &[Cell], channels: usize, sampling: Sampling, dense: &mut [f64]) -> Row {
    dense.fill(0.0);
    let share = 1.0 / normals.len() as f64;
    normals.iter().for_each(|&n| scatter(n, share, cells, sampling, dense));
    let mut row = (vec![], vec![]);
    for (node, w) in dense.chunks_exact(channels).enumerate() {
        if w.iter().any(|w| *w > 0.0) {
            row.0.push(node as u16);
            row.1.extend(w.iter().map(|w| *w as f32));
        }
    }
    row
}

/// Adds to `dense` (node-major, three channels a light) the weights of one normal.
fn scatter(n: Vec3, share: f64, cells: &[Cell], sampling: Sampling, dense: &mut [f64]) {
    for cell in cells {
        let cos_l = n.dot(cell.direction);
        if cos_l <= 0.0 {
            continue;
        }
        let cos_h = n.dot(cell.half).min(1.0);
        let sin_h = (1.0 - cos_h * cos_h).max(0.0).sqrt();
        let scale = sin_h * cell.sin_d;
        // Without an angle between n and h, or h and v, every azimuth is the same.
        let cos_phi = if scale > 1e-12 { ((cos_h * cell.cos_d - cos_l) / scale).abs().min(1.0) } else { 1.0 };
        let (j, b) = cell.j;
        let (k, c) = split((PHI_D - 1) as f64 * cos_phi.acos() / FRAC_PI_2, PHI_D);
        let weight = share * cos_l;
        let mut add = |i: usize, wi: f64| {
            for (dj, wj) in [(0, 1.0 - b), (1, b)] {
                for (dk, wk) in [(0, 1.0 - c), (1, c)] {
                    let node = (i * THETA_D + j + dj) * PHI_D + k + dk;
                    let w = weight * wi * wj * wk;
                    let at = node * cell.power.len();
                    for (sum, power) in dense[at..at + cell.power.len()].iter_mut().zip(&cell.power) {
                        *sum += w * power;
                    }
                }
            }
        };
        let theta_h = cos_h.acos();
        if sampling == Sampling::Averages && theta_h.to_degrees() < LIMIT {
            let shares = shares(theta_h.to_degrees());
            for (k, share) in shares.share.iter().enumerate().filter(|(_, share)| **share > 0.0) {
                add(shares.first + k, *share);
            }
        } else {
            let (i, a) = split(theta_h_coordinate(theta_h), THETA_H);
            add(i, 1.0 - a);
            add(i + 1, a);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn normals() -> Vec<Vec<Vec3>> {
        [0.0, 30.0, 60.0, 80.0].iter().map(|t: &f64| vec![Vec3::from_spherical(t.to_radians(), 0.7)]).collect()
    }

    #[test]
    fn white_furnace() {
        for sampling in [Sampling::Points, Sampling::Averages] {
            let operator = Operator::build(&normals(), &[Light::constant(1.0), Light::constant(2.5)], sampling);
            let pictures = operator.apply(&vec![[1.0 / PI; 3]; NODES]);
            for (picture, radiance) in pictures.iter().zip([1.0, 2.5]) {
                // The quadrature of a cosine on 1.9-degree cells.
                assert!(picture.iter().flatten().all(|v| (v / radiance - 1.0).abs() < 1e-3), "{picture:?}");
            }
        }
    }

    #[test]
    fn linear_in_the_table() {
        let operator = Operator::build(&normals(), &[Light::lamps(1)], Sampling::Averages);
        let a: Vec<Rgb> = (0..NODES).map(|n| [n as f64, 1.0, (n % 7) as f64]).collect();
        let b: Vec<Rgb> = (0..NODES).map(|n| [1.0, (n % 11) as f64, 2.0]).collect();
        let sum: Vec<Rgb> = a.iter().zip(&b).map(|(a, b)| [0, 1, 2].map(|c| a[c] + 2.0 * b[c])).collect();
        let (pa, pb, ps) = (operator.apply(&a), operator.apply(&b), operator.apply(&sum));
        for p in 0..operator.pixels() {
            for c in 0..3 {
                let expected = pa[0][p][c] + 2.0 * pb[0][p][c];
                assert!((ps[0][p][c] - expected).abs() <= 1e-12 * expected.abs());
            }
        }
    }

    #[test]
    fn the_transpose_is_that_of_the_operator() {
        let operator = Operator::build(&normals(), &[Light::lamps(1), Light::slot()], Sampling::Averages);
        let table: Vec<Rgb> = (0..NODES).map(|n| [n as f64, 1.0, (n % 7) as f64]).collect();
        let slope = |l: usize, p: usize| [1.0 + l as f64, p as f64, (l * p) as f64 - 1.0];
        let slopes: Vec<Vec<Rgb>> = (0..2).map(|l| (0..operator.pixels()).map(|p| slope(l, p)).collect()).collect();
        let dot =
            |a: &[Rgb], b: &[Rgb]| -> f64 { a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a * b).sum() };
        let left: f64 = operator.apply(&table).iter().zip(&slopes).map(|(a, b)| dot(a, b)).sum();
        let right = dot(&table, &operator.transpose(&slopes));
        assert!((left / right - 1.0).abs() < 1e-12, "{left} {right}");
    }

    #[test]
    fn the_mirror_image_of_a_scene_gives_the_mirror_picture() {
        // The slot and the sphere are symmetric about the plane x = 0.
        let pair = [Vec3::from_spherical(0.8, 0.4), Vec3::from_spherical(0.8, PI - 0.4)].map(|n| vec![n]);
        let operator = Operator::build(&pair, &[Light::slot()], Sampling::Averages);
        let table: Vec<Rgb> = (0..NODES).map(|n| [1.0 / (1.0 + n as f64); 3]).collect();
        let picture = &operator.apply(&table)[0];
        assert!((picture[0][0] / picture[1][0] - 1.0).abs() < 1e-5);
    }
}
