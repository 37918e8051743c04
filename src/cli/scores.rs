//! `--scores`: distances that somebody computed elsewhere, judged beside the metrics of vernis.

use super::user_error;
use crate::dataset::Study;
use crate::experiment::external::ExternalScores;
use anyhow::Result;
use clap::Args;
use std::path::{Path, PathBuf};

/// A table of distances.
#[derive(Args)]
pub struct ScoresArgs {
    /// A CSV file of distances that were computed elsewhere, each judged as any metric is. Its columns are `reference` and
    /// `candidate`, or `material` and `method`, as in the study, then one a metric. It has one row for every rated pair. Larger is
    /// worse.
    #[arg(long, value_name = "CSV")]
    scores: Option<PathBuf>,
    /// A column of --scores whose larger values mean a better match, such as a similarity; may be given several times.
    #[arg(long, value_name = "NAME", requires = "scores")]
    higher_is_better: Vec<String>,
}

impl ScoresArgs {
    /// The file.
    pub fn file(&self) -> Option<&Path> {
        self.scores.as_deref()
    }

    /// The distances of the rated pairs of `study`, checked.
    pub fn load(&self, study: &Study) -> Result<Option<ExternalScores>> {
        let load = |path| ExternalScores::load(path, study, &self.higher_is_better).map_err(user_error);
        self.file().map(load).transpose()
    }
}
