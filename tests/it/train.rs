//! Trainers on small generated studies: identity, leakage, determinism, recovery of a known function, errors.
#![cfg(feature = "train")]

use ndarray::Array2;
use rand::Rng;
use rand::seq::SliceRandom;
use vernis::dataset::{Basis, Identical, Row};
use vernis::descriptor::{Column, Role};
use vernis::math::rating_scale::RatingScale;
use vernis::math::seed::stream;
use vernis::samples::Samples;
use vernis::samples::split::{TrainingSet, grouped_folds};
use vernis::train::ensemble::{Average, OnColumns, bootstrap_members};
use vernis::train::kernel::KernelRidge;
use vernis::train::linear::ElasticNet;
use vernis::train::lp_baseline::{BestOf, Criterion, SingleMetric};
use vernis::train::neural::NeuralNetwork;
use vernis::train::svr::SupportVectors;
use vernis::train::trivial::MeanOf;
use vernis::train::{Predictor, TrainError, Trainer};

const DIFFERENCES: usize = 6;
const COLUMNS: usize = 8;

/// 40 materials with 6 candidates each; the rating falls with |c0| and, more so where the context c6 is large, with |c1|.
fn study(shuffled: bool) -> Samples {
    let mut rng = stream(1, "study", 0);
    let features = Array2::from_shape_fn((240, COLUMNS), |_| rng.random_range(-1.0..1.0f64));
    let mut mos: Vec<f64> = features
        .outer_iter()
        .map(|x| 4.5 - 1.5 * x[0].abs() - (1.0 + x[6]) * x[1].abs() + rng.random_range(-0.1..0.1))
        .map(|m: f64| m.clamp(1.0, 5.0))
        .collect();
    if shuffled {
        mos.shuffle(&mut rng);
    }
    let columns = (0..COLUMNS).map(|i| Column {
        name: format!("c{i}"),
        family: "test".into(),
        role: if i < DIFFERENCES { Role::Difference } else { Role::Context },
    });
    let rows = mos.iter().enumerate().map(|(i, &mos)| Row {
        material: format!("m{}", i / 6),
        group: format!("m{}", i / 6),
        method: format!("k{}", i % 6),
        method_family: format!("k{}", i % 6),
        material_type: Some(if i % 12 < 6 { "metal".into() } else { "dielectric".into() }),
        mos,
        weight: 1.0,
    });
    Samples::new(columns.collect(), rows.collect(), features).unwrap()
}

fn quick_network() -> NeuralNetwork {
    NeuralNetwork { epochs: 60, members: 2, choose_epochs: true, ..NeuralNetwork::default() }
}

fn exact_trainers() -> Vec<Box<dyn Trainer>> {
    vec![
        Box::new(KernelRidge::full()),
        Box::new(KernelRidge::nystroem(40)),
        Box::new(quick_network()),
        Box::new(ElasticNet::ridge()),
        Box::new(ElasticNet::mixed()),
        Box::new(Average {
            name: "average".into(),
            trainers: vec![Box::new(KernelRidge::nystroem(20)), Box::new(ElasticNet::ridge())],
        }),
    ]
}

/// Pearson's correlation of ratings and predictions for rows that the model has not seen.
fn out_of_fold(samples: &Samples, trainer: &dyn Trainer) -> f64 {
    let mut predicted = vec![0.0; samples.len()];
    for fold in grouped_folds(samples, 4, 0).unwrap() {
        let model = trainer.train(&fold.training, 3).unwrap();
        for (&i, p) in fold.held_out.indices().iter().zip(model.predict(fold.held_out.features())) {
            predicted[i] = p;
        }
    }
    let mos: Vec<f64> = samples.rows().iter().map(|r| r.mos).collect();
    let n = mos.len() as f64;
    let (a, b) = (predicted.iter().sum::<f64>() / n, mos.iter().sum::<f64>() / n);
    let sum = |f: &dyn Fn(f64, f64) -> f64| predicted.iter().zip(&mos).map(|(p, m)| f(p - a, m - b)).sum::<f64>();
    sum(&|p, m| p * m) / (sum(&|p, _| p * p) * sum(&|_, m| m * m)).sqrt()
}

#[test]
fn identical_brdfs_get_the_identity_bit_for_bit() {
    let known = Identical { score: 4.39, basis: Basis::Declared { source: "a paper".into() } };
    let samples = study(false).with_identical(known, RatingScale::GRADES);
    let set = TrainingSet::whole(&samples);
    assert_eq!((set.identical(), TrainingSet::whole(&study(false)).identical()), (4.39, 4.5));
    let mut identical = samples.features().to_owned();
    identical.slice_mut(ndarray::s![.., ..DIFFERENCES]).fill(0.0);
    for trainer in exact_trainers() {
        let model = trainer.train(&set, 7).unwrap();
        assert!(model.predict(identical.view()).iter().all(|m| *m == 4.39), "{}", trainer.name());
        assert!(model.predict(samples.features()).iter().any(|m| *m != 4.39), "{}", trainer.name());
    }
}

/// A fold knows no more of identical BRDFs than the hidden references that it trains on.
#[test]
fn hidden_references_that_are_held_out_are_not_learned_from() {
    let samples = study(false);
    let mut rows = samples.rows().to_vec();
    // Every material has one hidden reference; those of the first 20 are rated 4, the others 5.
    for (i, row) in rows.iter_mut().enumerate().filter(|(i, _)| i % 6 == 0) {
        (row.method, row.mos) = ("REFERENCE".into(), if i < 120 { 4.0 } else { 5.0 });
    }
    let found = Identical { score: 4.5, basis: Basis::HiddenReferences { pairs: 40 } };
    let samples = Samples::new(samples.columns().to_vec(), rows, samples.features().to_owned()).unwrap();
    let samples = samples.with_identical(found, RatingScale::GRADES);
    for fold in grouped_folds(&samples, 4, 3).unwrap() {
        let hidden: Vec<f64> = fold.training.rows().iter().filter(|r| r.method == "REFERENCE").map(|r| r.mos).collect();
        let mean = hidden.iter().sum::<f64>() / hidden.len() as f64;
        assert_eq!((fold.training.identical(), hidden.len()), (mean, 30));
        // A resample of it keeps what it knows: its members and the model are one metric.
        assert_eq!(fold.training.resample_groups(1, 0).identical(), mean);
    }
}

#[test]
fn portable_form_predicts_the_same() {
    let samples = study(false);
    let set = TrainingSet::whole(&samples);
    for trainer in exact_trainers() {
        let model = trainer.train(&set, 7).unwrap();
        let portable = model.regressor().unwrap();
        portable.check().unwrap();
        for (a, b) in model.predict(samples.features()).iter().zip(portable.predict_rows(samples.features())) {
            assert!((a - b).abs() < 1e-12, "{}", trainer.name());
        }
    }
}

#[test]
fn a_known_function_is_recovered_better_than_by_a_line() {
    let samples = study(false);
    let line = out_of_fold(&samples, &ElasticNet::ridge());
    let curved: [&dyn Trainer; 4] =
        [&KernelRidge::full(), &KernelRidge::nystroem(60), &quick_network(), &SupportVectors::default()];
    for trainer in curved {
        let agreement = out_of_fold(&samples, trainer);
        println!("{} {agreement}", trainer.name());
        // The function is even in every difference, so that a line explains nothing.
        assert!(agreement > 0.55 && line.abs() < 0.2, "{}: {agreement}, line {line}", trainer.name());
    }
}

#[test]
fn shuffled_ratings_leave_nothing_to_learn() {
    let samples = study(true);
    let trainers: [&dyn Trainer; 4] =
        [&KernelRidge::full(), &KernelRidge::nystroem(60), &quick_network(), &ElasticNet::ridge()];
    for trainer in trainers {
        let agreement = out_of_fold(&samples, trainer);
        // Three standard errors of a correlation of 240 independent rows are 0.19.
        assert!(agreement.abs() < 0.2, "{}: {agreement}", trainer.name());
    }
}

#[test]
fn threads_do_not_change_a_byte() {
    let set = TrainingSet::whole(&study(false));
    let trainers: [&dyn Trainer; 2] = [&KernelRidge::nystroem(30), &NeuralNetwork { epochs: 5, ..quick_network() }];
    for trainer in trainers {
        let bytes = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let members = pool.install(|| bootstrap_members(trainer, &set, 3, 9)).unwrap();
            members.iter().map(|m| serde_json::to_string(m.regressor().unwrap()).unwrap()).collect::<Vec<_>>()
        };
        let one = bytes(1);
        assert_eq!(one, bytes(2), "{}", trainer.name());
        assert_ne!(one[0], one[1], "{}: members must differ", trainer.name());
    }
}

#[test]
fn seeds_matter_only_where_something_is_drawn() {
    let set = TrainingSet::whole(&study(false));
    let train = |seed| NeuralNetwork { epochs: 5, ..quick_network() }.train(&set, seed).unwrap().regressor().cloned();
    assert_eq!(train(1), train(1));
    assert_ne!(train(1), train(2));
}

#[test]
fn a_trainer_of_some_columns_takes_rows_of_all() {
    let samples = study(false);
    let set = TrainingSet::whole(&samples);
    let some = OnColumns {
        name: "some".into(),
        trainer: KernelRidge::nystroem(30),
        keep: |c: &Column| c.name != "c0" && c.name != "c7",
    };
    let model = some.train(&set, 1).unwrap();
    let before = model.predict(samples.features());
    let mut changed = samples.features().to_owned();
    changed.column_mut(0).fill(0.7);
    assert_eq!(model.predict(changed.view()), before);
    let portable = model.regressor().unwrap();
    assert_eq!(portable.inputs.len(), COLUMNS);
    assert_eq!(portable.predict_rows(changed.view()), before);
}

#[test]
fn the_best_single_metric_is_chosen_on_training_rows() {
    let mut samples = study(false);
    let features = samples.features().mapv(f64::abs);
    samples = Samples::new(samples.columns().to_vec(), samples.rows().to_vec(), features).unwrap();
    let set = TrainingSet::whole(&samples);
    let columns: Vec<String> = (0..DIFFERENCES).map(|i| format!("c{i}")).collect();
    for criterion in [Criterion::Srocc, Criterion::Plcc] {
        let best = BestOf { columns: columns.clone(), criterion }.choose(&set).unwrap();
        let alone = SingleMetric { column: best.column.clone() }.train(&set, 0).unwrap();
        assert!(best.column == "c0" || best.column == "c1", "{}", best.column);
        assert_eq!(alone.predict(samples.features()), best.predict(samples.features()));
    }
    let unknown = SingleMetric { column: "c99".into() }.train(&set, 0).err().unwrap();
    assert_eq!(unknown.to_string(), "c99: column c99 does not exist; the training set has 8 columns");
}

#[test]
fn trivial_baselines_know_the_method_alone() {
    let samples = study(false);
    let fold = &grouped_folds(&samples, 4, 0).unwrap()[0];
    let rows = fold.training.rows();
    let mean = |keep: &dyn Fn(&Row) -> bool| {
        let kept: Vec<f64> = rows.iter().filter(|r| keep(r)).map(|r| r.mos).collect();
        kept.iter().sum::<f64>() / kept.len() as f64
    };
    let probe = fold.held_out.rows()[0].clone();
    let stranger = Row { method: "unseen".into(), ..probe.clone() };
    let predicted = MeanOf::Method.fit(&fold.training).unwrap().predict(&[probe.clone(), stranger]);
    assert!((predicted[0] - mean(&|r| r.method == probe.method)).abs() < 1e-12);
    assert!((predicted[1] - mean(&|_| true)).abs() < 1e-12);
    let typed = MeanOf::MethodAndMaterialType.fit(&fold.training).unwrap().predict(std::slice::from_ref(&probe))[0];
    let expected = mean(&|r| r.method == probe.method && r.material_type == probe.material_type);
    assert!((typed - expected).abs() < 1e-12);
}

fn error(trainer: &dyn Trainer, samples: &Samples) -> TrainError {
    trainer.train(&TrainingSet::whole(samples), 0).err().unwrap()
}

#[test]
fn what_cannot_be_learned_is_refused() {
    let samples = study(false);
    let with = |change: &dyn Fn(&mut Row)| {
        let mut rows = samples.rows().to_vec();
        rows.iter_mut().for_each(change);
        Samples::new(samples.columns().to_vec(), rows, samples.features().to_owned()).unwrap()
    };
    let equal = with(&|r| r.mos = 3.0);
    let one_material = with(&|r| r.group = "m0".into());
    let few = samples.select_rows(&[0, 1, 6]);
    let context_only = samples.select_columns(|c| c.role == Role::Context);
    let mut trainers = exact_trainers();
    trainers.push(Box::new(SupportVectors::default()));
    for trainer in &trainers {
        let t = trainer.as_ref();
        assert!(matches!(error(t, &equal), TrainError::EqualRatings { rows: 240, .. }), "{}", t.name());
        assert!(matches!(error(t, &few), TrainError::TooFewRows { found: 3, .. }), "{}", t.name());
        assert!(matches!(error(t, &context_only), TrainError::NoDifference { .. }), "{}", t.name());
        assert!(matches!(error(t, &one_material), TrainError::Split { .. }), "{}", t.name());
    }
    let bad = [
        NeuralNetwork { members: 0, ..NeuralNetwork::default() },
        NeuralNetwork { hidden: vec![8, 0], ..NeuralNetwork::default() },
        NeuralNetwork { dropout: 1.0, ..NeuralNetwork::default() },
        NeuralNetwork { rate: f64::NAN, ..NeuralNetwork::default() },
    ];
    for options in bad {
        assert!(matches!(error(&options, &samples), TrainError::Option { .. }), "{options:?}");
    }
    let none = Average { name: "none".into(), trainers: vec![] };
    assert!(matches!(error(&none, &samples), TrainError::Option { .. }));
}
