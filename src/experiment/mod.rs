//! One file a question: the training job, the benchmark of a study, the sweep of transport's parameters, which loss a fit should
//! have, a study's candidates made anew, which candidates explain the ratings, how
//! metrics follow one parameter of a material, what a gradient spares in a fit, and what a version of the
//! metric gains over the one before.
//!
//! Everything here is callable from a program of one's own: plain options in, a callback for progress, a typed result out.
//! Nothing prints, and nothing knows of a terminal.

#[cfg(feature = "train")]
mod contenders;
#[cfg(feature = "train")]
pub mod external;
#[cfg(feature = "train")]
pub mod further;
pub mod landscape;
pub mod losses;
pub mod optimizers;
#[cfg(feature = "train")]
pub mod plan;
#[cfg(feature = "train")]
mod provenance;
#[cfg(feature = "train")]
pub mod rebuilt;
pub mod refit;
pub mod rendering;
pub mod stimuli;
pub mod sweep;
#[cfg(feature = "train")]
pub mod train;
#[cfg(feature = "train")]
pub mod trials;
pub mod triplets;
#[cfg(feature = "train")]
pub mod versions;

#[cfg(feature = "train")]
pub use train::{BenchmarkOptions, Measurement, Purpose, TrainOptions, Trained, benchmark, train};

use crate::dataset::DatasetError;
use crate::evaluation::EvaluationError;
use crate::samples::SamplesError;
use crate::samples::extraction::ExtractionError;
use crate::samples::split::SplitError;
use crate::train::TrainError;
#[cfg(feature = "train")]
use crate::train::embedding_folds::EmbeddingError;
use crate::train::export::ExportError;
use std::path::PathBuf;
use thiserror::Error;
use vernis_metric::brdf::BrdfError;
use vernis_metric::descriptor::DescriptorError;
use vernis_metric::fit::FitError;
use vernis_metric::io::LockError;
use vernis_metric::metric::MetricError;
use vernis_metric::metric::learned::ExportedError;

/// Why an experiment has no result.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum ExperimentError {
    #[error(transparent)]
    Study(Box<DatasetError>),
    #[error(transparent)]
    Extraction(Box<ExtractionError>),
    #[error(transparent)]
    Evaluation(Box<EvaluationError>),
    #[error(transparent)]
    Samples(Box<SamplesError>),
    #[error(transparent)]
    Split(Box<SplitError>),
    #[error(transparent)]
    Train(Box<TrainError>),
    #[error(transparent)]
    Open(Box<BrdfError>),
    #[error("{reference} against {candidate}: {source}")]
    Metric { reference: String, candidate: String, source: Box<MetricError> },
    #[error("{notation}: {source}")]
    Table { notation: String, source: Box<MetricError> },
    #[error("{name}: {source}")]
    MetricNamed { name: String, source: Box<MetricError> },
    #[error("{material}, {model} under {loss}: {source}")]
    Fit { material: String, model: String, loss: &'static str, source: Box<FitError> },
    #[error(transparent)]
    Descriptor(Box<DescriptorError>),
    #[error(transparent)]
    Exported(Box<ExportedError>),
    #[error(transparent)]
    Export(Box<ExportError>),
    #[cfg(feature = "train")]
    #[error(transparent)]
    Embedding(Box<EmbeddingError>),
    #[error("{}: none of the {asked} combinations is there", folder.display())]
    NothingKept { folder: PathBuf, asked: usize },
    #[error("{study}: no rated pair is of a method that could be rebuilt in a known way; there must be at least one")]
    NoWay { study: String },
    #[error("there is nothing to try for the method {method}: {reason}")]
    NoTrial { method: String, reason: String },
    #[error(transparent)]
    Lock(Box<LockError>),
    #[error("the result cannot be written: {reason}")]
    Write { reason: String },
    #[error("{} is the result of another run: {differences}; choose another folder, or remove the file", path.display())]
    Kept { path: PathBuf, differences: String },
    #[error("{what} is {found}; it must be {allowed}")]
    Setting { what: &'static str, found: usize, allowed: &'static str },
    #[error(
        "the model {model} is computed from a reference without a search; searches are compared on models such as ggx"
    )]
    NoSearch { model: String },
    #[error("study {study}: {reason}")]
    Unsupported { study: String, reason: String },
    #[error("{metric} could not be measured on unseen materials, so that it cannot be exported: {reason}")]
    NotMeasured { metric: &'static str, reason: String },
}

/// Causes are boxed, so that a result takes little room.
macro_rules! boxed {
    ($($(#[$meta:meta])* $variant:ident($cause:ty)),* $(,)?) => {$(
        $(#[$meta])*
        impl From<$cause> for ExperimentError {
            fn from(cause: $cause) -> Self {
                Self::$variant(Box::new(cause))
            }
        }
    )*};
}

boxed! {
    Study(DatasetError),
    Extraction(ExtractionError),
    Evaluation(EvaluationError),
    Samples(SamplesError),
    Split(SplitError),
    Train(TrainError),
    Open(BrdfError),
    Descriptor(DescriptorError),
    Exported(ExportedError),
    Export(ExportError),
    Lock(LockError),
    #[cfg(feature = "train")]
    Embedding(EmbeddingError),
}
