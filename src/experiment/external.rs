//! Distances that somebody computed elsewhere, for the rated pairs of a study: a paper's new metric takes part in the benchmark
//! without a line of Rust.
//!
//! A CSV file has one row for every rated pair, named by the columns `reference` and `candidate` as the study names its BRDFs, or by
//! `material` and `method`. Every other column of numbers is a metric. Larger is worse, unless the metric is named as one whose
//! larger values are better; its numbers are then negated. Every metric is judged as the classical ones are: its logistic map is
//! fitted on the training side of each fold, and its difference to the learned metric is paired.

use super::{ExperimentError, contenders, plan, train};
use crate::dataset::csv_study::source_beside;
use crate::dataset::csv_table::{CsvTable, Expected, MOST_BYTES, Others};
use crate::dataset::{DatasetError, RatedPair, Study, StudyFile, notice};
use crate::evaluation::protocol::{Contender, Source};
use crate::evaluation::records::MetricKind;
use crate::samples::{Samples, SamplesError};
use ndarray::Array2;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use vernis_metric::brdf::{BrdfSource, ContentHash};
use vernis_metric::descriptor::{Column, Role};
use vernis_metric::io::{did_you_mean, nearest, read_at_most, shown};

/// What the metrics are called in a family of their own.
const FAMILY: &str = "external";
/// The pairs of columns that name a row, the first that is there.
const KEYS: [[&str; 2]; 2] = [["reference", "candidate"], ["material", "method"]];
/// Columns that are no metric: those of a study, and those that `vernis score` adds.
const NO_METRIC: [&str; 12] = [
    "reference",
    "candidate",
    "material",
    "method",
    "group",
    "method_family",
    "material_type",
    "weight",
    "mos",
    "mos_low",
    "mos_high",
    "reason",
];

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
        let unreadable = |e: std::io::Error| DatasetError::Unreadable { path: path.into(), reason: e.to_string() };
        let bytes = read_at_most(path, MOST_BYTES).map_err(unreadable)?;
        let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let file = StudyFile { name, content: ContentHash::of(&bytes), as_published: None };
        let taken = contenders::names(&train::metrics(study)?);
        Ok(Self { file, metrics: read(path, &bytes, study, better, &taken)? })
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

fn wrong(path: &Path, line: u64, name: &str, found: impl Into<String>, allowed: impl Into<String>) -> DatasetError {
    let (found, allowed) = (found.into(), allowed.into());
    DatasetError::Field { path: path.into(), line, field: name.into(), found, allowed }
}

fn read(
    path: &Path,
    bytes: &[u8],
    study: &Study,
    better: &[String],
    taken: &[String],
) -> Result<Vec<ExternalMetric>, DatasetError> {
    let is_number = |name: &str| !NO_METRIC.contains(&name);
    let expected =
        Expected { known: &NO_METRIC, is_number: &is_number, others: Others::Kept, delimiter: None, usual: b',' };
    let table = CsvTable::read(path, bytes, &expected)?;
    let metrics = metric_columns(path, &table)?;
    check_names(path, &metrics, better, taken)?;
    tell(path, &table, &metrics, better);
    let places = Keys::of(path, &table, study)?.places(path, &table, study)?;
    let metric = |(column, name): &(usize, String)| {
        let negated = better.contains(name);
        let mut distances = vec![0.0; study.pairs.len()];
        for ((line, row), pairs) in table.rows().iter().zip(&places) {
            let text = &row[*column];
            let value = text.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(|| {
                let found = if text.is_empty() { "empty".to_owned() } else { format!("`{text}`") };
                wrong(path, *line, name, found, "a finite number in every row")
            })?;
            pairs.iter().for_each(|&pair| distances[pair] = if negated { -value } else { value });
        }
        check_spread(path, name, &distances, study)?;
        Ok(ExternalMetric { name: name.clone(), negated, distances })
    };
    metrics.iter().map(metric).collect()
}

/// Place and name of every column of numbers. A column without any, such as one of notes, is none.
fn metric_columns(path: &Path, table: &CsvTable) -> Result<Vec<(usize, String)>, DatasetError> {
    let holds_numbers = |column: usize| {
        let mut cells = table.rows().iter().map(|(_, row)| &row[column]).filter(|text| !text.is_empty()).peekable();
        cells.peek().is_none() || cells.any(|text| text.parse::<f64>().is_ok())
    };
    let mut found: Vec<(usize, String)> = Vec::new();
    for (column, name) in table.header().iter().enumerate().filter(|(_, name)| !NO_METRIC.contains(name)) {
        // Dataframes call the column of their row numbers `Unnamed: 0`, or not at all.
        if !name.is_empty() && !name.starts_with("Unnamed:") && holds_numbers(column) {
            found.push((column, name.to_owned()));
        }
    }
    if found.is_empty() {
        let columns = table.written().iter().collect::<Vec<_>>().join(", ");
        let allowed = "reference and candidate, or material and method, and at least one column of numbers a metric";
        return Err(wrong(path, 1, "the header", format!("`{columns}`"), allowed));
    }
    Ok(found)
}

/// Tells which columns are taken for metrics, and which are not.
fn tell(path: &Path, table: &CsvTable, metrics: &[(usize, String)], better: &[String]) {
    let shown = |name: &str| format!("`{}`", shown(name, 100));
    let judged = metrics.iter().map(|(_, name)| {
        let sense = if better.contains(name) { "better" } else { "worse" };
        format!("{} (larger is {sense})", shown(name))
    });
    let mut text = format!("{}: judged as metrics: {}", path.display(), judged.collect::<Vec<_>>().join(", "));
    let is_other = |(column, name): &(usize, &str)| {
        !KEYS.as_flattened().contains(name) && !metrics.iter().any(|(metric, _)| metric == column)
    };
    let others: Vec<String> = table.header().iter().enumerate().filter(is_other).map(|(_, name)| shown(name)).collect();
    if !others.is_empty() {
        text += &format!("; ignored: {}", others.join(", "));
    }
    notice::tell(&text);
}

fn check_names(
    path: &Path,
    metrics: &[(usize, String)],
    better: &[String],
    taken: &[String],
) -> Result<(), DatasetError> {
    let taken: BTreeSet<String> = taken.iter().map(|name| name.to_lowercase()).collect();
    let mut own = BTreeSet::new();
    for (_, name) in metrics {
        if taken.contains(&name.to_lowercase()) {
            let allowed = "another name: a metric of that name takes part already";
            return Err(wrong(path, 1, "a column", format!("`{name}`"), allowed));
        }
        if !own.insert(name.to_lowercase()) {
            return Err(wrong(path, 1, &format!("column `{name}`"), "given twice", "given once; case does not count"));
        }
    }
    let known: Vec<&str> = metrics.iter().map(|(_, name)| name.as_str()).collect();
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

/// By which columns the rows of a file are the pairs of a study.
struct Keys {
    names: [&'static str; 2],
    columns: [usize; 2],
}

impl Keys {
    fn of(path: &Path, table: &CsvTable, study: &Study) -> Result<Self, DatasetError> {
        for names in KEYS {
            if let [Some(first), Some(second)] = [table.column(path, names[0])?, table.column(path, names[1])?] {
                let keys = Self { names, columns: [first, second] };
                if names == KEYS[1] {
                    check_methods(path, study)?;
                }
                return Ok(keys);
            }
        }
        let columns = table.written().iter().collect::<Vec<_>>().join(", ");
        let allowed = "one with the columns reference and candidate, or material and method, as in the study";
        Err(wrong(path, 1, "the header", format!("`{columns}`"), allowed))
    }

    /// The pairs of every row: those that show the same BRDFs, if reference and candidate are named.
    fn places(&self, path: &Path, table: &CsvTable, study: &Study) -> Result<Vec<Vec<usize>>, DatasetError> {
        let index = Index::of(study, self.names == KEYS[0]);
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut lines: BTreeMap<usize, u64> = BTreeMap::new();
        let mut found = Vec::with_capacity(table.rows().len());
        for (line, row) in table.rows() {
            let cells = self.columns.map(|column| &row[column]);
            let pairs = index.find(study, cells, folder);
            let shown = || format!("`{}`, `{}`", cells[0], cells[1]);
            let Some(&first) = pairs.first() else {
                let meant = did_you_mean(&index.nearest(cells));
                let allowed =
                    format!("{} and {} of a rated pair of {}; {meant}", self.names[0], self.names[1], study.name);
                return Err(wrong(path, *line, "the row", shown(), allowed));
            };
            if let Some(before) = lines.insert(first, *line) {
                let found = format!("{} again, as on line {before}", shown());
                return Err(wrong(path, *line, "the row", found, "given once"));
            }
            found.push(pairs);
        }
        let covered: BTreeSet<usize> = found.iter().flatten().copied().collect();
        let missing: Vec<&RatedPair> =
            study.pairs.iter().enumerate().filter(|(i, _)| !covered.contains(i)).map(|(_, pair)| pair).collect();
        match missing.first() {
            None => Ok(found),
            Some(pair) => Err(DatasetError::Content {
                place: path.display().to_string(),
                found: format!(
                    "has no row for {} of the {} rated pairs of {}",
                    missing.len(),
                    study.pairs.len(),
                    study.name
                ),
                allowed: format!(
                    "it must have one for each; the first that is missing is {}, {} (material {}, method {})",
                    pair.reference.notation(),
                    pair.candidate.notation(),
                    pair.material,
                    pair.method
                ),
            }),
        }
    }
}

/// That material and method name one pair.
fn check_methods(path: &Path, study: &Study) -> Result<(), DatasetError> {
    let mut seen = BTreeSet::new();
    match study.pairs.iter().find(|pair| !seen.insert((&pair.material, &pair.method))) {
        None => Ok(()),
        Some(pair) => Err(DatasetError::Content {
            place: path.display().to_string(),
            found: "names its rows by material and method".to_owned(),
            allowed: format!(
                "{} has several pairs of {}, {}: name them by reference and candidate",
                study.name, pair.material, pair.method
            ),
        }),
    }
}

/// The pairs of a study by their names.
struct Index {
    by_text: BTreeMap<[String; 2], Vec<usize>>,
    /// By the files that the notations lead to, where rows are named by BRDFs.
    by_place: Option<BTreeMap<[String; 2], Vec<usize>>>,
}

impl Index {
    fn of(study: &Study, by_brdfs: bool) -> Self {
        let texts = |pair: &RatedPair| match by_brdfs {
            true => [pair.reference.notation().to_owned(), pair.candidate.notation().to_owned()],
            false => [pair.material.clone(), pair.method.clone()],
        };
        let collect = |key: &dyn Fn(&RatedPair) -> [String; 2]| {
            let mut index: BTreeMap<[String; 2], Vec<usize>> = BTreeMap::new();
            study.pairs.iter().enumerate().for_each(|(i, pair)| index.entry(key(pair)).or_default().push(i));
            index
        };
        let places = |pair: &RatedPair| [placed(&pair.reference), placed(&pair.candidate)];
        Self { by_text: collect(&texts), by_place: by_brdfs.then(|| collect(&places)) }
    }

    /// As written; else by the files that are meant; else by the ends of the study's paths.
    fn find(&self, study: &Study, cells: [&str; 2], folder: &Path) -> Vec<usize> {
        if let Some(found) = self.by_text.get(&cells.map(str::to_owned)) {
            return found.clone();
        }
        let Some(by_place) = &self.by_place else { return Vec::new() };
        let [first, second] = cells.map(|cell| source_beside(folder, cell).ok());
        if let (Some(reference), Some(candidate)) = (&first, &second)
            && let Some(found) = by_place.get(&[placed(reference), placed(candidate)])
        {
            return found.clone();
        }
        let ends = |source: &BrdfSource, cell: &str| {
            let rest = source.notation().strip_suffix(cell);
            !cell.is_empty() && rest.is_some_and(|rest| rest.is_empty() || rest.ends_with(['/', '\\']))
        };
        let alike = |pair: &RatedPair| ends(&pair.reference, cells[0]) && ends(&pair.candidate, cells[1]);
        let places: Vec<usize> = (0..study.pairs.len()).filter(|&i| alike(&study.pairs[i])).collect();
        let distinct: BTreeSet<[String; 2]> = places
            .iter()
            .map(|&i| [&study.pairs[i].reference, &study.pairs[i].candidate].map(|s| s.identity()))
            .collect();
        if distinct.len() == 1 { places } else { Vec::new() }
    }

    /// Names of the study like those of a row.
    fn nearest(&self, cells: [&str; 2]) -> Vec<String> {
        let joined = |key: &[String; 2]| key.join(", ");
        nearest(&cells.join(", "), self.by_text.keys().map(joined))
    }
}

/// A source by where its file lies; as written where there is none.
fn placed(source: &BrdfSource) -> String {
    let notation = source.notation();
    let located = source.locate(None).ok().flatten().and_then(|path: PathBuf| {
        // What follows the path: a material, overrides.
        let rest = notation.strip_prefix(&*path.to_string_lossy())?.to_owned();
        Some(format!("{}{rest}", path.canonicalize().ok()?.display()))
    });
    located.unwrap_or_else(|| notation.to_owned())
}
