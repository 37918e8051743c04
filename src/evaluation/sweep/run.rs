//! One combination over all pairs of a study, and the record that makes a sweep resumable.

use super::super::EvaluationError;
use super::combination::Combination;
use super::tables::StudyTables;
use crate::brdf::ContentHash;
use crate::dataset::Study;
use crate::metric::MetricError;
use crate::metric::registry::Registry;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Raised when a divergence changes: files of older versions are computed again.
const VERSION: u32 = 1;

/// What a combination gave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The divergences (R, G, B) of every pair, in the order of the study.
    Computed { channels: Vec<[f64; 3]> },
    /// The metric does not cover this combination on this grid.
    Refused { reason: String },
}

/// The file of one combination.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CombinationRecord {
    pub metric: String,
    pub grid: String,
    /// Of the study's pairs and files: a file of another study is not taken for this one's.
    pub study: String,
    pub version: u32,
    pub outcome: Outcome,
}

impl CombinationRecord {
    /// `study` is [`fingerprint`].
    pub fn new(combination: &Combination, grid: &str, study: &str, outcome: Outcome) -> Self {
        Self {
            metric: combination.to_string(),
            grid: grid.to_owned(),
            study: study.to_owned(),
            version: VERSION,
            outcome,
        }
    }

    /// The outcome in a file's bytes, if they are whole and of this combination, grid, study and version.
    pub fn outcome_of(
        bytes: &[u8],
        combination: &Combination,
        grid: &str,
        study: &str,
        pairs: usize,
    ) -> Option<Outcome> {
        let record: Self = serde_json::from_slice(bytes).ok()?;
        let whole = match &record.outcome {
            Outcome::Computed { channels } => channels.len() == pairs,
            Outcome::Refused { .. } => true,
        };
        let same = record == Self::new(combination, grid, study, record.outcome.clone());
        (whole && same).then_some(record.outcome)
    }
}

/// Tells one study from another: a hash of its pairs and of the files that it was read from.
pub fn fingerprint(study: &Study) -> String {
    let pairs = study.pairs.iter().map(|p| format!("{}\n{}\n", p.reference.identity(), p.candidate.identity()));
    let files = study.files.iter().map(|f| format!("{} {}\n", f.name, f.content));
    ContentHash::of(pairs.chain(files).collect::<String>().as_bytes()).to_string()
}

/// The divergences of `combination` for every pair; `progress` is called once a pair, from any thread.
///
/// # Errors
/// A BRDF that cannot be read or compared; that the method does not cover the combination is an [`Outcome`].
pub fn compute(
    combination: &Combination,
    registry: &Registry,
    tables: &StudyTables,
    progress: &(dyn Fn() + Sync),
) -> Result<Outcome, EvaluationError> {
    let failed = |index: usize| {
        let (reference, candidate) = tables.notations(index);
        move |source: MetricError| EvaluationError::Metric { reference, candidate, source: Box::new(source) }
    };
    let metric = registry.get(&combination.to_string()).map_err(failed(0))?;
    let graph = metric.as_graph().ok_or_else(|| EvaluationError::UnknownMetric {
        name: combination.to_string(),
        judged: "metrics on graphs".to_owned(),
    })?;
    let of_pair = |index: usize| {
        let (reference, candidate) = tables.pair(index)?;
        let channels = graph.channels(&reference, &candidate);
        progress();
        match channels {
            Ok(channels) => Ok(Ok(channels)),
            // The combination's fault, not the pair's.
            Err(MetricError::NotComputed { reason, .. }) => Ok(Err(reason)),
            Err(other) => Err(failed(index)(other)),
        }
    };
    // The first pair tells whether the method covers the combination at all.
    let first = match of_pair(0)? {
        Ok(channels) => channels,
        Err(reason) => return Ok(Outcome::Refused { reason }),
    };
    let rest = (1..tables.len()).into_par_iter().map(of_pair).collect::<Result<Vec<_>, EvaluationError>>()?;
    Ok(match std::iter::once(Ok(first)).chain(rest).collect::<Result<Vec<_>, String>>() {
        Ok(channels) => Outcome::Computed { channels },
        Err(reason) => Outcome::Refused { reason },
    })
}
