//! The recipe of the exported metric: which descriptors, which models, how many members.
//!
//! The mean of a kernel model on landmarks and of an ensemble of small networks, both exact for identical BRDFs. Kernel
//! ridge regression on all rows agrees as well, but stores as many weights as there are ratings, so that the ratings
//! could be solved for; landmarks and networks cannot give them back. What each part is worth is in the benchmark.

use super::ensemble::Average;
use super::kernel::KernelRidge;
use super::neural::NeuralNetwork;
use super::{Predictor, TrainError, Trainer};
use crate::samples::split::TrainingSet;
use vernis_metric::descriptor::Column;
use vernis_metric::descriptor::Family;

/// Name of the learned metric in a benchmark.
pub const NAME: &str = "vernis";
/// Version of the recipe; raise it, with a line in the changelog, whenever it changes what is exported.
pub const METRIC_VERSION: &str = "1.1";
/// Models of an exported metric that were trained on resampled materials.
pub const MEMBERS: usize = 16;
/// Resampled models a fold, for calibrating the interval.
pub const CALIBRATION_MEMBERS: usize = 6;
/// Landmarks of the kernel model, fewer than a third of the ratings of the open study.
const LANDMARKS: usize = 128;
/// Weight of a pair with reference and candidate exchanged: how alike two materials look is said to be the same either way,
/// but the study never showed it that way.
const EXCHANGED_WEIGHT: f64 = 0.15;

/// Whether the metric uses a column: the families of the extended set.
pub fn uses(column: &Column) -> bool {
    Family::EXTENDED.iter().any(|f| f.name() == column.family)
}

/// A trainer that also learns from the pairs with reference and candidate exchanged.
pub struct Exchanged<T> {
    /// Name of the trainer with exchanged pairs.
    pub name: String,
    /// What learns from the doubled rows.
    pub trainer: T,
    /// Of an exchanged pair, against its original.
    pub weight: f64,
}

impl<T: Trainer> Trainer for Exchanged<T> {
    fn name(&self) -> &str {
        &self.name
    }

    fn train(&self, set: &TrainingSet, seed: u64) -> Result<Box<dyn Predictor>, TrainError> {
        self.trainer.train(&set.with_swapped(self.weight), seed)
    }
}

/// Names of the parts, whose mean the metric is.
pub const PARTS: [&str; 2] = ["landmark-kernel", "neural-network"];

/// Passes over the doubled rows: as many steps as 150 over the originals.
const EPOCHS: usize = 75;

/// The kernel part.
pub fn kernel() -> Exchanged<KernelRidge> {
    let trainer = KernelRidge::nystroem(LANDMARKS);
    Exchanged { name: PARTS[0].to_owned(), trainer, weight: EXCHANGED_WEIGHT }
}

/// The kernel part without exchanged pairs: trains in a tenth of a second.
pub fn plain_kernel() -> KernelRidge {
    KernelRidge::nystroem(LANDMARKS)
}

fn networks(name: &str, members: usize) -> Exchanged<NeuralNetwork> {
    let trainer = NeuralNetwork { members, epochs: EPOCHS, ..NeuralNetwork::default() };
    Exchanged { name: name.to_owned(), trainer, weight: EXCHANGED_WEIGHT }
}

/// The network part.
pub fn network() -> Exchanged<NeuralNetwork> {
    networks(PARTS[1], NeuralNetwork::default().members)
}

/// The metric.
pub fn metric() -> Average {
    Average { name: NAME.to_owned(), trainers: vec![Box::new(kernel()), Box::new(network())] }
}

/// One member: a single network. Landmark weights are linear in the ratings, so those of a few resampled kernel models
/// together would give the ratings back; networks do not.
pub fn member() -> Exchanged<NeuralNetwork> {
    networks("member", 1)
}
