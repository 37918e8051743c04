//! One channel of a BRDF's graph as masses on base nodes x value nodes.
//!
//! A cell of weight 1/N and value w = (k + t) h, 0 <= t < 1, puts (1 - t)/N on value node k and t/N on k + 1. That adds
//! the variance t (1 - t) h^2 to the cell, which anti-diffusion removes: with
//!
//!   V_k += t (1 - t) (2 - t)/(6 N),   V_{k+1} += t (1 - t) (1 + t)/(6 N)
//!
//! every node takes T = min(V_k, .49 A_{k-1}, .49 A_{k+1}) from each of its neighbours: m_k = A_k + 2 T_k - T_{k-1} -
//! T_{k+1}. Where the limits do not bind, this is cubic Lagrange interpolation, whose first four moments are those of the
//! cell; the limits keep every mass positive, so that logarithms exist. Along the base, hat functions.
//!
//! Where the cells are few, the limits bind everywhere: a lone cell stays on two nodes, and a small shift of it acts in the
//! middle between them, which costs nearly equal channels one or two per cent. Small grids are better summed directly.
//!
//! Only value nodes that a cell touches are kept. The masses lie in rows of base nodes, `LANES` value nodes to an entry; the
//! last entry is filled up with massless nodes.

use super::TransportError;
use super::elementary::{LANES, Lanes};
use super::lattice::Lattice;
use super::splat::Splat;

/// Value nodes beyond these multiples of h have no exact neighbours.
const LARGEST_MULTIPLE: f64 = (1u64 << 50) as f64;
/// Nodes (base nodes times value nodes) of one measure: 32 MB of masses and of each potential.
const MOST_NODES: usize = 1 << 22;
/// The share of a node's mass that one neighbour may take; with two neighbours, some is left.
pub(super) const LARGEST_SHARE: f64 = 0.49;

/// Masses on base nodes x value nodes.
#[derive(Debug, Clone)]
pub(super) struct Measure {
    pub lattice: Lattice,
    /// Value nodes, as multiples of h, increasing; filled up with copies of the last.
    pub values: Vec<Lanes>,
    /// `mass[base * values.len() + entry][lane]`; they add up to 1.
    pub mass: Vec<Lanes>,
}

impl Measure {
    /// The measure of the cells for which `valid` holds; there must be one, and valid values must be finite.
    pub fn new(lattice: Lattice, cells: &[f64], valid: impl Fn(usize) -> bool) -> Result<Self, TransportError> {
        let values = touched(&lattice, cells, &valid)?;
        let found = lattice.base_len() * values.len() * LANES;
        if found > MOST_NODES {
            return Err(TransportError::TooManyNodes { found, allowed: MOST_NODES });
        }
        let splat = Splat::new(&lattice, &values, cells, valid);
        let mut measure = Self { lattice, values, mass: splat.mass };
        measure.sharpen(&splat.excess);
        Ok(measure)
    }

    /// Whether each value node but the last has a neighbour above.
    pub fn adjacent(&self) -> Vec<bool> {
        self.values.as_flattened().windows(2).map(|pair| pair[1] - pair[0] == 1.0).collect()
    }

    /// Anti-diffusion along the value axis.
    fn sharpen(&mut self, excess: &[Lanes]) {
        let entries = self.values.len();
        let adjacent = self.adjacent();
        let mut taken = vec![0.0; entries * LANES];
        for (mass, excess) in self.mass.chunks_exact_mut(entries).zip(excess.chunks_exact(entries)) {
            let (mass, excess) = (mass.as_flattened_mut(), excess.as_flattened());
            for k in 1..mass.len() - 1 {
                let both = adjacent[k - 1] && adjacent[k];
                taken[k] = if both { excess[k].min(LARGEST_SHARE * mass[k - 1].min(mass[k + 1])) } else { 0.0 };
            }
            for k in 1..mass.len() - 1 {
                mass[k] += 2.0 * taken[k];
                mass[k - 1] -= taken[k];
                mass[k + 1] -= taken[k];
            }
        }
    }
}

/// The value nodes that a valid cell touches, in increasing order, with the node above each.
fn touched(lattice: &Lattice, cells: &[f64], valid: impl Fn(usize) -> bool) -> Result<Vec<Lanes>, TransportError> {
    let mut below: Vec<f64> = Vec::new();
    for (index, &value) in cells.iter().enumerate().filter(|&(index, _)| valid(index)) {
        let (node, _) = lattice.below(value);
        if node.abs() > LARGEST_MULTIPLE {
            let allowed = LARGEST_MULTIPLE * lattice.spacing;
            return Err(TransportError::ValueTooLarge { cell: index, found: value, allowed });
        }
        // Neighbours in phi_d mostly share their node.
        if below.last() != Some(&node) {
            below.push(node);
        }
    }
    below.sort_unstable_by(f64::total_cmp);
    below.dedup();
    let mut nodes: Vec<f64> = Vec::with_capacity(2 * below.len());
    for &node in &below {
        if nodes.last() != Some(&node) {
            nodes.push(node);
        }
        nodes.push(node + 1.0);
    }
    let last = nodes.last().copied().unwrap_or(0.0);
    nodes.resize(nodes.len().next_multiple_of(LANES), last);
    Ok(nodes.as_chunks().0.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::graph::GraphGrid;

    fn measure(cells: &[f64]) -> Measure {
        // Azimuths of one polar cell end at 720.
        let polar = if cells.len() > 2000 { 10 } else { 2 };
        let grid = GraphGrid::new(2, polar, cells.len() / (2 * polar)).unwrap();
        Measure::new(Lattice { grid, nodes: [2, 2, 2], spacing: 0.1 }, cells, |_| true).unwrap()
    }

    /// Sum of m (w - centre)^power over all nodes.
    fn moment(measure: &Measure, centre: f64, power: i32) -> f64 {
        let values = measure.values.as_flattened();
        let rows = measure.mass.as_flattened().chunks_exact(values.len());
        rows.flat_map(|row| row.iter().zip(values).map(|(m, v)| m * (v * 0.1 - centre).powi(power))).sum()
    }

    #[test]
    fn four_moments_of_densely_spread_values_are_kept() {
        let cells: Vec<f64> = (0..4000).map(|k| 3.0 + (f64::from(k) * 0.37).sin()).collect();
        let measure = measure(&cells);
        assert!(measure.mass.as_flattened().iter().all(|&mass| mass >= 0.0));
        for power in 0..4 {
            let expected = cells.iter().map(|w| (w - 3.0).powi(power)).sum::<f64>() / 4000.0;
            let found = moment(&measure, 3.0, power);
            // Masses spread to two nodes without care would add a sixth of the squared spacing, 1.7e-3. At the ends of the
            // range, where the limits bind, some of that remains.
            let tolerance = if power < 2 { 1e-12 } else { 3e-4 };
            assert!((found - expected).abs() < tolerance, "{power}: {found} {expected}");
        }
    }

    #[test]
    fn a_lone_cell_stays_on_two_nodes_with_its_mean() {
        let measure = measure(&[0.535; 8]);
        assert_eq!(measure.values.as_flattened()[..3], [5.0, 6.0, 6.0]);
        assert!((moment(&measure, 0.535, 1)).abs() < 1e-15);
        assert!((moment(&measure, 0.0, 0) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn far_and_absurd_values_are_few_nodes_or_refused() {
        let mut cells = [0.3; 16];
        cells[3] = 1e5;
        assert_eq!(measure(&cells).values.len(), 1);
        cells[3] = 1e300;
        let grid = GraphGrid::new(2, 2, 4).unwrap();
        let lattice = Lattice { grid, nodes: [2; 3], spacing: 0.1 };
        let refused = Measure::new(lattice, &cells, |_| true).unwrap_err();
        assert!(matches!(refused, TransportError::ValueTooLarge { cell: 3, .. }), "{refused}");
    }
}
