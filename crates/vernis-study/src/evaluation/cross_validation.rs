//! Predictions for rows that a metric has not seen.
//!
//! Each fold trains on its training side and predicts its held-out side; every row is held out exactly once. What is
//! trained predicts a MOS itself, the map having been learned with the rest. For a classical metric the 4-parameter
//! logistic from distance to MOS is fitted on the distances of the training side. A distance that is constant over the
//! training rows says nothing, and the mean of their ratings is its best map.
//! A model that only chooses a column and maps it also tells the column's own values: one column in every fold has a raw
//! correlation over all rows, several have it fold by fold alone, for their units do not go together.
//! Folds run in parallel; each has its own seed, so that neither their order nor the number of threads matters.

use super::EvaluationError;
use super::agreement::{Predictions, Raw};
use crate::samples::Samples;
use crate::samples::split::Fold;
use crate::train::ensemble::bootstrap_members;
use crate::train::trivial::MeanOf;
use crate::train::{TrainError, Trainer, Unmapped};
use ndarray::ArrayView1;
use rand::Rng;
use serde::{Deserialize, Serialize};
use vernis_metric::math::correlation;
use vernis_metric::math::logistic::{Logistic4, LogisticError};
use vernis_metric::math::parallel;
use vernis_metric::math::seed;

/// What a metric says of every row without having seen it.
#[derive(Debug, Clone)]
pub struct OutOfFold {
    /// Score and MOS of every row, predicted by the fold that held it out.
    pub predictions: Predictions,
    /// How each fold agrees on its own.
    pub folds: Vec<FoldRecord>,
}

/// One fold on its own. Correlations are `None` where ratings or predictions of the fold are all equal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoldRecord {
    /// Index of the fold, from 0.
    pub fold: usize,
    /// Rows that the fold trained on.
    pub training_rows: usize,
    /// Rows that the fold predicted.
    pub held_out_rows: usize,
    /// After the logistic.
    pub plcc: Option<f64>,
    /// Spearman's rho of score and MOS.
    pub srocc: Option<f64>,
    /// In MOS.
    pub rmse: f64,
    /// Pearson's r of the metric's own values, unmapped, and the MOS; `None` too in records of before it was kept.
    #[serde(default)]
    pub plcc_raw: Option<f64>,
    /// The column that was chosen on the training side of the fold, where one was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chosen: Option<String>,
}

/// Scores and MOS of one fold's held-out rows, in their order.
#[derive(Clone)]
pub(super) struct FoldPredictions {
    score: Vec<f64>,
    mos: Vec<f64>,
    /// Of a model that only mapped a column.
    unmapped: Option<Unmapped>,
}

impl FoldPredictions {
    /// Of scores that are MOS already.
    pub(super) fn direct(score: Vec<f64>) -> Self {
        Self { mos: score.iter().map(|s| s.clamp(1.0, 5.0)).collect(), score, unmapped: None }
    }
}

/// What a fold says of its held-out rows.
pub(super) enum FoldScores {
    /// Mean opinion scores, and the column that they were mapped from where that is all that the model does.
    Mos(Vec<f64>, Option<Unmapped>),
    /// Scores without a scale: those of the training rows, to fit the map on, and those of the held-out rows.
    ToMap(Vec<f64>, Vec<f64>),
}

/// Trains on each fold and predicts what it holds out.
pub fn cross_validate(
    samples: &Samples,
    folds: &[Fold],
    trainer: &dyn Trainer,
    seed: u64,
) -> Result<OutOfFold, EvaluationError> {
    run_folds(trainer.name(), samples, folds, |index, fold| {
        let predictor = trainer.train(&fold.training, fold_seed(seed, index))?;
        let features = fold.held_out.features();
        Ok(FoldScores::Mos(predictor.predict(features), predictor.unmapped(features)))
    })
}

/// A classical metric, whose distances stand in the column called `name` (larger is worse) and need no training: only
/// the logistic map is fitted, on each fold's training side, and the score of a row is its negated distance.
pub fn cross_validate_distance(samples: &Samples, folds: &[Fold], name: &str) -> Result<OutOfFold, EvaluationError> {
    let column = column_index(samples, name)?;
    let negated = |distances: ArrayView1<'_, f64>| distances.iter().map(|d| -d).collect::<Vec<f64>>();
    run_folds(name, samples, folds, |_, fold| {
        let (training, held_out) = (fold.training.features(), fold.held_out.features());
        Ok(FoldScores::ToMap(negated(training.column(column)), negated(held_out.column(column))))
    })
}

/// The baselines that know what a row belongs to and nothing of its appearance.
pub fn cross_validate_mean(samples: &Samples, folds: &[Fold], of: MeanOf) -> Result<OutOfFold, EvaluationError> {
    run_folds(of.name(), samples, folds, |_, fold| {
        let means = of.fit(&fold.training)?;
        Ok(FoldScores::Mos(means.predict(fold.held_out.rows()), None))
    })
}

/// Scores in MOS that are known for every row, as a mean of other contenders' is, put into the record of `folds`.
pub fn cross_validate_scores(
    name: &str,
    samples: &Samples,
    folds: &[Fold],
    scores: &[f64],
) -> Result<OutOfFold, EvaluationError> {
    run_folds(name, samples, folds, |_, fold| {
        Ok(FoldScores::Mos(fold.held_out.indices().iter().map(|&row| scores[row]).collect(), None))
    })
}

/// Standard deviation of the predictions of `members` models, each trained on resampled material groups of a fold's
/// training side, for every row, in MOS; 0 for fewer than two members.
pub fn cross_validate_spread(
    samples: &Samples,
    folds: &[Fold],
    trainer: &dyn Trainer,
    members: usize,
    seed: u64,
) -> Result<Vec<f64>, EvaluationError> {
    check_coverage(samples, folds)?;
    let mut spread = vec![0.0; samples.len()];
    for (index, fold) in folds.iter().enumerate() {
        let models = bootstrap_members(trainer, &fold.training, members, fold_seed(seed, index))
            .map_err(|source| training_error(trainer.name(), index, fold, source))?;
        let predicted: Vec<Vec<f64>> = models.iter().map(|m| m.predict(fold.held_out.features())).collect();
        for (k, &row) in fold.held_out.indices().iter().enumerate() {
            let mean = predicted.iter().map(|p| p[k]).sum::<f64>() / members as f64;
            let squares: f64 = predicted.iter().map(|p| (p[k] - mean).powi(2)).sum();
            spread[row] = if members < 2 { 0.0 } else { (squares / (members - 1) as f64).sqrt() };
        }
    }
    Ok(spread)
}

pub(super) fn fold_seed(seed: u64, index: usize) -> u64 {
    seed::stream(seed, "cross-validation", index as u64).random()
}

pub(super) fn training_error(metric: &str, fold: usize, of: &Fold, source: TrainError) -> EvaluationError {
    EvaluationError::Training {
        metric: metric.to_owned(),
        fold,
        training_rows: of.training.rows().len(),
        source: Box::new(source),
    }
}

/// Scores of the held-out rows by `predict`: as they are, or mapped to MOS.
pub(super) fn run_folds(
    name: &str,
    samples: &Samples,
    folds: &[Fold],
    predict: impl Fn(usize, &Fold) -> Result<FoldScores, TrainError> + Sync,
) -> Result<OutOfFold, EvaluationError> {
    check_coverage(samples, folds)?;
    let run = |index: usize| {
        let fold = &folds[index];
        match predict(index, fold).map_err(|source| training_error(name, index, fold, source))? {
            FoldScores::ToMap(training, score) => map_fold(name, index, &training, &fold.training.mos(), score),
            FoldScores::Mos(score, unmapped) => Ok(FoldPredictions { unmapped, ..FoldPredictions::direct(score) }),
        }
    };
    assemble(name, samples, folds, parallel::try_map(folds.len(), run)?)
}

/// The distances of the column called `name` with the logistic map fitted on the very rows that are judged, as the
/// literature reports them.
pub fn in_sample(samples: &Samples, name: &str) -> Result<Predictions, EvaluationError> {
    let score: Vec<f64> = samples.column(column_index(samples, name)?).iter().map(|d| -d).collect();
    let mos: Vec<f64> = samples.rows().iter().map(|r| r.mos).collect();
    let mapped = map_fold(name, 0, &score, &mos, score.clone())?;
    Ok(Predictions::new(mapped.score, mapped.mos))
}

fn column_index(samples: &Samples, name: &str) -> Result<usize, EvaluationError> {
    samples
        .columns()
        .iter()
        .position(|c| c.name == name)
        .ok_or_else(|| EvaluationError::UnknownColumn { name: name.to_owned(), columns: samples.columns().len() })
}

fn check_coverage(samples: &Samples, folds: &[Fold]) -> Result<(), EvaluationError> {
    let mut times = vec![0; samples.len()];
    for &row in folds.iter().flat_map(|fold| fold.held_out.indices()) {
        let found = times.get_mut(row).ok_or(EvaluationError::Lengths {
            what: "rows of the samples that the folds split",
            found: samples.len(),
            expected: row + 1,
        })?;
        *found += 1;
    }
    match times.iter().position(|&t| t != 1) {
        None => Ok(()),
        Some(row) => Err(EvaluationError::Coverage {
            row,
            material: samples.rows()[row].material.clone(),
            method: samples.rows()[row].method.clone(),
            times: times[row],
        }),
    }
}

/// Maps held-out scores to MOS by what the training scores say.
fn map_fold(
    metric: &str,
    fold: usize,
    training_score: &[f64],
    training_mos: &[f64],
    score: Vec<f64>,
) -> Result<FoldPredictions, EvaluationError> {
    let mos = match Logistic4::fit(training_score, training_mos) {
        Ok(curve) => score.iter().map(|&s| curve.predict(s)).collect(),
        Err(LogisticError::Constant { what: "x", .. }) => {
            let mean = training_mos.iter().sum::<f64>() / training_mos.len() as f64;
            vec![mean; score.len()]
        }
        Err(source) => return Err(EvaluationError::Logistic { metric: metric.to_owned(), fold, source }),
    };
    Ok(FoldPredictions { score, mos, unmapped: None })
}

pub(super) fn assemble(
    name: &str,
    samples: &Samples,
    folds: &[Fold],
    predicted: Vec<FoldPredictions>,
) -> Result<OutOfFold, EvaluationError> {
    let missing = vec![f64::NAN; samples.len()];
    let mut predictions =
        Predictions { fold: vec![0; samples.len()], ..Predictions::new(missing.clone(), missing.clone()) };
    predictions.raw = match chosen(&predicted) {
        Chosen::Nothing => Raw::Score,
        Chosen::One => Raw::Values(missing),
        Chosen::Several => Raw::Mixed,
    };
    let mut records = Vec::with_capacity(folds.len());
    for (index, (fold, found)) in folds.iter().zip(predicted).enumerate() {
        let held_out = &fold.held_out;
        if found.score.len() != held_out.indices().len() {
            let (what, expected) = ("predictions of a fold", held_out.indices().len());
            return Err(EvaluationError::Lengths { what, found: found.score.len(), expected });
        }
        if let (Raw::Values(values), Some(unmapped)) = (&mut predictions.raw, &found.unmapped) {
            held_out.indices().iter().zip(&unmapped.values).for_each(|(&row, &value)| values[row] = value);
        }
        for ((&row, &score), &mos) in held_out.indices().iter().zip(&found.score).zip(&found.mos) {
            if !(score.is_finite() && mos.is_finite()) {
                return Err(EvaluationError::NotFinite { metric: name.to_owned(), row, value: score });
            }
            predictions.score[row] = score;
            predictions.mos[row] = mos;
            predictions.fold[row] = index;
        }
        let rated: Vec<f64> = held_out.rows().iter().map(|r| r.mos).collect();
        let squares: f64 = found.mos.iter().zip(&rated).map(|(p, m)| (p - m) * (p - m)).sum();
        records.push(FoldRecord {
            fold: index,
            training_rows: fold.training.rows().len(),
            held_out_rows: rated.len(),
            plcc: correlation::pearson(&found.mos, &rated).ok(),
            srocc: correlation::spearman(&found.score, &rated).ok(),
            rmse: (squares / rated.len() as f64).sqrt(),
            plcc_raw: correlation::pearson(found.unmapped.as_ref().map_or(&found.score, |u| &u.values), &rated).ok(),
            chosen: found.unmapped.map(|unmapped| unmapped.column),
        });
    }
    Ok(OutOfFold { predictions, folds: records })
}

/// How many columns the folds chose.
enum Chosen {
    Nothing,
    One,
    Several,
}

fn chosen(predicted: &[FoldPredictions]) -> Chosen {
    let columns: Vec<Option<&str>> =
        predicted.iter().map(|fold| fold.unmapped.as_ref().map(|u| u.column.as_str())).collect();
    match columns.first() {
        Some(Some(first)) if columns.iter().all(|c| c == &Some(*first)) => Chosen::One,
        _ if columns.iter().all(Option::is_none) => Chosen::Nothing,
        _ => Chosen::Several,
    }
}
