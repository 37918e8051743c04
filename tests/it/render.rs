//! `vernis render`: pictures of BRDFs and scenes, the stimuli of a study, and what cannot be rendered.

use crate::files_of;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

const GGX: &str = r#"{"model":"ggx","kd":[0.1,0.15,0.2],"f0":[0.5,0.4,0.2],"alpha":0.3}"#;
const SCENE: &str = r#"{"shape": {"mesh": "m.obj"}, "brdf": "a.json", "table": {"half_side": 3, "brdf": "wood"},
    "camera": {"from": [0, 1, 6], "to": [0, 1, 0], "fov_deg": 24}, "film": [8, 12], "light": "lamps", "samples": 4}"#;

struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        place.write("a.json", GGX);
        place.write("b.json", GGX.replace("0.3}", "0.2}"));
        place.write("m.obj", "v -1 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n");
        place.write("scene.json", SCENE);
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        fs::write(self.path(name), text).unwrap();
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    /// Standard output and standard error of a run that ends with `code`.
    fn said(&self, args: &[&str], code: i32) -> [String; 2] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
        command.arg("render").args(args).current_dir(self.0.path()).env_remove("VERNIS_DATA");
        let output = command.output().unwrap();
        let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        assert_eq!(output.status.code(), Some(code), "{args:?}: {said:?}");
        said
    }
}

const SMALL: [&str; 4] = ["--size", "8x12", "--samples", "4"];

#[test]
fn a_brdf_becomes_a_picture_that_threads_do_not_change() {
    let place = Place::new();
    let render = |out: &str, more: &[&str]| {
        place.said(&[&["a.json", "--out", out], &SMALL[..], more].concat(), 0);
        place.bytes(out)
    };
    let one = render("one.exr", &["--threads", "1"]);
    assert_eq!(one, render("two.exr", &["--threads", "2"]));
    for more in [
        &["--seed", "1"][..],
        &["--camera", "reference"],
        &["--shape", "sphere"],
        &["--light", "white"],
        &["--no-table"],
        &["--bounces", "1"],
    ] {
        assert_ne!(one, render(&format!("{}.exr", more.concat().replace('-', "")), more), "{more:?}");
    }
    let png = render("one.png", &[]);
    assert_eq!(&png[1..4], b"PNG");
    for more in [&["--tone", "srgb"][..], &["--tone", "none"], &["--exposure", "-1"], &["--gamma", "0.8"]] {
        assert_ne!(png, render(&format!("{}.png", more.concat().replace('-', "")), more), "{more:?}");
    }
}

#[test]
fn a_scene_is_rendered_and_its_options_are_overridden() {
    let place = Place::new();
    let [out, _] = place.said(&["scene.json", "--out", "s.exr"], 0);
    assert!(out.starts_with("8x12 pixels, 4 samples, 8 bounces"), "{out}");
    let [out, _] =
        place.said(&["scene.json", "--out", "t.exr", "--size", "4x6", "--samples", "1", "--bounces", "1"], 0);
    assert!(out.starts_with("4x6 pixels, 1 sample, 1 bounce,"), "{out}");
    place.said(&["scene.json", "--out", "u.exr"], 0);
    assert_eq!(place.bytes("s.exr"), place.bytes("u.exr"));
}

/// One message, exit code 2, and nothing written.
#[test]
fn what_cannot_be_rendered_is_one_message_and_no_file() {
    let place = Place::new();
    place.write("empty.ply", "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n");
    place.write("far.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    place.write("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    place.write("cut.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 512 +X 1024\n");
    place.write("inside.json", SCENE.replace(r#"{"mesh": "m.obj"}"#, r#"{"sphere": {"radius": 7}}"#));
    place.write("zero.json", SCENE.replace(r#""samples": 4"#, r#""samples": 0"#));
    let before = files_of(place.0.path(), "").len();
    let brdf = |more: &[&'static str]| [&["a.json", "--out", "x.png"], &SMALL[..], more].concat();
    for (args, expected) in [
        (brdf(&["--shape", "empty.ply"]), "empty.ply: mesh: it has no face"),
        (brdf(&["--shape", "far.obj"]), "far.obj: mesh: face vertex index out of bounds"),
        (brdf(&["--shape", "nan.obj"]), "nan.obj: mesh: vertex 0 is"),
        (brdf(&["--shape", "none.ply"]), "none.ply: No such file"),
        (brdf(&["--light", "cut.hdr"]), "cut.hdr: light probe: "),
        (brdf(&["--light", "none.hdr"]), "none.hdr: light probe: No such file"),
        (brdf(&["--gamma", "0.8", "--tone", "srgb"]), "--gamma is the power of --tone exrdisplay"),
        (vec!["inside.json", "--out", "x.png"], "inside the shape; it must be outside"),
        (vec!["zero.json", "--out", "x.png"], "zero.json: samples is 0; it must be an integer from 1"),
        (vec!["scene.json", "--out", "x.png", "--light", "white"], "--light is for BRDFs"),
        (vec!["a.json", "--out", "x.jpg"], "its name must end in .exr or .png"),
        (vec!["a.json", "--out", "none/../a.json"], "must end in .exr or .png"),
        (vec!["a.json", "--out", "x.exr", "--exposure", "1"], "an EXR file holds linear radiance"),
        (vec!["a.json", "--out", "a.json/x.png"], "cannot write there"),
        (vec!["none.json", "--out", "x.png"], "none.json: no such file"),
    ] {
        let [_, err] = place.said(&args, 2);
        assert!(err.contains(expected) && err.trim_end().lines().count() == 1, "{args:?}: {err}");
        assert_eq!(files_of(place.0.path(), "").len(), before, "{args:?}");
    }
    for (option, value) in
        [("--samples", "0"), ("--size", "0x9"), ("--size", "99999x99999"), ("--bounces", "0"), ("--gamma", "0")]
    {
        let [_, err] = place.said(&["a.json", "--out", "x.png", option, value], 2);
        assert!(err.contains(option) && err.contains("it must be"), "{err}");
    }
    place.write("x.png", "earlier");
    let [_, err] = place.said(&brdf(&[]), 2);
    assert!(err.contains("exists already; use --replace"), "{err}");
    assert_eq!(place.bytes("x.png"), b"earlier");
}

/// Where the disc is full, the old picture stays and nothing is left.
#[cfg(target_os = "linux")]
#[test]
fn a_full_output_is_one_message() {
    let place = Place::new();
    // A limit on the size of files stands for a full disc; the signal that comes with it is ignored.
    let vernis = env!("CARGO_BIN_EXE_vernis");
    let script = format!("trap '' XFSZ; ulimit -f 1; exec {vernis} render a.json --size 64x96 --samples 1 --out x.exr");
    let output =
        Command::new("bash").args(["-c", &script]).current_dir(place.0.path()).env_remove("VERNIS_DATA").output();
    let output = output.unwrap();
    let err = String::from_utf8(output.stderr).unwrap();
    assert_ne!(output.status.code(), Some(0), "{err}");
    assert!(err.contains("x.exr: "), "{err}");
    assert!(files_of(place.0.path(), ".exr").is_empty() && files_of(place.0.path(), ".partial").is_empty());
}

#[test]
fn the_stimuli_of_a_study_are_made_once() {
    let place = Place::new();
    place.write(
        "pairs.csv",
        "reference,candidate,material,method,mos\na.json,b.json,stone,WARD,3\na.json,a.json,stone,A/B,5\nb.json,a.json,wood,WARD,4\n",
    );
    let render = |more: &[&str]| {
        let args = [&["--study", "pairs.csv", "--out", "out"], &SMALL[..], more].concat();
        place.said(&args, 0)[0].clone()
    };
    assert!(render(&["--shard", "2/2"]).contains("3 pictures made, 0 kept"));
    assert!(render(&[]).contains("4 pictures made, 3 kept"));
    let names = files_of(&place.path("out/stone"), "");
    let expected = ["WARD", "A_B", "reference", "hidden-reference"];
    assert_eq!(names.len(), 3 * expected.len(), "{names:?}");
    for name in expected {
        assert!(
            ["exr", "png", "json"].iter().all(|ending| names.contains_key(&format!("{name}.{ending}"))),
            "{names:?}"
        );
    }
    // The candidate that is the reference looks as the reference does in the camera of candidates.
    assert_eq!(place.bytes("out/stone/A_B.exr"), place.bytes("out/stone/hidden-reference.exr"));
    assert_ne!(place.bytes("out/stone/A_B.exr"), place.bytes("out/stone/reference.exr"));
    // What is damaged or of other settings is made anew, to the same bytes.
    let whole = place.bytes("out/wood/WARD.exr");
    place.write("out/wood/WARD.exr", &whole[..100]);
    assert!(render(&[]).contains("1 picture made, 6 kept"));
    assert_eq!(place.bytes("out/wood/WARD.exr"), whole);
    assert!(render(&["--seed", "1"]).contains("7 pictures made, 0 kept"));
    assert_ne!(place.bytes("out/wood/WARD.exr"), whole);
}
