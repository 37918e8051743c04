//! The one integration binary of the package: each room's tests are a module.

mod brdf;
mod descriptor;
mod fit;
mod golden;
mod graph;
mod lp;
mod lp_golden;
mod naive_lp;
mod transport;
mod transport_golden;
mod transport_pairs;
