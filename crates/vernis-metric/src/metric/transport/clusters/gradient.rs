//! The derivative of the divergence with respect to the candidate's values, by reverse differentiation of the annealed iterations.
//!
//! For f_i = -epsilon ln sum_j w_j K_ij exp(g_j/epsilon), pi_ij = w_j K_ij exp((f_i + g_j)/epsilon), and the derivative r_i of the divergence
//! with respect to f_i,
//!
//!   d/dg_j = -sum_i r_i pi_ij,   d/dy_j = sum_i r_i pi_ij dC_ij/dy_j
//!
//! with y_j anything that C depends on: the mean value of a cluster, or its spread. K_ii, and so C_ii, has two parts ([`super::kernel`]).
//! What it is the gradient of is said in [`super::super::divergence_and_gradient`]; the clusters are held.
//!
//! Where potentials go from level 1 to level 0 ([`super::levels`]), the way back leads over the update that gave their shape.
//!
//! Cost: about four divergences. Memory: the potentials before and after every update, clusters x 64 bytes an update.

use super::super::annealing::Annealing;
use super::super::elementary::{LANES, Lanes, exp, fma};
use super::super::{GroundCost, SinkhornParameters};
use super::kernel::{Diagonal, Kernel, Meeting, levels, squares};
use super::levels::{Level, Levels};
use super::measure::{Clusters, SPREAD, Side, lanes};
use super::{Graphs, Update, annealed, factors};
use crate::math::parallel;
use multiversion::multiversion;
use multiversion::target::target_cfg_f;

/// The divergence of two graphs in at most `count` clusters, and its derivative with respect to the values of b, 0 where no cell is valid.
pub(in crate::metric::transport) fn divergence_and_gradient(
    parameters: &SinkhornParameters,
    annealing: &Annealing,
    graphs: &Graphs<'_>,
    count: usize,
) -> (f64, Vec<f64>) {
    let levels = Levels::new(parameters, graphs, count);
    let mut found = (0.0, vec![0.0; graphs.b.len()]);
    for (finest, factor) in factors(&levels, graphs.cells()).into_iter().enumerate() {
        let (value, gradient) = of_levels(parameters, annealing, graphs, &levels.all()[finest..]);
        found.0 += factor * value;
        found.1.iter_mut().zip(gradient).for_each(|(all, own)| *all += factor * own);
    }
    found
}

/// Of the clusters of the finest of `levels`.
fn of_levels(
    parameters: &SinkhornParameters,
    annealing: &Annealing,
    graphs: &Graphs<'_>,
    levels: &[Level],
) -> (f64, Vec<f64>) {
    let mut updates = Vec::new();
    let potentials = annealed(parameters, annealing, levels, |update| updates.push(update.into_owned()));
    let mut reverse = Reverse::new(&levels[0].clusters);
    let mut gradient = vec![0.0; graphs.b.len()];
    for update in updates.iter().rev() {
        if update.refines {
            let (fine, coarse) = (&levels[0], &levels[1]);
            let of_potentials = reverse.refinement(update, fine, coarse);
            reverse.add_to_cells(graphs, &mut gradient);
            reverse = Reverse::on(&coarse.clusters, of_potentials);
        } else {
            reverse.step(update);
        }
    }
    reverse.add_to_cells(graphs, &mut gradient);
    (potentials.value(&levels[0].clusters), gradient)
}

/// Derivatives with respect to the potentials after an update, and those with respect to the clusters and cells of b so far.
struct Reverse<'a> {
    clusters: &'a Clusters,
    of_f_ba: Vec<f64>,
    of_g_ab: Vec<f64>,
    of_g_bb: Vec<f64>,
    of_values: Vec<f64>,
    of_spreads: Vec<f64>,
    /// By way of the differences within a cell, in the order of [`Clusters::differences`].
    of_differences: Vec<Vec<f64>>,
}

impl<'a> Reverse<'a> {
    /// After all updates.
    fn new(clusters: &'a Clusters) -> Self {
        let weights = || clusters.weights.clone();
        let minus = weights().iter().map(|w| -w).collect();
        Self::on(clusters, [weights(), weights(), minus])
    }

    /// With derivatives with respect to f_ba, g_ab and g_bb.
    fn on(clusters: &'a Clusters, [of_f_ba, of_g_ab, of_g_bb]: [Vec<f64>; 3]) -> Self {
        let zero = || vec![0.0; clusters.len()];
        Self {
            clusters,
            of_f_ba,
            of_g_ab,
            of_g_bb,
            of_values: zero(),
            of_spreads: zero(),
            of_differences: (0..clusters.len()).map(|i| vec![0.0; clusters.differences_of(i).len()]).collect(),
        }
    }

    /// Back over a refinement: the derivatives with respect to the potentials of the coarser level.
    fn refinement(&mut self, update: &Update<'_>, fine: &Level, coarse: &Level) -> [Vec<f64>; 3] {
        let mut of_coarse = self.of_potentials().map(|of| fine.sums(of, coarse));
        self.of_potentials().into_iter().for_each(|of| *of = fine.without_means_back(of, coarse));
        self.step(update);
        of_coarse.iter_mut().zip(self.of_potentials()).for_each(|(all, of)| add(all, &fine.sums(of, coarse)));
        of_coarse
    }

    fn of_potentials(&mut self) -> [&mut Vec<f64>; 3] {
        [&mut self.of_f_ba, &mut self.of_g_ab, &mut self.of_g_bb]
    }

    /// Back over an update.
    fn step(&mut self, Update { kernel, keep, before, after, .. }: &Update<'_>) {
        let keep = *keep;
        let share = 1.0 - keep;
        let softmin = |old: &[f64], new: &[f64]| -> Vec<f64> {
            old.iter().zip(new).map(|(old, new)| (new - keep * old) / share).collect()
        };
        let of_share = |of: &[f64]| -> Vec<f64> { of.iter().map(|of| share * of).collect() };
        let (r_ba, r_ab, r_bb) = (of_share(&self.of_f_ba), of_share(&self.of_g_ab), of_share(&self.of_g_bb));
        let f_ba = softmin(&before.f_ba, &after.f_ba);
        let g_ab = softmin(&before.g_ab, &after.g_ab);
        let g_bb = softmin(&before.g_bb, &after.g_bb);
        let potentials = |old, new, slope| Updated { old, new, slope };
        let pair = [potentials(&before.f_ba, &f_ba, &r_ba), potentials(&before.g_ab, &g_ab, &r_ab)];
        let own = || potentials(&before.g_bb, &g_bb, &r_bb);
        let (pair, own) = parallel::join(
            || Flows::new(kernel, self.clusters, Meeting::Both, &pair),
            || Flows::new(kernel, self.clusters, Meeting::Second, &[own(), own()]),
        );
        for flows in [&pair, &own] {
            add(&mut self.of_values, &flows.of_values);
            add(&mut self.of_spreads, &flows.of_spreads);
        }
        self.of_differences.iter_mut().zip(&pair.of_differences).for_each(|(all, of)| add(all, of));
        let through = |of: &mut [f64], through: &[f64]| {
            of.iter_mut().zip(through).for_each(|(of, through)| *of = keep * *of - through);
        };
        through(&mut self.of_f_ba, &pair.to_rows);
        through(&mut self.of_g_ab, &pair.to_columns);
        through(&mut self.of_g_bb, &own.to_columns);
    }

    /// Adds the derivatives with respect to the values of the grid's cells, by way of these clusters.
    fn add_to_cells(&self, graphs: &Graphs<'_>, gradient: &mut [f64]) {
        for i in 0..self.clusters.len() {
            let n = self.clusters.counts[i];
            let mean = self.clusters.b.point(i).0[3];
            for (&cell, of_difference) in self.clusters.cells_of(i).iter().zip(&self.of_differences[i]) {
                let cell = cell as usize;
                let of_spread = 2.0 * SPREAD[1] * (graphs.b[cell] - mean) * self.of_spreads[i];
                gradient[cell] += (self.of_values[i] + of_spread) / n + of_difference;
            }
        }
    }
}

fn add(to: &mut [f64], other: &[f64]) {
    to.iter_mut().zip(other).for_each(|(to, other)| *to += other);
}

/// A potential before an update, its softmin, and the derivative with respect to that.
struct Updated<'a> {
    old: &'a [f64],
    new: &'a [f64],
    slope: &'a [f64],
}

/// What flows back over one update of the potentials of the rows and of the columns of a meeting.
struct Flows {
    /// To the old potentials, with the opposite sign.
    to_rows: Vec<f64>,
    to_columns: Vec<f64>,
    /// To the values and spreads of the columns.
    of_values: Vec<f64>,
    of_spreads: Vec<f64>,
    /// To the differences between columns and rows, cell by cell; nothing within one graph.
    of_differences: Vec<Vec<f64>>,
}

impl Flows {
    fn new(kernel: &Kernel, clusters: &Clusters, meeting: Meeting, potentials: &[Updated<'_>; 2]) -> Self {
        let (rows, columns) = meeting.sides(clusters);
        let [of_rows, of_columns] = potentials;
        let entries = |values: &[f64]| lanes(values.iter().copied(), 0.0);
        let pass = Pass {
            old: [of_rows.old, of_columns.old].map(|f| levels(f, kernel.epsilon)),
            new: [of_rows.new, of_columns.new].map(|f| levels(f, kernel.epsilon)),
            slopes: [of_rows.slope, of_columns.slope].map(entries),
            weights: entries(&clusters.weights),
        };
        let mut to_rows = vec![0.0; clusters.len()];
        let mut found = [(); 3].map(|()| vec![[0.0; LANES]; pass.weights.len()]);
        let [to_columns, of_values, of_spreads] = &mut found;
        run(&pass, kernel, (rows, columns), &mut to_rows, (to_columns, of_values, of_spreads));
        let mut found = found.map(|found| found.into_flattened()[..clusters.len()].to_vec());
        let mut of_differences = Vec::new();
        for i in 0..clusters.len() {
            let own = Diagonal::new(kernel, clusters, meeting, i);
            let exponent_of = |f: &Updated<'_>, g: &Updated<'_>| (f.new[i] + g.old[i]) / kernel.epsilon;
            let w = clusters.weights[i];
            let own_levels = [exponent_of(of_rows, of_columns), exponent_of(of_columns, of_rows)];
            let slopes = [of_rows.slope[i], of_columns.slope[i]];
            let flow = |k: usize, exponent: f64| slopes[k] * w * (own_levels[k] + exponent).exp();
            let others = [0, 1].map(|k| match own.share < 1.0 {
                true => (1.0 - own.share) * flow(k, -own.others.0 / kernel.epsilon),
                false => 0.0,
            });
            let same = [0, 1].map(|k| own.share * flow(k, own.same_cell));
            let [to_columns, of_values, of_spreads] = &mut found;
            to_columns[i] += others[0] + same[0];
            to_rows[i] += others[1] + same[1];
            let n = clusters.counts[i];
            let of_square = (others[0] + others[1]) * own.others.1;
            of_values[i] += 2.0 * of_square * (columns.point(i).0[3] - rows.point(i).0[3]);
            of_spreads[i] += of_square * n / (n - 1.0).max(1.0);
            if meeting == Meeting::Both {
                // Both flows are multiples of one exponential.
                let level = own_levels[0].max(own_levels[1]);
                let flows: f64 = (0..2).map(|k| slopes[k] * w * (own_levels[k] - level).exp()).sum();
                let differences = clusters.differences_of(i);
                let mut of_cells = vec![0.0; differences.len()];
                kernel.masses(level, differences, &mut of_cells);
                for (of_cell, d) in of_cells.iter_mut().zip(differences) {
                    let (_, slope) = kernel.cost.of_square(d * d);
                    *of_cell *= own.share / n * flows * 2.0 * slope * d;
                }
                of_differences.push(of_cells);
            }
        }
        let [to_columns, of_values, of_spreads] = found;
        Self { to_rows, to_columns, of_values, of_spreads, of_differences }
    }
}

/// Of rows and of columns: potentials over epsilon before and after, and derivatives.
struct Pass {
    old: [Vec<Lanes>; 2],
    new: [Vec<Lanes>; 2],
    slopes: [Vec<Lanes>; 2],
    weights: Vec<Lanes>,
}

/// The sums over the rows: to the old potentials, to the values, to the spreads.
type OfColumns<'a> = (&'a mut [Lanes], &'a mut [Lanes], &'a mut [Lanes]);

/// Adds what all pairs but i = j give.
#[multiversion(targets("x86_64+avx2+fma"))]
fn run(pass: &Pass, kernel: &Kernel, sides: (&Side, &Side), to_rows: &mut [f64], of_columns: OfColumns<'_>) {
    const FUSED: bool = target_cfg_f!(target_feature = "fma");
    match kernel.cost {
        GroundCost::Distance => run_of::<FUSED, true>(pass, kernel, sides, to_rows, of_columns),
        GroundCost::SquaredDistance => run_of::<FUSED, false>(pass, kernel, sides, to_rows, of_columns),
    }
}

#[inline(always)]
fn run_of<const FUSED: bool, const ROOT: bool>(
    pass: &Pass,
    kernel: &Kernel,
    (rows, columns): (&Side, &Side),
    to_rows: &mut [f64],
    (to_columns, of_values, of_spreads): OfColumns<'_>,
) {
    let inverse = 1.0 / kernel.epsilon;
    let slope = if ROOT { -inverse } else { -0.5 * inverse };
    let [old_rows, old_columns] = &pass.old;
    let [new_rows, new_columns] = &pass.new;
    let [slope_rows, slope_columns] = &pass.slopes;
    for (i, to_row) in to_rows.iter_mut().enumerate() {
        let (own, lane_of_own) = (i / LANES, i % LANES);
        let of = |of: &[Lanes]| of[own][lane_of_own];
        let (old, new, r, weight) = (of(old_rows), of(new_rows), of(slope_rows), of(&pass.weights));
        let (point, spread) = rows.point(i);
        let mut all = [0.0; LANES];
        for at in 0..pass.weights.len() {
            let mut ways = squares::<FUSED>(point, spread, columns, at);
            let mut of_square = [0.5; LANES];
            let (mut forth, mut back) = ([0.0; LANES], [0.0; LANES]);
            for lane in 0..LANES {
                if ROOT {
                    ways[lane] = ways[lane].sqrt();
                    of_square[lane] = if ways[lane] > 0.0 { 0.5 / ways[lane] } else { 0.0 };
                }
                forth[lane] = fma::<FUSED>(slope, ways[lane], new + old_columns[at][lane]);
                back[lane] = fma::<FUSED>(slope, ways[lane], old + new_columns[at][lane]);
            }
            if at == own {
                forth[lane_of_own] = f64::NEG_INFINITY;
                back[lane_of_own] = f64::NEG_INFINITY;
            }
            let value = &columns.coordinates[3][at];
            for lane in 0..LANES {
                let forth = r * pass.weights[at][lane] * exp::<FUSED>(forth[lane]);
                let back = slope_columns[at][lane] * weight * exp::<FUSED>(back[lane]);
                let flow = (forth + back) * of_square[lane];
                all[lane] += back;
                to_columns[at][lane] += forth;
                of_spreads[at][lane] += flow;
                of_values[at][lane] = fma::<FUSED>(2.0 * flow, value[lane] - point[3], of_values[at][lane]);
            }
        }
        *to_row += all.iter().sum::<f64>();
    }
}
