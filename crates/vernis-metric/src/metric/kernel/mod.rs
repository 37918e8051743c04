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
//! 2. D goes onto a lattice (`lattice.rs`): 12 to 24 nodes a polar axis, the rest of about a million for the azimuth, by linear
//!    (hat) weights; value nodes (`value_axis.rs`) alpha/16 apart where values are, by cubic ones, which place the small
//!    differences of near-identical BRDFs well. Masses of the same place cancel first, and with them all constants;
//! 3. hats widen a Gaussian along the base; each is narrowed (`lattice.rs`) in advance by the variance that they add on average;
//! 4. along the base, pivoted Cholesky factors project D to the few coordinates that a Gaussian of that width can tell apart;
//!    along the values, sums run over the nodes within reach;
//! 5. what the lattice cannot resolve, the pair that one cell forms with itself on the other side, is added (`divergence.rs`).
//!
//! Source: G. Lavoué et al. 2021, doi:10.1111/cgf.142636, section 6.1; J. Feydy et al., "Interpolating between optimal transport
//! and MMD using Sinkhorn divergences", AISTATS 2019, arXiv:1810.08278 (the distances, and the factor 1/2); G. Székely, M. Rizzo,
//! "Energy statistics", J. Stat. Plan. Inference 143, 2013, doi:10.1016/j.jspi.2013.03.018. GeomLoss's `tensorized` back end
//! clamps squared distances at 1e-8, which doubles values of near-identical pairs; here nothing is clamped.
//!
//! Accuracy against the sums over all pairs: 1 % for the energy distance and the Gaussian MMD, 0.1 % at 45x45x180 where that
//! has been computed (some minutes a channel), 3 % for the Laplacian MMD; near-identical pairs (one part in a thousand) at
//! alpha 0.01, whose values lie many nodes apart, may be worse. Cost: 0.05 to 0.5 s a channel at 45x45x180, 20 to 50 MB.

mod axis;
mod direct;
mod divergence;
mod lattice;
mod metric;
mod mixture;
mod value_axis;

/// Of the numbers: it changes when a distance changes by more than rounding, and the golden values in the tests with it.
pub const VERSION: &str = "1";

/// Family of these metrics.
pub const FAMILY: &str = "energy";

pub use metric::KernelMetric;
pub use mixture::Kernel;
