//! One binary for all integration tests.
mod brdf;
mod descriptor;
mod learned;
mod train;
