//! Numbers by rated pair: a CSV file with one row for every rated pair of a study, such as the distances of a metric.
//!
//! A row is named by the columns `reference` and `candidate` as the study names its BRDFs, or by `material` and `method`.

use super::csv_study::source_beside;
use super::csv_table::{CsvTable, Expected, MOST_BYTES, Others};
use super::{DatasetError, RatedPair, Study, StudyFile};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use vernis_metric::brdf::{BrdfSource, ContentHash};
use vernis_metric::io::{did_you_mean, nearest, read_at_most};

/// The pairs of columns that name a row, the first that is there.
const KEYS: [[&str; 2]; 2] = [["reference", "candidate"], ["material", "method"]];
/// Columns that are no numbers of a metric: those of a study, and those that `vernis score` adds.
const NO_NUMBERS: [&str; 12] = [
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

/// What an empty cell of a column of numbers is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Empty {
    /// An error.
    Refused,
    /// A value that is not known, as `vernis score` writes it.
    Unknown,
}

/// A file of numbers by rated pair.
pub struct PairTable {
    path: PathBuf,
    table: CsvTable,
    /// Place and name of each column of numbers.
    columns: Vec<(usize, String)>,
}

impl PairTable {
    /// The file at `path`, and its content for provenance.
    ///
    /// # Errors
    /// A file that cannot be read; those of [`PairTable::parse`].
    pub fn load(path: &Path) -> Result<(Self, StudyFile), DatasetError> {
        let unreadable = |e: std::io::Error| DatasetError::Unreadable { path: path.into(), reason: e.to_string() };
        let bytes = read_at_most(path, MOST_BYTES).map_err(unreadable)?;
        let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let file = StudyFile { name, content: ContentHash::of(&bytes), as_published: None };
        Ok((Self::parse(path, &bytes)?, file))
    }

    /// The same of its bytes.
    ///
    /// # Errors
    /// No table, no column of numbers, or two of one name; case does not count.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, DatasetError> {
        let is_number = |name: &str| !NO_NUMBERS.contains(&name);
        let expected =
            Expected { known: &NO_NUMBERS, is_number: &is_number, others: Others::Kept, delimiter: None, usual: b',' };
        let table = CsvTable::read(path, bytes, &expected)?;
        let columns = number_columns(path, &table)?;
        let mut known = BTreeSet::new();
        match columns.iter().find(|(_, name)| !known.insert(name.to_lowercase())) {
            None => Ok(Self { path: path.to_owned(), table, columns }),
            Some((_, name)) => {
                Err(wrong(path, 1, &format!("column `{name}`"), "given twice", "given once; case does not count"))
            }
        }
    }

    /// The names of the columns of numbers, at least one.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|(_, name)| name.as_str())
    }

    /// The other columns, without those that name the rows.
    pub fn ignored(&self) -> Vec<&str> {
        let is_ignored = |(column, name): &(usize, &str)| {
            !KEYS.as_flattened().contains(name) && !self.columns.iter().any(|(number, _)| number == column)
        };
        self.table.header().iter().enumerate().filter(is_ignored).map(|(_, name)| name).collect()
    }

    /// The values of each column, one a rated pair of `study`, in its order.
    ///
    /// # Errors
    /// Rows that the study lacks, that are there twice, or that are missing; values that are not finite.
    pub fn values(&self, study: &Study, empty: Empty) -> Result<Vec<Vec<Option<f64>>>, DatasetError> {
        let (path, table) = (self.path.as_path(), &self.table);
        let places = Keys::of(path, table, study)?.places(path, table, study)?;
        let column = |(column, name): &(usize, String)| {
            let mut values = vec![None; study.pairs.len()];
            for ((line, row), pairs) in table.rows().iter().zip(&places) {
                let text = &row[*column];
                if text.is_empty() && empty == Empty::Unknown {
                    continue;
                }
                let value = text.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(|| {
                    let found = if text.is_empty() { "empty".to_owned() } else { format!("`{text}`") };
                    wrong(path, *line, name, found, "a finite number in every row")
                })?;
                pairs.iter().for_each(|&pair| values[pair] = Some(value));
            }
            Ok(values)
        };
        self.columns.iter().map(column).collect()
    }
}

/// A wrong field of a line of such a file.
pub fn wrong(path: &Path, line: u64, name: &str, found: impl Into<String>, allowed: impl Into<String>) -> DatasetError {
    let (found, allowed) = (found.into(), allowed.into());
    DatasetError::Field { path: path.into(), line, field: name.into(), found, allowed }
}

/// Place and name of every column of numbers. A column without any, such as one of notes, is none.
fn number_columns(path: &Path, table: &CsvTable) -> Result<Vec<(usize, String)>, DatasetError> {
    let holds_numbers = |column: usize| {
        let mut cells = table.rows().iter().map(|(_, row)| &row[column]).filter(|text| !text.is_empty()).peekable();
        cells.peek().is_none() || cells.any(|text| text.parse::<f64>().is_ok())
    };
    let mut found: Vec<(usize, String)> = Vec::new();
    for (column, name) in table.header().iter().enumerate().filter(|(_, name)| !NO_NUMBERS.contains(name)) {
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
