//! What of every known study is in a data folder, and where to get the rest.

use super::manifest::{Collection, Manifest, NAMES, PinnedFile};
use super::verify::Checked;
pub use super::verify::FileState;
use super::{Completeness, Study, synthetic};
use serde::Serialize;
use std::path::Path;

/// A pinned file of a study.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct FileStatus {
    /// In the data folder.
    pub path: String,
    /// What the file is for, in words.
    pub role: String,
    /// The study loads without it.
    pub optional: bool,
    /// Whether it is there, and as published.
    pub state: FileState,
    /// SHA-256 of the file that is there.
    pub found_sha256: Option<String>,
    /// SHA-256 that the manifest pins.
    pub published_sha256: String,
    /// Licence, as the manifest states it.
    pub licence: String,
    /// Where to get it.
    pub origin: String,
}

/// Files too many to list one by one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CollectionStatus {
    /// What the files are and where they belong, in words.
    pub what: String,
    /// Licence, as the manifest states it.
    pub licence: String,
    /// Where to get them.
    pub origin: String,
    /// Size in bytes, where the manifest states it.
    pub bytes: Option<u64>,
    /// Algorithm and digits, such as `md5 7141af4c12b4c4feed299769260b3604`.
    pub checksum: Option<String>,
}

/// One line of `vernis data list`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StudyStatus {
    /// Name of the study.
    pub name: String,
    /// Title of the publication, or one line about the study.
    pub title: String,
    /// DOI of the publication.
    pub doi: Option<String>,
    /// Ratings come from simulated observers.
    pub synthetic: bool,
    /// How many of its rated pairs are there.
    pub pairs: Completeness,
    /// The pinned files.
    pub files: Vec<FileStatus>,
    /// What the study needs besides its pinned files.
    pub collections: Vec<CollectionStatus>,
    /// Why the study cannot be loaded from this folder; `None` when it can.
    pub problem: Option<String>,
}

impl StudyStatus {
    /// `Study::load` succeeds on this folder.
    pub fn loads(&self) -> bool {
        self.problem.is_none()
    }
}

/// Every known study and how much of it is in `data`. Reads the pinned files to check them; downloads nothing.
pub fn inventory(data: Option<&Path>) -> Vec<StudyStatus> {
    NAMES.iter().map(|name| published_status(name, data)).chain([synthetic_status()]).collect()
}

fn synthetic_status() -> StudyStatus {
    StudyStatus {
        name: synthetic::NAME.into(),
        title: synthetic::TITLE.into(),
        doi: None,
        synthetic: true,
        pairs: Completeness { found: synthetic::PAIRS, known: synthetic::PAIRS },
        files: Vec::new(),
        collections: Vec::new(),
        problem: None,
    }
}

fn published_status(name: &str, data: Option<&Path>) -> StudyStatus {
    let loaded = Study::load(name, data);
    // A manifest that does not parse is the problem that loading reports.
    let manifest = Manifest::embedded(name).ok();
    let m = manifest.as_ref();
    StudyStatus {
        name: name.into(),
        title: m.map_or_else(String::new, |m| m.title().into()),
        doi: m.map(|m| m.doi().into()),
        synthetic: false,
        pairs: Completeness {
            found: loaded.as_ref().map_or(0, |s| s.completeness.found),
            known: m.map_or(0, Manifest::pairs),
        },
        files: m.map_or_else(Vec::new, |m| m.files().into_iter().map(|f| file_status(f, data)).collect()),
        collections: m.map_or_else(Vec::new, |m| m.collections().iter().map(collection_status).collect()),
        problem: loaded.err().map(|e| e.to_string()),
    }
}

fn file_status(pinned: &PinnedFile, data: Option<&Path>) -> FileStatus {
    let checked = data.map(|d| Checked::of(pinned, d, &mut |_| ()));
    let found_sha256 = checked.as_ref().and_then(|c| c.found).map(|f| f.sha256.to_string());
    let state = checked.map_or(FileState::Missing, |c| c.state);
    FileStatus {
        path: pinned.path.clone(),
        role: pinned.role.clone(),
        optional: pinned.optional,
        state,
        found_sha256,
        published_sha256: pinned.sha256.clone(),
        licence: pinned.licence.clone(),
        origin: pinned.origin(),
    }
}

fn collection_status(c: &Collection) -> CollectionStatus {
    CollectionStatus {
        what: c.what.clone(),
        licence: c.licence.clone(),
        origin: c.origin(),
        bytes: c.bytes,
        checksum: c.checksum.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn without_a_folder_only_the_embedded_study_loads() {
        let all = inventory(None);
        assert_eq!(all.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), Study::known());
        let loads: Vec<&str> = all.iter().filter(|s| s.loads()).map(|s| s.name.as_str()).collect();
        assert_eq!(loads, [synthetic::NAME]);
        assert!(all.iter().all(|s| s.pairs.known > 0 && s.pairs.found == if s.synthetic { s.pairs.known } else { 0 }));
    }

    #[test]
    fn a_file_that_is_not_the_published_one_says_so() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir_all(dir.path().join("lavoue2021")).unwrap();
        for file in ["PerceptualDistances.csv", "MaterialType.csv"] {
            fs::write(dir.path().join("lavoue2021").join(file), "something else").unwrap();
        }
        let full = published_status("lavoue2021", Some(dir.path()));
        let states: Vec<&FileState> = full.files.iter().map(|f| &f.state).collect();
        assert_eq!(states, [&FileState::Extract, &FileState::Different]);
        assert!(!full.loads() && full.pairs.found == 0);
        let open = published_status("lavoue2021-open", Some(dir.path()));
        assert!(open.files.iter().skip(2).all(|f| f.state == FileState::Missing));
    }
}
