//! The one integration binary: each room's tests are a module.

mod brdf;
mod rooms;
