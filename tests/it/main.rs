//! The one integration binary: each room's tests are a module.

mod brdf;
mod browser;
mod cli;
mod data;
mod dataset;
mod descriptor;
mod evaluation;
mod fit;
mod graph;
mod learned;
mod losses;
mod lp;
mod lp_golden;
mod naive_lp;
mod report;
mod rooms;
mod shipped;
mod study;
mod sweep;
#[cfg(feature = "train")]
mod train;
mod transport;
mod transport_golden;
mod transport_pairs;
