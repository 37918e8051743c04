//! Sums over all pairs of clusters.
//!
//!   C_ij = |r_ij| or r_ij^2/2,   r_ij^2 = |X_i - Y_j|^2 + spread_i + spread_j
//!
//! and within a cluster of n cells, where one pair of cells in n is the same cell on both sides:
//!
//!   K_ii = (1/n) mean_k exp(-C(d_k)/epsilon) + (1 - 1/n) exp(-C_ii/epsilon),   r_ii^2 = d^2 + (spread_i + spread'_i) n/(n - 1)
//!
//! with d_k the differences of the values at the n cells and d that of their means. Nearly equal graphs differ by little else.
//! Clusters of single cells give the exact sums.

use super::super::GroundCost;
use super::super::elementary::{LANES, Lanes, exp, fma, max, min};
use super::measure::{Clusters, Side, lanes};
use multiversion::multiversion;
use multiversion::target::target_cfg_f;

/// The kernel of one epsilon.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kernel {
    pub cost: GroundCost,
    pub epsilon: f64,
}

impl GroundCost {
    /// The cost of a squared distance, and its slope; that of the distance is 0 at 0.
    #[inline(always)]
    pub(super) fn of_square(self, square: f64) -> (f64, f64) {
        match self {
            Self::SquaredDistance => (0.5 * square, 0.5),
            Self::Distance => {
                let distance = square.sqrt();
                (distance, if distance > 0.0 { 0.5 / distance } else { 0.0 })
            }
        }
    }
}

/// Which two graphs meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Meeting {
    /// a and b.
    Both,
    /// a and a.
    First,
    /// b and b.
    Second,
}

impl Meeting {
    /// Rows and columns of the matrix of their costs.
    pub fn sides(self, clusters: &Clusters) -> (&Side, &Side) {
        let Clusters { a, b, .. } = clusters;
        match self {
            Self::Both => (a, b),
            Self::First => (a, a),
            Self::Second => (b, b),
        }
    }
}

/// A cluster with itself.
#[derive(Debug, Clone, Copy)]
pub(super) struct Diagonal {
    /// ln mean_k exp(-C(d_k)/epsilon).
    pub same_cell: f64,
    /// C_ii and its derivative with respect to r_ii^2.
    pub others: (f64, f64),
    /// 1/n.
    pub share: f64,
}

impl Diagonal {
    /// Of cluster `i`.
    pub fn new(kernel: &Kernel, clusters: &Clusters, meeting: Meeting, i: usize) -> Self {
        let n = clusters.counts[i];
        let (rows, columns) = meeting.sides(clusters);
        let ((x, of_x), (y, of_y)) = (rows.point(i), columns.point(i));
        let square = (x[3] - y[3]).powi(2) + (of_x + of_y) * n / (n - 1.0).max(1.0);
        let same_cell = if meeting == Meeting::Both { kernel.mean_logarithm(clusters.differences_of(i)) } else { 0.0 };
        Self { same_cell, others: kernel.cost.of_square(square), share: 1.0 / n }
    }

    /// K_ii exp(level).
    fn value(&self, kernel: &Kernel, level: f64) -> f64 {
        let others = if self.share < 1.0 { (level - self.others.0 / kernel.epsilon).exp() } else { 0.0 };
        self.share * (level + self.same_cell).exp() + (1.0 - self.share) * others
    }
}

impl Kernel {
    /// ln mean exp(-C(d)/epsilon).
    fn mean_logarithm(&self, differences: &[f64]) -> f64 {
        let least = self.cost.of_square(least_magnitude(differences).powi(2)).0 / self.epsilon;
        let mut masses = [0.0; 32 * LANES];
        let mut sums = [0.0; LANES];
        for differences in differences.chunks(masses.len()) {
            let masses = &mut masses[..differences.len()];
            self.masses(least, differences, masses);
            for masses in masses.chunks(LANES) {
                sums.iter_mut().zip(masses).for_each(|(sum, mass)| *sum += mass);
            }
        }
        -least + (sums.iter().sum::<f64>() / differences.len() as f64).ln()
    }

    /// exp(level - C(d)/epsilon) of every difference, and nowhere less than exp(-700).
    pub fn masses(&self, level: f64, differences: &[f64], masses: &mut [f64]) {
        masses_of(self, level, differences, masses);
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn least_magnitude(numbers: &[f64]) -> f64 {
    let (entries, rest) = numbers.as_chunks::<LANES>();
    let mut least = [f64::INFINITY; LANES];
    for entry in entries {
        for lane in 0..LANES {
            least[lane] = min(entry[lane].abs(), least[lane]);
        }
    }
    rest.iter().map(|x| x.abs()).chain(least).fold(f64::INFINITY, min)
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn masses_of(kernel: &Kernel, level: f64, differences: &[f64], masses: &mut [f64]) {
    const FUSED: bool = target_cfg_f!(target_feature = "fma");
    let slope = -1.0 / kernel.epsilon;
    match kernel.cost {
        GroundCost::Distance => {
            for (mass, d) in masses.iter_mut().zip(differences) {
                *mass = exp::<FUSED>(fma::<FUSED>(slope, d.abs(), level));
            }
        }
        GroundCost::SquaredDistance => {
            for (mass, d) in masses.iter_mut().zip(differences) {
                *mass = exp::<FUSED>(fma::<FUSED>(slope, 0.5 * d * d, level));
            }
        }
    }
}

/// Potential/epsilon, as entries; minus infinity where they are only filled up.
pub(super) fn levels(potential: &[f64], epsilon: f64) -> Vec<Lanes> {
    lanes(potential.iter().map(|f| f / epsilon), f64::NEG_INFINITY)
}

/// S_i = sum_j w_j K_ij exp((f_i + g_j)/epsilon), over the rows, and sum_i w_i K_ij exp((f_i + g_j)/epsilon), over the columns.
pub(super) struct Sums {
    pub rows: Vec<f64>,
    pub columns: Vec<f64>,
    /// The largest exponent.
    pub largest: f64,
}

/// Beyond these exponents sums are out of range or lose digits.
const LARGEST_EXPONENT: f64 = 600.0;
/// e^-600.
const SMALLEST_SUM: f64 = 1e-260;

impl Sums {
    pub fn are_in_range(&self) -> bool {
        let found = self.rows.iter().chain(&self.columns);
        self.largest < LARGEST_EXPONENT && found.fold(f64::INFINITY, |least, &sum| least.min(sum)) > SMALLEST_SUM
    }
}

impl Kernel {
    /// The sums of the potentials f of the rows and g of the columns; of one graph with itself f is g, and only the rows are summed.
    pub fn sums(&self, clusters: &Clusters, meeting: Meeting, f: &[f64], g: &[f64]) -> Sums {
        let pairs = Pairs {
            kernel: *self,
            sides: meeting.sides(clusters),
            levels: [levels(f, self.epsilon), levels(g, self.epsilon)],
            weights: lanes(clusters.weights.iter().copied(), 0.0),
            once: meeting != Meeting::Both,
        };
        let mut sums = vec![0.0; clusters.len()];
        let mut of_columns = vec![[0.0; LANES]; pairs.weights.len()];
        let largest = pairwise(&pairs, &mut sums, &mut of_columns);
        let of_columns = of_columns.as_flattened_mut();
        for (i, sum) in sums.iter_mut().enumerate() {
            let diagonal = Diagonal::new(self, clusters, meeting, i);
            let own = clusters.weights[i] * diagonal.value(self, f[i] / self.epsilon + g[i] / self.epsilon);
            match meeting {
                Meeting::Both => {
                    *sum += own;
                    of_columns[i] += own;
                }
                _ => *sum += own + of_columns[i],
            }
        }
        let columns = if meeting == Meeting::Both { of_columns[..sums.len()].to_vec() } else { Vec::new() };
        Sums { rows: sums, columns, largest }
    }

    /// The softmin of g at every cluster of the rows, whatever the size of the exponents: half as fast as [`Kernel::sums`], which gives two
    /// softmins at once.
    pub fn softmin(&self, clusters: &Clusters, meeting: Meeting, transposed: bool, g: &[f64]) -> Vec<f64> {
        let (mut rows, mut columns) = meeting.sides(clusters);
        if transposed {
            (rows, columns) = (columns, rows);
        }
        let logarithms = g.iter().zip(&clusters.weights).map(|(g, w)| g / self.epsilon + w.ln());
        let sources = lanes(logarithms, f64::NEG_INFINITY);
        let one = |i: usize| {
            let own = Diagonal::new(self, clusters, meeting, i);
            let level = sources.as_flattened()[i];
            let mut own = [own.share.ln() + own.same_cell, (1.0 - own.share).ln() - own.others.0 / self.epsilon];
            own.iter_mut().for_each(|own| *own += level);
            let mut exponents: Vec<f64> = (0..sources.len())
                .flat_map(|at| self.costs(rows.point(i), columns, at).map(|cost| -cost / self.epsilon))
                .zip(sources.as_flattened())
                .map(|(exponent, level)| exponent + level)
                .collect();
            exponents[i] = f64::NEG_INFINITY;
            exponents.extend(own);
            let top = exponents.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let sum: f64 = exponents.iter().map(|exponent| (exponent - top).exp()).sum();
            -self.epsilon * (top + sum.ln())
        };
        (0..clusters.len()).map(one).collect()
    }

    /// C between a point with its spread and entry `at` of a side.
    fn costs(&self, (point, spread): ([f64; 4], f64), side: &Side, at: usize) -> Lanes {
        squares::<false>(point, spread, side, at).map(|square| self.cost.of_square(square).0)
    }
}

/// r^2 between a point with its spread and entry `at` of a side.
#[inline(always)]
pub(super) fn squares<const FUSED: bool>(point: [f64; 4], spread: f64, side: &Side, at: usize) -> Lanes {
    let mut squares = side.spread[at];
    for square in &mut squares {
        *square += spread;
    }
    for (axis, x) in point.into_iter().enumerate() {
        let other = &side.coordinates[axis][at];
        for lane in 0..LANES {
            let difference = x - other[lane];
            squares[lane] = fma::<FUSED>(difference, difference, squares[lane]);
        }
    }
    squares
}

/// All pairs of clusters but those with themselves.
struct Pairs<'a> {
    kernel: Kernel,
    /// Rows and columns.
    sides: (&'a Side, &'a Side),
    /// Of rows and of columns.
    levels: [Vec<Lanes>; 2],
    weights: Vec<Lanes>,
    /// Each pair once: rows and columns are one graph.
    once: bool,
}

/// Adds to the sums of rows and columns what the pairs give, and returns the largest exponent. Of pairs that are taken once, either sum
/// may get it.
#[multiversion(targets("x86_64+avx2+fma"))]
fn pairwise(pairs: &Pairs<'_>, of_rows: &mut [f64], of_columns: &mut [Lanes]) -> f64 {
    const FUSED: bool = target_cfg_f!(target_feature = "fma");
    match pairs.kernel.cost {
        GroundCost::Distance => pairwise_of::<FUSED, true>(pairs, of_rows, of_columns),
        GroundCost::SquaredDistance => pairwise_of::<FUSED, false>(pairs, of_rows, of_columns),
    }
}

#[inline(always)]
fn pairwise_of<const FUSED: bool, const ROOT: bool>(
    pairs: &Pairs<'_>,
    of_rows: &mut [f64],
    of_columns: &mut [Lanes],
) -> f64 {
    let Pairs { kernel, sides: (rows, columns), levels: [row_levels, column_levels], weights, once } = pairs;
    let slope = if ROOT { -1.0 / kernel.epsilon } else { -0.5 / kernel.epsilon };
    let mut largest = [f64::NEG_INFINITY; LANES];
    for (i, of_row) in of_rows.iter_mut().enumerate() {
        let (own, lane_of_own) = (i / LANES, i % LANES);
        let (point, spread) = rows.point(i);
        let level = row_levels[own][lane_of_own];
        let weight = weights[own][lane_of_own];
        let mut all = [0.0; LANES];
        for at in if *once { own } else { 0 }..weights.len() {
            let (squares, levels) = (squares::<FUSED>(point, spread, columns, at), &column_levels[at]);
            let mut exponents = [0.0; LANES];
            for lane in 0..LANES {
                let way = if ROOT { squares[lane].sqrt() } else { squares[lane] };
                exponents[lane] = fma::<FUSED>(slope, way, level + levels[lane]);
            }
            let mut weight = [weight; LANES];
            if at == own {
                // Each row of this entry finds the others of the entry, so that none is left for the columns.
                exponents[lane_of_own] = f64::NEG_INFINITY;
                weight = if *once { [0.0; LANES] } else { weight };
            }
            let (of_column, weights) = (&mut of_columns[at], &weights[at]);
            for (lane, exponent) in exponents.into_iter().enumerate() {
                largest[lane] = max(exponent, largest[lane]);
                let mass = exp::<FUSED>(exponent);
                all[lane] = fma::<FUSED>(weights[lane], mass, all[lane]);
                of_column[lane] = fma::<FUSED>(weight[lane], mass, of_column[lane]);
            }
        }
        *of_row += all.iter().sum::<f64>();
    }
    largest.into_iter().fold(f64::NEG_INFINITY, f64::max)
}
