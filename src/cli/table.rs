//! A table of text that a command reads: a file, or standard input in its place.

use super::output::STANDARD;
use super::user_error;
use anyhow::Result;
use std::io::Read;
use std::path::{Path, PathBuf};
use vernis::dataset::csv_table::MOST_BYTES;
use vernis_metric::io::read_at_most;

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
        if path == Path::new(STANDARD) {
            let mut bytes = Vec::new();
            let read = std::io::stdin().lock().take(MOST_BYTES + 1).read_to_end(&mut bytes);
            let read = read.map_err(|e| user_error(format!("standard input: {e}")))?;
            if read as u64 > MOST_BYTES {
                return Err(user_error(format!(
                    "standard input has more than {MOST_BYTES} bytes; it must have at most that"
                )));
            }
            return Ok(Self { name: PathBuf::from("standard input"), folder: PathBuf::new(), bytes });
        }
        let bytes = read_at_most(path, MOST_BYTES).map_err(|e| user_error(format!("{}: {e}", path.display())))?;
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Ok(Self { name: path.to_owned(), folder, bytes })
    }
}
