//! Support-vector regression with a Gaussian kernel: the usual kernel baseline of learned quality metrics.
//!
//!   mos(z) = sum_i a_i exp(-|z - z_i|^2 / (s d)) + b,   |a_i| <= C,   no penalty for errors below epsilon
//!
//! (d features). Not exact for identical BRDFs, unlike the other trainers, and row weights are not used: it is the
//! textbook method (Smola & Schoelkopf 2004, doi:10.1023/B:STCO.0000035301.49549.88, eq. 2 to 13), solved by
//! `linfa-svm`. s and C minimise the squared error over inner folds. Cost: about a second for 450 rows.

use super::standardize::{Standardized, apply_rows};
use super::{INNER_FOLDS, Predictor, TrainError, Trainer, check_set};
use crate::samples::split::TrainingSet;
use linfa::Dataset;
use linfa::traits::{Fit, Predict};
use linfa_svm::Svm;
use ndarray::{Array1, Array2, ArrayView2, Axis};
use vernis_metric::metric::learned::Standardizer;

const NEEDED_ROWS: usize = 8;

/// Options of support-vector regression.
#[derive(Debug, Clone, PartialEq)]
pub struct SupportVectors {
    /// Candidates for C; inner folds choose.
    pub costs: Vec<f64>,
    /// Candidates for s; inner folds choose.
    pub widths: Vec<f64>,
    /// Errors that cost nothing, in MOS.
    pub epsilon: f64,
}

impl Default for SupportVectors {
    fn default() -> Self {
        Self { costs: vec![1.0, 4.0], widths: vec![2.0, 8.0], epsilon: 0.1 }
    }
}

struct Fitted {
    standardizer: Standardizer,
    mean: f64,
    model: Svm<f64, f64>,
}

impl Predictor for Fitted {
    fn predict(&self, features: ArrayView2<'_, f64>) -> Vec<f64> {
        let predicted: Array1<f64> = self.model.predict(&apply_rows(&self.standardizer, features, None));
        predicted.iter().map(|p| p + self.mean).collect()
    }
}

impl Trainer for SupportVectors {
    fn name(&self) -> &str {
        "support-vector"
    }

    fn train(&self, set: &TrainingSet, seed: u64) -> Result<Box<dyn Predictor>, TrainError> {
        let trainer = || self.name().to_owned();
        check_set(self.name(), set, NEEDED_ROWS)?;
        let data = Standardized::fit(self.name(), set)?;
        let mos = set.mos();
        let mean = mos.iter().sum::<f64>() / mos.len() as f64;
        let y: Array1<f64> = mos.iter().map(|m| m - mean).collect();
        let folds =
            set.inner_folds(INNER_FOLDS, seed).map_err(|source| TrainError::Split { trainer: trainer(), source })?;
        let mut best: Option<(f64, f64, f64)> = None;
        for (&cost, &width) in self.costs.iter().flat_map(|c| self.widths.iter().map(move |w| (c, w))) {
            let mut error = 0.0;
            for fold in &folds {
                let held = fold.held_out.indices();
                let rest: Vec<usize> = (0..y.len()).filter(|i| !held.contains(i)).collect();
                let model = self.solve(data.z.select(Axis(0), &rest), y.select(Axis(0), &rest), cost, width)?;
                let predicted: Array1<f64> = model.predict(&data.z.select(Axis(0), held));
                error += held.iter().zip(&predicted).map(|(&i, p)| (y[i] - p).powi(2)).sum::<f64>();
            }
            if best.is_none_or(|b| error < b.0) {
                best = Some((error, cost, width));
            }
        }
        let Some((_, cost, width)) = best else {
            return Err(TrainError::Solver { trainer: trainer(), reason: "no cost or no width to choose from".into() });
        };
        let model = self.solve(data.z, y, cost, width)?;
        Ok(Box::new(Fitted { standardizer: data.standardizer, mean, model }))
    }
}

impl SupportVectors {
    fn solve(&self, z: Array2<f64>, y: Array1<f64>, cost: f64, width: f64) -> Result<Svm<f64, f64>, TrainError> {
        let scale = width * z.ncols() as f64;
        Svm::<f64, f64>::params()
            .gaussian_kernel(scale)
            .c_svr(cost, Some(self.epsilon))
            .eps(1e-3)
            .fit(&Dataset::new(z, y))
            .map_err(|e| TrainError::Solver { trainer: self.name().to_owned(), reason: e.to_string() })
    }
}
