//! From cells to masses, and derivatives back again.
//!
//! Cost: 8 additions a cell along phi_d, then one pass over the touched nodes for every pair of polar angles. Back: 32
//! multiplications a cell.

use super::super::elementary::{LANES, Lanes};
use super::lattice::Lattice;
use super::measure::{MOST_MARKED, Measure};
use std::ops::Range;

/// The masses before anti-diffusion.
#[derive(Debug, Clone)]
pub(super) struct Splat {
    pub mass: Vec<Lanes>,
    /// V: half the variance that the linear splat added, in h^2.
    pub excess: Vec<Lanes>,
}

/// Masses and excesses on the nodes of the axes already contracted.
struct Rows {
    columns: usize,
    mass: Vec<Lanes>,
    excess: Vec<Lanes>,
    /// The columns that were written to.
    touched: Range<usize>,
}

impl Rows {
    fn new(rows: usize, columns: usize) -> Self {
        let zeros = || vec![[0.0; LANES]; rows * columns / LANES];
        Self { columns, mass: zeros(), excess: zeros(), touched: columns..0 }
    }

    /// Adds `other`, whose rows belong to one cell of this array's slowest axis, to the nodes beside that cell.
    fn contract(&mut self, (node, upper): (usize, f64), other: &Rows) {
        if other.touched.is_empty() {
            return;
        }
        self.touched = self.touched.start.min(other.touched.start)..self.touched.end.max(other.touched.end);
        for (first, weight) in [(node, 1.0 - upper), (node + 1, upper)] {
            if weight > 0.0 {
                let first = first * other.mass.len() * LANES;
                for (from, to) in [(&other.mass, &mut self.mass), (&other.excess, &mut self.excess)] {
                    let (from, to) = (from.as_flattened(), to.as_flattened_mut());
                    for (from, to) in from.chunks_exact(self.columns).zip(to[first..].chunks_exact_mut(self.columns)) {
                        let (from, to) = (&from[other.touched.clone()], &mut to[other.touched.clone()]);
                        from.iter().zip(to).for_each(|(from, to)| *to += weight * from);
                    }
                }
            }
        }
    }

    fn clear(&mut self) {
        if !self.touched.is_empty() {
            for array in [&mut self.mass, &mut self.excess] {
                let rows = array.as_flattened_mut().chunks_exact_mut(self.columns);
                rows.for_each(|row| row[self.touched.clone()].fill(0.0));
            }
            self.touched = self.columns..0;
        }
    }
}

/// What cells give to the value node below them, to the next, and the excesses of both, by the node below.
type Shares = [f64; 4];

/// The cells of one pair of polar angles, on the nodes of phi_d.
struct Azimuths {
    columns: usize,
    shares: Vec<Shares>,
    touched: Range<usize>,
}

impl Azimuths {
    /// One cell, `upper` on the way from row to row and `t` from value node to value node.
    #[inline(always)]
    fn add(&mut self, (row, upper): (usize, f64), column: usize, t: f64) {
        self.touched = self.touched.start.min(column)..self.touched.end.max(column + 1);
        let both = t * (1.0 - t) * (1.0 / 6.0);
        let shares = [1.0 - t, t, both * (2.0 - t), both * (1.0 + t)];
        for (row, weight) in [(row, 1.0 - upper), (row + 1, upper)] {
            let to = &mut self.shares[row * self.columns + column];
            (0..4).for_each(|k| to[k] += weight * shares[k]);
        }
    }

    /// Moves everything to `rows`, which are clear.
    fn drain(&mut self, rows: &mut Rows) {
        if self.touched.is_empty() {
            return;
        }
        let columns = self.columns;
        rows.touched = self.touched.start..self.touched.end + 1;
        for (row, shares) in self.shares.chunks_exact_mut(columns).enumerate() {
            let shares = &mut shares[self.touched.clone()];
            let at = row * columns + self.touched.start;
            let mass = &mut rows.mass.as_flattened_mut()[at..=at + shares.len()];
            let excess = &mut rows.excess.as_flattened_mut()[at..=at + shares.len()];
            for (k, [lower, upper, of_lower, of_upper]) in shares.iter().enumerate() {
                mass[k] += lower;
                mass[k + 1] += upper;
                excess[k] += of_lower;
                excess[k + 1] += of_upper;
            }
            shares.fill([0.0; 4]);
        }
        self.touched = columns..0;
    }
}

impl Splat {
    /// Contracts phi_d, then theta_o, then theta_i to their nodes.
    pub fn new(lattice: &Lattice, values: &[Lanes], cells: &[f64], valid: impl Fn(usize) -> bool) -> Self {
        let columns = values.len() * LANES;
        let [_, cells_o, cells_phi] = lattice.grid.shape();
        let [_, nodes_o, nodes_phi] = lattice.nodes;
        let weight = 1.0 / (0..cells.len()).filter(|&index| valid(index)).count() as f64;
        let mut all = Rows::new(lattice.base_len(), columns);
        let mut of_theta_i = Rows::new(nodes_o * nodes_phi, columns);
        let mut of_theta_o = Rows::new(nodes_phi, columns);
        let mut azimuths = Azimuths { columns, shares: vec![[0.0; 4]; nodes_phi * columns], touched: columns..0 };
        let [hats_i, hats_o, hats_phi] = [0, 1, 2].map(|axis| lattice.hats(axis));
        let finder = ColumnFinder::new(values);
        let mut places = Vec::with_capacity(cells_phi);
        let mut index = 0;
        for (cells, hat_i) in cells.chunks_exact(cells_o * cells_phi).zip(hats_i) {
            for (cells, &hat_o) in cells.chunks_exact(cells_phi).zip(&hats_o) {
                // One kind of work a loop: the first becomes vector code.
                places.clear();
                places.extend(cells.iter().map(|&value| lattice.below(value)));
                for (&(node, t), &hat) in places.iter().zip(&hats_phi) {
                    if valid(index) {
                        azimuths.add(hat, finder.find(node), t);
                    }
                    index += 1;
                }
                azimuths.drain(&mut of_theta_o);
                of_theta_i.contract(hat_o, &of_theta_o);
                of_theta_o.clear();
            }
            all.contract(hat_i, &of_theta_i);
            of_theta_i.clear();
        }
        let scaled = |mut array: Vec<Lanes>| {
            array.as_flattened_mut().iter_mut().for_each(|x| *x *= weight);
            array
        };
        Self { mass: scaled(all.mass), excess: scaled(all.excess) }
    }
}

/// Finds the column of a value node that is one.
struct ColumnFinder<'a> {
    values: &'a [f64],
    /// The column of every multiple of h from the first node on, where they are not too many.
    columns: Vec<u32>,
}

impl<'a> ColumnFinder<'a> {
    fn new(values: &'a [Lanes]) -> Self {
        let values = values.as_flattened();
        let (first, last) = (values[0], values[values.len() - 1]);
        let mut columns = Vec::new();
        if last - first <= MOST_MARKED {
            columns.resize(index(last - first) + 1, 0);
            // Backwards: of the copies of the last node, the first counts.
            values.iter().enumerate().rev().for_each(|(at, value)| columns[index(value - first)] = at as u32);
        }
        Self { values, columns }
    }

    #[inline(always)]
    fn find(&self, node: f64) -> usize {
        if self.columns.is_empty() {
            return self.values.partition_point(|&value| value < node);
        }
        self.columns[index(node - self.values[0])] as usize
    }
}

/// An integer from 0 to 2^32 - 1, converted without the care that a cast takes of others.
#[inline(always)]
pub(super) fn index(x: f64) -> usize {
    const TWO_POW_52: f64 = 4_503_599_627_370_496.0;
    (x + TWO_POW_52).to_bits() as u32 as usize
}

/// The derivative of a function of a measure with respect to the values of its cells.
///
/// `of_mass`: its derivative with respect to the masses. The derivative with respect to an invalid cell is 0.
pub(super) fn pull_back(
    measure: &Measure,
    cells: &[f64],
    valid: impl Fn(usize) -> bool,
    of_mass: &[Lanes],
) -> Vec<f64> {
    let (of_linear, of_excess) = measure.sharpen_back(of_mass);
    over_cells(measure, cells, valid, |at, t| {
        of_linear[at + 1] - of_linear[at]
            + of_excess[at] * (2.0 - 6.0 * t + 3.0 * t * t) / 6.0
            + of_excess[at + 1] * (1.0 - 3.0 * t * t) / 6.0
    })
}

/// The derivatives with respect to the values of cells, where `slope(at, t)` is that of moving a unit of mass that lies t on
/// the way from node `at` to the next, per h.
fn over_cells(
    measure: &Measure,
    cells: &[f64],
    valid: impl Fn(usize) -> bool,
    slope: impl Fn(usize, f64) -> f64,
) -> Vec<f64> {
    let lattice = &measure.lattice;
    let [_, cells_o, cells_phi] = lattice.grid.shape();
    let [_, nodes_o, nodes_phi] = lattice.nodes;
    let columns = measure.values.len() * LANES;
    let count = (0..cells.len()).filter(|&cell| valid(cell)).count();
    let finder = ColumnFinder::new(&measure.values);
    let hats = [0, 1, 2].map(|axis| lattice.hats(axis));
    let mut gradient = vec![0.0; cells.len()];
    for (cell, total) in gradient.iter_mut().enumerate().filter(|&(cell, _)| valid(cell)) {
        let indices = [cell / (cells_o * cells_phi), cell / cells_phi % cells_o, cell % cells_phi];
        let hats = [0, 1, 2].map(|axis| hats[axis][indices[axis]]);
        let (node, t) = lattice.below(cells[cell]);
        let column = finder.find(node);
        for corner in 0..8 {
            let above = [0, 1, 2].map(|axis| corner >> axis & 1);
            let part = |axis: usize| if above[axis] == 1 { hats[axis].1 } else { 1.0 - hats[axis].1 };
            let weight = part(0) * part(1) * part(2);
            if weight > 0.0 {
                let [i, o, phi] = [0, 1, 2].map(|axis| hats[axis].0 + above[axis]);
                *total += weight * slope(((i * nodes_o + o) * nodes_phi + phi) * columns + column, t);
            }
        }
        *total /= count as f64 * lattice.spacing;
    }
    gradient
}
