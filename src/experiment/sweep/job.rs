//! The whole sweep: computes what is missing, keeps it as files, and judges all.

use super::{
    Combination, CombinationRecord, Journal, Outcome, PairOutcome, Setting, StudyTables, SweepProtocol, SweepRecord,
    compute, groups, judge,
};
use crate::dataset::Study;
use crate::experiment::ExperimentError;
use std::fs;
use std::path::{Path, PathBuf};
use vernis_metric::io::{Count, FolderLock, Observer, Progress, read_at_most, seal, unseal, write_atomically};
use vernis_metric::metric::graph::GraphGrid;

/// Hundreds of times what a combination takes.
const MOST_BYTES: u64 = 1 << 30;

/// What is swept, and how.
#[derive(Debug, Clone)]
pub struct SweepOptions {
    /// Folder that relative sources are looked up in.
    pub data: Option<PathBuf>,
    /// Where each combination that is done is kept as a file; a sweep that was interrupted goes on from there.
    pub folder: PathBuf,
    /// What is computed and judged, in order.
    pub combinations: Vec<Combination>,
    /// Cells that are compared.
    pub grid: GraphGrid,
    /// Of transport: a name of [`Accuracy::NAMES`](vernis_metric::metric::transport::Accuracy::NAMES).
    pub accuracy: String,
    /// Bytes for tables; tables beyond it are made again for every combination.
    pub memory: usize,
    /// Only so many pairs, which [`Study::thinned`] chooses; all where it is `None`. The report says so.
    pub pairs: Option<usize>,
    /// Without it, only what is kept already is judged.
    pub compute: bool,
    /// How the combinations are judged.
    pub protocol: SweepProtocol,
}

/// A sweep, as far as it came.
#[derive(Debug, Clone)]
pub struct Swept {
    /// The agreement of everything that is done.
    pub record: SweepRecord,
    /// Combinations that are done.
    pub done: usize,
    /// Kept files and lines that were damaged, changed or of another version, and were computed again.
    pub warnings: Vec<String>,
}

/// Computes the combinations that are not kept yet, and judges all.
///
/// # Errors
/// Files that are the results of another study ([`ExperimentError::Kept`]); BRDFs that cannot be read or compared, files that cannot be
/// written, a folder into which another process writes, ratings that cannot be judged;
/// [`ExperimentError::NothingKept`] where nothing is kept and nothing shall be computed.
pub fn sweep(study: &Study, options: &SweepOptions, progress: Observer<'_>) -> Result<Swept, ExperimentError> {
    let rated = study.pairs.len();
    let study = &study.clone().thinned(options.pairs.unwrap_or(rated));
    study.validate(options.protocol.folds)?;
    let setting = Setting::new(&options.grid.to_string(), &options.accuracy, study);
    let job = Job { study, options, setting: &setting, progress };
    let mut warnings = Vec::new();
    let outcomes = job.outcomes(&mut warnings)?;
    if outcomes.is_empty() {
        let (folder, asked) = (options.folder.clone(), options.combinations.len());
        return Err(ExperimentError::NothingKept { folder, asked });
    }
    let rows: Vec<_> = study.pairs.iter().map(|p| p.row()).collect();
    let record = judge(&study.short_name(), &setting, &rows, &outcomes, options.protocol)?;
    let record = SweepRecord { rated, ..record };
    Ok(Swept { record, done: outcomes.len(), warnings })
}

struct Job<'a> {
    study: &'a Study,
    options: &'a SweepOptions,
    setting: &'a Setting,
    progress: Observer<'a>,
}

impl Job<'_> {
    fn path(&self, combination: &Combination, kind: &str) -> PathBuf {
        let Setting { accuracy, grid, .. } = self.setting;
        self.options.folder.join(format!("{}-{accuracy}-{grid}.{kind}", combination.slug()))
    }

    /// What an earlier run has left of a combination.
    fn kept(&self, combination: &Combination, warnings: &mut Vec<String>) -> Result<Option<Outcome>, ExperimentError> {
        let path = self.path(combination, "json");
        let Ok(bytes) = read_at_most(&path, MOST_BYTES) else { return Ok(None) };
        let mut again = |reason: String| {
            warnings.push(format!("{}: {reason}; the combination is computed again", path.display()));
            Ok(None)
        };
        let found = CombinationRecord::outcome_of(&bytes, combination, self.setting, self.study.pairs.len());
        match found {
            Ok(Some(outcome)) => return Ok(Some(outcome)),
            Ok(None) => {}
            Err(e) => return again(e.to_string()),
        }
        let Ok(record) = unseal::<CombinationRecord>(&bytes) else { return Ok(None) };
        if let Some(differences) = record.differences(self.setting) {
            return Err(ExperimentError::Kept { path, differences });
        }
        let (found, asked) = (&record.version, combination.version());
        again(match found == asked {
            true => format!("it is of {} and {} pairs", record.metric, record.pairs()),
            false => format!("the version of {combination} is {found} there and {asked} here"),
        })
    }

    /// What every combination gave: read where an earlier run has left it, computed and kept elsewhere.
    fn outcomes(&self, warnings: &mut Vec<String>) -> Result<Vec<(Combination, Outcome)>, ExperimentError> {
        let combinations = &self.options.combinations;
        let mut outcomes: Vec<(Combination, Outcome)> = Vec::new();
        let mut missing: Vec<Combination> = Vec::new();
        for combination in combinations {
            match self.kept(combination, warnings)? {
                Some(outcome) => outcomes.push((*combination, outcome)),
                None => missing.push(*combination),
            }
        }
        if !missing.is_empty() && self.options.compute {
            outcomes.extend(self.compute(&missing, warnings)?);
        }
        let place = |c: &Combination| combinations.iter().position(|other| other == c);
        outcomes.sort_by_key(|(combination, _)| place(combination));
        Ok(outcomes)
    }

    fn compute(
        &self,
        missing: &[Combination],
        warnings: &mut Vec<String>,
    ) -> Result<Vec<(Combination, Outcome)>, ExperimentError> {
        let SweepOptions { data, folder, grid, memory, .. } = self.options;
        fs::create_dir_all(folder).map_err(|e| unwritable(folder, &e))?;
        // Two sweeps would write one journal.
        let _lock = FolderLock::acquire(folder)?;
        // A run that was killed between its last result and the end of its journal left the journal.
        for kept in self.options.combinations.iter().filter(|combination| !missing.contains(combination)) {
            let journal = self.path(kept, "journal");
            match fs::remove_file(&journal) {
                Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(unwritable(&journal, &e)),
                _ => {}
            }
        }
        let told = |progress| (self.progress)("tables", progress);
        let tables = StudyTables::of(self.study, *grid, data.as_deref(), *memory, &told)?;
        let weight = |group: &[Combination]| group.iter().map(Combination::weight).sum::<usize>();
        let total = weight(missing) * tables.len();
        let done = Count::of(total);
        let (mut finished, mut outcomes) = (0, Vec::new());
        for group in groups(missing) {
            let journal = Journal::open(self.path(&group[0], "journal"), &group, self.setting)?;
            warnings.extend_from_slice(journal.warnings());
            let step = |pairs: usize| {
                done.more(pairs * weight(&group), |progress| {
                    (self.progress)("sweep", Progress { done: progress.done.min(total), total });
                });
            };
            step(journal.known().len());
            let keep = |index: usize, found: &PairOutcome| -> Result<(), ExperimentError> {
                step(1);
                journal.keep(index, found)
            };
            let found = compute(&group, self.setting, &tables, journal.known(), &keep)?;
            for (combination, outcome) in group.iter().zip(found) {
                let record = CombinationRecord::new(combination, self.setting, outcome.clone());
                let text = seal(&record).map_err(|e| ExperimentError::Write { reason: e.to_string() })?;
                let path = self.path(combination, "json");
                write_atomically(&path, text.as_bytes()).map_err(|e| unwritable(&path, &e))?;
                outcomes.push((*combination, outcome));
            }
            journal.remove()?;
            // A refused group stops at its first reference.
            finished += weight(&group) * tables.len();
            done.set(finished);
        }
        Ok(outcomes)
    }
}

fn unwritable(path: &Path, cause: &std::io::Error) -> ExperimentError {
    ExperimentError::Write { reason: format!("{}: {cause}", path.display()) }
}
