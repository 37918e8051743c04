//! How different do two materials look?
pub mod brdf;
pub mod dataset;
pub mod descriptor;
pub mod math;
pub mod metric;
pub mod train;
