//! Elastic net on the differences: the linear baseline, exact for identical BRDFs.
//!
//! With z and z0 the standardised features of a row and of its reference against itself,
//!
//!   mos = identity + w.(z - z0),
//!   w = argmin 1/(2n) sum_i v_i (mos_i - identity - w.(z_i - z0_i))^2 + penalty (r |w|_1 + (1 - r)/2 |w|_2^2)
//!
//! Context features cancel in z - z0, so only differences have weights. r = 0 is ridge regression. The row weights v
//! (mean 1) enter by scaling rows by sqrt(v); the penalty minimises the weighted squared error over inner folds.
//! Source: Zou & Hastie (2005), doi:10.1111/j.1467-9868.2005.00503.x, solved by `linfa-elasticnet`'s coordinate descent,
//! and r = 0 directly. Cost: milliseconds for ridge, about a second for the elastic net.

use super::standardize::Standardized;
use super::{INNER_FOLDS, Predictor, TrainError, Trainer, check_set};
use crate::samples::split::TrainingSet;
use linfa::Dataset;
use linfa::traits::Fit;
use linfa_elasticnet::ElasticNet as Solver;
use ndarray::{Array1, Array2, Axis};
use vernis_metric::math::cholesky::solve;
use vernis_metric::metric::learned::{Function, Regressor, Term};

const NEEDED_ROWS: usize = 8;

/// Options of the elastic net.
#[derive(Debug, Clone, PartialEq)]
pub struct ElasticNet {
    /// Candidates; inner folds choose.
    pub penalties: Vec<f64>,
    /// Share r of the absolute penalty, 0 (ridge) to 1 (lasso).
    pub l1_ratio: f64,
}

impl ElasticNet {
    /// Ridge regression: the squared penalty alone, in six strengths to choose from.
    pub fn ridge() -> Self {
        Self { penalties: vec![0.003, 0.01, 0.03, 0.1, 0.3, 1.0], l1_ratio: 0.0 }
    }

    /// Half absolute and half squared penalty, in two strengths to choose from.
    pub fn mixed() -> Self {
        Self { penalties: vec![0.01, 0.03], l1_ratio: 0.5 }
    }
}

impl Trainer for ElasticNet {
    fn name(&self) -> &str {
        if self.l1_ratio == 0.0 { "ridge" } else { "elastic-net" }
    }

    fn train(&self, set: &TrainingSet, seed: u64) -> Result<Box<dyn Predictor>, TrainError> {
        let trainer = || self.name().to_owned();
        check_set(self.name(), set, NEEDED_ROWS)?;
        let data = Standardized::fit(self.name(), set)?;
        let weights = set.weights();
        let mean = weights.iter().sum::<f64>() / weights.len() as f64;
        let root: Array1<f64> = weights.iter().map(|w| (w / mean).sqrt()).collect();
        let x = (&data.z - &data.z0) * root.view().insert_axis(Axis(1));
        let y: Array1<f64> = set.mos().iter().zip(&root).map(|(m, r)| (m - set.identical()) * r).collect();

        let folds =
            set.inner_folds(INNER_FOLDS, seed).map_err(|source| TrainError::Split { trainer: trainer(), source })?;
        let mut best: Option<(f64, f64)> = None;
        for &penalty in &self.penalties {
            let mut error = 0.0;
            for fold in &folds {
                let held = fold.held_out.indices();
                let rest: Vec<usize> = (0..y.len()).filter(|i| !held.contains(i)).collect();
                let w = self.solve(x.select(Axis(0), &rest), y.select(Axis(0), &rest), penalty)?;
                error += held.iter().map(|&i| (y[i] - x.row(i).dot(&w)).powi(2)).sum::<f64>();
            }
            if best.is_none_or(|b| error < b.0) {
                best = Some((error, penalty));
            }
        }
        let Some((_, penalty)) = best else {
            return Err(TrainError::Option {
                trainer: trainer(),
                what: "the number of penalties",
                value: 0.0,
                allowed: "at least 1",
            });
        };
        let regressor = Regressor {
            identity_mos: set.identical(),
            inputs: data.inputs,
            terms: vec![Term {
                weight: 1.0,
                standardizer: data.standardizer,
                function: Function::Linear { weights: self.solve(x, y, penalty)?.to_vec() },
            }],
        };
        regressor.check().map_err(|source| TrainError::Regressor { trainer: trainer(), source })?;
        Ok(Box::new(regressor))
    }
}

impl ElasticNet {
    fn solve(&self, x: Array2<f64>, y: Array1<f64>, penalty: f64) -> Result<Array1<f64>, TrainError> {
        let trainer = || self.name().to_owned();
        if self.l1_ratio == 0.0 {
            // Coordinate descent stops by a duality gap that the absolute penalty defines: without it, never.
            let (n, size) = (y.len() as f64, x.ncols());
            let right = x.t().dot(&y).to_vec();
            return solve(x.t().dot(&x).view(), n * penalty, &right)
                .map(Array1::from_vec)
                .ok_or_else(|| TrainError::Singular { trainer: trainer(), what: "ridge regression", size });
        }
        Solver::params()
            .penalty(penalty)
            .l1_ratio(self.l1_ratio)
            .with_intercept(false)
            .max_iterations(2_000)
            .fit(&Dataset::new(x, y))
            .map(|model| model.hyperplane().clone())
            .map_err(|e| TrainError::Solver { trainer: trainer(), reason: e.to_string() })
    }
}
