//! A table of text that a command reads: a file, or standard input in its place.

use super::output::STANDARD;
use super::user_error;
use anyhow::Result;
use std::path::{Path, PathBuf};
use vernis::dataset::csv_table::MOST_BYTES;
use vernis_metric::io::{read_at_most, read_stream_at_most};

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
