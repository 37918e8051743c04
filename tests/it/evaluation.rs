//! Agreement measured end to end: splits, trainers, bootstrap, records.

use crate::data_folder;
use ndarray::{Array2, ArrayView2};
use rand::Rng;
use rand::seq::SliceRandom;
use std::collections::HashMap;
use vernis::dataset::{NamedRows, Row};
use vernis::descriptor::{Column, Role};
use vernis::evaluation::EvaluationError;
use vernis::evaluation::agreement::{Agreement, Figure, FoldMeans, Ratings};
use vernis::evaluation::benchmark::{JudgedMetric, Jury, residuals_by_material};
use vernis::evaluation::cross_validation::{
    OutOfFold, cross_validate, cross_validate_distance, cross_validate_mean, in_sample,
};
use vernis::evaluation::records::{Judgement, MetricKind, RowSet, Split};
use vernis::math::correlation::pearson;
use vernis::math::seed;
use vernis::samples::Samples;
use vernis::samples::split::{TrainingSet, grouped_folds, method_and_group_folds};
use vernis::train::lp_baseline::{BestOf, Criterion};
use vernis::train::trivial::MeanOf;
use vernis::train::{Predictor, TrainError, Trainer};

const METHODS: [&str; 6] = ["ABC", "BAGHER", "BLINN-PHONG", "LAFORTUNE", "SGD", "WARD"];

/// 40 materials under 6 methods; `good` is a distance that tells the rating up to a little noise, `poor` up to much.
fn study() -> Samples {
    let mut rng = seed::stream(11, "test study", 0);
    let (mut rows, mut values) = (Vec::new(), Vec::new());
    for m in 0..40 {
        for (k, method) in METHODS.iter().enumerate() {
            let distance: f64 = rng.random_range(0.0..1.0) * (1.0 - 0.1 * k as f64);
            let mos = 1.0 + 4.0 / (1.0 + (6.0 * (distance - 0.4)).exp());
            rows.push(Row {
                material: format!("material-{m}"),
                group: format!("group-{}", m / 2),
                method: (*method).into(),
                method_family: (*method).into(),
                material_type: None,
                mos: (mos + rng.random_range(-0.2..0.2)).clamp(1.0, 5.0),
                weight: 1.0,
            });
            values.extend([distance + rng.random_range(-0.05..0.05), distance + rng.random_range(-0.5..0.5)]);
        }
    }
    let column = |name: &str| Column { name: name.into(), family: "lp".into(), role: Role::Difference };
    let features = Array2::from_shape_vec((rows.len(), 2), values).unwrap();
    Samples::new(vec![column("good"), column("poor")], rows, features).unwrap()
}

/// The same descriptors, the ratings dealt out anew.
fn shuffled(samples: &Samples) -> Samples {
    let mut mos: Vec<f64> = samples.rows().iter().map(|r| r.mos).collect();
    mos.shuffle(&mut seed::stream(12, "test shuffle", 0));
    let rows = samples.rows().iter().zip(mos).map(|(row, mos)| Row { mos, ..row.clone() }).collect();
    Samples::new(samples.columns().to_vec(), rows, samples.features().to_owned()).unwrap()
}

/// Predicts the rating of the training row whose descriptors are nearest: as flexible as a model can be.
struct Nearest;

struct NearestRow {
    features: Array2<f64>,
    mos: Vec<f64>,
}

impl Trainer for Nearest {
    fn name(&self) -> &str {
        "nearest"
    }

    fn train(&self, set: &TrainingSet, _seed: u64) -> Result<Box<dyn Predictor>, TrainError> {
        Ok(Box::new(NearestRow { features: set.features().to_owned(), mos: set.mos() }))
    }
}

impl Predictor for NearestRow {
    fn predict(&self, features: ArrayView2<'_, f64>) -> Vec<f64> {
        let distance = |i: usize, row: &ndarray::ArrayView1<'_, f64>| {
            self.features.row(i).iter().zip(row).map(|(a, b)| (a - b).powi(2)).sum::<f64>()
        };
        let nearest = |row: ndarray::ArrayView1<'_, f64>| {
            (0..self.mos.len()).min_by(|&a, &b| distance(a, &row).total_cmp(&distance(b, &row))).unwrap()
        };
        features.outer_iter().map(|row| self.mos[nearest(row)]).collect()
    }
}

/// Predicts the seed it was given.
struct SeedTeller;

struct Told(f64);

impl Trainer for SeedTeller {
    fn name(&self) -> &str {
        "seed-teller"
    }

    fn train(&self, _set: &TrainingSet, seed: u64) -> Result<Box<dyn Predictor>, TrainError> {
        Ok(Box::new(Told(seed as f64)))
    }
}

impl Predictor for Told {
    fn predict(&self, features: ArrayView2<'_, f64>) -> Vec<f64> {
        vec![self.0; features.nrows()]
    }
}

fn srocc(samples: &Samples, found: &OutOfFold) -> f64 {
    Agreement::of(&Ratings::of(samples.rows()), &found.predictions).unwrap().srocc
}

#[test]
fn a_model_that_memorises_gains_nothing_from_shuffled_ratings() {
    let samples = study();
    let folds = grouped_folds(&samples, 5, 1).unwrap();
    let honest = srocc(&samples, &cross_validate(&samples, &folds, &Nearest, 1).unwrap());
    assert!(honest > 0.7, "{honest}");
    let shuffled = shuffled(&samples);
    let folds = grouped_folds(&shuffled, 5, 1).unwrap();
    let none = srocc(&shuffled, &cross_validate(&shuffled, &folds, &Nearest, 1).unwrap());
    // 240 rows: a standard error of 0.065 under independence.
    assert!(none.abs() < 0.2, "{none}");
}

/// Ratings that were dealt at random: over all rows a predictor that learned nothing is below 0, for each fold's predictions lie
/// near the mean of the other folds. The mean of the folds' own correlations is not.
#[test]
fn fold_means_are_not_biased_where_there_is_nothing_to_learn() {
    let samples = study();
    let (mut pooled, mut means) = (Vec::new(), Vec::new());
    for deal in 0..40 {
        let mut mos: Vec<f64> = samples.rows().iter().map(|r| r.mos).collect();
        mos.shuffle(&mut seed::stream(12, "test shuffle", deal));
        let rows: Vec<Row> = samples.rows().iter().zip(mos).map(|(row, mos)| Row { mos, ..row.clone() }).collect();
        let dealt = Samples::new(samples.columns().to_vec(), rows, samples.features().to_owned()).unwrap();
        let folds = grouped_folds(&dealt, 20, deal).unwrap();
        let found = cross_validate_mean(&dealt, &folds, MeanOf::Method).unwrap().predictions;
        let ratings = Ratings::of(dealt.rows());
        pooled.push(Agreement::of(&ratings, &found).unwrap().plcc);
        means.push(FoldMeans::of(&ratings, &found).unwrap().plcc);
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (pooled, means) = (mean(&pooled), mean(&means));
    // 40 deals of 240 rows: a standard error of 0.065/sqrt 40 = 0.010 of each mean.
    assert!(pooled < -0.03, "{pooled} {means}");
    assert!(means.abs() < 0.03 && means > pooled + 0.03, "{pooled} {means}");
}

/// Chooses one column for the fold that holds the first group out and another one for the others.
struct Fickle;

impl Trainer for Fickle {
    fn name(&self) -> &str {
        "fickle"
    }

    fn train(&self, set: &TrainingSet, seed: u64) -> Result<Box<dyn Predictor>, TrainError> {
        let seen = set.rows().iter().any(|row| row.group == "group-0");
        let columns = vec![if seen { "good".to_owned() } else { "poor".to_owned() }];
        BestOf { columns, criterion: Criterion::Plcc }.train(set, seed)
    }
}

#[test]
fn raw_agreement_of_a_choice_is_that_of_the_chosen_distances() {
    let samples = study();
    let folds = grouped_folds(&samples, 5, 1).unwrap();
    let ratings = Ratings::of(samples.rows());
    let raw = |name: &str, rows: &[usize]| {
        let column = samples.column(samples.columns().iter().position(|c| c.name == name).unwrap());
        let (x, y): (Vec<f64>, Vec<f64>) = rows.iter().map(|&i| (-column[i], samples.rows()[i].mos)).unzip();
        pearson(&x, &y).unwrap()
    };
    let all: Vec<usize> = (0..samples.len()).collect();
    // One choice everywhere: the distances themselves, not what they were mapped to.
    let best = BestOf { columns: vec!["poor".into(), "good".into()], criterion: Criterion::Plcc };
    let found = cross_validate(&samples, &folds, &best, 1).unwrap();
    assert!(found.folds.iter().all(|fold| fold.chosen.as_deref() == Some("good")));
    let agreement = Agreement::of(&ratings, &found.predictions).unwrap();
    assert!(
        (agreement.plcc_raw.unwrap() - raw("good", &all)).abs() < 1e-12 && agreement.plcc > agreement.plcc_raw.unwrap()
    );
    // Several: each fold has its own, and all together have none.
    let found = cross_validate(&samples, &folds, &Fickle, 1).unwrap();
    let agreement = Agreement::of(&ratings, &found.predictions).unwrap();
    assert!(agreement.plcc_raw.is_none() && agreement.srocc > 0.7, "{agreement:?}");
    let chosen: Vec<&str> = found.folds.iter().filter_map(|fold| fold.chosen.as_deref()).collect();
    assert_eq!((chosen.len(), chosen.iter().filter(|c| **c == "poor").count()), (5, 1));
    for (record, fold) in found.folds.iter().zip(&folds) {
        let expected = raw(record.chosen.as_deref().unwrap(), fold.held_out.indices());
        assert!((record.plcc_raw.unwrap() - expected).abs() < 1e-12, "{record:?} {expected}");
    }
    let jury = Jury::new(samples.rows(), |_| false, &[], 60, 3).unwrap();
    let judged = jury.judge("fickle", Split::UnseenMaterial, &found.predictions).unwrap();
    let text = serde_json::to_string(&judged[0].record()).unwrap();
    assert!(text.contains("\"plcc_raw\":null"), "{text}");
    assert_eq!(serde_json::from_str::<Judgement>(&text).unwrap(), judged[0].record());
}

#[test]
fn held_out_ratings_do_not_touch_their_own_predictions() {
    let samples = study();
    let folds = grouped_folds(&samples, 5, 1).unwrap();
    let held: Vec<usize> = folds[2].held_out.indices().to_vec();
    let rows = samples.rows().iter().enumerate();
    let changed: Vec<Row> =
        rows.map(|(i, r)| Row { mos: if held.contains(&i) { 6.0 - r.mos } else { r.mos }, ..r.clone() }).collect();
    let changed = Samples::new(samples.columns().to_vec(), changed, samples.features().to_owned()).unwrap();
    let changed_folds = grouped_folds(&changed, 5, 1).unwrap();
    let distance = |s: &Samples, f: &[_]| cross_validate_distance(s, f, "good").unwrap().predictions.mos;
    let trained = |s: &Samples, f: &[_]| cross_validate(s, f, &Nearest, 1).unwrap().predictions.mos;
    for (before, after) in [
        (distance(&samples, &folds), distance(&changed, &changed_folds)),
        (trained(&samples, &folds), trained(&changed, &changed_folds)),
    ] {
        assert!(held.iter().all(|&i| before[i] == after[i]));
        assert!(before != after, "the other folds train on the changed ratings");
    }
}

#[test]
fn every_fold_has_its_own_seed_and_threads_do_not_matter() {
    let samples = study();
    let folds = grouped_folds(&samples, 5, 1).unwrap();
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let told = cross_validate(&samples, &folds, &SeedTeller, 9).unwrap();
            let jury = Jury::new(samples.rows(), |r| r.method == "BAGHER", &[], 100, 3).unwrap();
            let nearest = cross_validate(&samples, &folds, &Nearest, 1).unwrap();
            let judged = jury.judge("nearest", Split::UnseenMaterial, &nearest.predictions).unwrap();
            let records: Vec<String> = judged.iter().map(|j| serde_json::to_string(&j.record()).unwrap()).collect();
            (told.predictions, records)
        })
    };
    let (one, four) = (run(1), run(4));
    assert_eq!(one, four);
    let mut seeds: Vec<u64> = folds.iter().map(|f| one.0.score[f.held_out.indices()[0]].to_bits()).collect();
    seeds.sort_unstable();
    seeds.dedup();
    assert_eq!(seeds.len(), 5);
}

#[test]
fn folds_that_miss_a_row_are_refused() {
    let samples = study();
    let folds = grouped_folds(&samples, 5, 1).unwrap();
    let error = cross_validate_distance(&samples, &folds[1..], "good").unwrap_err();
    assert!(matches!(error, EvaluationError::Coverage { times: 0, .. }), "{error}");
    let error = cross_validate_distance(&samples, &folds, "missing").unwrap_err();
    assert_eq!(error.to_string(), "there is no column missing among the 2 columns of the samples");
}

#[test]
fn judged_metrics_differ_as_they_should() {
    let samples = study();
    let by_material = grouped_folds(&samples, 5, 1).unwrap();
    let by_method = method_and_group_folds(&samples, 5, 1).unwrap();
    let named = |name: &str, methods: &[&str]| NamedRows {
        name: name.into(),
        methods: methods.iter().map(|method| (*method).to_owned()).collect(),
    };
    // A set of no row, and one of all, are no sets.
    let mut methods: Vec<&str> = samples.rows().iter().map(|row| row.method.as_str()).collect();
    let sets = [named("near copies", &["BAGHER"]), named("none", &["ABC-OURS"]), named("whole", &methods)];
    methods.retain(|method| *method == "BAGHER");
    let jury = Jury::new(samples.rows(), |r| r.method_family == "BAGHER", &sets, 400, 3).unwrap();
    let judge = |name: &str| {
        let material = cross_validate_distance(&samples, &by_material, name).unwrap();
        let method = cross_validate_distance(&samples, &by_method, name).unwrap();
        let fitted = in_sample(&samples, name).unwrap();
        let mut judged = jury.judge(name, Split::UnseenMaterial, &material.predictions).unwrap();
        judged.extend(jury.judge(name, Split::UnseenMaterialAndMethod, &method.predictions).unwrap());
        judged.extend(jury.judge(name, Split::InSample, &fitted).unwrap());
        JudgedMetric { name: name.into(), kind: MetricKind::Lp, note: String::new(), judged, folds: material.folds }
    };
    let metrics = [judge("good"), judge("poor")];
    let good = metrics[0].record();
    let all = good.judgement(Split::UnseenMaterial, RowSet::All).unwrap();
    let kept = good.judgement(Split::UnseenMaterial, RowSet::WithoutSetAside).unwrap();
    let fitted = good.judgement(Split::InSample, RowSet::All).unwrap();
    assert_eq!((all.rows, kept.rows, good.folds.len()), (240, 200, 5));
    let near = good.judgement(Split::UnseenMaterialAndMethod, RowSet::Named("near copies".into())).unwrap();
    assert_eq!((near.rows, methods.len(), good.judgements.len()), (40, 40, 3 * 3));
    assert!(fitted.agreement.plcc >= all.agreement.plcc && fitted.agreement.rmse <= all.agreement.rmse);
    // A distance needs no training: its own order is the same however the rows are split.
    assert_eq!(fitted.agreement.srocc, all.agreement.srocc);
    // The logistic is what makes the relation straight.
    assert!(Some(all.agreement.plcc) > all.agreement.plcc_raw);
    assert!(all.intervals.plcc.contains(all.agreement.plcc));

    let figures = [Figure::Plcc, Figure::Srocc, Figure::Rmse];
    let found = jury.differences(&metrics, &[("good", "poor"), ("good", "good")], &figures).unwrap();
    // Two pairs, three splits that were judged, with and without the rows set aside, and on them.
    assert_eq!(found.len(), 2 * figures.len() * 3 * 3);
    let found: Vec<_> = found.into_iter().filter(|d| !matches!(d.row_set, RowSet::Named(_))).collect();
    for record in &found {
        assert!(record.holm_p >= record.paired.p);
        if record.b == "good" {
            assert_eq!((record.paired.difference, record.holm_p), (0.0, 1.0));
        } else if record.figure == Figure::Rmse {
            assert!(record.paired.interval.high < 0.0 && record.cross_check.is_none());
        } else {
            assert!(record.paired.interval.low > 0.0 && record.holm_p < 0.05, "{record:?}");
            let check = record.cross_check.unwrap();
            assert!(check.zou.low > 0.0 && check.steiger_p < 0.001, "{check:?}");
        }
    }
    let error = jury.differences(&metrics, &[("good", "bad")], &figures).unwrap_err().to_string();
    assert_eq!(error, "there is no metric bad; the judged metrics are good, poor");

    let ablation = jury.ablation("only poor", 1, &metrics[0], &metrics[1].judged);
    assert!(ablation.srocc_change.unwrap().interval.high < 0.0);
}

#[test]
fn residuals_name_the_material_that_is_farthest_off() {
    let samples = study();
    let mut predictions = in_sample(&samples, "good").unwrap();
    for (row, mos) in samples.rows().iter().zip(&mut predictions.mos) {
        *mos = if row.material == "material-7" && row.method == "SGD" { row.mos - 3.0 } else { row.mos };
    }
    let found = residuals_by_material(samples.rows(), &predictions);
    assert_eq!(found.len(), 40);
    assert_eq!((found[0].material.as_str(), found[0].worst_method.as_str()), ("material-7", "SGD"));
    assert!((found[0].bias + 0.5).abs() < 1e-12 && (found[0].rms - 1.5f64.sqrt()).abs() < 1e-12);
    assert_eq!(found[1].rms, 0.0);
}

/// The same for methods: SGD alone is off, by 3 on one material of 40, and the resamples without that material find nothing.
#[test]
fn residuals_by_method_have_intervals_by_material() {
    let samples = study();
    let mut predictions = in_sample(&samples, "good").unwrap();
    for (row, mos) in samples.rows().iter().zip(&mut predictions.mos) {
        *mos = if row.material == "material-7" && row.method == "SGD" { row.mos - 3.0 } else { row.mos };
    }
    let jury = Jury::new(samples.rows(), |_| false, &[], 400, 3).unwrap();
    let found = jury.residuals_by_method(&predictions, Split::UnseenMaterial);
    assert_eq!(found.iter().map(|r| r.method.as_str()).collect::<Vec<_>>(), METHODS);
    for residual in &found {
        let interval = residual.interval.unwrap();
        if residual.method == "SGD" {
            assert!((residual.bias + 3.0 / 40.0).abs() < 1e-12, "{residual:?}");
            assert!((residual.rms - (9.0f64 / 40.0).sqrt()).abs() < 1e-12, "{residual:?}");
            assert!(interval.low < -0.1 && interval.high == 0.0, "{residual:?}");
        } else {
            assert_eq!((residual.bias, interval.low, interval.high), (0.0, 0.0, 0.0));
        }
    }
}

/// The published ratings as rows without descriptors.
fn published_ratings(folder: &std::path::Path) -> Samples {
    let table = |name: &str| {
        let path = folder.join("lavoue2021").join(name);
        csv::ReaderBuilder::new().delimiter(b';').from_path(path).unwrap()
    };
    let types: HashMap<String, String> = table("MaterialType.csv").deserialize().map(Result::unwrap).collect();
    let ratings: Vec<(String, String, f64)> =
        table("PerceptualDistances.csv").deserialize().map(Result::unwrap).collect();
    let row = |(method, material, distance): (String, String, f64)| Row {
        group: material.clone(),
        material_type: types.get(&material).cloned(),
        method_family: method.clone(),
        mos: 5.0 - 4.0 * distance,
        weight: 1.0,
        method,
        material,
    };
    let rows: Vec<Row> = ratings.into_iter().map(row).collect();
    let features = Array2::zeros((rows.len(), 0));
    Samples::new(vec![], rows, features).unwrap()
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn knowing_the_method_agrees_as_well_as_published_ratings_say() {
    let folder = data_folder();
    let samples = published_ratings(folder.as_ref());
    if samples.len() != 1638 {
        println!("skipped: the expected values are those of the extract of 85 materials");
        return;
    }
    let analytic: Vec<usize> = (0..samples.len()).filter(|&i| !samples.rows()[i].method.starts_with("GPLVM")).collect();
    let analytic = samples.select_rows(&analytic);
    // Mean MOS of the method over all other materials, by numpy; SciPy 1.17.1: stats.pearsonr, spearmanr, kendalltau
    // over all rows, and the mean of stats.spearmanr over materials.
    for (samples, plcc, ranks) in [
        (&samples, 0.686028863132771, [0.6493951838576582, 0.44283302333326446, 0.7053104384820186]),
        (&analytic, 0.4966447109052468, [0.40400174137552297, 0.25449483494882164, 0.5230251594250475]),
    ] {
        let folds = grouped_folds(samples, 85, 1).unwrap();
        let found = cross_validate_mean(samples, &folds, MeanOf::Method).unwrap();
        let found = Agreement::of(&Ratings::of(samples.rows()), &found.predictions).unwrap();
        assert!((found.plcc_raw.unwrap() - plcc).abs() < 1e-12, "{found:?}");
        // Means of the same ratings in another order are equal or not by rounding, and so are their ranks.
        let found = [found.srocc, found.krocc, found.within_material_srocc.unwrap()];
        assert!(found.iter().zip(ranks).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?}");
    }
}
