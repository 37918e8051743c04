//! From cells to masses, and derivatives back again.
//!
//! Cost: 8 additions a cell along phi_d, then one pass over the touched nodes for every pair of polar angles. Back: 32
//! multiplications a cell. Code for AVX2 does the same operations in the same order, so that the bytes are the same.

use super::super::elementary::{LANES, Lanes};
use super::lattice::Lattice;
use super::measure::{MOST_MARKED, Measure};
use multiversion::multiversion;
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
    #[inline(always)]
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

    #[inline(always)]
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
    /// Cells: the row of each and how far it is on the way to the next row, its column, and how far it is on the way to the next column.
    ///
    /// Neighbours mostly go to the same nodes, which stay in registers as long: a sum that is stored and read again takes three times as
    /// long.
    #[inline(always)]
    fn add(&mut self, cells: impl Iterator<Item = ((usize, f64), usize, f64)>) {
        let columns = self.columns;
        let mut at = None;
        let (mut lower, mut upper) = ([0.0; 4], [0.0; 4]);
        for ((row, way), column, t) in cells {
            let place = row * columns + column;
            if at != Some(place) {
                if let Some(at) = at {
                    (self.shares[at], self.shares[at + columns]) = (lower, upper);
                }
                (lower, upper) = (self.shares[place], self.shares[place + columns]);
                at = Some(place);
                self.touched = self.touched.start.min(column)..self.touched.end.max(column + 1);
            }
            let both = t * (1.0 - t) * (1.0 / 6.0);
            let shares = [1.0 - t, t, both * (2.0 - t), both * (1.0 + t)];
            for (to, weight) in [(&mut lower, 1.0 - way), (&mut upper, way)] {
                (0..4).for_each(|k| to[k] += weight * shares[k]);
            }
        }
        if let Some(at) = at {
            (self.shares[at], self.shares[at + columns]) = (lower, upper);
        }
    }

    /// Moves everything to `rows`, which are clear.
    #[inline(always)]
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
            let mut below = [0.0; 2];
            let to = mass.iter_mut().zip(excess);
            for ((mass, excess), [lower, upper, of_lower, of_upper]) in to.zip(shares.iter().chain([&[0.0; 4]])) {
                *mass = below[0] + lower;
                *excess = below[1] + of_lower;
                below = [*upper, *of_upper];
            }
            shares.fill([0.0; 4]);
        }
        self.touched = columns..0;
    }
}

impl Splat {
    /// Contracts phi_d, then theta_o, then theta_i to their nodes. `valid`: the cells that count, all where it is `None`.
    pub fn new(lattice: &Lattice, values: &[Lanes], cells: &[f64], valid: Option<&[bool]>) -> Self {
        splat(lattice, values, cells, valid)
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn splat(lattice: &Lattice, values: &[Lanes], cells: &[f64], valid: Option<&[bool]>) -> Splat {
    let columns = values.len() * LANES;
    let [_, cells_o, cells_phi] = lattice.grid.shape();
    let [_, nodes_o, nodes_phi] = lattice.nodes;
    let count = valid.map_or(cells.len(), |valid| valid.iter().filter(|&&valid| valid).count());
    let weight = 1.0 / count as f64;
    let mut all = Rows::new(lattice.base_len(), columns);
    let mut of_theta_i = Rows::new(nodes_o * nodes_phi, columns);
    let mut of_theta_o = Rows::new(nodes_phi, columns);
    let mut azimuths = Azimuths { columns, shares: vec![[0.0; 4]; nodes_phi * columns], touched: columns..0 };
    let [hats_i, hats_o, hats_phi] = [0, 1, 2].map(|axis| lattice.hats(axis));
    let finder = ColumnFinder::new(values);
    // Of the cells of a row: the value nodes below them and the ways to the next.
    let (mut nodes, mut ways) = (vec![0.0; cells_phi], vec![0.0; cells_phi]);
    for (i, hat_i) in hats_i.into_iter().enumerate() {
        for (o, &hat_o) in hats_o.iter().enumerate() {
            let row = (i * cells_o + o) * cells_phi..(i * cells_o + o + 1) * cells_phi;
            let valid = valid.map(|valid| &valid[row.clone()]);
            // One kind of work a loop: the first becomes vector code.
            for ((node, way), &value) in nodes.iter_mut().zip(&mut ways).zip(&cells[row]) {
                (*node, *way) = lattice.below(value);
            }
            let all = nodes.iter().zip(&ways).zip(&hats_phi);
            let place = |((&node, &t), &hat): ((&f64, &f64), &(usize, f64))| (hat, finder.find(node), t);
            match valid {
                None => azimuths.add(all.map(place)),
                Some(valid) => azimuths.add(all.zip(valid).filter(|&(_, &valid)| valid).map(|(cell, _)| place(cell))),
            }
            azimuths.drain(&mut of_theta_o);
            of_theta_i.contract(hat_o, &of_theta_o);
            of_theta_o.clear();
        }
        all.contract(hat_i, &of_theta_i);
        of_theta_i.clear();
    }
    for array in [&mut all.mass, &mut all.excess] {
        array.as_flattened_mut().iter_mut().for_each(|x| *x *= weight);
    }
    Splat { mass: all.mass, excess: all.excess }
}

/// Finds the column of a value node that is one.
struct ColumnFinder<'a> {
    values: &'a [f64],
    first: f64,
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
        Self { values, first, columns }
    }

    #[inline(always)]
    fn find(&self, node: f64) -> usize {
        if self.columns.is_empty() {
            return self.values.partition_point(|&value| value < node);
        }
        self.columns[index(node - self.first)] as usize
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
