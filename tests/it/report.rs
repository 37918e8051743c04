//! Records become files: complete, self-contained, the same bytes every time.

use ndarray::Array2;
use rand::Rng;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::LazyLock;
use vernis::dataset::{NamedRows, Row};
use vernis::descriptor::{Column, Role};
use vernis::evaluation::agreement::Figure;
use vernis::evaluation::benchmark::{Judged, JudgedMetric, Jury, prediction_records, residuals_by_material};
use vernis::evaluation::bootstrap::Interval;
use vernis::evaluation::calibration::Calibration;
use vernis::evaluation::cross_validation::{cross_validate_distance, in_sample};
use vernis::evaluation::records::{
    BenchmarkRecord, CurvePoint, CurveRecord, ImportanceRecord, LearningPoint, MetricKind, RowSet, Split,
};
use vernis::evaluation::triplets::TripletAgreement;
use vernis::math::seed;
use vernis::report::page::materials::{Candidate, Material};
use vernis::report::{OutputFolder, ReportError, write_benchmark};
use vernis::samples::Samples;
use vernis::samples::split::{grouped_folds, method_and_group_folds};

const METHODS: [&str; 6] = ["ABC", "BAGHER", "BLINN-PHONG", "LAFORTUNE", "SGD", "WARD"];

fn triplets(metric: &str, majority: f64) -> TripletAgreement {
    let interval = Some(Interval { low: majority - 0.02, high: majority + 0.02 });
    TripletAgreement { metric: metric.to_owned(), triplets: 1234, groups: 79, majority, interval }
}

/// Made-up ratings of 60 materials and distances that follow them, from well to badly.
fn samples(columns: &[(String, f64)]) -> Samples {
    let mut rng = seed::stream(21, "report test", 0);
    let (mut rows, mut values) = (Vec::new(), Vec::new());
    for m in 0..60 {
        for (k, method) in METHODS.iter().enumerate() {
            let distance: f64 = rng.random_range(0.0..1.0) * (1.0 - 0.1 * k as f64);
            let mos = 1.0 + 3.8 / (1.0 + (7.0 * (distance - 0.4)).exp()) + rng.random_range(-0.25..0.25);
            rows.push(Row {
                material: format!("color-changing-paint{m}"),
                group: format!("group-{}", m / 2),
                method: (*method).into(),
                method_family: (*method).into(),
                material_type: None,
                mos: mos.clamp(1.0, 5.0),
                weight: 1.0,
            });
            values.extend(columns.iter().map(|(_, noise)| distance + rng.random_range(-noise..*noise)));
        }
    }
    let column =
        |(name, _): &(String, f64)| Column { name: name.clone(), family: "made-up".into(), role: Role::Difference };
    let features = Array2::from_shape_vec((rows.len(), columns.len()), values).unwrap();
    Samples::new(columns.iter().map(column).collect(), rows, features).unwrap()
}

fn columns() -> Vec<(String, f64)> {
    let mut columns = vec![("vernis".to_owned(), 0.1), ("nested best of 36 Lp".to_owned(), 0.4)];
    columns.push(("mean of the method & <type>".to_owned(), 1.5));
    for (metric, noise) in [("ssim", 0.5), ("cielab", 0.8)] {
        for cameras in ["", ",camera=offset", ",camera=offset-minus-hidden"] {
            columns.push((format!("stimulus[{metric}{cameras}]"), noise));
        }
    }
    for d in 1..=9 {
        for (v, variant) in ["", ".Cl", ".CR", ".Cl.CR"].iter().enumerate() {
            columns.push((format!("D{d}{variant}"), 0.9 - 0.05 * d as f64 - 0.1 * v as f64));
        }
    }
    columns
}

pub(crate) fn record(synthetic: bool) -> BenchmarkRecord {
    static RECORD: LazyLock<BenchmarkRecord> = LazyLock::new(make_record);
    BenchmarkRecord { synthetic, ..RECORD.clone() }
}

/// The made-up record as one of the embedded study.
pub(crate) fn record_of_the_embedded_study() -> BenchmarkRecord {
    let mut record = BenchmarkRecord { study: "synthetic".into(), ..record(true) };
    let study = vernis::dataset::Study::load("synthetic", None).unwrap();
    record.predictions.truncate(study.pairs.len());
    for (row, pair) in record.predictions.iter_mut().zip(study.pairs) {
        (row.material, row.method, row.mos) = (pair.material, pair.method, pair.mos);
    }
    record.data_hashes.clear();
    record
}

fn row_sets() -> Vec<NamedRows> {
    vec![NamedRows { name: "far <candidates>".into(), methods: ["ABC", "SGD", "WARD"].map(str::to_owned).to_vec() }]
}

fn make_record() -> BenchmarkRecord {
    let columns = columns();
    let samples = samples(&columns);
    let (folds, methods) = (grouped_folds(&samples, 5, 1).unwrap(), method_and_group_folds(&samples, 5, 1).unwrap());
    let jury = Jury::new(samples.rows(), |r| r.method == "BAGHER", &row_sets(), 60, 1).unwrap();
    let judge = |name: &str| {
        let material = cross_validate_distance(&samples, &folds, name).unwrap();
        let method = cross_validate_distance(&samples, &methods, name).unwrap();
        let mut judged = jury.judge(name, Split::UnseenMaterial, &material.predictions).unwrap();
        judged.extend(jury.judge(name, Split::UnseenMaterialAndMethod, &method.predictions).unwrap());
        judged.extend(jury.judge(name, Split::InSample, &in_sample(&samples, name).unwrap()).unwrap());
        let kind = match name {
            "vernis" => MetricKind::Learned,
            name if name.starts_with('D') => MetricKind::Lp,
            name if name.starts_with("nested") => MetricKind::NestedBestLp,
            name if name.starts_with("stimulus") => MetricKind::Image,
            _ => MetricKind::Trivial,
        };
        let note = if kind == MetricKind::Lp { String::new() } else { format!("{name}, made up") };
        JudgedMetric { name: name.to_owned(), kind, note, judged, folds: material.folds }
    };
    let metrics: Vec<JudgedMetric> = columns.iter().map(|(name, _)| judge(name)).collect();
    let headline = ["vernis", "nested best of 36 Lp", "D9.Cl", "D1.Cl.CR", "mean of the method & <type>"];
    let others = headline[1..].iter().copied().chain(["stimulus[ssim]"]);
    let pairs: Vec<(&str, &str)> = others.map(|b| ("vernis", b)).collect();
    let subject = cross_validate_distance(&samples, &folds, "vernis").unwrap().predictions;
    let intervals: Vec<Interval> = subject.mos.iter().map(|m| Interval { low: m - 0.3, high: m + 0.3 }).collect();
    let mos: Vec<f64> = samples.rows().iter().map(|r| r.mos).collect();
    let ablation =
        |name: &str, columns, metric: usize| jury.ablation(name, columns, &metrics[0], &metrics[metric].judged);
    let importance = |name: &str, columns, metric: usize| {
        let found = ablation(name, columns, metric);
        let (plcc_change, srocc_change) = (found.plcc_change, found.srocc_change);
        ImportanceRecord { name: name.to_owned(), columns, plcc_change, srocc_change }
    };
    let learning = |groups, metric: usize| LearningPoint {
        groups,
        judgements: metrics[metric].judged.iter().map(Judged::record).collect(),
    };
    let mapped = in_sample(&samples, "D9.Cl").unwrap();
    let point = |(row, (score, mapped)): (&Row, (&f64, &f64))| CurvePoint {
        method: row.method.clone(),
        distance: -score,
        mos: row.mos,
        mapped: *mapped,
    };
    let points: Vec<CurvePoint> = samples.rows().iter().zip(mapped.score.iter().zip(&mapped.mos)).map(point).collect();
    BenchmarkRecord {
        study: "made-up".into(),
        synthetic: false,
        scale: vernis::math::rating_scale::RatingScale::GRADES,
        identical: None,
        rows: samples.len(),
        materials: 60,
        groups: 30,
        folds: 5,
        resamples: 60,
        seed: 1,
        command: "vernis train --study made-up --seed 1".into(),
        versions: BTreeMap::from([("vernis".to_owned(), "0.1.0".to_owned())]),
        data_hashes: BTreeMap::from([("ratings.csv".to_owned(), "00ff".repeat(16))]),
        set_aside: vec!["BAGHER".into()],
        row_sets: row_sets(),
        headline: headline.iter().map(|s| (*s).to_owned()).collect(),
        metrics: metrics.iter().map(JudgedMetric::record).collect(),
        differences: jury.differences(&metrics, &pairs, &[Figure::Plcc, Figure::Srocc]).unwrap(),
        retrained: "D5".into(),
        ablation: vec![ablation("without lights", 24, 1), ablation("only angular", 14, 2)],
        importance: vec![importance("lights", 18, 1), importance("angular", 14, 7), importance("cxexc", 1, 12)],
        learning_curve: vec![learning(6.0, 1), learning(24.0, 0)],
        curves: ["D9.Cl", "stimulus[ssim]", "stimulus[ssim,camera=offset]"]
            .map(|metric| CurveRecord { metric: metric.into(), points: Vec::clone(&points) })
            .into(),
        residuals: residuals_by_material(samples.rows(), &subject),
        method_residuals: jury.residuals_by_method(&subject, Split::UnseenMaterial),
        calibration: Some(Calibration::of(&mos, &intervals, 0.95).unwrap()),
        triplets: vec![triplets("vernis", 0.761), triplets("vernis-loss", 0.802)],
        predictions: prediction_records(samples.rows(), &[("vernis", &subject)]),
        did_not_help: vec!["Colour ratios < one by one: they are noise.".into()],
        left_out: vec!["The split by <type> is left out.".into()],
    }
}

fn read(folder: &OutputFolder, name: &str) -> String {
    fs::read_to_string(folder.path().join(name)).unwrap()
}

/// A made-up material; the bytes stand for pictures.
fn material() -> Material {
    let candidate = Candidate {
        method: "GGX <new>".into(),
        picture: vec![1, 2, 3],
        mos: 4.25,
        predicted: Some(3.5),
        stimulus: None,
    };
    Material {
        name: "teflon".into(),
        reference: vec![0; 3],
        candidates: vec![candidate],
        error: Some(0.75),
        stimuli: [None, None],
    }
}

/// The values of an attribute in a page.
fn values<'a>(html: &'a str, attribute: &str) -> Vec<&'a str> {
    let start = format!(" {attribute}=\"");
    html.split(&start).skip(1).map(|rest| rest.split('"').next().unwrap()).collect()
}

fn report(path: impl AsRef<Path>, record: &BenchmarkRecord) -> OutputFolder {
    let folder = OutputFolder::create(path.as_ref()).unwrap();
    let page = write_benchmark(&folder, record, &[material()], "lamps").unwrap();
    assert_eq!(page, folder.path().join("report.html"));
    folder
}

#[test]
fn every_file_is_written_the_same_each_time() {
    let record = record(false);
    // Kept after the test, to be looked at.
    let kept = report(Path::new(env!("CARGO_TARGET_TMPDIR")).join("report"), &record);
    let dir = tempfile::tempdir().unwrap();
    let again = report(dir.path(), &record);
    let mut names: Vec<String> =
        fs::read_dir(again.path()).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    for name in &names {
        let bytes = |folder: &OutputFolder| fs::read(folder.path().join(name)).unwrap();
        assert!(bytes(&kept) == bytes(&again), "{name} differs between two runs");
    }
    for expected in ["report.html", "report.md", "benchmark.json", "metrics.csv", "predictions.csv"] {
        assert!(names.iter().any(|n| n == expected), "{expected} is missing among {names:?}");
    }
    let json: BenchmarkRecord = serde_json::from_str(&read(&again, "benchmark.json")).unwrap();
    assert_eq!(json, record);
}

#[test]
fn tables_hold_every_figure() {
    let record = record(false);
    let dir = tempfile::tempdir().unwrap();
    let folder = report(dir.path(), &record);
    let lines = |name: &str| read(&folder, name).lines().count() - 1;
    // 45 metrics, 3 splits, 3 sets of rows, 6 figures.
    assert_eq!(lines("metrics.csv"), 45 * 3 * 3 * 6);
    // 5 pairs, 3 splits, 3 sets of rows, 2 figures.
    assert_eq!(lines("differences.csv"), 5 * 3 * 3 * 2);
    assert_eq!((lines("predictions.csv"), lines("residuals.csv")), (360, 60));
    let metrics = read(&folder, "metrics.csv");
    let plcc = record.metrics[0].judgements[0].agreement.plcc;
    assert!(metrics.contains(&format!("vernis,,learned,unseen-material,all,360,plcc,{plcc},")), "{metrics}");
}

/// Small tables say on which rows a figure stands; without sets of rows there are none.
#[test]
fn metrics_on_pictures_stand_beside_those_on_brdfs() {
    let folder = tempfile::tempdir().unwrap();
    let folder = report(folder.path(), &record(false));
    let page = read(&folder, "report.md");
    let section = page.split("## Metrics on pictures\n").nth(1).and_then(|rest| rest.split("\n## ").next()).unwrap();
    let rows: Vec<&str> = section.lines().filter(|line| line.starts_with("| ")).collect();
    assert_eq!(rows.len(), 4, "heading, rule, two metrics: {section}");
    assert!(rows[0].contains("SROCC, same camera") && rows[0].contains("PLCC, the study's two cameras"), "{}", rows[0]);
    // The better one first, and only what was compared has a difference.
    assert!(rows[2].starts_with("| ssim | 0.") && rows[3].starts_with("| cielab | 0."), "{section}");
    assert!(!rows[2].ends_with("| - |") && rows[3].ends_with("| - |"), "{section}");
    let by_rows =
        page.split("## Metrics on pictures by rows").nth(1).and_then(|rest| rest.split("\n## ").next()).unwrap();
    assert!(by_rows.contains("far &lt;candidates>, same camera") && by_rows.contains("\n| vernis | 0."), "{by_rows}");
    for figure in ["image-metrics", "image-curves", "curves"] {
        assert!(page.contains(&format!("![{figure}]({figure}.png)")), "{figure}");
    }
    // The headline has metrics on BRDFs alone.
    assert!(!page.split("![").next().unwrap().contains("stimulus["));
    let mut without = record(false);
    without.metrics.retain(|metric| metric.kind != MetricKind::Image);
    without.curves.retain(|curve| curve.metric == "D9.Cl");
    let plain = tempfile::tempdir().unwrap();
    let page = read(&report(plain.path(), &without), "report.md");
    assert!(!page.contains("Metrics on pictures") && !page.contains("![image-"));
}

#[test]
fn sets_of_rows_have_tables_of_their_own() {
    use vernis::report::tables;
    let record = record(false);
    let found = tables::headlines(&record);
    assert_eq!(found.len(), 3);
    assert!(found[0].title.contains("unseen material, all 360 rows"), "{}", found[0].title);
    for (table, split) in found[1..].iter().zip([Split::UnseenMaterial, Split::UnseenMaterialAndMethod]) {
        assert!(
            table.title.starts_with("PLCC / SROCC by the rows that are judged, ")
                && table.title.contains(split.label())
        );
        let set = RowSet::Named("far <candidates>".into());
        let judged = record.metrics[0].judgement(split, &set).unwrap();
        assert_eq!(table.columns, ["metric", "all rows (360)", &format!("far <candidates> ({})", judged.rows)]);
        assert_eq!(table.rows.len(), record.headline.len());
        assert!(table.rows[0][2].starts_with(&format!("{:.3} [", judged.agreement.plcc)), "{:?}", table.rows[0]);
    }
    // In sample, and for unseen types, a named set is in the numbers alone.
    let differences = tables::differences(&record);
    assert_eq!(differences.rows.iter().filter(|row| row[2].ends_with(", far <candidates>")).count(), 5 * 2 * 2);
    assert!(tables::ablation(&record).columns.contains(&"unseen method, far <candidates>".to_owned()));
    let dir = tempfile::tempdir().unwrap();
    let folder = report(dir.path(), &record);
    assert!(read(&folder, "report.html").contains("far &lt;candidates&gt; ("));
    assert!(read(&folder, "report.md").contains("* rows of far &lt;candidates>: `ABC, SGD, WARD`"));
    assert!(read(&folder, "ablation.csv").contains(",unseen-material-and-method,far <candidates>,"));
    let plain = BenchmarkRecord { row_sets: Vec::new(), ..record };
    assert_eq!(tables::headlines(&plain).len(), 1);
    assert!(!tables::headlines(&plain)[0].title.contains("all 360 rows"));
}

#[test]
fn the_page_needs_no_network_and_escapes_names() {
    let dir = tempfile::tempdir().unwrap();
    let folder = report(dir.path(), &record(false));
    let html = read(&folder, "report.html");
    for forbidden in ["url(", "@import", "<type>", "<new>", "<script src"] {
        assert!(!html.contains(forbidden), "{forbidden}");
    }
    assert!(values(&html, "src").iter().all(|src| src.starts_with("data:image/png;base64,")));
    let links = values(&html, "href");
    assert!(links.iter().all(|link| *link == "data:," || folder.path().join(link).is_file()), "{links:?}");
    assert!(links.contains(&"metrics.csv") && links.contains(&"benchmark.json"));
    assert_eq!(links.contains(&"scatter.svg"), cfg!(feature = "train"), "figures need the feature");
    // The RFC's alphabet: the bytes 1, 2, 3.
    assert!(html.contains("base64,AQID") && html.contains("GGX &lt;new&gt;: rated 4.25, predicted 3.50"));
    assert!(html.contains("mean of the method &amp; &lt;type&gt;"));
    assert!(html.contains("vernis train --study made-up --seed 1") && html.contains(&"00ff".repeat(16)));
    assert!(html.find("<table>") < html.find("SHA-256 of ratings.csv"), "the headline comes first");
    assert!(!html.contains("SYNTHETIC"));
}

#[test]
fn synthetic_observers_are_named_everywhere() {
    let dir = tempfile::tempdir().unwrap();
    let folder = report(dir.path(), &record(true));
    for name in ["report.html", "report.md"] {
        let text = read(&folder, name);
        assert!(text.matches("SYNTHETIC observers").count() >= 2, "{name}");
    }
    #[cfg(feature = "train")]
    for name in ["scatter", "agreement", "lp", "ablation", "importance", "learning", "curves", "residuals"]
        .map(|name| format!("{name}.svg"))
    {
        let svg = read(&folder, &name);
        assert!(svg.contains("(SYNTHETIC observers)"), "{name}");
    }
}

#[cfg(feature = "train")]
#[test]
fn pictures_have_content_on_both_back_ends() {
    let dir = tempfile::tempdir().unwrap();
    let folder = report(dir.path(), &record(false));
    for name in ["scatter", "agreement", "lp", "ablation", "importance", "learning", "curves", "residuals"] {
        let picture = image::open(folder.path().join(format!("{name}.png"))).unwrap().to_rgb8();
        let inked = picture.pixels().filter(|p| p.0 != [255; 3]).count();
        assert!(inked > 10_000, "{name}: {inked} pixels");
        let svg = read(&folder, &format!("{name}.svg"));
        assert!(svg.contains("<text") && svg.trim_end().ends_with("</svg>"), "{name}");
    }
    // A mark a rated pair: six shapes, of which one is a circle.
    let scatter = read(&folder, "scatter.svg");
    assert_eq!(scatter.matches("<circle").count() + scatter.matches("<polygon").count(), 360 + METHODS.len());
}

/// A benchmark of ratings from 0 to 100, and of DMOS: correlations stay, what has a unit follows the scale, pages and figures say it.
#[test]
fn a_benchmark_speaks_the_scale_of_its_study() {
    use vernis::dataset::{Basis, Identical};
    use vernis::math::rating_scale::RatingScale;
    let identical = Some(Identical { score: 4.5, basis: Basis::Assumed });
    let grades = BenchmarkRecord { identical, ..record(false) };
    for (worst, best) in [(0.0, 100.0), (100.0, 0.0)] {
        let scale = RatingScale::new(worst, best).unwrap();
        let found = grades.clone().on_scale(scale);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9 * (1.0 + b.abs());
        for (a, b) in found.metrics.iter().zip(&grades.metrics) {
            for (a, b) in a.judgements.iter().zip(&b.judgements) {
                assert!(near(a.agreement.rmse, 25.0 * b.agreement.rmse) && a.agreement.plcc == b.agreement.plcc);
                assert!(near(a.intervals.rmse.high, 25.0 * b.intervals.rmse.high));
            }
        }
        for (a, b) in found.predictions.iter().zip(&grades.predictions) {
            assert!(near(a.mos, scale.score(b.mos)));
            assert!(a.predicted.iter().all(|(name, mos)| near(*mos, scale.score(b.predicted[name]))));
        }
        for (a, b) in found.residuals.iter().zip(&grades.residuals) {
            assert!(near(a.rms, 25.0 * b.rms) && near(a.bias, scale.direction() * 25.0 * b.bias));
        }
        let (a, b) = (found.calibration.unwrap(), grades.calibration.unwrap());
        assert!(near(a.mean_width, 25.0 * b.mean_width) && a.covered == b.covered);
        assert_eq!(a.below, if scale.direction() > 0.0 { b.below } else { b.above });
        assert_eq!(found.identical.as_ref().unwrap().score, scale.score(4.5));
        let dir = tempfile::tempdir().unwrap();
        let folder = report(dir.path(), &found);
        let page = read(&folder, "report.md");
        assert!(page.contains(&format!("scale of the ratings: `{worst} (worst) to {best} (best)`")), "{page}");
        assert!(page.contains("score of identical BRDFs: `") && page.contains("assumed, 87.5 %"), "{page}");
        assert!(page.contains(&format!("{best} means that people would not tell")), "{page}");
        let json: BenchmarkRecord = serde_json::from_str(&read(&folder, "benchmark.json")).unwrap();
        assert_eq!(json, found);
    }
    assert_eq!(grades.clone().on_scale(RatingScale::GRADES), grades);
}

#[test]
fn an_empty_benchmark_still_has_a_page() {
    let record = BenchmarkRecord {
        headline: vec![],
        metrics: vec![],
        differences: vec![],
        ablation: vec![],
        importance: vec![],
        learning_curve: vec![],
        curves: vec![],
        residuals: vec![],
        method_residuals: vec![],
        calibration: None,
        triplets: vec![],
        predictions: vec![],
        ..record(false)
    };
    let dir = tempfile::tempdir().unwrap();
    let folder = report(dir.path(), &record);
    assert!(!read(&folder, "report.html").contains("<figure"));
}

#[test]
fn an_unwritable_folder_is_found_before_the_work() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("taken"), b"results of yesterday").unwrap();
    let error = OutputFolder::create(dir.path().join("taken")).unwrap_err();
    assert!(matches!(error, ReportError::Unwritable { .. }), "{error}");
    assert_eq!(fs::read(dir.path().join("taken")).unwrap(), b"results of yesterday");
}

/// The bars of one figure are of one model, and captions name it.
#[test]
fn captions_name_the_model_that_was_retrained() {
    let record = record(false);
    let dir = tempfile::tempdir().unwrap();
    let folder = report(dir.path(), &record);
    let (page, markdown) = (read(&folder, "report.html"), read(&folder, "report.md"));
    for text in [&page, &markdown] {
        assert!(text.contains("Ablation: D5 retrained with other descriptors"), "{text}");
        assert!(text.contains("Permutation importance: change of D5 when"));
        assert!(text.contains("Learning curve: agreement of D5 on unseen materials"));
    }
    #[cfg(feature = "train")]
    {
        // The words of a drawing, in their order: the first bar is the same model on all of its descriptors, with its own value.
        let svg = read(&folder, "ablation.svg");
        let words: Vec<&str> =
            svg.split("<text").skip(1).filter_map(|w| w.split_once('>')?.1.split('<').next()).collect();
        let words: Vec<&str> = words.into_iter().map(str::trim).collect();
        let at = words.iter().position(|w| *w == "D5 (full)").expect("a bar of all descriptors");
        let full = record.metric("D5").unwrap().judgements[0].agreement;
        let expected = [full.plcc, full.srocc].map(|x| format!("{x:.2}"));
        assert_eq!(words[at + 1..at + 3], [expected[0].as_str(), expected[1].as_str()], "{words:?}");
        assert!(!words.contains(&"vernis (full)"));
        let rows = "Rows: 360 rated pairs of 60 materials, each predicted by the one of 5 folds that held";
        for caption in [
            "Agreement of D5 on unseen materials: first",
            "Loss of D5 when",
            "Agreement of D5 on unseen materials when",
        ] {
            let line = markdown.lines().find(|line| line.starts_with(caption)).expect(caption);
            assert!(line.contains(rows) && !line.contains("landmark"), "{line}");
        }
    }
    // A record of before the model was named still has its bars.
    let mut old = serde_json::to_value(&record).unwrap();
    old.as_object_mut().unwrap().remove("retrained");
    assert_eq!(serde_json::from_value::<BenchmarkRecord>(old).unwrap().retrained, "nystroem-ridge");
}

#[test]
fn the_mean_of_folds_stands_beside_the_correlation_over_all_rows() {
    let record = record(false);
    let dir = tempfile::tempdir().unwrap();
    let folder = report(dir.path(), &record);
    let markdown = read(&folder, "report.md");
    assert!(
        markdown.contains("| SROCC | mean of folds |") && markdown.contains("biased downwards for weak predictors")
    );
    let metric = record.metric("D9.Cl").unwrap();
    let means = metric.judgements[0].fold_means.unwrap();
    let of_folds: Vec<f64> = metric.folds.iter().map(|fold| fold.plcc.unwrap()).collect();
    assert!((means.plcc - of_folds.iter().sum::<f64>() / 5.0).abs() < 1e-12 && means.folds == 5);
    assert!(markdown.contains(&format!("| {:.3} / {:.3} |", means.plcc, means.srocc)));
    let csv = read(&folder, "metrics.csv");
    assert!(csv.lines().next().unwrap().ends_with(",low,high,fold_mean"));
    let line = csv.lines().find(|line| line.starts_with("D9.Cl,,lp,unseen-material,all,360,plcc,")).unwrap();
    assert!(line.ends_with(&format!(",{}", means.plcc)), "{line}");
    // In sample nothing was held out.
    assert!(csv.lines().filter(|line| line.contains(",in-sample,")).all(|line| line.ends_with(',')));
}

#[test]
fn a_learned_metric_that_loses_says_so() {
    use vernis::report::tables::defeat;
    let whole = record(false);
    let best = |record: &BenchmarkRecord| record.metrics[0].judgements[0].agreement.plcc;
    assert!(whole.metrics[1..].iter().all(|m| m.judgements[0].agreement.plcc < best(&whole)));
    assert_eq!(defeat(&whole), None);
    // The same distances under the name of what is exported: D9.Cl.CR is better than the noisiest of them.
    let mut poor = whole.clone();
    poor.metrics[0].judgements = poor.metric("D1").unwrap().judgements.clone();
    let words = defeat(&poor).unwrap();
    assert!(words.starts_with("The learned metric vernis loses under cross-validation to "), "{words}");
    assert!(words.contains(" of 44 metrics that were not learned, above all to D9.Cl.CR: PLCC "), "{words}");
    let dir = tempfile::tempdir().unwrap();
    let folder = report(dir.path(), &poor);
    assert!(read(&folder, "report.html").contains(&words) && read(&folder, "report.md").contains(&words));
    // Other learned models are no classical metrics.
    poor.metrics.retain(|metric| metric.name == "vernis" || metric.name == "D9.Cl.CR");
    poor.metrics[1].kind = MetricKind::Baseline;
    assert_eq!(defeat(&poor), None);
    poor.metrics[1].kind = MetricKind::Lp;
    assert!(defeat(&poor).unwrap().contains("to 1 of 1 metric that"), "{:?}", defeat(&poor));
}

/// A sentence on what is left out quotes names from the user's files.
#[test]
fn names_in_sentences_open_no_tag() {
    let left_out = vec!["<img src=x onerror=alert(1)> is left out: all values are equal.".to_owned()];
    let dir = tempfile::tempdir().unwrap();
    let folder = report(dir.path(), &BenchmarkRecord { left_out, ..record(false) });
    for name in ["report.html", "report.md"] {
        let page = read(&folder, name);
        assert!(page.contains("&lt;img src=x onerror=alert(1)") && !page.contains("<img src=x"), "{name}");
    }
}

#[test]
fn one_of_a_thing_is_singular() {
    let record = BenchmarkRecord { rows: 1, materials: 1, groups: 1, folds: 1, resamples: 1, ..record(false) };
    let dir = tempfile::tempdir().unwrap();
    let markdown = read(&report(dir.path(), &record), "report.md");
    assert!(markdown.contains("`1 rated pair, 1 material in 1 group of sisters, 1 fold, 1 resample`"), "{markdown}");
    for wrong in ["1 rated pairs", "1 materials", "1 folds", "1 resamples", "1 metrics", "1 methods"] {
        assert!(!markdown.contains(&format!(" {wrong}")) && !markdown.contains(&format!("`{wrong}")), "{wrong}");
    }
}

/// `vernis report` on the embedded study: figures of the ratings that can be drawn, sentences for the others, every link there.
#[test]
fn the_page_of_a_study_shows_its_ratings_and_says_what_is_missing() {
    let dir = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_vernis"));
        command.args(args).current_dir(dir.path()).env_remove("VERNIS_DATA").output().unwrap()
    };
    let output = run(&["report", "--study", "synthetic", "--out", "page"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let folder = OutputFolder::create(dir.path().join("page")).unwrap();
    let html = read(&folder, "report.html");
    assert!(html.contains("SYNTHETIC observers") && html.contains("no --benchmark was given"));
    assert!(html.contains("Grace by degree"));
    let without_figures = html.contains("built without the feature `train`");
    assert!(html.contains("no rated candidate is a manifold sample") != without_figures);
    assert_eq!(without_figures, !cfg!(feature = "train"));
    let links = values(&html, "href");
    assert!(links.iter().all(|link| *link == "data:," || folder.path().join(link).is_file()), "{links:?}");
    // 40 materials and 349 candidates.
    assert_eq!(html.matches("<img").count(), 40 + 349);
    #[cfg(feature = "train")]
    for name in [
        "methods",
        "mos-by-type",
        "interval-widths",
        "mos-of-references-by-type",
        "interval-widths-of-references",
        "mos-by-method",
        "mos-by-model",
        "mos-by-light-and-type",
        "illuminations",
    ] {
        assert!(html.contains(&format!("<figure id=\"{name}\">")), "{name}");
    }
    let output = run(&["report", "--study", "synthetic", "--benchmark", "page", "--out", "page"]);
    assert_eq!(output.status.code(), Some(2));
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(
        error.contains("benchmark.json: No such file") && error.contains("it must be the benchmark.json"),
        "{error}"
    );
}
