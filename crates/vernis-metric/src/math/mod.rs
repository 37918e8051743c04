//! Directions, coordinates, colour spaces, correlations, quantiles, least squares, Cholesky factors, the simplex of Nelder and
//! Mead, the logistic curve, dense layers, dual numbers, the error function, resamples, scales of ratings, seeds and loops on
//! all workers.
//!
//! Nothing in this room knows what a BRDF is.

pub mod cholesky;
pub mod color;
pub mod coordinates;
pub mod correlation;
pub mod dual;
pub mod eigen;
pub mod erf;
pub mod layers;
pub mod least_squares;
pub mod logistic;
pub mod nelder_mead;
pub mod parallel;
pub mod quantile;
pub mod rating_scale;
pub mod resampling;
pub mod seed;
pub mod spherical_harmonics;
mod vec3;

pub use vec3::Vec3;

/// A linear RGB triple; the unit is that of whatever it measures (for a BRDF 1/sr).
pub type Rgb = [f64; 3];
