//! A BRDF becomes comparable numbers: samples on half/difference nodes, pictures under fixed lights, angular ratios.
//!
//! Everything that depends on one BRDF alone is a [`BrdfFeatures`], computed once and cached; comparing two of them takes
//! less than a millisecond. Nothing in this room knows of scores.

pub mod angular;
mod cache;
pub mod compact;
pub mod context;
mod display;
pub mod embedding;
mod extract;
mod features;
pub mod light;
pub mod node_table;
pub mod operator;
pub mod picture;
mod set;
mod setup;
pub mod shape;
pub mod wasserstein;

pub use cache::{Cache, CacheWarning};
pub use embedding::Embedding;
pub use extract::{Extraction, Extractor, Progress, features};
pub use features::BrdfFeatures;
pub use node_table::NodeTable;
pub use set::{Description, DescriptorSet, Family};
pub use setup::{DescriptorOptions, Lights, Setup, ShapeChoice, VERSION};

use crate::brdf::BrdfError;
use crate::math::Rgb;
use std::path::PathBuf;
use thiserror::Error;

/// What keeps a descriptor from being computed.
#[derive(Debug, Error)]
pub enum DescriptorError {
    #[error(
        "the BRDF is {value:?} at theta_h {theta_h:.2}, theta_d {theta_d:.2}, phi_d {phi_d:.0} deg; allowed: finite numbers"
    )]
    NotFinite { theta_h: f64, theta_d: f64, phi_d: f64, value: Rgb },
    #[error("the BRDF has no measurement at any of the {nodes} nodes; allowed: at least one")]
    NoMeasurement { nodes: usize },
    #[error("{}: light probe: {reason}", path.display())]
    Probe { path: PathBuf, reason: String },
    #[error("{}: mesh: {reason}", path.display())]
    Mesh { path: PathBuf, reason: String },
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
