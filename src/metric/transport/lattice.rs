//! Where the masses of a quantised graph may lie: base nodes x value nodes.
//!
//! Base nodes are equispaced from the centre of the first cell of an axis to that of the last, and both sides of a
//! comparison use the same, so that their errors all but cancel. Value nodes are multiples of h, whatever the other
//! side is.

use crate::metric::graph::GraphGrid;

/// The nodes that the measures of one comparison share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lattice {
    pub grid: GraphGrid,
    /// Base nodes along (theta_i, theta_o, phi_d).
    pub nodes: [usize; 3],
    /// h, the distance of value nodes.
    pub spacing: f64,
}

impl Lattice {
    /// The lower of the two nodes between which cell `index` of `axis` lies, and how far it is on the way to the upper.
    pub fn hat(&self, axis: usize, index: usize) -> (usize, f64) {
        let (cells, nodes) = (self.grid.shape()[axis], self.nodes[axis]);
        let position = (index * (nodes - 1)) as f64 / (cells - 1) as f64;
        let lower = (position as usize).min(nodes - 2);
        (lower, position - lower as f64)
    }

    /// The value node below a value, as a multiple of h, and how far the value is on the way to the next, in [0, 1).
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

    /// The mean variance that the hat functions of `axis` add to a cell, in squared node distances.
    pub fn base_excess(&self, axis: usize) -> f64 {
        let cells = self.grid.shape()[axis];
        let variance = |index| {
            let (_, t) = self.hat(axis, index);
            t * (1.0 - t)
        };
        (0..cells).map(variance).sum::<f64>() / cells as f64
    }

    /// Number of base nodes.
    pub fn base_len(&self) -> usize {
        self.nodes.iter().product()
    }
}

/// The largest integer up to x, saturating at 2^63: without SSE4.1, `f64::floor` is a library call.
fn floor(x: f64) -> f64 {
    let truncated = x as i64 as f64;
    if truncated > x { truncated - 1.0 } else { truncated }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_reach_from_the_first_cell_to_the_last() {
        let grid = GraphGrid::new(6, 9, 24).unwrap();
        let lattice = Lattice { grid, nodes: [4, 9, 4], spacing: 0.5 };
        assert_eq!([lattice.hat(0, 0), lattice.hat(0, 5)], [(0, 0.0), (2, 1.0)]);
        assert_eq!(lattice.hat(0, 2), (1, 2.0 * 3.0 / 5.0 - 1.0));
        // As many nodes as cells: every cell is a node.
        assert!((0..9).all(|cell| lattice.hat(1, cell).1 % 1.0 == 0.0));
        assert_eq!(lattice.base_excess(1), 0.0);
        assert!((lattice.base_spacing(2, 0.1) - 0.1 * 23.0 / 24.0 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn values_lie_between_their_nodes() {
        let grid = GraphGrid::new(6, 9, 24).unwrap();
        let lattice = Lattice { grid, nodes: [4; 3], spacing: 0.5 };
        assert_eq!(lattice.below(1.25), (2.0, 0.5));
        assert_eq!(lattice.below(-0.25), (-1.0, 0.5));
        assert_eq!(lattice.below(1e30).0, 9.223_372_036_854_776e18);
    }
}
