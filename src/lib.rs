//! How different do two materials look? A trainer for perceptual BRDF metrics.

pub mod dataset;
pub mod evaluation;
pub mod experiment;
pub mod panel;
pub mod prelude;
pub mod report;
pub mod samples;
pub mod train;

pub use vernis_metric::{brdf, descriptor, fit, io, light, math, metric};
