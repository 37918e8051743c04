//! Parameters of a model from a measured BRDF, with any metric as the loss.
//!
//! [`Fitting`] says how: model, metric, start, method, budget; [`Fitting::run`] gives a [`Fitted`], which [`FitFile`] keeps.
//! Underneath: [`loss`] makes a function of the model out of a metric and its reference, [`Space`] gives the parameters
//! coordinates in which steps are alike, [`start`] finds where to begin, [`optimizer`] searches. Models that are read off a
//! reference, not searched, are in [`direct`] and [`rational`]. [`manifold`] makes candidates that belong to no model. [`export`] takes
//! a fit to a renderer.

pub mod direct;
pub mod export;
mod fitting;
mod least_distance;
mod log_fits;
pub mod loss;
pub mod manifold;
mod objective;
pub mod optimizer;
pub mod rational;
mod result_file;
mod search;
mod space;
pub mod start;

pub use fitting::{Fitted, Fitting, Start};
pub use log_fits::LogFits;
pub use result_file::{Difference, FIT_VERSION, FitFile, KeptFit, MetricUsed, ReferenceUsed};
pub use space::{AtBound, Bound, Space};

use crate::brdf::BrdfError;
use crate::brdf::models::{ModelError, foreign, names};
use crate::io::{did_you_mean, nearest};
use crate::metric::MetricError;
use thiserror::Error;

/// What keeps a model from being fitted.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum FitError {
    #[error(transparent)]
    Metric(#[from] MetricError),
    #[error(transparent)]
    Model(ModelError),
    #[error("unknown model `{found}`; {}; the models are {}, and sums such as ggx+ward", foreign::model(found).unwrap_or_else(|| did_you_mean(nearest)), names().join(", "))]
    UnknownModel { found: String, nearest: Vec<String> },
    #[error("unknown renderer `{found}`; {}; they are mitsuba, pbrt, materialx, gltf", did_you_mean(nearest))]
    UnknownRenderer { found: String, nearest: Vec<String> },
    #[error("{what} is {found}; it must be {allowed}")]
    Setting { what: &'static str, found: String, allowed: String },
    #[error("lbfgs needs gradients, and {what} has none; use hooke-jeeves or nelder-mead")]
    NoGradient { what: String },
    #[error("the start cannot be used: {reason}")]
    Start { reason: String },
    #[error("{material}: {cause}")]
    Reference { material: String, cause: Box<BrdfError> },
    #[error("{model}: no such function stays within {:.0} % of every {channel} value of the reference", 100.0 * width)]
    Infeasible { model: String, channel: &'static str, width: f64 },
    #[error("the result cannot be written: {reason}")]
    Write { reason: String },
    #[error(
        "{path} is the result of another run: {}; choose another folder, or remove the file",
        differences.iter().map(Difference::to_string).collect::<Vec<_>>().join(", ")
    )]
    Kept { path: String, differences: Vec<Difference> },
}

impl FitError {
    /// With the nearest names for a model that does not exist.
    fn from_model(error: ModelError) -> Self {
        let ModelError::UnknownModel { found } = error else { return Self::Model(error) };
        let nearest = nearest(&found, names());
        Self::UnknownModel { found, nearest }
    }
}
