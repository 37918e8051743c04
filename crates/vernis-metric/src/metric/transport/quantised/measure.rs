//! One channel of a BRDF's graph as masses on base nodes x value nodes.
//!
//! A cell of weight 1/N and value w = (k + t) h, 0 <= t < 1, puts (1 - t)/N on value node k and t/N on k + 1. That adds
//! the variance t (1 - t) h^2 to the cell, which anti-diffusion removes: with
//!
//!   V_k += t (1 - t) (2 - t)/(6 N),   V_{k+1} += t (1 - t) (1 + t)/(6 N)
//!
//! every node takes T = min(V_k, 0.49 A_{k-1}, 0.49 A_{k+1}) from each of its neighbours: m_k = A_k + 2 T_k - T_{k-1} -
//! T_{k+1}. Where the limits do not bind, this is cubic Lagrange interpolation, whose first four moments are those of the
//! cell; the limits keep every mass positive, so that logarithms exist. Along the base, hat functions.
//!
//! Where the cells are few, the limits bind everywhere: a lone cell stays on two nodes, and a small shift of it acts in the
//! middle between them, which costs nearly equal channels one or two per cent. Small grids are better summed directly.
//!
//! Only value nodes that a cell touches are kept, `LANES` of them to an entry; the last entry is filled up with massless nodes.
//! Masses and potentials lie entry by entry, all base nodes of one beside each other, as sums take them. Masses are made in rows
//! of value nodes, a base node each.

use super::super::TransportError;
use super::super::elementary::{LANES, Lanes, range_of};
use super::lattice::Lattice;
use super::splat::{Splat, index};
use multiversion::multiversion;

/// Value nodes beyond these multiples of h have no exact neighbours.
const LARGEST_MULTIPLE: f64 = (1u64 << 50) as f64;
/// Ranges of so many value nodes are marked one by one, longer ones sorted.
pub(super) const MOST_MARKED: f64 = (1u32 << 20) as f64;
/// Nodes (base nodes times value nodes) of one measure: 32 MB of masses and of each potential.
const MOST_NODES: usize = 1 << 22;
/// The share of a node's mass that one neighbour may take; with two neighbours, some is left.
const LARGEST_SHARE: f64 = 0.49;

/// Masses on base nodes x value nodes.
#[derive(Debug, Clone)]
pub(super) struct Measure {
    pub lattice: Lattice,
    /// Value nodes, as multiples of h, increasing; filled up with copies of the last.
    pub values: Vec<Lanes>,
    /// `mass[entry * lattice.base_len() + base][lane]`; they add up to 1.
    pub mass: Vec<Lanes>,
    /// Where `mass` is not 0.
    pub support: Support,
    /// The masses before anti-diffusion, for derivatives; in rows.
    pub linear: Splat,
}

impl Measure {
    /// The measure of the valid cells (all where `valid` is `None`); there must be one, and valid values must be finite.
    pub fn new(lattice: Lattice, cells: &[f64], valid: Option<&[bool]>) -> Result<Self, TransportError> {
        let values = touched(&lattice, cells, valid)?;
        let found = lattice.base_len() * values.len() * LANES;
        if found > MOST_NODES {
            return Err(TransportError::TooManyNodes { found, allowed: MOST_NODES });
        }
        let splat = Splat::new(&lattice, &values, cells, valid);
        Ok(Self::sharpened(lattice, values, splat))
    }

    /// The measure of masses that were spread linearly.
    pub fn sharpened(lattice: Lattice, values: Vec<Lanes>, splat: Splat) -> Self {
        let mut measure = Self { lattice, values, mass: Vec::new(), support: Support::default(), linear: splat };
        measure.mass = by_entry(&measure.sharpen(), measure.values.len());
        measure.support = Support::of(&measure.mass, measure.values.len());
        measure
    }

    /// The masses in rows.
    pub fn rows(&self) -> Vec<Lanes> {
        in_rows(&self.mass, self.values.len())
    }

    /// Value nodes, multiples of h in any order and number, as [`Measure::values`] has them.
    pub fn axis(mut nodes: Vec<f64>) -> Vec<Lanes> {
        nodes.sort_unstable_by(f64::total_cmp);
        nodes.dedup();
        let last = nodes.last().copied().unwrap_or(0.0);
        nodes.resize(nodes.len().next_multiple_of(LANES), last);
        nodes.as_chunks().0.to_vec()
    }

    /// Whether each value node but the last has a neighbour above.
    pub fn adjacent(&self) -> Vec<bool> {
        self.values.as_flattened().windows(2).map(|pair| pair[1] - pair[0] == 1.0).collect()
    }

    /// The masses after anti-diffusion along the value axis, in rows.
    fn sharpen(&self) -> Vec<Lanes> {
        let entries = self.values.len();
        let adjacent = self.adjacent();
        let mut taken = vec![0.0; entries * LANES];
        let mut sharpened = self.linear.mass.clone();
        for (mass, excess) in sharpened.chunks_exact_mut(entries).zip(self.linear.excess.chunks_exact(entries)) {
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
        sharpened
    }

    /// The derivatives with respect to A and V, in rows, given that with respect to the masses. The transport of anti-diffusion passes
    /// it on to whichever of the three limits binds.
    pub fn sharpen_back(&self, of_mass: &[Lanes]) -> (Vec<f64>, Vec<f64>) {
        let columns = self.values.len() * LANES;
        let adjacent = self.adjacent();
        let (mass, excess) = (self.linear.mass.as_flattened(), self.linear.excess.as_flattened());
        let of_mass = in_rows(of_mass, self.values.len());
        let of_mass = of_mass.as_flattened();
        let mut of_linear = of_mass.to_vec();
        let mut of_excess = vec![0.0; of_linear.len()];
        for row in (0..mass.len()).step_by(columns) {
            for k in (1..columns - 1).filter(|&k| adjacent[k - 1] && adjacent[k]) {
                let at = row + k;
                let of_taken = 2.0 * of_mass[at] - of_mass[at - 1] - of_mass[at + 1];
                let lower = if mass[at - 1] < mass[at + 1] { at - 1 } else { at + 1 };
                if excess[at] <= LARGEST_SHARE * mass[lower] {
                    of_excess[at] += of_taken;
                } else {
                    of_linear[lower] += LARGEST_SHARE * of_taken;
                }
            }
        }
        (of_linear, of_excess)
    }
}

/// Rows of `entries` entries each, entry by entry.
fn by_entry(rows: &[Lanes], entries: usize) -> Vec<Lanes> {
    let mut turned = Vec::with_capacity(rows.len());
    (0..entries).for_each(|entry| turned.extend(rows.chunks_exact(entries).map(|row| row[entry])));
    turned
}

/// The inverse of [`by_entry`].
fn in_rows(numbers: &[Lanes], entries: usize) -> Vec<Lanes> {
    by_entry(numbers, numbers.len() / entries)
}

/// Where numbers on entries of value nodes x base nodes are not 0: a cell's neighbours have values like its own, so that a
/// base node has mass at few of all values (a third at the default setting, a tenth of 11^3 base nodes).
#[derive(Debug, Clone, Default)]
pub(super) struct Support {
    /// Where in `base` each entry starts, and the end.
    starts: Vec<usize>,
    /// The base nodes of all entries, increasing within each.
    base: Vec<u32>,
}

impl Support {
    /// Of `numbers`, so many `entries`.
    pub fn of(numbers: &[Lanes], entries: usize) -> Self {
        let (mut starts, mut base) = (vec![0], Vec::new());
        for numbers in numbers.chunks_exact(numbers.len() / entries) {
            let filled = numbers.iter().zip(0u32..).filter(|(numbers, _)| numbers.iter().any(|&number| number != 0.0));
            base.extend(filled.map(|(_, node)| node));
            starts.push(base.len());
        }
        Self { starts, base }
    }

    /// The base nodes at which any of the value nodes of `entry` has a number.
    pub fn at(&self, entry: usize) -> &[u32] {
        &self.base[self.starts[entry]..self.starts[entry + 1]]
    }
}

/// The value nodes that a valid cell touches: the one below it, and the next.
fn touched(lattice: &Lattice, cells: &[f64], valid: Option<&[bool]>) -> Result<Vec<Lanes>, TransportError> {
    let is_valid = |cell: usize| valid.is_none_or(|valid| valid[cell]);
    let (least, most) = range_of(cells, valid);
    let (first, last) = (lattice.below(least).0, lattice.below(most).0);
    if let Some(found) = [least, most].into_iter().find(|&value| lattice.below(value).0.abs() > LARGEST_MULTIPLE) {
        let cell = (0..cells.len()).find(|&index| is_valid(index) && cells[index] == found).unwrap_or(0);
        return Err(TransportError::ValueTooLarge { cell, found, allowed: LARGEST_MULTIPLE * lattice.spacing });
    }
    let mut nodes = Vec::new();
    if last - first < MOST_MARKED {
        let marked = marked(lattice, cells, valid, first, index(last - first) + 1);
        nodes.extend(marked.into_iter().enumerate().filter(|&(_, marked)| marked).map(|(step, _)| first + step as f64));
    } else {
        // Neighbours in phi_d mostly share their node.
        let of_valid = cells.iter().enumerate().filter(|&(index, _)| is_valid(index));
        for (node, _) in of_valid.map(|(_, &value)| lattice.below(value)) {
            if nodes.last() != Some(&node) {
                nodes.push(node);
            }
        }
    }
    nodes.extend_from_within(..);
    let half = nodes.len() / 2;
    nodes[half..].iter_mut().for_each(|node| *node += 1.0);
    Ok(Measure::axis(nodes))
}

/// Which of the `count` value nodes from `first` on have a valid cell between them and the next.
#[multiversion(targets("x86_64+avx2"))]
fn marked(lattice: &Lattice, cells: &[f64], valid: Option<&[bool]>, first: f64, count: usize) -> Vec<bool> {
    const CHUNK: usize = 256;
    let mut marked = vec![false; count];
    let mut steps = [0.0; CHUNK];
    for (chunk, cells) in cells.chunks(CHUNK).enumerate() {
        for (step, &value) in steps.iter_mut().zip(cells) {
            *step = lattice.below(value).0 - first;
        }
        let start = chunk * CHUNK;
        let steps = steps[..cells.len()].iter().enumerate();
        steps
            .filter(|&(k, _)| valid.is_none_or(|valid| valid[start + k]))
            .for_each(|(_, &step)| marked[index(step)] = true);
    }
    marked
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::graph::GraphGrid;

    fn measure(cells: &[f64]) -> Measure {
        // Azimuths of one polar cell end at 720.
        let polar = if cells.len() > 2000 { 10 } else { 2 };
        let grid = GraphGrid::new(2, polar, cells.len() / (2 * polar)).unwrap();
        Measure::new(Lattice::new(grid, [2, 2, 2], 0.1), cells, None).unwrap()
    }

    /// Sum of m (w - centre)^power over all nodes.
    fn moment(measure: &Measure, centre: f64, power: i32) -> f64 {
        let values = measure.values.as_flattened();
        let mass = measure.rows();
        let rows = mass.as_flattened().chunks_exact(values.len());
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
    fn the_support_is_where_the_mass_is() {
        let cells: Vec<f64> = (0..4000).map(|k| f64::from(k / 400) + (f64::from(k) * 0.37).sin()).collect();
        let measure = measure(&cells);
        let (entries, rows) = (measure.values.len(), measure.rows());
        for entry in 0..entries {
            let filled = |&base: &usize| rows[base * entries + entry].iter().any(|&mass| mass > 0.0);
            let expected: Vec<u32> = (0..measure.lattice.base_len()).filter(filled).map(|base| base as u32).collect();
            assert_eq!(measure.support.at(entry), expected);
        }
        let filled: usize = (0..entries).map(|entry| measure.support.at(entry).len()).sum();
        assert!(filled < entries * measure.lattice.base_len(), "all of {filled}");
    }

    #[test]
    fn far_and_absurd_values_are_few_nodes_or_refused() {
        let mut cells = [0.3; 16];
        cells[3] = 1e5;
        assert_eq!(measure(&cells).values.len(), 1);
        cells[3] = 1e300;
        let grid = GraphGrid::new(2, 2, 4).unwrap();
        let lattice = Lattice::new(grid, [2; 3], 0.1);
        let refused = Measure::new(lattice, &cells, None).unwrap_err();
        assert!(matches!(refused, TransportError::ValueTooLarge { cell: 3, .. }), "{refused}");
    }
}
