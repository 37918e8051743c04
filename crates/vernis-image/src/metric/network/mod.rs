//! Metrics by convolutional networks, whose weights the user brings; `burn` computes them. Nothing outside this folder names it.
//!
//! Networks run on one thread, in a fixed order: the same pictures give the same bytes whatever the number of threads.

mod layers;
pub mod lpips;
pub mod matsim;
mod perceptual;
mod resize;
pub mod st_lpips;
mod tensors;

pub use lpips::{Backbone, Lpips};
pub use matsim::MatSim;
pub use st_lpips::{ShiftTolerant, StLpips};

use super::contract::{Conditions, ImageMetricError};
use super::weights::{Weights, WeightsError, WeightsFile};
use std::any::Any;
use std::sync::Arc;

/// The network of `metric`, from the user's folder at first use.
fn loaded<T: Any + Send + Sync>(
    metric: &'static str,
    files: &'static [&'static str],
    conditions: &Conditions,
    load: impl FnOnce(&Weights, &[&WeightsFile]) -> Result<T, WeightsError>,
) -> Result<Arc<T>, ImageMetricError> {
    let files: Vec<&WeightsFile> = files.iter().filter_map(|name| WeightsFile::named(name)).collect();
    let folder = conditions.weights.as_deref();
    let missing = |file: &&&WeightsFile| folder.is_none_or(|weights| file.find(weights.folder()).is_none());
    if let Some(file) = files.iter().find(missing) {
        let folder = folder.map(|weights| weights.folder().to_owned());
        return Err(ImageMetricError::NoWeights { metric, file, folder });
    }
    match folder {
        Some(weights) => Ok(weights.network(metric, || load(weights, &files))?),
        None => unreachable!("without a folder the first file is missing"),
    }
}
