//! The pairs of a group of combinations that are done, while the group is not: a sealed line of JSON each, so that a sweep that is
//! killed loses the pairs in hand and no more, and a line that was changed is computed again.

use super::{Combination, PairOutcome, Setting};
use crate::experiment::ExperimentError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use vernis_metric::io::{read_at_most, seal, unseal, write_atomically};

/// Hundreds of times what a journal takes.
const MOST_BYTES: u64 = 1 << 30;

/// The first line.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    setting: Setting,
    /// Name and version of each.
    metrics: Vec<(String, String)>,
}

/// The other lines.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    pair: usize,
    found: PairOutcome,
}

/// The journal of one group.
pub struct Journal {
    path: PathBuf,
    known: BTreeMap<usize, PairOutcome>,
    warnings: Vec<String>,
    file: Mutex<File>,
}

impl Journal {
    /// Takes up the journal at `path`; one of another group or version of a metric begins anew. Lines that do not match
    /// their seals are left out, with a warning, except a last line that was cut off.
    ///
    /// # Errors
    /// The file belongs to another setting ([`ExperimentError::Kept`]), or cannot be written.
    pub fn open(path: PathBuf, group: &[Combination], setting: &Setting) -> Result<Self, ExperimentError> {
        let named = |combination: &Combination| (combination.to_string(), combination.version().to_owned());
        let header = Header { setting: setting.clone(), metrics: group.iter().map(named).collect() };
        let bytes = read_at_most(&path, MOST_BYTES).unwrap_or_default();
        let (known, warnings) = read(&bytes, &header, &path)?;
        let mut whole = line(&header)?;
        for (&pair, found) in &known {
            whole += &line(&Line { pair, found: found.clone() })?;
        }
        let written = write_atomically(&path, whole.as_bytes());
        let opened = written.and_then(|()| OpenOptions::new().append(true).open(&path));
        let file = opened.map_err(|e| failed(&path, "written", &e))?;
        Ok(Self { path, known, warnings, file: Mutex::new(file) })
    }

    /// What was there.
    pub fn known(&self) -> &BTreeMap<usize, PairOutcome> {
        &self.known
    }

    /// What was there and could not be used.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// # Errors
    /// The file cannot be written.
    pub fn keep(&self, pair: usize, found: &PairOutcome) -> Result<(), ExperimentError> {
        let line = line(&Line { pair, found: found.clone() })?;
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(line.as_bytes()).map_err(|e| failed(&self.path, "written", &e))
    }

    /// The group is done.
    ///
    /// # Errors
    /// The file cannot be removed.
    pub fn remove(self) -> Result<(), ExperimentError> {
        fs::remove_file(&self.path).map_err(|e| failed(&self.path, "removed", &e))
    }
}

/// The pairs of a journal, by their places, and what is wrong with other lines.
type Found = (BTreeMap<usize, PairOutcome>, Vec<String>);

/// What a journal with that header holds.
fn read(bytes: &[u8], header: &Header, path: &Path) -> Result<Found, ExperimentError> {
    let (mut known, mut warnings) = (BTreeMap::new(), Vec::new());
    let mut lines = bytes.split_inclusive(|b| *b == b'\n');
    let place = path.display();
    match lines.next().map(unseal::<Header>) {
        None => return Ok((known, warnings)),
        Some(Ok(found)) if found == *header => {}
        Some(Ok(found)) => match found.setting.differences(&header.setting) {
            Some(differences) => return Err(ExperimentError::Kept { path: path.to_owned(), differences }),
            // Of another group or version: nothing in it is of use.
            None => return Ok((known, warnings)),
        },
        Some(Err(e)) => {
            warnings.push(format!("{place}, line 1: {e}; the group is computed again"));
            return Ok((known, warnings));
        }
    }
    for (number, text) in lines.enumerate() {
        match unseal::<Line>(text) {
            Ok(line) if line.found.len() == header.metrics.len() => drop(known.insert(line.pair, line.found)),
            // The run was killed while it wrote.
            Err(_) if !text.ends_with(b"\n") => {}
            Ok(_) => {
                warnings.push(format!("{place}, line {}: not of this group; the pair is computed again", number + 2))
            }
            Err(e) => warnings.push(format!("{place}, line {}: {e}; the pair is computed again", number + 2)),
        }
    }
    Ok((known, warnings))
}

fn line(content: &impl Serialize) -> Result<String, ExperimentError> {
    let text = seal(content).map_err(|e| ExperimentError::Write { reason: e.to_string() })?;
    Ok(text + "\n")
}

fn failed(path: &Path, what: &str, cause: &std::io::Error) -> ExperimentError {
    ExperimentError::Write { reason: format!("{}: cannot be {what}: {cause}", path.display()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn group() -> Vec<Combination> {
        Combination::of_study()[..2].to_vec()
    }

    fn setting(accuracy: &str) -> Setting {
        let study = crate::dataset::Study::load(crate::dataset::synthetic::NAME, None).unwrap();
        Setting::new("3x3x8", accuracy, &study)
    }

    fn found() -> PairOutcome {
        vec![Ok([1.0, 0.5, 1e-300]), Err("a test".to_owned())]
    }

    /// A journal with the pairs 3 and 1.
    fn with_two_pairs(path: &Path, setting: &Setting) {
        let journal = Journal::open(path.to_owned(), &group(), setting).unwrap();
        assert!(journal.known().is_empty());
        journal.keep(3, &found()).unwrap();
        journal.keep(1, &found()).unwrap();
    }

    #[test]
    fn a_journal_that_was_cut_off_is_taken_up_and_that_of_others_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.journal");
        let setting_of = setting("coarse");
        let open = |group: &[Combination], setting: &Setting| Journal::open(path.clone(), group, setting).unwrap();
        with_two_pairs(&path, &setting_of);
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() - 9]).unwrap();
        // Opening writes what is left once more: a second cut loses nothing else.
        for _ in 0..2 {
            let journal = open(&group(), &setting_of);
            assert_eq!(*journal.known(), BTreeMap::from([(3, found())]));
            assert!(journal.warnings().is_empty());
        }
        let bytes = fs::read(&path).unwrap();
        let error = Journal::open(path.clone(), &group(), &setting("fast")).err().unwrap().to_string();
        assert!(error.contains("is the result of another run: accuracy is coarse there and fast here"), "{error}");
        assert_eq!(fs::read(&path).unwrap(), bytes);
        let journal = open(&group()[..1], &setting_of);
        assert!(journal.known().is_empty());
        journal.remove().unwrap();
        assert!(!path.exists());
    }

    #[test]
    fn a_line_that_was_changed_is_named_and_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.journal");
        let setting = setting("coarse");
        with_two_pairs(&path, &setting);
        let text = fs::read_to_string(&path).unwrap();
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        lines[1] = lines[1].replace("0.5", "0.6");
        fs::write(&path, lines.join("\n") + "\n").unwrap();
        let journal = Journal::open(path.clone(), &group(), &setting).unwrap();
        assert_eq!(*journal.known(), BTreeMap::from([(1, found())]));
        let warning = &journal.warnings()[0];
        assert!(
            warning.ends_with("a.journal, line 2: its content does not match its seal; the pair is computed again"),
            "{warning}"
        );
        // A journal of before seals, or of another program, is named as well.
        fs::write(&path, "{\"setting\": {}}\n").unwrap();
        let journal = Journal::open(path.clone(), &group(), &setting).unwrap();
        assert!(journal.known().is_empty() && journal.warnings()[0].contains("line 1: it cannot be read"));
    }
}
