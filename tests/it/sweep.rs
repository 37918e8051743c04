//! The sweep over the parameters of the study's distances: sharing, records, interruption, wrong input.

use crate::files_of;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::thread::sleep;
use std::time::{Duration, SystemTime};
use vernis::dataset::{Study, synthetic};
use vernis::experiment::ExperimentError;
use vernis::experiment::sweep::{
    Combination, CombinationRecord, Family, Outcome, PairOutcome, Setting, StudyTables, SweepProtocol, compute, groups,
    judge,
};
use vernis::io::SealError;

#[test]
fn a_sweep_records_what_it_found_and_takes_it_up_again() {
    let study = Study { pairs: synthetic_pairs(), ..Study::load(synthetic::NAME, None).unwrap() };
    let grid = "3x3x8".parse().unwrap();
    let tables = StudyTables::of(&study, grid, None, usize::MAX, &|_| {}).unwrap();
    let without_memory = StudyTables::of(&study, grid, None, 0, &|_| {}).unwrap();
    let setting = Setting::new("3x3x8", "standard", &study);
    let all = Combination::of_study();
    let pick = |name: &str| *all.iter().find(|c| c.to_string() == name).unwrap();
    let combinations = [
        pick("ot[p=2,alpha=0.1,blur=0.05,scaling=0.8,phi=t^1/4]"),
        pick("ot[p=1,alpha=0.1,blur=0.1,scaling=0.8,phi=t^1/4]"),
        pick("energy[alpha=0.1,phi=t^1/3]"),
        pick("energy[alpha=1,phi=log:eta=0.01]"),
    ];
    let mut outcomes = Vec::new();
    for combination in combinations {
        let outcome_on = |tables: &StudyTables| {
            let found = compute(&[combination], &setting, tables, &BTreeMap::new(), &forget);
            found.unwrap().remove(0)
        };
        let outcome = outcome_on(&tables);
        assert_eq!(outcome, outcome_on(&without_memory));
        let record = CombinationRecord::new(&combination, &setting, outcome.clone());
        let bytes = vernis::io::seal(&record).unwrap().into_bytes();
        let pairs = study.pairs.len();
        let read = |bytes: &[u8], of: &Combination, setting: &Setting, pairs| {
            CombinationRecord::outcome_of(bytes, of, setting, pairs)
        };
        assert_eq!(read(&bytes, &combination, &setting, pairs), Ok(Some(outcome.clone())));
        // Another study, grid, accuracy, combination, version, another number of pairs: computed again. So are half a file and one
        // that was changed, which are named.
        assert!(matches!(read(&bytes[..bytes.len() / 2], &combination, &setting, pairs), Err(SealError::Malformed(_))));
        let changed = String::from_utf8(bytes.clone()).unwrap().replacen(&record.metric, "another metric", 1);
        assert_eq!(read(changed.as_bytes(), &combination, &setting, pairs), Err(SealError::Broken));
        let older = CombinationRecord { version: "0".to_owned(), ..record.clone() };
        let older = vernis::io::seal(&older).unwrap();
        assert_eq!(read(older.as_bytes(), &combination, &setting, pairs), Ok(None));
        let whole = Study::load(synthetic::NAME, None).unwrap();
        let fewer = Study { pairs: whole.pairs[1..].to_vec(), ..whole };
        for other in [("3x3x8", "standard", &fewer), ("3x3x9", "standard", &study), ("3x3x8", "fast", &study)] {
            assert_eq!(read(&bytes, &combination, &Setting::new(other.0, other.1, other.2), pairs), Ok(None));
        }
        assert_eq!(read(&bytes, &all[77], &setting, pairs), Ok(None));
        assert_eq!(read(&bytes, &combination, &setting, pairs + 1), Ok(None));
        outcomes.push((combination, outcome));
    }
    let refused = [(all[0], "a test"), (all[2], "another"), (all[3], "a test"), (all[5], "a test")];
    outcomes.extend(refused.map(|(combination, reason)| (combination, Outcome::Refused { reason: reason.into() })));
    let rows: Vec<_> = study.pairs.iter().map(|p| p.row()).collect();
    let protocol = SweepProtocol { folds: 4, resamples: 60, seed: 1 };
    let record = judge("synthetic", &setting, &rows, &outcomes, protocol).unwrap();
    assert_eq!((record.in_sample.len(), record.nested.len(), record.refused.len()), (12, 3, 4));
    let text = vernis::report::sweep::markdown(&record, "a command", [16, 17]);
    let together = format!("* `{}` and 2 others to `{}`: a test\n* `{}`: another\n", all[0], all[5], all[2]);
    assert!(text.contains("16 of the 17") && text.contains("Not all") && text.ends_with(&together), "{text}");
    assert!(record.in_sample.is_sorted_by(|a, b| a.plcc.value >= b.plcc.value));
    // A power changes no rank; choosing out of sample cannot beat the best in sample by much.
    let srocc = |name: &str| record.in_sample.iter().find(|r| r.name == name).unwrap().srocc.value;
    let name = |gamma: f64| outcomes[0].0.with_gamma(gamma);
    assert_eq!(srocc(&name(0.25)), srocc(&name(0.5)));
    assert!(record.nested.iter().all(|row| row.plcc.value <= record.in_sample[0].plcc.value + 0.01));
    assert_eq!(all.iter().filter(|c| c.family() == Family::Energy).count(), 32);
}

/// Keeps no journal.
fn forget(_: usize, _: &PairOutcome) -> Result<(), ExperimentError> {
    Ok(())
}

#[test]
fn combinations_of_a_group_give_what_each_gives_alone() {
    let study = Study { pairs: synthetic_pairs(), ..Study::load(synthetic::NAME, None).unwrap() };
    // Fine enough for the quantised method at coarse accuracy.
    let setting = Setting::new("9x9x36", "coarse", &study);
    let tables = StudyTables::of(&study, "9x9x36".parse().unwrap(), None, usize::MAX, &|_| {}).unwrap();
    let chosen = |c: &&Combination| {
        c.to_string().starts_with("ot[p=2,alpha=0.05,blur=0.1,") && c.to_string().ends_with("phi=t]")
    };
    let group: Vec<Combination> = Combination::of_study().iter().filter(chosen).copied().collect();
    assert_eq!((groups(&group), group.len()), (vec![group.clone()], 4));
    let seen = Mutex::new(BTreeMap::new());
    let keep = |index: usize, found: &PairOutcome| -> Result<(), ExperimentError> {
        seen.lock().unwrap().insert(index, found.clone());
        Ok(())
    };
    let together = compute(&group, &setting, &tables, &BTreeMap::new(), &keep).unwrap();
    for (combination, expected) in group.iter().zip(&together) {
        let alone = compute(&[*combination], &setting, &tables, &BTreeMap::new(), &forget).unwrap();
        assert_eq!(alone[0], *expected);
    }
    // Half of the pairs known: the same, and only the others are computed.
    let mut known = seen.into_inner().unwrap();
    assert_eq!(known.len(), study.pairs.len());
    known.retain(|index, _| index % 2 == 0);
    let again = Mutex::new(0);
    let count = |index: usize, _: &PairOutcome| -> Result<(), ExperimentError> {
        assert_eq!(index % 2, 1);
        *again.lock().unwrap() += 1;
        Ok(())
    };
    assert_eq!(compute(&group, &setting, &tables, &known, &count).unwrap(), together);
    assert_eq!(*again.lock().unwrap(), study.pairs.len() / 2);
    // What the caller cannot keep ends the work.
    let full = |_: usize, _: &PairOutcome| Err(ExperimentError::Write { reason: "the disk is full".to_owned() });
    assert!(compute(&group, &setting, &tables, &BTreeMap::new(), &full).is_err());
}

/// Every candidate of a dozen materials.
fn synthetic_pairs() -> Vec<vernis::dataset::RatedPair> {
    let study = Study::load(synthetic::NAME, None).unwrap();
    let mut materials: Vec<String> = study.pairs.iter().map(|p| p.material.clone()).collect();
    materials.dedup();
    materials.truncate(12);
    study.pairs.into_iter().filter(|p| materials.contains(&p.material)).collect()
}

/// Six combinations in three groups over the embedded study.
const SWEEP: [&str; 15] = [
    "sweep",
    "--study",
    "synthetic",
    "--grid",
    "6x6x24",
    "--accuracy",
    "coarse",
    "--p",
    "2",
    "--alpha",
    ".05",
    "--blur",
    ".02",
    "--phi",
    "t^1/2,t^1/3,t^1/4",
];

fn sweep(folder: &Path, out: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
    command.args(SWEEP).args(["--family", "transport", "--scaling", ".8,.9", "--resamples", "50", "--out", out]);
    command.current_dir(folder).env_remove("VERNIS_DATA").stdout(Stdio::null()).stderr(Stdio::null());
    command
}

#[test]
fn a_sweep_that_is_killed_goes_on_with_the_next_pair() {
    let place = tempfile::tempdir().unwrap();
    let combinations = place.path().join("killed/combinations");
    let mut killed = sweep(place.path(), "killed").spawn().unwrap();
    // In the second group, with some pairs in its journal.
    let started = SystemTime::now();
    let in_second_group = || {
        let journals = files_of(&combinations, ".journal");
        let lines = |name: &String| fs::read_to_string(combinations.join(name)).unwrap_or_default().lines().count();
        files_of(&combinations, ".json").len() >= 2 && journals.keys().any(|name| lines(name) > 20)
    };
    while !in_second_group() {
        assert!(killed.try_wait().unwrap().is_none(), "it ended before it could be killed");
        assert!(started.elapsed().unwrap() < Duration::from_secs(300), "no second group");
        sleep(Duration::from_millis(2));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    let before = files_of(&combinations, ".json");
    assert!((2..6).contains(&before.len()), "{before:?}");
    for name in before.keys() {
        let bytes = fs::read(combinations.join(name)).unwrap();
        assert!(vernis::io::unseal::<CombinationRecord>(&bytes).is_ok(), "{name} is half a file");
    }
    // What was there can be reported, and is not made again; the rest comes to what an undisturbed sweep finds.
    assert!(sweep(place.path(), "killed").arg("--report").status().unwrap().success());
    assert_eq!(files_of(&combinations, ".json"), before);
    let said = fs::read_to_string(place.path().join("killed/sweep.md")).unwrap();
    assert!(
        said.contains(&format!("\n{} of the 6 combinations", before.len())) && said.contains("Not all are computed"),
        "{said}"
    );
    assert!(
        said.contains("--p 2 --alpha 0.05 --blur 0.02 --scaling 0.8,0.9 --phi t^1/2,t^1/3,t^1/4 --folds 10"),
        "{said}"
    );
    // As a run leaves it that is killed between its last result and the end of its journal.
    let (finished, _) = before.first_key_value().unwrap();
    fs::write(combinations.join(finished).with_extension("journal"), "done\n").unwrap();
    assert!(sweep(place.path(), "killed").status().unwrap().success());
    let after = files_of(&combinations, ".json");
    assert!(after.len() == 6 && before.iter().all(|(name, time)| after.get(name) == Some(time)), "{after:?}");
    assert_eq!(files_of(&combinations, ".journal"), BTreeMap::new());
    assert!(sweep(place.path(), "whole").status().unwrap().success());
    let read = |folder: &str| fs::read(place.path().join(folder).join("sweep.csv")).unwrap();
    assert!(read("killed") == read("whole"));
}

/// Files of another study in the folder are refused, and left alone.
#[test]
fn a_sweep_of_another_study_is_not_mixed_in() {
    use vernis::experiment::sweep::{SweepOptions, sweep};
    let place = tempfile::tempdir().unwrap();
    let study = Study { pairs: synthetic_pairs(), ..Study::load(synthetic::NAME, None).unwrap() };
    let other = Study { pairs: study.pairs[..study.pairs.len() - 1].to_vec(), ..study.clone() };
    let energy = |c: &&Combination| c.family() == Family::Energy;
    let options = SweepOptions {
        data: None,
        folder: place.path().join("combinations"),
        combinations: Combination::of_study().iter().filter(energy).take(1).copied().collect(),
        grid: "3x3x8".parse().unwrap(),
        accuracy: "coarse".to_owned(),
        memory: usize::MAX,
        pairs: None,
        compute: true,
        protocol: SweepProtocol { folds: 4, resamples: 60, seed: 1 },
    };
    sweep(&study, &options, &|_, _| ()).unwrap();
    let before = files_of(&options.folder, ".json");
    let error = sweep(&other, &options, &|_, _| ()).unwrap_err().to_string();
    assert!(error.contains(".json is the result of another run: the SHA-256 of the study is "), "{error}");
    assert_eq!((files_of(&options.folder, ".json"), before.len()), (before.clone(), 1));
    assert!(sweep(&study, &options, &|_, _| ()).unwrap().warnings.is_empty());
    // A part of the pairs is another study, and told apart in the report.
    let all = study.pairs.len();
    let of_part = SweepOptions { pairs: Some(all / 2), folder: place.path().join("part"), ..options.clone() };
    let mixed = sweep(&study, &SweepOptions { folder: options.folder, ..of_part.clone() }, &|_, _| ()).unwrap_err();
    assert!(mixed.to_string().contains("the SHA-256 of the study is "), "{mixed}");
    let record = sweep(&study, &of_part, &|_, _| ()).unwrap().record;
    assert_eq!((record.rows, record.rated), (all / 2, all));
    let text = vernis::report::sweep::markdown(&record, "a command", [1, 1]);
    let told = format!("a subset of {} of {all} pairs", all / 2);
    assert_eq!((text.matches("**A subset**").count(), text.matches(&told).count()), (1, 2), "{text}");
}

#[test]
fn wrong_settings_of_a_sweep_are_named() {
    let place = tempfile::tempdir().unwrap();
    for (option, value, expected) in [
        ("--accuracy", "exact", "--accuracy is exact; it must be one of coarse, fast, standard, high"),
        ("--alpha", ".2", "--alpha is 0.2; it must be one of 0.01, 0.05, 0.1, 1"),
        ("--phi", "log:eta=7", "--phi"),
        ("--grid", "6x6", "--grid"),
        ("--pairs", "0", "--pairs is 0; it must be 1 to "),
        ("--pairs", "3", "with --pairs 3, study synthetic has 3 groups"),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_vernis"))
            .args(["sweep", "--study", "synthetic", "--out", "out", option, value])
            .current_dir(place.path())
            .output()
            .unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(2) && said.contains(expected), "{option} {value}: {said}");
        assert_eq!(said.trim_end().lines().count(), 1, "{said}");
    }
    assert!(!place.path().join("out").exists());
}
