//! Sums of Gaussians between two measures on product grids, in the log domain: the inner loop of everything here.
//!
//!   S(y) = sum_x c(x) exp((g(x) - |x - y|^2/2)/epsilon),   x = (base node p, value node q)
//!
//! The Gaussian factorises. First, at every value node q ([`Gaussian::spread`]),
//!
//!   G_q = max_p g(p, q),   V(p, q) = c(p, q) exp((g(p, q) - G_q)/epsilon),   V <- (K_1 x K_2 x K_3) V,
//!   M_q = sum_p |V(p, q)|,  V <- V/M_q,  G_q <- G_q + epsilon ln M_q;
//!
//! then along the value axis ([`Gaussian::gather`], in [`super::value_axis`]).
//!
//! Only nodes with c(p, q) != 0 take part in the first maximum, the exponentials and the first of the three products.
//!
//! c: masses, or signed numbers (then M_q may vanish, and the node is silent). Instruction sets without fused
//! multiplication round differently in the last digits; the number of threads changes nothing.

use super::super::elementary::{LANES, Lanes, exp, fma, ln, max};
use super::lattice::Lattice;
use super::measure::{Measure, Support};
use super::value_axis;
use multiversion::multiversion;
use multiversion::target::{match_target, target_cfg_f};

/// Terms smaller than exp(-34), times the largest base factor, are left out.
const NEGLIGIBLE: f64 = 34.0;

/// The Gaussian kernel of one epsilon on one lattice.
pub(super) struct Gaussian {
    pub epsilon: f64,
    /// (w_q - w_r)^2/(2 epsilon) for neighbouring value nodes.
    pub neighbour_cost: f64,
    /// Exponents further below the largest are left out.
    pub cut: f64,
    nodes: [usize; 3],
    /// exp(-distance^2/(2 epsilon)) between the nodes of each base axis, nodes x nodes.
    axes: [Vec<f64>; 3],
}

/// What becomes of a sum S(y) = e^F S'.
pub(super) enum Sink<'a> {
    /// f <- keep f - (1 - keep) epsilon ln S.
    Potential { potential: &'a mut [Lanes], keep: f64 },
    /// s <- S exp(g(y)/epsilon), for the potential g.
    Sum { sum: &'a mut [Lanes], potential: &'a [Lanes] },
}

/// The nodes of the target that a sum is wanted at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Nodes {
    All,
    /// Those with mass, and those beside them in an entry.
    Support,
}

/// The result of the first half, and the scratch memory of both.
#[derive(Default)]
pub(super) struct Spread {
    /// V, entries of value nodes x base nodes.
    pub values: Vec<Lanes>,
    /// G/epsilon.
    pub level: Vec<Lanes>,
}

impl Gaussian {
    pub fn new(lattice: &Lattice, alpha: f64, epsilon: f64) -> Self {
        let spacings = [0, 1, 2].map(|axis| lattice.base_spacing(axis, alpha));
        let factor = |axis: usize| {
            let nodes = lattice.nodes[axis];
            let distance = |k: usize| spacings[axis] * (k / nodes).abs_diff(k % nodes) as f64;
            // Both sides' hat functions widen the kernel. Taking back what one of them adds makes the error of the base
            // smallest: it falls from 10 to 4 thousandths on 6 x 6 x 24 cells.
            let widened = lattice.base_excess[axis] * spacings[axis].powi(2);
            let variance = (epsilon - widened).max(0.5 * epsilon);
            (0..nodes * nodes).map(|k| (-0.5 * distance(k).powi(2) / variance).exp()).collect()
        };
        let largest: f64 = (0..3).map(|axis| 0.5 * (spacings[axis] * (lattice.nodes[axis] - 1) as f64).powi(2)).sum();
        Self {
            epsilon,
            neighbour_cost: 0.5 * lattice.spacing * lattice.spacing / epsilon,
            cut: NEGLIGIBLE + largest / epsilon,
            nodes: lattice.nodes,
            axes: [factor(0), factor(1), factor(2)],
        }
    }

    /// The first half: `weights` c, which are 0 outside `support`, and `potential` g.
    pub fn spread(&self, weights: &[Lanes], support: &Support, potential: &[Lanes], spread: &mut Spread) {
        spread_up_to_avx512(self, weights, support, potential, spread);
    }

    /// The second half: from the value nodes of `source` to `nodes` of `target`.
    pub fn gather(&self, source: &Measure, spread: &Spread, target: &Measure, nodes: Nodes, sink: Sink) {
        gather_up_to_avx512(self, source, spread, target, nodes, sink);
    }

    pub fn base_len(&self) -> usize {
        self.nodes.iter().product()
    }

    /// Multiplies by the kernel of the middle base axis.
    #[inline(always)]
    fn smooth_middle<const FUSED: bool>(&self, from: &[Lanes], to: &mut [Lanes]) {
        let [_, nodes, stride] = self.nodes;
        for (from, to) in from.chunks_exact(nodes * stride).zip(to.chunks_exact_mut(nodes * stride)) {
            for column in 0..stride {
                let line = from[column..].iter().step_by(stride);
                products::<FUSED>(&self.axes[1], line, |node, sum| to[node * stride + column] = sum);
            }
        }
    }

    /// Multiplies by the kernel of the last base axis, and by `factor`.
    #[inline(always)]
    fn smooth_last<const FUSED: bool>(&self, from: &[Lanes], factor: &Lanes, to: &mut [Lanes]) {
        let nodes = self.nodes[2];
        for (from, to) in from.chunks_exact(nodes).zip(to.chunks_exact_mut(nodes)) {
            products::<FUSED>(&self.axes[2], from.iter(), |node, sum| {
                (0..LANES).for_each(|lane| to[node][lane] = sum[lane] * factor[lane]);
            });
        }
    }
}

/// The products of the rows of a square matrix with `line`, each handed to `take` with its row.
#[inline(always)]
fn products<'a, const FUSED: bool>(
    matrix: &[f64],
    line: impl ExactSizeIterator<Item = &'a Lanes> + Clone,
    mut take: impl FnMut(usize, Lanes),
) {
    /// Rows whose sums stay in registers.
    const ROWS: usize = 4;
    let mut first = 0;
    for rows in matrix.chunks(ROWS * line.len()) {
        match rows.len() / line.len() {
            ROWS => products_of::<FUSED, ROWS>(rows, line.clone(), first, &mut take),
            3 => products_of::<FUSED, 3>(rows, line.clone(), first, &mut take),
            2 => products_of::<FUSED, 2>(rows, line.clone(), first, &mut take),
            _ => products_of::<FUSED, 1>(rows, line.clone(), first, &mut take),
        }
        first += ROWS;
    }
}

/// The products of `ROWS` rows.
#[inline(always)]
fn products_of<'a, const FUSED: bool, const ROWS: usize>(
    rows: &[f64],
    line: impl ExactSizeIterator<Item = &'a Lanes>,
    first: usize,
    take: &mut impl FnMut(usize, Lanes),
) {
    let mut sums = [[0.0; LANES]; ROWS];
    let columns = line.len();
    for (column, value) in line.enumerate() {
        for (row, sum) in sums.iter_mut().enumerate() {
            let factor = rows[row * columns + column];
            for lane in 0..LANES {
                sum[lane] = fma::<FUSED>(factor, value[lane], sum[lane]);
            }
        }
    }
    for (row, sum) in sums.into_iter().enumerate() {
        take(first + row, sum);
    }
}

// One function an instruction set, each falling back on the next, so that tests reach every one of them. `multiversion`
// takes AVX-512 only together with what came with Ice Lake; processors with less of it use AVX2.

#[multiversion(targets("x86_64+avx512f+avx512dq+fma"))]
fn spread_up_to_avx512(
    kernel: &Gaussian,
    weights: &[Lanes],
    support: &Support,
    potential: &[Lanes],
    spread: &mut Spread,
) {
    match_target! {
        "x86_64+avx512f+avx512dq+fma" => spread_at_nodes::<true>(kernel, weights, support, potential, spread),
        _ => { spread_up_to_avx2(kernel, weights, support, potential, spread) },
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn spread_up_to_avx2(
    kernel: &Gaussian,
    weights: &[Lanes],
    support: &Support,
    potential: &[Lanes],
    spread: &mut Spread,
) {
    const FUSED: bool = target_cfg_f!(any(target_feature = "fma", target_arch = "aarch64"));
    spread_at_nodes::<FUSED>(kernel, weights, support, potential, spread);
}

#[multiversion(targets("x86_64+avx512f+avx512dq+fma"))]
fn gather_up_to_avx512(
    kernel: &Gaussian,
    source: &Measure,
    spread: &Spread,
    target: &Measure,
    nodes: Nodes,
    sink: Sink,
) {
    match_target! {
        "x86_64+avx512f+avx512dq+fma" => value_axis::gather::<true, 8>(kernel, source, spread, target, nodes, sink),
        _ => { gather_up_to_avx2(kernel, source, spread, target, nodes, sink) },
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn gather_up_to_avx2(kernel: &Gaussian, source: &Measure, spread: &Spread, target: &Measure, nodes: Nodes, sink: Sink) {
    const FUSED: bool = target_cfg_f!(any(target_feature = "fma", target_arch = "aarch64"));
    match_target! {
        "x86_64+avx2+fma" => value_axis::gather::<FUSED, 4>(kernel, source, spread, target, nodes, sink),
        _ => { value_axis::gather::<FUSED, 2>(kernel, source, spread, target, nodes, sink) },
    }
}

#[inline(always)]
fn spread_at_nodes<const FUSED: bool>(
    kernel: &Gaussian,
    weights: &[Lanes],
    support: &Support,
    potential: &[Lanes],
    spread: &mut Spread,
) {
    let base = kernel.base_len();
    let entries = weights.len() / base;
    let plane = base / kernel.nodes[0];
    spread.values.resize(weights.len(), [0.0; LANES]);
    spread.level.resize(entries, [0.0; LANES]);
    let mut block = vec![[0.0; LANES]; base];
    let mut scratch = block.clone();
    let inverse = 1.0 / kernel.epsilon;
    let of_entries = weights.chunks_exact(base).zip(potential.chunks_exact(base));
    for (entry, (values, (weights, potential))) in spread.values.chunks_exact_mut(base).zip(of_entries).enumerate() {
        let nodes = support.at(entry).iter().map(|&p| p as usize);
        let at = |p: usize| (&weights[p], &potential[p]);
        let mut top = [f64::MIN; LANES];
        for (&weight, &potential) in nodes.clone().map(at) {
            for lane in 0..LANES {
                top[lane] = max(if weight[lane] == 0.0 { f64::MIN } else { potential[lane] }, top[lane]);
            }
        }
        let mut total = [0.0; LANES];
        block.fill([0.0; LANES]);
        for p in nodes {
            let (&weight, &potential) = at(p);
            let mut value = [0.0; LANES];
            for lane in 0..LANES {
                // Positive only where the weight is 0.
                let exponent = (potential[lane] - top[lane]) * inverse;
                let exponent = if exponent < 0.0 { exponent } else { 0.0 };
                value[lane] = weight[lane] * exp::<FUSED>(exponent);
                total[lane] += value[lane].abs();
            }
            // The first axis; its kernel is symmetric.
            let (node, rest) = (p / plane, p % plane);
            let row = &kernel.axes[0][node * kernel.nodes[0]..][..kernel.nodes[0]];
            for (&factor, to) in row.iter().zip(block[rest..].iter_mut().step_by(plane)) {
                for lane in 0..LANES {
                    to[lane] = fma::<FUSED>(factor, value[lane], to[lane]);
                }
            }
        }
        kernel.smooth_middle::<FUSED>(&block, &mut scratch);
        let mut share = [0.0; LANES];
        for lane in 0..LANES {
            let total = max(total[lane], f64::MIN_POSITIVE);
            share[lane] = 1.0 / total;
            spread.level[entry][lane] = fma::<FUSED>(top[lane], inverse, ln::<FUSED>(total));
        }
        kernel.smooth_last::<FUSED>(&scratch, &share, values);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::graph::GraphGrid;
    use crate::metric::transport::elementary::is_fused;

    /// Both halves, compiled for one instruction set or dispatched.
    type Halves = (
        fn(&Gaussian, &[Lanes], &Support, &[Lanes], &mut Spread),
        fn(&Gaussian, &Measure, &Spread, &Measure, Nodes, Sink),
    );
    const DISPATCHED: [Halves; 2] =
        [(spread_up_to_avx512, gather_up_to_avx512), (spread_up_to_avx2, gather_up_to_avx2)];
    const FUSED: Halves = (spread_at_nodes::<true>, value_axis::gather::<true, 2>);
    const SEPARATE: Halves = (spread_at_nodes::<false>, value_axis::gather::<false, 2>);

    fn measure(shift: f64) -> Measure {
        let grid = GraphGrid::new(9, 9, 36).unwrap();
        let cells: Vec<f64> = (0..grid.len()).map(|k| k as f64 * 1e-3 + shift * (k as f64 * 0.37).sin()).collect();
        Measure::new(Lattice::new(grid, [4; 3], 0.05 / 8.0), &cells, None).unwrap()
    }

    fn waves(measure: &Measure) -> Vec<Lanes> {
        let wave = |k: usize, lane: usize| 0.01 * ((LANES * k + lane) as f64 * 0.7).sin();
        (0..measure.mass.len()).map(|k| std::array::from_fn(|lane| wave(k, lane))).collect()
    }

    /// V, G/epsilon, the potential after an update, and the sums.
    fn results((spread_of, gather): Halves, epsilon: f64) -> [Vec<Lanes>; 4] {
        let (source, target) = (measure(0.1), measure(0.2));
        let kernel = Gaussian::new(&source.lattice, 0.1, epsilon);
        let mut spread = Spread::default();
        spread_of(&kernel, &source.mass, &source.support, &waves(&source), &mut spread);
        let mut updated = waves(&target);
        let sink = Sink::Potential { potential: &mut updated, keep: 0.5 };
        gather(&kernel, &source, &spread, &target, Nodes::All, sink);
        let mut sum = waves(&target);
        gather(&kernel, &source, &spread, &target, Nodes::Support, Sink::Sum { sum: &mut sum, potential: &updated });
        [spread.values, spread.level, updated, sum]
    }

    /// Nor does the number of rows that stay in registers change a bit. Fused multiplication rounds once where two
    /// instructions round twice: a few 1e-16 of levels up to some hundreds.
    #[test]
    fn every_instruction_set_gives_the_bits_of_its_multiplication() {
        let bits = |results: &[Vec<Lanes>; 4]| -> Vec<u64> {
            results.iter().flat_map(|numbers| numbers.as_flattened()).map(|x| x.to_bits()).collect()
        };
        for epsilon in [1.0, 0.04, 0.0025] {
            let (fused, separate) = (results(FUSED, epsilon), results(SEPARATE, epsilon));
            let expected = bits(if is_fused() || cfg!(target_arch = "aarch64") { &fused } else { &separate });
            for halves in DISPATCHED {
                assert!(bits(&results(halves, epsilon)) == expected, "epsilon {epsilon}");
            }
            assert_ne!(bits(&fused), bits(&separate), "the bits do not tell one multiplication from the other");
            for (fused, separate) in fused.iter().zip(&separate) {
                for (a, b) in fused.as_flattened().iter().zip(separate.as_flattened()) {
                    // Levels of value nodes without mass are -infinity.
                    assert!(a == b || (a - b).abs() <= 1e-12 * b.abs().max(1.0), "epsilon {epsilon}: {a:e} {b:e}");
                }
            }
        }
    }
}
