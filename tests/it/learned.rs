//! The exported metric seen from outside: round trip, identity, and every file that must be refused.

use ndarray::Array2;
use rand::Rng;
use vernis::brdf::models::Ggx;
use vernis::dataset::Row;
use vernis::descriptor::Role;
use vernis::descriptor::{DescriptorSet, Setup};
use vernis::math::rating_scale::RatingScale;
use vernis::math::seed::stream;
use vernis::metric::Metric;
use vernis::metric::learned::exported::{DataHash, Descriptors, FORMAT, Interval, Provenance, Reached};
use vernis::metric::learned::{ExportedError, ExportedMetric, LearnedMetric, Regressor};
use vernis::samples::Samples;
use vernis::samples::split::TrainingSet;
use vernis::train::ensemble::bootstrap_members;
use vernis::train::kernel::KernelRidge;
use vernis::train::{Predictor, Trainer};

/// Ratings of random descriptors of compact 48: only their shapes matter here.
fn samples() -> Samples {
    let mut rng = stream(4, "learned-test", 0);
    let columns = DescriptorSet::compact().columns();
    let features = Array2::from_shape_fn((60, columns.len()), |_| rng.random_range(-1.0..1.0f64));
    let rows = features.outer_iter().enumerate().map(|(i, x)| Row {
        material: format!("m{}", i / 4),
        group: format!("m{}", i / 4),
        method: "a".into(),
        method_family: "a".into(),
        material_type: None,
        mos: (4.3 - 2.0 * x[0].abs()).clamp(1.0, 5.0),
        weight: 1.0,
    });
    let rows = rows.collect();
    Samples::new(columns, rows, features).unwrap()
}

fn portable(model: &dyn Predictor) -> Regressor {
    model.regressor().unwrap().clone()
}

fn exported() -> ExportedMetric {
    exported_from(&samples())
}

fn exported_from(samples: &Samples) -> ExportedMetric {
    let set = TrainingSet::whole(samples);
    let trainer = KernelRidge::nystroem(12);
    let members = bootstrap_members(&trainer, &set, 3, 1).unwrap();
    ExportedMetric::new(
        "test-metric",
        "1",
        Descriptors { setup: Setup::standard().id().to_owned(), set: DescriptorSet::compact() },
        portable(trainer.train(&set, 1).unwrap().as_ref()),
        members.iter().map(|m| portable(m.as_ref())).collect(),
        Interval::calibrate(&[0.1, -0.3, 0.2, 0.5, -0.1], &[0.1; 5], 0.9).unwrap(),
        Provenance {
            study: "random numbers".into(),
            synthetic: true,
            rows: 60,
            materials: 15,
            data: vec![DataHash { name: "none".into(), sha256: "00".into() }],
            seed: 1,
            command: "cargo test".into(),
            crate_version: env!("CARGO_PKG_VERSION").into(),
            agreement: vec![Reached { measure: "srocc".into(), rows: "all".into(), value: 0.5, low: 0.4, high: 0.6 }],
        },
    )
    .unwrap()
}

fn parse(text: &str) -> Result<ExportedMetric, ExportedError> {
    ExportedMetric::parse(text, "m.vernis.json")
}

#[test]
fn what_is_written_is_read_back_bit_for_bit() {
    let metric = exported();
    let text = metric.to_json().unwrap();
    let back = parse(&text).unwrap();
    assert_eq!(back, metric);
    assert_eq!(back.to_json().unwrap(), text);
    assert_eq!(exported().to_json().unwrap(), text, "the same training gives the same bytes");
}

#[test]
fn scores_are_exact_at_identity_and_bounded() {
    let metric = exported();
    for (i, row) in samples().features().outer_iter().enumerate() {
        let mut raw = row.to_vec();
        let score = metric.score(&raw).unwrap();
        assert!(score.distance >= 0.0 && score.low <= score.mos && score.mos <= score.high, "row {i}: {score:?}");
        assert!(score.low >= 1.0 && score.high <= 5.0);
        for (x, input) in raw.iter_mut().zip(&metric.regressor.inputs) {
            if input.role == Role::Difference {
                *x = if i % 2 == 0 { 0.0 } else { -0.0 };
            }
        }
        let identical = metric.score(&raw).unwrap();
        assert_eq!((identical.distance, identical.mos), (0.0, 4.5));
        assert_eq!(metric.spread(&raw), 0.0);
    }
}

#[test]
fn a_score_needs_all_descriptors_and_finite_ones() {
    let metric = exported();
    assert!(matches!(metric.score(&[0.0; 3]), Err(ExportedError::Inputs { found: 3, expected: 48, .. })));
    let mut raw = [0.1; 48];
    raw[5] = f64::NAN;
    assert!(matches!(metric.score(&raw), Err(ExportedError::NotFinite { .. })));
}

#[test]
fn distance_between_brdfs_is_zero_only_for_the_same() {
    let metric = LearnedMetric::new(exported(), Setup::standard()).unwrap();
    let ggx = |alpha| Ggx::new([0.2, 0.1, 0.05], [0.05, 0.06, 0.08], alpha).unwrap();
    let prepared = metric.prepare(&ggx(0.1)).unwrap();
    assert_eq!(prepared.distance(&ggx(0.1)).unwrap(), 0.0);
    assert_ne!(prepared.distance(&ggx(0.4)).unwrap(), 0.0);
}

/// The file with one part changed.
fn tampered(change: impl Fn(&mut serde_json::Value)) -> ExportedError {
    let mut value: serde_json::Value = serde_json::from_str(&exported().to_json().unwrap()).unwrap();
    change(&mut value);
    parse(&value.to_string()).unwrap_err()
}

#[test]
fn files_of_the_future_or_of_other_descriptors_are_refused() {
    let newer = tampered(|v| {
        v["format"] = (FORMAT + 1).into();
        v["something"] = "new".into();
        v["provenance"]["crate_version"] = "9.9.9".into();
    });
    assert_eq!(
        newer.to_string(),
        "m.vernis.json: format 3, written by vernis 9.9.9; this is vernis 0.1.0, which reads up to format 2: use vernis 9.9.9 \
         or later"
    );
    let family = tampered(|v| v["descriptors"]["set"]["families"][0] = "holograms".into());
    assert!(matches!(family, ExportedError::UnknownFamily { .. }), "{family}");
    assert!(family.to_string().contains("`holograms` is unknown; the families are lights, slot"), "{family}");
    let setup = tampered(|v| v["descriptors"]["setup"] = "v99".into());
    assert!(
        setup.to_string().contains("unknown descriptors `v99`; this program knows v1-lamps-sphere, and"),
        "{setup}"
    );
    let setup = tampered(|v| v["descriptors"]["setup"] = "v99-lamps-sphere".into());
    assert!(setup.to_string().ends_with("this program knows up to version 2: update vernis"), "{setup}");
    let fewer = tampered(|v| v["descriptors"]["set"]["families"] = serde_json::json!(["lights"]));
    assert!(matches!(fewer, ExportedError::Columns { index: 18, .. }), "{fewer}");
    let renamed = tampered(|v| v["regressor"]["inputs"][2]["name"] = "lights.other".into());
    assert!(matches!(renamed, ExportedError::Columns { index: 2, .. }), "{renamed}");
    let role = tampered(|v| v["regressor"]["inputs"][0]["role"] = "context".into());
    assert!(matches!(role, ExportedError::Columns { index: 0, .. }), "{role}");
}

#[test]
fn damaged_numbers_are_refused() {
    let remove = |path: &'static str| {
        tampered(move |v| {
            v.pointer_mut(path).unwrap().as_array_mut().unwrap().pop();
        })
    };
    for path in [
        "/regressor/terms/0/function/weights",
        "/regressor/terms/0/function/landmarks",
        "/regressor/terms/0/standardizer/features",
        "/regressor/terms",
        "/members/1/0/function/weights",
    ] {
        let error = remove(path);
        assert!(matches!(error, ExportedError::Regressor { .. }), "{path}: {error}");
    }
    let set = |path: &'static str, x: serde_json::Value| tampered(move |v| *v.pointer_mut(path).unwrap() = x.clone());
    let scale = set("/regressor/terms/0/standardizer/features/0/scale", 0.0.into());
    assert!(matches!(scale, ExportedError::Regressor { .. }), "{scale}");
    let input = set("/regressor/terms/0/standardizer/features/0/input", 48.into());
    assert!(matches!(input, ExportedError::Regressor { .. }), "{input}");
    // Finite, and far beyond what training gives: a sum of such numbers is none, and `max` would make a distance of 0 of it.
    for path in [
        "/regressor/terms/0/weight",
        "/regressor/terms/0/function/weights/0",
        "/regressor/terms/0/function/landmarks/0",
        "/regressor/terms/0/function/kernel/linear",
        "/regressor/terms/0/function/kernel/length",
        "/regressor/terms/0/standardizer/limit",
        "/regressor/terms/0/standardizer/power",
        "/regressor/terms/0/standardizer/features/0/mean",
        "/regressor/terms/0/standardizer/features/0/scale",
        "/regressor/terms/0/standardizer/features/0/gain",
        "/members/1/0/function/weights/0",
    ] {
        let error = set(path, 1.7e308.into());
        assert!(matches!(error, ExportedError::Regressor { .. }), "{path}: {error}");
        assert!(error.to_string().contains("is 1.7e308; it must be "), "{path}: {error}");
    }
    for name in ["", "a\u{1b}[2Jb", &"n".repeat(201)] {
        let error = set("/name", name.into());
        assert!(error.to_string().contains("the name is") && !error.to_string().contains('\u{1b}'), "{error}");
    }
    for (path, x) in [
        ("/interval/factor", 1.7e308),
        ("/interval/factor", -1.0),
        ("/interval/level", 1.0),
        ("/regressor/identity_mos", 7.0),
    ] {
        let error = set(path, x.into());
        assert!(matches!(error, ExportedError::Value { .. }), "{path}: {error}");
    }
    // Not a number is null in JSON; an overflow is no number at all.
    let null = set("/regressor/terms/0/function/weights/0", serde_json::Value::Null);
    assert!(matches!(null, ExportedError::Json { .. }), "{null}");
    let text = exported().to_json().unwrap().replacen("\"weight\":1.0", "\"weight\":1e999", 1);
    assert!(matches!(parse(&text), Err(ExportedError::Json { .. })));
    assert!(matches!(parse("{"), Err(ExportedError::Json { line: 1, .. })));
    assert!(matches!(parse("[1, 2]"), Err(ExportedError::Json { .. })));
}

#[test]
fn a_calibrated_interval_covers_what_it_says() {
    let residuals: Vec<f64> = (0..100).map(|i| (i as f64 / 50.0 - 1.0) * (1.0 + (i % 3) as f64)).collect();
    let spreads: Vec<f64> = (0..100).map(|i| 0.2 * (i % 3) as f64).collect();
    for level in [0.5, 0.9, 0.95] {
        let interval = Interval::calibrate(&residuals, &spreads, level).unwrap();
        let inside = residuals
            .iter()
            .zip(&spreads)
            .filter(|(r, s)| r.abs() <= interval.factor * (*s + interval.offset) + 1e-12)
            .count();
        // The level, up to one row in a hundred and ties.
        assert!((level - 1e-9..=level + 0.03).contains(&(inside as f64 / 100.0)), "{level}: {inside}");
    }
    assert!(Interval::calibrate(&[], &[], 0.9).is_none());
    assert!(Interval::calibrate(&[0.1], &[0.1], 1.0).is_none());
}

/// The same study stated on 1 to 5, on 0 to 100, as DMOS: one metric up to the map between the scales.
#[test]
fn a_study_gives_the_same_metric_on_whichever_scale_it_is_stated() {
    let (grades, whole) = (exported(), samples());
    for (worst, best) in [(0.0, 100.0), (60.0, 0.0), (-3.0, 10.0)] {
        let scale = RatingScale::new(worst, best).unwrap();
        let stated = whole.rows().iter().map(|r| Row { mos: scale.grade(scale.stated(r.mos)), ..r.clone() });
        let restated = Samples::new(whole.columns().to_vec(), stated.collect(), whole.features().to_owned()).unwrap();
        let metric = exported_from(&restated).on_scale(scale).unwrap();
        assert!(metric.regressor.identity_mos == scale.score(4.5) && metric.scale == scale);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-4 * scale.unit().abs();
        for row in whole.features().outer_iter() {
            let (one, other) = (grades.score(&row.to_vec()).unwrap(), metric.score(&row.to_vec()).unwrap());
            assert!(near(other.mos, scale.score(one.mos)), "{one:?} {other:?}");
            assert!(near(other.distance, scale.width(one.distance)), "{one:?} {other:?}");
            let ends = [one.low, one.high].map(|x| scale.score(x));
            let ends = [ends[0].min(ends[1]), ends[0].max(ends[1])];
            assert!(near(other.low, ends[0]) && near(other.high, ends[1]), "{one:?} {other:?}");
            assert!(scale.contains(other.low) && scale.contains(other.high) && other.scale == scale);
            let signed = metric.signed_distance(&row.to_vec()).unwrap();
            assert_eq!(signed.max(0.0), other.distance);
        }
        let mut same = whole.features().row(0).to_vec();
        for (x, input) in same.iter_mut().zip(&metric.regressor.inputs) {
            *x = if input.role == Role::Difference { 0.0 } else { *x };
        }
        let score = metric.score(&same).unwrap();
        assert_eq!((score.distance, score.mos), (0.0, metric.regressor.identity_mos));
        let text = metric.to_json().unwrap();
        assert_eq!(parse(&text).unwrap(), metric);
        assert_ne!(
            metric.content(),
            parse(&text.replace(&format!("\"best\":{best:?}"), "\"best\":1000.0"))
                .map_or_else(|_| grades.content(), |m| m.content())
        );
        assert!(metric.on_scale(scale).unwrap_err().to_string().contains("not in grades"));
    }
    // A file without a scale is in grades, and says nothing of it.
    assert!(grades.scale.is_grades() && !grades.to_json().unwrap().contains("\"scale\":{"));
    assert_eq!(grades.clone().on_scale(RatingScale::GRADES).unwrap(), grades);
    // What lies beyond the scale, or is none, is refused.
    let percent = grades.on_scale(RatingScale::new(0.0, 100.0).unwrap()).unwrap().to_json().unwrap();
    let changed = |from: &str, to: &str| {
        assert!(percent.contains(from), "{from}");
        parse(&percent.replacen(from, to, 1)).unwrap_err().to_string()
    };
    let message = changed("\"identity_mos\":87.5", "\"identity_mos\":100.5");
    assert!(message.contains("identity_mos is 100.5; it must be on the scale of the file"), "{message}");
    assert!(changed("\"best\":100.0", "\"best\":0.0").contains("they must be finite and differ"));
}

#[test]
fn members_of_another_model_are_refused() {
    let metric = exported();
    let mut other = metric.regressor.clone();
    other.identity_mos = 4.4;
    let made = ExportedMetric::new(
        "x",
        "1",
        metric.descriptors.clone(),
        metric.regressor.clone(),
        vec![other],
        metric.interval,
        metric.provenance.clone(),
    );
    assert!(matches!(made, Err(ExportedError::Write { .. })));
}
