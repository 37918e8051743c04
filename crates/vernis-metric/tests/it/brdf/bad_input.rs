//! Wrong files and notations: one clear message each, and earlier files intact.

use super::{message, open};
use crate::data_folder;
use std::fs;
use std::path::Path;
use vernis_metric::brdf::formats::{self, merl, titopo};
use vernis_metric::brdf::models::{Ggx, Lambert};
use vernis_metric::brdf::{Brdf, Grid, TabulatedBrdf};

const HEADER: [u8; 12] = [90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0];

/// The bytes of a MERL file of one number, but for the cells named: (plane, cell, value).
fn merl_bytes(changes: &[(usize, usize, f64)]) -> Vec<u8> {
    let cells = Grid::MERL.len();
    let mut numbers = vec![150.0f64; 3 * cells];
    for &(plane, cell, value) in changes {
        numbers[plane * cells + cell] = value;
    }
    HEADER.into_iter().chain(numbers.iter().flat_map(|v| v.to_le_bytes())).collect()
}

#[test]
fn merl_files_of_the_wrong_size_or_header() {
    let path = Path::new("alum-bronze.binary");
    let good = merl_bytes(&[]);
    let at = |bytes: &[u8]| message(merl::decode(path, bytes));
    for cut in [good.len() - 1, good.len() / 2, 12] {
        let text = at(&good[..cut]);
        let allowed = if cut == 12 { "34992012 or 69984012" } else { "34992012 for its header 90x90x180" };
        assert_eq!(text, format!("alum-bronze.binary: the file has {cut} bytes; MERL needs {allowed}"));
    }
    assert!(at(&[]).contains("the file has 0 bytes"));
    assert!(at(&[good.clone(), vec![0]].concat()).contains("the file has 34992013 bytes"));
    let mut other = good.clone();
    other[8] = 181;
    assert_eq!(at(&other), "alum-bronze.binary: the header says 90x90x181; MERL needs 90x90x180 or 90x90x360");
    // A header of the larger form before the smaller body.
    other[8..10].copy_from_slice(&360u16.to_le_bytes());
    assert!(at(&other).contains("MERL needs 69984012 for its header 90x90x360"));
}

#[test]
fn merl_numbers_that_are_none_are_refused_and_negative_ones_masked() {
    let path = Path::new("x.binary");
    let cell = (45 * 90 + 30) * 180 + 77;
    for wrong in [f64::NAN, f64::INFINITY, 1e300] {
        let text = message(merl::decode(path, &merl_bytes(&[(1, cell, wrong)])));
        assert!(text.starts_with("x.binary: G plane, cell theta_h 45, theta_d 30, phi_d 77 holds "), "{text}");
        assert!(text.contains("it must hold a finite number"), "{text}");
    }
    let table = merl::decode(path, &merl_bytes(&[(2, cell, -1.0), (0, 5, -1e-9)])).expect("negative is allowed");
    let masked: Vec<usize> = (0..Grid::MERL.len()).filter(|k| !table.valid()[*k]).collect();
    assert_eq!(masked, [5, cell]);
    // The published factors: 150 (1, 1.15, 1.66) / 1500.
    assert_eq!(table.values()[0], [0.1, 0.115, 0.166]);
    let nothing = merl::decode(path, &[&HEADER[..], &(-1.0f64).to_le_bytes().repeat(3 * Grid::MERL.len())].concat());
    assert_eq!(message(nothing), "x.binary: the table has no valid cell");
}

#[test]
fn titopo_files_of_the_wrong_size_and_unknown_cells() {
    let good: Vec<u8> = 0.25f32.to_le_bytes().repeat(3 * Grid::TITOPO_HALF.len());
    let path = Path::new("x.T.titopoh");
    for bytes in [&good[..good.len() - 4], &[&good[..], &[0; 4]].concat(), &[]] {
        let text = message(titopo::decode(path, bytes));
        let expected =
            format!("x.T.titopoh: the file has {} bytes; Titopo at half resolution needs exactly 4374000", bytes.len());
        assert_eq!(text, expected);
    }
    let text = message(titopo::decode(Path::new("x.T.titopo"), &good));
    assert_eq!(text, "x.T.titopo: the file has 4374000 bytes; Titopo needs exactly 34992000");
    let mut gaps = good;
    for (cell, value) in [(7, f32::NAN), (100, -0.5), (101, f32::INFINITY)] {
        gaps[12 * cell + 4..12 * cell + 8].copy_from_slice(&value.to_le_bytes());
    }
    let table = titopo::decode(path, &gaps).expect("gaps are allowed");
    let masked: Vec<usize> = (0..Grid::TITOPO_HALF.len()).filter(|k| !table.valid()[*k]).collect();
    assert_eq!(masked, [7, 100, 101]);
}

#[test]
fn a_table_on_another_grid_is_not_written_and_a_failed_write_leaves_the_old_file() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let table = TabulatedBrdf::tabulate(&Lambert { kd: [0.5; 3] }, Grid::TITOPO_HALF).expect("finite model");
    let path = folder.path().join("old.binary");
    fs::write(&path, "old").expect("writable");
    let text = message(merl::write(&path, &table));
    assert!(
        text.contains("MERL cannot hold a 45x45x180 table in standard coordinates; resample to Grid::MERL"),
        "{text}"
    );
    assert_eq!(fs::read(&path).expect("still there"), b"old");
    let text = message(titopo::write(&folder.path().join("no/such/folder.titopoh"), &table));
    assert!(text.contains("folder.titopoh: ") && text.contains("No such file"), "{text}");
    // A folder of that name cannot be replaced by a file, and no temporary file stays behind.
    let taken = folder.path().join("taken.titopoh");
    fs::create_dir_all(taken.join("inside")).expect("writable");
    assert!(message(titopo::write(&taken, &table)).contains("taken.titopoh: "));
    assert_eq!(folder.path().read_dir().expect("folder").count(), 2);
}

#[test]
fn models_in_json() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let read = |text: &str, query: &str| {
        fs::write(folder.path().join("m.json"), text).expect("writable");
        open(&format!("m.json{query}"), folder.path())
    };
    let good = r#"{"model":"ggx","kd":[0.2,0.1,0.05],"f0":[0.04,0.04,0.04],"alpha":0.15}"#;
    let n = vernis_metric::math::Vec3::new(0.0, 0.0, 1.0);
    let model = |alpha| Ggx { kd: [0.2, 0.1, 0.05], f0: [0.04; 3], alpha };
    assert_eq!(read(good, "").expect("valid").eval(n, n), model(0.15).eval(n, n));
    assert_eq!(read(good, "?alpha=.3").expect("valid").eval(n, n), model(0.3).eval(n, n));
    let twice = good.replace("0.15", "0.15,\"alpha\":0.5");
    let roughness = good.replace("alpha", "roughness");
    for (text, query, expected) in [
        (&twice[..], "", "m.json: not a valid model in JSON: the key `alpha` is given twice at line 1 column 77"),
        (&roughness, "", "m.json: ggx has no parameter `roughness`; alpha = roughness^2 for the roughness of Disney"),
        (good, "?ior=1.5", "ggx has no parameter `ior`; f0 = ((n - 1) / (n + 1))^2 for an index of refraction n"),
        (&good.replace("ggx", "disney"), "", "m.json: unknown model `disney`; it is called principled here"),
        (&good.replace("0.15", "1e-300"), "", "ggx: alpha is 1e-300; it must be 0.001 to 1"),
        ("[1]", "", "m.json: not a valid model in JSON: it must be an object"),
        (&good.replace("alpha", "alfa")[..], "", "m.json: ggx has no parameter `alfa`; did you mean alpha"),
        (&good.replace("ggx", "gxx"), "", "m.json: unknown model `gxx`; did you mean ggx"),
        (&good.replace("\"alpha\":0.15", "\"alpha\":\"x\""), "", "m.json: alpha is \"x\"; it must be one number"),
        (&good.replace(",0.05]", "]"), "", "m.json: kd is [0.2,0.1]; it must be 3 numbers"),
        (&good.replace(",\"alpha\":0.15", ""), "", "m.json: alpha is missing; it must be one number"),
        (&good.replace("0.15", "-0.15"), "", "ggx: alpha is -0.15; it must be 0.001 to 1"),
        (&good.replace("\"ggx\"", "7"), "", "m.json: model is 7; it must be one of lambert, ward"),
        ("{\"model\":\"ggx\",", "", "m.json: not a valid model in JSON: EOF"),
        (good, "?eta=2.5", "ggx has no parameter `eta`; no name is similar; its parameters are kd, f0, alpha"),
        (good, "?alpha=big", "m.json?alpha=big: alpha is big; it must be one number"),
        (good, "?alpha=NaN", "m.json?alpha=NaN: ggx: alpha is NaN; it must be 0.001 to 1"),
        (good, "?model=abc", "model is abc (kd, a, b, c, eta); it must be a model with the fields of ggx"),
    ] {
        let found = message(read(text, query));
        assert!(found.contains(expected), "{found}\n{expected}");
    }
}

#[test]
fn files_that_are_missing_or_not_what_they_seem() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let text = message(open("nowhere.binary", folder.path()));
    assert!(text.starts_with("nowhere.binary: no such file; looked for nowhere.binary, "), "{text}");
    assert!(text.contains(&folder.path().join("merl/nowhere.binary").display().to_string()), "{text}");
    for (name, content, expected) in [
        ("a.zip", "not a zip", "not a valid archive of BRDFs"),
        ("a.fit", "# nothing\n", "not a valid file of fits: no line with a material"),
        ("b.fit", "# one\nteflon = Aggregate(", "b.fit:2: column 20 is the end of the line"),
        ("a.bin", "short", "the file has 5 bytes; NPF needs exactly 1572864"),
        ("b.bin", &"u".repeat(1_990_656), "its 1990656 bytes are those of an anisotropic BRDF of UTIA"),
    ] {
        fs::write(folder.path().join(name), content).expect("writable");
        let text = message(open(&format!("{name}:teflon"), folder.path()));
        assert!(text.contains(name) && text.contains(expected), "{text}");
        assert_eq!(message(formats::materials(&folder.path().join(name))), text);
    }
    let twice = "x = Aggregate(Lambertian(albedo = [0, 0, 0]), NganWard(albedo = [0, 0, 0], roughness = 0.1))\n";
    fs::write(folder.path().join("c.fit"), twice.repeat(2)).expect("writable");
    assert!(message(open("c.fit:x", folder.path())).contains("c.fit:2: material `x` is given twice"));
    assert!(message(formats::materials(Path::new("x.txt"))).contains("extension is `txt`; it must be zip, fit or bin"));
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn an_unknown_material_brings_the_nearest_names() {
    let data = data_folder();
    for file in ["merl_nbrdf.zip", "bagher_sgd.fit", "npf.bin"] {
        let text = message(open(&format!("{file}:alum-bronz"), &data));
        assert!(text.contains(file) && text.contains("no material `alum-bronz`; did you mean alum-bronze"), "{text}");
    }
    let text = message(open("low_lowmicrofacet_E2.fit:teflon?etta=2.5", &data));
    assert!(
        text.contains("abc has no parameter `etta`; did you mean eta") && text.contains("kd, a, b, c, eta"),
        "{text}"
    );
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn a_damaged_network_names_the_material() {
    let data = data_folder();
    let path = data.join("nbrdf/merl_nbrdf.zip");
    let bytes = formats::archive::member(&path, "teflon").expect("material of the archive").bytes;
    let text = message(formats::nbrdf::decode(&path, "teflon", bytes[..bytes.len() / 2].to_vec()));
    assert!(text.contains("merl_nbrdf.zip: not a valid archive of BRDFs: teflon: "), "{text}");
}
