//! The nodes along one base axis.

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
}
