//! Small neural networks, trained with `burn`: nothing outside this folder names it.
//!
//! [`regression`] learns the map from descriptors to ratings, [`saturated`] a distance that is a metric, [`autoencoder`] a
//! low-dimensional code of BRDF tables.
//! Both leave as plain numbers that evaluate without it.

pub mod autoencoder;
mod network;
pub mod regression;
pub mod saturated;

pub use autoencoder::{Autoencoder, Encoder};
pub use network::LEAK;
pub use regression::NeuralNetwork;
pub use saturated::{Known, SaturatedDistance};
