//! Kernel distances between the graphs of two BRDFs: the energy distance, Gaussian and Laplacian MMD.
//!
//! With a and b the graphs ([`crate::metric::graph`]) of one channel, N points of mass 1/N each, D = a - b, r the Euclidean
//! distance in four dimensions and k(r) = -r (energy), exp(-r^2/(2 blur^2)) (Gaussian) or exp(-r/blur) (Laplacian):
//!
//!   W = 1/2 sum_xy D(x) k(|x - y|) D(y),   distance = (W_r + W_g + W_b)^gamma.
//!
//! Up to 4,000 cells (`direct.rs`) that is what is computed. Beyond, N^2 pairs are too many, and (Rahimi & Recht would sample, we
//! do not):
//!
//! 1. k becomes a sum of Gaussians (`mixture.rs`), 10 to 20 of them, each the product of one factor an axis;
//! 2. each side goes onto a lattice (`splat.rs`): 11 nodes an axis of the base, by linear (hat) weights; value nodes (`value_axis.rs`)
//!    alpha/16 apart, by cubic ones, which place the small differences of near-identical BRDFs well. The nodes are the same for all
//!    sides, and whatever follows is done once a side;
//! 3. hats widen a Gaussian along the base; each is narrowed (`plan.rs`) in advance by the variance that they add on average;
//! 4. every Gaussian is a sum of squares, <D, G D> = |S D|^2: along the base, S are eigenvectors, the few that a Gaussian of that width
//!    can tell apart; along the values, Gaussians of half the variance. S a is kept for every side (`side.rs`), and two sides are compared
//!    by |S a - S b|^2: no digits of near-identical pairs cancel;
//! 5. what the lattice cannot resolve, the pair that one cell forms with itself on the other side, is added (`divergence.rs`).
//!
//! Source: G. Lavoué et al. 2021, doi:10.1111/cgf.142636, section 6.1; J. Feydy et al., "Interpolating between optimal transport
//! and MMD using Sinkhorn divergences", AISTATS 2019, arXiv:1810.08278 (the distances, and the factor 1/2); G. Székely, M. Rizzo,
//! "Energy statistics", J. Stat. Plan. Inference 143, 2013, doi:10.1016/j.jspi.2013.03.018. GeomLoss's `tensorized` back end
//! clamps squared distances at 1e-8, which doubles values of near-identical pairs; here nothing is clamped.
//!
//! Accuracy against the sums over all pairs: 1 % for the energy distance and the Gaussian MMD, 0.1 % at 45x45x180 where that
//! has been computed (some minutes a channel), 3 % for the Laplacian MMD; near-identical pairs (one part in a thousand) at
//! alpha 0.01 or phi = ln(t + eta), whose values lie many nodes apart, may be worse, by 5 %. Cost at 45x45x180: 15 to 50 ms and 3 to
//! 10 MB a side and channel, then 2 to 6 ms a pair and channel.

mod axis;
mod direct;
mod divergence;
mod lanes;
mod memory;
mod metric;
mod mixture;
mod plan;
mod side;
mod splat;
mod value_axis;

/// Of the numbers: it changes when a distance changes by more than rounding, and the golden values in the tests with it.
/// 2: nodes that do not depend on the other side; values moved by a few tenths of a per cent.
pub const VERSION: &str = "2";

/// Family of these metrics.
pub const FAMILY: &str = "energy";

pub use metric::{KernelMetric, PreparedChannels};
pub use mixture::Kernel;
