#![doc = include_str!("../README.md")]

pub mod display;
pub mod metric;
pub mod picture;
pub mod scene;
pub mod stimulus;
pub mod trace;
