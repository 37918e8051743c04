//! How agreement is judged out of fold: options that experiments share.

use super::limits;
use clap::Args;

/// Folds, resamples and the seed of both.
#[derive(Args)]
pub struct Judging {
    /// Cross-validation folds, by material: 2 to the number of groups of materials.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = limits::folds)]
    pub folds: usize,
    /// Bootstrap resamples of materials, 40 to 20000.
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = limits::resamples)]
    pub resamples: usize,
    /// Seed of folds, training and resamples.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = limits::seed)]
    pub seed: u64,
}
