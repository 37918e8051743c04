//! What the README shows is what the program prints, and recipes in the documents are the files that were run.

use crate::data_folder;
use std::path::Path;
use std::process::Command;

fn readme() -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md")).unwrap()
}

/// The example under "What the number means".
#[test_with::env(VERNIS_DATA)]
#[test]
fn its_example_is_what_the_program_prints() {
    let place = tempfile::tempdir().unwrap();
    let arguments = ["merl_nbrdf.zip:teflon", "bagher_sgd.fit:teflon", "--metric", "vernis", "--metric", "D9.Cl"];
    let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
    command.arg("compare").args(arguments).arg("--data").arg(data_folder()).arg("--cache").arg(place.path());
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8(output.stdout).unwrap();
    let shown = format!("$ vernis compare {}\n{printed}", arguments.join(" "));
    assert!(readme().contains(&shown), "the README does not show:\n{shown}");
}

/// The two commands that stay true on any machine stand first.
#[test]
fn its_first_commands_are_those_that_need_nothing() {
    let text = readme();
    let commands: Vec<&str> = text.lines().filter(|line| line.starts_with("cargo ")).take(2).collect();
    assert!(
        commands[0].starts_with("cargo run --release -- train") && commands[1] == "cargo test --release",
        "{commands:?}"
    );
}

/// Users copy it from the page; `experiments/scale/slurm.sh` runs the file.
#[test]
fn the_page_on_large_studies_shows_the_batch_script_that_ran() {
    let read = |path| std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap();
    let batch: String = read("experiments/scale/extract.sbatch").lines().map(|line| format!("    {line}\n")).collect();
    assert!(read("datasets/SCALE.md").contains(&batch), "datasets/SCALE.md does not show:\n{batch}");
}
