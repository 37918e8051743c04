//! The nodes of a lattice along one axis, and Gaussians between them.

/// A point between two nodes: mass 1 - t at `below`, t at `below + 1`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hat {
    pub below: usize,
    pub t: f64,
}

/// Equispaced nodes of a base axis: from the first cell centre to the last, no more nodes than cells.
#[derive(Debug, Clone)]
pub(super) struct BaseAxis {
    pub nodes: usize,
    /// Distance between nodes.
    pub spacing: f64,
    /// One a cell.
    pub hats: Vec<Hat>,
}

impl BaseAxis {
    /// `cells` of width alpha/cells on `nodes` nodes.
    pub fn new(cells: usize, nodes: usize, alpha: f64) -> Self {
        let nodes = nodes.min(cells).max(2);
        let extent = alpha * (cells - 1) as f64 / cells as f64;
        let hat = |cell: usize| {
            let x = cell as f64 * (nodes - 1) as f64 / (cells - 1) as f64;
            let below = (x as usize).min(nodes - 2);
            Hat { below, t: x - below as f64 }
        };
        Self { nodes, spacing: extent / (nodes - 1) as f64, hats: (0..cells).map(hat).collect() }
    }

    /// The mean over the cells of the variance that the hats add to a point.
    pub fn spread(&self) -> f64 {
        let mean = self.hats.iter().map(|h| h.t * (1.0 - h.t)).sum::<f64>() / self.hats.len() as f64;
        mean * self.spacing * self.spacing
    }

    /// L with L L^T = exp(-(x - y)^2/(2 variance)) between the nodes, to `TOLERANCE`.
    pub fn factor(&self, variance: f64) -> Factor {
        let gram = |i: usize, j: usize| {
            let d = i.abs_diff(j) as f64 * self.spacing;
            (-0.5 * d * d / variance).exp()
        };
        Factor::of(self.nodes, gram)
    }
}

/// Square of what a factor may leave of a row of its matrix, whose diagonal is 1.
const TOLERANCE: f64 = 1e-11;

/// A low-rank factor: `values` is nodes x rank.
#[derive(Debug, Clone)]
pub(super) struct Factor {
    pub rank: usize,
    pub values: Vec<f64>,
}

impl Factor {
    /// Pivoted Cholesky factorisation (Higham, "Accuracy and Stability of Numerical Algorithms", 2002, section 10.3,
    /// doi:10.1137/1.9780898718027) of a positive matrix with unit diagonal, stopped at [`TOLERANCE`].
    fn of(n: usize, gram: impl Fn(usize, usize) -> f64) -> Self {
        let mut left: Vec<f64> = vec![1.0; n];
        let mut columns: Vec<Vec<f64>> = Vec::new();
        while columns.len() < n {
            let pivot = (0..n).max_by(|a, b| left[*a].total_cmp(&left[*b]).then(b.cmp(a))).unwrap_or(0);
            if left[pivot] < TOLERANCE {
                break;
            }
            let scale = 1.0 / left[pivot].sqrt();
            let column: Vec<f64> = (0..n)
                .map(|i| (gram(i, pivot) - columns.iter().map(|c| c[i] * c[pivot]).sum::<f64>()) * scale)
                .collect();
            left.iter_mut().zip(&column).for_each(|(l, c)| *l -= c * c);
            left[pivot] = 0.0;
            columns.push(column);
        }
        let rank = columns.len();
        Self { rank, values: (0..n).flat_map(|i| columns.iter().map(move |c| c[i])).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hats_keep_a_cell_where_it_is() {
        for (cells, nodes) in [(45, 15), (180, 15), (6, 15), (2, 2), (9, 9)] {
            let axis = BaseAxis::new(cells, nodes, 0.1);
            for (cell, hat) in axis.hats.iter().enumerate() {
                let place = (hat.below as f64 + hat.t) * axis.spacing;
                assert!((place - 0.1 * cell as f64 / cells as f64).abs() < 1e-15);
                assert!(hat.below + 1 < axis.nodes && (0.0..=1.0).contains(&hat.t));
            }
            assert!(cells > nodes || axis.spread() < 1e-30);
        }
    }

    #[test]
    fn factors_give_the_gaussian_back() {
        let axis = BaseAxis::new(45, 15, 0.1);
        for (sigma, most) in [(0.007, 15), (0.05, 10), (1.0, 4)] {
            let factor = axis.factor(sigma * sigma);
            assert!(factor.rank <= most, "{sigma}: {}", factor.rank);
            for i in 0..15 {
                for j in 0..15 {
                    let row = |k: usize| &factor.values[k * factor.rank..(k + 1) * factor.rank];
                    let found: f64 = row(i).iter().zip(row(j)).map(|(a, b)| a * b).sum();
                    let d = (i as f64 - j as f64) * axis.spacing / sigma;
                    assert!((found - (-0.5 * d * d).exp()).abs() < 1e-10);
                }
            }
        }
    }
}
