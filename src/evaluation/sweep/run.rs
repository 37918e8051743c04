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
use std::borrow::Cow;
use std::collections::BTreeMap;

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

/// The divergences of a pair, or why the metric does not cover the combination.
type Channels = Result<[f64; 3], String>;

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
    // The combination's fault, not the pair's.
    let sort = |index: usize, found: Result<[f64; 3], MetricError>| match found {
        Ok(channels) => Ok(Ok(channels)),
        Err(MetricError::NotComputed { reason, .. }) => Ok(Err(reason)),
        Err(other) => Err(failed(index)(other)),
    };
    // The first pair tells whether the method covers the combination at all.
    if let Err(reason) = sort(0, graph.channels(&tables.reference(0)?, &tables.candidate(0)?))? {
        return Ok(Outcome::Refused { reason });
    }
    let of_reference = |indices: &Vec<usize>| -> Result<Vec<(usize, Channels)>, EvaluationError> {
        let prepared = match graph.prepare_table(Cow::Owned(tables.reference(indices[0])?)) {
            Ok(prepared) => prepared,
            Err(MetricError::NotComputed { reason, .. }) => return Ok(vec![(indices[0], Err(reason))]),
            Err(other) => return Err(failed(indices[0])(other)),
        };
        let of_pair = |&index: &usize| {
            let found = sort(index, prepared.channels(&tables.candidate(index)?))?;
            progress();
            Ok((index, found))
        };
        indices.iter().map(of_pair).collect()
    };
    let groups = tables.by_reference();
    let found = groups.par_iter().map(of_reference).collect::<Result<Vec<_>, EvaluationError>>()?;
    let found: BTreeMap<usize, Channels> = found.into_iter().flatten().collect();
    Ok(match found.into_values().collect::<Result<Vec<_>, String>>() {
        Ok(channels) => Outcome::Computed { channels },
        Err(reason) => Outcome::Refused { reason },
    })
}
