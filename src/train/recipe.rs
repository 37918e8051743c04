//! The recipe of the exported metric: which descriptors, which models, how many members.
//!
//! The mean of a kernel model on landmarks and of an ensemble of small networks, both exact for identical BRDFs. Kernel
//! ridge regression on all rows agrees as well, but stores as many weights as there are ratings, so that the ratings
//! could be solved for; landmarks and networks cannot give them back. What each part is worth is in the benchmark.

use super::Trainer;
use super::ensemble::Average;
use super::kernel::KernelRidge;
use super::neural::NeuralNetwork;
use crate::dataset::samples::Column;
use crate::descriptor::Family;

/// Name of the learned metric in a benchmark.
pub const NAME: &str = "vernis";
/// Version of the recipe; raise it, with a line in the changelog, whenever it changes what is exported.
pub const METRIC_VERSION: &str = "1";
/// Models of an exported metric that were trained on resampled materials.
pub const MEMBERS: usize = 16;
/// Resampled models a fold, for calibrating the interval.
pub const CALIBRATION_MEMBERS: usize = 6;
/// Landmarks of the kernel model, fewer than a third of the ratings of the open study.
const LANDMARKS: usize = 128;

/// Whether the metric uses a column: the families of the compact set.
pub fn uses(column: &Column) -> bool {
    [Family::Lights, Family::Slot, Family::Angular, Family::Context].iter().any(|f| f.name() == column.family)
}

fn average(name: &str, landmarks: usize, network: NeuralNetwork) -> Average {
    let trainers: Vec<Box<dyn Trainer>> = vec![Box::new(kernel(landmarks)), Box::new(network)];
    Average { name: name.to_owned(), trainers }
}

fn kernel(landmarks: usize) -> KernelRidge {
    KernelRidge::nystroem(landmarks)
}

/// The metric.
pub fn metric() -> Average {
    average(NAME, LANDMARKS, NeuralNetwork::default())
}

/// One member: a single network. Landmark weights are linear in the ratings, so those of a few resampled kernel models
/// together would give the ratings back; networks do not.
pub fn member() -> NeuralNetwork {
    NeuralNetwork { members: 1, ..NeuralNetwork::default() }
}

/// The kernel part alone, for ablations: it trains in a fraction of a second.
pub fn ablation() -> KernelRidge {
    kernel(LANDMARKS)
}
