//! Sums of Gaussians between two measures on product grids, in the log domain: the inner loop of everything here.
//!
//!   S(y) = sum_x c(x) exp((g(x) - |x - y|^2/2)/epsilon),   x = (base node p, value node q)
//!
//! The Gaussian factorises. First, at every value node q ([`Gaussian::spread`]),
//!
//!   G_q = max_p g(p, q),   V(p, q) = c(p, q) exp((g(p, q) - G_q)/epsilon),   V <- (K_1 x K_2 x K_3) V,
//!   M_q = sum_p |V(p, q)|,  V <- V/M_q,  G_q <- G_q + epsilon ln M_q;
//!
//! then along the value axis ([`Gaussian::gather`]), for every value node r of the target,
//!
//!   F_r = max_q (G_q - (w_q - w_r)^2/2)/epsilon,   S(p, r) = e^(F_r) sum_q exp((G_q - (w_q - w_r)^2/2)/epsilon - F_r) V(p, q),
//!
//! a banded matrix product: blocks of value nodes all of whose exponents lie more than 34 + (largest base cost)/epsilon
//! below F_r, less than 2e-15 of the sum, are left out. S > 0 wherever c is a measure, for the exponent of the largest
//! term is 0 and base costs are limited (`Method::LARGEST_ALPHA_PER_BLUR`).
//!
//! c: masses, or signed numbers (then M_q may vanish, and the node is silent). Cost, for P base nodes and Q, R value
//! nodes: Q R (1 exponential + P multiplications), less what the band leaves out. Instruction sets without fused
//! multiplication round differently in the last digits; the number of threads changes nothing.

use super::elementary::{LANES, Lanes, exp, fma, ln, max};
use super::measure::{Lattice, Measure};

/// Terms smaller than exp(-34), times the largest base factor, are left out.
const NEGLIGIBLE: f64 = 34.0;

/// The Gaussian kernel of one epsilon on one lattice.
pub(super) struct Gaussian {
    epsilon: f64,
    /// (w_q - w_r)^2/(2 epsilon) for neighbouring value nodes.
    neighbour_cost: f64,
    /// Exponents further below the largest are left out.
    cut: f64,
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
    values: Vec<Lanes>,
    /// G/epsilon.
    level: Vec<Lanes>,
}

impl Gaussian {
    pub fn new(lattice: &Lattice, alpha: f64, epsilon: f64) -> Self {
        let spacings = [0, 1, 2].map(|axis| lattice.base_spacing(axis, alpha));
        let factor = |axis: usize| {
            let nodes = lattice.nodes[axis];
            let distance = |k: usize| spacings[axis] * (k / nodes).abs_diff(k % nodes) as f64;
            (0..nodes * nodes).map(|k| (-0.5 * distance(k).powi(2) / epsilon).exp()).collect()
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
        gather_at_nodes::<PLAIN, 2>(self, source, spread, target, sink);
    }

    fn base_len(&self) -> usize {
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
    gather_at_nodes::<FUSED, 8>(kernel, source, spread, target, sink);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn gather_avx2(kernel: &Gaussian, source: &Measure, spread: &Spread, target: &Measure, sink: Sink) {
    gather_at_nodes::<FUSED, 4>(kernel, source, spread, target, sink);
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
            spread.values[p * entries + entry] = std::array::from_fn(|lane| value[lane] * share[lane]);
        }
    }
}

/// One tile of target value nodes: what it needs of the sources.
#[derive(Default)]
struct Band {
    /// The largest exponents of every entry of sources.
    largest: Vec<Lanes>,
    /// Entries that take part.
    entries: Vec<usize>,
    /// exp(exponent - F) of every source node of these.
    factors: Vec<Lanes>,
}

impl Band {
    /// Finds the band of the target nodes at the multiples `r` of h, and returns F.
    #[inline(always)]
    fn find<const FUSED: bool>(&mut self, kernel: &Gaussian, source: &Measure, level: &[Lanes], r: &Lanes) -> Lanes {
        let exponent = |q: f64, level: f64, lane: usize| {
            let distance = q - r[lane];
            fma::<FUSED>(-kernel.neighbour_cost * distance, distance, level)
        };
        let mut top = [f64::NEG_INFINITY; LANES];
        self.largest.clear();
        for (q, level) in source.values.iter().zip(level) {
            let mut largest = [f64::NEG_INFINITY; LANES];
            for (&q, &level) in q.iter().zip(level) {
                (0..LANES).for_each(|lane| largest[lane] = max(exponent(q, level, lane), largest[lane]));
            }
            (0..LANES).for_each(|lane| top[lane] = max(top[lane], largest[lane]));
            self.largest.push(largest);
        }
        self.entries.clear();
        self.factors.clear();
        for (entry, largest) in self.largest.iter().enumerate() {
            if (0..LANES).any(|lane| largest[lane] >= top[lane] - kernel.cut) {
                self.entries.push(entry);
                for (&q, &level) in source.values[entry].iter().zip(&level[entry]) {
                    let factor = |lane| exp::<FUSED>(exponent(q, level, lane) - top[lane]);
                    self.factors.push(std::array::from_fn(factor));
                }
            }
        }
        top
    }

    /// Sums of `ROWS` base nodes, of whose rows of V `rows` is the first.
    #[inline(always)]
    fn sums<const FUSED: bool, const ROWS: usize>(&self, rows: &[Lanes], entries: usize) -> [Lanes; ROWS] {
        let rows: [&[Lanes]; ROWS] = std::array::from_fn(|row| &rows[row * entries..][..entries]);
        let mut sums = [[0.0; LANES]; ROWS];
        for (&entry, factors) in self.entries.iter().zip(self.factors.chunks_exact(LANES)) {
            let values: [&Lanes; ROWS] = std::array::from_fn(|row| &rows[row][entry]);
            for (node, factor) in factors.iter().enumerate() {
                for (sum, value) in sums.iter_mut().zip(values) {
                    (0..LANES).for_each(|lane| sum[lane] = fma::<FUSED>(value[node], factor[lane], sum[lane]));
                }
            }
        }
        sums
    }
}

/// `ROWS`: base nodes whose sums are kept in registers at a time.
#[inline(always)]
fn gather_at_nodes<const FUSED: bool, const ROWS: usize>(
    kernel: &Gaussian,
    source: &Measure,
    spread: &Spread,
    target: &Measure,
    mut sink: Sink,
) {
    let (base, from, to) = (kernel.base_len(), source.values.len(), target.values.len());
    let mut band = Band::default();
    for (tile, r) in target.values.iter().enumerate() {
        let top = band.find::<FUSED>(kernel, source, &spread.level, r);
        let whole = base - base % ROWS;
        for p in (0..whole).step_by(ROWS) {
            let sums = band.sums::<FUSED, ROWS>(&spread.values[p * from..], from);
            for (row, sum) in sums.iter().enumerate() {
                sink.take::<FUSED>((p + row) * to + tile, sum, &top, kernel.epsilon);
            }
        }
        for p in whole..base {
            let [sum] = band.sums::<FUSED, 1>(&spread.values[p * from..], from);
            sink.take::<FUSED>(p * to + tile, &sum, &top, kernel.epsilon);
        }
    }
}

impl Sink<'_> {
    #[inline(always)]
    fn take<const FUSED: bool>(&mut self, at: usize, sum: &Lanes, top: &Lanes, epsilon: f64) {
        match self {
            Self::Potential { potential, keep } => {
                for lane in 0..LANES {
                    let logarithm = top[lane] + ln::<FUSED>(max(sum[lane], f64::MIN_POSITIVE));
                    let old = &mut potential[at][lane];
                    *old = *keep * *old - (1.0 - *keep) * (epsilon * logarithm);
                }
            }
            Self::Sum { sum: out, potential } => {
                for lane in 0..LANES {
                    out[at][lane] = sum[lane] * exp::<FUSED>(top[lane] + potential[at][lane] / epsilon);
                }
            }
        }
    }
}
