//! Distances that somebody computed elsewhere: how their rows are found, and what is refused before any BRDF is read. That they are
//! judged is a part of the test `metrics_are_judged_without_brdfs`.

use std::fs;
use std::path::Path;
use vernis::dataset::Study;
use vernis::experiment::external::ExternalScores;

const STUDY: &str = "reference,candidate,mos,material,method\n\
    chalk.json,chalk-a.json,4.1,chalk,A\nchalk.json,chalk-b.json,2.7,chalk,B\nlib/gold.json,gold-a.json,3.3,gold,A\n";

/// A folder with a study in it, of which no BRDF can be read.
fn place() -> tempfile::TempDir {
    let place = tempfile::tempdir().unwrap();
    fs::create_dir_all(place.path().join("study/lib")).unwrap();
    fs::write(place.path().join("study/study.csv"), STUDY).unwrap();
    for name in ["chalk.json", "chalk-a.json", "chalk-b.json", "lib/gold.json", "gold-a.json"] {
        fs::write(place.path().join("study").join(name), "no BRDF").unwrap();
    }
    place
}

fn load(place: &Path, text: &str, better: &[&str]) -> Result<ExternalScores, String> {
    let study = Study::load(&place.join("study/study.csv").to_string_lossy(), None).unwrap();
    fs::write(place.join("scores.csv"), text).unwrap();
    let better: Vec<String> = better.iter().map(|name| (*name).to_owned()).collect();
    ExternalScores::load(&place.join("scores.csv"), &study, &better).map_err(|e| e.to_string())
}

#[test]
fn rows_are_found_however_they_are_named() {
    let place = place();
    for text in [
        "reference,candidate,d,s\nlib/gold.json,gold-a.json,3,-3\nchalk.json,chalk-b.json,2,-2\nchalk.json,chalk-a.json,1,-1\n",
        ",method,d,material,s,Unnamed: 0\n0,A,3,gold,-3,7\n1,B,2,chalk,-2,8\n2,A,1,chalk,-1,9\n",
        "candidate;Reference;d;s;note;mos\nstudy/gold-a.json;study/lib/gold.json;3,0;-3;far;1\n\
         study/chalk-b.json;study/chalk.json;2,0;-2;;2\nstudy/chalk-a.json;study/chalk.json;1e0;-1;;3\n",
    ] {
        let found = load(place.path(), text, &["s"]).unwrap_or_else(|e| panic!("{text}: {e}"));
        let metrics: Vec<_> = found.metrics.iter().map(|m| (m.name.as_str(), m.negated, &m.distances[..])).collect();
        assert_eq!(metrics, [("d", false, &[1.0, 2.0, 3.0][..]), ("s", true, &[1.0, 2.0, 3.0])], "{text}");
    }
}

#[test]
fn what_is_wrong_is_named_by_line() {
    let place = place();
    let rows = "chalk,A,1\nchalk,B,2\n";
    for (text, better, says) in [
        (
            "a,b,d\nchalk,A,1\n".to_owned(),
            &[][..],
            "scores.csv, line 1: the header is `a, b, d`; it must be one with the columns",
        ),
        (format!("material,method\n{}", "chalk,A\n"), &[], "scores.csv, line 1: the header is `material, method`"),
        (
            format!("material,method,d\n{rows}"),
            &[],
            "scores.csv has no row for 1 of the 3 rated pairs of study.csv, but it must have",
        ),
        (
            format!("material,method,d\n{rows}gold,A,x\n"),
            &[],
            "scores.csv, line 4: d is `x`; it must be a finite number in",
        ),
        (
            format!("material,method,d\n{rows}gold,A,\n"),
            &[],
            "scores.csv, line 4: d is empty; it must be a finite number",
        ),
        (format!("material,method,d\n{rows}gold,A,NaN\n"), &[], "scores.csv, line 4: d is `NaN`"),
        (format!("material,method,d\n{rows}gold,A,inf\n"), &[], "scores.csv, line 4: d is `inf`"),
        (
            format!("material,method,d\n{rows}gold,A,3\nchalk,A,1\n"),
            &[],
            "scores.csv, line 5: the row is `chalk`, `A` again, as on line 2",
        ),
        (
            format!("material,method,d\n{rows}glod,A,3\n"),
            &[],
            "scores.csv, line 4: the row is `glod`, `A`; it must be material and method of a rated pair of study.csv; did you mean gold, A",
        ),
        (
            format!("material,method,d9.cl\n{rows}gold,A,3\n"),
            &[],
            "scores.csv, line 1: a column is `d9.cl`; it must be another name",
        ),
        (format!("material,method,Vernis\n{rows}gold,A,3\n"), &[], "scores.csv, line 1: a column is `Vernis`"),
        ("material,method,d,D\nchalk,A,1,1\n".to_owned(), &[], "scores.csv, line 1: column `D` is given twice"),
        (
            format!("material,method,ssim\n{rows}gold,A,3\n"),
            &["sim"],
            "scores.csv, line 1: --higher-is-better is `sim`; it must be",
        ),
        (
            "material,method,d\nchalk,A,1\nchalk,B,1\ngold,A,1\n".to_owned(),
            &[],
            "scores.csv, line 1: d is 1 in every row",
        ),
    ] {
        let message = load(place.path(), &text, better).err().unwrap_or_default();
        let message =
            message.rsplit_once("/scores.csv").map_or(message.clone(), |(_, rest)| format!("scores.csv{rest}"));
        assert!(message.starts_with(says), "{text}{message}");
    }
    let twice = STUDY.replace(",B\n", ",A\n");
    fs::write(place.path().join("study/study.csv"), twice).unwrap();
    let message = load(place.path(), "material,method,d\nchalk,A,1\n", &[]).unwrap_err();
    assert!(message.contains("several pairs of chalk, A: name them by reference and candidate"), "{message}");
}

/// The checks come before the first BRDF is read: none of the study's can be.
#[test]
fn the_command_refuses_them_before_the_work() {
    let place = place();
    fs::write(place.path().join("scores.csv"), "material,method,d\nchalk,A,1\n").unwrap();
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_vernis"));
    command.args(["benchmark", "--study", "study/study.csv", "--folds", "2", "--scores", "scores.csv", "--out", "out"]);
    let output = command.current_dir(place.path()).env_remove("VERNIS_DATA").output().unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{error}");
    let mut lines = error.lines();
    assert_eq!(lines.next(), Some("scores.csv: judged as metrics: `d` (larger is worse)"));
    let error = lines.collect::<String>();
    assert!(error.starts_with("vernis: scores.csv has no row for 2 of the 3 rated pairs of study.csv"), "{error}");
}
