//! A table of text that a command reads: a file, or standard input in its place.

use super::output::STANDARD;
use super::user_error;
use crate::dataset::csv_table::{CsvTable, MOST_BYTES};
use anyhow::Result;
use std::path::{Path, PathBuf};
use vernis_metric::io::{read_at_most, read_stream_at_most, shown};

/// Its bytes, and what it is called in messages.
pub struct Table {
    pub name: PathBuf,
    /// Where the relative paths in it start.
    pub folder: PathBuf,
    pub bytes: Vec<u8>,
}

impl Table {
    /// Of the file at `path`, or of standard input where that is `-`.
    pub fn read(path: &Path) -> Result<Self> {
        let (name, folder, bytes) = if path == Path::new(STANDARD) {
            let bytes = read_stream_at_most(std::io::stdin().lock(), MOST_BYTES);
            (PathBuf::from("standard input"), PathBuf::new(), bytes)
        } else {
            let folder = path.parent().unwrap_or(Path::new("")).to_owned();
            (path.to_owned(), folder, read_at_most(path, MOST_BYTES))
        };
        let bytes = bytes.map_err(|e| user_error(format!("{}: {e}", name.display())))?;
        Ok(Self { name, folder, bytes })
    }
}

/// The place of the column `name` of `table`, which `of` is the name of and which must have the columns `needed`.
pub fn column(table: &CsvTable, of: &Path, name: &str, needed: &[&str]) -> Result<usize> {
    /// Columns that a message tells, and characters of each.
    const SHOWN: [usize; 2] = [20, 50];
    table.column(of, name).map_err(user_error)?.ok_or_else(|| {
        let found: Vec<_> = table.written().iter().take(SHOWN[0]).map(|h| shown(h, SHOWN[1])).collect();
        let found = match found.concat().is_empty() {
            true => "there are no names of columns".to_owned(),
            false => format!("the columns are {}", found.join(", ")),
        };
        user_error(format!("{}, line 1: no column `{name}`; {found}; needed are {}", of.display(), needed.join(", ")))
    })
}
