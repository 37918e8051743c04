//! Extraction: interruption, shards and their merging, the Parquet file, and training from it.

use crate::files_of;
use ndarray::Array2;
use proptest::prelude::*;
use rand::Rng;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use vernis::brdf::formats::{merl, titopo};
use vernis::brdf::models::Lambert;
use vernis::brdf::{BrdfSource, ContentHash, Grid, TabulatedBrdf};
use vernis::dataset::{Basis, Completeness, Identical, RatedPair, Study, StudyFile, synthetic};
use vernis::descriptor::{Column, Role};
use vernis::descriptor::{DescriptorSet, VERSION};
use vernis::experiment::train::metrics;
use vernis::math::rating_scale::RatingScale;
use vernis::math::seed;
use vernis::metric::lp::LpDistances;
use vernis::metric::registry::Registry;
use vernis::samples::Samples;
use vernis::samples::extracted::{ExtractedStudy, Versions};
use vernis::samples::shard::Shard;
use zip::write::{SimpleFileOptions, ZipWriter};

fn vernis(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vernis"));
    command.args(args).current_dir(folder).env_remove("VERNIS_DATA").stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn run(folder: &Path, args: &[&str]) -> Output {
    vernis(folder, args).output().unwrap()
}

/// Runs to the end and returns what was said on standard output.
fn done(folder: &Path, args: &[&str]) -> String {
    let output = run(folder, args);
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn refused(folder: &Path, args: &[&str], parts: &[&str]) {
    let output = run(folder, args);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
    assert!(parts.iter().all(|part| said.contains(part)), "{args:?}: {said}");
    assert!(output.stdout.is_empty());
}

#[test]
fn an_extraction_that_is_killed_goes_on() {
    let place = tempfile::tempdir().unwrap();
    let extract = |more: &[&'static str]| [&["extract", "--study", "synthetic", "--shard", "2/8"], more].concat();
    let kept = |ending: &str| files_of(&place.path().join("cache"), ending);
    let killed = extract(&["--cache", "cache", "--out", "killed"]);
    let mut child = vernis(place.path(), &killed).stderr(Stdio::null()).spawn().unwrap();
    let started = Instant::now();
    while kept(".values").len() < 30 {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it could be killed");
        assert!(started.elapsed() < Duration::from_secs(300), "nothing in the cache");
        sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(fs::read_dir(place.path().join("killed")).unwrap().count(), 0);
    // As if it had been killed long ago in the middle of a file.
    let abandoned = place.path().join("cache/.1-1.tmp");
    let file = fs::File::create(&abandoned).unwrap();
    file.set_modified(std::time::SystemTime::now() - Duration::from_secs(7200)).unwrap();
    let before = [kept(".features"), kept(".values")];
    let said = done(place.path(), &killed);
    let study = Study::load(synthetic::NAME, None).unwrap();
    let places = "2/8".parse::<Shard>().unwrap().places(&study);
    assert!(said.starts_with(&format!("{} of {} pairs: ", places.len(), study.pairs.len())), "{said}");
    assert!(!abandoned.exists());
    // What was there was not made again.
    for (before, after) in before.iter().zip([kept(".features"), kept(".values")]) {
        assert!(before.len() < after.len() && before.iter().all(|(name, time)| after.get(name) == Some(time)));
    }
    // From nothing, on one thread: the same bytes.
    done(place.path(), &extract(&["--cache", "other", "--threads", "1", "--out", "undisturbed"]));
    let file = "synthetic-2-of-8.parquet";
    let [killed, undisturbed] = ["killed", "undisturbed"].map(|folder| place.path().join(folder).join(file));
    assert!(fs::read(&killed).unwrap() == fs::read(undisturbed).unwrap());
    // The numbers are those of the distances themselves.
    let read = ExtractedStudy::load(&killed).unwrap();
    assert_eq!((&read.places, read.whole), (&places, study.pairs.len()));
    let column = read.samples.columns().iter().position(|c| c.name == "D9.Cl").unwrap();
    for row in [0, places.len() / 2, places.len() - 1] {
        let pair = &study.pairs[places[row]];
        let [reference, candidate] = [&pair.reference, &pair.candidate].map(|source| source.open(None).unwrap());
        let distances = LpDistances::of_study_between(reference.brdf.as_ref(), candidate.brdf.as_ref()).unwrap();
        assert_eq!(read.samples.features()[(row, column)], distances.by_name("D9.Cl").unwrap());
        assert_eq!(read.contents[row], [reference.content, candidate.content]);
        assert_eq!(read.study.pairs[row].row(), pair.row());
    }
}

#[test]
fn shards_are_merged_into_the_bytes_of_the_whole() {
    let place = tempfile::tempdir().unwrap();
    for (name, alpha) in [("a", 0.2), ("b", 0.3), ("c", 0.25)] {
        let model = format!(r#"{{"model": "ggx", "kd": [0.2, 0.1, 0.1], "f0": [0.04, 0.04, 0.04], "alpha": {alpha}}}"#);
        fs::write(place.path().join(format!("{name}.json")), model).unwrap();
    }
    // The pairs of a reference need not be neighbours.
    let rows = "reference,candidate,mos\na.json,c.json,4\nb.json,c.json,3\na.json,b.json,2\n";
    fs::write(place.path().join("mine.csv"), rows).unwrap();
    let extract = |more: &[&'static str]| {
        done(place.path(), &[&["extract", "--study", "mine.csv", "--cache", "cache"], more].concat())
    };
    extract(&["--shard", "1/2", "--out", "shards"]);
    extract(&["--shard", "2/2", "--out", "shards"]);
    extract(&["--out", "whole"]);
    let [first, second] = ["shards/mine-1-of-2.parquet", "shards/mine-2-of-2.parquet"];
    let said = done(place.path(), &["merge", second, first, "--out", "all.parquet"]);
    assert!(said.starts_with("3 pairs of 2 files: "), "{said}");
    let read = |path: &str| fs::read(place.path().join(path)).unwrap();
    assert!(read("all.parquet") == read("whole/mine.parquet"));
    let merged = ExtractedStudy::load(&place.path().join("all.parquet")).unwrap();
    assert_eq!(merged.study.pairs.iter().map(|p| p.mos).collect::<Vec<_>>(), [4.0, 3.0, 2.0]);
    refused(
        place.path(),
        &["benchmark", "--extracted", first],
        &["mine-1-of-2.parquet is shard 1/2, but the whole study is needed: join all 2 with `vernis merge`"],
    );
    refused(place.path(), &["merge", first, "--out", "none.parquet"], &["was given no shard 2 of 2"]);
    assert!(!place.path().join("none.parquet").exists());
}

/// A study whose columns are those of the program, and whose numbers are made up to agree with its scores.
pub(crate) fn made_up() -> ExtractedStudy {
    let mut columns = DescriptorSet::all().columns();
    let metrics = metrics(&small().study).unwrap();
    columns.extend(metrics.iter().map(|metric| Column {
        name: metric.name().to_owned(),
        family: metric.properties().family.to_owned(),
        role: Role::Difference,
    }));
    let pair = |k: usize| RatedPair {
        reference: BrdfSource::Notation(format!("{}.binary", k / 5)),
        candidate: BrdfSource::Notation(format!("{k}.binary")),
        material: format!("m{}", k / 5),
        group: format!("m{}", k / 5),
        method: format!("method {}", k % 5),
        method_family: format!("method {}", k % 5),
        material_type: Some(if k < 30 { "Dielectric" } else { "Metal" }.into()),
        mos: 1.2 + 3.6 * ((k * 37) % 60) as f64 / 60.0,
        weight: 1.0,
    };
    let pairs: Vec<RatedPair> = (0..60).map(pair).collect();
    let mut random = seed::stream(5, "made-up study", 0);
    let values = Array2::from_shape_fn((60, columns.len()), |(row, column)| {
        let quality = if columns[column].role == Role::Difference { 4.5 - pairs[row].mos } else { 1.0 };
        quality * (0.5 + random.random::<f64>())
    });
    let samples = Samples::new(columns, pairs.iter().map(RatedPair::row).collect(), values.clone()).unwrap();
    ExtractedStudy {
        samples: samples.with_swapped(values).unwrap(),
        contents: (0..60).map(|k| [ContentHash::of(&[k / 5]), ContentHash::of(&[k, k])]).collect(),
        places: (0..60).collect(),
        whole: 60,
        versions: Versions::new(&format!("v{VERSION}-lamps-sphere"), &metrics),
        study: Study {
            name: "made-up".into(),
            completeness: Completeness { found: 60, known: 60 },
            pairs,
            ..small().study
        },
        ..small()
    }
}

#[test]
fn metrics_are_judged_without_brdfs() {
    let place = tempfile::tempdir().unwrap();
    let study = made_up();
    write(place.path(), "all.parquet", &study);
    // Metrics of others: one that knows the ratings up to a sign, and one whose distances fall where they should rise.
    let row = |(k, pair): (usize, &RatedPair)| {
        let noise = (k * 7 % 11) as f64 / 20.0;
        format!(
            "{};{};{}\n",
            pair.material,
            pair.method,
            format!("{:.3};{}", pair.mos + noise, k * 13 % 17).replace('.', ",")
        )
    };
    let rows: String = study.study.pairs.iter().enumerate().map(row).collect();
    fs::write(place.path().join("others.csv"), format!("Material;method;close;far\n{rows}")).unwrap();
    let options = ["--extracted", "all.parquet", "--folds", "2", "--resamples", "40", "--out", "judged"];
    let scores = ["--scores", "others.csv", "--higher-is-better", "close"];
    let said = done(place.path(), &[&["benchmark"], &options[..], &scores[..]].concat());
    assert!(said.contains("SYNTHETIC") && place.path().join("judged/report.html").is_file(), "{said}");
    let record = fs::read_to_string(place.path().join("judged/benchmark.json")).unwrap();
    let record: serde_json::Value = serde_json::from_str(&record).unwrap();
    assert_eq!(record["rows"], 60);
    assert_eq!(
        record["command"],
        "vernis benchmark --extracted made-up.parquet --seed 1 --folds 2 --resamples 40 --scores others.csv \
         --higher-is-better close"
    );
    let metric = |name: &str| record["metrics"].as_array().unwrap().iter().find(|m| m["name"] == name).unwrap();
    let srocc = |name: &str| metric(name)["judgements"][0]["agreement"]["srocc"].as_f64().unwrap();
    assert_eq!(
        (&metric("close")["kind"], &metric("close")["judgements"][0]["split"]),
        (&"external".into(), &"unseen-material".into())
    );
    assert!(srocc("close") > 0.97 && srocc("far").abs() < 0.5, "{} {}", srocc("close"), srocc("far"));
    assert!(metric("far")["version"].as_str().unwrap().starts_with("sha256 "));
    // Every row keeps the distances of whatever was judged by them.
    let judged = record["metrics"].as_array().unwrap().iter();
    let judged = judged.filter(|m| ["lp", "graph", "external"].contains(&m["kind"].as_str().unwrap()));
    let mut judged: Vec<&str> = judged.map(|m| m["name"].as_str().unwrap()).collect();
    judged.sort_unstable();
    for (k, row) in record["predictions"].as_array().unwrap().iter().enumerate() {
        let distances = row["distances"].as_object().unwrap();
        assert_eq!(distances.keys().collect::<Vec<_>>(), judged);
        assert_eq!(distances["far"], (k * 13 % 17) as f64);
        let close = study.study.pairs[k].mos + (k * 7 % 11) as f64 / 20.0;
        assert!((distances["close"].as_f64().unwrap() + close).abs() < 1e-3, "negated, for larger is better");
    }
    for name in ["close", "far"] {
        let compared = |d: &&serde_json::Value| d["a"] == "vernis" && d["b"] == name && d["split"] == "unseen-material";
        assert_eq!(record["differences"].as_array().unwrap().iter().filter(compared).count(), 2, "PLCC and SROCC");
        assert!(said.lines().any(|line| line.starts_with(name)), "{said}");
    }
    assert!(record["data_hashes"]["--scores others.csv"].is_string());
    // Results of a named folder stay.
    refused(
        place.path(),
        &[&["benchmark"], &options[..]].concat(),
        &["judged/report.html exists already; use --replace"],
    );
    let ablation: Vec<&str> =
        record["ablation"].as_array().unwrap().iter().map(|a| a["name"].as_str().unwrap()).collect();
    assert!(ablation.contains(&"with transport") && !ablation.contains(&"with pca"), "{ablation:?}");
    let report = fs::read_to_string(place.path().join("judged/report.html")).unwrap();
    assert!(report.contains("left out, for they are learned from BRDFs"));
}

/// Two materials with two candidates each, three columns.
fn small() -> ExtractedStudy {
    let pair = |k: usize| RatedPair {
        reference: BrdfSource::Notation(format!("{}.binary", k / 2)),
        candidate: BrdfSource::Notation(format!("{k}.json?kd=0.1,0.2,0.3")),
        material: format!("material, \"{}\"", k / 2),
        group: format!("group {}", k / 2),
        method: "GGX".into(),
        method_family: "microfacets".into(),
        material_type: (k < 2).then(|| "Métal".into()),
        mos: 1.0 + k as f64,
        weight: 0.5,
    };
    let pairs: Vec<RatedPair> = (0..4).map(pair).collect();
    let column =
        |name: &str, role| Column { name: name.into(), family: name.split('.').next().unwrap_or("").into(), role };
    let columns = vec![
        column("lights.dE4", Role::Difference),
        column("context.albedo", Role::Context),
        column("D9.Cl", Role::Difference),
    ];
    let values = Array2::from_shape_fn((4, 3), |(row, column)| (row as f64 + 0.1).powi(column as i32 - 1));
    let samples = Samples::new(columns, pairs.iter().map(RatedPair::row).collect(), values.clone()).unwrap();
    ExtractedStudy {
        samples: samples.with_swapped(-values).unwrap(),
        contents: (0..4).map(|k| [ContentHash::of(&[k / 2]), ContentHash::of(&[k, k])]).collect(),
        shard: Shard::WHOLE,
        places: (0..4).collect(),
        whole: 4,
        versions: Versions::new("v1-lamps-sphere", &[Registry::standard().unwrap().get("D9.Cl").unwrap()]),
        study: Study {
            name: "small".into(),
            synthetic: true,
            completeness: Completeness { found: 4, known: 9 },
            scale: RatingScale::new(0.0, 100.0).unwrap(),
            identical: Identical { score: 4.25, basis: Basis::HiddenReferences { pairs: 3 } },
            files: vec![StudyFile {
                name: "ratings.csv".into(),
                content: ContentHash::of(b"r"),
                as_published: Some(true),
            }],
            pairs,
        },
    }
}

/// A shard of [`small`].
fn part(shard: &str) -> ExtractedStudy {
    let whole = small();
    let shard: Shard = shard.parse().unwrap();
    let places = shard.places(&whole.study);
    ExtractedStudy {
        samples: whole.samples.select_rows(&places),
        contents: places.iter().map(|&place| whole.contents[place]).collect(),
        study: Study { pairs: places.iter().map(|&place| whole.study.pairs[place].clone()).collect(), ..whole.study },
        shard,
        places,
        ..whole
    }
}

pub(crate) fn write(folder: &Path, name: &str, extracted: &ExtractedStudy) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, extracted.to_parquet().unwrap()).unwrap();
    path
}

#[test]
fn a_file_holds_all_of_a_study() {
    let place = tempfile::tempdir().unwrap();
    let (whole, read) = (small(), ExtractedStudy::load(&write(place.path(), "whole.parquet", &small())).unwrap());
    assert_eq!(read.samples.features(), whole.samples.features());
    assert_eq!(read.samples.swapped(), whole.samples.swapped());
    assert_eq!(read.samples.columns(), whole.samples.columns());
    assert_eq!((read.samples.rows(), &read.contents), (whole.samples.rows(), &whole.contents));
    assert_eq!((read.study.scale, &read.study.identical), (whole.study.scale, &whole.study.identical));
    assert_eq!(read.samples.identical(), &whole.study.identical);
    assert_eq!((&read.places, read.whole, read.shard), (&whole.places, 4, Shard::WHOLE));
    assert_eq!((&read.versions, read.study.completeness), (&whole.versions, whole.study.completeness));
    assert_eq!((&read.study.files, read.study.synthetic), (&whole.study.files, true));
    let notations = |study: &Study| study.pairs.iter().map(|p| p.candidate.notation().to_owned()).collect::<Vec<_>>();
    assert_eq!(notations(&read.study), notations(&whole.study));
    // Shards may be empty: here the third of three.
    let parts = ["3/3", "1/3", "2/3"].map(|k| {
        let path = write(place.path(), "part.parquet", &part(k));
        (k.to_owned(), ExtractedStudy::load(&path).unwrap())
    });
    assert!(parts[0].1.places.is_empty());
    let merged = ExtractedStudy::merge(parts.into()).unwrap();
    assert!(merged.to_parquet().unwrap() == whole.to_parquet().unwrap());
}

#[test]
fn what_is_no_set_of_shards_is_not_merged() {
    let merge = |parts: &[ExtractedStudy]| {
        let named = parts.iter().enumerate().map(|(k, part)| (format!("{k}.parquet"), part.clone())).collect();
        ExtractedStudy::merge(named).unwrap_err().to_string()
    };
    let [first, second] = [part("1/2"), part("2/2")];
    assert_eq!(merge(&[]), "merge was given no file, but it needs the files of all shards of a study");
    assert_eq!(
        merge(std::slice::from_ref(&second)),
        "merge was given no shard 1 of 2, but it needs the files of all shards"
    );
    assert!(merge(&[first.clone(), first.clone()]).starts_with("1.parquet is shard 1/2, as is 0.parquet"));
    assert!(merge(&[first.clone(), part("2/3")]).contains("1.parquet has another number of shards"));
    let mut other = second.clone();
    other.versions.metrics.insert("D9.Cl".into(), "3".into());
    assert!(merge(&[first.clone(), other]).contains("1.parquet has another version of the numbers"));
    let mut other = second.clone();
    other.study.files[0].content = ContentHash::of(b"other");
    assert!(merge(&[first.clone(), other]).contains("has another set of ratings than 0.parquet"));
    let mut other = second.clone();
    other.samples = other.samples.select_columns(|c| c.name != "D9.Cl");
    assert!(merge(&[first.clone(), other]).contains("has another set of columns than 0.parquet"));
    let mut other = second;
    other.places = first.places.clone();
    assert!(merge(&[first, other]).contains("4 rows, some missing or repeated"));
}

#[test]
fn files_that_are_none_are_named() {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("text.parquet"), "not a table at all").unwrap();
    refused(
        place.path(),
        &["merge", "text.parquet", "--out", "all.parquet"],
        &["text.parquet has no valid seal", "Parquet file as `vernis extract`"],
    );
    refused(place.path(), &["merge", "none.parquet", "--out", "all.parquet"], &["none.parquet"]);
    refused(place.path(), &["merge", "text.parquet", "--out", "."], &["--out . is a folder"]);
    refused(
        place.path(),
        &["extract", "--study", "synthetic", "--shard", "4/3"],
        &["shard is `4/3`; it must be NUMBER/COUNT"],
    );
    write(place.path(), "old.parquet", &small());
    refused(
        place.path(),
        &["benchmark", "--extracted", "old.parquet"],
        &["old.parquet has no column ", "extract again"],
    );
    refused(
        place.path(),
        &["train", "--extracted", "old.parquet", "--lights", "old.parquet"],
        &["cannot be used with"],
    );
    refused(
        place.path(),
        &["train", "--extracted", "old.parquet", "--resamples", "39"],
        &["'39' for '--resamples", "it must be an integer from 40 to 20000"],
    );
    let mut wrong = small();
    wrong.whole = 5;
    let error = ExtractedStudy::load(&write(place.path(), "wrong.parquet", &wrong)).unwrap_err().to_string();
    assert!(error.contains("wrong.parquet has 4 rows at 4 places of 5"), "{error}");
    wrong = small();
    wrong.places = vec![0, 1, 2, 2];
    let error = ExtractedStudy::load(&write(place.path(), "wrong.parquet", &wrong)).unwrap_err().to_string();
    assert!(error.contains("4 rows at 3 places of 4"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// A damaged file is an error, never a panic.
    #[test]
    fn a_damaged_file_never_panics(cut in any::<prop::sample::Index>(), hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4)) {
        let place = tempfile::tempdir().unwrap();
        let mut bytes = small().to_parquet().unwrap();
        let whole = bytes.clone();
        match hits.is_empty() {
            true => bytes.truncate(cut.index(whole.len())),
            false => hits.iter().for_each(|(at, value)| bytes[at.index(whole.len())] = *value),
        }
        let path = place.path().join("damaged.parquet");
        fs::write(&path, &bytes).unwrap();
        match ExtractedStudy::load(&path) {
            Err(error) => prop_assert!(error.to_string().contains("damaged.parquet has no valid seal"), "{error}"),
            Ok(_) => prop_assert!(bytes == whole),
        }
    }
}

#[test]
fn a_table_is_known_before_it_is_decoded() {
    let place = tempfile::tempdir().unwrap();
    let lambert = Lambert::new([0.5; 3]).unwrap();
    let path = place.path().join("a.titopoh");
    titopo::write(&path, &TabulatedBrdf::tabulate(&lambert, Grid::TITOPO_HALF).unwrap()).unwrap();
    let source = BrdfSource::parse(&path.to_string_lossy()).unwrap();
    let (identified, open) = (source.identify(None).unwrap(), source.open(None).unwrap());
    assert_eq!((&identified.notation, identified.content), (&open.notation, open.content));
    let table = identified.brdf().unwrap().as_table().unwrap();
    assert_eq!(table.values(), open.brdf.as_table().unwrap().values());
    // The same in an archive, which is read in place.
    let archive = place.path().join("tables.zip");
    let mut zip = ZipWriter::new(fs::File::create(&archive).unwrap());
    zip.start_file("in/folders/a.titopoh", SimpleFileOptions::default()).unwrap();
    zip.write_all(&fs::read(&path).unwrap()).unwrap();
    zip.start_file("in/folders/a.txt", SimpleFileOptions::default()).unwrap();
    zip.finish().unwrap();
    let packed = BrdfSource::parse(&format!("{}:a", archive.display())).unwrap();
    let (identified, opened) = (packed.identify(None).unwrap(), packed.open(None).unwrap());
    assert_eq!((identified.content, opened.content), (open.content, open.content));
    assert_eq!(identified.brdf().unwrap().as_table().unwrap().values(), table.values());
    assert_eq!(opened.brdf.as_table().unwrap().valid(), table.valid());
    // Damage inside a table is found when it is decoded, a wrong size at once.
    let path = place.path().join("b.binary");
    merl::write(&path, &TabulatedBrdf::tabulate(&lambert, Grid::MERL).unwrap()).unwrap();
    let mut bytes = fs::read(&path).unwrap();
    bytes[12 + 800..][..8].copy_from_slice(&f64::NAN.to_le_bytes());
    fs::write(&path, &bytes).unwrap();
    let source = BrdfSource::parse(&path.to_string_lossy()).unwrap();
    let identified = source.identify(None).unwrap();
    assert_eq!(identified.content, ContentHash::of(&bytes));
    let error = identified.brdf().err().unwrap().to_string();
    assert!(error.contains("b.binary") && error.contains("phi_d 100") && error.contains("NaN"), "{error}");
    fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
    assert!(source.identify(None).is_err());
}
