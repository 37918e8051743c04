//! Groups of combinations over all pairs of a study, and the records that make a sweep resumable.

use super::combination::{Combination, Family, Transport};
use super::tables::StudyTables;
use crate::dataset::Study;
use crate::experiment::ExperimentError;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use vernis_metric::brdf::ContentHash;
use vernis_metric::io::{SealError, unseal};
use vernis_metric::metric::graph::GraphMetric;
use vernis_metric::metric::kernel::KernelMetric;
use vernis_metric::metric::transport::TransportMetric;
use vernis_metric::metric::{MetricError, Side};

/// What a combination gave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The divergences (R, G, B) of every pair, in the order of the study.
    Computed {
        /// R, G and B, one entry a pair.
        channels: Vec<[f64; 3]>,
    },
    /// The metric does not cover this combination on this grid.
    Refused {
        /// Why the metric refuses it.
        reason: String,
    },
}

/// What the files of a sweep belong to: those of another grid, accuracy or study are not taken for this one's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// Cells along theta_i, theta_o and phi_d, such as `45x45x180`.
    pub grid: String,
    /// A name of [`Accuracy::NAMES`](vernis_metric::metric::transport::Accuracy::NAMES), for transport.
    pub accuracy: String,
    /// [`fingerprint`] of the study.
    pub study: String,
}

impl Setting {
    /// The setting of a sweep over `study`, whose fingerprint is computed here.
    pub fn new(grid: &str, accuracy: &str, study: &Study) -> Self {
        let [grid, accuracy] = [grid, accuracy].map(str::to_owned);
        Self { grid, accuracy, study: fingerprint(study) }
    }

    /// In what the setting of something kept, `self`, differs from the one that is asked for; `None` where it is the same.
    pub(super) fn differences(&self, asked: &Self) -> Option<String> {
        let parts = [
            ("grid", &self.grid, &asked.grid),
            ("accuracy", &self.accuracy, &asked.accuracy),
            ("the SHA-256 of the study", &self.study, &asked.study),
        ];
        let differing = parts.into_iter().filter(|(_, found, asked)| found != asked);
        let texts: Vec<_> =
            differing.map(|(what, found, asked)| format!("{what} is {found} there and {asked} here")).collect();
        (!texts.is_empty()).then(|| texts.join(", "))
    }

    /// The notation of `combination` that computes it in this setting.
    fn notation(&self, combination: &Combination) -> String {
        match combination.family() {
            Family::Transport => {
                format!("{},accuracy={}]", combination.to_string().trim_end_matches(']'), self.accuracy)
            }
            Family::Energy => combination.to_string(),
        }
    }
}

/// The file of one combination, sealed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CombinationRecord {
    /// Notation of the combination, without gamma.
    pub metric: String,
    /// Of the metric's numbers: those of another version are computed again.
    pub version: String,
    /// What the file belongs to.
    pub setting: Setting,
    /// What the combination gave.
    pub outcome: Outcome,
}

impl CombinationRecord {
    /// The record of `combination`, with the version of its metric.
    pub fn new(combination: &Combination, setting: &Setting, outcome: Outcome) -> Self {
        let (metric, version) = (combination.to_string(), combination.version().to_owned());
        Self { metric, version, setting: setting.clone(), outcome }
    }

    /// How many pairs it holds; none where the metric refused.
    pub fn pairs(&self) -> usize {
        match &self.outcome {
            Outcome::Computed { channels } => channels.len(),
            Outcome::Refused { .. } => 0,
        }
    }

    /// In what the setting of this record differs from `setting`; `None` where it is the same.
    pub fn differences(&self, setting: &Setting) -> Option<String> {
        self.setting.differences(setting)
    }

    /// The outcome in a file's bytes; `None` where the file is of another combination, setting, version or number of pairs.
    ///
    /// # Errors
    /// A file that is damaged or was changed.
    pub fn outcome_of(
        bytes: &[u8],
        combination: &Combination,
        setting: &Setting,
        pairs: usize,
    ) -> Result<Option<Outcome>, SealError> {
        let record: Self = unseal(bytes)?;
        let whole = match &record.outcome {
            Outcome::Computed { channels } => channels.len() == pairs,
            Outcome::Refused { .. } => true,
        };
        let same = record == Self::new(combination, setting, record.outcome.clone());
        Ok((whole && same).then_some(record.outcome))
    }
}

/// Tells one study from another: a hash of its pairs and of the files that it was read from.
pub fn fingerprint(study: &Study) -> String {
    let pairs = study.pairs.iter().map(|p| format!("{}\n{}\n", p.reference.identity(), p.candidate.identity()));
    let files = study.files.iter().map(|f| format!("{} {}\n", f.name, f.content));
    ContentHash::of(pairs.chain(files).collect::<String>().as_bytes()).to_string()
}

/// What one pair gave, for every combination of a group: the divergences (R, G, B), or why the metric does not cover it.
pub type PairOutcome = Vec<Result<[f64; 3], String>>;

/// Combinations in groups that share everything but the annealing, in their order.
pub fn groups(combinations: &[Combination]) -> Vec<Vec<Combination>> {
    let shared =
        |c: &Combination| Combination { transport: c.transport.map(|t| Transport { scaling: 0.0, ..t }), ..*c };
    let mut groups: Vec<Vec<Combination>> = Vec::new();
    for combination in combinations {
        match groups.iter_mut().find(|group| shared(&group[0]) == shared(combination)) {
            Some(group) if combination.family() == Family::Transport => group.push(*combination),
            _ => groups.push(vec![*combination]),
        }
    }
    groups
}

/// The divergences of a group of combinations for every pair, those `known` excepted. Tables, curves and masses are made
/// once for the group. `done` is told of every pair that was computed, from any thread.
///
/// # Errors
/// A BRDF that cannot be read or compared, and what `done` returns; that the method does not cover a combination is an
/// [`Outcome`].
pub fn compute<E: From<ExperimentError> + Send>(
    group: &[Combination],
    setting: &Setting,
    tables: &StudyTables,
    known: &BTreeMap<usize, PairOutcome>,
    done: &(dyn Fn(usize, &PairOutcome) -> Result<(), E> + Sync),
) -> Result<Vec<Outcome>, E> {
    let members = Members::new(group, setting)?;
    let of_reference = |indices: &Vec<usize>| -> Result<Vec<(usize, PairOutcome)>, E> {
        let mut missing = indices.iter().filter(|index| !known.contains_key(index)).peekable();
        let Some(&&first) = missing.peek() else { return Ok(Vec::new()) };
        let of_pair = members.prepare(tables, first)?;
        let computed = |&index: &usize| {
            let found = of_pair(index)?;
            done(index, &found)?;
            Ok((index, found))
        };
        missing.map(computed).collect()
    };
    let by_reference = tables.by_reference();
    let mut found: BTreeMap<usize, PairOutcome> = known.clone();
    // The first reference tells whether the method covers any of the combinations at all.
    let (first, others) = by_reference.split_at(by_reference.len().min(1));
    found.extend(first.iter().map(of_reference).collect::<Result<Vec<_>, E>>()?.into_iter().flatten());
    let covered = |index: &usize| found.get(index).is_some_and(|pair| pair.iter().any(Result::is_ok));
    if first.iter().flatten().all(covered) {
        found.extend(others.par_iter().map(of_reference).collect::<Result<Vec<_>, E>>()?.into_iter().flatten());
    }
    let outcome =
        |member: usize| match found.values().map(|pair| pair[member].clone()).collect::<Result<Vec<_>, String>>() {
            Ok(channels) => Outcome::Computed { channels },
            Err(reason) => Outcome::Refused { reason },
        };
    Ok((0..group.len()).map(outcome).collect())
}

/// The metrics of a group.
enum Members {
    /// They differ in scaling alone.
    Transport(Vec<TransportMetric>),
    /// One, of another family.
    Kernel(KernelMetric),
}

/// Computes one pair of those that share a reference.
type OfPair<'a> = Box<dyn Fn(usize) -> Result<PairOutcome, ExperimentError> + 'a>;

impl Members {
    fn new(group: &[Combination], setting: &Setting) -> Result<Self, ExperimentError> {
        let named = |name: &str| {
            let name = name.to_owned();
            move |source| ExperimentError::MetricNamed { name, source: Box::new(source) }
        };
        if group.iter().all(|combination| combination.family() == Family::Transport) {
            let metric = |name: String| TransportMetric::named(&name).map_err(named(&name));
            let metrics = group.iter().map(|combination| metric(setting.notation(combination)));
            return Ok(Self::Transport(metrics.collect::<Result<_, _>>()?));
        }
        let name = setting.notation(&group[0]);
        Ok(Self::Kernel(KernelMetric::named(&name).map_err(named(&name))?))
    }

    /// Does once what depends on the reference of the pair `first` alone.
    fn prepare<'a>(&'a self, tables: &'a StudyTables, first: usize) -> Result<OfPair<'a>, ExperimentError> {
        let reference = tables.reference(first)?;
        match self {
            Self::Transport(metrics) => {
                let all = |reason: String| vec![Err(reason); metrics.len()];
                let prepared = refusal(tables, first, metrics[0].prepare_channels(&reference, Side::Reference))?;
                Ok(Box::new(move |index| {
                    let reference = match &prepared {
                        Ok(reference) => reference,
                        Err(reason) => return Ok(all(reason.clone())),
                    };
                    let table = tables.candidate(index)?;
                    match refusal(tables, index, metrics[0].prepare_channels(&table, Side::Candidate))? {
                        Ok(candidate) => {
                            let of = |metric: &TransportMetric| metric.between(reference, &candidate);
                            metrics.iter().map(|metric| refusal(tables, index, of(metric))).collect()
                        }
                        Err(reason) => Ok(all(reason)),
                    }
                }))
            }
            Self::Kernel(metric) => {
                let prepared = refusal(tables, first, metric.prepare_table(Arc::new(reference)))?;
                Ok(Box::new(move |index| match &prepared {
                    Ok(prepared) => Ok(vec![refusal(tables, index, prepared.channels(&tables.candidate(index)?))?]),
                    Err(reason) => Ok(vec![Err(reason.clone())]),
                }))
            }
        }
    }
}

/// Tells the combination's fault, the inner error, from the pair's.
fn refusal<T>(
    tables: &StudyTables,
    index: usize,
    found: Result<T, MetricError>,
) -> Result<Result<T, String>, ExperimentError> {
    match found {
        Ok(found) => Ok(Ok(found)),
        Err(MetricError::NotComputed { reason, .. } | MetricError::TooWide { reason, .. }) => Ok(Err(reason)),
        Err(source) => {
            let (reference, candidate) = tables.notations(index);
            Err(ExperimentError::Metric { reference, candidate, source: Box::new(source) })
        }
    }
}
