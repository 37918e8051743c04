//! One channel of a BRDF's graph as masses on a product grid of base nodes and value nodes.
//!
//! A cell of weight 1/N and value w = (k + t) h, 0 <= t < 1, puts (1 - t)/N on value node k and t/N on k + 1. That adds
//! the variance t (1 - t) h^2 to the cell, which anti-diffusion removes: with
//!
//!   V_k += t (1 - t) (2 - t)/(6 N),   V_{k+1} += t (1 - t) (1 + t)/(6 N)
//!
//! every node takes T = min(V_k, .49 A_{k-1}, .49 A_{k+1}) from each of its neighbours: m_k = A_k + 2 T_k - T_{k-1} -
//! T_{k+1}. Where the limits do not bind, this is cubic Lagrange interpolation, whose first four moments are those of the
//! cell; the limits keep every mass positive, so that logarithms exist. Along the base, hat functions: both sides
//! use the same base nodes, so that their errors all but cancel.
//!
//! Value nodes are multiples of h, whatever the other side is, and only those that a cell touches are kept. The masses
//! lie in rows of base nodes, `LANES` value nodes to an entry; the last entry is filled up with massless nodes.
//!
//! Cost: 8 additions a cell, then one pass over the touched nodes for every pair of polar angles.

use super::TransportError;
use super::elementary::{LANES, Lanes};
use crate::metric::graph::GraphGrid;

/// Value nodes beyond these multiples of h have no exact neighbours.
const LARGEST_MULTIPLE: f64 = (1u64 << 50) as f64;
/// Nodes (base nodes times value nodes) of one measure, 32 MB of masses and of each potential.
const MOST_NODES: usize = 1 << 22;
/// The share of a node's mass that one neighbour may take; with two neighbours, some is left.
const LARGEST_SHARE: f64 = 0.49;

/// Where a measure's nodes are: shared by both sides.
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
    /// Nodes are equispaced from the centre of the first cell to that of the last.
    fn hat(&self, axis: usize, index: usize) -> (usize, f64) {
        let (cells, nodes) = (self.grid.shape()[axis], self.nodes[axis]);
        if nodes == 1 {
            return (0, 0.0);
        }
        let position = (index * (nodes - 1)) as f64 / (cells - 1) as f64;
        let lower = (position as usize).min(nodes - 2);
        (lower, position - lower as f64)
    }

    /// Distance of neighbouring base nodes along `axis` when the axis has length `alpha`.
    pub fn base_spacing(&self, axis: usize, alpha: f64) -> f64 {
        let (cells, nodes) = (self.grid.shape()[axis] as f64, self.nodes[axis] as f64);
        if nodes == 1.0 { 0.0 } else { alpha * (cells - 1.0) / cells / (nodes - 1.0) }
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

    pub fn base_len(&self) -> usize {
        self.nodes.iter().product()
    }
}

/// Masses on base nodes x value nodes.
#[derive(Debug, Clone)]
pub(super) struct Measure {
    pub lattice: Lattice,
    /// Multiples of h, increasing; filled up with copies of the last.
    pub values: Vec<Lanes>,
    /// `mass[base * values.len() + entry][lane]`; they add up to 1.
    pub mass: Vec<Lanes>,
}

/// The masses before anti-diffusion.
struct Splat {
    mass: Vec<Lanes>,
    /// Half the variance that the linear splat added, in h^2.
    excess: Vec<Lanes>,
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
    fn adjacent(&self) -> Vec<bool> {
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

/// The derivative of a function of a measure with respect to the values of its cells.
///
/// `of_mass`: its derivative with respect to the masses. The transport of anti-diffusion passes it on to whichever of the
/// three limits binds. The derivative with respect to an invalid cell is 0.
pub(super) fn pull_back(
    measure: &Measure,
    cells: &[f64],
    valid: impl Fn(usize) -> bool,
    of_mass: &[Lanes],
) -> Vec<f64> {
    let lattice = &measure.lattice;
    let [_, cells_o, cells_phi] = lattice.grid.shape();
    let [_, nodes_o, nodes_phi] = lattice.nodes;
    let columns = measure.values.len() * LANES;
    let count = (0..cells.len()).filter(|&cell| valid(cell)).count();
    let splat = Splat::new(lattice, &measure.values, cells, &valid);
    let (of_linear, of_excess) = splat.pull_back(measure, of_mass);
    let mut finder = ColumnFinder { values: measure.values.as_flattened(), last: 0 };
    let mut gradient = vec![0.0; cells.len()];
    for (cell, slope) in gradient.iter_mut().enumerate().filter(|&(cell, _)| valid(cell)) {
        let hats = [
            lattice.hat(0, cell / (cells_o * cells_phi)),
            lattice.hat(1, cell / cells_phi % cells_o),
            lattice.hat(2, cell % cells_phi),
        ];
        let position = cells[cell] / lattice.spacing;
        let multiple = floor(position);
        let (t, column) = (position - multiple, finder.find(multiple));
        for corner in 0..8 {
            let mut weight = 1.0;
            let mut node = [0; 3];
            for (axis, &(lower, upper)) in hats.iter().enumerate() {
                let above = corner >> axis & 1;
                node[axis] = lower + above;
                weight *= if above == 1 { upper } else { 1.0 - upper };
            }
            if weight > 0.0 {
                let at = ((node[0] * nodes_o + node[1]) * nodes_phi + node[2]) * columns + column;
                *slope += weight
                    * (of_linear[at + 1] - of_linear[at]
                        + of_excess[at] * (2.0 - 6.0 * t + 3.0 * t * t) / 6.0
                        + of_excess[at + 1] * (1.0 - 3.0 * t * t) / 6.0);
            }
        }
        *slope /= count as f64 * lattice.spacing;
    }
    gradient
}

/// The largest integer up to x, saturating at 2^63: without SSE4.1, `f64::floor` is a library call.
fn floor(x: f64) -> f64 {
    let truncated = x as i64 as f64;
    if truncated > x { truncated - 1.0 } else { truncated }
}

/// The multiples of h that a valid cell touches, in increasing order.
fn touched(lattice: &Lattice, cells: &[f64], valid: impl Fn(usize) -> bool) -> Result<Vec<Lanes>, TransportError> {
    let mut multiples: Vec<f64> = Vec::new();
    for (index, &value) in cells.iter().enumerate().filter(|&(index, _)| valid(index)) {
        let multiple = floor(value / lattice.spacing);
        if multiple.abs() > LARGEST_MULTIPLE {
            let allowed = LARGEST_MULTIPLE * lattice.spacing;
            return Err(TransportError::ValueTooLarge { cell: index, found: value, allowed });
        }
        // Neighbours in phi_d mostly share their node.
        if multiples.last() != Some(&multiple) {
            multiples.push(multiple);
        }
    }
    multiples.sort_unstable_by(f64::total_cmp);
    multiples.dedup();
    let mut nodes: Vec<f64> = Vec::with_capacity(multiples.len() + 1);
    for &multiple in &multiples {
        if nodes.last() != Some(&multiple) {
            nodes.push(multiple);
        }
        nodes.push(multiple + 1.0);
    }
    let last = nodes.last().copied().unwrap_or(0.0);
    nodes.resize(nodes.len().next_multiple_of(LANES), last);
    Ok(nodes.as_chunks().0.to_vec())
}

/// One phi_d row, or one theta_o row of them: masses and excesses on the nodes of the axes already contracted.
struct Rows {
    columns: usize,
    mass: Vec<f64>,
    excess: Vec<f64>,
    /// The columns that were written to.
    touched: std::ops::Range<usize>,
}

impl Rows {
    fn new(rows: usize, columns: usize) -> Self {
        Self { columns, mass: vec![0.0; rows * columns], excess: vec![0.0; rows * columns], touched: columns..0 }
    }

    fn touch(&mut self, columns: std::ops::Range<usize>) {
        self.touched = self.touched.start.min(columns.start)..self.touched.end.max(columns.end);
    }

    /// Adds `weight` times `other` from row `first` on, which must have been touched.
    fn add(&mut self, first: usize, weight: f64, other: &Rows) {
        let columns = self.columns;
        self.touch(other.touched.clone());
        for (from, to) in [(&other.mass, &mut self.mass), (&other.excess, &mut self.excess)] {
            for (from, to) in from.chunks_exact(columns).zip(to[first * columns..].chunks_exact_mut(columns)) {
                let (from, to) = (&from[other.touched.clone()], &mut to[other.touched.clone()]);
                from.iter().zip(to).for_each(|(from, to)| *to += weight * from);
            }
        }
    }

    fn clear(&mut self) {
        if self.touched.is_empty() {
            return;
        }
        for array in [&mut self.mass, &mut self.excess] {
            array.chunks_exact_mut(self.columns).for_each(|row| row[self.touched.clone()].fill(0.0));
        }
        self.touched = self.columns..0;
    }
}

impl Splat {
    /// Contracts phi_d, then theta_o, then theta_i to their nodes.
    fn new(lattice: &Lattice, values: &[Lanes], cells: &[f64], valid: impl Fn(usize) -> bool) -> Self {
        let columns = values.len() * LANES;
        let [cells_i, cells_o, cells_phi] = lattice.grid.shape();
        let [_, nodes_o, nodes_phi] = lattice.nodes;
        let count = (0..cells.len()).filter(|&index| valid(index)).count();
        let mut all = Rows::new(lattice.base_len(), columns);
        let mut of_theta_i = Rows::new(nodes_o * nodes_phi, columns);
        let mut of_theta_o = Rows::new(nodes_phi, columns);
        let hats_phi: Vec<_> = (0..cells_phi).map(|index| lattice.hat(2, index)).collect();
        let mut finder = ColumnFinder { values: values.as_flattened(), last: 0 };
        for i in 0..cells_i {
            for o in 0..cells_o {
                let first = (i * cells_o + o) * cells_phi;
                for (index, &hat) in (first..).zip(&hats_phi).filter(|&(index, _)| valid(index)) {
                    of_theta_o.splat(hat, cells[index] / lattice.spacing, 1.0 / count as f64, &mut finder);
                }
                of_theta_i.contract(lattice.hat(1, o), nodes_phi, &of_theta_o);
                of_theta_o.clear();
            }
            all.contract(lattice.hat(0, i), nodes_o * nodes_phi, &of_theta_i);
            of_theta_i.clear();
        }
        Self { mass: all.mass.as_chunks().0.to_vec(), excess: all.excess.as_chunks().0.to_vec() }
    }
}

impl Rows {
    /// One cell, at `position` along the value axis in units of h.
    fn splat(&mut self, (row, upper): (usize, f64), position: f64, weight: f64, finder: &mut ColumnFinder) {
        let multiple = floor(position);
        let t = position - multiple;
        let column = finder.find(multiple);
        self.touch(column..column + 2);
        let both = t * (1.0 - t) / 6.0;
        for (row, weight) in [(row, weight * (1.0 - upper)), (row + 1, weight * upper)] {
            if weight > 0.0 {
                let at = row * self.columns + column;
                self.mass[at] += weight * (1.0 - t);
                self.mass[at + 1] += weight * t;
                self.excess[at] += weight * both * (2.0 - t);
                self.excess[at + 1] += weight * both * (1.0 + t);
            }
        }
    }

    /// Adds `other`, whose `rows` rows belong to one cell of this array's slowest axis.
    fn contract(&mut self, (node, upper): (usize, f64), rows: usize, other: &Rows) {
        for (node, weight) in [(node, 1.0 - upper), (node + 1, upper)] {
            if weight > 0.0 && !other.touched.is_empty() {
                self.add(node * rows, weight, other);
            }
        }
    }
}

impl Splat {
    /// The derivatives with respect to the linear splat A and to V, given that with respect to the masses.
    fn pull_back(&self, measure: &Measure, of_mass: &[Lanes]) -> (Vec<f64>, Vec<f64>) {
        let columns = measure.values.len() * LANES;
        let adjacent = measure.adjacent();
        let (mass, excess) = (self.mass.as_flattened(), self.excess.as_flattened());
        let mut of_linear = of_mass.as_flattened().to_vec();
        let mut of_excess = vec![0.0; of_linear.len()];
        let of_mass = of_mass.as_flattened();
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

/// Finds the column of a multiple of h, fast where the last one found is near.
struct ColumnFinder<'a> {
    values: &'a [f64],
    last: usize,
}

impl ColumnFinder<'_> {
    fn find(&mut self, multiple: f64) -> usize {
        let near = self.last.saturating_sub(2)..(self.last + 3).min(self.values.len());
        let near = near.clone().find(|&column| self.values[column] == multiple);
        self.last = near.unwrap_or_else(|| self.values.partition_point(|&value| value < multiple));
        self.last
    }
}
