//! One rule for every command that writes: inputs stay, and earlier results stay without --replace.

use std::fs;
use std::path::Path;
use std::process::Command;

const GGX: &str = r#"{"model":"ggx","kd":[0.2,0.1,0.05],"f0":[0.04,0.04,0.04],"alpha":0.3}"#;
const PAIRS: &str = "reference,candidate\nggx.json,other.json\n";
const STUDY: &str = "reference,candidate,mos,material\nggx.json,other.json,3,a\nother.json,ggx.json,2,b\n";

fn place() -> tempfile::TempDir {
    let place = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(place.path().join(name), text).unwrap();
    write("ggx.json", GGX);
    write("other.json", &GGX.replace("0.3}", "0.4}"));
    write("p.csv", PAIRS);
    write("study.csv", STUDY);
    fs::create_dir(place.path().join("sub")).unwrap();
    fs::hard_link(place.path().join("ggx.json"), place.path().join("hard.json")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("../ggx.json", place.path().join("sub/soft.json")).unwrap();
    place
}

fn run(place: &Path, args: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
    let output = command.args(args).current_dir(place).env_remove("VERNIS_DATA").output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn no_command_replaces_what_it_reads() {
    let place = place();
    let before = |name: &str| fs::read(place.path().join(name)).unwrap();
    let (ggx, pairs, study) = (before("ggx.json"), before("p.csv"), before("study.csv"));
    fs::write(place.path().join("in.titopoh"), "").unwrap();
    fs::create_dir(place.path().join("page")).unwrap();
    fs::write(place.path().join("page/study.json"), STUDY).unwrap();
    let mut cases: Vec<Vec<&str>> = vec![
        vec!["fit", "ggx.json", "--model", "lambert", "--out", "ggx.json"],
        vec!["fit", "ggx.json", "--model", "lambert", "--out", "./sub/../ggx.json"],
        vec!["fit", "ggx.json", "--model", "lambert", "--out", "hard.json"],
        vec!["fit", "ggx.json?alpha=0.2", "--model", "lambert", "--out", "ggx.json"],
        vec!["fit", "other.json", "--model", "ggx", "--start", "ggx.json", "--out", "ggx.json"],
        vec!["score", "p.csv", "-m", "D1", "--out", "p.csv"],
        vec!["score", "p.csv", "-m", "D1", "--out", "ggx.json"],
        vec!["score", "p.csv", "-m", "D1", "--out", "sub/../other.json"],
        vec!["data", "convert", "in.titopoh", "in.titopoh"],
        vec!["report", "--study", "page/study.json", "--out", "page"],
    ];
    if cfg!(unix) {
        cases.push(vec!["fit", "ggx.json", "--model", "lambert", "--out", "sub/soft.json"]);
    }
    if cfg!(feature = "train") {
        let rows = (0..24).map(|k| {
            let (material, alpha, mos) = (k / 3, 0.1 + 0.02 * f64::from(k), 1.5 + 0.1 * f64::from(k));
            format!("ggx.json?alpha=0.{material}1,other.json?alpha={alpha},{mos},m{material}\n")
        });
        let study = format!("reference,candidate,mos,material\n{}", rows.collect::<String>());
        fs::write(place.path().join("sub/metrics.csv"), study).unwrap();
        cases.push(vec!["train", "--study", "sub/metrics.csv", "--folds", "2", "--out", "sub"]);
        cases.push(vec!["merge", "p.csv", "--out", "p.csv"]);
    }
    for args in &mut cases {
        // `--replace` is for results.
        args.push("--replace");
        let (code, said) = run(place.path(), args);
        assert_eq!(code, Some(2), "{args:?}: {said}");
        assert!(
            said.contains("input of this command; inputs are never replaced: write to another file"),
            "{args:?}: {said}"
        );
    }
    assert_eq!([before("ggx.json"), before("p.csv"), before("study.csv")], [ggx, pairs, study]);
}

#[test]
fn earlier_results_stay_unless_asked() {
    let place = place();
    let fit = ["fit", "ggx.json", "--model", "lambert", "-m", "D4.Cl", "--grid", "9", "--out", "new/fit.json"];
    let score = ["score", "p.csv", "-m", "D1", "--out", "new/scores.csv"];
    let convert = ["data", "convert", "ggx.json", "folder/new.titopoh"];
    let study = ["study", "--study", "synthetic", "--out", "ratings"];
    for (args, file) in [
        (&fit[..], "new/fit.json"),
        (&score, "new/scores.csv"),
        (&convert, "folder/new.titopoh"),
        (&study, "ratings/study.json"),
    ] {
        let (code, said) = run(place.path(), args);
        assert_eq!(code, Some(0), "{args:?}: {said}");
        let written = fs::read(place.path().join(file)).unwrap();
        fs::write(place.path().join(file), "yesterday's").unwrap();
        let (code, said) = run(place.path(), args);
        assert_eq!(code, Some(2), "{args:?}");
        assert!(said.ends_with(&format!("{file} exists already; use --replace to replace it\n")), "{said}");
        assert_eq!(fs::read(place.path().join(file)).unwrap(), b"yesterday's");
        let (code, said) = run(place.path(), &[args, &["--replace"]].concat());
        assert_eq!(code, Some(0), "{args:?}: {said}");
        assert!(fs::read(place.path().join(file)).unwrap() == written, "{args:?}");
    }
    // A folder that vernis names itself is its own.
    for _ in 0..2 {
        assert_eq!(run(place.path(), &["study", "--study", "synthetic"]).0, Some(0));
    }
}

/// Found before the work: the metric of a folder that the user named stays, under the name that it would get.
#[cfg(feature = "train")]
#[test]
fn an_exported_metric_stays_in_a_named_folder() {
    let place = place();
    fs::create_dir(place.path().join("kept")).unwrap();
    for (file, name) in [("mine", &["--name", "mine"][..]), ("vernis-synthetic", &[])] {
        let file = format!("kept/{file}.vernis.json");
        fs::write(place.path().join(&file), "earlier").unwrap();
        let train = ["train", "--study", "synthetic", "--out", "kept"];
        let (code, said) = run(place.path(), &[&train[..], name].concat());
        assert_eq!(code, Some(2), "{said}");
        assert!(said.ends_with(&format!("{file} exists already; use --replace to replace it\n")), "{said}");
    }
}
