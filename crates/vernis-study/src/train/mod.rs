//! Ratings become a metric.
//!
//! A [`Trainer`] learns from a [`TrainingSet`] alone: standardisation, hyper-parameters, stopping and the map to the
//! scale of the ratings are all fitted on its rows, choices on its own inner folds. What it returns predicts mean
//! opinion scores, as grades from 1 to 5, from raw descriptors; identical BRDFs get [`TrainingSet::identical`]. The kernel and
//! network trainers also give a portable
//! [`Regressor`], the part of an exported metric that was learned.

#[cfg(feature = "train")]
mod choices;
#[cfg(feature = "train")]
pub mod embedding;
#[cfg(feature = "train")]
pub mod embedding_folds;
pub mod ensemble;
pub mod export;
pub mod kernel;
mod landmarks;
#[cfg(feature = "train")]
pub mod linear;
pub mod lp_baseline;
#[cfg(feature = "train")]
pub mod neural;
#[cfg(feature = "train")]
pub mod recipe;
#[cfg(feature = "train")]
pub mod residual;
mod standardize;
#[cfg(feature = "train")]
pub mod svr;
pub mod trivial;

use crate::samples::split::{SplitError, TrainingSet};
use ndarray::ArrayView2;
use thiserror::Error;
use vernis_metric::io::counted;
use vernis_metric::math::logistic::LogisticError;
use vernis_metric::metric::learned::{Regressor, RegressorError};

/// Rows from which every trainer of the recipe and of the baselines learns.
pub const LEAST_ROWS: usize = 8;

/// Inner folds for every choice that a trainer makes.
pub const INNER_FOLDS: usize = 5;

/// Why a trainer could not make a model.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum TrainError {
    #[error("{trainer}: the training set has {}; it must have at least {needed}", counted(*found, "row"))]
    TooFewRows { trainer: String, found: usize, needed: usize },
    #[error("{trainer}: all {rows} ratings are equal ({value}); there is nothing to learn")]
    EqualRatings { trainer: String, rows: usize, value: f64 },
    #[error("{trainer}: no descriptor compares candidate and reference, or none varies over the training rows")]
    NoDifference { trainer: String },
    #[error("{trainer}: column {column} does not exist; the training set has {}", counted(*available, "column"))]
    UnknownColumn { trainer: String, column: String, available: usize },
    #[error("{trainer}: {what} is {value}; it must be {allowed}")]
    Option { trainer: String, what: &'static str, value: f64, allowed: &'static str },
    #[error("{trainer}: the {size}x{size} system of {what} is singular")]
    Singular { trainer: String, what: &'static str, size: usize },
    #[error("{trainer}: training diverged: {what} is not finite after {}", counted(*epochs, "epoch"))]
    Diverged { trainer: String, what: &'static str, epochs: usize },
    #[error("{trainer}: {reason}")]
    Solver { trainer: String, reason: String },
    #[error("{trainer}: the model has no portable form")]
    NotPortable { trainer: String },
    #[error("{trainer}, column {column}: {source}")]
    Logistic { trainer: String, column: String, source: LogisticError },
    #[error("{trainer}: {source}")]
    Split { trainer: String, source: SplitError },
    #[error("{trainer}: {source}")]
    Regressor { trainer: String, source: RegressorError },
}

/// Learns a map from descriptors to mean opinion scores.
pub trait Trainer: Send + Sync {
    /// Such as `kernel-ridge`; names the model in records and errors.
    fn name(&self) -> &str;

    /// Learns from the rows of `set` alone. The same set and seed give the same model.
    fn train(&self, set: &TrainingSet, seed: u64) -> Result<Box<dyn Predictor>, TrainError>;
}

/// What a trainer returns.
pub trait Predictor: Send + Sync {
    /// Mean opinion scores, one a row of rows x columns, the columns being those of the training set. Not limited to
    /// 1..=5.
    fn predict(&self, features: ArrayView2<'_, f64>) -> Vec<f64>;

    /// What a model that only chooses and maps one column goes by, before the map; `None` for every other model.
    fn unmapped(&self, _features: ArrayView2<'_, f64>) -> Option<Unmapped> {
        None
    }

    /// The portable form, where the model has one: exact at identity and free of training crates.
    fn regressor(&self) -> Option<&Regressor> {
        None
    }
}

/// A column as a model found it.
#[derive(Debug, Clone, PartialEq)]
pub struct Unmapped {
    /// Name of the column.
    pub column: String,
    /// Its values, one a row; a distance enters negated, so that larger is better.
    pub values: Vec<f64>,
}

impl Predictor for Regressor {
    fn predict(&self, features: ArrayView2<'_, f64>) -> Vec<f64> {
        self.predict_rows(features)
    }

    fn regressor(&self) -> Option<&Regressor> {
        Some(self)
    }
}

/// Refuses what no trainer can learn from.
fn check_set(trainer: &str, set: &TrainingSet, needed: usize) -> Result<(), TrainError> {
    let mos = set.mos();
    if mos.len() < needed {
        return Err(TrainError::TooFewRows { trainer: trainer.to_owned(), found: mos.len(), needed });
    }
    if mos.iter().all(|m| *m == mos[0]) {
        return Err(TrainError::EqualRatings { trainer: trainer.to_owned(), rows: mos.len(), value: mos[0] });
    }
    Ok(())
}
