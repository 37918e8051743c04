//! Boxes of neighbouring cells on which two graphs are nearly flat.
//!
//! From the whole grid, the box with the largest sum of squares is halved, along the axis where that lowers the sum most, until there are
//! as many boxes as asked for, or every box is a cell. The sum of squares of a box is, over its cells,
//!
//!   sum (a - mean a)^2 + (b - mean b)^2 + c (d - mean d)^2 + |X - mean X|^2,   d = a - b,   X: the cell's place in the base,
//!
//! with c such that d varies over the whole grid as much as a and b together: nearly equal graphs have a difference to resolve as well.
//! The boxes are the same with a and b exchanged. Boxes with equal sums, such as mirror images, are halved together, so that a small
//! change of the values, which decides between them, changes no box.
//!
//! Cost: each halving reads the cells of its box once.

use crate::metric::graph::GraphGrid;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::ops::Range;

/// Sums of squares that differ by no larger share are equal: mirror images differ in the last digits.
const SAME: f64 = 1e-9;

/// Ranges of cells along theta_i, theta_o and phi_d.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::metric::transport) struct CellBox {
    pub ranges: [Range<usize>; 3],
}

impl CellBox {
    /// The cells, row by row: theta_i and theta_o of the row, and its cells' indices.
    pub fn rows(&self, grid: GraphGrid) -> impl Iterator<Item = (usize, usize, Range<usize>)> + '_ {
        let [_, n_o, n_phi] = grid.shape();
        let [i, o, phi] = &self.ranges;
        let row = move |i: usize, o: usize| {
            let first = (i * n_o + o) * n_phi;
            (i, o, first + phi.start..first + phi.end)
        };
        i.clone().flat_map(move |i| o.clone().map(move |o| row(i, o)))
    }

    fn half(&self, axis: usize, upper: bool) -> Self {
        let mut half = self.clone();
        let Range { start, end } = half.ranges[axis];
        let middle = usize::midpoint(start, end);
        half.ranges[axis] = if upper { middle..end } else { start..middle };
        half
    }
}

/// Two graphs over one grid and the cells that count.
pub(in crate::metric::transport) struct Graphs<'a> {
    pub grid: GraphGrid,
    pub a: &'a [f64],
    pub b: &'a [f64],
    /// `None`: all cells.
    pub valid: Option<&'a [bool]>,
    pub alpha: f64,
}

impl Graphs<'_> {
    pub fn is_valid(&self, cell: usize) -> bool {
        self.valid.is_none_or(|valid| valid[cell])
    }

    /// Number of valid cells.
    pub fn cells(&self) -> usize {
        self.valid.map_or(self.grid.len(), |valid| valid.iter().filter(|valid| **valid).count())
    }

    /// For each of `counts`, each at least as large as the one before: at most so many boxes that hold every valid cell, in the order of
    /// their first cells.
    pub fn boxes(&self, counts: &[usize]) -> Vec<Vec<CellBox>> {
        let whole = CellBox { ranges: self.grid.shape().map(|n| 0..n) };
        let of_whole = self.sums(&whole).whole();
        let spread = of_whole.squares(0.0);
        let of_difference = of_whole.variation(2);
        let weight = if of_difference > 0.0 { spread / of_difference } else { 0.0 };
        let mut heap = BinaryHeap::new();
        heap.extend(self.weighed(whole, weight));
        let mut cells = Vec::new();
        let mut grown_to = |count: usize| {
            self.halve(&mut heap, &mut cells, weight, count);
            let mut all: Vec<CellBox> =
                cells.iter().chain(heap.iter().map(|weighed| &weighed.cells)).cloned().collect();
            all.sort_by_key(|found| found.ranges.clone().map(|range| range.start));
            all
        };
        counts.iter().map(|&count| grown_to(count)).collect()
    }

    /// Halves the boxes of `heap`; those of one cell go to `cells`.
    fn halve(&self, heap: &mut BinaryHeap<Weighed>, cells: &mut Vec<CellBox>, weight: f64, count: usize) {
        while let Some(first) = heap.pop() {
            let least = first.squares * (1.0 - SAME);
            let mut equals = vec![first];
            while heap.peek().is_some_and(|next| next.squares >= least) {
                equals.extend(heap.pop());
            }
            if cells.len() + heap.len() + 2 * equals.len() > count {
                heap.extend(equals);
                break;
            }
            for Weighed { cells: found, axis, .. } in equals {
                match axis {
                    None => cells.push(found),
                    Some(axis) => {
                        let halves = [false, true].map(|upper| self.weighed(found.half(axis, upper), weight));
                        heap.extend(halves.into_iter().flatten());
                    }
                }
            }
        }
    }

    /// A box with its sum of squares and where to halve it; `None` without a valid cell.
    fn weighed(&self, cells: CellBox, weight: f64) -> Option<Weighed> {
        let halves = self.sums(&cells);
        let whole = halves.whole();
        if whole.count == 0.0 {
            return None;
        }
        // Evenly spaced places vary by (n^2 - 1)/12 spacings squared.
        let base = |axis: usize, n: usize| {
            let spacing = self.alpha / self.grid.shape()[axis] as f64;
            whole.count * spacing * spacing * (n * n - 1) as f64 / 12.0
        };
        let lengths = cells.ranges.clone().map(|range| range.len());
        let squares = whole.squares(weight);
        let gain = |axis: &usize| {
            let n = lengths[*axis];
            let [low, high] = halves.0[*axis];
            let of_base = base(*axis, n) - base(*axis, n.div_ceil(2));
            squares - low.squares(weight) - high.squares(weight) + of_base
        };
        let axes = (0..3).filter(|&axis| lengths[axis] > 1);
        let clearer = |best: (f64, usize), next: (f64, usize)| if next.0 > best.0 * (1.0 + SAME) { next } else { best };
        let axis = axes.map(|axis| (gain(&axis), axis)).reduce(clearer);
        let of_base = (0..3).map(|axis| base(axis, lengths[axis])).sum::<f64>();
        Some(Weighed { squares: squares + of_base, cells, axis: axis.map(|(_, axis)| axis) })
    }

    /// Of both halves along each axis, in one pass.
    fn sums(&self, cells: &CellBox) -> Halves {
        let [i, o, phi] = &cells.ranges;
        let middle = |range: &Range<usize>| usize::midpoint(range.start, range.end);
        let split = middle(phi) - phi.start;
        let mut halves = Halves::default();
        for (at_i, at_o, row) in cells.rows(self.grid) {
            let low = self.sum(row.start..row.start + split);
            let high = self.sum(row.start + split..row.end);
            halves.0[2][0].add(&low);
            halves.0[2][1].add(&high);
            for half in [&low, &high] {
                halves.0[0][usize::from(at_i >= middle(i))].add(half);
                halves.0[1][usize::from(at_o >= middle(o))].add(half);
            }
        }
        halves
    }

    fn sum(&self, cells: Range<usize>) -> Sums {
        let mut sums = Sums::default();
        let (a, b) = (&self.a[cells.clone()], &self.b[cells.clone()]);
        match self.valid {
            None => a.iter().zip(b).for_each(|(a, b)| sums.include(*a, *b)),
            Some(valid) => {
                let valid = valid[cells].iter();
                a.iter().zip(b).zip(valid).filter(|(_, valid)| **valid).for_each(|((a, b), _)| sums.include(*a, *b));
            }
        }
        sums
    }
}

/// A box in the order of its sum of squares; of equal ones, the first.
#[derive(Debug)]
struct Weighed {
    squares: f64,
    cells: CellBox,
    /// Where to halve it; `None`: it is a cell.
    axis: Option<usize>,
}

impl Ord for Weighed {
    fn cmp(&self, other: &Self) -> Ordering {
        let start = |weighed: &Self| weighed.cells.ranges.clone().map(|range| range.start);
        self.squares.total_cmp(&other.squares).then_with(|| start(other).cmp(&start(self)))
    }
}

impl PartialOrd for Weighed {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Weighed {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Weighed {}

/// By axis, lower half and upper half.
#[derive(Debug, Default)]
struct Halves([[Sums; 2]; 3]);

impl Halves {
    fn whole(&self) -> Sums {
        let mut whole = self.0[0][0];
        whole.add(&self.0[0][1]);
        whole
    }
}

/// Number of cells, and sums and sums of squares of a, b and a - b.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    count: f64,
    sums: [f64; 3],
    squares: [f64; 3],
}

impl Sums {
    fn include(&mut self, a: f64, b: f64) {
        self.count += 1.0;
        for (k, x) in [a, b, a - b].into_iter().enumerate() {
            self.sums[k] += x;
            self.squares[k] += x * x;
        }
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        for k in 0..3 {
            self.sums[k] += other.sums[k];
            self.squares[k] += other.squares[k];
        }
    }

    /// Sum of squares about the mean; rounding may leave a little of nothing.
    fn variation(&self, k: usize) -> f64 {
        if self.count == 0.0 { 0.0 } else { (self.squares[k] - self.sums[k] * self.sums[k] / self.count).max(0.0) }
    }

    fn squares(&self, weight: f64) -> f64 {
        self.variation(0) + self.variation(1) + weight * self.variation(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graphs<'a>(grid: GraphGrid, a: &'a [f64], b: &'a [f64], valid: Option<&'a [bool]>) -> Graphs<'a> {
        Graphs { grid, a, b, valid, alpha: 0.1 }
    }

    #[test]
    fn every_valid_cell_lies_in_one_box() {
        let grid = GraphGrid::new(5, 6, 9).unwrap();
        let a: Vec<f64> = (0..grid.len()).map(|k| (k as f64 * 0.37).sin()).collect();
        let b: Vec<f64> = (0..grid.len()).map(|k| (k as f64 * 0.11).cos()).collect();
        // A box without a valid cell, and single ones.
        let valid: Vec<bool> = (0..grid.len()).map(|k| k >= 54 && k % 7 != 0).collect();
        let counts = [2, 17, 100, 1000];
        let grown = graphs(grid, &a, &b, Some(&valid)).boxes(&counts);
        for (count, boxes) in counts.into_iter().zip(grown) {
            let mut seen = vec![0; grid.len()];
            boxes.iter().flat_map(|cells| cells.rows(grid)).flat_map(|(_, _, row)| row).for_each(|k| seen[k] += 1);
            assert!(seen.iter().zip(&valid).all(|(&n, &valid)| n == 1 || (n == 0 && !valid)), "{count}");
            assert!(boxes.len() <= count, "{count}: {}", boxes.len());
            // Whatever was asked for before.
            let exchanged = graphs(grid, &b, &a, Some(&valid)).boxes(&[count]);
            assert_eq!([boxes], exchanged[..]);
        }
        let cells = graphs(grid, &a, &b, None).boxes(&[1000]);
        assert_eq!(cells[0].len(), grid.len());
    }

    /// A jump that lies between two halves is found.
    #[test]
    fn boxes_end_where_values_jump() {
        let grid = GraphGrid::new(4, 4, 8).unwrap();
        let step: Vec<f64> = (0..grid.len()).map(|k| f64::from(u8::from(k % 8 >= 4))).collect();
        let flat = vec![0.3; grid.len()];
        let boxes = graphs(grid, &step, &flat, None).boxes(&[2]);
        assert_eq!(
            boxes[0].iter().map(|b| b.ranges.clone()).collect::<Vec<_>>(),
            [[0..4, 0..4, 0..4], [0..4, 0..4, 4..8]]
        );
    }
}
