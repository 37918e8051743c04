//! How different do two materials look? Metrics between BRDFs: evaluate, compare, fit.

pub mod brdf;
pub mod descriptor;
pub mod fit;
pub mod io;
pub mod light;
pub mod math;
pub mod metric;
