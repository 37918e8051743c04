//! The program against input that means harm: metric files, special files, huge sizes, names with escape sequences, runs that
//! disturb each other, and a machine that gives nothing.

use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

const LAMBERT: &str = r#"{"model":"lambert","kd":[0.2,0.1,0.05]}"#;
const GGX: &str = r#"{"model":"ggx","kd":[0.2,0.1,0.05],"f0":[0.04,0.04,0.04],"alpha":0.2}"#;

struct Place(TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().expect("temporary folder"));
        place.write("a.json", LAMBERT);
        place.write("b.json", GGX);
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).expect("writable");
    }

    /// The program after a line of shell, ended where it does not end by itself.
    fn command(&self, before: &str, args: &[&str]) -> Command {
        let mut command = Command::new("sh");
        command.arg("-c").arg(format!("{before} exec timeout 100 \"$@\"")).arg("sh").arg(env!("CARGO_BIN_EXE_vernis"));
        command.args(args).current_dir(self.0.path()).stdin(Stdio::null());
        command.env_remove("VERNIS_DATA").env("VERNIS_CACHE", self.path("cache"));
        command
    }

    fn run(&self, args: &[&str]) -> Output {
        self.command("", args).output().expect("the program starts")
    }

    /// The message of a run that must fail by the user's mistake.
    fn mistake(&self, args: &[&str]) -> String {
        let output = self.run(args);
        // What is wrong with an argument itself is told with a hint at the help.
        let message =
            String::from_utf8(output.stderr).expect("UTF-8").replace("\n\nFor more information, try '--help'.", "");
        assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
        assert_eq!(message.lines().count(), 1, "{args:?}: {message}");
        message
    }
}

/// Version 1 of the metric, which holds networks as well, changed.
fn metric(change: impl Fn(&mut Value)) -> String {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/vernis-metric/src/metric/learned/vernis-1.vernis.json");
    let mut metric = serde_json::from_str(&fs::read_to_string(path).expect("part of the source")).expect("JSON");
    change(&mut metric);
    metric.to_string()
}

#[test]
fn weights_that_overflow_are_refused_and_the_file_is_named() {
    let place = Place::new();
    for (at, value) in [
        ("/regressor/terms/0/weight", 1.7e308),
        ("/regressor/terms/0/function/weights/3", -1.7e308),
        ("/regressor/terms/1/function/members/0/0/weights/0", 1e300),
        ("/regressor/terms/1/function/members/2/1/bias/0", -1e200),
        ("/regressor/terms/1/function/activation/slope", 1e300),
        ("/members/0/0/standardizer/features/0/gain", 1e308),
    ] {
        let text = metric(|m| *m.pointer_mut(at).unwrap_or_else(|| panic!("{at}")) = json!(value));
        place.write("evil.vernis.json", text);
        let message = place.mistake(&["compare", "a.json", "b.json", "-m", "evil.vernis.json"]);
        assert!(message.contains("evil.vernis.json: ") && message.contains("it must be "), "{at}: {message}");
    }
}

#[test]
fn a_file_never_goes_by_the_name_of_a_built_in_metric() {
    let place = Place::new();
    for name in ["D9.Cl", "vernis", "ot", "OT", "all-lp", "ot[blur=0.1]"] {
        place.write("x.vernis.json", metric(|m| (m["name"], m["metric_version"]) = (json!(name), json!("evil"))));
        for order in [["D9.Cl", "x.vernis.json"], ["x.vernis.json", "D9.Cl"]] {
            let output = place.run(&["compare", "a.json", "b.json", "-m", order[0], "-m", order[1], "--json"]);
            assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
            let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
            let distances = found["distances"].as_object().expect("an object");
            let own = format!("{name}@x.vernis.json");
            assert!(distances.contains_key(&own) && distances.contains_key("D9.Cl"), "{distances:?}");
            assert_eq!((distances.len(), found["mos"].get(&own).is_some()), (2, true), "{found}");
        }
    }
    // A file whose own name is that of a metric is asked for by its path alone.
    place.write("ot.json", metric(|m| m["name"] = json!("mine")));
    let output = place.run(&["compare", "a.json", "b.json", "-m", "ot.json", "--json"]);
    assert!(String::from_utf8_lossy(&output.stdout).contains("\"mine\""));
}

#[test]
fn options_of_metrics_must_be_numbers_in_range() {
    let place = Place::new();
    for name in [
        "ot[blur=nan]",
        "ot[blur=inf]",
        "ot[alpha=nan]",
        "ot[scaling=nan]",
        "ot[gamma=nan]",
        "ot[p=nan]",
        "ot[kappa=nan]",
        "ot[nodes=1e30]",
        "ot[phi=log:eta=nan]",
        "ot[eta=-inf,phi=log]",
        "energy[alpha=nan]",
        "energy[gamma=inf]",
        "mmd-gaussian[blur=nan]",
        "mmd-laplacian[blur=1e-300]",
    ] {
        let message = place.mistake(&["compare", "a.json", "b.json", "-m", name]);
        assert!(message.contains("it must be"), "{name}: {message}");
    }
}

/// Everything that the program reads: the name of a file, and the arguments that have it read.
const INPUTS: [(&str, &[&str]); 14] = [
    ("x.json", &["describe", "x.json"]),
    ("x.binary", &["describe", "x.binary"]),
    ("x.titopo", &["describe", "x.titopo"]),
    ("x.zip", &["describe", "x.zip:teflon"]),
    ("x.fit", &["describe", "x.fit:teflon"]),
    ("x.bin", &["describe", "x.bin:teflon"]),
    ("x.vernis.json", &["compare", "a.json", "b.json", "-m", "x.vernis.json"]),
    ("x.hdr", &["compare", "a.json", "b.json", "-m", "probe.vernis.json", "--lights", "x.hdr"]),
    ("x.ply", &["compare", "a.json", "b.json", "-m", "mesh.vernis.json", "--shape", "x.ply"]),
    ("x.csv", &["study", "--study", "x.csv"]),
    ("x.csv", &["study", "--ratings", "x.csv"]),
    ("x.toml", &["study", "--ratings", "x.toml"]),
    ("x.json", &["fit", "a.json", "--model", "lambert", "--start", "x.json", "--out", "fit.json"]),
    ("benchmark.json", &["report", "--study", "synthetic", "--benchmark", "benchmark.json"]),
];

/// Metrics that need a probe and a mesh.
fn with_view(place: &Place) {
    let setup = |id: &str| metric(|m| m["descriptors"]["setup"] = json!(id));
    place.write("probe.vernis.json", setup("v1-probe-0123456789abcdef-sphere"));
    place.write("mesh.vernis.json", setup("v1-lamps-mesh-0123456789abcdef"));
}

#[test]
fn special_files_are_refused_at_once() {
    let place = Place::new();
    with_view(&place);
    for (name, args) in INPUTS {
        for kind in ["device", "FIFO", "folder"] {
            let path = place.path(name);
            match kind {
                "device" => std::os::unix::fs::symlink("/dev/zero", &path).expect("writable"),
                "FIFO" => assert!(Command::new("mkfifo").arg(&path).status().expect("mkfifo").success()),
                _ => fs::create_dir(&path).expect("writable"),
            }
            let message = place.mistake(args);
            // A folder that is named as a result of `benchmark` is looked into.
            let told = message.contains(&format!("it is a {kind}; it must be a regular file"));
            assert!(message.contains(name) && (told || name == "benchmark.json"), "{kind}: {message}");
            if kind == "folder" { fs::remove_dir(path) } else { fs::remove_file(path) }.expect("ours");
        }
    }
}

#[test]
fn special_files_in_the_cache_are_replaced() {
    let place = Place::new();
    let describe = ["describe", "a.json"];
    assert!(place.run(&describe).status.success());
    let said = place.run(&describe).stdout;
    let entries: Vec<PathBuf> =
        fs::read_dir(place.path("cache")).expect("a cache").map(|e| e.unwrap().path()).collect();
    assert!(!entries.is_empty());
    for entry in &entries {
        fs::remove_file(entry).expect("ours");
        assert!(Command::new("mkfifo").arg(entry).status().expect("mkfifo").success());
    }
    let output = place.run(&describe);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.stdout, said);
    assert!(entries.iter().all(|entry| entry.is_file()), "entries are whole again");
}

#[test]
fn sizes_that_a_header_only_says_take_no_memory() {
    let place = Place::new();
    with_view(&place);
    let mut files: Vec<(&str, &[&str], Vec<u8>)> = Vec::new();
    for size in ["-Y 1000000 +X 1000000", "-Y 4294967295 +X 4294967295", "-Y 8000 +X 16000", "-Y 30000 +X 40000"] {
        let text = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n");
        files.push(("x.hdr", INPUTS[7].1, text.into()));
    }
    for (vertices, faces) in [(u64::MAX, 1), (3, u64::MAX), (99_999_999_999, 99_999_999_999)] {
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
             element face {faces}\nproperty list uchar int i\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
        );
        files.push(("x.ply", INPUTS[8].1, text.into()));
    }
    let header = [90i32, 90, i32::MAX].map(i32::to_le_bytes).concat();
    files.push(("x.binary", INPUTS[1].1, header));
    files.push(("x.zip", INPUTS[3].1, large_archive(u64::MAX / 2)));
    files.push(("x.zip", INPUTS[3].1, large_archive(1 << 40)));
    for (name, args, bytes) in files {
        place.write(name, &bytes);
        let output = place.command("ulimit -d 1000000;", args).output().expect("the program starts");
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{name}: {message}");
        assert!(message.contains(name) && message.lines().count() == 1, "{message}");
    }
}

/// An archive in the format for large ones whose directory says that it has so many members.
fn large_archive(members: u64) -> Vec<u8> {
    let mut bytes = b"PK\x06\x06".to_vec();
    bytes.extend(44u64.to_le_bytes());
    bytes.extend([45, 0, 45, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    bytes.extend(members.to_le_bytes());
    bytes.extend(members.to_le_bytes());
    // Size and place of the directory.
    bytes.extend(0u64.to_le_bytes());
    bytes.extend(0u64.to_le_bytes());
    bytes.extend(b"PK\x06\x07");
    bytes.extend(0u32.to_le_bytes());
    bytes.extend(0u64.to_le_bytes());
    bytes.extend(1u32.to_le_bytes());
    bytes.extend(b"PK\x05\x06");
    bytes.extend([0, 0, 0, 0]);
    bytes.extend([0xff; 12]);
    bytes.extend([0, 0]);
    bytes
}

/// What acts on a terminal.
fn acts(text: &str) -> bool {
    text.chars().any(|c| (c.is_control() && c != '\n' && c != '\t') || ('\u{202a}'..='\u{202e}').contains(&c))
}

#[test]
fn nothing_that_is_named_acts_on_the_terminal() {
    let place = Place::new();
    // The title of the window, red, a control of eight bits, an override of direction, the way back over the line.
    let evil = "e\u{1b}]0;owned\u{7}\u{1b}[31m\u{9b}2J\u{202e}gnp\r\u{7f}";
    let file = |ending: &str| format!("{evil}.{ending}");
    place.write(&file("json"), GGX);
    place.write("model.json", json!({"model": evil}).to_string());
    place.write("field.json", json!({"model": "lambert", evil: 1}).to_string());
    place.write(&file("csv"), "reference,candidate,mos\n");
    place.write("ratings.csv", format!("participant,material,method,score\na,{evil},S,3\nb,{evil},S,4\n"));
    place.write("study.csv", format!("reference,candidate,mos\n{evil}.binary,x.xyz,3\n"));
    place.write("header.csv", format!("reference,candidate,mos,{evil}\n"));
    place.write("metric.vernis.json", format!("{{\"format\": 1, \"{evil}\": 2}}"));
    let (json, csv, zip) = (file("json"), file("csv"), format!("{}:{evil}", file("zip")));
    for args in [
        &[evil][..],
        &["--threads", evil, "metrics"],
        &["describe", evil],
        &["describe", &json],
        &["describe", &json, "--json"],
        &["describe", &zip],
        &["describe", "model.json"],
        &["describe", "field.json"],
        &["describe", "a.json", "--cache", "a.json/e\u{1b}[31m"],
        &["compare", "a.json", "b.json", "-m", evil],
        &["compare", "a.json", "b.json", "-m", "metric.vernis.json"],
        &["compare", "a.json", "b.json", "--grid", evil],
        &["score", &csv, "--out", "x.csv"],
        &["fit", "a.json", "--model", evil, "--out", "x.json"],
        &["fit", "a.json", "--model", "lambert", "--out", evil],
        &["data", "convert", "a.json", evil],
        &["data", "fetch", evil],
        &["data", "verify", "--data", evil],
        &["data", "list", "--data", evil],
        &["data", "fetch", "lavoue2021", "--data", "d", "--mirror", &format!("ftp://{evil}")],
        &["data", "fetch", "lavoue2021", "--data", "d", "--mirror", evil],
        &["study", "--study", evil],
        &["study", "--study", "study.csv"],
        &["study", "--study", "header.csv"],
        &["study", "--ratings", "ratings.csv", "--out", &format!("out {evil}")],
        &["study", "--ratings", "ratings.csv", "--json"],
        &["report", "--study", "synthetic", "--benchmark", evil],
        &["refit", "--study", evil, "--out", "x"],
        &["sweep", "--study", "synthetic", "--phi", evil],
    ] {
        let output = place.run(args);
        for stream in [&output.stdout, &output.stderr] {
            let text = String::from_utf8_lossy(stream);
            assert!(!acts(&text), "{args:?}: {text:?}");
        }
        assert!(!output.stdout.is_empty() || !output.stderr.is_empty(), "{args:?} says nothing");
    }
    let output = place.command("", &["describe", "--help"]).env("VERNIS_DATA", evil).output().expect("starts");
    assert!(output.status.success() && !acts(&String::from_utf8_lossy(&output.stdout)));
    // JSON still is JSON, of the same names.
    let found: Value = serde_json::from_slice(&place.run(&["describe", &json, "--json"]).stdout).expect("JSON");
    assert_eq!(found["brdf"], json!(json));
}

#[test]
fn names_are_no_markup_in_reports() {
    let place = Place::new();
    let evil = "<img src=x onerror=alert(1)>|[a](javascript:b)";
    let rows: String = ["a", "b"].iter().map(|who| format!("{who},\"{evil}\",=1+1,3\n{who},m,GGX,4\n")).collect();
    place.write("r.csv", format!("participant,material,method,score\n{rows}"));
    let output = place.run(&["study", "--ratings", "r.csv", "--out", "o"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let page = fs::read_to_string(place.path("o/study.md")).expect("written");
    assert!(page.contains("&lt;img src=x") && !page.contains("<img") && !page.contains("](java"), "{page}");
    assert!(page.contains("onerror=alert(1)>\\|[a]"), "{page}");
}

#[test]
fn a_standard_error_that_cannot_be_written_changes_nothing() {
    let place = Place::new();
    for (args, code) in [
        (&["describe", "nowhere.json"][..], 2),
        (&["--nonsense"], 2),
        (&["study", "--out", "o", "--replace"], 0),
        (&["describe", "a.json", "--cache", "/dev/null/x"], 2),
    ] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").expect("on this system");
        let output = place.command("", args).stderr(full).output().expect("the program starts");
        assert_eq!(output.status.code(), Some(code), "{args:?}");
        let output = place.command("exec 2>&-;", args).output().expect("the program starts");
        assert_eq!(output.status.code(), Some(code), "{args:?}");
    }
}

#[test]
fn threads_that_cannot_be_started_are_told() {
    let place = Place::new();
    let limited = |args: &[&str]| place.command("ulimit -v 700000;", args).output().expect("the program starts");
    let output = limited(&["--threads", "1024", "metrics"]);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.starts_with("vernis: 1024 worker threads cannot be started ("), "{message}");
    assert!(message.ends_with("; ask for fewer with --threads\n") && !message.contains("panicked"), "{message}");
    // The default, which nobody asked for.
    let mut command = place.command("ulimit -v 700000;", &["metrics"]);
    let output = command.env("RAYON_NUM_THREADS", "1024").output().expect("the program starts");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.code() == Some(1)
            && message.contains("the worker threads (one per core, or as many as RAYON_NUM_THREADS says) cannot"),
        "{message}"
    );
}

#[test]
fn runs_into_one_folder_end_well_or_are_refused() {
    let place = Place::new();
    for _ in 0..3 {
        let start = |_| {
            let mut command = place.command("", &["study", "--study", "synthetic", "--out", "same", "--replace"]);
            command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts")
        };
        let running: Vec<_> = (0..4).map(start).collect();
        let mut well = 0;
        for child in running {
            let output = child.wait_with_output().expect("it ends");
            let message = String::from_utf8_lossy(&output.stderr).into_owned();
            match output.status.code() {
                Some(0) => well += 1,
                code => {
                    assert_eq!(code, Some(2), "{message}");
                    let said = ["same: another vernis is writing there (", "wait until it ends"];
                    assert!(said.iter().all(|part| message.contains(part)), "{message}");
                }
            }
        }
        assert!(well > 0, "one of them must have the folder");
        let mut left: Vec<_> =
            fs::read_dir(place.path("same")).expect("there").map(|f| f.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["study.json", "study.md"], "nothing else is left");
    }
}

/// Where `eprintln!` cannot write, it ends the program: one function tells everything.
#[test]
fn one_function_writes_to_standard_error() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/cli");
    let mut folders = vec![folder];
    let mut read = 0;
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("sources") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let code = fs::read_to_string(&path).expect("UTF-8");
            for name in ["print!(", "println!(", "dbg!("] {
                assert!(!code.contains(name), "{} uses {name}", path.display());
            }
            read += 1;
        }
    }
    assert!(read > 20, "only {read} files were read");
}
