//! What the program says of BRDFs: their values, their parameters, and whether they can be those of a material.

use crate::data_folder;
use serde_json::{Value, json};
use std::fs;
use std::io::Write;
use std::process::{Command, Output, Stdio};
use vernis::brdf::formats::{merl, titopo};
use vernis::brdf::models::{Ggx, build};
use vernis::brdf::{Brdf, Grid, TabulatedBrdf};
use vernis::math::Vec3;

/// A folder in which the program runs.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().expect("a folder"));
        place.write("ggx.json", r#"{"model":"ggx","kd":[0.2,0.1,0.05],"f0":[0.04,0.04,0.04],"alpha":0.15}"#);
        place.write("ward.json", r#"{"model":"ward","kd":[0.2,0.1,0.05],"ks":[0.1,0.1,0.1],"alpha":0.15}"#);
        place
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.0.path().join(name), content).expect("writable");
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.0.path().join(name)).expect("text")
    }

    fn program(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
        command.args(args).current_dir(self.0.path()).env_remove("VERNIS_DATA").env_remove("VERNIS_CACHE");
        command.env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
        command
    }

    /// Standard output and standard error of a run that succeeds.
    fn run(&self, args: &[&str]) -> (String, String) {
        texts(args, self.program(args).output().expect("the program starts"), 0)
    }

    fn mistake(&self, args: &[&str]) -> String {
        let (out, error) = texts(args, self.program(args).output().expect("the program starts"), 2);
        assert!(out.is_empty() && error.lines().count() == 1, "{args:?}: {out}{error}");
        error
    }

    fn json(&self, args: &[&str]) -> Value {
        let (out, error) = self.run(args);
        assert_eq!(error, "", "{args:?}");
        serde_json::from_str(&out).expect("JSON")
    }
}

fn texts(args: &[&str], output: Output, code: i32) -> (String, String) {
    let [out, error] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).expect("UTF-8"));
    assert_eq!(output.status.code(), Some(code), "{args:?}: {error}");
    (out, error)
}

#[test]
fn values_at_directions() {
    let place = Place::new();
    let half = "0,0.6,0.8";
    place.write(
        "at.csv",
        format!("name,wix,wiy,wiz,wox,woy,woz\n\"a,b\",{half},0,-0.6,0.8\nc,0,0,1,0,0,-1\nd,0,0,1.004,{half}\n"),
    );
    let (out, error) = place.run(&["evaluate", "ggx.json", "--at", "at.csv"]);
    assert_eq!(error, "");
    let lines: Vec<&str> = out.lines().collect();
    assert_eq!(lines[0], "name,wix,wiy,wiz,wox,woy,woz,r,g,b");
    assert_eq!(lines[2], "c,0,0,1,0,0,-1,0,0,0");
    let model = Ggx { kd: [0.2, 0.1, 0.05], f0: [0.04; 3], alpha: 0.15 };
    let (wi, wo) = (Vec3::new(0.0, 0.6, 0.8), Vec3::new(0.0, -0.6, 0.8));
    let expected = model.eval(wi.normalized(), wo.normalized()).expect("a model").map(|v| v.to_string()).join(",");
    assert_eq!(lines[1], format!("\"a,b\",{half},0,-0.6,0.8,{expected}"));
    let up = model.eval(Vec3::new(0.0, 0.0, 1.0), wi.normalized()).expect("a model").map(|v| v.to_string()).join(",");
    assert_eq!(lines[3], format!("d,0,0,1.004,{half},{up}"));

    // Standard input, with semicolons and decimal commas, in another case and order, after a mark of the byte order.
    let text = "\u{feff}WOX;WOY;WOZ;WIX;WIY;WIZ\r\n0;-0,6;0,8;0;0,6;0,8\r\n";
    let args = ["evaluate", "ggx.json", "--at", "-", "--out", "new/values.csv"];
    let mut child = place
        .program(&args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("starts");
    child.stdin.take().expect("piped").write_all(text.as_bytes()).expect("read");
    let (said, _) = texts(&args, child.wait_with_output().expect("ends"), 0);
    assert_eq!(said, "1 pair of directions, 0 not measured: new/values.csv\n");
    assert_eq!(
        place.read("new/values.csv"),
        format!("WOX,WOY,WOZ,WIX,WIY,WIZ,r,g,b\n0,-0.6,0.8,0,0.6,0.8,{expected}\n")
    );

    // Nothing that was there is replaced unasked, and inputs never.
    let said = place.mistake(&["evaluate", "ggx.json", "--at", "at.csv", "--out", "new/values.csv"]);
    assert!(said.contains("new/values.csv exists already; use --replace"), "{said}");
    place.run(&["evaluate", "ggx.json", "--at", "at.csv", "--out", "new/values.csv", "--replace"]);
    assert_eq!(place.read("new/values.csv"), out);
    for input in ["at.csv", "new/../at.csv", "ggx.json"] {
        let said = place.mistake(&["evaluate", "ggx.json", "--at", "at.csv", "--out", input, "--replace"]);
        assert!(said.contains("input of this command; inputs are never replaced"), "{said}");
    }
}

#[test]
fn what_is_not_measured_is_empty() {
    let place = Place::new();
    let grid = Grid::TITOPO_HALF;
    let table = TabulatedBrdf::tabulate(&Ggx { kd: [0.2; 3], f0: [0.04; 3], alpha: 0.15 }, grid).expect("finite");
    let valid = (0..grid.len()).map(|k| k / 180 % 45 < 20).collect();
    let table = TabulatedBrdf::new(grid, table.values().to_vec(), valid).expect("some are valid");
    titopo::write(&place.0.path().join("a.titopoh"), &table).expect("writable");
    place.write("at.csv", "wix,wiy,wiz,wox,woy,woz\n0,0,1,0,0.6,0.8\n0,0,1,0.8,0,0.6\n");
    let (out, _) = place.run(&["evaluate", "a.titopoh", "--at", "at.csv"]);
    let lines: Vec<&str> = out.lines().collect();
    assert!(lines[1].starts_with("0,0,1,0,0.6,0.8,0.0"), "{out}");
    assert_eq!(lines[2], "0,0,1,0.8,0,0.6,,,");
}

#[test]
fn directions_that_are_none_are_named() {
    let place = Place::new();
    let head = "wix,wiy,wiz,wox,woy,woz";
    for (text, expected) in [
        (
            format!("{head}\n0,0,1,0,0,1\n0,0,2,0,0,1\n"),
            "at.csv, line 3: the length of wi is 2; it must be 1, within 0.01",
        ),
        (format!("{head}\n0,0,1,0,0,0\n"), "at.csv, line 2: the length of wo is 0; it must be 1"),
        (format!("{head}\n0,0,1,0,x,1\n"), "at.csv, line 2: woy is `x`; it must be a number"),
        (format!("{head}\n0,0,1,0,NaN,1\n"), "at.csv, line 2: woy is `NaN`"),
        (format!("{head}\n0,0,1,0,1\n"), "at.csv, line 2: the number of fields is 5; it must be 6"),
        (format!("{head},R\n0,0,1,0,0,1,1\n"), "at.csv, line 1: the column `r` is there already"),
        ("wix,wiy,wiz\n0,0,1\n".to_owned(), "at.csv, line 1: no column `wox`; the columns are wix, wiy, wiz"),
        (String::new(), "at.csv, line 1: no column `wix`; there are no names of columns; needed are wix, wiy,"),
    ] {
        place.write("at.csv", text);
        let said = place.mistake(&["evaluate", "ggx.json", "--at", "at.csv"]);
        assert!(said.contains(expected), "{said}");
    }
    assert!(place.mistake(&["evaluate", "ggx.json", "--at", "none.csv"]).contains("none.csv: No such file"));
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn measurements_of_rgl_keep_their_colours() {
    let place = Place::new();
    let data = data_folder();
    let data = data.to_str().expect("UTF-8");
    place.write(
        "at.csv",
        "wix,wiy,wiz,wox,woy,woz\n-0.9820085054791597,0.028556894530951102,0.18666493763247363,0.9838833885747023,0,0.17881129071387378\n",
    );
    let (out, _) = place.run(&["evaluate", "cc_green_malachite_rgb.bsdf", "--at", "at.csv", "--data", data]);
    let last: Vec<f64> =
        out.lines().nth(1).expect("a row").split(',').skip(6).map(|v| v.parse().expect("a number")).collect();
    // By Mitsuba 3.9.1.
    for (found, expected) in last.iter().zip([-1.8504740976614744, 5.842604004212115, 3.6568401367564567]) {
        assert!((found - expected).abs() < 1e-4, "{last:?}");
    }
    let (out, _) = place.run(&["data", "convert", "cc_green_malachite_rgb.bsdf", "green.titopoh", "--data", data]);
    assert!(out.contains("a BRDF that is no table"), "{out}");
    let (out, _) = place.run(&["describe", "chm_orange_rgb.bsdf", "--data", data]);
    assert!(
        out.contains("measurement of the RGL database, 8 elevations: TeckWrap vinyl wrapping film (Orange CHM11E)"),
        "{out}"
    );
}

#[test]
fn models_are_described_by_their_parameters() {
    let place = Place::new();
    let (out, error) = place.run(&["describe", "ggx.json"]);
    assert_eq!(error, "");
    assert!(out.contains("model ggx\n  kd     0.2 0.1 0.05\n  f0     0.04 0.04 0.04\n  alpha  0.15\n"), "{out}");
    assert!(out.contains("albedo for light at  0 deg: 0.2"), "{out}");
    let found = place.json(&["describe", "ggx.json", "--json"]);
    assert_eq!(found["model"], "ggx");
    assert_eq!(found["parameters"], json!({"kd": [0.2, 0.1, 0.05], "f0": [0.04, 0.04, 0.04], "alpha": 0.15}));
    assert_eq!(found["warnings"], json!([]));
    assert_eq!(found["albedo"][1]["theta_deg"], 30.0);
    let p: Vec<f64> = vernis::brdf::models::schema("ggx+ward").expect("a model").iter().map(|p| p.start).collect();
    let sum: std::sync::Arc<dyn Brdf> = build("ggx+ward", &p).expect("valid");
    assert!(sum.as_model().is_some());
}

#[test]
fn collections_list_their_materials() {
    let place = Place::new();
    let line = |name: &str| {
        format!(
            "{name} = Aggregate(Lambertian(albedo = [0.3, 0.3, 0.3]), NganWard(albedo = [0.1, 0.1, 0.1], roughness = 0.1))\n"
        )
    };
    place.write("some.fit", line("teflon") + &line("brass"));
    let (out, _) = place.run(&["describe", "some.fit"]);
    assert_eq!(out, "some.fit holds 2 materials, each a BRDF such as some.fit:brass\n  brass\n  teflon\n");
    let found = place.json(&["describe", "some.fit", "--json"]);
    assert_eq!(found, json!({"collection": "some.fit", "materials": ["brass", "teflon"]}));
    assert!(place.mistake(&["describe", "none.zip"]).contains("none.zip: no such file"));
    assert!(place.mistake(&["compare", "some.fit", "ggx.json"]).contains("`some.fit` holds many materials, name one"));
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn published_collections_list_their_materials() {
    let place = Place::new();
    let data = data_folder();
    for (file, count) in [("merl_nbrdf.zip", 100), ("npf.bin", 100), ("ngan_ward.fit", 86)] {
        let found = place.json(&["describe", file, "--json", "--data", data.to_str().expect("UTF-8")]);
        assert_eq!(found["materials"].as_array().map(Vec::len), Some(count), "{file}");
    }
}

/// Good, 1,500 times too dark, and with 180 cells of 1e30 1/sr.
fn tables(place: &Place) {
    let model = Ggx { kd: [0.2, 0.1, 0.05], f0: [0.04; 3], alpha: 0.15 };
    let good = TabulatedBrdf::tabulate(&model, Grid::MERL).expect("finite");
    let write = |name: &str, value: &dyn Fn(usize, [f32; 3]) -> [f32; 3]| {
        let values = good.values().iter().enumerate().map(|(k, v)| value(k, *v)).collect();
        let table = TabulatedBrdf::new(Grid::MERL, values, good.valid().to_vec()).expect("finite");
        merl::write(&place.0.path().join(name), &table).expect("writable");
    };
    write("good.binary", &|_, v| v);
    write("dark.binary", &|_, v| v.map(|x| x / 1500.0));
    write("e30.binary", &|k, v| if (8000..8180).contains(&k) { [1e30; 3] } else { v });
}

#[test]
fn implausible_tables_are_warned_of() {
    let place = Place::new();
    tables(&place);
    let dark = "vernis: warning: dark.binary: the albedo is below 0.001 in all channels (";
    let e30 = [
        "vernis: warning: e30.binary: the albedo is above 1.05",
        "180 cells have a value that no lobe has which is as narrow as the cells: 1e30 1/sr",
    ];
    let (_, said) = place.run(&["compare", "good.binary", "dark.binary", "-m", "D1"]);
    assert!(said.starts_with(dark) && said.lines().count() == 1, "{said}");
    let (out, said) = place.run(&["compare", "e30.binary", "good.binary", "-m", "D1"]);
    assert!(said.contains(e30[1]) && said.len() < 1000, "{said}");
    assert!(out.len() < 100, "{out}");
    let found = place.json(&["compare", "good.binary", "dark.binary", "-m", "D1", "--json"]);
    assert_eq!(found["warnings"].as_array().map(Vec::len), Some(1));
    assert!(found["albedo"]["candidate"][0]["rgb"][0].as_f64() < Some(0.001));
    let found = place.json(&["compare", "good.binary", "ggx.json", "-m", "D1", "--json"]);
    assert_eq!(found["warnings"], json!([]));

    let (_, said) = place.run(&["describe", "e30.binary"]);
    assert!(said.contains(e30[1]), "{said}");
    let found = place.json(&["describe", "dark.binary", "--json"]);
    assert!(
        found["warnings"][0].as_str().is_some_and(|w| w.starts_with("dark.binary: the albedo is below")),
        "{found}"
    );
    let (out, said) = place.run(&["data", "convert", "dark.binary", "dark.titopoh"]);
    assert!(said.starts_with(dark) && out.contains("albedo for light at 60 deg: 1.772e-4"), "{out}{said}");
    let fit = ["fit", "dark.binary", "--model", "lambert", "-m", "D4.Cl", "--grid", "15", "--out", "fit.json"];
    let output = place.program(&fit).output().expect("the program starts");
    assert!(String::from_utf8_lossy(&output.stderr).contains(dark));
    // Black by intent is black all the same.
    place.write("black.json", r#"{"model":"lambert","kd":[0,0,0]}"#);
    let (_, said) = place.run(&["describe", "black.json"]);
    assert!(said.contains("black.json: the albedo is below 0.001"), "{said}");
}

/// The second time, features and plausibility of a table come from the cache, and say the same; those of a model are not kept.
#[test]
fn tables_that_the_cache_knows_are_compared_alike() {
    let place = Place::new();
    place.run(&["data", "convert", "ward.json", "ward.titopoh"]);
    let compare = ["compare", "ward.titopoh", "ggx.json", "--cache", "cache", "-m", "vernis", "-m", "D4", "--json"];
    let first = place.json(&compare);
    let kept = |ending: &str| {
        let names = fs::read_dir(place.0.path().join("cache")).expect("a folder").map(|entry| entry.expect("an entry"));
        names.filter(|entry| entry.file_name().to_string_lossy().ends_with(ending)).count()
    };
    assert_eq!((kept(".features"), kept(".values"), kept(".operators")), (1, 1, 1));
    assert_eq!(place.json(&compare), first);
    let uncached = place.json(&["compare", "ward.titopoh", "ggx.json", "-m", "D4", "--json"]);
    assert_eq!(uncached["distances"]["D4"], first["distances"]["D4"]);
    assert_eq!(uncached["albedo"], first["albedo"]);
    // What is no table is refused by its size, whether it is hashed or decoded.
    let cut = fs::read(place.0.path().join("ward.titopoh")).expect("bytes")[..1000].to_vec();
    place.write("ward.titopoh", cut);
    for metric in ["vernis", "D4"] {
        let said = place.mistake(&["compare", "ward.titopoh", "ggx.json", "--cache", "cache", "-m", metric]);
        assert!(
            said.contains("ward.titopoh: the file has 1000 bytes; Titopo at half resolution needs exactly 4374000"),
            "{said}"
        );
    }
}

#[test]
fn channels_are_said_to_be_lacking() {
    let place = Place::new();
    let said = place.mistake(&["compare", "ggx.json", "ward.json", "-m", "D6", "-m", "lab", "--per-channel"]);
    assert!(
        said.contains("--per-channel needs a metric with a distance of each channel, and none of D6, lab has one"),
        "{said}"
    );
    let args = ["compare", "ggx.json", "ward.json", "-m", "D6", "-m", "D1", "--per-channel"];
    let (out, _) = place.run(&args);
    assert!(
        out.lines().next().is_some_and(|line| line.ends_with("(no distance of each channel: it takes them together)")),
        "{out}"
    );
    let found = place.json(&[&args[..], &["--json"]].concat());
    assert_eq!(found["without_channels"], json!(["D6"]));
}

#[test]
fn extreme_numbers_are_short() {
    let place = Place::new();
    place.write("tiny.json", r#"{"model":"lambert","kd":[1e-300,1e-300,1e-300]}"#);
    place.write("at.csv", "wix,wiy,wiz,wox,woy,woz\n0,0,1,0,0,1\n");
    let (out, _) = place.run(&["evaluate", "tiny.json", "--at", "at.csv"]);
    assert!(out.len() < 200 && out.contains("e-301"), "{out}");
    let (out, _) = place.run(&["describe", "tiny.json"]);
    assert!(out.contains("kd  1e-300 1e-300 1e-300\n") && out.lines().all(|line| line.len() < 200), "{out}");
    let (out, _) = place.run(&["compare", "tiny.json", "tiny.json?kd=2e-300,2e-300,2e-300", "-m", "D5"]);
    assert!(out.len() < 60 && out.contains("e-30"), "{out}");
    assert!(place.mistake(&["describe", "ggx.json?alpha=1e-300"]).contains("alpha is 1e-300; it must be 0.001 to 1"));
}
