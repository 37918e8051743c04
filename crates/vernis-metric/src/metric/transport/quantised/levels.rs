//! Coarser versions of a quantised graph, for the large epsilons of the annealing.
//!
//! A sum of Gaussians of width sqrt(epsilon) needs nodes at a fraction of that width and no more. Level 0 is the
//! [`Measure`] that the blur asks for; each further level has half the value nodes and about half the nodes along each base
//! axis, and serves epsilons four times as large. The annealing starts on the last level and ends on level 0: early updates
//! cost next to nothing, and of slow annealings only the last few take all nodes (`quantised.rs`).
//!
//! *Masses* go down a level as cells go to nodes (`measure.rs`): value node 2k goes to k, 2k + 1 half to k and half to
//! k + 1, which adds the variance (1/4) (2 h)^2, V_k += 1/16, V_{k+1} += 1/16, taken back by anti-diffusion; along the base, hat
//! functions.
//!
//! *Potentials* go up a level by interpolation, smooth as they are: along values, node 2k takes k and 2k + 1 takes
//! (-1, 9, 9, -1)/16 of k - 1 to k + 2, which are kept as nodes for that, massless or not; along a base axis, the polynomial
//! through the nearest four nodes, or as many as there are.
//!
//! Every chain of a comparison changes levels at the same epsilons, so that what this changes cancels.

use super::super::TransportError;
use super::super::elementary::{LANES, Lanes};
use super::field::Field;
use super::lattice::Lattice;
use super::matrix::{Matrix, multiply};
use super::measure::Measure;
use super::splat::Splat;

/// A level of at most so many value nodes has no coarser one.
const FEWEST_VALUES: usize = 2 * LANES;
/// Base axes keep so many nodes, where they have as many: potentials bend.
const FEWEST_BASE_NODES: usize = 3;
/// More levels than any range of values within the limits needs.
const MOST_LEVELS: usize = 50;

/// A measure and its coarser versions.
#[derive(Debug, Clone)]
pub(in crate::metric::transport) struct Levels {
    /// From fine to coarse.
    measures: Vec<Measure>,
    /// From each to the next.
    ways: Vec<Way>,
}

/// Between a level and the next coarser one.
#[derive(Debug, Clone)]
struct Way {
    /// For every fine value node the coarse one at or below it, and whether it lies half-way to the next.
    below: Vec<(usize, bool)>,
    /// The share of every fine base node's mass that every coarse one gets, an axis each: coarse x fine.
    hats: [Matrix; 3],
    /// Fine base nodes' potentials from coarse ones', an axis each: fine x coarse.
    polynomials: [Matrix; 3],
}

impl Levels {
    /// All levels of the measure of the valid cells (all where `valid` is `None`); there must be one, and valid values must be finite.
    pub fn new(lattice: Lattice, cells: &[f64], valid: Option<&[bool]>) -> Result<Self, TransportError> {
        let mut fine = Measure::new(lattice, cells, valid)?;
        let mut levels = Self { measures: Vec::new(), ways: Vec::new() };
        while fine.values.len() * LANES > FEWEST_VALUES && levels.measures.len() + 1 < MOST_LEVELS {
            let (way, coarse) = Way::down(&fine);
            levels.measures.push(fine);
            levels.ways.push(way);
            fine = coarse;
        }
        levels.measures.push(fine);
        Ok(levels)
    }

    /// Number of levels, at least 1.
    pub fn len(&self) -> usize {
        self.measures.len()
    }

    /// 0 is the finest.
    pub(super) fn level(&self, level: usize) -> &Measure {
        &self.measures[level]
    }

    pub(super) fn finest(&self) -> &Measure {
        self.level(0)
    }

    /// A potential of level `from` on the finer level `to`.
    pub fn refine(&self, mut potential: Field, from: usize, to: usize) -> Field {
        for level in (to..from).rev() {
            potential = self.ways[level].refine(&potential);
        }
        potential
    }

    /// The derivative with respect to a potential of the coarser level `to`, from that with respect to what
    /// [`Levels::refine`] made of it for level `from`.
    pub fn refine_back(&self, mut of_potential: Field, from: usize, to: usize) -> Field {
        for level in from..to {
            of_potential = self.ways[level].refine_back(&of_potential, self.level(level + 1).values.len());
        }
        of_potential
    }

    /// The derivative with respect to the masses of level 0, from those with respect to the masses of every level.
    pub fn coarsen_back(&self, mut of_masses: Vec<Field>) -> Field {
        for level in (1..of_masses.len()).rev() {
            let of_coarse = std::mem::take(&mut of_masses[level]);
            self.ways[level - 1].coarsen_back(self.level(level), &of_coarse, &mut of_masses[level - 1]);
        }
        of_masses.swap_remove(0)
    }
}

impl Way {
    /// The way down from `fine`, and where it leads.
    fn down(fine: &Measure) -> (Self, Measure) {
        let (lattice, hats) = fine.lattice.coarser(FEWEST_BASE_NODES);
        let fine_nodes = fine.values.as_flattened();
        let mut nodes: Vec<f64> = Vec::with_capacity(fine_nodes.len());
        for half in fine_nodes.iter().map(|node| 0.5 * node) {
            let below = half.floor();
            nodes.extend(if half == below { 0..1 } else { -1..3 }.map(|step: i32| below + f64::from(step)));
        }
        let values = Measure::axis(nodes);
        let place = |node: &f64| {
            let below = (0.5 * node).floor();
            (values.as_flattened().partition_point(|&value| value < below), 0.5 * node != below)
        };
        let below = fine_nodes.iter().map(place).collect();
        let polynomials = [0, 1, 2].map(|axis| Matrix::polynomials(fine.lattice.nodes[axis], lattice.nodes[axis]));
        let way = Self { below, hats, polynomials };
        let splat = way.coarsen(fine, values.len());
        (way, Measure::sharpened(lattice, values, splat))
    }

    /// The masses and excesses of the coarse nodes, `entries` of them, before anti-diffusion.
    fn coarsen(&self, fine: &Measure, entries: usize) -> Splat {
        let columns = entries * LANES;
        let rows = fine.lattice.base_len();
        let (mut mass, mut excess) = (vec![0.0; rows * columns], vec![0.0; rows * columns]);
        let fine = fine.rows();
        let fine_rows = fine.as_flattened().chunks_exact(self.below.len());
        for (from, (mass, excess)) in
            fine_rows.zip(mass.chunks_exact_mut(columns).zip(excess.chunks_exact_mut(columns)))
        {
            for (&from, &(below, half_way)) in from.iter().zip(&self.below) {
                if half_way {
                    mass[below] += 0.5 * from;
                    mass[below + 1] += 0.5 * from;
                    excess[below] += HALF_WAY_EXCESS * from;
                    excess[below + 1] += HALF_WAY_EXCESS * from;
                } else {
                    mass[below] += from;
                }
            }
        }
        let coarse = |array| multiply(self.hats.each_ref(), array, columns);
        Splat { mass: coarse(mass), excess: coarse(excess) }
    }

    /// Adds the derivative by way of the coarse masses to that with respect to the fine ones.
    fn coarsen_back(&self, coarse: &Measure, of_coarse: &[Lanes], of_fine: &mut Field) {
        let columns = coarse.values.len() * LANES;
        let (of_linear, of_excess) = coarse.sharpen_back(of_coarse);
        let hats = self.hats.each_ref().map(Matrix::transposed);
        let [of_linear, of_excess] = [of_linear, of_excess].map(|array| multiply(hats.each_ref(), array, columns));
        let (of_linear, of_excess) = (of_linear.as_flattened(), of_excess.as_flattened());
        let base = of_fine.len() * LANES / self.below.len();
        let rows = of_linear.chunks_exact(columns).zip(of_excess.chunks_exact(columns));
        for (row, (linear, excess)) in rows.enumerate() {
            for (node, &(below, half_way)) in self.below.iter().enumerate() {
                of_fine[node / LANES * base + row][node % LANES] += if half_way {
                    0.5 * (linear[below] + linear[below + 1]) + HALF_WAY_EXCESS * (excess[below] + excess[below + 1])
                } else {
                    linear[below]
                };
            }
        }
    }

    /// A potential of the coarse nodes at the fine ones.
    fn refine(&self, potential: &[Lanes]) -> Field {
        let base: usize = self.polynomials.iter().map(|matrix| matrix.columns).product();
        let mut fine = Vec::new();
        for nodes in self.below.as_chunks::<LANES>().0 {
            let mut along_values = Vec::with_capacity(base * LANES);
            for row in 0..base {
                let at = |node: usize| potential[node / LANES * base + row][node % LANES];
                along_values.extend(nodes.iter().map(|&(below, half_way)| {
                    if half_way {
                        CUBIC * (at(below) + at(below + 1)) - (CUBIC - 0.5) * (at(below - 1) + at(below + 2))
                    } else {
                        at(below)
                    }
                }));
            }
            fine.extend(multiply(self.polynomials.each_ref(), along_values, LANES));
        }
        fine
    }

    /// The transpose of [`Way::refine`], to so many `entries`.
    fn refine_back(&self, of_potential: &[Lanes], entries: usize) -> Field {
        let polynomials = self.polynomials.each_ref().map(Matrix::transposed);
        let base: usize = polynomials.iter().map(|matrix| matrix.rows).product();
        let mut of_coarse = vec![[0.0; LANES]; base * entries];
        let of_entries = of_potential.chunks_exact(of_potential.len() * LANES / self.below.len());
        for (nodes, of_entry) in self.below.as_chunks::<LANES>().0.iter().zip(of_entries) {
            let of_entry = multiply(polynomials.each_ref(), of_entry.as_flattened().to_vec(), LANES);
            for (row, of_row) in of_entry.iter().enumerate() {
                let mut add = |node: usize, x: f64| of_coarse[node / LANES * base + row][node % LANES] += x;
                for (&of_fine, &(below, half_way)) in of_row.iter().zip(nodes) {
                    if half_way {
                        add(below, CUBIC * of_fine);
                        add(below + 1, CUBIC * of_fine);
                        add(below - 1, (0.5 - CUBIC) * of_fine);
                        add(below + 2, (0.5 - CUBIC) * of_fine);
                    } else {
                        add(below, of_fine);
                    }
                }
            }
        }
        of_coarse
    }
}

/// t (1 - t) (2 - t)/6 half-way between two nodes.
const HALF_WAY_EXCESS: f64 = 1.0 / 16.0;
/// The inner weights of cubic interpolation half-way; those of the outer two are 1/2 less.
const CUBIC: f64 = 9.0 / 16.0;
