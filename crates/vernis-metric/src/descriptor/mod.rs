//! A BRDF becomes comparable numbers: samples on half/difference nodes, pictures under fixed lights, angular ratios.
//!
//! Everything that depends on one BRDF alone is a [`BrdfFeatures`], computed once and cached; comparing two of them takes
//! less than a millisecond. Nothing in this room knows of scores.

mod angular;
mod cache;
mod column;
mod comparison;
#[cfg(test)]
mod constant;
mod context;
mod display;
pub mod embedding;
mod extract;
mod features;
mod frame;
mod gradient;
pub mod names;
mod norms;
mod pair;
mod picture;
pub mod regions;
mod set;
mod setup;
mod setup_id;
mod smooth;
mod v1;
pub mod wasserstein;

pub use cache::{Cache, CacheWarning};
pub use column::{Column, Role};
pub use embedding::Embedding;
pub use extract::features;
pub use features::BrdfFeatures;
pub use set::{Description, DescriptorSet, Family};
pub use setup::{DescriptorOptions, Lights, Setup, ShapeChoice, VERSION};
pub use setup_id::SetupId;

use crate::brdf::BrdfError;
use crate::io::shown;
use crate::light::LightError;
use std::path::PathBuf;
use thiserror::Error;

/// What keeps a descriptor from being computed.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum DescriptorError {
    #[error(transparent)]
    Light(#[from] LightError),
    #[error("{}: cache folder: {reason}", path.display())]
    CacheFolder { path: PathBuf, reason: String },
    #[error("unknown descriptors `{}`; this program knows {known}", shown(id, 100))]
    UnknownSetup { id: String, known: String },
    #[error("the descriptors are of version {found}; this program knows up to version {newest}: update vernis")]
    NewerSetup { found: u32, newest: u32 },
    #[error("the descriptors need {what}; name it with {option}")]
    MissingFile { what: String, option: &'static str },
    #[error("{}: the {kind} is {found}; it must be {wanted} (the first digits of its SHA-256)", path.display())]
    OtherFile { path: PathBuf, kind: &'static str, found: String, wanted: String },
    #[error("descriptor family `{name}` is unknown; the families are {known}")]
    UnknownFamily { name: String, known: String },
    #[error("embedding `{name}`: the number of {what} is {found}; it must be {expected}")]
    Embedding { name: String, what: String, found: usize, expected: usize },
    #[error("the comparison gave {found} numbers; it must give {expected}")]
    Columns { found: usize, expected: usize },
    #[error("the number of {what} is {found}; it must be {expected}")]
    Length { what: &'static str, found: usize, expected: usize },
    #[error("{what} have no derivative")]
    NoDerivative { what: String },
    #[error(transparent)]
    Open(#[from] BrdfError),
    #[error("{notation}: {cause}")]
    Source { notation: String, cause: Box<DescriptorError> },
}
