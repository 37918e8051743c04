//! Baselines that know nothing of appearance: who made the approximation, and of which kind of material.
//!
//! The prediction is the mean rating, over the training rows, of the same method, or of the same method on the same
//! type of material (dielectric, metal). A metric that does not beat this has learned nothing about appearance.
//!
//! These look at what a row belongs to, not at its descriptors, so they are no [`Trainer`](super::Trainer).

use super::{TrainError, check_set};
use crate::dataset::Row;
use crate::samples::split::TrainingSet;
use std::collections::BTreeMap;

/// What rows share that get one prediction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum MeanOf {
    /// The approximation method.
    Method,
    /// The approximation method and the type of material.
    MethodAndMaterialType,
}

/// Mean ratings by key.
#[derive(Debug, Clone, PartialEq)]
pub struct MeanTable {
    of: MeanOf,
    means: BTreeMap<(String, Option<String>), f64>,
    overall: f64,
}

impl MeanOf {
    /// The name that benchmarks use, such as `mean-of-method`.
    pub fn name(self) -> &'static str {
        match self {
            MeanOf::Method => "mean-of-method",
            MeanOf::MethodAndMaterialType => "mean-of-method-and-material-type",
        }
    }

    fn key(self, row: &Row) -> (String, Option<String>) {
        match self {
            MeanOf::Method => (row.method.clone(), None),
            MeanOf::MethodAndMaterialType => (row.method.clone(), row.material_type.clone()),
        }
    }

    /// Weighted means over the training rows.
    pub fn fit(self, set: &TrainingSet) -> Result<MeanTable, TrainError> {
        check_set(self.name(), set, 1)?;
        let mut sums: BTreeMap<(String, Option<String>), (f64, f64)> = BTreeMap::new();
        let (mut sum, mut total) = (0.0, 0.0);
        for row in set.rows() {
            let entry = sums.entry(self.key(row)).or_default();
            entry.0 += row.weight * row.mos;
            entry.1 += row.weight;
            sum += row.weight * row.mos;
            total += row.weight;
        }
        Ok(MeanTable {
            of: self,
            means: sums.into_iter().map(|(key, (sum, weight))| (key, sum / weight)).collect(),
            overall: sum / total,
        })
    }
}

impl MeanTable {
    /// One score a row; a method never seen in training gets the mean of all training rows, which is all that this
    /// baseline can know of it. The rows' own ratings are not read.
    pub fn predict(&self, rows: &[Row]) -> Vec<f64> {
        rows.iter().map(|row| self.means.get(&self.of.key(row)).copied().unwrap_or(self.overall)).collect()
    }
}
