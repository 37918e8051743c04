//! How a file of raw ratings is written: which of its columns means what.
//!
//! ```toml
//! file = "export.csv"          # beside the TOML file
//! delimiter = ";"              # default: found by the names of the columns
//! reference_method = "GROUND"  # the method of hidden references; default: REFERENCE
//! scale = {worst = 0, best = 100}   # see [`super::scale`]; default: 1 (very poor) to 5 (excellent)
//! [columns]                    # those that are not named keep their name; other columns of the file are ignored
//! participant = "worker_id"
//! score = "answer"
//! ```
//!
//! The manifest of a study may have the same table, `[raw_ratings]`, with a file of the data folder.

use super::opinions::REFERENCE;
use super::raw_ratings::{OPTIONAL, REQUIRED};
use super::{DatasetError, DeclaredScale};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use vernis_metric::io::read_at_most;

/// Far more than a layout needs.
const MOST_BYTES: u64 = 1 << 20;

/// How a file of raw ratings is written.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawLayout {
    /// The CSV file, in the folder of whatever states the layout.
    #[serde(default)]
    pub file: String,
    /// Separator of the fields; found by the names of the columns where nothing is stated.
    #[serde(default)]
    pub delimiter: Option<char>,
    /// The method of hidden references, as the file names it.
    #[serde(default = "reference")]
    pub reference_method: String,
    /// The scale of the scores, where it is declared.
    pub scale: Option<DeclaredScale>,
    /// Names in the file of the columns of [`super::raw_ratings`], where they differ.
    #[serde(default)]
    pub columns: BTreeMap<String, String>,
    /// Columns that have no meaning here are ignored.
    #[serde(skip, default = "yes")]
    pub ignore_others: bool,
}

fn reference() -> String {
    REFERENCE.into()
}

fn yes() -> bool {
    true
}

impl Default for RawLayout {
    /// The columns of [`super::raw_ratings`] under their own names and no other one.
    fn default() -> Self {
        Self {
            file: String::new(),
            delimiter: None,
            reference_method: reference(),
            scale: None,
            columns: BTreeMap::new(),
            ignore_others: false,
        }
    }
}

impl RawLayout {
    /// The layout and the CSV file that `path` stands for: a `.toml` states both, any other file is read as it is.
    pub fn of(path: &Path) -> Result<(Self, PathBuf), DatasetError> {
        if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
            return Ok((Self::default(), path.into()));
        }
        let unreadable = |reason: String| DatasetError::Unreadable { path: path.into(), reason };
        let bytes = read_at_most(path, MOST_BYTES).map_err(|e| unreadable(e.to_string()))?;
        let text = String::from_utf8(bytes).map_err(|e| unreadable(e.to_string()))?;
        let layout: Self = toml::from_str(&text).map_err(|e| unreadable(e.to_string().trim().replace('\n', " ")))?;
        if layout.file.is_empty() {
            return Err(unreadable("`file` is missing; it must be the name of a CSV file beside it".into()));
        }
        layout.check().map_err(unreadable)?;
        let csv = path.parent().unwrap_or(Path::new("")).join(&layout.file);
        Ok((layout, csv))
    }

    /// What is wrong with the layout.
    pub fn check(&self) -> Result<(), String> {
        let known = || REQUIRED.iter().chain(&OPTIONAL);
        if let Some(column) = self.columns.keys().find(|c| !known().any(|k| k == c)) {
            let allowed = known().copied().collect::<Vec<_>>().join(", ");
            return Err(format!("columns: a key is `{column}`; it must be one of {allowed}"));
        }
        if let Some(delimiter) = self.delimiter.filter(|delimiter| !delimiter.is_ascii()) {
            return Err(format!("delimiter is `{delimiter}`; it must be one ASCII character"));
        }
        Ok(())
    }

    /// The file's name of a column.
    pub fn column<'a>(&'a self, name: &'a str) -> &'a str {
        self.columns.get(name).map_or(name, String::as_str)
    }
}
