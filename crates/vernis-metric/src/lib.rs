#![doc = include_str!("../README.md")]

pub mod brdf;
pub mod descriptor;
pub mod fit;
pub mod io;
pub mod light;
pub mod math;
pub mod metric;
pub mod prelude;
