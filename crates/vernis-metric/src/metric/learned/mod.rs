//! Learned metrics: what an exported file holds, evaluated without any training library.

/// Family of these metrics.
pub const FAMILY: &str = "learned";

pub mod exported;
mod metric;
mod regressor;

pub use crate::math::layers::{Activation, Dense, forward};
pub use crate::metric::Score;
pub use exported::{ExportedError, ExportedMetric};
pub use metric::LearnedMetric;
pub use regressor::{
    Feature, Function, Input, Kernel, Radial, Regressor, RegressorError, Standardizer, Term, sign_power,
};
