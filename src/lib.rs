//! How different do two materials look? A trainer for perceptual BRDF metrics.

pub mod cli;
pub mod dataset;
pub mod evaluation;
pub mod experiment;
pub mod panel;
pub mod prelude;
pub mod report;
pub mod samples;
pub mod train;

/// The stimuli, path traced, and metrics that look at pictures.
pub use vernis_image as image;
pub use vernis_metric::{brdf, descriptor, fit, io, light, math, metric};

/// Records and errors of [`dataset::csv_table`].
pub use csv;
/// Markup of the pages in [`report::page`] and of [`report::tables::Table`].
pub use maud;
/// Matrices and vectors of the public signatures, the random generator of [`math::seed`], and JSON values.
pub use vernis_metric::{ndarray, rand_chacha, serde_json};

/// The README's examples, compiled and run with the tests of the documentation.
#[cfg(all(doctest, feature = "train"))]
#[doc = include_str!("../README.md")]
struct Readme;
