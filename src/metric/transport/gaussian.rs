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
//! c: masses, or signed numbers (then M_q may vanish, and the node is silent). Instruction sets without fused
//! multiplication round differently in the last digits; the number of threads changes nothing.

use super::elementary::{LANES, Lanes, exp, fma, ln, max};
use super::lattice::Lattice;
use super::measure::Measure;
use super::value_axis;

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

/// The result of the first half, and the scratch memory of both.
#[derive(Default)]
pub(super) struct Spread {
    /// V, base nodes x entries of value nodes.
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

    /// The first half: `weights` c and `potential` g of the measure's nodes.
    pub fn spread(&self, weights: &[Lanes], potential: &[Lanes], spread: &mut Spread) {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") {
                // SAFETY: the function is safe but for its need of AVX-512, which the processor has.
                return unsafe { spread_avx512(self, weights, potential, spread) };
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                // SAFETY: as above, with AVX2 and FMA.
                return unsafe { spread_avx2(self, weights, potential, spread) };
            }
        }
        spread_at_nodes::<PLAIN>(self, weights, potential, spread);
    }

    /// The second half: from the value nodes of `source` to those of `target`.
    pub fn gather(&self, source: &Measure, spread: &Spread, target: &Measure, sink: Sink) {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") {
                // SAFETY: the function is safe but for its need of AVX-512, which the processor has.
                return unsafe { gather_avx512(self, source, spread, target, sink) };
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                // SAFETY: as above, with AVX2 and FMA.
                return unsafe { gather_avx2(self, source, spread, target, sink) };
            }
        }
        value_axis::gather::<PLAIN, 2>(self, source, spread, target, sink);
    }

    pub fn base_len(&self) -> usize {
        self.nodes.iter().product()
    }

    /// Multiplies `block` (base nodes) by the kernels of the three axes.
    #[inline(always)]
    fn smooth_base<const FUSED: bool>(&self, block: &mut Vec<Lanes>, scratch: &mut Vec<Lanes>) {
        let mut stride = block.len();
        for (&nodes, kernel) in self.nodes.iter().zip(&self.axes) {
            stride /= nodes;
            for (from, to) in block.chunks_exact(nodes * stride).zip(scratch.chunks_exact_mut(nodes * stride)) {
                for (row, to) in kernel.chunks_exact(nodes).zip(to.chunks_exact_mut(stride)) {
                    to.fill([0.0; LANES]);
                    for (&factor, from) in row.iter().zip(from.chunks_exact(stride)) {
                        for (from, to) in from.iter().zip(&mut *to) {
                            (0..LANES).for_each(|lane| to[lane] = fma::<FUSED>(factor, from[lane], to[lane]));
                        }
                    }
                }
            }
            std::mem::swap(block, scratch);
        }
    }
}

/// Multiplication and addition in one instruction, or not.
#[cfg(target_arch = "x86_64")]
const FUSED: bool = true;
const PLAIN: bool = cfg!(target_arch = "aarch64");

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,fma")]
fn spread_avx512(kernel: &Gaussian, weights: &[Lanes], potential: &[Lanes], spread: &mut Spread) {
    spread_at_nodes::<FUSED>(kernel, weights, potential, spread);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn spread_avx2(kernel: &Gaussian, weights: &[Lanes], potential: &[Lanes], spread: &mut Spread) {
    spread_at_nodes::<FUSED>(kernel, weights, potential, spread);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,fma")]
fn gather_avx512(kernel: &Gaussian, source: &Measure, spread: &Spread, target: &Measure, sink: Sink) {
    value_axis::gather::<FUSED, 8>(kernel, source, spread, target, sink);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn gather_avx2(kernel: &Gaussian, source: &Measure, spread: &Spread, target: &Measure, sink: Sink) {
    value_axis::gather::<FUSED, 4>(kernel, source, spread, target, sink);
}

#[inline(always)]
fn spread_at_nodes<const FUSED: bool>(kernel: &Gaussian, weights: &[Lanes], potential: &[Lanes], spread: &mut Spread) {
    let base = kernel.base_len();
    let entries = weights.len() / base;
    spread.values.resize(weights.len(), [0.0; LANES]);
    spread.level.resize(entries, [0.0; LANES]);
    let mut block = vec![[0.0; LANES]; base];
    let mut scratch = block.clone();
    let inverse = 1.0 / kernel.epsilon;
    for entry in 0..entries {
        let at = |p: usize| (&weights[p * entries + entry], &potential[p * entries + entry]);
        let mut top = [f64::MIN; LANES];
        for (weight, potential) in (0..base).map(at) {
            for lane in 0..LANES {
                top[lane] = max(if weight[lane] == 0.0 { f64::MIN } else { potential[lane] }, top[lane]);
            }
        }
        let mut total = [0.0; LANES];
        for (p, value) in block.iter_mut().enumerate() {
            let (weight, potential) = at(p);
            for lane in 0..LANES {
                // Positive only where the weight is 0.
                let exponent = (potential[lane] - top[lane]) * inverse;
                let exponent = if exponent < 0.0 { exponent } else { 0.0 };
                value[lane] = weight[lane] * exp::<FUSED>(exponent);
                total[lane] += value[lane].abs();
            }
        }
        kernel.smooth_base::<FUSED>(&mut block, &mut scratch);
        let mut share = [0.0; LANES];
        for lane in 0..LANES {
            let total = max(total[lane], f64::MIN_POSITIVE);
            share[lane] = 1.0 / total;
            spread.level[entry][lane] = fma::<FUSED>(top[lane], inverse, ln::<FUSED>(total));
        }
        for (p, value) in block.iter().enumerate() {
            let to = &mut spread.values[p * entries + entry];
            (0..LANES).for_each(|lane| to[lane] = value[lane] * share[lane]);
        }
    }
}
