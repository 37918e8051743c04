//! What a run says of itself: the command that makes it again, the versions of what computed it, and what its metric reached.

use super::external::ExternalScores;
use super::train::{BenchmarkOptions, Purpose, RESAMPLES, default_folds, folds_of};
use crate::dataset::{DeclaredScale, Study};
use crate::evaluation::records::{BenchmarkRecord, RowSet, Split};
use crate::train::recipe;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use vernis_metric::descriptor::{DescriptorOptions, VERSION};
use vernis_metric::metric::Metric;
use vernis_metric::metric::learned::exported::Reached;

/// The name of the study's file, without its folder.
pub(super) fn file_name(study: &Study) -> String {
    Path::new(&study.name).file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The option that declares the scale of a file's ratings, where they are not 1 to 5.
pub(super) fn scale_option(study: &Study) -> String {
    if study.scale.is_grades() { String::new() } else { format!(" --scale {}", DeclaredScale::of_scale(study.scale)) }
}

/// What to type for the same bytes: without folders, which do not matter.
pub(super) fn command_line(
    purpose: Purpose,
    source: &str,
    study: &Study,
    options: &BenchmarkOptions,
    setup: &str,
) -> String {
    let mut line = format!("vernis {} {source} --seed {}", purpose.command(), options.seed);
    let folds = (folds_of(options, study), default_folds(study));
    for (flag, (value, default)) in [("folds", folds), ("resamples", (options.resamples, RESAMPLES))] {
        if value != default {
            line += &format!(" --{flag} {value}");
        }
    }
    if options.variants {
        line += " --variants";
    }
    line += &options.further.arguments();
    line.extend(options.scores.as_ref().map(ExternalScores::arguments));
    if options.descriptors != DescriptorOptions::default() {
        line += &format!(" ({setup})");
    }
    line
}

/// Versions of the program, the descriptors, the recipe, and each family of metrics.
pub(super) fn versions(setup: &str, metrics: &[Arc<dyn Metric>]) -> BTreeMap<String, String> {
    let mut versions: BTreeMap<String, String> =
        metrics.iter().map(|metric| (metric.properties().family.to_owned(), metric.version().to_owned())).collect();
    versions.extend(
        [
            ("vernis", env!("CARGO_PKG_VERSION").to_owned()),
            ("descriptors", format!("{VERSION} ({setup})")),
            ("metric", recipe::METRIC_VERSION.to_owned()),
        ]
        .map(|(name, version)| (name.to_owned(), version)),
    );
    versions
}

/// Versions of the numbers of every metric that is judged.
pub(super) fn metric_versions(metrics: &[Arc<dyn Metric>]) -> BTreeMap<String, String> {
    let classical = metrics.iter().map(|metric| (metric.name().to_owned(), metric.version().to_owned()));
    let learned = [recipe::NAME, recipe::LOSS_NAME].map(|name| (name.to_owned(), recipe::METRIC_VERSION.to_owned()));
    classical.chain(learned).collect()
}

/// The headline figures of a learned metric.
pub(super) fn reached(record: &BenchmarkRecord, name: &str) -> Vec<Reached> {
    let Some(metric) = record.metric(name) else { return Vec::new() };
    let mut asked = vec![
        (Split::UnseenMaterial, RowSet::All),
        (Split::UnseenMaterial, RowSet::WithoutSetAside),
        (Split::UnseenMaterialAndMethod, RowSet::All),
    ];
    for set in record.named_row_sets().into_iter().skip(1) {
        asked.extend([Split::UnseenMaterial, Split::UnseenMaterialAndMethod].map(|split| (split, set.clone())));
    }
    let mut found = Vec::new();
    for (split, row_set) in asked {
        let rows = match &row_set {
            RowSet::All => split.label().to_owned(),
            set => format!("{}, {}", split.label(), record.rows_in_words(set)),
        };
        let Some(judgement) = metric.judgement(split, row_set) else { continue };
        let (agreement, intervals) = (&judgement.agreement, &judgement.intervals);
        for (measure, value, interval) in
            [("plcc", agreement.plcc, intervals.plcc), ("srocc", agreement.srocc, intervals.srocc)]
        {
            found.push(Reached {
                measure: measure.to_owned(),
                rows: rows.clone(),
                value,
                low: interval.low,
                high: interval.high,
            });
        }
    }
    found
}
