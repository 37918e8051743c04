//! `vernis fit`, `refit` and `manifold`: files come back, mistakes are named.

use std::process::{Command, Output};
use vernis::brdf::formats::titopo;
use vernis::brdf::models::build;
use vernis::brdf::{Grid, TabulatedBrdf};
use vernis::dataset::Study;

const GGX: [f64; 7] = [0.25, 0.12, 0.05, 0.06, 0.08, 0.04, 0.22];

/// A folder in which the program runs.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().expect("a folder"));
        let ward = r#"{"model":"ward-duer","kd":[0.3,0.2,0.1],"ks":[0.05,0.06,0.08],"alpha":0.18}"#;
        std::fs::write(place.0.path().join("ward.json"), ward).expect("writable");
        place
    }

    fn run(&self, args: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
        command.args(args).current_dir(self.0.path()).env_remove("VERNIS_DATA");
        command.output().expect("the program starts")
    }

    fn mistake(&self, args: &[&str]) -> String {
        let output = self.run(args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        String::from_utf8(output.stderr).expect("UTF-8")
    }
}

#[test]
fn the_file_of_a_fit_is_a_brdf_and_a_start() {
    let place = Place::new();
    let fit = |more: &[&str]| {
        let args = ["fit", "ward.json", "--model", "blinn-phong", "--grid", "6", "--replace", "--out"];
        place.run(&[&args[..], more].concat())
    };
    let output = fit(&["fit.json", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let file: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((&file["format"], &file["metric"]["name"]), (&1.into(), &"D4.Cl".into()));
    assert_eq!((&file["model"], &file["stop"]), (&"blinn-phong".into(), &"converged".into()));
    let compared = place.run(&["compare", "ward.json", "fit.json", "--metric", "D4.Cl", "--json"]);
    let compared: serde_json::Value = serde_json::from_slice(&compared.stdout).expect("JSON");
    let (a, b) = (compared["distances"]["D4.Cl"].as_f64(), file["value"].as_f64());
    let (a, b) = (a.expect("a number"), b.expect("a number"));
    assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
    // From its own result nothing is left to gain, and too few evaluations say so with a code of their own.
    assert_eq!(fit(&["again.json", "--start", "fit.json"]).status.code(), Some(0));
    let early = fit(&["fit.json", "--max-evaluations", "10"]);
    assert_eq!(early.status.code(), Some(3));
    let said = String::from_utf8_lossy(&early.stderr).into_owned();
    assert!(said.contains("evaluations did not suffice"), "{said}");
    assert_eq!(place.run(&["compare", "ward.json", "fit.json", "--metric", "D1"]).status.code(), Some(0));
    assert_eq!(std::fs::read_dir(place.0.path()).expect("a folder").count(), 3, "nothing half-written is left");
}

#[test]
fn mistakes_at_the_command_line_are_named() {
    let place = Place::new();
    let text = place.mistake(&["fit", "ward.json", "--model", "gxg", "--out", "a.json"]);
    assert!(text.contains("unknown model `gxg`; did you mean ggx"), "{text}");
    let text = place.mistake(&["fit", "ward.json", "--model", "ggx", "--metric", "D4.Cll", "--out", "a.json"]);
    assert!(text.contains("there is no metric `D4.Cll`; did you mean D4.Cl"), "{text}");
    let text = place.mistake(&["fit", "ward.json", "--model", "ggx", "--metric", "all-lp", "--out", "a.json"]);
    assert!(text.contains("several metrics"), "{text}");
    let text = place.mistake(&["fit", "ward.json", "--model", "ggx", "--start", "ward.json", "--out", "a.json"]);
    assert!(text.contains("is a ward-duer; it must hold parameters of ggx"), "{text}");
    let text = place.mistake(&["fit", "ward.json", "--model", "ggx", "--out", "a.txt"]);
    assert!(text.contains("it must be the name of a .json file"), "{text}");
    let newer = r#"{"format": 2, "model": "ggx", "coefficients": []}"#;
    std::fs::write(place.0.path().join("newer.json"), newer).expect("writable");
    let text = place.mistake(&["compare", "ward.json", "newer.json", "--metric", "D1"]);
    assert!(text.contains("newer.json: format is 2; it must be 1 to 1 in vernis"), "{text}");
    assert!(!place.0.path().join("a.json").exists());
}

#[test]
fn a_study_is_refitted_and_a_second_run_keeps_what_is_there() {
    let place = Place::new();
    let rows = "reference,candidate,material,method,mos\nward.json,ward.json,paint,WARD,4.5\n";
    std::fs::write(place.0.path().join("pairs.csv"), rows).expect("writable");
    let refit = || {
        place.run(&[
            "refit",
            "--study",
            "pairs.csv",
            "--out",
            "refits",
            "--grid",
            "6",
            "--method",
            "WARD",
            "--method",
            "GGX",
            "--method",
            "LEGENDRE",
        ])
    };
    let first = refit();
    assert_eq!(first.status.code(), Some(0), "{}", String::from_utf8_lossy(&first.stderr));
    let table = String::from_utf8(first.stdout).expect("UTF-8");
    assert!(table.contains("| WARD | ward-duer | 1 | 0 | 0 |") && table.contains("carry none"), "{table}");
    let path = place.0.path().join("refits/paint.WARD.json");
    let written = std::fs::metadata(&path).and_then(|m| m.modified()).expect("a file");
    let csv = std::fs::read(place.0.path().join("refits/refit.csv")).expect("a table");
    assert_eq!(refit().status.code(), Some(0));
    assert_eq!(std::fs::metadata(&path).and_then(|m| m.modified()).expect("a file"), written);
    assert_eq!(std::fs::read(place.0.path().join("refits/refit.csv")).expect("a table"), csv);
    let text = place.mistake(&["refit", "--study", "pairs.csv", "--method", "WART", "--out", "refits"]);
    assert!(text.contains("--method is WART; it must be one of ABC, WARD"), "{text}");
}

#[test]
fn samples_of_a_manifold_are_written_and_leave_their_reference() {
    let place = Place::new();
    let ggx = r#"{"model":"ggx","kd":[0.1,0.2,0.3],"f0":[0.1,0.1,0.1],"alpha":0.3}"#;
    std::fs::write(place.0.path().join("ggx.json"), ggx).expect("writable");
    let manifold = |more: &[&str]| {
        let args = ["manifold", "--reference", "ward.json", "--reference", "ggx.json", "--out", "samples"];
        place.run(&[&args[..], more, &["--replace"]].concat())
    };
    for (kind, stop) in [("linear", "direct"), ("gplvm", "converged")] {
        let output = manifold(&["--material", "ggx.json", "--kind", kind]);
        let said = String::from_utf8(output.stdout).expect("UTF-8");
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(
            said.starts_with(&format!("dimensions: 1, references: 2, search for their points: {stop}\n")),
            "{said}"
        );
        assert_eq!(said.matches("  grows with every sample").count(), 2, "{said}");
    }
    // The table that was written has the distance that was reported.
    let csv = std::fs::read_to_string(place.0.path().join("samples/ggx.json.manifold.csv")).expect("a table");
    let last: Vec<&str> = csv.lines().last().expect("six samples").split(',').collect();
    assert_eq!((csv.lines().next(), last[0]), (Some("sample,file,D9.Cl,D4.Cl.CR"), "6"));
    let sample = format!("samples/{}", last[1]);
    place.run(&["data", "convert", "ggx.json", "ggx.titopoh"]);
    let compared = place.run(&["compare", "ggx.titopoh", &sample, "--metric", "D9.Cl", "--json"]);
    let compared: serde_json::Value = serde_json::from_slice(&compared.stdout).expect("JSON");
    let (a, b) =
        (compared["distances"]["D9.Cl"].as_f64().expect("a number"), last[2].parse::<f64>().expect("a number"));
    assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
    let text = String::from_utf8(manifold(&["--material", "ggx.json", "--dimension", "0"]).stderr).expect("UTF-8");
    assert!(text.contains("it must be an integer of at least 1"), "{text}");
    let text = String::from_utf8(manifold(&["--material", "teflon"]).stderr).expect("UTF-8");
    assert!(text.contains("--material is teflon; it must be one of ggx.json, ward.json"), "{text}");
}

/// The study's own samples, `MATERIAL.1` to `MATERIAL.6` among its tables, are candidates with their ratings.
#[test]
fn the_studys_own_manifold_samples_are_candidates() {
    let dir = tempfile::tempdir().expect("a folder");
    let (study, tables) = (dir.path().join("lavoue2021"), dir.path().join("lavoue2021/tables"));
    std::fs::create_dir_all(&tables).expect("writable");
    std::fs::create_dir_all(dir.path().join("merl")).expect("writable");
    std::fs::write(dir.path().join("merl/steel.binary"), "").expect("writable");
    std::fs::write(study.join("MaterialType.csv"), "BRDF;Type\nsteel;Metal\n").expect("writable");
    let ratings: String = (1..=6).map(|i| format!("GPLVM_APPROX.{i};steel;0.{i}\n")).collect();
    let ratings = format!("METHOD;BRDF;DISTANCE\n{ratings}");
    std::fs::write(study.join("PerceptualDistances.csv"), ratings).expect("writable");
    for i in [1, 6] {
        let made = TabulatedBrdf::tabulate(&*build("ggx", &GGX).expect("within bounds"), Grid::TITOPO_HALF);
        titopo::write(&tables.join(format!("steel.{i}.titopoh")), &made.expect("a table")).expect("writable");
    }
    let loaded = Study::load("lavoue2021", Some(dir.path())).expect("a study");
    let found: Vec<(&str, &str, f64)> =
        loaded.pairs.iter().map(|p| (p.method.as_str(), p.method_family.as_str(), p.mos)).collect();
    assert_eq!(found.len(), 2);
    for ((method, family, mos), i) in found.into_iter().zip([1.0, 6.0]) {
        assert_eq!((method, family), (format!("GPLVM_APPROX.{i}").as_str(), "GPLVM"));
        assert!((mos - (5.0 - 0.4 * i)).abs() < 1e-12, "{mos}");
    }
    let opened = loaded.pairs[1].candidate.open(Some(dir.path())).expect("present").brdf;
    assert_eq!(opened.as_table().expect("a table").grid(), Grid::TITOPO_HALF);
}

#[cfg(feature = "train")]
#[test]
fn an_experiment_without_its_study_says_where_to_get_it() {
    let place = Place::new();
    let text = place.mistake(&["experiment", "losses", "--out", "losses"]);
    assert!(text.contains("lavoue2021-open") && text.lines().count() == 1, "{text}");
    assert!(!place.0.path().join("losses").exists());
}
