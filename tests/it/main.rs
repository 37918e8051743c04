//! The one integration binary: each room's tests are a module.

mod browser;
mod cli;
mod data;
mod dataset;
mod evaluation;
#[cfg(feature = "train")]
mod extract;
mod fit;
mod learned;
mod losses;
mod old_files;
mod report;
mod rooms;
mod shipped;
mod study;
mod sweep;
#[cfg(feature = "train")]
mod train;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::SystemTime;

/// The files of a folder that end in `ending`, and when each was written; none where there is no folder.
fn files_of(folder: &Path, ending: &str) -> BTreeMap<String, SystemTime> {
    let Ok(entries) = fs::read_dir(folder) else { return BTreeMap::new() };
    let entry = |entry: fs::DirEntry| {
        let name = entry.file_name().into_string().ok()?;
        // A file may be renamed while we look.
        let time = entry.metadata().ok()?.modified().ok()?;
        (name.ends_with(ending) && !name.starts_with('.')).then_some((name, time))
    };
    entries.filter_map(|e| entry(e.ok()?)).collect()
}
