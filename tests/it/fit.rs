//! Fits: known parameters are found again, published fits are not better, bad input is refused, files come back.
//!
//! Tests of published data take its folder from `VERNIS_DATA`.

use std::path::PathBuf;
use std::process::{Command, Output};
use vernis::brdf::formats::titopo;
use vernis::brdf::models::build;
use vernis::brdf::{Brdf, BrdfSource, Grid, TabulatedBrdf};
use vernis::dataset::Study;
use vernis::fit::loss::{LearnedLoss, Loss, LpLoss};
use vernis::fit::optimizer::{Method, StopReason};
use vernis::fit::{FitError, Fitted, Fitting, Start};
use vernis::metric::Metric;
use vernis::metric::learned::LearnedMetric;
use vernis::metric::registry::Registry;

/// A model on a small table in half/difference coordinates.
fn table(model: &str, p: &[f64]) -> TabulatedBrdf {
    let brdf = build(model, p).expect("within bounds");
    let grid = Grid::HalfDifference { theta_h: 90, theta_d: 45, phi_d: 60 };
    TabulatedBrdf::tabulate(&*brdf, grid).expect("a table")
}

fn metric(name: &str) -> std::sync::Arc<dyn Metric> {
    Registry::standard().expect("a registry").get(name).expect("a metric")
}

fn fit(fitting: &Fitting<'_>, reference: &dyn Brdf) -> Fitted {
    fitting.run(reference, &|_, _| ()).expect("a fit")
}

/// The largest relative difference between parameters.
fn difference(fitted: &Fitted, expected: &[f64]) -> f64 {
    let pairs = fitted.model.parameters().into_iter().zip(expected);
    pairs.map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max)
}

const GGX: [f64; 7] = [0.25, 0.12, 0.05, 0.06, 0.08, 0.04, 0.22];
const WARD: [f64; 7] = [0.3, 0.2, 0.1, 0.05, 0.06, 0.08, 0.18];
const BLINN_PHONG: [f64; 7] = [0.1, 0.2, 0.3, 0.1, 0.12, 0.15, 60.0];

#[test]
fn what_made_a_reference_is_found_again() {
    let ggx = Method::ALL.map(|method| ("ggx", &GGX, "D9.Cl", method));
    let others =
        [("ward-duer", &WARD, "D4.Cl", Method::HookeJeeves), ("blinn-phong", &BLINN_PHONG, "D4.Cl", Method::Lbfgs)];
    for (model, expected, name, method) in ggx.into_iter().chain(others) {
        let reference = build(model, expected).expect("within bounds");
        let metric = metric(name);
        let fitted = fit(&Fitting { coarsening: 6, method, ..Fitting::new(model, &*metric) }, &*reference);
        assert!(fitted.stop.is_success(), "{model} {name} {method}: {:?}", fitted.stop);
        assert!(fitted.value < fitted.value_at_start, "{model} {name} {method}");
        let worst = difference(&fitted, expected);
        assert!(worst < 0.01, "{model} {name} {method}: {worst} {:?}", fitted.model.parameters());
    }
}

/// A table's cells are wide: what made it is found within their width.
#[test]
fn what_made_a_table_is_found_within_its_cells() {
    let reference = table("ggx", &GGX);
    let metric = metric("D9.Cl");
    let fitted = fit(&Fitting::new("ggx", &*metric), &reference);
    assert!(difference(&fitted, &GGX) < 0.05, "{:?}", fitted.model.parameters());
    // The value is the metric's own.
    let expected = metric.distance(&reference, &*fitted.model as &dyn Brdf).expect("a distance");
    assert!((fitted.value / expected - 1.0).abs() < 1e-9, "{} {expected}", fitted.value);
}

#[test]
fn transport_finds_the_parameters_with_and_without_its_gradient() {
    let reference = build("blinn-phong", &BLINN_PHONG).expect("within bounds");
    let metric = metric("ot[grid=5x5x16]");
    let near: Vec<f64> = BLINN_PHONG.iter().map(|p| 1.3 * p).collect();
    for method in [Method::Lbfgs, Method::HookeJeeves] {
        let start = Some(Start::Parameters(near.clone()));
        let fitted = fit(&Fitting { start, method, ..Fitting::new("blinn-phong", &*metric) }, &*reference);
        assert!(difference(&fitted, &BLINN_PHONG) < 0.05, "{method}: {:?}", fitted.model.parameters());
        assert!(fitted.value < 0.2 * fitted.value_at_start, "{} {}", fitted.value, fitted.value_at_start);
    }
}

#[test]
fn more_starts_are_no_worse_and_the_same_seed_gives_the_same_fit() {
    let reference = table("ward-duer", &WARD);
    let metric = metric("D4.Cl");
    let fitting = Fitting { coarsening: 6, ..Fitting::new("blinn-phong", &*metric) };
    let one = fit(&fitting, &reference);
    let many = fit(&Fitting { starts: 4, ..fitting.clone() }, &reference);
    let again = fit(&Fitting { starts: 4, ..fitting }, &reference);
    assert!(many.value <= one.value * (1.0 + 1e-3), "{} {}", many.value, one.value);
    assert_eq!(many.model.parameters(), again.model.parameters());
    assert!(many.evaluations > one.evaluations);
}

/// Along lines through the fit under the logarithm, its loss has one hollow. So has the learned one, here, at steps of 6 %;
/// elsewhere it may have more.
#[test]
fn landscapes_along_lines_through_the_fit_under_the_logarithm() {
    let learned = LearnedMetric::shipped().expect("the shipped metric");
    let reference = table("ward-duer", &WARD);
    let log = LpLoss::new(&reference, "D9.Cl".parse().expect("a name"), 6).expect("valid").expect("no colours");
    let loss = LearnedLoss::new(&learned, &reference).expect("valid");
    let metric = metric("D9.Cl");
    let best = fit(&Fitting { coarsening: 6, ..Fitting::new("ggx", &*metric) }, &reference).model.parameters();
    let hollows = |loss: &dyn Loss, k: usize| {
        let at = |step: i32| {
            let mut p = best.clone();
            p[k] = (p[k] * (0.06 * f64::from(step)).exp()).clamp(1e-3, 1.0);
            loss.value(&*build("ggx", &p).expect("within bounds")).expect("a value")
        };
        let values: Vec<f64> = (-12..=12).map(at).collect();
        assert!(values.iter().all(|v| v.is_finite()));
        values.windows(3).filter(|w| w[1] < w[0] && w[1] < w[2]).count()
    };
    let along = |loss: &dyn Loss| -> Vec<usize> { [0, 3, 6].map(|k| hollows(loss, k)).to_vec() };
    let (of_log, of_learned) = (along(&log), along(&loss));
    println!("hollows along kd.r, f0.r, alpha: logarithm {of_log:?}, learned {of_learned:?}");
    assert_eq!(of_log, [1, 1, 1]);
    assert!(of_learned.iter().all(|n| (1..=3).contains(n)), "{of_learned:?}");
}

/// The metric itself is cut off at zero; the loss is not, and agrees where the metric is above.
#[test]
fn the_learned_loss_is_the_distance_before_it_is_cut_off() {
    let learned = LearnedMetric::shipped().expect("the shipped metric");
    let reference = table("ward-duer", &WARD);
    let loss = LearnedLoss::new(&learned, &reference).expect("valid");
    for alpha in [0.05, 0.12, 0.18, 0.3] {
        let candidate = build("ward-duer", &[0.3, 0.2, 0.1, 0.05, 0.06, 0.08, alpha]).expect("within bounds");
        let (found, distance) =
            (loss.value(&*candidate).expect("a value"), learned.distance(&reference, &*candidate).expect("a value"));
        assert_eq!(found.max(0.0), distance);
    }
}

#[test]
fn a_fit_under_the_learned_metric_is_better_under_it_than_the_log_fit() {
    let reference = table("ward-duer", &WARD);
    let (log, learned) = (metric("D9.Cl"), metric("vernis"));
    let of_log = fit(&Fitting::new("ggx", &*log), &reference);
    let of_learned = fit(&Fitting { max_evaluations: Some(150), ..Fitting::new("ggx", &*learned) }, &reference);
    let under = |fitted: &Fitted| learned.distance(&reference, &*fitted.model as &dyn Brdf).expect("a distance");
    assert!(under(&of_learned) < under(&of_log), "{} {}", under(&of_learned), under(&of_log));
    assert_eq!(of_learned.start, "log");
}

#[test]
fn a_search_that_ends_early_keeps_its_best() {
    let reference = table("ggx", &GGX);
    let metric = metric("D9.Cl");
    let fitted = fit(&Fitting { max_evaluations: Some(20), ..Fitting::new("ward", &*metric) }, &reference);
    assert_eq!(fitted.stop, StopReason::EvaluationLimit);
    assert!(fitted.value <= fitted.value_at_start);
}

#[test]
fn what_cannot_be_fitted_says_why() {
    let reference = table("ggx", &GGX);
    let refused = |fitting: &Fitting<'_>, reference: &dyn Brdf| -> FitError {
        fitting.run(reference, &|_, _| ()).err().expect("a mistake")
    };
    let (d4, d6, learned) = (metric("D4.Cl"), metric("D6"), metric("vernis"));
    let error = refused(&Fitting::new("ggxx", &*d4), &reference).to_string();
    assert!(error.starts_with("unknown model `ggxx`; did you mean ggx"), "{error}");
    let error = refused(&Fitting::new("ggx", &*d6), &reference).to_string();
    assert_eq!(error, "metric: found D6, allowed: a metric without jumps; D6 has some");
    let lbfgs = |model, metric| Fitting { method: Method::Lbfgs, ..Fitting::new(model, metric) };
    let error = refused(&lbfgs("ggx", &*learned), &reference).to_string();
    assert!(error.contains("the metric vernis has none"), "{error}");
    let error = refused(&Fitting { starts: 0, ..Fitting::new("ggx", &*d4) }, &reference).to_string();
    assert_eq!(error, "starts: found 0, allowed: 1 to 1000");
    let outside = Fitting { start: Some(Start::Parameters(vec![2.0; 7])), ..Fitting::new("ggx", &*d4) };
    assert!(refused(&outside, &reference).to_string().contains("ggx: kd.r is 2, allowed is 0 to 1"));
    assert!("newton".parse::<Method>().unwrap_err().to_string().contains("hooke-jeeves, nelder-mead, lbfgs"));
}

/// One measured cell beyond 80 degrees, where clamped metrics do not look.
#[test]
fn a_reference_without_a_valid_cell_is_refused() {
    let mut valid = vec![false; Grid::TITOPO_HALF.len()];
    *valid.last_mut().expect("cells") = true;
    let values = vec![[1.0; 3]; valid.len()];
    let reference = TabulatedBrdf::new(Grid::TITOPO_HALF, values, valid).expect("a table");
    let error = Fitting::new("ggx", &*metric("D4.Cl")).run(&reference, &|_, _| ()).err().expect("nothing to fit");
    assert_eq!(error.to_string(), "reference: the BRDF has no valid cell on the grid of the metric");
}

/// Ngan's fits (`ngan_wardduer.fit`, `ngan_blinnphong.fit`) were made under another loss: under D4.Cl ours are at least as good.
#[test]
fn published_fits_are_not_better_under_our_loss() {
    let Some(data) = std::env::var_os("VERNIS_DATA").map(PathBuf::from) else {
        println!("skipped: VERNIS_DATA is not set");
        return;
    };
    let open = |notation: &str| BrdfSource::parse(notation).expect("valid").open(Some(&data)).expect("present").brdf;
    let metric = metric("D4.Cl");
    for material in ["teflon", "blue-acrylic"] {
        let reference = open(&format!("merl_nbrdf.zip:{material}"));
        for (file, model) in [("ngan_wardduer.fit", "ward-duer"), ("ngan_blinnphong.fit", "blinn-phong")] {
            let published = metric.distance(&*reference, &*open(&format!("{file}:{material}"))).expect("a distance");
            let ours = fit(&Fitting::new(model, &*metric), &*reference);
            println!("{material} {model}: published {published:.5}, ours {:.5}", ours.value);
            assert!(ours.value <= published, "{material} {model}: {} {published}", ours.value);
        }
    }
}

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
        let args = ["fit", "ward.json", "--model", "blinn-phong", "--grid", "6", "--out", "fit.json"];
        place.run(&[&args[..], more].concat())
    };
    let output = fit(&["--json"]);
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
    assert_eq!(fit(&["--start", "fit.json"]).status.code(), Some(0));
    let early = fit(&["--max-evaluations", "10"]);
    assert_eq!(early.status.code(), Some(3));
    let said = String::from_utf8_lossy(&early.stderr).into_owned();
    assert!(said.contains("evaluations did not suffice"), "{said}");
    assert_eq!(place.run(&["compare", "ward.json", "fit.json", "--metric", "D1"]).status.code(), Some(0));
    assert_eq!(std::fs::read_dir(place.0.path()).expect("a folder").count(), 2, "nothing half-written is left");
}

#[test]
fn mistakes_at_the_command_line_are_named() {
    let place = Place::new();
    let text = place.mistake(&["fit", "ward.json", "--model", "gxg", "--out", "a.json"]);
    assert!(text.contains("unknown model `gxg`; did you mean ggx"), "{text}");
    let text = place.mistake(&["fit", "ward.json", "--model", "ggx", "--metric", "D4.Cll", "--out", "a.json"]);
    assert!(text.contains("there is no metric `D4.Cll`; similar: D4.Cl"), "{text}");
    let text = place.mistake(&["fit", "ward.json", "--model", "ggx", "--metric", "all-lp", "--out", "a.json"]);
    assert!(text.contains("several metrics"), "{text}");
    let text = place.mistake(&["fit", "ward.json", "--model", "ggx", "--start", "ward.json", "--out", "a.json"]);
    assert!(text.contains("found a ward-duer, allowed: parameters of ggx"), "{text}");
    let text = place.mistake(&["fit", "ward.json", "--model", "ggx", "--out", "a.txt"]);
    assert!(text.contains("allowed: the name of a .json file"), "{text}");
    let newer = r#"{"format": 2, "model": "ggx", "coefficients": []}"#;
    std::fs::write(place.0.path().join("newer.json"), newer).expect("writable");
    let text = place.mistake(&["compare", "ward.json", "newer.json", "--metric", "D1"]);
    assert!(
        text.contains("newer.json: format: found 2, allowed is 1 to 1; a newer file needs a newer vernis"),
        "{text}"
    );
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
    assert!(text.contains("--method: found WART, allowed: ABC, WARD"), "{text}");
}

#[test]
fn samples_of_a_manifold_are_written_and_leave_their_reference() {
    let place = Place::new();
    let ggx = r#"{"model":"ggx","kd":[0.1,0.2,0.3],"f0":[0.1,0.1,0.1],"alpha":0.3}"#;
    std::fs::write(place.0.path().join("ggx.json"), ggx).expect("writable");
    let manifold = |more: &[&str]| {
        let args = ["manifold", "--reference", "ward.json", "--reference", "ggx.json", "--out", "samples"];
        place.run(&[&args[..], more].concat())
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
    assert!(text.contains("allowed: an integer of at least 1"), "{text}");
    let text = String::from_utf8(manifold(&["--material", "teflon"]).stderr).expect("UTF-8");
    assert!(text.contains("--material: found teflon, allowed: ggx.json, ward.json"), "{text}");
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
