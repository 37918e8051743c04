//! The pairs of a group of combinations that are done, while the group is not: a line of JSON each, so that a sweep that is
//! killed loses the pairs in hand and no more.

use super::{Combination, PairOutcome, Setting};
use crate::experiment::ExperimentError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use vernis_metric::io::write_atomically;

/// The first line.
#[derive(PartialEq, Serialize, Deserialize)]
struct Header {
    setting: Setting,
    metrics: Vec<String>,
}

/// The other lines.
#[derive(Serialize, Deserialize)]
struct Line {
    pair: usize,
    found: PairOutcome,
}

/// The journal of one group.
pub struct Journal {
    path: PathBuf,
    known: BTreeMap<usize, PairOutcome>,
    file: Mutex<File>,
}

impl Journal {
    /// Takes up the journal at `path`; one of another group or setting begins anew. A line that was cut off is left out.
    pub fn open(path: PathBuf, group: &[Combination], setting: &Setting) -> Result<Self, ExperimentError> {
        let header = Header { setting: setting.clone(), metrics: group.iter().map(Combination::to_string).collect() };
        let text = fs::read_to_string(&path).unwrap_or_default();
        let mut lines = text.lines();
        let same = lines.next().and_then(|line| serde_json::from_str::<Header>(line).ok()).is_some_and(|h| h == header);
        let lines = lines.filter(|_| same).map_while(|line| serde_json::from_str::<Line>(line).ok());
        let known: BTreeMap<_, _> =
            lines.filter(|line| line.found.len() == group.len()).map(|line| (line.pair, line.found)).collect();
        let mut whole = line(&header)?;
        for (&pair, found) in &known {
            whole += &line(&Line { pair, found: found.clone() })?;
        }
        let written = write_atomically(&path, whole.as_bytes());
        let opened = written.and_then(|()| OpenOptions::new().append(true).open(&path));
        let file = opened.map_err(|e| failed(&path, "written", &e))?;
        Ok(Self { path, known, file: Mutex::new(file) })
    }

    /// What was there.
    pub fn known(&self) -> &BTreeMap<usize, PairOutcome> {
        &self.known
    }

    pub fn keep(&self, pair: usize, found: &PairOutcome) -> Result<(), ExperimentError> {
        let line = line(&Line { pair, found: found.clone() })?;
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(line.as_bytes()).map_err(|e| failed(&self.path, "written", &e))
    }

    /// The group is done.
    pub fn remove(self) -> Result<(), ExperimentError> {
        fs::remove_file(&self.path).map_err(|e| failed(&self.path, "removed", &e))
    }
}

fn line(content: &impl Serialize) -> Result<String, ExperimentError> {
    let text = serde_json::to_string(content).map_err(|e| ExperimentError::Write { reason: e.to_string() })?;
    Ok(text + "\n")
}

fn failed(path: &Path, what: &str, cause: &std::io::Error) -> ExperimentError {
    ExperimentError::Write { reason: format!("{}: cannot be {what}: {cause}", path.display()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_journal_that_was_cut_off_is_taken_up_and_that_of_others_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.journal");
        let group = Combination::of_study()[..2].to_vec();
        let study = crate::dataset::Study::load(crate::dataset::synthetic::NAME, None).unwrap();
        let setting = Setting::new("3x3x8", "coarse", &study);
        let found: PairOutcome = vec![Ok([1.0, 0.5, 1e-300]), Err("a test".to_owned())];
        let open = |group: &[Combination], setting: &Setting| Journal::open(path.clone(), group, setting).unwrap();
        let journal = open(&group, &setting);
        assert!(journal.known().is_empty());
        journal.keep(3, &found).unwrap();
        journal.keep(1, &found).unwrap();
        drop(journal);
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() - 9]).unwrap();
        // Opening writes what is left once more: a second cut loses nothing else.
        for _ in 0..2 {
            assert_eq!(*open(&group, &setting).known(), BTreeMap::from([(3, found.clone())]));
        }
        assert!(open(&group, &Setting::new("3x3x8", "fast", &study)).known().is_empty());
        let journal = open(&group[..1], &setting);
        assert!(journal.known().is_empty());
        journal.remove().unwrap();
        assert!(!path.exists());
    }
}
