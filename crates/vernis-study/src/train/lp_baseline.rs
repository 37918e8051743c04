//! Classical metrics as baselines: one column, mapped to mean opinion scores by a logistic curve.
//!
//! `SingleMetric` maps a named column; `BestOf` first picks the column that agrees best *on the training rows*, which
//! is what choosing "the best of 36 variants" honestly means: picked on all rows, the choice would leak the held-out
//! ratings. Source of the map: [`Logistic4`]. Cost: a rank correlation and one logistic fit a column.

use super::{Predictor, TrainError, Trainer, Unmapped, check_set};
use crate::samples::split::TrainingSet;
use ndarray::ArrayView2;
use vernis_metric::math::correlation::{pearson, spearman};
use vernis_metric::math::logistic::Logistic4;

const NEEDED_ROWS: usize = 4;

/// One column and a logistic curve fitted on the training rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SingleMetric {
    /// Name of the column, such as `lp.D9.Cl`.
    pub column: String,
}

/// What a choice among columns maximises, in absolute value, on the training rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Criterion {
    /// Spearman's rank correlation.
    Srocc,
    /// Pearson's correlation after the logistic curve.
    Plcc,
}

/// The best of several columns, chosen and mapped on the training rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BestOf {
    /// Names of the columns to choose from.
    pub columns: Vec<String>,
    /// What the choice maximises.
    pub criterion: Criterion,
}

/// A column and its map.
#[derive(Debug, Clone, PartialEq)]
pub struct MappedColumn {
    /// Name of the column.
    pub column: String,
    /// Its place among the columns.
    pub index: usize,
    /// From its values to mean opinion scores.
    pub map: Logistic4,
}

impl Predictor for MappedColumn {
    fn predict(&self, features: ArrayView2<'_, f64>) -> Vec<f64> {
        features.column(self.index).iter().map(|&x| self.map.predict(x)).collect()
    }

    fn unmapped(&self, features: ArrayView2<'_, f64>) -> Option<Unmapped> {
        let values = features.column(self.index).iter().map(|x| -x).collect();
        Some(Unmapped { column: self.column.clone(), values })
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
                Criterion::Srocc => spearman(&x, &mos),
                Criterion::Plcc => pearson(&mapped.predict(set.features()), &mos),
            };
            // A column that is the same in every row says nothing.
            let agreement = agreement.map_or(0.0, f64::abs);
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
