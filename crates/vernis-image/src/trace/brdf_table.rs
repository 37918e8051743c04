//! A BRDF as a table that is quick to look up, for those that are slow to evaluate or have gaps.
//!
//! Nodes: sqrt(tan(t_h/2)) in equal steps, dense about the normal as a lobe is; tan(t_d/2) over its value at the horizon, which is
//! where the lower of the two directions touches the surface: tan t_d = 1 / (tan t_h |cos phi_d|); and a measure of phi_d between 0 and
//! pi/2, |sin| / (|sin| + |cos|), that goes on in the other quarters. All of them come from directions without an angle. Values
//! between nodes are linear in all three. Half of phi_d is enough where the two directions can be swapped, and a quarter where the BRDF
//! is the same when mirrored as well.
//!
//! A straight line between two nodes of a curve lies above it where the curve is hollow, on average by a twelfth of its second
//! difference. That is taken away from the nodes, so that the energy of a lobe is kept.
//!
//! A node without a measurement has the mean of its neighbours that have one. Values below zero count as 0.

use super::TraceError;
use glam::{Vec3A, Vec4};
use vernis_metric::brdf::Brdf;
use vernis_metric::math::coordinates::{HalfDifference, half_difference_directions};
use vernis_metric::math::parallel;
use vernis_metric::math::{Rgb, Vec3};

/// Nodes of the half angle, the difference angle and a quarter turn.
pub const SIZE: [usize; 3] = [192, 64, 20];
/// How far below the horizon the last node lies, as a share of the difference angle: there the BRDF still has a value.
const INSIDE: f64 = 1.0 - 1e-3;

/// The table.
pub struct BrdfTable {
    /// RGB, 1/sr, of (half, azimuth, difference).
    values: Vec<Vec4>,
    /// Nodes of the azimuth.
    azimuths: usize,
    turn: Turn,
    half: usize,
    difference: usize,
    quarter: usize,
}

/// How much of phi_d tells the rest.
#[derive(Clone, Copy, PartialEq)]
enum Turn {
    /// 0 to pi/2, both with a node: reciprocal and the same when mirrored.
    Quarter,
    /// 0 to pi: reciprocal.
    Half,
    /// 0 to 2 pi.
    Whole,
}

impl Turn {
    fn of(brdf: &dyn Brdf) -> Self {
        match (is_reciprocal(brdf), brdf.is_mirror_symmetric()) {
            (true, true) => Self::Quarter,
            (true, false) => Self::Half,
            (false, _) => Self::Whole,
        }
    }

    fn azimuths(self, quarter: usize) -> usize {
        match self {
            Self::Quarter => quarter + 1,
            Self::Half => 2 * quarter,
            Self::Whole => 4 * quarter,
        }
    }
}

/// Whether swapping the directions changes nothing, at 512 pairs.
fn is_reciprocal(brdf: &dyn Brdf) -> bool {
    let angle = |k: usize, step: f64| (0.5 + k as f64 * step).fract();
    let (wi, wo): (Vec<Vec3>, Vec<Vec3>) = (0..512)
        .map(|k| {
            let direction = |a: f64, b: f64| Vec3::from_spherical(1.5 * a, std::f64::consts::TAU * b);
            (direction(angle(k, 0.7549), 0.0), direction(angle(k, 0.5698), angle(k, 0.4302)))
        })
        .unzip();
    let (mut there, mut back) = (vec![None; 512], vec![None; 512]);
    brdf.eval_in_gamut(&wi, &wo, &mut there);
    brdf.eval_in_gamut(&wo, &wi, &mut back);
    let same = |a: &Rgb, b: &Rgb| (0..3).all(|c| (a[c] - b[c]).abs() <= 1e-6 * (a[c].abs() + b[c].abs()));
    there.iter().zip(&back).all(|pair| matches!(pair, (Some(a), Some(b)) if same(a, b)) || matches!(pair, (None, None)))
}

impl BrdfTable {
    /// Evaluates `brdf` on the nodes.
    ///
    /// # Errors
    /// A value that is not finite, or no measurement at all.
    pub fn new(brdf: &dyn Brdf, size: [usize; 3]) -> Result<Self, TraceError> {
        let [half, difference, quarter] = size;
        let turn = Turn::of(brdf);
        let azimuths = turn.azimuths(quarter);
        let nodes: Vec<Vec<Option<Rgb>>> = parallel::map(half, |h| {
            let (wi, wo): (Vec<Vec3>, Vec<Vec3>) =
                (0..azimuths * difference).map(|k| Self::directions(size, h, k / difference, k % difference)).unzip();
            let mut values = vec![None; wi.len()];
            // As `Value::at` asks.
            brdf.eval_in_gamut(&wo, &wi, &mut values);
            values
        });
        let nodes: Vec<Option<Rgb>> = nodes.concat();
        if let Some(value) = nodes.iter().flatten().find(|v| !v.iter().all(|x| x.is_finite())) {
            return Err(TraceError::NotFinite { value: *value });
        }
        let values = filled(nodes, size, turn).ok_or(TraceError::NoMeasurement)?;
        let values = values.into_iter().map(|v| v.map(|x| x.max(0.0))).collect();
        let values =
            lowered(values, size, turn).into_iter().map(|[r, g, b]| Vec4::new(r as f32, g as f32, b as f32, 0.0));
        Ok(Self { values: values.collect(), azimuths, turn, half, difference, quarter })
    }

    /// All that decides its values.
    pub fn bytes(&self) -> Vec<u8> {
        let size = format!("table {} {} {} {}", self.half, self.difference, self.quarter, self.azimuths);
        let values = self.values.iter().flat_map(|v| v.to_array()).flat_map(f32::to_le_bytes);
        size.into_bytes().into_iter().chain(values).collect()
    }

    fn directions(
        [halves, differences, quarter]: [usize; 3],
        half: usize,
        azimuth: usize,
        difference: usize,
    ) -> (Vec3, Vec3) {
        let theta_h = 2.0 * (half as f64 / (halves - 1) as f64).powi(2).min(1.0 - 1e-6).atan();
        let (turns, q) = (azimuth / quarter, (azimuth % quarter) as f64 / quarter as f64);
        let phi_d = q.atan2(1.0 - q) + turns as f64 * std::f64::consts::FRAC_PI_2;
        let steepness = theta_h.tan() * phi_d.cos().abs();
        let horizon = 1.0 / (steepness + (steepness * steepness + 1.0).sqrt());
        let share = INSIDE * difference as f64 / (differences - 1) as f64;
        let theta_d = 2.0 * (share * horizon).atan();
        half_difference_directions(HalfDifference { theta_h, theta_d, phi_d })
    }

    /// The value for unit directions above the horizon.
    #[inline]
    pub fn at(&self, wi: Vec3A, wo: Vec3A) -> Vec3A {
        let h = (wi + wo).normalize_or(Vec3A::Z);
        let sin_h = (h.x * h.x + h.y * h.y).sqrt();
        let (cos_phi, sin_phi) = if sin_h > 1e-6 { (h.x / sin_h, h.y / sin_h) } else { (1.0, 0.0) };
        // The difference vector, as `half_and_difference_vectors` has it.
        let (x, y) = (cos_phi * wi.x + sin_phi * wi.y, cos_phi * wi.y - sin_phi * wi.x);
        let (dx, dy, dz) = (h.z * x - sin_h * wi.z, y, sin_h * x + h.z * wi.z);
        let sin_d = (dx * dx + dy * dy).sqrt();
        let u = (sin_h / (1.0 + h.z)).sqrt() * (self.half - 1) as f32;
        let steepness = sin_h * dx.abs() / (h.z * sin_d).max(1e-12);
        let share = sin_d / (1.0 + dz) * (steepness + (steepness * steepness + 1.0).sqrt());
        let v = share * ((self.difference - 1) as f32 / INSIDE as f32);
        let (ax, ay) = (dx.abs(), dy.abs());
        let q = ay / (ax + ay).max(1e-20);
        let q = match self.turn {
            Turn::Quarter => q,
            // phi_d and phi_d + pi are the same pair, swapped.
            Turn::Half => {
                if dx * dy >= 0.0 {
                    q
                } else {
                    2.0 - q
                }
            }
            Turn::Whole => match (dx >= 0.0, dy >= 0.0) {
                (true, true) => q,
                (false, true) => 2.0 - q,
                (false, false) => 2.0 + q,
                (true, false) => 4.0 - q,
            },
        };
        self.between(u, q * self.quarter as f32, v)
    }

    #[inline]
    fn between(&self, u: f32, q: f32, v: f32) -> Vec3A {
        let split = |x: f32, last: usize| {
            let k = (x as usize).min(last - 1);
            (k, (x - k as f32).clamp(0.0, 1.0))
        };
        let (h, fh) = split(u, self.half - 1);
        let (d, fd) = split(v, self.difference - 1);
        let (a0, fa) = split(q, if self.turn == Turn::Quarter { self.quarter } else { self.azimuths });
        let a1 = if a0 + 1 == self.azimuths { 0 } else { a0 + 1 };
        let line = |h: usize, a: usize| {
            let at = (h * self.azimuths + a) * self.difference + d;
            self.values[at] + fd * (self.values[at + 1] - self.values[at])
        };
        let plane = |h: usize| {
            let near = line(h, a0);
            near + fa * (line(h, a1) - near)
        };
        let near = plane(h);
        Vec3A::from_vec4(near + fh * (plane(h + 1) - near))
    }
}

/// The nodes, those without a value filled from their neighbours, nearest first; `None` where no node has one.
fn filled(mut nodes: Vec<Option<Rgb>>, [half, difference, quarter]: [usize; 3], turn: Turn) -> Option<Vec<Rgb>> {
    let (azimuths, round) = (turn.azimuths(quarter), turn != Turn::Quarter);
    let place = |h: usize, a: usize, d: usize| (h * azimuths + a) * difference + d;
    while nodes.iter().any(Option::is_none) {
        let found: Vec<(usize, Rgb)> = (0..nodes.len())
            .filter(|&k| nodes[k].is_none())
            .filter_map(|k| {
                let (h, a, d) = (k / difference / azimuths, k / difference % azimuths, k % difference);
                let next = if a + 1 < azimuths { Some(a + 1) } else { round.then_some(0) };
                let last = if a > 0 { Some(a - 1) } else { round.then_some(azimuths - 1) };
                let around = [
                    h.checked_sub(1).map(|h| place(h, a, d)),
                    (h + 1 < half).then(|| place(h + 1, a, d)),
                    d.checked_sub(1).map(|d| place(h, a, d)),
                    (d + 1 < difference).then(|| place(h, a, d + 1)),
                    next.map(|a| place(h, a, d)),
                    last.map(|a| place(h, a, d)),
                ];
                let known: Vec<Rgb> = around.into_iter().flatten().filter_map(|k| nodes[k]).collect();
                let mean = [0, 1, 2].map(|c| known.iter().map(|v| v[c]).sum::<f64>() / known.len() as f64);
                (!known.is_empty()).then_some((k, mean))
            })
            .collect();
        if found.is_empty() {
            return None;
        }
        found.into_iter().for_each(|(k, value)| nodes[k] = Some(value));
    }
    nodes.into_iter().collect()
}

/// The nodes less a twelfth of their second differences, along each axis in turn: linear interpolation then keeps the mean. No node loses
/// more than half of its value. The first and the last of an axis that does not go round stay.
fn lowered(mut nodes: Vec<Rgb>, [half, difference, quarter]: [usize; 3], turn: Turn) -> Vec<Rgb> {
    let azimuths = turn.azimuths(quarter);
    let round = turn != Turn::Quarter;
    for (step, count, round) in
        [(1, difference, false), (difference, azimuths, round), (azimuths * difference, half, false)]
    {
        let before = nodes.clone();
        for (k, node) in nodes.iter_mut().enumerate() {
            let at = k / step % count;
            let first = k - at * step;
            let (last, next) = if round {
                ((at + count - 1) % count, (at + 1) % count)
            } else if at == 0 || at + 1 == count {
                continue;
            } else {
                (at - 1, at + 1)
            };
            *node = [0, 1, 2].map(|c| {
                let value = before[k][c];
                let second = before[first + last * step][c] - 2.0 * value + before[first + next * step][c];
                (value - second / 12.0).max(0.5 * value)
            });
        }
    }
    nodes
}
