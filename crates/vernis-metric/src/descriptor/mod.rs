//! A BRDF becomes comparable numbers: samples on half/difference nodes, pictures under fixed lights, angular ratios.
//!
//! Everything that depends on one BRDF alone is a [`BrdfFeatures`], computed once and cached; comparing two of them takes
//! less than a millisecond. Nothing in this room knows of scores.

pub mod angular;
mod cache;
mod column;
pub mod compact;
#[cfg(test)]
mod constant;
pub mod context;
mod display;
pub mod embedding;
mod extract;
mod features;
pub mod picture;
mod set;
mod setup;
pub mod wasserstein;

pub use cache::{Cache, CacheWarning};
pub use column::{Column, Role};
pub use embedding::Embedding;
pub use extract::{Extraction, Extractor, Progress, features};
pub use features::BrdfFeatures;
pub use set::{Description, DescriptorSet, Family};
pub use setup::{DescriptorOptions, Lights, Setup, ShapeChoice, VERSION};

use crate::brdf::BrdfError;
use crate::light::LightError;
use std::path::PathBuf;
use thiserror::Error;

/// What keeps a descriptor from being computed.
#[derive(Debug, Error)]
pub enum DescriptorError {
    #[error(transparent)]
    Light(#[from] LightError),
    #[error("{}: cache folder: {reason}", path.display())]
    CacheFolder { path: PathBuf, reason: String },
    #[error("descriptor family `{name}` is unknown; known: {known}")]
    UnknownFamily { name: String, known: String },
    #[error("embedding `{name}`: {what}: found {found}, expected {expected}")]
    Embedding { name: String, what: String, found: usize, expected: usize },
    #[error("the comparison gave {found} numbers, expected {expected}")]
    Columns { found: usize, expected: usize },
    #[error(transparent)]
    Open(#[from] BrdfError),
    #[error("{notation}: {cause}")]
    Source { notation: String, cause: Box<DescriptorError> },
}
