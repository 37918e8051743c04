//! Files of earlier versions keep loading, with their values: see `tests/files/README.md`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use vernis::brdf::BrdfSource;
use vernis::brdf::models::build;
use vernis::descriptor::{DescriptorOptions, Lights, ShapeChoice};
use vernis::evaluation::records::{BenchmarkRecord, RowSet};
use vernis::fit::optimizer::Method;
use vernis::fit::{FitFile, Fitting, KeptFit};
use vernis::metric::Metric;
use vernis::metric::learned::LearnedMetric;
use vernis::metric::registry::Registry;

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files/0.1.0").join(name)
}

/// The light probe of `probe.vernis.json`: 192x96 pixels, each four bytes, without compression.
fn sky(folder: &Path) -> PathBuf {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 96 +X 192\n".to_vec();
    for y in 0u32..96 {
        for x in 0u32..192 {
            let sun = (20..24).contains(&y) && (40..46).contains(&x);
            let pixel = if sun { [250, 240, 220, 133] } else { [128 + y, 140 + (x * 7 + y) % 32, 230 - y, 127] };
            bytes.extend(pixel.map(|byte| u8::try_from(byte).unwrap()));
        }
    }
    let path = folder.join("sky.hdr");
    fs::write(&path, bytes).unwrap();
    path
}

/// What `vernis compare --metric tiny.vernis.json --json` of vernis 0.1.0 printed for two pairs.
#[test]
fn an_exported_metric_keeps_its_scores() {
    let metric = LearnedMetric::load(&file("tiny.vernis.json")).unwrap();
    let ggx = |kd: [f64; 3], alpha| build("ggx", &[&kd[..], &[0.04; 3], &[alpha]].concat()).unwrap();
    let ward = |kd: [f64; 3], alpha| build("ward", &[&kd[..], &[0.05; 3], &[alpha]].concat()).unwrap();
    let (first, sixth) = ([0.05, 0.30, 0.1], [0.25, 0.15, 0.24]);
    for (reference, candidate, expected) in [
        (
            ggx(first, 0.05),
            ggx(first, 0.075),
            [0.7933990414753946, 3.7066009585246054, 3.263404757878118, 4.149797159171093],
        ),
        (
            ggx(sixth, 0.33),
            ward(sixth, 0.33),
            [1.2110847811825183, 3.2889152188174817, 2.931304872681815, 3.6465255649531483],
        ),
    ] {
        let score = metric.compare(&*reference, &*candidate).unwrap();
        for (found, expected) in [score.distance, score.mos, score.low, score.high].into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
    }
}

/// No command of vernis 0.1.0 could load what its own `train --lights --shape` wrote.
#[test]
fn a_metric_of_a_probe_and_a_mesh_loads_where_both_are_named() {
    let place = tempfile::tempdir().unwrap();
    let (metric, lights, shape) = (file("probe.vernis.json"), sky(place.path()), file("octahedron.ply"));
    let options = DescriptorOptions { lights: Lights::Probe(lights.clone()), shape: ShapeChoice::Mesh(shape.clone()) };
    let loaded = LearnedMetric::load_with(&metric, &options).unwrap();
    let ggx = build("ggx", &[0.2, 0.1, 0.1, 0.04, 0.04, 0.04, 0.1]).unwrap();
    assert_eq!(loaded.distance(&*ggx, &*ggx).unwrap(), 0.0);
    let refused = |options: &DescriptorOptions| LearnedMetric::load_with(&metric, options).unwrap_err().to_string();
    let message = refused(&DescriptorOptions::default());
    assert!(
        message.contains("light probe whose SHA-256 begins with 035d24e3e978589f; name it with --lights"),
        "{message}"
    );
    let message = refused(&DescriptorOptions { lights: Lights::Probe(lights.clone()), ..Default::default() });
    assert!(message.contains("mesh whose SHA-256 begins with 61d113fe98d8e7e4; name it with --shape"), "{message}");
    fs::copy(&lights, place.path().join("other.hdr")).unwrap();
    let mut bytes = fs::read(&lights).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(place.path().join("other.hdr"), bytes).unwrap();
    let other = Lights::Probe(place.path().join("other.hdr"));
    let message = refused(&DescriptorOptions { lights: other, shape: options.shape.clone() });
    assert!(message.contains("other.hdr: the light probe is ") && message.contains("it must be 035d24e3"), "{message}");

    let model = |name: &str, alpha: f64| {
        let text = format!(r#"{{"model": "ggx", "kd": [0.2, 0.1, 0.1], "f0": [0.04, 0.04, 0.04], "alpha": {alpha}}}"#);
        fs::write(place.path().join(name), text).unwrap();
    };
    model("a.json", 0.1);
    model("b.json", 0.2);
    let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
    command.args(["compare", "a.json", "b.json", "--json", "--cache", "cache", "--metric"]).arg(&metric);
    command.arg("--lights").arg(&lights).arg("--shape").arg(&shape);
    let output = command.current_dir(place.path()).env_remove("VERNIS_DATA").output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let rough = build("ggx", &[0.2, 0.1, 0.1, 0.04, 0.04, 0.04, 0.2]).unwrap();
    assert_eq!(found["distances"]["probe"].as_f64(), Some(loaded.distance(&*ggx, &*rough).unwrap()));
}

#[test]
fn a_fit_is_a_brdf_and_is_kept() {
    let registry = Registry::standard().unwrap();
    let reference = BrdfSource::parse(&file("r1.json").to_string_lossy()).unwrap().open(None).unwrap();
    for (name, metric, version, value) in
        [("fit-d9.json", "D9.Cl", "2", 0.25992991880155725), ("fit-vernis.json", "vernis", "1", f64::NAN)]
    {
        let KeptFit::Whole(kept) = FitFile::read(&file(name)) else { panic!("{name} is no fit") };
        assert_eq!((kept.metric.name.as_str(), kept.metric.version.as_str()), (metric, version));
        let metric = registry.get(metric).unwrap();
        // Only the search is another one now: it would be made again, and nothing else differs.
        let fitting = Fitting { method: Method::HookeJeeves, ..Fitting::new("ward", &*metric) };
        let differences = kept.differences(&fitting, &reference.content.to_string());
        assert!(differences.iter().all(vernis::fit::Difference::is_version), "{differences:?}");
        assert!(
            differences.iter().any(|d| d.to_string() == "the version of fits is 1 there and 5 here"),
            "{differences:?}"
        );
        let fitted = BrdfSource::parse(&file(name).to_string_lossy()).unwrap().open(None).unwrap();
        let distance = metric.distance(&*reference.brdf, &*fitted.brdf).unwrap();
        // Version 1.1 of `vernis` has other distances than the version that the file names.
        let same = (distance / kept.value - 1.0).abs() < 1e-9;
        assert_eq!(same, metric.version() == version, "{name}: {distance} {}", kept.value);
        assert!(value.is_nan() || kept.value == value);
    }
}

#[test]
fn a_benchmark_is_read() {
    let record: BenchmarkRecord = serde_json::from_slice(&fs::read(file("benchmark.json")).unwrap()).unwrap();
    assert_eq!((record.rows, record.materials, record.study.as_str()), (32, 8, "tiny"));
    assert!(record.headline_metrics().len() > 5);
    // What came later is missing, and what was not named then is known.
    let judgement = &record.metrics[0].judgements[0];
    assert!(record.row_sets.is_empty() && judgement.row_set == RowSet::All);
    let known = [RowSet::All, RowSet::WithoutSetAside];
    assert!(record.metrics.iter().flat_map(|m| &m.judgements).all(|j| known.contains(&j.row_set)));
    assert_eq!((judgement.fold_means, judgement.agreement.plcc_raw), (None, Some(0.95947440616854)));
    let retrained = record.retrained_metric().expect("the model of the ablation is among the metrics");
    #[cfg(feature = "train")]
    assert_eq!(retrained.name, vernis::train::Trainer::name(&vernis::train::recipe::plain_kernel()));
    assert!(retrained.note.contains("ablation"), "{}", retrained.note);
}

/// A combination of a sweep had no seal and no version of its metric: it is named and computed again.
#[test]
fn a_combination_of_a_sweep_is_computed_again() {
    use vernis::experiment::sweep::{Combination, CombinationRecord, Setting};
    let study = vernis::dataset::Study::load("synthetic", None).unwrap();
    let combination = Combination::of_study()[0];
    let bytes = fs::read(file("combination.json")).unwrap();
    let found = CombinationRecord::outcome_of(&bytes, &combination, &Setting::new("5x5x16", "coarse", &study), 32);
    assert!(found.unwrap_err().to_string().starts_with("it cannot be read"));
}

#[cfg(feature = "train")]
#[test]
fn an_extracted_study_is_read_with_the_versions_of_its_numbers() {
    use vernis::samples::extracted::ExtractedStudy;
    let extracted = ExtractedStudy::load(&file("tiny.parquet")).unwrap();
    assert_eq!((extracted.study.pairs.len(), extracted.versions.setup.as_str()), (32, "v1-lamps-sphere"));
    let version = |name: &str| extracted.versions.metrics.get(name).map(String::as_str);
    assert_eq!((version("D9.Cl"), version("ot"), version("energy")), (Some("2"), Some("4"), Some("1")));
    let metrics = vernis::experiment::train::metrics(&extracted.study).unwrap();
    // The energy distance has got a second version since: its numbers would be others.
    let (energy, others): (Vec<_>, Vec<_>) =
        metrics.into_iter().partition(|metric| metric.properties().family == vernis_metric::metric::kernel::FAMILY);
    extracted.check_versions(&others, "tiny.parquet").unwrap();
    let refused = extracted.check_versions(&energy, "tiny.parquet").unwrap_err().to_string();
    assert!(refused.contains("energy of version 1") && refused.contains("extract again"), "{refused}");
    // Written anew it says its versions by name, and who can read it.
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("again.parquet");
    fs::write(&path, extracted.to_parquet().unwrap()).unwrap();
    let again = ExtractedStudy::load(&path).unwrap();
    assert_eq!(again.versions, extracted.versions);
    assert_eq!(again.samples.features(), extracted.samples.features());
}
