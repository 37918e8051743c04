//! Rows that stand for all others of a kernel matrix: a Cholesky factorisation with pivots that stops early.
//!
//! Golub & Van Loan, *Matrix Computations* (4th ed.), 10.3; random pivots as in Chen, Epperly, Tropp & Webber (2025),
//! doi:10.1002/cpa.22234. Cost: n r^2 for r pivots. Sums run in a fixed order: the same input gives the same bytes.

use ndarray::{Array2, ArrayView2};
use rand::Rng;
use std::ops::Range;
use vernis_metric::math::cholesky::{dot, solve_transposed};

/// A low-rank factor of a kernel matrix, K ~ F F^T, exact for the pivots.
#[derive(Clone)]
pub(super) struct LowRank {
    /// Rows chosen, in order of choice.
    pub pivots: Vec<usize>,
    /// n x r.
    pub factor: Array2<f64>,
}

impl LowRank {
    /// Draws up to `rank` rows, each with a probability proportional to what the rows drawn before leave unexplained of
    /// it; stops early where less than `tolerance` of the largest diagonal element is left of every row.
    pub(super) fn new(kernel: ArrayView2<'_, f64>, rank: usize, tolerance: f64, rng: &mut impl Rng) -> Self {
        Self::in_stages(kernel, &[(0..kernel.nrows(), rank)], tolerance, rng)
    }

    /// The same in stages: up to so many among each range of rows, one after the other.
    pub(super) fn in_stages(
        kernel: ArrayView2<'_, f64>,
        stages: &[(Range<usize>, usize)],
        tolerance: f64,
        rng: &mut impl Rng,
    ) -> Self {
        let n = kernel.nrows();
        let rank: usize = stages.iter().map(|(range, rank)| (*rank).min(range.len())).sum();
        let mut left: Vec<f64> = (0..n).map(|i| kernel[[i, i]]).collect();
        let floor = tolerance * left.iter().fold(0.0f64, |a, &b| a.max(b));
        let mut factor = Array2::<f64>::zeros((n, rank));
        let mut pivots = Vec::with_capacity(rank);
        for (range, rank) in stages {
            for _ in 0..(*rank).min(range.len()) {
                let r = pivots.len();
                let open = |left: f64| if left > floor { left } else { 0.0 };
                let mut mark = rng.random::<f64>() * range.clone().map(|i| open(left[i])).sum::<f64>();
                let drawn = range.clone().filter(|&i| left[i] > floor).find(|&i| {
                    mark -= left[i];
                    mark < 0.0
                });
                // Rounding may leave the mark just past the last row.
                let Some(pivot) = drawn.or_else(|| range.clone().rev().find(|&i| left[i] > floor)) else { break };
                let scale = left[pivot].sqrt();
                let chosen = factor.row(pivot).to_vec();
                for i in 0..n {
                    let explained = factor.row(i).to_slice().map_or(0.0, |row| dot(&row[..r], &chosen[..r]));
                    let value = (kernel[[i, pivot]] - explained) / scale;
                    factor[[i, r]] = value;
                    left[i] -= value * value;
                }
                left[pivot] = f64::NEG_INFINITY;
                pivots.push(pivot);
            }
        }
        let kept = pivots.len();
        Self { pivots, factor: factor.slice_move(ndarray::s![.., ..kept]) }
    }

    /// Rows and columns of the pivots: lower triangular, r x r, row by row.
    fn triangle(&self) -> Vec<f64> {
        let r = self.pivots.len();
        let mut l = vec![0.0; r * r];
        for (i, &p) in self.pivots.iter().enumerate() {
            for j in 0..=i {
                l[i * r + j] = self.factor[[p, j]];
            }
        }
        l
    }

    /// The factor's row of each further point; `kernel` is points x pivots.
    #[cfg(any(test, feature = "train"))]
    pub(super) fn rows_of(&self, kernel: ArrayView2<'_, f64>) -> Array2<f64> {
        let (r, l) = (self.pivots.len(), self.triangle());
        let mut rows = kernel.to_owned();
        for mut row in rows.outer_iter_mut() {
            for i in 0..r {
                let explained: f64 = (0..i).map(|j| l[i * r + j] * row[j]).sum();
                row[i] = (row[i] - explained) / l[i * r + i];
            }
        }
        rows
    }

    /// Weights of the pivots that give the same function as `coefficients` of the factor's columns.
    pub(super) fn pivot_weights(&self, coefficients: &[f64]) -> Vec<f64> {
        let (r, l) = (self.pivots.len(), self.triangle());
        let mut x = coefficients.to_vec();
        solve_transposed(&l, r, &mut x);
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_rank_reproduces_the_matrix_and_its_functions() {
        let n = 12;
        let kernel = Array2::from_shape_fn((n, n), |(i, j)| (-(i as f64 - j as f64).abs() / 3.0).exp());
        let low = LowRank::new(kernel.view(), n, 1e-12, &mut vernis_metric::math::seed::stream(1, "test", 0));
        assert!((&low.factor.dot(&low.factor.t()) - &kernel).iter().all(|e| e.abs() < 1e-12));
        let coefficients: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
        let weights = low.pivot_weights(&coefficients);
        for i in 0..n {
            let through_pivots: f64 = low.pivots.iter().zip(&weights).map(|(&p, w)| kernel[[i, p]] * w).sum();
            let direct: f64 = (0..n).map(|j| low.factor[[i, j]] * coefficients[j]).sum();
            assert!((through_pivots - direct).abs() < 1e-10);
        }
        // A point that is a row gets that row.
        let of_pivots = Array2::from_shape_fn((n, n), |(i, j)| kernel[[i, low.pivots[j]]]);
        assert!((&low.rows_of(of_pivots.view()) - &low.factor).iter().all(|e| e.abs() < 1e-10));
        // Stages draw from their own ranges.
        let rng = &mut vernis_metric::math::seed::stream(1, "test", 0);
        let staged = LowRank::in_stages(kernel.view(), &[(0..6, 3), (6..12, 2)], 1e-12, rng);
        assert!(staged.pivots[..3].iter().all(|p| *p < 6) && staged.pivots[3..].iter().all(|p| *p >= 6));
        assert_eq!((staged.pivots.len(), staged.factor.ncols()), (5, 5));
    }

    #[test]
    fn a_repeated_row_is_chosen_once() {
        let x = [0.0f64, 1.0, 1.0, 2.5];
        let kernel = Array2::from_shape_fn((4, 4), |(i, j)| (-(x[i] - x[j]).abs()).exp());
        assert_eq!(
            LowRank::new(kernel.view(), 4, 1e-9, &mut vernis_metric::math::seed::stream(1, "test", 0)).pivots.len(),
            3
        );
    }
}
