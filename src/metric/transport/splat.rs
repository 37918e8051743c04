//! From cells to masses, and derivatives back again.
//!
//! Cost: 8 additions a cell along phi_d, then one pass over the touched nodes for every pair of polar angles. Back: 32
//! multiplications a cell.

use super::elementary::{LANES, Lanes};
use super::lattice::Lattice;
use super::measure::{LARGEST_SHARE, Measure};

/// The masses before anti-diffusion.
pub(super) struct Splat {
    pub mass: Vec<Lanes>,
    /// V: half the variance that the linear splat added, in h^2.
    pub excess: Vec<Lanes>,
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
    pub fn new(lattice: &Lattice, values: &[Lanes], cells: &[f64], valid: impl Fn(usize) -> bool) -> Self {
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
                    of_theta_o.splat(hat, lattice.below(cells[index]), 1.0 / count as f64, &mut finder);
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
    /// One cell, `upper` on the way from row to row and `t` from value node to value node.
    fn splat(&mut self, (row, upper): (usize, f64), (node, t): (f64, f64), weight: f64, finder: &mut ColumnFinder) {
        let column = finder.find(node);
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

/// Finds the column of a value node, fast where the last one found is near.
struct ColumnFinder<'a> {
    values: &'a [f64],
    last: usize,
}

impl ColumnFinder<'_> {
    fn find(&mut self, node: f64) -> usize {
        let near = self.last.saturating_sub(2)..(self.last + 3).min(self.values.len());
        let near = near.clone().find(|&column| self.values[column] == node);
        self.last = near.unwrap_or_else(|| self.values.partition_point(|&value| value < node));
        self.last
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
    let splat = Splat::new(lattice, &measure.values, cells, &valid);
    let (of_linear, of_excess) = splat.pull_back(measure, of_mass);
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
    let mut finder = ColumnFinder { values: measure.values.as_flattened(), last: 0 };
    let mut gradient = vec![0.0; cells.len()];
    for (cell, total) in gradient.iter_mut().enumerate().filter(|&(cell, _)| valid(cell)) {
        let indices = [cell / (cells_o * cells_phi), cell / cells_phi % cells_o, cell % cells_phi];
        let hats = [0, 1, 2].map(|axis| lattice.hat(axis, indices[axis]));
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
