//! How a screen shows a picture: tone curves and display models.

mod model;
pub mod tone;

pub use model::Display;
pub(crate) use model::standard_luminance;
