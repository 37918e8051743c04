//! The one integration binary: each room's tests are a module.

mod brdf;
mod cli;
mod dataset;
mod descriptor;
mod evaluation;
mod fit;
mod learned;
mod lp;
mod lp_golden;
mod naive_lp;
mod report;
mod rooms;
mod shipped;
#[cfg(feature = "train")]
mod train;
mod transport;
mod transport_pairs;
