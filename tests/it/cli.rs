//! The program itself: what it prints and writes, and what it says of wrong input.

use crate::data_folder;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;
use tempfile::TempDir;
use vernis::brdf::formats::merl;
use vernis::brdf::models::Lambert;
use vernis::brdf::{Grid, TabulatedBrdf};
use vernis::descriptor::{Cache, Setup};

/// One cache for all tests, in which the picture operators are ready. It starts empty and lies in the build folder.
static CACHE: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cli-cache");
    if folder.exists() {
        fs::remove_dir_all(&folder).expect("a folder of ours");
    }
    let cache = Cache::open(&folder).expect("writable");
    assert_eq!(cache.prepare(&Setup::standard()), None);
    folder
});

const WARD: &str = r#"{"model":"ward","kd":[0.2,0.1,0.05],"ks":[0.1,0.1,0.1],"alpha":0.15}"#;
const GGX: &str = r#"{"model":"ggx","kd":[0.2,0.1,0.05],"f0":[0.04,0.04,0.04],"alpha":0.2}"#;

/// A folder with two models, in which the program runs.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().expect("temporary folder"));
        place.write("ward.json", WARD);
        place.write("ggx.json", GGX);
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).expect("writable");
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).expect("a file of text")
    }

    /// Runs without a data folder, with the shared cache unless `args` name one.
    fn run(&self, args: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
        command.args(args).current_dir(self.0.path()).env_remove("VERNIS_DATA").env_remove("VERNIS_CACHE");
        if !args.contains(&"--cache") {
            command.arg("--cache").arg(&*CACHE);
        }
        command.output().expect("the program starts")
    }

    /// Standard output of a run that must succeed.
    fn output(&self, args: &[&str]) -> String {
        let output = self.run(args);
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{args:?}: {error}");
        assert_eq!(error, "", "{args:?}");
        String::from_utf8(output.stdout).expect("UTF-8")
    }

    fn json(&self, args: &[&str]) -> Value {
        serde_json::from_str(&self.output(args)).expect("valid JSON")
    }

    /// The message of a run that must fail by the user's mistake: exit code 2, one line, no output.
    fn mistake(&self, args: &[&str]) -> String {
        let output = self.run(args);
        let error = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(2), "{args:?}: {error}");
        assert!(output.stdout.is_empty(), "{args:?}");
        assert_eq!(error.lines().count(), 1, "{args:?}: {error}");
        error.strip_prefix("vernis: ").expect("the name of the program").trim_end().to_owned()
    }
}

/// Fails unless `message` holds every one of `parts`.
fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{message}` does not say `{part}`");
    }
}

#[test]
fn a_model_compared_with_itself_is_at_distance_zero() {
    let place = Place::new();
    let found =
        place.json(&["compare", "ward.json", "ward.json", "--metric", "all-lp", "--metric", "vernis", "--json"]);
    let distances = found["distances"].as_object().expect("distances by name");
    assert_eq!(distances.len(), 37);
    for (name, value) in distances {
        assert_eq!(value, &json!(0.0), "{name}");
    }
    let mos = &found["mos"]["vernis"];
    assert_eq!(found["mos"].as_object().map(|m| m.len()), Some(1));
    let [low, mos, high] = ["low", "mos", "high"].map(|key| mos[key].as_f64().expect("a number"));
    assert!(1.0 <= low && low <= mos && mos <= high && high <= 5.0 && mos > 4.0);
    assert!(found.get("channels").is_none());
}

#[test]
fn compare_prints_the_same_numbers_as_text_and_as_json() {
    let place = Place::new();
    let args = ["compare", "ward.json", "ggx.json", "-m", "vernis", "-m", "D1", "-m", "D6", "--per-channel"];
    let found = place.json(&[&args[..], &["--json"]].concat());
    let value = |name: &str| found["distances"][name].as_f64().expect("a number");
    let names: Vec<&str> = found["distances"].as_object().expect("an object").keys().map(String::as_str).collect();
    assert_eq!(names, ["D1", "D6", "vernis"]);
    // Every number comes with the version of what made it: those that `vernis metrics` lists.
    let listed = place.json(&["metrics", "--json"]);
    for metric in listed.as_array().expect("a list").iter().filter(|m| names.iter().any(|name| m["name"] == *name)) {
        assert_eq!(found["versions"][metric["name"].as_str().unwrap()], metric["version"], "{metric}");
    }
    assert_eq!(found["versions"].as_object().map(|v| v.len()), Some(3));
    assert!(value("vernis") > 0.0 && value("D1") > 0.0);
    // D1 is the root of the sum of the channels' squares; D6 has no channels.
    let channels: Vec<f64> = serde_json::from_value(found["channels"]["D1"].clone()).expect("three numbers");
    assert!((channels.iter().map(|c| c * c).sum::<f64>().sqrt() / value("D1") - 1.0).abs() < 1e-12);
    assert_eq!(found["channels"].as_object().map(|c| c.len()), Some(1));

    let text = place.output(&args);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 3, "{text}");
    for (line, name) in lines.iter().zip(["vernis", "D1", "D6"]) {
        assert!(line.starts_with(name) && line.contains(&format!("{:.6}", value(name))), "{line}");
    }
    assert!(lines[0].contains(&format!("predicted MOS {:.2} of 5", found["mos"]["vernis"]["mos"].as_f64().unwrap())));
    assert!(lines[1].contains(&format!("R {:.6}", channels[0])) && !lines[2].contains("R "));
}

/// A metric that was learned from ratings of another scale speaks that scale.
#[test]
fn compare_tells_scores_on_the_scale_of_the_metric() {
    use vernis::math::rating_scale::RatingScale;
    use vernis::metric::learned::LearnedMetric;
    let place = Place::new();
    let shipped = LearnedMetric::shipped().unwrap().exported().clone();
    for (name, worst, best) in [("percent", 0.0, 100.0), ("dmos", 100.0, 0.0)] {
        let scale = RatingScale::new(worst, best).unwrap();
        let mut metric = shipped.clone().on_scale(scale).unwrap();
        metric.name = name.to_owned();
        let file = format!("{name}.vernis.json");
        place.write(&file, metric.to_json().unwrap());
        let args = ["compare", "ward.json", "ggx.json", "--metric", "vernis", "--metric", &file];
        let found: Value = serde_json::from_str(&place.output(&[&args[..], &["--json"]].concat())).unwrap();
        let of = |metric: &str, key: &str| found["mos"][metric][key].as_f64().unwrap();
        assert!((of(name, "mos") - scale.score(of("vernis", "mos"))).abs() < 1e-9);
        assert_eq!(found["mos"][name]["scale"], json!({"worst": worst, "best": best}));
        assert_eq!(found["mos"]["vernis"]["scale"], json!({"worst": 1.0, "best": 5.0}));
        let distance = |metric: &str| found["distances"][metric].as_f64().unwrap();
        assert!((distance(name) - 25.0 * distance("vernis")).abs() < 1e-9);
        let text = place.output(&args);
        let expected =
            format!("predicted score {:.1} on {worst} (worst) to {best} (best), 95 % between", of(name, "mos"));
        assert!(text.contains(&expected), "{text}");
    }
}

#[test]
fn score_keeps_the_rows_and_adds_columns() {
    let place = Place::new();
    let pairs = "note,candidate,reference\n\"a, quoted\",ggx.json,ward.json\n\nb,ward.json,ward.json\nc,ward.json?alpha=0.3,ward.json\n";
    place.write("pairs.csv", pairs);
    let args = ["score", "pairs.csv", "--metric", "vernis", "--metric", "D9.Cl", "--out", "new/scores.csv"];
    let said = place.output(&args);
    assert_says(&said, &["3 pairs, 2 metrics: new/scores.csv"]);
    let text = place.read("new/scores.csv");
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header: Vec<&str> = reader.headers().expect("a header").iter().collect::<Vec<_>>();
    assert_eq!(header, ["note", "candidate", "reference", "vernis", "D9.Cl", "mos", "mos_low", "mos_high", "reason"]);
    let rows: Vec<csv::StringRecord> = reader.records().collect::<Result<_, _>>().expect("whole rows");
    assert_eq!(rows.iter().map(|r| &r[0]).collect::<Vec<_>>(), ["a, quoted", "b", "c"]);
    assert_eq!((&rows[1][3], &rows[1][4]), ("0", "0"));
    let found = place.json(&["compare", "ward.json", "ggx.json", "-m", "vernis", "-m", "D9.Cl", "--json"]);
    for (column, value) in [(3, &found["distances"]["vernis"]), (4, &found["distances"]["D9.Cl"])] {
        assert_eq!(rows[0][column].parse::<f64>().ok(), value.as_f64());
    }
    for (column, key) in [(5, "mos"), (6, "low"), (7, "high")] {
        assert_eq!(rows[0][column].parse::<f64>().ok(), found["mos"]["vernis"][key].as_f64());
    }
}

#[test]
fn metrics_are_listed() {
    let place = Place::new();
    let listed = place.json(&["metrics", "--json"]);
    let names: Vec<&str> = listed.as_array().expect("a list").iter().filter_map(|m| m["name"].as_str()).collect();
    assert!(["vernis", "D1", "D1.Cl.CR", "D9.Cl", "lab"].iter().all(|name| names.contains(name)), "{names:?}");
    let on = |name: &str| listed.as_array().and_then(|all| all.iter().find(|m| m["name"] == name)).map(|m| &m["on"]);
    assert_eq!(
        [on("D1"), on("ssim"), on("matsim")],
        [Some(&json!("brdfs")), Some(&json!("pictures")), Some(&json!("pictures"))]
    );
    let text = place.output(&["metrics"]);
    assert!(names.iter().all(|name| text.lines().any(|line| line.split_whitespace().next() == Some(*name))));
    assert_says(&text, &["all-lp"]);
}

#[test]
fn describe_tells_what_a_brdf_is() {
    let place = Place::new();
    let found = place.json(&["describe", "ward.json", "--json"]);
    assert_eq!(found["brdf"], "ward.json");
    assert_eq!(found["versions"]["vernis"], env!("CARGO_PKG_VERSION"));
    assert_eq!(found["versions"]["descriptors"], vernis::descriptor::VERSION);
    assert_eq!(found["sha256"].as_str().map(str::len), Some(64));
    assert_eq!(found["cells"], Value::Null);
    assert_eq!(found["descriptors"].as_object().map(|d| d.len()), Some(10));
    // Ward at normal incidence: kd / pi + ks / (4 pi alpha^2).
    let expected = (0.2 + 0.1 / (4.0 * 0.15 * 0.15)) / std::f64::consts::PI;
    let normal = found["mirror"][0]["rgb"][0].as_f64().expect("a number");
    assert!((normal / expected - 1.0).abs() < 1e-9, "{normal} {expected}");
    let text = place.output(&["describe", "ward.json", "--descriptors"]);
    assert_says(&text, &["mirror direction at  0 deg: 0.41", "descriptors of a pair:", "lights.dE"]);
}

#[test]
fn data_list_says_what_is_missing_and_where_to_get_it() {
    let place = Place::new();
    let text = place.output(&["data", "list"]);
    assert_says(&text, &["no data folder", "lavoue2021-open: ", "missing", "https://", "synthetic: "]);
    fs::create_dir(place.path("data")).expect("writable");
    let text = place.output(&["data", "list", "--data", "data"]);
    assert_says(&text, &["data folder: data\n", "0 of "]);
    assert_says(&place.output(&["data", "list", "--data", "nowhere"]), &["nowhere (no such folder)"]);
    let studies = place.json(&["data", "list", "--json"]);
    let names: Vec<&str> = studies.as_array().expect("a list").iter().filter_map(|s| s["name"].as_str()).collect();
    assert!(["lavoue2021", "lavoue2021-open", "synthetic"].iter().all(|name| names.contains(name)));
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn data_list_counts_the_rated_pairs_of_a_data_folder() {
    let data = data_folder();
    let place = Place::new();
    let studies = place.json(&["data", "list", "--json", "--data", &data.to_string_lossy()]);
    let open = studies.as_array().expect("a list").iter().find(|s| s["name"] == "lavoue2021-open").expect("known");
    assert!(open["pairs"]["found"].as_u64() > Some(0));
    assert_eq!(open["problem"], Value::Null);
}

#[test]
fn every_subcommand_explains_itself() {
    let place = Place::new();
    let mut commands = vec!["compare", "score", "metrics", "describe", "study", "data"];
    if cfg!(feature = "train") {
        commands.extend(["train", "benchmark", "extract", "merge"]);
    }
    let overview = place.output(&["--help"]);
    for command in commands {
        assert_says(&overview, &[command]);
        assert_says(&place.output(&[command, "--help"]), &["Usage: vernis", "--data", "--cache", "--threads"]);
    }
    assert_says(&place.output(&["data", "list", "--help"]), &["Examples:"]);
}

#[test]
fn empty_variables_mean_nothing_was_given() {
    let place = Place::new();
    let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
    command.args(["data", "list"]).current_dir(place.0.path()).env("VERNIS_DATA", "").env("VERNIS_CACHE", "");
    let output = command.output().expect("the program starts");
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    assert_says(&String::from_utf8_lossy(&output.stdout), &["no data folder"]);
}

#[test]
fn damaged_tables_are_named_with_what_is_wrong() {
    let place = Place::new();
    let table = TabulatedBrdf::tabulate(&Lambert { kd: [0.5; 3] }, Grid::MERL).expect("finite model");
    merl::write(&place.path("good.binary"), &table).expect("writable");
    let good = fs::read(place.path("good.binary")).expect("just written");
    // Plane G, theta_h 45, theta_d 30, phi_d 77.
    let with_cell = |value: f64| {
        let start = 12 + 8 * (Grid::MERL.len() + (45 * 90 + 30) * 180 + 77);
        [&good[..start], &value.to_le_bytes(), &good[start + 8..]].concat()
    };
    let mut header = good.clone();
    header[8] = 181;
    let cases: [(&str, &[u8], &[&str]); 5] = [
        ("cut.binary", &good[..good.len() / 2], &["the file has 17496006 bytes", "34992012"]),
        ("long.binary", &[&good[..], &[0]].concat(), &["the file has 34992013 bytes", "34992012"]),
        ("header.binary", &header, &["the header says 90x90x181", "90x90x180 or 90x90x360"]),
        ("nan.binary", &with_cell(f64::NAN), &["G plane", "theta_h 45", "holds NaN", "finite"]),
        ("cut.titopoh", &good[..1000], &["the file has 1000 bytes", "4374000"]),
    ];
    for (name, bytes, parts) in cases {
        place.write(name, bytes);
        let message = place.mistake(&["compare", "ward.json", name, "-m", "D1"]);
        assert!(message.starts_with(&format!("{name}: ")), "{message}");
        assert_says(&message, parts);
    }
    place.write("negative.binary", with_cell(-1.0));
    place.output(&["compare", "good.binary", "negative.binary", "-m", "D1"]);
}

#[test]
fn what_does_not_exist_brings_the_nearest_names() {
    let place = Place::new();
    let fits = "teflon = Aggregate(Lambertian(albedo = [0.3, 0.3, 0.3]), NganWard(albedo = [0.1, 0.1, 0.1], roughness = 0.1))\n";
    place.write("some.fit", fits);
    place.write("odd.json", WARD.replace("ward", "wrad"));
    place.write("extra.json", WARD.replace("alpha", "alhpa"));
    for (args, parts) in [
        (["some.fit:teflom", "D1"], &["some.fit: ", "no material `teflom`", "teflon"][..]),
        (["ggx.json", "D9.Lc"], &["no metric `D9.Lc`", "did you mean D9.Cl"]),
        (["ggx.json", "all-pl"], &["no metric `all-pl`", "all-lp"]),
        (["odd.json", "D1"], &["odd.json: unknown model `wrad`", "did you mean ward", "the models are lambert"]),
        (["extra.json", "D1"], &["extra.json: ward has no parameter `alhpa`", "did you mean alpha", "kd, ks, alpha"]),
        (["nowhere.binary", "D1"], &["nowhere.binary: no such file; looked for nowhere.binary"]),
        (["ggx.xyz", "D1"], &["`ggx.xyz` is not a BRDF source", "extension `xyz`", "write it as PATH.binary"]),
        (["ggx.json", "nowhere.vernis.json"], &["nowhere.vernis.json: cannot be read", "No such file"]),
        (["ggx.json", "ward.json"], &["ward.json, line 1", "not an exported metric"]),
    ] {
        assert_says(&place.mistake(&["compare", "ward.json", args[0], "--metric", args[1]]), parts);
    }
}

#[test]
fn csv_files_of_pairs_are_refused_by_line() {
    let place = Place::new();
    for (text, parts) in [
        (
            "reference,other\nward.json,ggx.json\n",
            &["pairs.csv, line 1: no column `candidate`", "reference, other"][..],
        ),
        (
            "reference,candidate\nward.json,ggx.json\n\nward.json\n",
            &["pairs.csv, line 4: the number of fields is 1; it must be 2, as in the header"],
        ),
        ("reference,candidate\nward.json,\n", &["pairs.csv, line 2: `candidate` is empty"]),
        ("reference,candidate\nward.json,no.binary\n", &["pairs.csv, line 2: no.binary: no such file"]),
        ("reference,candidate\n", &["pairs.csv: there is no pair after the header"]),
        (
            "",
            &[
                "pairs.csv, line 1: no column `reference`; there are no names of columns; needed are reference, candidate",
            ],
        ),
    ] {
        place.write("pairs.csv", text);
        assert_says(&place.mistake(&["score", "pairs.csv", "-m", "D1", "--out", "scores.csv"]), parts);
    }
    place.write("pairs.csv", b"reference,candidate\nward.json,\xff\n");
    let message = place.mistake(&["score", "pairs.csv", "-m", "D1", "--out", "scores.csv"]);
    assert_says(&message, &["pairs.csv", "line 2", "UTF-8"]);
    assert_says(&place.mistake(&["score", "none.csv", "-m", "D1", "--out", "scores.csv"]), &["none.csv: No such file"]);
    assert!(!place.path("scores.csv").exists());
}

#[test]
fn an_output_that_cannot_be_written_is_found_before_the_work() {
    let place = Place::new();
    // The pairs cannot be opened either: the message is about the output, which is looked at first.
    place.write("pairs.csv", "reference,candidate\nno.binary,no.binary\n");
    place.write("file", "");
    let out = |out: &str| place.mistake(&["score", "pairs.csv", "-m", "D1", "--out", out]);
    assert_says(&out("file/scores.csv"), &["file: cannot write there", "it must be a folder"]);
    fs::create_dir(place.path("folder")).expect("writable");
    assert_says(&out("folder"), &["--out folder is a folder", "it must be the name of a file"]);
    // Earlier results stay when the new ones cannot be computed.
    place.write("scores.csv", "earlier");
    assert_says(&out("scores.csv"), &["scores.csv exists already; use --replace to replace it"]);
    let message = place.mistake(&["score", "pairs.csv", "-m", "D1", "--out", "scores.csv", "--replace"]);
    assert_says(&message, &["pairs.csv, line 2: no.binary: no such file"]);
    assert_eq!(place.read("scores.csv"), "earlier");
}

#[test]
fn an_exported_metric_of_a_newer_format_or_of_damaged_shape_is_refused() {
    let place = Place::new();
    let shipped = vernis::metric::learned::LearnedMetric::shipped().expect("the shipped metric");
    let text = shipped.exported().to_json().expect("writable");
    let whole: Value = serde_json::from_str(&text).expect("valid JSON");
    let refused = |change: &dyn Fn(&mut Value), parts: &[&str]| {
        let mut value = whole.clone();
        change(&mut value);
        place.write("m.vernis.json", value.to_string());
        assert_says(&place.mistake(&["compare", "ward.json", "ggx.json", "-m", "m.vernis.json"]), parts);
    };
    refused(
        &|v| v["format"] = json!(99),
        &["m.vernis.json: format 99, written by vernis 0.1.0", "which reads up to format 2"],
    );
    refused(
        &|v| v["descriptors"]["setup"] = json!("v0"),
        &["m.vernis.json: unknown descriptors `v0`; this program knows v1-lamps-sphere"],
    );
    refused(
        &|v| v["interval"]["factor"] = json!(-1),
        &["m.vernis.json: ", "the factor of the interval is -1; it must be 0 or more"],
    );
    refused(&|v| v["regressor"]["terms"] = json!([]), &["m.vernis.json: ", "has no term"]);
    place.write("m.vernis.json", &text[..text.len() / 2]);
    let message = place.mistake(&["compare", "ward.json", "ggx.json", "-m", "m.vernis.json"]);
    assert_says(&message, &["m.vernis.json, line 1", "not an exported metric: "]);
    // As it was written, the file gives the numbers of the metric that is built in.
    place.write("m.vernis.json", text);
    let built_in = place.json(&["compare", "ward.json", "ggx.json", "--json"]);
    assert_eq!(place.json(&["compare", "ward.json", "ggx.json", "-m", "m.vernis.json", "--json"]), built_in);
}

#[test]
fn options_out_of_range_are_refused() {
    let place = Place::new();
    for threads in ["0", "200000"] {
        let message = place.mistake(&["metrics", "--threads", threads]);
        assert_says(&message, &[&format!("--threads is {threads}; it must be 1 to 1024")]);
    }
    place.write("file", "");
    let message = place.mistake(&["describe", "ward.json", "--cache", "file/cache"]);
    assert_says(&message, &["file/cache: cache folder: "]);
    assert_eq!(place.run(&["compare", "ward.json"]).status.code(), Some(2));
    assert_eq!(place.run(&["no-such-command"]).status.code(), Some(2));
}

#[test]
fn a_reader_that_stops_early_is_no_error() {
    use std::process::Stdio;
    let mut child = Command::new(env!("CARGO_BIN_EXE_vernis"))
        .args(["metrics", "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("the program ends");
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    assert_eq!(output.status.code(), Some(0));
}

#[cfg(feature = "train")]
mod training {
    use super::*;

    fn refused(rows: &str, parts: &[&str]) {
        let place = Place::new();
        place.write("study.csv", format!("reference,candidate,mos\n{rows}"));
        let message = place.mistake(&["train", "--study", "study.csv", "--out", "results"]);
        assert_says(&message, parts);
    }

    #[test]
    fn studies_that_nothing_can_be_learned_from_are_refused() {
        let row = |reference: &str, alpha: f64, mos: f64| format!("{reference},ggx.json?alpha={alpha},{mos}\n");
        let one: String = [0.1, 0.2, 0.3].map(|a| row("ward.json", a, 5.0 - 10.0 * a)).concat();
        refused(&one, &["study", "one material (ward.json)", "at least 2"]);
        let few: String = (1..5).map(|i| row(&format!("ward.json?alpha=0.{i}"), 0.2, f64::from(i))).collect();
        refused(&few, &["study", "4 groups", "10 folds need at least 10"]);
        let equal: String = (1..=12).map(|i| row(&format!("ward.json?alpha=0.{i:02}"), 0.2, 3.0)).collect();
        refused(&equal, &["study", "all 12 ratings are 3"]);
        refused("ward.json,ggx.json\n", &["study.csv, line 2", "the number of fields is 2; it must be 3"]);
        refused("ward.json,ggx.json,6\n", &["study.csv, line 2: mos is `6`; it must be 1"]);
        refused("", &["study", "no usable pair"]);
    }

    #[test]
    fn an_unwritable_output_folder_and_an_unknown_study_are_refused() {
        let place = Place::new();
        place.write("file", "");
        let message = place.mistake(&["train", "--study", "synthetic", "--out", "file/results"]);
        assert_says(&message, &["file/results: cannot write there"]);
        let message = place.mistake(&["train", "--study", "sinthetic", "--out", "results"]);
        assert_says(&message, &["unknown study `sinthetic`", "did you mean synthetic"]);
        assert!(!place.path("results").exists());
    }
}
