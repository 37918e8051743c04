//! Learned metrics: the regressor that an exported file holds, evaluated without any training library.

mod regressor;

pub use regressor::{Activation, Dense, Feature, Regressor, RegressorError, Standardizer};
