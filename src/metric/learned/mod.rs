//! Learned metrics: the regressor that an exported file holds, evaluated without any training library.

mod regressor;

pub use regressor::{
    Activation, Dense, Feature, Function, Input, Kernel, Regressor, RegressorError, Standardizer, Term, forward,
    sign_root,
};
