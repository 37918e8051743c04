//! How a screen shows a picture: tone curves and display models.

mod model;

pub use model::Display;
pub(crate) use model::standard_luminance;
