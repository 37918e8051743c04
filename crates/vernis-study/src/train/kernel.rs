//! Kernel ridge regression that is exact for identical BRDFs, in full and with few landmarks.
//!
//! With a = (f, c) a row's standardised differences and context, and a0 = (0, c),
//!
//!   k(a, b)  = phi(|a - b| / (l sqrt d)) + s a.b / d     (d features, s = 0.2, phi one of `Radial`)
//!   k'(a, b) = k(a, b) - k(a0, b) - k(a, b0) + k(a0, b0)
//!   mos(a)   = identity + sum_m w_m k'(a, a_m).
//!
//! k' is the kernel of the functions that vanish at f = 0 for every c, so the identity holds by construction. The
//! weights minimise sum_i v_i (mos_i - mos(a_i))^2 + ridge |mos - identity|_k'^2, v_i the rows' training weights.
//!
//! Solved through the pivoted Cholesky factor K' ~ F F^T: all rows as pivots give kernel ridge regression itself; few
//! give its Nystroem approximation (Williams & Seeger 2001), with pivots drawn by what is left of the diagonal (Chen,
//! Epperly, Tropp & Webber 2025, doi:10.1002/cpa.22234, algorithm 2.1). Far fewer weights than ratings are then stored,
//! so that no single rating can be solved for. phi, l and ridge minimise the weighted squared error over inner folds
//! by material; the landmarks depend on descriptors alone. Few landmarks carry a smooth kernel further than a rough
//! one, so the two forms have different candidates.
//!
//! Source: Saunders, Gammerman & Vovk (1998), "Ridge regression learning algorithm in dual variables", ICML; centring
//! at a point as in Schoelkopf (2001), "The kernel trick for distances", eq. 14. Cost: about 20 n r^2 for n rows and
//! r pivots.

use super::landmarks::LowRank;
use super::standardize::Standardized;
use super::{INNER_FOLDS, Predictor, TrainError, Trainer, check_set};
use crate::samples::split::{Fold, TrainingSet};
use ndarray::{Array2, ArrayView2, Axis};
use vernis_metric::math::cholesky::solve;
use vernis_metric::math::seed;
use vernis_metric::metric::learned::{Function, Kernel, Radial, Regressor, Term};

/// Of the largest diagonal element of K': rows explained better than this add nothing.
const TOLERANCE: f64 = 1e-7;
const NEEDED_ROWS: usize = 8;
/// Weight s of the linear part of the kernels.
const LINEAR: f64 = 0.2;

/// Options of kernel ridge regression.
#[derive(Debug, Clone, PartialEq)]
pub struct KernelRidge {
    /// Candidates; inner folds choose.
    pub kernels: Vec<Kernel>,
    /// Candidates for the ridge; inner folds choose.
    pub ridges: Vec<f64>,
    /// Number of landmarks, or all rows.
    pub landmarks: Option<usize>,
}

impl KernelRidge {
    /// Every training row is a landmark: the best agreement, and not for export, since as many weights as ratings are
    /// stored.
    pub fn full() -> Self {
        let kernel = |length| Kernel { radial: Radial::Exponential, length, linear: LINEAR };
        Self { kernels: vec![kernel(1.0), kernel(3.0)], ridges: vec![0.03, 0.1, 0.3], landmarks: None }
    }

    /// Few landmarks: what an exported metric holds.
    pub fn nystroem(landmarks: usize) -> Self {
        let kernel = |radial, length| Kernel { radial, length, linear: LINEAR };
        Self {
            kernels: vec![kernel(Radial::Matern32, 1.7), kernel(Radial::Gaussian, 1.0)],
            ridges: vec![0.03, 0.1, 0.3],
            landmarks: Some(landmarks),
        }
    }
}

impl Trainer for KernelRidge {
    fn name(&self) -> &str {
        if self.landmarks.is_some() { "nystroem-ridge" } else { "kernel-ridge" }
    }

    fn train(&self, set: &TrainingSet, seed: u64) -> Result<Box<dyn Predictor>, TrainError> {
        let trainer = || self.name().to_owned();
        check_set(self.name(), set, NEEDED_ROWS)?;
        self.check()?;
        let data = Standardized::fit(self.name(), set)?;
        let folds =
            set.inner_folds(INNER_FOLDS, seed).map_err(|source| TrainError::Split { trainer: trainer(), source })?;
        let distances = Distances::new(&data.z, &data.z0);
        let target: Vec<f64> = set.mos().iter().map(|m| m - set.identical()).collect();
        let weights = set.weights();

        let mut best: Option<(f64, Kernel, f64, Problem)> = None;
        for (index, &kernel) in self.kernels.iter().enumerate() {
            let rank = self.landmarks.unwrap_or(target.len());
            let mut rng = seed::stream(seed, "landmarks", index as u64);
            let low_rank = LowRank::new(distances.centred(&kernel).view(), rank, TOLERANCE, &mut rng);
            let problem = Problem::new(low_rank, &target, &weights);
            let errors = problem.fold_errors(&folds, &self.ridges).ok_or_else(|| self.singular(&problem))?;
            for (&ridge, error) in self.ridges.iter().zip(errors) {
                if best.as_ref().is_none_or(|b| error < b.0) {
                    best = Some((error, kernel, ridge, problem.clone()));
                }
            }
        }
        let Some((_, kernel, ridge, problem)) = best else {
            return Err(TrainError::Solver {
                trainer: trainer(),
                reason: "no finite error over the inner folds".into(),
            });
        };
        let coefficients = problem.solve(ridge, None).ok_or_else(|| self.singular(&problem))?;
        let regressor = Regressor {
            identity_mos: set.identical(),
            terms: vec![Term {
                weight: 1.0,
                function: Function::Kernel {
                    kernel,
                    weights: problem.low_rank.pivot_weights(&coefficients),
                    landmarks: problem.low_rank.pivots.iter().flat_map(|&p| data.z.row(p).to_vec()).collect(),
                },
                standardizer: data.standardizer,
            }],
            inputs: data.inputs,
        };
        regressor.check().map_err(|source| TrainError::Regressor { trainer: trainer(), source })?;
        Ok(Box::new(regressor))
    }
}

impl KernelRidge {
    fn check(&self) -> Result<(), TrainError> {
        let option =
            |what, value, allowed| Err(TrainError::Option { trainer: self.name().into(), what, value, allowed });
        let lengths: Vec<f64> = self.kernels.iter().map(|k| k.length).collect();
        for (what, values) in [("a kernel length", &lengths), ("a ridge", &self.ridges)] {
            if let Some(&value) = values.iter().find(|v| !(**v > 0.0 && v.is_finite())) {
                return option(what, value, "greater than 0");
            }
        }
        for (what, count) in [("the number of kernels", lengths.len()), ("the number of ridges", self.ridges.len())] {
            if count == 0 {
                return option(what, 0.0, "at least 1");
            }
        }
        match self.landmarks {
            Some(0) => option("the number of landmarks", 0.0, "at least 1"),
            _ => Ok(()),
        }
    }

    fn singular(&self, problem: &Problem) -> TrainError {
        let size = problem.low_rank.pivots.len();
        TrainError::Singular { trainer: self.name().into(), what: "kernel ridge regression", size }
    }
}

/// k'(a, b) of all pairs of a point and a landmark; of each are given rows x features, as they are and with every difference at zero.
#[cfg(feature = "train")]
pub(super) fn centred(kernel: &Kernel, [z, z0]: [&Array2<f64>; 2], [b, b0]: [&Array2<f64>; 2]) -> Array2<f64> {
    let features = z.ncols() as f64;
    let radial = |a: &Array2<f64>, b: &Array2<f64>| distances(a.view(), b.view()).mapv(|d| kernel.radial(d, features));
    let mut centred = radial(z, b) - radial(z, b0) - radial(z0, b) + radial(z0, b0);
    centred.scaled_add(kernel.linear / features, &(z - z0).dot(&(b - b0).t()));
    centred
}

/// Everything of the kernel matrix that does not depend on l.
pub(super) struct Distances {
    features: f64,
    /// |a - b|, |a - b0| and |a0 - b0| of all pairs of rows.
    rows: Array2<f64>,
    rows_to_identity: Array2<f64>,
    identity: Array2<f64>,
    /// (a - a0).(b - b0).
    products: Array2<f64>,
}

impl Distances {
    pub(super) fn new(z: &Array2<f64>, z0: &Array2<f64>) -> Self {
        let differences = z - z0;
        Self {
            features: z.ncols() as f64,
            rows: own_distances(z.view()),
            rows_to_identity: distances(z.view(), z0.view()),
            identity: own_distances(z0.view()),
            products: differences.dot(&differences.t()),
        }
    }

    /// K' of all pairs of rows.
    pub(super) fn centred(&self, kernel: &Kernel) -> Array2<f64> {
        let radial = |distance: f64| kernel.radial(distance, self.features);
        let near = self.rows_to_identity.mapv(radial);
        let mut centred = self.rows.mapv(radial) + self.identity.mapv(radial);
        centred -= &near;
        centred -= &near.t();
        centred.scaled_add(kernel.linear / self.features, &self.products);
        centred
    }
}

/// Euclidean distances of all pairs of rows, summed directly: the usual |a|^2 - 2 a.b + |b|^2 cancels for near rows.
fn distances(a: ArrayView2<'_, f64>, b: ArrayView2<'_, f64>) -> Array2<f64> {
    let others: Vec<Vec<f64>> = b.outer_iter().map(|row| row.to_vec()).collect();
    let mut out = Array2::zeros((a.nrows(), b.nrows()));
    for (row, mut out) in a.outer_iter().zip(out.outer_iter_mut()) {
        let row = row.to_vec();
        out.iter_mut().zip(&others).for_each(|(out, other)| *out = squared_distance(&row, other).sqrt());
    }
    out
}

/// The same of all pairs of rows of one matrix.
fn own_distances(a: ArrayView2<'_, f64>) -> Array2<f64> {
    let rows: Vec<Vec<f64>> = a.outer_iter().map(|row| row.to_vec()).collect();
    let mut out = Array2::zeros((rows.len(), rows.len()));
    for i in 0..rows.len() {
        for j in 0..i {
            let distance = squared_distance(&rows[i], &rows[j]).sqrt();
            out[[i, j]] = distance;
            out[[j, i]] = distance;
        }
    }
    out
}

/// |a - b|^2, in eight sums that the processor adds side by side.
fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = a8.remainder().iter().zip(b8.remainder()).map(|(a, b)| (a - b) * (a - b)).sum();
    for (a, b) in a8.zip(b8) {
        for i in 0..8 {
            let d = a[i] - b[i];
            lanes[i] += d * d;
        }
    }
    lanes.iter().sum::<f64>() + tail
}

/// Weighted ridge regression on the columns of a low-rank factor.
#[derive(Clone)]
struct Problem {
    low_rank: LowRank,
    target: Vec<f64>,
    weights: Vec<f64>,
    /// F^T V F and F^T V y over all rows.
    normal: Array2<f64>,
    right: Vec<f64>,
}

impl Problem {
    fn new(low_rank: LowRank, target: &[f64], weights: &[f64]) -> Self {
        let all: Vec<usize> = (0..target.len()).collect();
        let (normal, right) = normal_equations(&low_rank.factor, target, weights, &all);
        Self { low_rank, target: target.to_vec(), weights: weights.to_vec(), normal, right }
    }

    /// Coefficients of the factor's columns, without the rows `left_out`.
    fn solve(&self, ridge: f64, left_out: Option<&(Array2<f64>, Vec<f64>)>) -> Option<Vec<f64>> {
        match left_out {
            None => solve(self.normal.view(), ridge, &self.right),
            Some((normal, right)) => {
                let rest: Vec<f64> = self.right.iter().zip(right).map(|(a, b)| a - b).collect();
                solve((&self.normal - normal).view(), ridge, &rest)
            }
        }
    }

    /// Weighted squared error over the held-out rows of all folds, one a ridge.
    fn fold_errors(&self, folds: &[Fold], ridges: &[f64]) -> Option<Vec<f64>> {
        let mut errors = vec![0.0; ridges.len()];
        for fold in folds {
            let held = fold.held_out.indices();
            let left_out = normal_equations(&self.low_rank.factor, &self.target, &self.weights, held);
            for (&ridge, error) in ridges.iter().zip(&mut errors) {
                let coefficients = self.solve(ridge, Some(&left_out))?;
                for &i in held {
                    let predicted: f64 =
                        self.low_rank.factor.row(i).iter().zip(&coefficients).map(|(f, c)| f * c).sum();
                    *error += self.weights[i] * (self.target[i] - predicted).powi(2);
                }
            }
        }
        Some(errors)
    }
}

/// F^T V F and F^T V y over some rows.
fn normal_equations(factor: &Array2<f64>, y: &[f64], v: &[f64], rows: &[usize]) -> (Array2<f64>, Vec<f64>) {
    let mut scaled = factor.select(Axis(0), rows);
    let mut right = vec![0.0; factor.ncols()];
    for (&i, mut row) in rows.iter().zip(scaled.outer_iter_mut()) {
        row.iter().zip(&mut right).for_each(|(f, r)| *r += v[i] * y[i] * f);
        row *= v[i].sqrt();
    }
    (scaled.t().dot(&scaled), right)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Row;
    use crate::samples::Samples;
    use rand::Rng;
    use vernis_metric::descriptor::{Column, Role};
    use vernis_metric::math::cholesky::dot;

    fn set(n: usize) -> TrainingSet {
        let mut rng = seed::stream(2, "kernel-test", 0);
        let features = Array2::from_shape_fn((n, 5), |_| rng.random::<f64>() - 0.5);
        let columns = (0..5).map(|i| Column {
            name: format!("c{i}"),
            family: "test".into(),
            role: if i < 4 { Role::Difference } else { Role::Context },
        });
        let rows = (0..n).map(|i| Row {
            material: format!("m{}", i / 3),
            group: format!("m{}", i / 3),
            method: "a".into(),
            method_family: "a".into(),
            material_type: None,
            mos: 4.0 - 2.0 * features[[i, 0]].abs() + features[[i, 4]],
            weight: 0.5 + (i % 2) as f64,
        });
        TrainingSet::whole(&Samples::new(columns.collect(), rows.collect(), features.clone()).unwrap())
    }

    #[test]
    fn all_pivots_give_kernel_ridge_regression() {
        let set = set(30);
        let kernel = Kernel { radial: Radial::Exponential, length: 1.0, linear: LINEAR };
        let options = KernelRidge { kernels: vec![kernel], ridges: vec![0.1], landmarks: None };
        let model = options.train(&set, 0).unwrap();
        // The textbook form: a = (K' + ridge V^-1)^-1 (y - identity).
        let data = Standardized::fit("test", &set).unwrap();
        let mut system = Distances::new(&data.z, &data.z0).centred(&kernel);
        let centred = system.clone();
        let y: Vec<f64> = set.mos().iter().map(|m| m - set.identical()).collect();
        set.weights().iter().enumerate().for_each(|(i, v)| system[[i, i]] += 0.1 / v);
        let a = solve(system.view(), 0.0, &y).unwrap();
        for (i, predicted) in model.predict(set.features()).iter().enumerate() {
            let direct = set.identical() + dot(&centred.row(i).to_vec(), &a);
            assert!((predicted - direct).abs() < 1e-5, "{predicted} {direct}");
        }
    }

    #[test]
    fn few_landmarks_store_few_weights() {
        let model = KernelRidge::nystroem(10).train(&set(30), 0).unwrap();
        assert_eq!(model.regressor().unwrap().weight_count(), 10);
    }

    #[test]
    fn refuses_impossible_options() {
        let bad = [
            KernelRidge { landmarks: Some(0), ..KernelRidge::full() },
            KernelRidge { ridges: vec![], ..KernelRidge::full() },
            KernelRidge { ridges: vec![0.0], ..KernelRidge::full() },
        ];
        for options in bad {
            assert!(matches!(options.train(&set(30), 0), Err(TrainError::Option { .. })));
        }
    }
}
