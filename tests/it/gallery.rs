//! `vernis report --stimuli`: rendered stimuli beside the spheres and in a gallery, and folders that cannot be shown.

use crate::files_of;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use vernis::evaluation::records::{BenchmarkRecord, PredictionRecord};

const PAIRS: &str = "reference,candidate,material,method,mos\na.json,b.json,stone,WARD,3\na.json,c.json,stone,A/B,4.5\n\
    b.json,a.json,wood,WARD,2\nb.json,c.json,wood,<new>,4\n";
/// The second row is not known.
const SCORES: &str =
    "material,method,mine </script>,note\nwood,<new>,-0.5,far\nstone,A/B,,unknown\nstone,WARD,-1e-7,\nwood,WARD,3e6,\n";
const SMALL: [&str; 8] = ["--size", "24x36", "--samples", "2", "--shape", "sphere", "--light", "lamps"];

/// A study of four pairs in a folder.
pub(crate) struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        for (name, alpha) in [("a", 0.3), ("b", 0.2), ("c", 0.1)] {
            let text = format!(r#"{{"model":"ggx","kd":[0.1,0.15,0.2],"f0":[0.5,0.4,0.2],"alpha":{alpha}}}"#);
            place.write(&format!("{name}.json"), text);
        }
        place.write("pairs.csv", PAIRS);
        place.write("scores.csv", SCORES);
        fs::create_dir(place.path("judged")).unwrap();
        place.write("judged/benchmark.json", serde_json::to_vec(&benchmark()).unwrap());
        place
    }

    /// With all of its stimuli in `page/stimuli`.
    pub(crate) fn rendered() -> Self {
        let place = Self::new();
        place.render(&[]);
        place
    }

    fn render(&self, more: &[&str]) {
        self.said(&[&["render", "--study", "pairs.csv", "--out", "page/stimuli"], &SMALL[..], more].concat(), 0);
    }

    /// The folder of the page.
    pub(crate) fn report(&self, more: &[&str]) -> PathBuf {
        let args = ["report", "--study", "pairs.csv", "--stimuli", "page/stimuli", "--out", "page"];
        let [out, _] = self.said(&[&args, more].concat(), 0);
        assert!(out.ends_with("gallery: page/gallery.html\n"), "{out}");
        self.path("page")
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        fs::write(self.path(name), text).unwrap();
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    /// Standard output and standard error of a run that ends with `code`.
    fn said(&self, args: &[&str], code: i32) -> [String; 2] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
        let output = command.args(args).current_dir(self.0.path()).env_remove("VERNIS_DATA").output().unwrap();
        let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        assert_eq!(output.status.code(), Some(code), "{args:?}: {said:?}");
        said
    }
}

/// A made-up benchmark of the study.
fn benchmark() -> BenchmarkRecord {
    let rows = [
        ("stone", "WARD", 3.0, 2.5, 0.9),
        ("stone", "A/B", 4.5, 4.0, 0.01),
        ("wood", "WARD", 2.0, 3.5, 0.02),
        ("wood", "<new>", 4.0, 1.25, 0.3),
    ];
    let row = |(material, method, mos, predicted, distance): (&str, &str, f64, f64, f64)| PredictionRecord {
        material: material.into(),
        group: material.into(),
        method: method.into(),
        method_family: method.into(),
        mos,
        predicted: BTreeMap::from([("vernis".into(), predicted)]),
        distances: BTreeMap::from([("D9.Cl".into(), distance)]),
    };
    BenchmarkRecord {
        study: "pairs.csv".into(),
        predictions: rows.map(row).to_vec(),
        data_hashes: BTreeMap::new(),
        ..crate::report::record(false)
    }
}

/// What the script of the page reads.
fn data(html: &str) -> Value {
    let (_, rest) = html.split_once(r#"type="application/json">"#).unwrap();
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn stimuli_are_shown_beside_spheres_and_in_a_gallery() {
    let place = Place::rendered();
    let page = place.report(&["--benchmark", "judged", "--scores", "scores.csv"]);
    let (report, gallery) = (place.read("page/report.html"), place.read("page/gallery.html"));
    // Two references in two cameras and four candidates; the spheres stay.
    assert_eq!(report.matches(r#"<img class="stimulus" src="data:image/jpeg;base64,"#).count(), 8);
    assert_eq!(report.matches(r#"<img class="sphere" src="data:image/png;base64,"#).count(), 6);
    assert_eq!(gallery.matches(r#"<img src="data:image/jpeg;base64,"#).count(), 8);
    assert!(report.contains(r#"href="gallery.html""#) && gallery.contains(r#"href="report.html""#));
    for html in [&report, &gallery] {
        assert!(
            html.contains("All pictures: 24x36 pixels, 2 samples a pixel, at most 8 bounces, tone curve exrdisplay")
        );
        assert!(!html.contains("pictures are not rendered yet") && !html.contains("SYNTHETIC"));
        for forbidden in ["url(", "@import", "<new>", "<script src", &place.0.path().to_string_lossy()] {
            assert!(!html.contains(forbidden), "{forbidden}");
        }
        for link in html.split(" href=\"").skip(1).map(|rest| rest.split('"').next().unwrap()) {
            assert!(link == "data:," || page.join(link).is_file(), "{link}");
        }
    }
    assert!(!gallery.contains("http"), "{gallery}");
    let found = data(&gallery);
    let names: Vec<[&str; 2]> = found["columns"]
        .as_array()
        .unwrap()
        .iter()
        .map(|column| [column["name"].as_str().unwrap(), column["what"].as_str().unwrap()])
        .collect();
    assert_eq!(names, [["vernis", "predicted MOS"], ["D9.Cl", "distance"], ["mine </script>", "scores.csv"]]);
    let expected = [
        ("stone", "WARD", 3.0, serde_json::json!([2.5, 0.9, -1e-7])),
        ("stone", "A/B", 4.5, serde_json::json!([4.0, 0.01, null])),
        ("wood", "WARD", 2.0, serde_json::json!([3.5, 0.02, 3e6])),
        ("wood", "<new>", 4.0, serde_json::json!([1.25, 0.3, -0.5])),
    ];
    for (pair, (material, method, mos, values)) in found["pairs"].as_array().unwrap().iter().zip(expected) {
        assert_eq!(pair["material"], material);
        assert_eq!((&pair["method"], &pair["mos"], &pair["values"]), (&method.into(), &mos.into(), &values));
        let link = |of: &str| found["pictures"][pair[of].as_u64().unwrap() as usize]["link"].as_str().unwrap();
        assert_eq!(link("reference"), format!("stimuli/{material}/reference.png"));
        assert_eq!(link("hidden"), format!("stimuli/{material}/hidden-reference.png"));
        assert!(link("candidate").starts_with(&format!("stimuli/{material}/{}", &method[..1].replace('<', "_"))));
    }
    // The same bytes each time.
    place.report(&["--benchmark", "judged", "--scores", "scores.csv", "--replace"]);
    assert!(place.read("page/gallery.html") == gallery && place.read("page/report.html") == report);
}

#[test]
fn what_is_not_rendered_yet_is_counted() {
    let place = Place::new();
    place.render(&["--shard", "2/2"]);
    fs::remove_file(place.path("page/stimuli/wood/reference.json")).unwrap();
    place.report(&[]);
    let (report, gallery) = (place.read("page/report.html"), place.read("page/gallery.html"));
    for html in [&report, &gallery] {
        assert!(html.contains("5 of 8 pictures are not rendered yet."), "{html}");
    }
    assert_eq!(gallery.matches("data:image/jpeg").count(), 3);
    assert_eq!(
        report.matches(r#"<img class="sphere""#).count() + report.matches(r#"<img class="stimulus""#).count(),
        6 + 3
    );
    let found = data(&gallery);
    assert_eq!(found["pairs"].as_array().unwrap().len(), 2);
    assert!(found["pairs"][0]["reference"].is_null() && found["pairs"][0]["hidden"].is_u64());
    assert_eq!(found["columns"], serde_json::json!([]));
}

/// One message, exit code 2, and no page.
#[test]
fn a_folder_that_cannot_be_shown_is_one_message() {
    let place = Place::rendered();
    fs::create_dir(place.path("empty")).unwrap();
    let sidecar = place.read("page/stimuli/stone/WARD.json");
    let png = fs::read(place.path("page/stimuli/stone/WARD.png")).unwrap();
    let changed = |from: &str, to: &str| {
        let text = sidecar.replacen(from, to, 1);
        assert_ne!(text, sidecar, "{from}");
        text.into_bytes()
    };
    let sha256 = |bytes: &[u8]| vernis::brdf::ContentHash::of(bytes).to_string();
    let cut = png[..png.len() / 2].to_vec();
    let cut_sidecar = changed(&sha256(&png), &sha256(&cut));
    let (json, picture) = ("page/stimuli/stone/WARD.json", "page/stimuli/stone/WARD.png");
    for (file, bytes, also, expected) in [
        (json, b"{".to_vec(), None, "stone/WARD.json: EOF while parsing"),
        (
            json,
            changed("\"format\": 2", "\"format\": 99"),
            None,
            "WARD.json: its format is 99, and this version of vernis reads 1 to 2",
        ),
        (
            json,
            changed("\"test\"", "\"reference\""),
            None,
            "WARD.json: camera is `reference`, and of this picture it is `test`",
        ),
        (json, changed("24,", "25,"), None, "WARD.png: it has 24x36 pixels, and the file beside it says 25x36"),
        (
            picture,
            cut.clone(),
            None,
            "stone/WARD.png: its content is not that which page/stimuli/stone/WARD.json states; `vernis render`",
        ),
        (picture, cut, Some(cut_sidecar), "it must be the PNG file of a stimulus"),
        (
            "b.json",
            place.read("c.json").into_bytes(),
            None,
            "stone/WARD.json says that the picture shows b.json (SHA-256 ",
        ),
    ] {
        let before = fs::read(place.path(file)).unwrap();
        place.write(file, bytes);
        if let Some(also) = also {
            place.write(json, also);
        }
        let [_, err] = place.said(&["report", "--study", "pairs.csv", "--stimuli", "page/stimuli", "--out", "none"], 2);
        assert!(err.contains(expected) && err.trim_end().lines().count() == 1, "{expected}: {err}");
        place.write(file, before);
        place.write(json, &sidecar);
    }
    place.write(
        "raw.csv",
        "participant,material,method,score\np,stone,WARD,3\nq,stone,WARD,4\np,wood,WARD,1\nq,wood,WARD,2\n",
    );
    place.write("few.csv", "material,method,d\nstone,WARD,1\n");
    place.write("other.csv", PAIRS.replace("stone", "rock").replace("wood", "tree"));
    let of = |more: &[&'static str]| [&["report", "--out", "none"], more].concat();
    for (args, expected) in [
        (
            of(&["--study", "pairs.csv", "--stimuli", "nowhere"]),
            "nowhere: no such folder; it must be one that `vernis render --study",
        ),
        (
            of(&["--study", "pairs.csv", "--stimuli", "empty"]),
            "empty holds none of the 8 stimuli of pairs.csv; it must be the folder",
        ),
        (
            of(&["--study", "other.csv", "--stimuli", "page/stimuli"]),
            "page/stimuli holds none of the 8 stimuli of other.csv",
        ),
        (
            of(&["--ratings", "raw.csv", "--stimuli", "page/stimuli"]),
            "--stimuli needs a study, for --ratings does not say",
        ),
        (
            of(&["--study", "pairs.csv", "--stimuli", "page/stimuli", "--scores", "few.csv"]),
            "few.csv has no row for 3 of the 4 rated pairs of pairs.csv",
        ),
    ] {
        let [_, err] = place.said(&args, 2);
        assert!(err.contains(expected) && err.trim_end().lines().count() == 1, "{args:?}: {err}");
    }
    let [_, err] = place.said(&of(&["--study", "pairs.csv", "--scores", "scores.csv"]), 2);
    assert!(err.contains("--stimuli"), "{err}");
    assert!(files_of(&place.path("none"), "").is_empty());
    place.report(&[]);
}

/// Sidecars of the first layout do not tell their tone.
#[test]
fn stimuli_of_the_first_layout_are_shown_and_kept() {
    let place = Place::rendered();
    for (folder, name) in [("stone", "WARD"), ("wood", "WARD")] {
        let path = format!("page/stimuli/{folder}/{name}.json");
        let mut sidecar: serde_json::Map<String, Value> = serde_json::from_str(&place.read(&path)).unwrap();
        for name in ["tone", "gamma", "exposure"] {
            assert!(sidecar.remove(name).is_some(), "{name}");
        }
        sidecar.insert("format".into(), 1.into());
        place.write(&path, serde_json::to_vec(&sidecar).unwrap());
    }
    let args = [&["render", "--study", "pairs.csv", "--out", "page/stimuli"], &SMALL[..]].concat();
    assert!(place.said(&args, 0)[0].contains("0 pictures made, 8 kept"));
    place.report(&[]);
    let gallery = place.read("page/gallery.html");
    assert!(
        gallery.contains("made in several ways, so that they cannot be compared with each other: 6 pictures: "),
        "{gallery}"
    );
    assert!(gallery.contains("; 2 pictures: 24x36 pixels, 2 samples a pixel, at most 8 bounces."));
}
