//! The annealed Sinkhorn iterations by sums over all pairs of cells: right for every cost and every parameter, and slow.
//!
//!   f(y) = -epsilon ln sum_x (1/N) exp((g(x) - C(x, y))/epsilon),   C = |x - y|^2/2 or |x - y|
//!
//! GeomLoss's tensorised distances are at least 1e-4 (it clamps squares); these, like its KeOps ones, are not clamped.
//!
//! Cost: N^2 exponentials, four times an epsilon: half a minute a channel for 15 x 15 x 60 cells. Targets are spread
//! over threads in fixed chunks, each summed in order: the bytes do not depend on the number of threads.

use super::annealing::Annealing;
use super::elementary::{LANES, Lanes, exp, fma, max};
use super::{GroundCost, SinkhornParameters};
use crate::metric::graph::GraphGrid;
use rayon::prelude::*;

/// Targets treated by one task.
const CHUNK: usize = 64;

/// The points of a graph, as arrays of coordinates, [`LANES`] points to an entry.
#[derive(Debug, Clone)]
pub(super) struct Points {
    /// Base coordinates for alpha = 1, and the value.
    coordinates: [Vec<Lanes>; 4],
    /// Number of points; the last entry is filled up with others.
    len: usize,
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

    fn point(&self, index: usize) -> [f64; 4] {
        [0, 1, 2, 3].map(|axis| self.coordinates[axis][index / LANES][index % LANES])
    }
}

/// The kernel of one epsilon.
struct Kernel {
    cost: GroundCost,
    alpha: f64,
    epsilon: f64,
}

/// <a, f_ba - f_aa> + <b, g_ab - g_bb>.
pub(super) fn divergence(parameters: &SinkhornParameters, annealing: &Annealing, a: &Points, b: &Points) -> f64 {
    let zero = |points: &Points| vec![0.0; points.len];
    let (mut f_aa, mut f_ba, mut g_bb, mut g_ab) = (zero(a), zero(a), zero(b), zero(b));
    for (epsilon, keep) in annealing.updates() {
        let kernel = Kernel { cost: parameters.cost(), alpha: parameters.alpha(), epsilon };
        // Both from the old potentials.
        let (old_f_ba, old_g_ab) = (f_ba.clone(), g_ab.clone());
        kernel.update(b, &old_g_ab, a, &mut f_ba, keep);
        kernel.update(a, &old_f_ba, b, &mut g_ab, keep);
        let (old_f_aa, old_g_bb) = (f_aa.clone(), g_bb.clone());
        kernel.update(a, &old_f_aa, a, &mut f_aa, keep);
        kernel.update(b, &old_g_bb, b, &mut g_bb, keep);
    }
    let mean = |f: &[f64], g: &[f64]| f.iter().zip(g).map(|(f, g)| f - g).sum::<f64>() / f.len() as f64;
    mean(&f_ba, &f_aa) + mean(&g_ab, &g_bb)
}

impl Kernel {
    /// f <- keep f + (1 - keep) softmin(g) at the points of `target`.
    fn update(&self, source: &Points, g: &[f64], target: &Points, f: &mut [f64], keep: f64) {
        // Points that only fill up weigh nothing: their exponent is -infinity.
        let mut levels = vec![[f64::NEG_INFINITY; LANES]; g.len().div_ceil(LANES)];
        levels.as_flattened_mut().iter_mut().zip(g).for_each(|(level, g)| *level = g / self.epsilon);
        f.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, f)| {
            for (f, index) in f.iter_mut().zip(chunk * CHUNK..) {
                let (top, sum) = self.sum(source, &levels, target.point(index));
                let softmin = -self.epsilon * (top + (sum / source.len as f64).ln());
                *f = keep * *f + (1.0 - keep) * softmin;
            }
        });
    }

    /// (F, S) of sum_x exp(g(x)/epsilon - C(x, y)/epsilon) = e^F S.
    fn sum(&self, source: &Points, levels: &[Lanes], target: [f64; 4]) -> (f64, f64) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the function is safe but for its need of AVX2 and FMA, which the processor has.
            return unsafe { sum_avx2(self, source, levels, target) };
        }
        sum::<false>(self, source, levels, target)
    }

    /// g/epsilon - C/epsilon from entry `at` of the source.
    #[inline(always)]
    fn exponents<const FUSED: bool>(&self, source: &Points, levels: &Lanes, at: usize, target: [f64; 4]) -> Lanes {
        let mut squares = [0.0; LANES];
        for (axis, scale) in [self.alpha, self.alpha, self.alpha, 1.0].into_iter().enumerate() {
            let x = &source.coordinates[axis][at];
            for lane in 0..LANES {
                let difference = scale * (x[lane] - target[axis]);
                squares[lane] = fma::<FUSED>(difference, difference, squares[lane]);
            }
        }
        let inverse = 1.0 / self.epsilon;
        match self.cost {
            GroundCost::SquaredDistance => {
                std::array::from_fn(|lane| fma::<FUSED>(-0.5 * inverse, squares[lane], levels[lane]))
            }
            GroundCost::Distance => {
                std::array::from_fn(|lane| fma::<FUSED>(-inverse, squares[lane].sqrt(), levels[lane]))
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn sum_avx2(kernel: &Kernel, source: &Points, levels: &[Lanes], target: [f64; 4]) -> (f64, f64) {
    sum::<true>(kernel, source, levels, target)
}

#[inline(always)]
fn sum<const FUSED: bool>(kernel: &Kernel, source: &Points, levels: &[Lanes], target: [f64; 4]) -> (f64, f64) {
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
