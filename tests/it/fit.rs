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
        let args = [
            "fit",
            "ward.json",
            "--model",
            "blinn-phong",
            "--metric",
            "D4.Cl",
            "--coarsening",
            "6",
            "--replace",
            "--out",
        ];
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
    // From its own result nothing is left to gain, which is no convergence but a success; too few evaluations say so with a code of
    // their own.
    let again = fit(&["again.json", "--start", "fit.json"]);
    assert_eq!(again.status.code(), Some(0));
    let text = String::from_utf8(again.stdout).expect("UTF-8");
    assert!(text.contains("(nothing-moved, ") || text.contains("(converged, "), "{text}");
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
fn a_fit_is_exported_to_renderers_and_its_file_says_what_that_costs() {
    let place = Place::new();
    let args =
        ["fit", "ward.json", "--model", "lambert", "--metric", "D4.Cl.CR", "--coarsening", "6", "--out", "f.json"];
    let output = place.run(&[&args[..], &["--export", "mitsuba,gltf", "--export", "pbrt", "--json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let file: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let exports = file["exports"].as_array().expect("a list");
    let found: Vec<_> =
        exports.iter().map(|e| (e["renderer"].as_str(), e["file"].as_str(), e["exact"].as_bool())).collect();
    let expected = [("mitsuba", "f.xml"), ("gltf", "f.gltf"), ("pbrt", "f.pbrt")];
    assert_eq!(found, expected.map(|(renderer, file)| (Some(renderer), Some(file), Some(true))));
    for export in exports {
        let costs = export["costs"].as_array().expect("a list");
        let names: Vec<_> = costs.iter().map(|cost| cost["metric"]["name"].as_str()).collect();
        assert_eq!(names, ["D4.Cl.CR", "vernis-loss", "vernis"].map(Some));
        assert!(costs[0]["score"].is_null() && costs[2]["score"]["mos"].as_f64().is_some_and(|mos| mos > 4.0));
        assert!(costs.iter().all(|cost| cost["distance"].as_f64().is_some_and(|d| d < 1e-6)), "{costs:?}");
    }
    let xml = std::fs::read_to_string(place.0.path().join("f.xml")).expect("written");
    assert!(xml.contains("type=\"diffuse\"") && xml.contains("lambert of ward.json under D4.Cl.CR"), "{xml}");
    // The fit with its materials is a whole file, and a BRDF.
    let kept = std::fs::read(place.0.path().join("f.json")).expect("written");
    assert_eq!(kept, output.stdout);
    assert_eq!(place.run(&["compare", "f.json", "ward.json", "--metric", "D1"]).status.code(), Some(0));

    let again = |more: &[&str]| place.mistake(&[&args[..9], more].concat());
    assert!(again(&["h.json", "--export", "mitsubba"]).contains("unknown renderer `mitsubba`; did you mean mitsuba"));
    assert!(again(&["h.json", "--export", "pbrt,pbrt"]).contains("--export pbrt is given twice"));
    std::fs::write(place.0.path().join("h.xml"), "mine").expect("writable");
    assert!(again(&["h.json", "--export", "mitsuba"]).contains("h.xml exists already; use --replace"));
    assert!(!place.0.path().join("h.json").exists(), "nothing is computed for an output that cannot be written");
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
            "--coarsening",
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
    // Files of other settings are somebody's results: refused before the work, and left alone.
    let other = ["refit", "--study", "pairs.csv", "--out", "refits", "--coarsening", "5", "--method", "WARD"];
    let text = place.mistake(&other);
    assert!(
        text.contains(
            "paint.WARD.json is the result of another run: coarsening is 6 there and 5 here; choose another folder"
        ),
        "{text}"
    );
    let other = ["refit", "--study", "pairs.csv", "--out", "refits", "-m", "D9.Cl", "--grid", "6", "--method", "WARD"];
    assert!(place.mistake(&other).contains("metric is D4.Cl there and D9.Cl here"));
    let ward = std::fs::read_to_string(place.0.path().join("ward.json")).expect("a model");
    std::fs::write(place.0.path().join("ward.json"), ward.replace("0.18", "0.28")).expect("writable");
    assert!(
        place
            .mistake(&["refit", "--study", "pairs.csv", "--out", "refits", "--coarsening", "6", "--method", "WARD"])
            .contains("the SHA-256 of the reference is ")
    );
    assert_eq!(std::fs::metadata(&path).and_then(|m| m.modified()).expect("a file"), written);
    let text = place.mistake(&["refit", "--study", "pairs.csv", "--method", "WART", "--out", "refits"]);
    assert!(text.contains("--method is WART; it must be one of ABC, WARD"), "{text}");
}

/// `-m` and `--grid` mean one thing each; their old spellings are still read.
#[test]
fn options_mean_the_same_in_every_command() {
    let place = Place::new();
    let fit = |more: &[&str]| {
        let args = ["fit", "ward.json", "--model", "lambert", "--out", "fit.json", "--replace", "--json"];
        let output = place.run(&[&args[..], more].concat());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(matches!(output.status.code(), Some(0 | 3)), "{more:?}: {said}");
        (serde_json::from_slice::<serde_json::Value>(&output.stdout).expect("JSON"), said)
    };
    let (file, said) = fit(&["-m", "energy", "--grid", "4x4x8", "--coarsening", "1"]);
    assert_eq!((&file["metric"]["name"], &file["grid"], said.as_str()), (&"energy".into(), &1.into(), ""));
    assert!(file["metric"]["identity"].as_str().is_some_and(|i| i.ends_with("4x4x8")), "{file}");
    let (file, said) = fit(&["-l", "D9.Cl", "--grid", "9"]);
    assert_eq!((&file["metric"]["name"], &file["grid"]), (&"D9.Cl".into(), &9.into()));
    assert!(said.contains("--grid 9 is read as --coarsening 9"), "{said}");
    let text = place.mistake(&["fit", "ward.json", "--model", "ggx", "--grid", "9x9x36", "--out", "a.json"]);
    assert!(text.contains("--grid needs a metric with a grid, and vernis-loss has none"), "{text}");
    let text = place.mistake(&["fit", "ward.json", "--model", "ggx", "--coarsening", "0", "--out", "a.json"]);
    assert!(text.contains("'--coarsening <N>': it must be an integer from 1 to 15"), "{text}");
    for command in ["compare", "score", "fit", "refit", "manifold", "sweep", "train", "describe"] {
        let help = String::from_utf8(place.run(&[command, "--help"]).stdout).expect("UTF-8");
        let lines = || help.lines().map(str::trim_start).filter(|line| line.starts_with('-'));
        assert!(lines().filter(|l| l.starts_with("-m")).all(|l| l.starts_with("-m, --metric")), "{command}");
        assert!(
            lines().filter(|l| l.starts_with("--grid")).all(|l| l.starts_with("--grid <GRID>")),
            "{command}: {help}"
        );
    }
}

/// What a variable gives is not shown as if the usage demanded it.
#[test]
fn usage_lines_do_not_demand_what_a_variable_sets() {
    let place = Place::new();
    let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
    command.args(["compare", "ward.json"]).current_dir(place.0.path()).env("VERNIS_DATA", ".").env("VERNIS_CACHE", "c");
    let said = String::from_utf8(command.output().expect("the program starts").stderr).expect("UTF-8");
    let usage = said.lines().find(|line| line.starts_with("Usage:")).expect("a usage line");
    assert_eq!(usage, "Usage: vernis compare <REFERENCE> <CANDIDATE>");
    // The variable is read all the same.
    std::fs::create_dir(place.0.path().join("data")).expect("writable");
    std::fs::rename(place.0.path().join("ward.json"), place.0.path().join("data/ward.json")).expect("writable");
    let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
    command
        .args(["compare", "ward.json", "ward.json", "-m", "D1"])
        .current_dir(place.0.path())
        .env("VERNIS_DATA", "data");
    assert_eq!(command.output().expect("the program starts").status.code(), Some(0));
}

#[test]
fn a_fit_says_which_parameters_stand_on_their_bounds() {
    let place = Place::new();
    let blue = r#"{"model":"ward-duer","kd":[0,0,0.1],"ks":[0,0,0.08],"alpha":0.18}"#;
    std::fs::write(place.0.path().join("blue.json"), blue).expect("writable");
    let args = ["fit", "blue.json", "--model", "ward-duer", "-m", "D4.Cl", "--coarsening", "9", "--out", "fit.json"];
    let text = String::from_utf8(place.run(&args).stdout).expect("UTF-8");
    assert!(text.contains("\non their bounds: ") && text.contains("kd.r 0 (lower)"), "{text}");
    let file = std::fs::read(place.0.path().join("fit.json")).expect("a file");
    let file: serde_json::Value = serde_json::from_slice(&file).expect("JSON");
    let first = serde_json::json!({"parameter": "kd.r", "bound": "lower", "value": 0.0});
    assert!(file["at_bounds"].as_array().is_some_and(|all| all.contains(&first)), "{file}");
}

/// A few cells of 1e30: the loss is theirs, whatever the parameters.
#[test]
fn a_fit_to_implausible_values_is_not_converged() {
    let place = Place::new();
    let brdf = build("ggx", &GGX).expect("within bounds");
    let table = TabulatedBrdf::tabulate(&*brdf, Grid::TITOPO_HALF).expect("a table");
    let (mut values, valid) = (table.values().to_vec(), table.valid().to_vec());
    let middle = values.len() / 3;
    values[middle..middle + 180].fill([1e30; 3]);
    let spoilt = TabulatedBrdf::new(Grid::TITOPO_HALF, values, valid).expect("a table");
    titopo::write(&place.0.path().join("spoilt.titopoh"), &spoilt).expect("writable");
    for optimizer in ["hooke-jeeves", "nelder-mead", "lbfgs"] {
        let args = [
            "fit",
            "spoilt.titopoh",
            "--model",
            "ggx",
            "--metric",
            "D4.Cl",
            "--coarsening",
            "9",
            "--optimizer",
            optimizer,
            "--out",
            "x.json",
            "--replace",
        ];
        let output = place.run(&args);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(3), "{optimizer}: {said}");
        assert!(said.contains("no step of a parameter changes it by a millionth: the result means nothing"), "{said}");
        let text = String::from_utf8(output.stdout).expect("UTF-8");
        assert!(text.contains("(flat, ") && !text.contains("converged"), "{text}");
    }
}

/// Waits until the program catches SIGINT, and sends it.
#[cfg(target_os = "linux")]
fn interrupt(running: &std::process::Child, signal: &str) {
    let caught = || {
        let status = std::fs::read_to_string(format!("/proc/{}/status", running.id())).unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap_or("0");
        u64::from_str_radix(mask.trim(), 16).unwrap_or(0) & 0b100_0000_0000_0010 == 0b100_0000_0000_0010
    };
    for _ in 0..6000 {
        if caught() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    assert!(caught(), "signals are not caught");
    let sent = Command::new("kill").args([signal, &running.id().to_string()]).status().expect("kill");
    assert!(sent.success());
}

#[cfg(target_os = "linux")]
#[test]
fn a_fit_that_is_interrupted_writes_its_best() {
    use std::process::Stdio;
    let place = Place::new();
    for (signal, code) in [("-INT", 130), ("-TERM", 143)] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
        command.args([
            "fit",
            "ward.json",
            "--model",
            "ggx+blinn-phong",
            "-m",
            "D4.Cl",
            "--coarsening",
            "2",
            "--starts",
            "50",
        ]);
        command.args(["--out", "fit.json", "--json"]).current_dir(place.0.path()).env_remove("VERNIS_DATA");
        let running = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts");
        interrupt(&running, signal);
        let output = running.wait_with_output().expect("it ends");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{said}");
        assert!(said.contains("ending with the best so far; a second signal ends at once"), "{said}");
        assert!(said.contains("the best result so far was written to fit.json"), "{said}");
        let file: serde_json::Value =
            serde_json::from_slice(&std::fs::read(place.0.path().join("fit.json")).expect("a file")).expect("JSON");
        assert_eq!(file["stop"], "interrupted");
        assert_eq!(place.run(&["compare", "ward.json", "fit.json", "--metric", "D1"]).status.code(), Some(0));
        std::fs::remove_file(place.0.path().join("fit.json")).expect("a file");
    }
}

/// Commands that keep what they finish end at once, and say how to go on.
#[cfg(target_os = "linux")]
#[test]
fn a_command_that_can_be_resumed_says_so_when_it_is_interrupted() {
    use std::process::Stdio;
    let place = Place::new();
    let rows: String = (0..40).map(|k| format!("ward.json,ward.json,paint{k},WARD,4.5\n")).collect();
    let rows = format!("reference,candidate,material,method,mos\n{rows}");
    std::fs::write(place.0.path().join("pairs.csv"), rows).expect("writable");
    let refit = ["refit", "--study", "pairs.csv", "--out", "refits", "--coarsening", "2"];
    let sweep = ["sweep", "--study", "synthetic", "--grid", "15x15x60", "--out", "swept"];
    for (args, kept) in [(&refit[..], "refits"), (&sweep[..], "swept/combinations")] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
        command.args(args).current_dir(place.0.path()).env_remove("VERNIS_DATA");
        let running = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts");
        interrupt(&running, "-INT");
        let output = running.wait_with_output().expect("it ends");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(130), "{said}");
        assert!(said.contains(&format!("are kept in {kept}; the same command continues from there")), "{said}");
    }
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
    assert!(text.contains("it must be an integer from 1 to 1000"), "{text}");
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
