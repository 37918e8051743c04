//! Small and odd studies: what they do not support is left out with a sentence or refused at once, a path is a path, arguments
//! have limits, and inputs that contradict each other are refused.

use ndarray::Array2;
use rand::Rng;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::time::Instant;
use vernis::brdf::{BrdfSource, ContentHash};
use vernis::dataset::{Completeness, RatedPair, Study};
use vernis::descriptor::{Column, DescriptorSet, Role, VERSION};
use vernis::experiment::train::metrics;
use vernis::math::seed;
use vernis::samples::Samples;
use vernis::samples::extracted::{ExtractedStudy, Versions};
use vernis::samples::shard::Shard;

fn run(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
    command.args(args).current_dir(folder).env_remove("VERNIS_DATA").env("VERNIS_CACHE", folder.join("cache"));
    command.output().expect("the program starts")
}

/// What was said on standard error of a run that must succeed.
fn done(folder: &Path, args: &[&str]) -> String {
    let output = run(folder, args);
    let said = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(0), "{args:?}: {said}");
    said
}

/// A mistake of the user's, found before any work.
fn refused(folder: &Path, args: &[&str], parts: &[&str]) {
    let started = Instant::now();
    let output = run(folder, args);
    let said = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
    assert!(output.stdout.is_empty(), "{args:?}");
    for part in parts {
        assert!(said.contains(part), "{args:?}: `{said}` does not say `{part}`");
    }
    assert!(started.elapsed().as_secs() < 30, "{args:?} took {} s", started.elapsed().as_secs());
}

/// An extracted study of `materials` materials with `per` candidates each, whose numbers are made up to agree with its scores;
/// `row` and `value` may change rows and numbers, which are named by row and column.
fn extracted(
    [materials, per]: [usize; 2],
    row: &dyn Fn(usize, &mut RatedPair),
    value: &dyn Fn(usize, &Column) -> Option<f64>,
) -> ExtractedStudy {
    let pair = |k: usize| {
        let name = format!("m{}", k / per);
        let mut pair = RatedPair {
            reference: BrdfSource::Notation(format!("{name}.binary")),
            candidate: BrdfSource::Notation(format!("c{k}.binary")),
            material: name.clone(),
            group: name,
            method: "unnamed".into(),
            method_family: "unnamed".into(),
            material_type: None,
            mos: 1.2 + 3.6 * ((k * 37) % 60) as f64 / 60.0,
            weight: 1.0,
        };
        row(k, &mut pair);
        pair
    };
    let pairs: Vec<RatedPair> = (0..materials * per).map(pair).collect();
    let completeness = Completeness { found: pairs.len(), known: pairs.len() };
    let study = Study { pairs, completeness, name: "odd.csv".into(), ..Study::load("synthetic", None).unwrap() };
    let metrics = metrics(&study).unwrap();
    let mut columns = DescriptorSet::all().columns();
    columns.extend(metrics.iter().map(|metric| Column {
        name: metric.name().to_owned(),
        family: metric.properties().family.to_owned(),
        role: Role::Difference,
    }));
    let mut random = seed::stream(5, "odd study", 0);
    let values = Array2::from_shape_fn((study.pairs.len(), columns.len()), |(row, column)| {
        let column = &columns[column];
        let quality = if column.role == Role::Difference { 5.0 - study.pairs[row].mos } else { 1.0 };
        let made_up = quality * (0.5 + random.random::<f64>());
        value(row, column).unwrap_or(made_up)
    });
    let samples = Samples::new(columns, study.pairs.iter().map(RatedPair::row).collect(), values.clone()).unwrap();
    let hash = |text: &str| ContentHash::of(text.as_bytes());
    ExtractedStudy {
        samples: samples.with_swapped(values).unwrap(),
        contents: study.pairs.iter().enumerate().map(|(k, p)| [hash(&p.material), hash(&format!("c{k}"))]).collect(),
        places: (0..study.pairs.len()).collect(),
        whole: study.pairs.len(),
        shard: Shard::WHOLE,
        versions: Versions::new(&format!("v{VERSION}-lamps-sphere"), &metrics),
        study,
    }
}

fn write(folder: &Path, extracted: &ExtractedStudy) {
    fs::write(folder.join("odd.parquet"), extracted.to_parquet().unwrap()).unwrap();
}

const AS_IT_IS: fn(usize, &Column) -> Option<f64> = |_, _| None;

fn record(folder: &Path) -> Value {
    serde_json::from_slice(&fs::read(folder.join("out/benchmark.json")).unwrap()).unwrap()
}

fn has(record: &Value, metric: &str) -> bool {
    record["metrics"].as_array().unwrap().iter().any(|m| m["name"] == metric)
}

/// Sentences stand on standard error and in the record and the report.
fn left_out(folder: &Path, said: &str, parts: &[&str]) {
    let record = record(folder);
    let report = fs::read_to_string(folder.join("out/report.md")).unwrap();
    let sentences: Vec<&str> = record["left_out"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    for part in parts {
        let found = sentences.iter().find(|s| s.contains(part));
        let sentence = found.unwrap_or_else(|| panic!("nothing says `{part}` among {sentences:#?}"));
        assert_eq!(said.matches(sentence).count(), 1, "{said}");
        assert!(report.contains(sentence), "{report}");
    }
}

#[test]
fn a_study_of_one_method_is_trained() {
    let place = tempfile::tempdir().unwrap();
    write(place.path(), &extracted([8, 4], &|_, _| (), &AS_IT_IS));
    let options = ["--extracted", "odd.parquet", "--folds", "4", "--resamples", "40", "--out", "out"];
    let said = done(place.path(), &[&["train", "--name", "mine"], &options[..]].concat());
    let parts = [
        "The split by unseen material and method is left out: all rows name one family of methods, unnamed",
        "The split by unseen material type is left out: the study names no types of material",
        "The baseline mean-of-method is left out: the study names one method",
    ];
    left_out(place.path(), &said, &parts);
    assert!(place.path().join("out/mine.vernis.json").is_file() && place.path().join("out/metrics.csv").is_file());
    let record = record(place.path());
    assert_eq!(record["learning_curve"].as_array().unwrap().len(), 5);
    assert!(!record["ablation"].as_array().unwrap().is_empty() && !has(&record, "mean-of-method"));
}

#[test]
fn the_smallest_study_that_is_not_refused_is_measured() {
    let place = tempfile::tempdir().unwrap();
    // Each training side: 8 rows of 2 materials. One row names no type, and no two materials share a method.
    let row = |k: usize, pair: &mut RatedPair| {
        pair.method = format!("a{k}");
        pair.method_family = format!("a{}", k % 2);
        pair.material_type = (k > 0).then(|| if k < 4 { "Metal" } else { "Wood" }.to_owned());
    };
    write(place.path(), &extracted([3, 4], &row, &AS_IT_IS));
    let options = ["benchmark", "--extracted", "odd.parquet", "--resamples", "40", "--out", "out", "--folds"];
    let said = done(place.path(), &[&options[..], &["3"]].concat());
    let parts = [
        "unseen material and method is left out: to judge a0, a fold would train on 2 rows of 1 group of materials",
        "unseen material type is left out: 1 of 12 rows name no type of material",
        "mean-of-method is left out: no method is rated on two groups of materials",
        "The learning curve is left out: with 20 % of the training materials a fold would train on 4 rows of 1 group",
        "Learned embeddings are left out of the ablation: a fold would learn them from 2 materials",
    ];
    left_out(place.path(), &said, &parts);
    refused(
        place.path(),
        &[&options[..], &["2"]].concat(),
        &["study odd.csv: fold 1 of 2 would train on 4 rows of 1 group of materials", "must have at least 8 rows of"],
    );
}

#[test]
fn odd_numbers_are_left_out_or_refused() {
    let place = tempfile::tempdir().unwrap();
    let options =
        ["benchmark", "--extracted", "odd.parquet", "--folds", "3", "--resamples", "40", "--out", "out", "--replace"];
    // One row a material, descriptors of which most are constant, and a distance that says the same of every pair.
    let value = |_: usize, column: &Column| match column.family.as_str() {
        "angular" | "context" => Some(1.0),
        _ => (column.name == "D2").then_some(0.5),
    };
    write(place.path(), &extracted([15, 1], &|_, _| (), &value));
    let said = done(place.path(), &options);
    let parts = ["D2 is left out: ", "The correlation within materials is left out: no material has 3 candidates"];
    left_out(place.path(), &said, &parts);
    let found = record(place.path());
    assert!(has(&found, "vernis") && has(&found, "D1") && !has(&found, "D2"));
    // Pairs whose BRDFs do not differ, whatever their files are called.
    let same = |_: usize, column: &Column| (column.role == Role::Difference).then_some(0.0);
    write(place.path(), &extracted([15, 1], &|_, _| (), &same));
    refused(
        place.path(),
        &options,
        &["fold 1 of 3 would train on 10 rows of 10 groups whose descriptors do not differ"],
    );
    let equal = |k: usize, pair: &mut RatedPair| pair.mos = if k < 2 { 1.0 + k as f64 } else { 3.0 };
    write(place.path(), &extracted([6, 2], &equal, &AS_IT_IS));
    refused(place.path(), &options, &["groups whose ratings are all 3; the training side of every fold must have"]);
}

#[test]
fn what_was_measured_stays_when_a_later_step_fails() {
    let place = tempfile::tempdir().unwrap();
    write(place.path(), &extracted([6, 3], &|_, _| (), &AS_IT_IS));
    // A folder of that name cannot be replaced by a file.
    fs::create_dir_all(place.path().join("out/mine.vernis.json/x")).unwrap();
    let options = ["--extracted", "odd.parquet", "--folds", "3", "--resamples", "40", "--out", "out", "--replace"];
    let output = run(place.path(), &[&["train", "--name", "mine"], &options[..]].concat());
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("the measurement is finished and written (out/benchmark.json), but what follows it failed"));
    for file in ["benchmark.json", "metrics.csv", "predictions.csv", "report.html"] {
        assert!(place.path().join("out").join(file).is_file(), "{file}");
    }
}

const WARD: &str = r#"{"model":"ward","kd":[0.2,0.1,0.05],"ks":[0.1,0.1,0.1],"alpha":0.15}"#;
const GGX: &str = r#"{"model":"ggx","kd":[0.2,0.1,0.05],"f0":[0.04,0.04,0.04],"alpha":0.2}"#;

/// A folder with a study of two materials, as a CSV file called `name`.
fn rated(name: &str) -> tempfile::TempDir {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("ward.json"), WARD).unwrap();
    fs::write(place.path().join("ggx.json"), GGX).unwrap();
    let rows = "ward.json,ggx.json,4.1,m1,A\nward.json,ggx.json?alpha=0.4,2.1,m1,B\n\
                ggx.json,ward.json,3.8,m2,A\nggx.json,ward.json?alpha=0.5,1.5,m2,B\n";
    fs::write(place.path().join(name), format!("reference,candidate,mos,material,method\n{rows}")).unwrap();
    place
}

#[test]
fn a_path_is_a_path_whatever_the_file_is_called() {
    // The last has no ending; with a folder before it, it is a path all the same.
    for (name, path) in [
        ("good.csv", "good.csv"),
        ("synthetic.csv", "synthetic.csv"),
        ("my.study.csv", "my.study.csv"),
        ("synthetic", "./synthetic"),
    ] {
        let place = rated(name);
        done(place.path(), &["report", "--study", path, "--out", "page"]);
        let html = fs::read_to_string(place.path().join("page/report.html")).unwrap();
        // Two references and four candidates, not the embedded study's 389.
        assert_eq!(html.matches("<img").count(), 6, "{name}");
        assert!(!html.contains("SYNTHETIC"), "{name}");
        let expected = if name == path { name.to_owned() } else { path.to_owned() };
        let study: Value = serde_json::from_slice(&fs::read(place.path().join("page/study.json")).unwrap()).unwrap();
        assert_eq!(study["study"], expected.as_str());
        assert!(study["command"].as_str().unwrap().starts_with(&format!("vernis study --study {expected} ")));
    }
    // Results lie under the name without its ending.
    let place = rated("my.study.csv");
    done(place.path(), &["study", "--study", "my.study.csv"]);
    assert!(place.path().join("out/my.study/study.json").is_file());
}

#[test]
fn inputs_that_contradict_each_other_are_refused() {
    let place = rated("good.csv");
    let judged = |change: &dyn Fn(&mut Value)| {
        let mut record = serde_json::to_value(super::report::record_of_the_embedded_study()).unwrap();
        change(&mut record);
        fs::write(place.path().join("benchmark.json"), record.to_string()).unwrap();
    };
    let report = |study: &'static str| ["report", "--study", study, "--benchmark", "benchmark.json", "--out", "page"];
    judged(&|_| ());
    refused(
        place.path(),
        &report("good.csv"),
        &["benchmark.json belongs to another study than good.csv", "its ratings are those of simulated observers"],
    );
    judged(&|record| record["synthetic"] = false.into());
    refused(place.path(), &report("good.csv"), &["than good.csv: its study is synthetic"]);
    judged(&|record| (record["synthetic"], record["study"]) = (false.into(), "good".into()));
    refused(place.path(), &report("good.csv"), &["it has the pair ", ", which the study has not"]);
    judged(&|record| {
        (record["synthetic"], record["study"]) = (false.into(), "good".into());
        record["predictions"] = Value::Array(Vec::new());
    });
    done(place.path(), &report("good.csv"));
    let ratings = "participant,material,method,score\np,m1,A,1\nq,m1,A,2\np,m1,B,5\nq,m1,B,4\n";
    fs::write(place.path().join("raw.csv"), ratings).unwrap();
    refused(
        place.path(),
        &["study", "--study", "good.csv", "--ratings", "raw.csv"],
        &["raw.csv contradicts the study good.csv", "m1, A has a mean of 1.50 in the ratings and 4.10 in the study"],
    );
    write(place.path(), &extracted([6, 3], &|_, _| (), &AS_IT_IS));
    for study in ["good.csv", "synthetic"] {
        refused(
            place.path(),
            &["benchmark", "--extracted", "odd.parquet", "--study", study, "--folds", "2"],
            &["odd.parquet was not extracted from the study", "it holds the study odd.csv"],
        );
    }
}

#[test]
fn arguments_out_of_range_are_refused_before_the_work() {
    let place = rated("good.csv");
    let train = ["train", "--study", "good.csv"];
    for (option, value, part) in [
        ("--resamples", "99999999999", "it must be an integer from 40 to 20000"),
        ("--resamples", "20001", "it must be an integer from 40 to 20000"),
        ("--folds", "1000000", "it must be an integer from 2 to 1000"),
        ("--folds", "1", "it must be an integer from 2 to 1000"),
        ("--folds", "3", "study good.csv has 2 groups of materials; 3 folds need at least 3"),
        ("--seed", "-1", "-1"),
        ("--seed", "99999999999999999999", "it must be an integer from 0 to 18446744073709551615"),
        ("--threads", "1025", "it must be 1 to 1024"),
        ("--name", "../evil", "it must begin with a letter or digit"),
        ("--name", "D9.Cl", "--name is D9.Cl, which is a metric of vernis itself"),
        ("--lights", "nowhere.hdr", "nowhere.hdr"),
        ("--lights", ".", "it is a folder; it must be a regular file"),
        ("--shape", "nowhere.ply", "it must be the name of a file"),
        ("--extracted", "nowhere.parquet", "nowhere.parquet: "),
    ] {
        refused(place.path(), &[&train[..], &[option, value]].concat(), &[part]);
    }
    for (command, part) in [
        (&["extract", "--study", "good.csv", "--shard", "1/99999999999"][..], "COUNT up to 1000000"),
        (&["train", "--study", "synthetic", "--out", "ward.json"], "ward.json: cannot write there"),
        (&["extract", "--study", "good.csv", "--out", "ward.json"], "ward.json: cannot write there"),
        (&["study", "--study", "good.csv", "--out", "ward.json"], "ward.json: cannot write there"),
        (&["study", "--ratings", "nowhere.csv"], "nowhere.csv: "),
        (&["report", "--study", "good.csv", "--out", "ward.json"], "ward.json: cannot write there"),
        (&["refit", "--study", "good.csv", "--out", "x", "--coarsening", "0"], "it must be an integer from 1 to 15"),
        (&["sweep", "--study", "good.csv", "--resamples", "1"], "it must be an integer from 40 to 20000"),
        (&["sweep", "--study", "good.csv", "--folds", "0"], "it must be an integer from 2 to 1000"),
        (
            &["manifold", "--study", "good.csv", "--material", "m1", "--out", "x", "--dimension", "0"],
            "it must be an integer from 1 to 1000",
        ),
        (
            &["fit", "ward.json", "--model", "ggx", "--out", "x.json", "--coarsening", "16"],
            "it must be an integer from 1 to 15",
        ),
        // As it was called before.
        (
            &["fit", "ward.json", "--model", "ggx", "-m", "D4.Cl", "--out", "x.json", "--grid", "16"],
            "coarsening is 16; it must be 1 to 15 cells",
        ),
        (
            &["fit", "ward.json", "--model", "ggx", "--out", "x.json", "--starts", "1001"],
            "it must be an integer from 1 to 1000",
        ),
        (
            &["fit", "ward.json", "--model", "ggx", "--out", "x.json", "--max-evaluations", "1"],
            "it must be an integer from 10 to 100000000",
        ),
        (&["experiment", "losses", "--out", "x", "--materials", "1"], "it must be an integer from 2 to 10000"),
        (&["experiment", "losses", "--out", "x", "--max-evaluations", "9"], "it must be an integer from 10 to 1000000"),
        (&["experiment", "noise", "--study", "good.csv", "--a", "1.5"], "it must be a number from 0 to 1"),
        (&["experiment", "noise", "--study", "good.csv", "--raters", "0"], "it must be an integer from 1 to 100000"),
        (
            &["experiment", "triplets", "--triplets", "no.json", "--materials", "no.txt"],
            "it must be the name of a file",
        ),
    ] {
        refused(place.path(), command, &[part]);
    }
}

#[test]
fn the_bound_of_noise_and_triplets_are_printed() {
    let place = rated("good.csv");
    let text = |args: &[&str]| {
        let output = run(place.path(), args);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let noise = ["experiment", "noise", "--study", "good.csv", "--simulations", "40"];
    let found: Value = serde_json::from_str(&text(&[&noise[..], &["--json"]].concat())).unwrap();
    assert_eq!(
        (found["a"].as_f64(), found["raters"].as_f64(), found["stimuli"].as_u64()),
        (Some(0.2), Some(30.0), Some(4))
    );
    let plcc = found["plcc"]["value"].as_f64().unwrap();
    assert!(plcc > 0.9 && plcc < 1.0, "{plcc}");
    assert!(text(&noise).contains(&format!("| PLCC | {plcc:.3} | [")));
    let votes = r#"{"answers":[[0,1,2],[0,2,1],[1,0,2],[2,1,0]],"agreement":[[3,1],[1,3],[2,2],[0,0]]}"#;
    fs::write(place.path().join("votes.json"), votes).unwrap();
    fs::write(place.path().join("names.txt"), "0\tteflon\n1\tnylon\n2\tchrome\n").unwrap();
    let fits = ["teflon", "nylon", "chrome"].iter().enumerate().map(|(k, name)| {
        format!(
            "{name} = Aggregate(Lambertian(albedo = [0.3, 0.3, 0.3]), NganWard(albedo = [0.1, 0.1, 0.1], roughness = {}))\n",
            0.1 + 0.1 * (k * k) as f64
        )
    });
    fs::write(place.path().join("some.fit"), fits.collect::<String>()).unwrap();
    let triplets = ["experiment", "triplets", "--metric", "D1", "--metric", "vernis", "--triplets", "votes.json"];
    let more = ["--materials", "names.txt", "--archive", "some.fit", "--resamples", "40", "--json"];
    let found: Value = serde_json::from_str(&text(&[&triplets[..], &more].concat())).unwrap();
    assert_eq!(
        (found["triplets"].as_u64(), found["votes"].as_u64(), found["untied"].as_u64()),
        (Some(3), Some(12), Some(2))
    );
    assert_eq!(found["most"].as_f64(), Some(8.0 / 12.0));
    for metric in found["metrics"].as_array().unwrap() {
        // Nylon is nearer to teflon than chrome is: 3 of 4 votes, twice, and 2 of 4.
        assert_eq!(
            (metric["votes"]["value"].as_f64(), metric["majority"]["value"].as_f64()),
            (Some(8.0 / 12.0), Some(1.0))
        );
    }
}
