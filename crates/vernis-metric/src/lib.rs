#![doc = include_str!("../README.md")]

pub mod brdf;
pub mod descriptor;
pub mod fit;
pub mod io;
pub mod light;
pub mod math;
pub mod metric;
pub mod prelude;

/// Matrices and vectors of this crate's public signatures.
pub use ndarray;
/// The random generator that [`math::seed::stream`] returns.
pub use rand_chacha;
/// JSON values of [`fit::FitFile`] and of the seals in [`io`].
pub use serde_json;
