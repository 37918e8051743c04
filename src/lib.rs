//! How different do two materials look? A trainer for perceptual BRDF metrics.

pub mod cli;
pub mod experiment;
pub mod prelude;
pub mod report;

/// The stimuli, path traced, and metrics that look at pictures.
pub use vernis_image as image;
pub use vernis_metric::{brdf, descriptor, fit, io, light, math, metric};
/// Studies, what is learned from them, and how well it agrees with people.
pub use vernis_study::{csv, dataset, evaluation, panel, samples, train};

/// Markup of the pages in [`report::page`] and of [`report::tables::Table`].
pub use maud;
/// Matrices and vectors of the public signatures, the random generator of [`math::seed`], and JSON values.
pub use vernis_metric::{ndarray, rand_chacha, serde_json};

/// The README's examples, compiled and run with the tests of the documentation.
#[cfg(all(doctest, feature = "train"))]
#[doc = include_str!("../README.md")]
struct Readme;
