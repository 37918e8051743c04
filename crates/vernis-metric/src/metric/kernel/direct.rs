//! The squared kernel distance by its definition: a sum over all pairs of cells.
//!
//! With k the kernel, x_i, y_i the points of cell i on both sides and D = a - b,
//!
//!   1/2 <D, K D> = N^-2 ( sum_i (k(0) - k(x_i, y_i))
//!                  + sum_(i<j) k(x_i, x_j) + k(y_i, y_j) - k(x_i, y_j) - k(y_i, x_j) ).
//!
//! The four terms of a pair nearly cancel and are added first: near-identical BRDFs keep their digits.
//! Cost: O(N^2); 40 ms a channel at 9x9x36.

use super::mixture::Kernel;
use crate::metric::graph::{CommonCells, GraphGrid};

/// Both sides of one channel, cell by cell.
pub(super) struct Points {
    kernel: Kernel,
    /// Index in the grid, place in the base, value of the reference and of the candidate.
    cells: Vec<(usize, [f64; 3], f64, f64)>,
}

impl Points {
    /// `a` and `b` are phi of the values, one a cell of `grid`.
    pub fn new(kernel: Kernel, alpha: f64, a: &[f64], b: &[f64], grid: GraphGrid, common: &CommonCells) -> Self {
        let [_, n_o, n_d] = grid.shape();
        let point = |cell: usize| {
            let place = [cell / (n_o * n_d), cell / n_d % n_o, cell % n_d];
            (cell, [0, 1, 2].map(|axis| alpha * grid.position(axis, place[axis])), a[cell], b[cell])
        };
        Self { kernel, cells: (0..grid.len()).filter(|cell| common.contains(*cell)).map(point).collect() }
    }

    /// N^2 times the squared distance.
    pub fn sum(&self) -> f64 {
        let mut sum = 0.0;
        for (i, &(_, x, a, b)) in self.cells.iter().enumerate() {
            let mut row = self.kernel.fall((a - b).abs());
            for &(_, y, c, d) in &self.cells[..i] {
                let base = square(x, y);
                let fall = |w: f64| self.kernel.fall((base + w * w).sqrt());
                row += (fall(a - d) - fall(a - c)) + (fall(b - c) - fall(b - d));
            }
            sum += row;
        }
        sum
    }

    /// The derivatives of [`Points::sum`] with respect to the candidate's values: (index in the grid, derivative).
    pub fn slopes(&self) -> Vec<(usize, f64)> {
        let slope = |&(cell, x, a, b): &(usize, [f64; 3], f64, f64)| {
            // d/dw of k(0) - k(sqrt(base + w^2)); 0 at w = 0, by symmetry.
            let along = |base: f64, w: f64| match (base + w * w).sqrt() {
                0.0 => 0.0,
                r => self.kernel.slope(r) * w / r,
            };
            let others = self.cells.iter().map(|&(other, y, c, d)| {
                let base = square(x, y);
                if other == cell { along(0.0, b - a) } else { along(base, b - c) - along(base, b - d) }
            });
            (cell, others.sum())
        };
        self.cells.iter().map(slope).collect()
    }
}

fn square(x: [f64; 3], y: [f64; 3]) -> f64 {
    (0..3).map(|k| (x[k] - y[k]).powi(2)).sum()
}
