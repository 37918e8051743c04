//! The divergence on quantised nodes: the cost p = 2 is separable, so that sums over all pairs become small products.
//!
//! `measure` puts the masses on nodes (`lattice` the base, `splat` the weights), `levels` has coarser ones, `iterations` anneals,
//! `gaussian` and its `value_axis` and `band` sum, `gradient` goes back.

mod band;
mod field;
mod gaussian;
mod gradient;
mod iterations;
mod lattice;
mod levels;
mod matrix;
mod measure;
mod splat;
mod value_axis;

pub(super) use gradient::divergence_and_gradient;
pub(super) use iterations::divergence;
pub(super) use lattice::Lattice;
pub(super) use levels::Levels;
