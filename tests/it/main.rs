//! The one integration binary: each room's tests are a module.

#[cfg(unix)]
mod attack;
mod browser;
mod cli;
mod compare_images;
mod data;
mod dataset;
mod evaluation;
#[cfg(feature = "train")]
mod external;
#[cfg(feature = "train")]
mod extract;
mod fit;
#[cfg(feature = "train")]
mod further;
mod gallery;
mod inputs;
mod landscape;
mod learned;
mod losses;
mod old_files;
mod optimizers;
mod output;
#[cfg(feature = "train")]
mod plan;
mod readme;
mod render;
mod report;
mod rooms;
mod score;
mod shipped;
mod study;
mod sweep;
#[cfg(feature = "train")]
mod train;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
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

// So that a change of the variable makes the tests anew: those that need data are ignored where it is not set.
const _: Option<&str> = option_env!("VERNIS_DATA");

/// The folder with published data.
fn data_folder() -> PathBuf {
    let folder = PathBuf::from(std::env::var_os("VERNIS_DATA").expect("VERNIS_DATA names the data folder"));
    assert!(folder.is_dir(), "VERNIS_DATA names {}, which is no folder", folder.display());
    folder
}

/// Where data must be there, tests that need them are not merely ignored.
#[test]
fn data_are_there_where_they_are_required() {
    if std::env::var_os("VERNIS_REQUIRE_DATA").is_some_and(|required| required == "1") {
        assert!(
            option_env!("VERNIS_DATA").is_some(),
            "VERNIS_REQUIRE_DATA is 1, but VERNIS_DATA was not set at compile time"
        );
        data_folder();
    }
}
