//! How a screen shows a picture: tone curves and display models.

pub mod tone;
