//! Tables from one file format into another, and what that loses.

use super::{error, out, text, vernis_data};
use std::fs;
use std::path::Path;
use vernis::brdf::formats::{merl, titopo};
use vernis::brdf::models::Ggx;
use vernis::brdf::{ConversionLoss, Grid, TabulatedBrdf};

fn ggx(grid: Grid) -> TabulatedBrdf {
    let model = Ggx { kd: [0.2, 0.1, 0.05], f0: [0.04; 3], alpha: 0.2 };
    TabulatedBrdf::tabulate(&model, grid).expect("finite model")
}

#[test]
fn the_losses_that_the_help_states() {
    let help = out(&vernis_data(&["convert", "--help"]));
    let mut unsaid = Vec::new();
    for (from, to, way) in [
        (Grid::MERL, Grid::TITOPO, ".binary  -> .titopo  -> .binary "),
        (Grid::MERL, Grid::TITOPO_HALF, ".binary  -> .titopoh -> .binary "),
        (Grid::TITOPO, Grid::MERL, ".titopo  -> .binary  -> .titopo "),
        (Grid::TITOPO, Grid::TITOPO_HALF, ".titopo  -> .titopoh -> .titopo "),
    ] {
        let ConversionLoss { median, p99, missing } = ConversionLoss::of(&ggx(from), to).expect("valid cells");
        let expected = format!("{way}    {median:.5} and {p99:.4}");
        println!("{expected}");
        if !help.contains(&expected) {
            unsaid.push(expected);
        }
        assert!(missing < 0.01, "{way}: {missing}");
    }
    assert!(unsaid.is_empty(), "the help does not say {unsaid:?}");
    for (from, to) in [(Grid::TITOPO_HALF, Grid::TITOPO), (Grid::MERL, Grid::MERL_FULL)] {
        let loss = ConversionLoss::of(&ggx(from), to).expect("valid cells");
        assert_eq!(loss, ConversionLoss { median: 0.0, p99: 0.0, missing: 0.0 });
    }
}

#[test]
fn the_program_converts_every_format_into_every_other() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let at = |name: &str| folder.path().join(name);
    merl::write(&at("a.binary"), &ggx(Grid::MERL)).expect("writable");
    let convert = |from: &str, to: &str, extra: &[&str]| {
        vernis_data(&[&["convert", text(&at(from)), text(&at(to))], extra].concat())
    };
    for (from, to, extra, size, says) in [
        ("a.binary", "b.titopo", &[][..], 34_992_000, "90 x 90 x 360 in standard coordinates"),
        ("a.binary", "c.titopoh", &[], 4_374_000, "45 x 45 x 180 in standard coordinates"),
        ("b.titopo", "d.binary", &[], 34_992_012, "90 x 90 x 180 in half/difference coordinates"),
        ("b.titopo", "e.binary", &["--phi", "360"], 69_984_012, "90 x 90 x 360 in half/difference coordinates"),
        ("c.titopoh", "f.titopo", &[], 34_992_000, "median 0.00000, 99th percentile 0.00000; 0.00 %"),
        ("a.binary", "g.binary", &[], 34_992_012, "nothing is lost"),
    ] {
        let output = convert(from, to, extra);
        assert_eq!(output.status.code(), Some(0), "{from} {to}: {}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(fs::metadata(at(to)).expect("written").len(), size, "{to}");
        let lines = out(&output);
        assert!(lines.contains(says), "{lines}");
        if to != "g.binary" {
            assert!(lines.contains("after the way back: median 0.00"), "{lines}");
        }
    }
    // The same file, byte by byte, and the values that the library finds.
    assert_eq!(fs::read(at("a.binary")).expect("there"), fs::read(at("g.binary")).expect("there"));
    let written = titopo::read(&at("b.titopo")).expect("a table");
    let made = ggx(Grid::MERL).interpolated(Grid::TITOPO).expect("valid cells");
    assert_eq!(written.valid(), made.valid());
    assert!((0..made.valid().len()).all(|k| !made.valid()[k] || made.values()[k] == written.values()[k]));

    let refused = convert("a.binary", "b.titopo", &[]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(error(&refused).contains("b.titopo exists already; use --replace"));
    assert_eq!(convert("a.binary", "b.titopo", &["--replace"]).status.code(), Some(0));
    for (from, to, expected) in [
        ("a.binary", "x.png", "x.png has the extension `png`; it must be binary, titopo or titopoh"),
        ("nowhere.binary", "x.titopo", "nowhere.binary: no such file"),
    ] {
        let output = convert(from, to, &[]);
        assert_eq!(output.status.code(), Some(2));
        assert!(error(&output).contains(expected), "{}", error(&output));
        assert!(!Path::new(&at(to)).exists());
    }
    // The folder of the output is made, as `fit` makes it.
    let made = vernis_data(&["convert", text(&at("c.titopoh")), text(&at("new/folder/c.titopoh"))]);
    assert_eq!(made.status.code(), Some(0), "{}", String::from_utf8_lossy(&made.stderr));
    assert!(out(&made).contains("albedo for light at 30 deg: 0.2"), "{}", out(&made));
    assert_eq!(fs::read(at("new/folder/c.titopoh")).expect("written"), fs::read(at("c.titopoh")).expect("there"));
    // A model is evaluated at every sample.
    fs::write(at("m.json"), r#"{"model":"ggx","kd":[0.2,0.1,0.05],"f0":[0.04,0.04,0.04],"alpha":0.2}"#)
        .expect("writable");
    assert!(out(&convert("m.json", "m.binary", &[])).contains("a BRDF that is no table"));
    assert_eq!(fs::read(at("m.binary")).expect("there"), fs::read(at("a.binary")).expect("there"));
}
