#![doc = include_str!("../README.md")]

pub mod dataset;
pub mod evaluation;
pub mod panel;
pub mod samples;
pub mod train;

/// Records and errors of [`dataset::csv_table`].
pub use csv;
