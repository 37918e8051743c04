//! Learned metrics: what an exported file holds, evaluated without any training library.

pub mod exported;
mod metric;
mod regressor;

pub use crate::math::layers::{Activation, Dense, forward};
pub use exported::{ExportedError, ExportedMetric, Score};
pub use metric::LearnedMetric;
pub use regressor::{
    Feature, Function, Input, Kernel, Radial, Regressor, RegressorError, Standardizer, Term, sign_power,
};
