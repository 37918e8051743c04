//! Learned metrics: what an exported file holds, evaluated without any training library.

pub mod exported;
mod metric;
mod regressor;

pub use exported::{ExportedError, ExportedMetric, Score};
pub use metric::LearnedMetric;
pub use regressor::{
    Activation, Dense, Feature, Function, Input, Kernel, Radial, Regressor, RegressorError, Standardizer, Term,
    forward, sign_power,
};
