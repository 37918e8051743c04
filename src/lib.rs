//! How different do two materials look?
pub mod brdf;
pub mod dataset;
pub mod evaluation;
pub mod math;
pub mod metric;
pub mod report;
pub mod train;
