//! Learned metrics: what an exported file holds, evaluated without any training library.

/// Family of these metrics.
pub const FAMILY: &str = "learned";

pub mod exported;
mod gradient;
mod metric;
mod regressor;
mod standardizer;

pub use crate::math::layers::{Activation, Dense, forward};
pub use crate::metric::Score;
pub use exported::{ExportedError, ExportedMetric};
pub use gradient::SMOOTHING;
pub use metric::LearnedMetric;
pub use regressor::{Function, Input, Kernel, Radial, Regressor, RegressorError, Term};
pub use standardizer::{Clip, Feature, Standardizer, sign_power, soft_power};
