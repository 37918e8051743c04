//! The annealed Sinkhorn iterations by sums over all pairs of cells: right for every cost and every parameter, and slow.
//!
//!   f(y) = -epsilon ln sum_x (1/N) exp((g(x) - C(x, y))/epsilon),   C = |x - y|^2/2 or |x - y|
//!
//! GeomLoss's tensorised distances are at least 1e-4 (it clamps squares); these, like its KeOps ones, are not clamped.
//!
//! Cost: N^2 exponentials, four times an epsilon: half a minute a channel for 15 x 15 x 60 cells. Targets are spread
//! over threads in fixed chunks, each summed in order: the bytes do not depend on the number of threads.

mod gradient;

pub(super) use gradient::divergence_and_gradient;

use super::annealing::{Annealing, Step};
use super::elementary::{LANES, Lanes, exp, fma, max};
use super::{GroundCost, SinkhornParameters};
use crate::metric::graph::GraphGrid;
use multiversion::multiversion;
use multiversion::target::target_cfg_f;
use rayon::prelude::*;

/// Targets treated by one task.
pub(super) const CHUNK: usize = 64;

/// The points of a graph, as arrays of coordinates, [`LANES`] points to an entry.
#[derive(Debug, Clone)]
pub(super) struct Points {
    /// Base coordinates for alpha = 1, and the value.
    pub coordinates: [Vec<Lanes>; 4],
    /// Number of points; the last entry is filled up with others.
    pub len: usize,
}

impl Points {
    pub fn new(grid: GraphGrid, values: &[f64], valid: impl Fn(usize) -> bool) -> Self {
        let [_, n_o, n_phi] = grid.shape();
        let cells: Vec<usize> = (0..values.len()).filter(|&cell| valid(cell)).collect();
        let fill = |coordinate: &dyn Fn(usize) -> f64| {
            let mut all: Vec<f64> = cells.iter().map(|&cell| coordinate(cell)).collect();
            all.resize(all.len().next_multiple_of(LANES), 0.0);
            all.as_chunks().0.to_vec()
        };
        let coordinates = [
            fill(&|cell| grid.position(0, cell / (n_o * n_phi))),
            fill(&|cell| grid.position(1, cell / n_phi % n_o)),
            fill(&|cell| grid.position(2, cell % n_phi)),
            fill(&|cell| values[cell]),
        ];
        Self { coordinates, len: cells.len() }
    }

    pub fn point(&self, index: usize) -> [f64; 4] {
        [0, 1, 2, 3].map(|axis| self.coordinates[axis][index / LANES][index % LANES])
    }
}

/// The kernel of one epsilon.
pub(super) struct Kernel {
    pub cost: GroundCost,
    pub alpha: f64,
    pub epsilon: f64,
}

/// The four potentials at one time.
pub(super) struct Potentials {
    pub f_ba: Vec<f64>,
    pub g_ab: Vec<f64>,
    pub f_aa: Vec<f64>,
    pub g_bb: Vec<f64>,
}

impl Potentials {
    pub fn zero(a: &Points, b: &Points) -> Self {
        let zero = |points: &Points| vec![0.0; points.len];
        Self { f_ba: zero(a), g_ab: zero(b), f_aa: zero(a), g_bb: zero(b) }
    }

    /// The potentials after one update, all from the old ones.
    pub fn updated(&self, kernel: &Kernel, keep: f64, a: &Points, b: &Points) -> Self {
        let updated = |source, g: &[f64], target, f: &Vec<f64>| {
            let mut f = f.clone();
            kernel.update(source, g, target, &mut f, keep);
            f
        };
        Self {
            f_ba: updated(b, &self.g_ab, a, &self.f_ba),
            g_ab: updated(a, &self.f_ba, b, &self.g_ab),
            f_aa: updated(a, &self.f_aa, a, &self.f_aa),
            g_bb: updated(b, &self.g_bb, b, &self.g_bb),
        }
    }

    /// <a, f_ba - f_aa> + <b, g_ab - g_bb>.
    pub fn value(&self) -> f64 {
        let mean = |f: &[f64], g: &[f64]| f.iter().zip(g).map(|(f, g)| f - g).sum::<f64>() / f.len() as f64;
        mean(&self.f_ba, &self.f_aa) + mean(&self.g_ab, &self.g_bb)
    }
}

/// The divergence of `a` and `b`.
pub(super) fn divergence(parameters: &SinkhornParameters, annealing: &Annealing, a: &Points, b: &Points) -> f64 {
    let kernel = |epsilon| Kernel { cost: parameters.cost(), alpha: parameters.alpha(), epsilon };
    let start = Potentials::zero(a, b);
    let update = |old: Potentials, Step { epsilon, keep, .. }| old.updated(&kernel(epsilon), keep, a, b);
    annealing.updates().fold(start, update).value()
}

impl Kernel {
    /// f <- keep f + (1 - keep) softmin(g) at the points of `target`.
    pub fn update(&self, source: &Points, g: &[f64], target: &Points, f: &mut [f64], keep: f64) {
        // Points that only fill up weigh nothing: their exponent is -infinity.
        let mut levels = vec![[f64::NEG_INFINITY; LANES]; g.len().div_ceil(LANES)];
        levels.as_flattened_mut().iter_mut().zip(g).for_each(|(level, g)| *level = g / self.epsilon);
        f.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, f)| {
            for (f, index) in f.iter_mut().zip(chunk * CHUNK..) {
                let (top, sum) = sum(self, source, &levels, target.point(index));
                let softmin = -self.epsilon * (top + (sum / source.len as f64).ln());
                *f = keep * *f + (1.0 - keep) * softmin;
            }
        });
    }

    /// |x - y|^2 from entry `at` of the source to `target`.
    #[inline(always)]
    pub fn squares<const FUSED: bool>(&self, source: &Points, at: usize, target: [f64; 4]) -> Lanes {
        let mut squares = [0.0; LANES];
        for (axis, scale) in [self.alpha, self.alpha, self.alpha, 1.0].into_iter().enumerate() {
            let x = &source.coordinates[axis][at];
            for lane in 0..LANES {
                let difference = scale * (x[lane] - target[axis]);
                squares[lane] = fma::<FUSED>(difference, difference, squares[lane]);
            }
        }
        squares
    }

    /// g/epsilon - C/epsilon from entry `at` of the source.
    #[inline(always)]
    fn exponents<const FUSED: bool>(&self, source: &Points, levels: &Lanes, at: usize, target: [f64; 4]) -> Lanes {
        let mut exponents = self.squares::<FUSED>(source, at, target);
        let inverse = 1.0 / self.epsilon;
        for lane in 0..LANES {
            exponents[lane] = match self.cost {
                GroundCost::SquaredDistance => fma::<FUSED>(-0.5 * inverse, exponents[lane], levels[lane]),
                GroundCost::Distance => fma::<FUSED>(-inverse, exponents[lane].sqrt(), levels[lane]),
            };
        }
        exponents
    }
}

/// (F, S) of sum_x exp(g(x)/epsilon - C(x, y)/epsilon) = e^F S.
#[multiversion(targets("x86_64+avx2+fma"))]
fn sum(kernel: &Kernel, source: &Points, levels: &[Lanes], target: [f64; 4]) -> (f64, f64) {
    sum_of::<{ target_cfg_f!(target_feature = "fma") }>(kernel, source, levels, target)
}

#[inline(always)]
fn sum_of<const FUSED: bool>(kernel: &Kernel, source: &Points, levels: &[Lanes], target: [f64; 4]) -> (f64, f64) {
    let mut tops = [f64::NEG_INFINITY; LANES];
    for (at, levels) in levels.iter().enumerate() {
        let exponents = kernel.exponents::<FUSED>(source, levels, at, target);
        (0..LANES).for_each(|lane| tops[lane] = max(exponents[lane], tops[lane]));
    }
    let top = tops.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let mut sums = [0.0; LANES];
    for (at, levels) in levels.iter().enumerate() {
        let exponents = kernel.exponents::<FUSED>(source, levels, at, target);
        (0..LANES).for_each(|lane| sums[lane] += exp::<FUSED>(exponents[lane] - top));
    }
    (top, sums.iter().sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::transport::elementary::is_fused;

    /// Fused multiplication rounds once where two instructions round twice: a few 1e-16 of exponents up to 500.
    #[test]
    fn every_instruction_set_gives_the_bits_of_its_multiplication() {
        let grid = GraphGrid::new(4, 4, 16).unwrap();
        let values: Vec<f64> = (0..grid.len()).map(|k| 1.0 + (k as f64 * 0.37).sin()).collect();
        // One point fewer than fill the entries.
        let points = Points::new(grid, &values, |cell| cell != 5);
        let mut levels: Vec<Lanes> =
            (0..points.len.div_ceil(LANES)).map(|k| std::array::from_fn(|lane| (k + 3 * lane) as f64 * 0.1)).collect();
        *levels.as_flattened_mut().last_mut().unwrap() = f64::NEG_INFINITY;
        for cost in [GroundCost::SquaredDistance, GroundCost::Distance] {
            let kernel = Kernel { cost, alpha: 0.1, epsilon: 0.004 };
            let bits = |(top, sum): (f64, f64)| [top.to_bits(), sum.to_bits()];
            let mut differences = 0;
            for index in 0..points.len {
                let target = points.point(index);
                let found = sum(&kernel, &points, &levels, target);
                let fused = sum_of::<true>(&kernel, &points, &levels, target);
                let separate = sum_of::<false>(&kernel, &points, &levels, target);
                assert_eq!(bits(found), bits(if is_fused() { fused } else { separate }), "{cost:?} {index}");
                let logarithm = |(top, sum): (f64, f64)| top + sum.ln();
                assert!((logarithm(fused) - logarithm(separate)).abs() < 1e-12, "{fused:?} {separate:?}");
                differences += usize::from(bits(fused) != bits(separate));
            }
            assert!(differences > 0, "the bits do not tell one multiplication from the other");
        }
    }
}
