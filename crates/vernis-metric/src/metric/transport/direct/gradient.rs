//! The derivative of the directly summed divergence with respect to the candidate's values, by reverse differentiation of
//! the annealed iterations.
//!
//! For f(t) = -epsilon ln sum_s (1/N) exp((g(s) - C(s, t))/epsilon), pi(s, t) = (1/N) exp((f(t) + g(s) - C(s, t))/epsilon), and the
//! derivative r(t) of the value with respect to f(t),
//!
//!   d value/dg(s) = -sum_t r(t) pi(s, t),   d value/dw_s = sum_t r(t) pi(s, t) dC/dw_s,   d value/dw_t = r(t) sum_s pi(s, t) dC/dw_t
//!
//! with w the value coordinate. dC/dw_s = w_s - w_t for p = 2, (w_s - w_t)/|x_s - x_t| (0 at the same point) for p = 1. What it is the
//! gradient of is said in [`super::gradient`].
//!
//! Cost: 2 divergences. Memory: the potentials of every update, cells x 24 bytes an update.

use super::super::annealing::{Annealing, Step};
use super::super::elementary::{LANES, Lanes, exp, fma};
use super::super::{GroundCost, SinkhornParameters};
use super::{CHUNK, Kernel, Points, Potentials};
use multiversion::multiversion;
use multiversion::target::target_cfg_f;
use rayon::prelude::*;

/// The divergence of `a` and `b`, and its derivative with respect to the values of the points of `b`.
pub(in crate::metric::transport) fn divergence_and_gradient(
    parameters: &SinkhornParameters,
    annealing: &Annealing,
    a: &Points,
    b: &Points,
) -> (f64, Vec<f64>) {
    let updates: Vec<Step> = annealing.updates().collect();
    let kernel = |epsilon| Kernel { cost: parameters.cost(), alpha: parameters.alpha(), epsilon };
    let mut states = vec![Potentials::zero(a, b)];
    for (k, &Step { epsilon, keep, .. }) in updates.iter().enumerate() {
        let next = states[k].updated(&kernel(epsilon), keep, a, b);
        states.push(next);
    }
    let value = states[updates.len()].value();
    let mut reverse = Reverse::new(a, b);
    for (k, &Step { epsilon, keep, .. }) in updates.iter().enumerate().rev() {
        reverse.step(&kernel(epsilon), keep, a, b, &states[k], &states[k + 1]);
    }
    (value, reverse.of_values)
}

/// Derivatives with respect to the potentials after an update, and those with respect to the values of b so far.
struct Reverse {
    of_f_ba: Vec<f64>,
    of_g_ab: Vec<f64>,
    of_g_bb: Vec<f64>,
    of_values: Vec<f64>,
}

impl Reverse {
    fn new(a: &Points, b: &Points) -> Self {
        let weight = |points: &Points, sign: f64| vec![sign / points.len as f64; points.len];
        let of_values = vec![0.0; b.len];
        Self { of_f_ba: weight(a, 1.0), of_g_ab: weight(b, 1.0), of_g_bb: weight(b, -1.0), of_values }
    }

    /// Back over the update from `before` to `after`.
    fn step(&mut self, kernel: &Kernel, keep: f64, a: &Points, b: &Points, before: &Potentials, after: &Potentials) {
        let share = 1.0 - keep;
        let softmin = |old: &[f64], new: &[f64]| -> Vec<f64> {
            old.iter().zip(new).map(|(old, new)| (new - keep * old) / share).collect()
        };
        let f_ba = softmin(&before.f_ba, &after.f_ba);
        let g_ab = softmin(&before.g_ab, &after.g_ab);
        let g_bb = softmin(&before.g_bb, &after.g_bb);
        let side = |points, potential, slope| Side { points, potential, slope };
        // Every softmin seen from its sources, then from its targets; only the places of b move.
        let to_g_ab = kernel.couple(&side(a, &f_ba, Some(&self.of_f_ba)), &side(b, &before.g_ab, None));
        let to_f_ba = kernel.couple(&side(b, &g_ab, Some(&self.of_g_ab)), &side(a, &before.f_ba, None));
        let from_g_ab = kernel.couple(&side(a, &before.f_ba, None), &side(b, &g_ab, Some(&self.of_g_ab)));
        let to_g_bb = kernel.couple(&side(b, &g_bb, Some(&self.of_g_bb)), &side(b, &before.g_bb, None));
        let from_g_bb = kernel.couple(&side(b, &before.g_bb, None), &side(b, &g_bb, Some(&self.of_g_bb)));
        for (k, of_value) in self.of_values.iter_mut().enumerate() {
            *of_value += share * (to_g_ab[k].1 + from_g_ab[k].1 + to_g_bb[k].1 + from_g_bb[k].1);
        }
        let through = |of: &mut [f64], sums: &[(f64, f64)]| {
            of.iter_mut().zip(sums).for_each(|(of, (sum, _))| *of = keep * *of - share * sum);
        };
        through(&mut self.of_f_ba, &to_f_ba);
        through(&mut self.of_g_ab, &to_g_ab);
        through(&mut self.of_g_bb, &to_g_bb);
    }
}

/// One side of a coupling pi: its points, its potential, and, on the side of the targets, the derivative r.
struct Side<'a> {
    points: &'a Points,
    potential: &'a [f64],
    slope: Option<&'a [f64]>,
}

impl Kernel {
    /// (sum_x r pi(x, y), sum_x r pi(x, y) dC/dw_y) at every point y of `to`, over the points x of `from`; r belongs to
    /// whichever side has one.
    fn couple(&self, from: &Side, to: &Side) -> Vec<(f64, f64)> {
        let entries = from.points.len.div_ceil(LANES);
        let uniform = -(from.points.len as f64).ln();
        // Points that only fill up weigh nothing.
        let mut levels = vec![[f64::NEG_INFINITY; LANES]; entries];
        let mut slopes = vec![[0.0; LANES]; entries];
        let ones = vec![1.0; from.points.len];
        let potentials = levels.as_flattened_mut().iter_mut().zip(from.potential);
        potentials.for_each(|(level, f)| *level = f / self.epsilon + uniform);
        slopes.as_flattened_mut().iter_mut().zip(from.slope.unwrap_or(&ones)).for_each(|(slope, r)| *slope = *r);
        let mut sums = vec![(0.0, 0.0); to.points.len];
        sums.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, sums)| {
            for (sum, y) in sums.iter_mut().zip(chunk * CHUNK..) {
                let level = to.potential[y] / self.epsilon;
                let (mass, slope) = weighted(self, from.points, &levels, &slopes, to.points.point(y), level);
                let r = to.slope.map_or(1.0, |r| r[y]);
                *sum = (r * mass, r * slope);
            }
        });
        sums
    }
}

/// (sum_x s(x) pi(x, y), sum_x s(x) pi(x, y) dC/dw_y) for the slopes s, `level` being f(y)/epsilon.
#[multiversion(targets("x86_64+avx2+fma"))]
fn weighted(
    kernel: &Kernel,
    from: &Points,
    levels: &[Lanes],
    slopes: &[Lanes],
    point: [f64; 4],
    level: f64,
) -> (f64, f64) {
    weighted_of::<{ target_cfg_f!(target_feature = "fma") }>(kernel, from, levels, slopes, point, level)
}

#[inline(always)]
fn weighted_of<const FUSED: bool>(
    kernel: &Kernel,
    from: &Points,
    levels: &[Lanes],
    slopes: &[Lanes],
    point: [f64; 4],
    level: f64,
) -> (f64, f64) {
    let inverse = 1.0 / kernel.epsilon;
    let (mut masses, mut moments) = ([0.0; LANES], [0.0; LANES]);
    for (at, (levels, slopes)) in levels.iter().zip(slopes).enumerate() {
        let squares = kernel.squares::<FUSED>(from, at, point);
        let w = &from.coordinates[3][at];
        for lane in 0..LANES {
            let (cost, per_difference) = match kernel.cost {
                GroundCost::SquaredDistance => (0.5 * squares[lane], 1.0),
                GroundCost::Distance => {
                    let distance = squares[lane].sqrt();
                    (distance, if distance > 0.0 { 1.0 / distance } else { 0.0 })
                }
            };
            let exponent = fma::<FUSED>(-inverse, cost, levels[lane] + level);
            let exponent = if exponent < 0.0 { exponent } else { 0.0 };
            let mass = slopes[lane] * exp::<FUSED>(exponent);
            masses[lane] += mass;
            moments[lane] += mass * per_difference * (point[3] - w[lane]);
        }
    }
    (masses.iter().sum(), moments.iter().sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::graph::GraphGrid;
    use crate::metric::transport::elementary::is_fused;

    /// Fused multiplication rounds once where two instructions round twice: a few 1e-16 of exponents up to 500.
    #[test]
    fn every_instruction_set_gives_the_bits_of_its_multiplication() {
        let grid = GraphGrid::new(4, 4, 16).unwrap();
        let values: Vec<f64> = (0..grid.len()).map(|k| 1.0 + (k as f64 * 0.37).sin()).collect();
        let points = Points::new(grid, &values, |_| true);
        let entries = 0..points.len / LANES;
        let levels: Vec<Lanes> =
            entries.clone().map(|k| std::array::from_fn(|lane| -((k + 3 * lane) as f64) * 0.1)).collect();
        let slopes: Vec<Lanes> =
            entries.map(|k| std::array::from_fn(|lane| ((LANES * k + lane) as f64 * 0.7).cos())).collect();
        for cost in [GroundCost::SquaredDistance, GroundCost::Distance] {
            let kernel = Kernel { cost, alpha: 0.1, epsilon: 0.004 };
            let bits = |(mass, slope): (f64, f64)| [mass.to_bits(), slope.to_bits()];
            let mut differences = 0;
            for index in 0..points.len {
                let point = points.point(index);
                let found = weighted(&kernel, &points, &levels, &slopes, point, -0.3);
                let fused = weighted_of::<true>(&kernel, &points, &levels, &slopes, point, -0.3);
                let separate = weighted_of::<false>(&kernel, &points, &levels, &slopes, point, -0.3);
                assert_eq!(bits(found), bits(if is_fused() { fused } else { separate }), "{cost:?} {index}");
                // Both sums are of numbers up to 1, with either sign.
                assert!((fused.0 - separate.0).abs() < 1e-12, "{fused:?} {separate:?}");
                assert!((fused.1 - separate.1).abs() < 1e-12, "{fused:?} {separate:?}");
                differences += usize::from(bits(fused) != bits(separate));
            }
            assert!(differences > 0, "the bits do not tell one multiplication from the other");
        }
    }
}
