//! `vernis compare-images`: its numbers, its map, and what it says of wrong input.

use image::{ImageBuffer, Luma, Rgb};
use serde_json::Value;
use std::fs;
use std::process::{Command, Output};
use tempfile::TempDir;

/// A folder with pictures, in which the program runs.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().expect("a folder"));
        let code = |x: u32, y: u32| ((x * 5 + y * 3) % 200 + 40 * ((x / 8 + y / 8) % 2)) as u8;
        let reference = ImageBuffer::from_fn(40, 30, |x, y| Rgb([code(x, y), code(y, x), code(x + y, y)]));
        let test = ImageBuffer::from_fn(40, 30, |x, y| {
            let noise = ((x * 7 + y * 13) % 11) as u8;
            Rgb(reference.get_pixel(x, y).0.map(|v| v.saturating_add(noise)))
        });
        reference.save(place.0.path().join("ref.png")).expect("written");
        test.save(place.0.path().join("test.png")).expect("written");
        ImageBuffer::from_pixel(40, 31, Rgb([1u8, 2, 3])).save(place.0.path().join("other.png")).expect("written");
        let light: Vec<u8> = (0..40 * 30 * 3).flat_map(|i| (1.0 + (i % 7) as f32).to_le_bytes()).collect();
        fs::write(place.0.path().join("light.pfm"), [b"PF 40 30 -1\n", &light[..]].concat()).expect("written");
        place
    }

    fn run(&self, args: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
        command.arg("compare-images").args(args).current_dir(self.0.path()).env_remove("VERNIS_DATA");
        command.output().expect("the program starts")
    }

    fn json(&self, args: &[&str]) -> Value {
        let found = self.run(&[args, &["--json"]].concat());
        assert_eq!(found.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&found.stderr));
        serde_json::from_slice(&found.stdout).expect("JSON")
    }

    /// One message, and exit code 2.
    fn mistake(&self, args: &[&str]) -> String {
        let found = self.run(args);
        let error = String::from_utf8(found.stderr).expect("UTF-8");
        assert_eq!((found.status.code(), found.stdout.len()), (Some(2), 0), "{args:?}: {error}");
        error
    }
}

#[test]
fn json_has_distances_quality_and_versions() {
    let place = Place::new();
    let found = place.json(&["ref.png", "test.png", "--metric", "ssim", "-m", "psnr", "-m", "hdr-vdp", "--ppd", "60"]);
    let quality = |name: &str| found["quality"][name].as_f64().expect("a number");
    let distance = |name: &str| found["distances"][name].as_f64().expect("a number");
    assert_eq!(found["distances"].as_object().map(|all| all.len()), Some(3));
    assert!((distance("ssim") - (1.0 - quality("ssim"))).abs() < 1e-12 && distance("ssim") > 0.0);
    assert!((distance("psnr") - 10f64.powf(-quality("psnr") / 20.0)).abs() < 1e-9);
    assert_eq!(found["details"]["hdr-vdp"]["ppd"], 60.0);
    assert!(found["details"]["hdr-vdp"]["P_det"].is_number() && found["versions"]["ssim"].is_u64());
    let same = place.json(&["ref.png", "ref.png", "-m", "ssim", "-m", "psnr", "-m", "hdr-vdp", "-m", "cvvdp"]);
    assert!(same["distances"].as_object().is_some_and(|all| all.values().all(|d| d == 0.0)), "{same}");
    assert!(same["quality"]["psnr"].is_null());
    assert_eq!(same["quality"]["cvvdp"], 10.0);
}

#[test]
fn without_metrics_all_that_apply() {
    let place = Place::new();
    let codes = place.json(&["ref.png", "test.png"]);
    let has = |found: &Value, name: &str| found["quality"].get(name).is_some();
    assert!(has(&codes, "cid-cielab") && has(&codes, "flip") && !has(&codes, "cid") && !has(&codes, "hdr-flip"));
    // Too small for MS-SSIM, which is said and no mistake.
    assert!(!has(&codes, "ms-ssim"));
    let light = place.json(&["light.pfm", "light.pfm"]);
    assert!(has(&light, "hdr-flip") && has(&light, "delta-e-itp") && !has(&light, "ssim"));
}

#[test]
fn a_map_shows_where_the_differences_are() {
    let place = Place::new();
    let found = place.json(&["ref.png", "test.png", "-m", "psnr", "--map", "map.png"]);
    assert_eq!((&found["map"]["width"], &found["map"]["white"]), (&40.into(), &255.0.into()));
    let map = image::open(place.0.path().join("map.png")).expect("a picture").into_luma16();
    assert_eq!(map.dimensions(), (40, 30));
    // Noise of (7 x + 13 y) mod 11 codes in every channel, 257 of 65535 each.
    assert_eq!(map.get_pixel(0, 0), &Luma([0]));
    assert!(map.get_pixel(1, 0).0[0].abs_diff(7 * 257) <= 1);
    assert!(place.mistake(&["ref.png", "test.png", "-m", "psnr", "--map", "map.png"]).contains("exists already"));
    assert!(place.mistake(&["ref.png", "test.png", "--map", "new.png"]).contains("exactly one --metric; there are 0"));
    let none = place.mistake(&["ref.png", "test.png", "-m", "ms-ssim", "--map", "new.png"]);
    assert!(none.contains("ms-ssim has none"), "{none}");
    assert!(place.mistake(&["ref.png", "test.png", "-m", "psnr", "--map", "new.jpg"]).contains("must end in .png"));
    let input = place.mistake(&["ref.png", "test.png", "-m", "psnr", "--map", "ref.png", "--replace"]);
    assert!(input.contains("inputs are never replaced"), "{input}");
}

#[test]
fn wrong_input_is_one_message() {
    let place = Place::new();
    for (args, expected) in [
        (
            &["ref.png", "other.png"][..],
            "the test picture has 40 x 31 pixels; it must have as many as the reference, 40 x 30",
        ),
        (
            &["ref.png", "light.pfm"],
            "the reference holds sRGB codes (of a PNG or JPEG) and the test picture linear light",
        ),
        (&["ref.png", "test.png", "-m", "sism"], "did you mean ssim"),
        (&["ref.png", "test.png", "-m", "hdr-flip"], "hdr-flip needs linear light"),
        (&["ref.png", "test.png", "-m", "icid"], "without it use icid-cielab"),
        (
            &["ref.png", "test.png", "-m", "icid", "--weights", "."],
            "icid needs the table of LAB2000HL, which may not be shipped; the folder . has no lab2000hl_ab.f32; without it use icid-cielab",
        ),
        (&["ref.png", "test.png", "--weights", "nowhere"], "--weights nowhere is no folder"),
        (&["ref.png", "test.png", "--ppd", "0"], "there are 0 pixels a degree; there must be 1 to 1000"),
        (&["ref.png", "missing.png"], "missing.png: "),
        (
            &["ref.png", "test.png", "-m", "cvvdp", "--display", "standard-hdr-linear"],
            "display standard-hdr-linear shows",
        ),
    ] {
        let message = place.mistake(args);
        assert!(message.contains(expected) && message.lines().count() == 1, "{args:?}: {message}");
    }
    fs::write(place.0.path().join("lab2000hl_ab.f32"), [0; 12]).expect("written");
    let size = place.mistake(&["ref.png", "test.png", "-m", "cid", "--weights", "."]);
    assert!(size.contains("it has 12 bytes; the table of LAB2000HL has 257 x 257 x 2"), "{size}");
}

#[test]
fn networks_say_which_weights_are_missing() {
    let place = Place::new();
    // Large enough for the network, which the other pictures are not.
    for name in ["large.png", "larger.png"] {
        ImageBuffer::from_pixel(48, 40, Rgb([100u8, 50, 20])).save(place.0.path().join(name)).expect("written");
    }
    let missing = "vernis: st-lpips-alex needs alex_shift_tolerant.pth (or alex_shift_tolerant.safetensors), which may not be \
                   shipped; ";
    let listed = "(`vernis data weights` says where to get it)\n";
    let said = place.mistake(&["large.png", "larger.png", "-m", "st-lpips-alex"]);
    assert!(said.contains(missing) && said.contains("with --weights") && said.ends_with(listed), "{said}");
    fs::create_dir(place.0.path().join("weights")).expect("a folder");
    let said = place.mistake(&["large.png", "larger.png", "-m", "st-lpips-alex", "--weights", "weights"]);
    assert!(said.contains(missing) && said.contains("the folder weights has no such file"), "{said}");
    fs::write(place.0.path().join("weights/alex_shift_tolerant.pth"), b"nothing").expect("written");
    let said = place.mistake(&["large.png", "larger.png", "-m", "st-lpips-alex", "--weights", "weights"]);
    assert!(said.contains("alex_shift_tolerant.pth: it is no PyTorch checkpoint: "), "{said}");
}

#[test]
fn weights_are_listed_with_what_a_folder_has() {
    let place = Place::new();
    let run = |args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
        command.args(["data", "weights"]).args(args).current_dir(place.0.path()).output().expect("the program starts")
    };
    let text = String::from_utf8(run(&[]).stdout).expect("UTF-8");
    assert!(text.contains("alex_shift_tolerant.pth: ST-LPIPS on AlexNet") && !text.contains("missing"), "{text}");
    fs::create_dir(place.0.path().join("weights")).expect("a folder");
    fs::write(place.0.path().join("weights/alex.pth"), b"mine").expect("written");
    fs::write(place.0.path().join("weights/model_best.safetensors"), b"mine").expect("written");
    let found: Value = serde_json::from_slice(&run(&["--weights", "weights", "--json"]).stdout).expect("JSON");
    let state = |name: &str| {
        let row = found.as_array().and_then(|all| all.iter().find(|row| row["file"] == name)).expect("a row");
        (row["state"].as_str().expect("a state").to_owned(), row["path"].as_str().map(str::to_owned))
    };
    assert_eq!(state("vgg.pth"), ("missing".to_owned(), None));
    assert_eq!(state("alex.pth"), ("different".to_owned(), Some("weights/alex.pth".to_owned())));
    assert_eq!(state("model_best.pth.tar").0, "not checked");
    let wrong = run(&["--weights", "nowhere"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("--weights nowhere is no folder"));
}
