//! Where the masses of a quantised graph may lie: base nodes x value nodes.
//!
//! Base nodes are equispaced from the centre of the first cell of an axis to that of the last, and both sides of a
//! comparison use the same, so that their errors all but cancel. Value nodes are multiples of h, whatever the other
//! side is.

use super::matrix::Matrix;
use crate::metric::graph::GraphGrid;

/// The nodes that the measures of one comparison share.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::metric::transport) struct Lattice {
    pub grid: GraphGrid,
    /// Base nodes along (theta_i, theta_o, phi_d).
    pub nodes: [usize; 3],
    /// h, the distance of value nodes.
    pub spacing: f64,
    /// The share of all cells that every node of each base axis gets.
    shares: [Vec<f64>; 3],
    /// The mean variance that going to the nodes of each base axis has added to a cell, in squared node distances.
    pub base_excess: [f64; 3],
}

impl Lattice {
    pub fn new(grid: GraphGrid, nodes: [usize; 3], spacing: f64) -> Self {
        let cells = grid.shape();
        let of_cells = cells.map(|cells| vec![1.0 / cells as f64; cells]);
        let hats = [0, 1, 2].map(|axis| hats(cells[axis], nodes[axis]));
        Self { grid, nodes, spacing, shares: shares(&of_cells, &hats, nodes), base_excess: excess(&of_cells, &hats) }
    }

    /// Twice the distance of value nodes, and about half the base nodes, but not less than `fewest` of those that there are;
    /// and the shares of the nodes here that each node there gets, an axis each.
    pub(super) fn coarser(&self, fewest: usize) -> (Self, [Matrix; 3]) {
        let nodes = self.nodes.map(|nodes| ((nodes - 1).div_ceil(2) + 1).max(nodes.min(fewest)));
        let hats = [0, 1, 2].map(|axis| hats(self.nodes[axis], nodes[axis]));
        let added = excess(&self.shares, &hats);
        let before = |axis: usize| {
            let finer = (nodes[axis] - 1) as f64 / (self.nodes[axis] - 1) as f64;
            self.base_excess[axis] * finer * finer
        };
        let shares = shares(&self.shares, &hats, nodes);
        let matrix = |axis: usize| {
            let weight = |to: usize, from: usize| {
                let (lower, upper): (usize, f64) = hats[axis][from];
                if to == lower {
                    1.0 - upper
                } else if to == lower + 1 {
                    upper
                } else {
                    0.0
                }
            };
            Matrix::new(nodes[axis], self.nodes[axis], weight)
        };
        let base_excess = [0, 1, 2].map(|axis| before(axis) + added[axis]);
        let lattice = Self { grid: self.grid, nodes, spacing: 2.0 * self.spacing, shares, base_excess };
        (lattice, [0, 1, 2].map(matrix))
    }

    /// For every cell of `axis` the lower of the two nodes between which it lies, and how far it is on the way to the
    /// upper.
    pub fn hats(&self, axis: usize) -> Vec<(usize, f64)> {
        hats(self.grid.shape()[axis], self.nodes[axis])
    }

    /// The value node below a value, as a multiple of h, and how far the value is on the way to the next, in [0, 1).
    #[inline(always)]
    pub fn below(&self, value: f64) -> (f64, f64) {
        let position = value / self.spacing;
        let node = floor(position);
        (node, position - node)
    }

    /// Distance of neighbouring base nodes along `axis` when the axis has length `alpha`.
    pub fn base_spacing(&self, axis: usize, alpha: f64) -> f64 {
        let (cells, nodes) = (self.grid.shape()[axis] as f64, self.nodes[axis] as f64);
        alpha * (cells - 1.0) / cells / (nodes - 1.0)
    }

    /// Number of base nodes.
    pub fn base_len(&self) -> usize {
        self.nodes.iter().product()
    }
}

/// Where `from` equispaced points lie among `to` ones with the same ends.
fn hats(from: usize, to: usize) -> Vec<(usize, f64)> {
    let hat = |index: usize| {
        let position = (index * (to - 1)) as f64 / (from - 1) as f64;
        let lower = (position as usize).min(to - 2);
        (lower, position - lower as f64)
    };
    (0..from).map(hat).collect()
}

/// What every node gets of the shares before.
fn shares(before: &[Vec<f64>; 3], hats: &[Vec<(usize, f64)>; 3], nodes: [usize; 3]) -> [Vec<f64>; 3] {
    [0, 1, 2].map(|axis| {
        let mut shares = vec![0.0; nodes[axis]];
        for (share, &(lower, upper)) in before[axis].iter().zip(&hats[axis]) {
            shares[lower] += share * (1.0 - upper);
            shares[lower + 1] += share * upper;
        }
        shares
    })
}

/// The mean variance that the hat functions add.
fn excess(shares: &[Vec<f64>; 3], hats: &[Vec<(usize, f64)>; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| shares[axis].iter().zip(&hats[axis]).map(|(share, (_, t))| share * t * (1.0 - t)).sum())
}

/// The largest integer up to x, for |x| < 2^51; a large number beyond. Without SSE4.1, `f64::floor` is a library call.
#[inline(always)]
fn floor(x: f64) -> f64 {
    /// Added to a number below 2^51, it leaves the nearest integer.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let nearest = (x + ROUND) - ROUND;
    if nearest > x { nearest - 1.0 } else { nearest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_reach_from_the_first_cell_to_the_last() {
        let grid = GraphGrid::new(6, 9, 24).unwrap();
        let lattice = Lattice::new(grid, [4, 9, 4], 0.5);
        let of_theta_i = lattice.hats(0);
        assert_eq!([of_theta_i[0], of_theta_i[5]], [(0, 0.0), (2, 1.0)]);
        assert_eq!(of_theta_i[2], (1, 2.0 * 3.0 / 5.0 - 1.0));
        // As many nodes as cells: every cell is a node.
        assert!(lattice.hats(1).iter().all(|(_, t)| t % 1.0 == 0.0));
        assert_eq!(lattice.base_excess[1], 0.0);
        assert!((lattice.base_spacing(2, 0.1) - 0.1 * 23.0 / 24.0 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn coarser_lattices_know_what_they_add() {
        // 9 cells on 9 nodes, then on 5: every other node lies half-way, t (1 - t) = 1/4 for 4 of 9.
        let (coarser, hats) = Lattice::new(GraphGrid::new(9, 9, 24).unwrap(), [9, 3, 2], 0.5).coarser(3);
        assert_eq!((coarser.nodes, coarser.spacing), ([5, 3, 2], 1.0));
        assert!((coarser.base_excess[0] - 1.0 / 9.0).abs() < 1e-15);
        // 3 and 2 nodes stay as they are.
        assert_eq!(coarser.base_excess[1], Lattice::new(coarser.grid, [9, 3, 2], 1.0).base_excess[1]);
        assert!(
            hats.iter()
                .zip([9, 3, 2])
                .all(|(hats, nodes)| (0..nodes).all(|node| (hats.column_sum(node) - 1.0).abs() < 1e-15))
        );
    }

    #[test]
    fn values_lie_between_their_nodes() {
        let grid = GraphGrid::new(6, 9, 24).unwrap();
        let lattice = Lattice::new(grid, [4; 3], 0.5);
        assert_eq!(lattice.below(1.25), (2.0, 0.5));
        assert_eq!(lattice.below(-0.25), (-1.0, 0.5));
        assert_eq!(lattice.below(-3.0), (-6.0, 0.0));
        assert!(lattice.below(1e30).0 > 1e30 && lattice.below(-1e30).0 < -1e30);
    }
}
