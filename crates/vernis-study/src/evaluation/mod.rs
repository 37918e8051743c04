//! Agreement with people: correlations, cross-validation, bootstrap, tests of differences, benchmark records.
//!
//! A [`cross_validation::OutOfFold`] says what a metric predicts for rows that it has not seen,
//! [`agreement::Agreement`] how well that agrees with the ratings, [`bootstrap`] how sure that is, and
//! [`benchmark`] collects both for many metrics as records. Nothing here formats or prints.

pub mod agreement;
pub mod benchmark;
pub mod bootstrap;
pub mod calibration;
pub mod cross_validation;
pub mod dependent;
pub mod importance;
pub mod protocol;
pub mod records;
mod scale;
pub mod triplets;

use crate::samples::SamplesError;
use crate::samples::split::SplitError;
use crate::train::TrainError;
use thiserror::Error;
use vernis_metric::io::counted;
use vernis_metric::math::correlation::CorrelationError;
use vernis_metric::math::logistic::LogisticError;
use vernis_metric::math::resampling::ResamplingError;

/// Why agreement with people could not be measured.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum EvaluationError {
    #[error("the number of {what} is {found}; it must be {expected}")]
    Lengths { what: &'static str, found: usize, expected: usize },
    #[error("{what}: {source}")]
    Correlation { what: &'static str, source: CorrelationError },
    #[error("{metric}, fold {fold}: {source}")]
    Logistic { metric: String, fold: usize, source: LogisticError },
    #[error(transparent)]
    Split(#[from] SplitError),
    #[error("{metric}, fold {fold} of {}: {source}", counted(*training_rows, "training row"))]
    Training { metric: String, fold: usize, training_rows: usize, source: Box<TrainError> },
    #[error("row {row} ({material}, {method}) is held out by {times} folds; it must be held out by exactly 1")]
    Coverage { row: usize, material: String, method: String, times: usize },
    #[error("{metric}: the prediction for row {row} is {value}; it must be finite")]
    NotFinite { metric: String, row: usize, value: f64 },
    #[error("{metric}: {defined} of {resamples} resamples have a correlation; at least half must have one")]
    Resamples { metric: String, defined: usize, resamples: usize },
    #[error("the number of {what} is {found}; it must be at least {least}")]
    TooFew { what: &'static str, found: usize, least: usize },
    #[error(transparent)]
    Resampling(#[from] ResamplingError),
    #[error("there is no column {name} among the {} of the samples", counted(*columns, "column"))]
    UnknownColumn { name: String, columns: usize },
    #[error(transparent)]
    Samples(#[from] SamplesError),
    #[error("there is no metric {name}; the judged metrics are {judged}")]
    UnknownMetric { name: String, judged: String },
}
