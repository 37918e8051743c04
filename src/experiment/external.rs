//! Distances that somebody computed elsewhere, for the rated pairs of a study: a paper's new metric takes part in the benchmark
//! without a line of Rust.
//!
//! A CSV file has one row for every rated pair, named by the columns `reference` and `candidate` as the study names its BRDFs, or by
//! `material` and `method`. Every other column of numbers is a metric. Larger is worse, unless the metric is named as one whose
//! larger values are better; its numbers are then negated. Every metric is judged as the classical ones are: its logistic map is
//! fitted on the training side of each fold, and its difference to the learned metric is paired.

use super::{ExperimentError, contenders, plan, train};
use crate::dataset::pair_table::{Empty, PairTable, wrong};
use crate::dataset::{DatasetError, RatedPair, Study, StudyFile, notice};
use crate::evaluation::protocol::{Contender, Source};
use crate::evaluation::records::MetricKind;
use crate::samples::{Samples, SamplesError};
use ndarray::Array2;
use std::collections::BTreeSet;
use std::path::Path;
use vernis_metric::descriptor::{Column, Role};
use vernis_metric::io::{did_you_mean, nearest, shown};

/// What the metrics are called in a family of their own.
const FAMILY: &str = "external";

/// A metric whose distances were computed elsewhere.
#[derive(Debug, Clone, PartialEq)]
pub struct ExternalMetric {
    /// The name of its column.
    pub name: String,
    /// Whether its numbers were negated, for larger ones were better.
    pub negated: bool,
    /// One a rated pair, in the order of the study; larger is worse.
    pub distances: Vec<f64>,
}

/// Distances of the rated pairs of one study, from a file.
#[derive(Debug, Clone)]
pub struct ExternalScores {
    /// The file.
    pub file: StudyFile,
    /// At least one.
    pub metrics: Vec<ExternalMetric>,
}

impl ExternalScores {
    /// Those in the file at `path` for the rated pairs of `study`; `better` names the columns whose larger values are better. No
    /// BRDF is read.
    ///
    /// # Errors
    /// A file that cannot be read; rows that the study lacks, that are there twice, or that are missing; values that are not
    /// finite or the same in every row; a name that another metric has; a name of `better` that no column has.
    pub fn load(path: &Path, study: &Study, better: &[String]) -> Result<Self, ExperimentError> {
        let (table, file) = PairTable::load(path)?;
        let taken = contenders::names(&train::metrics(study)?);
        check_names(path, &table, better, &taken)?;
        tell(path, &table, better);
        Ok(Self { file, metrics: read(path, &table, study, better)? })
    }

    /// The distances as columns beside the descriptors.
    pub(super) fn samples(&self, study: &Study) -> Result<Samples, SamplesError> {
        let column =
            |m: &ExternalMetric| Column { name: m.name.clone(), family: FAMILY.into(), role: Role::Difference };
        let shape = (study.pairs.len(), self.metrics.len());
        let features = Array2::from_shape_fn(shape, |(row, metric)| self.metrics[metric].distances[row]);
        let rows = study.pairs.iter().map(RatedPair::row).collect();
        Samples::new(self.metrics.iter().map(column).collect(), rows, features)
    }

    /// Each metric, with its distances in `samples`.
    pub(super) fn contenders<'a>(&'a self, samples: &'a Samples) -> impl Iterator<Item = Contender<'a>> {
        self.metrics.iter().map(move |metric| Contender {
            name: metric.name.clone(),
            kind: MetricKind::External,
            note: match metric.negated {
                false => format!("computed elsewhere, read from {}", self.file.name),
                true => format!("computed elsewhere, read from {}; larger is better, so it is negated", self.file.name),
            },
            source: Source::Distance(samples),
        })
    }

    /// What a version of the numbers can be: the content of their file.
    pub(super) fn versions(&self) -> impl Iterator<Item = (String, String)> {
        let version = format!("sha256 {}", &self.file.content.to_string()[..12]);
        self.metrics.iter().map(move |metric| (metric.name.clone(), version.clone()))
    }

    /// What to type for the same distances, without folders.
    pub(super) fn arguments(&self) -> String {
        let negated = self.metrics.iter().filter(|m| m.negated).map(|m| format!(" --higher-is-better {}", m.name));
        format!(" --scores {}{}", self.file.name, negated.collect::<String>())
    }
}

fn read(path: &Path, table: &PairTable, study: &Study, better: &[String]) -> Result<Vec<ExternalMetric>, DatasetError> {
    let metric = |(name, values): (&str, Vec<Option<f64>>)| {
        let negated = better.iter().any(|better| better == name);
        // No cell is empty.
        let distances: Vec<f64> =
            values.into_iter().flatten().map(|value| if negated { -value } else { value }).collect();
        check_spread(path, name, &distances, study)?;
        Ok(ExternalMetric { name: name.to_owned(), negated, distances })
    };
    table.names().zip(table.values(study, Empty::Refused)?).map(metric).collect()
}

/// Tells which columns are taken for metrics, and which are not.
fn tell(path: &Path, table: &PairTable, better: &[String]) {
    let shown = |name: &str| format!("`{}`", shown(name, 100));
    let judged = table.names().map(|name| {
        let sense = if better.iter().any(|better| better == name) { "better" } else { "worse" };
        format!("{} (larger is {sense})", shown(name))
    });
    let mut text = format!("{}: judged as metrics: {}", path.display(), judged.collect::<Vec<_>>().join(", "));
    let others: Vec<String> = table.ignored().into_iter().map(shown).collect();
    if !others.is_empty() {
        text += &format!("; ignored: {}", others.join(", "));
    }
    notice::tell(&text);
}

fn check_names(path: &Path, table: &PairTable, better: &[String], taken: &[String]) -> Result<(), DatasetError> {
    let taken: BTreeSet<String> = taken.iter().map(|name| name.to_lowercase()).collect();
    for name in table.names() {
        if taken.contains(&name.to_lowercase()) {
            let allowed = "another name: a metric of that name takes part already";
            return Err(wrong(path, 1, "a column", format!("`{name}`"), allowed));
        }
    }
    let known: Vec<&str> = table.names().collect();
    match better.iter().find(|name| !known.contains(&name.as_str())) {
        None => Ok(()),
        Some(name) => {
            let meant = did_you_mean(&nearest(name, &known));
            let allowed = format!("a column of this file, one of {}; {meant}", known.join(", "));
            Err(wrong(path, 1, "--higher-is-better", format!("`{name}`"), allowed))
        }
    }
}

/// That a metric says something of the rows that are judged.
fn check_spread(path: &Path, name: &str, distances: &[f64], study: &Study) -> Result<(), DatasetError> {
    let aside = |pair: &RatedPair| plan::SET_ASIDE.contains(&pair.method_family.as_str());
    let constant = |kept: &dyn Fn(&RatedPair) -> bool| {
        let mut values = study.pairs.iter().zip(distances).filter(|(pair, _)| kept(pair)).map(|(_, value)| *value);
        values.next().filter(|first| values.all(|value| value == *first))
    };
    let all = constant(&|_| true).map(|value| (value, "every row"));
    let rest = || constant(&|pair| !aside(pair)).map(|value| (value, "every row that is not of a manifold or a table"));
    match all.or_else(rest) {
        None => Ok(()),
        Some((value, rows)) => {
            let allowed = "different for different pairs, or else there is nothing to judge";
            Err(wrong(path, 1, name, format!("{value} in {rows}"), allowed))
        }
    }
}
