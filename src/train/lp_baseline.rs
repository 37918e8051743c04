//! Classical metrics as baselines: one column, mapped to mean opinion scores by a logistic curve.
//!
//! `SingleMetric` maps a named column; `BestOf` first picks the column that agrees best *on the training rows*, which
//! is what choosing "the best of 36 variants" honestly means: picked on all rows, the choice would leak the held-out
//! ratings. Source of the map: [`Logistic4`]. Cost: a rank correlation and one logistic fit a column.

use super::{Predictor, TrainError, Trainer, check_set};
use crate::dataset::split::TrainingSet;
use crate::math::logistic::Logistic4;
use ndarray::ArrayView2;

const NEEDED_ROWS: usize = 4;

/// One column and a logistic curve fitted on the training rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SingleMetric {
    /// Name of the column, such as `lp.D9.Cl`.
    pub column: String,
}

/// What a choice among columns maximises, in absolute value, on the training rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Criterion {
    /// Spearman's rank correlation.
    Srocc,
    /// Pearson's correlation after the logistic curve.
    Plcc,
}

/// The best of several columns, chosen and mapped on the training rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BestOf {
    pub columns: Vec<String>,
    pub criterion: Criterion,
}

/// A column and its map.
#[derive(Debug, Clone, PartialEq)]
pub struct MappedColumn {
    pub column: String,
    pub index: usize,
    pub map: Logistic4,
}

impl Predictor for MappedColumn {
    fn predict(&self, features: ArrayView2<'_, f64>) -> Vec<f64> {
        features.column(self.index).iter().map(|&x| self.map.predict(x)).collect()
    }
}

impl Trainer for SingleMetric {
    fn name(&self) -> &str {
        &self.column
    }

    fn train(&self, set: &TrainingSet, _seed: u64) -> Result<Box<dyn Predictor>, TrainError> {
        check_set(self.name(), set, NEEDED_ROWS)?;
        Ok(Box::new(fit(self.name(), set, &self.column)?))
    }
}

impl BestOf {
    /// The chosen column and its map.
    pub fn choose(&self, set: &TrainingSet) -> Result<MappedColumn, TrainError> {
        check_set(self.name(), set, NEEDED_ROWS)?;
        let mos = set.mos();
        let mut best: Option<(f64, MappedColumn)> = None;
        for column in &self.columns {
            let mapped = fit(self.name(), set, column)?;
            let x: Vec<f64> = set.features().column(mapped.index).to_vec();
            let agreement = match self.criterion {
                Criterion::Srocc => spearman(&x, &mos).abs(),
                Criterion::Plcc => pearson(&mapped.predict(set.features()), &mos).abs(),
            };
            // Earlier columns win ties.
            if best.as_ref().is_none_or(|b| agreement > b.0) {
                best = Some((agreement, mapped));
            }
        }
        best.map(|b| b.1).ok_or_else(|| TrainError::NoDifference { trainer: self.name().to_owned() })
    }
}

impl Trainer for BestOf {
    fn name(&self) -> &str {
        match self.criterion {
            Criterion::Srocc => "best-single-by-srocc",
            Criterion::Plcc => "best-single-by-plcc",
        }
    }

    fn train(&self, set: &TrainingSet, _seed: u64) -> Result<Box<dyn Predictor>, TrainError> {
        Ok(Box::new(self.choose(set)?))
    }
}

fn fit(trainer: &str, set: &TrainingSet, column: &str) -> Result<MappedColumn, TrainError> {
    let index = set.columns().iter().position(|c| c.name == column).ok_or_else(|| TrainError::UnknownColumn {
        trainer: trainer.to_owned(),
        column: column.to_owned(),
        available: set.columns().len(),
    })?;
    let map = Logistic4::fit(&set.features().column(index).to_vec(), &set.mos())
        .map_err(|source| TrainError::Logistic { trainer: trainer.to_owned(), column: column.to_owned(), source })?;
    Ok(MappedColumn { column: column.to_owned(), index, map })
}

fn pearson(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len() as f64;
    let (mean_x, mean_y) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for (x, y) in x.iter().zip(y) {
        xx += (x - mean_x).powi(2);
        yy += (y - mean_y).powi(2);
        xy += (x - mean_x) * (y - mean_y);
    }
    if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
}

/// Pearson's correlation of mid-ranks.
fn spearman(x: &[f64], y: &[f64]) -> f64 {
    pearson(&ranks(x), &ranks(y))
}

fn ranks(x: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..x.len()).collect();
    order.sort_by(|&a, &b| x[a].total_cmp(&x[b]));
    let mut ranks = vec![0.0; x.len()];
    for tied in order.chunk_by(|&a, &b| x[a] == x[b]) {
        let smaller = order.partition_point(|&i| x[i] < x[tied[0]]);
        for &i in tied {
            ranks[i] = smaller as f64 + (tied.len() - 1) as f64 / 2.0;
        }
    }
    ranks
}
