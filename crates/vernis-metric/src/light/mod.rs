//! Lights and shapes defined by code or read from probes and meshes, and the linear operator from a BRDF to a picture.

mod footprint;
pub mod node_table;
pub mod operator;
pub mod shape;
pub mod sites;
pub mod source;
pub mod sphere;

pub use node_table::NodeTable;
pub use operator::Operator;
pub use shape::Shape;
pub use sites::{Sampling, Sites};
pub use source::Light;

use crate::math::Rgb;
use std::path::PathBuf;
use thiserror::Error;

/// Why there is no light, shape or picture.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum LightError {
    #[error(
        "the BRDF is {value:?} at theta_h {theta_h:.2}, theta_d {theta_d:.2}, phi_d {phi_d:.0} deg; it must be finite"
    )]
    NotFinite { theta_h: f64, theta_d: f64, phi_d: f64, value: Rgb },
    #[error("the BRDF has no measurement at any of the {nodes} nodes; it must have at least one")]
    NoMeasurement { nodes: usize },
    #[error("{}: light probe: {reason}", path.display())]
    Probe { path: PathBuf, reason: String },
    #[error("{}: mesh: {reason}", path.display())]
    Mesh { path: PathBuf, reason: String },
    #[error("the picture could not be encoded: {0}")]
    Encode(String),
}
