//! A distance that is a metric, and a kernel model of what it leaves over.
//!
//!   mos(a) = p(a) + sum_m w_m k'(a, a_m)
//!
//! p is the prediction of a [`SaturatedDistance`], or the score of identical BRDFs alone; k' the kernel of
//! [`super::kernel`], which vanishes for identical BRDFs. The weights are those of a Gaussian process whose observations are
//!
//!   y_i - p(a_i) = f(a_i) + h_m(i)(a_i) + noise,   f ~ GP(0, k'),   h_m ~ GP(0, tau k'),   noise ~ N(0, ridge / v_i)
//!
//! with one deviation h_m for each family of methods m: what a method's candidates have in common beyond their descriptors is a
//! nuisance, and the prediction is that of f alone. v_i are the rows' training weights. On landmarks, k' ~ F F^T, the coefficients c of
//! F's columns are a generalised least squares fit with a standard normal prior,
//!
//!   (F^T S^-1 F + I) c = F^T S^-1 (y - p),   S = tau 1[same family] K' + diag(ridge / v),
//!
//! S block by block, one for each family (Rasmussen & Williams 2006, 2.7, with the roles of mean and covariance as there).
//!
//! Judged triplets may take part: to |c|^2 + ... above is added 2 (mu / ridge) sum of the votes' log losses, with logit
//! 3 (mos(r, a) - mos(r, b)), and Newton steps find the minimum. The triplets bring landmarks of their own, for their pairs are of
//! different materials. Cost: n^2 for the kernel of n rows, n_m^3 for each family; half a second for 900 rows.

use super::choices::Choices;
use super::kernel::{Distances, centred};
use super::landmarks::LowRank;
use super::neural::SaturatedDistance;
use super::standardize::{Standardized, apply_rows};
use super::{LEAST_ROWS, Predictor, TrainError, Trainer, check_set};
use crate::samples::split::TrainingSet;
use crate::samples::triplets::JudgedTriplet;
use ndarray::{Array2, Axis, concatenate};
use std::collections::{BTreeMap, BTreeSet};
use vernis_metric::descriptor::Column;
use vernis_metric::math::cholesky::{Cholesky, solve};
use vernis_metric::math::seed;
use vernis_metric::metric::learned::{Function, Kernel, Regressor, Term};

/// Of the largest diagonal element of K': rows explained better than this add nothing.
const TOLERANCE: f64 = 1e-7;
/// Pairs of triplets that landmarks are drawn from, for each landmark.
const CANDIDATES: usize = 4;

/// How triplets take part in the kernel model.
#[derive(Debug, Clone, PartialEq)]
pub struct TripletTask {
    /// Weight of a vote's log loss, beside the squared error of a row of weight 1.
    pub mu: f64,
    /// Triplets at most.
    pub most: usize,
    /// Landmarks among their pairs.
    pub landmarks: usize,
}

/// A metric and a kernel model of the rest.
#[derive(Debug, Clone)]
pub struct ResidualKernel {
    /// Name of the trainer.
    pub name: String,
    /// What the kernel model adds to; without it, to the score of identical BRDFs.
    pub mean: Option<SaturatedDistance>,
    /// Columns that the kernel takes.
    pub keep: fn(&Column) -> bool,
    /// k.
    pub kernel: Kernel,
    /// Noise of a row of weight 1.
    pub ridge: f64,
    /// Variance of a method's deviation, a share of that of the model.
    pub tau: f64,
    /// Landmarks among the rows.
    pub landmarks: usize,
    /// Weight of a pair with reference and candidate exchanged, against its original.
    pub exchanged: f64,
    /// Triplets of the kernel model; none by default.
    pub triplets: Option<TripletTask>,
}

impl Trainer for ResidualKernel {
    fn name(&self) -> &str {
        &self.name
    }

    fn train(&self, set: &TrainingSet, seed: u64) -> Result<Box<dyn Predictor>, TrainError> {
        check_set(&self.name, set, LEAST_ROWS)?;
        self.check()?;
        let mean = self.mean.as_ref().map(|mean| mean.fit(set, seed)).transpose()?;
        let doubled = set.with_swapped(self.exchanged);
        let predicted = match &mean {
            Some(mean) => mean.predict_rows(doubled.features()),
            None => vec![set.identical(); doubled.rows().len()],
        };
        let rest: Vec<f64> = doubled.mos().iter().zip(predicted).map(|(mos, p)| mos - p).collect();
        let data = Standardized::fit_smooth(&self.name, &doubled, &self.keep)?;
        let rated = set.rows().len();
        let (low_rank, landmarks, coefficients) = self.fit((&doubled, rated), &data, &rest, mean.as_ref(), seed)?;
        let term = Term {
            weight: 1.0,
            function: Function::Kernel {
                kernel: self.kernel,
                weights: low_rank.pivot_weights(&coefficients),
                landmarks: landmarks.iter().copied().collect(),
            },
            standardizer: data.standardizer,
        };
        let terms = mean.into_iter().flat_map(|mean| mean.terms).chain([term]).collect();
        let regressor = Regressor { identity_mos: set.identical(), inputs: data.inputs, terms };
        regressor.check().map_err(|source| TrainError::Regressor { trainer: self.name.clone(), source })?;
        Ok(Box::new(regressor))
    }
}

/// Rows of the pairs of the triplets that take part.
struct Judged<'a> {
    triplets: Vec<&'a JudgedTriplet>,
    /// Rows of the pairs in the triplets' table, in the order in which they are first asked for.
    pairs: Vec<usize>,
    /// Standardised, pairs x features.
    z: Array2<f64>,
    z0: Array2<f64>,
    /// p of every pair, less the score of identical BRDFs.
    mean: Vec<f64>,
}

impl Judged<'_> {
    /// How the votes depend on the coefficients of the columns of `factor`, the pairs' rows.
    fn choices(&self, factor: &Array2<f64>, mu: f64) -> Choices {
        let place: BTreeMap<usize, usize> = self.pairs.iter().enumerate().map(|(i, &pair)| (pair, i)).collect();
        let mut steps = Array2::zeros((self.triplets.len(), factor.ncols()));
        let mut offsets = Vec::with_capacity(self.triplets.len());
        for (triplet, mut row) in self.triplets.iter().zip(steps.outer_iter_mut()) {
            let [a, b] = triplet.pairs.map(|pair| place[&pair]);
            row += &factor.row(a);
            row -= &factor.row(b);
            offsets.push(self.mean[a] - self.mean[b]);
        }
        Choices { steps, offsets, votes: self.triplets.iter().map(|t| t.votes).collect(), mu }
    }
}

impl ResidualKernel {
    fn check(&self) -> Result<(), TrainError> {
        let option =
            |what, value, allowed| Err(TrainError::Option { trainer: self.name.clone(), what, value, allowed });
        let positive = |x: f64| x > 0.0 && x.is_finite();
        if !positive(self.kernel.length) {
            return option("the kernel length", self.kernel.length, "greater than 0");
        }
        if !positive(self.ridge) {
            return option("the ridge", self.ridge, "greater than 0");
        }
        if !positive(self.exchanged) {
            return option("the weight of exchanged pairs", self.exchanged, "greater than 0");
        }
        if !(self.tau.is_finite() && self.tau >= 0.0) {
            return option("tau", self.tau, "at least 0");
        }
        if self.landmarks == 0 {
            return option("the number of landmarks", 0.0, "at least 1");
        }
        match &self.triplets {
            Some(task) if !positive(task.mu) => option("mu", task.mu, "greater than 0"),
            _ => Ok(()),
        }
    }

    /// The factor, the standardised landmarks (landmarks x features) and the coefficients of the factor's columns. The first `rated` rows
    /// of the set are pairs as they were rated, the others exchanged.
    fn fit(
        &self,
        (set, rated): (&TrainingSet, usize),
        data: &Standardized,
        rest: &[f64],
        mean: Option<&Regressor>,
        seed: u64,
    ) -> Result<(LowRank, Array2<f64>, Vec<f64>), TrainError> {
        let judged = self.triplets.as_ref().and_then(|task| self.judged(task, set, data, mean, seed));
        let rows = rest.len();
        // The rows, and after them those pairs of triplets that may become landmarks.
        let further = self.triplets.as_ref().map_or(0, |task| CANDIDATES * task.landmarks);
        let (z, z0) = match &judged {
            None => (data.z.clone(), data.z0.clone()),
            Some(judged) => {
                let with = |a: &Array2<f64>, b: &Array2<f64>| {
                    let some = b.slice(ndarray::s![..further.min(b.nrows()), ..]);
                    concatenate(Axis(0), &[a.view(), some]).unwrap_or_else(|_| a.clone())
                };
                (with(&data.z, &judged.z), with(&data.z0, &judged.z0))
            }
        };
        let k = Distances::new(&z, &z0).centred(&self.kernel);
        // Pairs as they were rated: exchanged ones count little, and a landmark is better spent.
        let mut stages = vec![(0..rated, self.landmarks)];
        stages.extend(self.triplets.as_ref().map(|task| (rows..z.nrows(), task.landmarks)));
        let mut rng = seed::stream(seed, "residual-landmarks", 0);
        let low_rank = LowRank::in_stages(k.view(), &stages, TOLERANCE, &mut rng);
        let singular = || TrainError::Singular {
            trainer: self.name.clone(),
            what: "the kernel model",
            size: low_rank.pivots.len(),
        };
        let (mut normal, right) = self.normal_equations(set, &k, &low_rank.factor, rest).ok_or_else(singular)?;
        normal.diag_mut().mapv_inplace(|d| d + 1.0);
        let mut coefficients = solve(normal.view(), 0.0, &right).ok_or_else(singular)?;
        let landmarks = z.select(Axis(0), &low_rank.pivots);
        if let (Some(task), Some(judged)) = (&self.triplets, &judged) {
            let at_identity = z0.select(Axis(0), &low_rank.pivots);
            let kernel = centred(&self.kernel, [&judged.z, &judged.z0], [&landmarks, &at_identity]);
            let factor = low_rank.rows_of(kernel.view());
            let problem = judged.choices(&factor, task.mu / self.ridge);
            coefficients = problem.minimise(&normal, &right, coefficients).ok_or_else(singular)?;
        }
        Ok((low_rank, landmarks, coefficients))
    }

    /// F^T S^-1 F and F^T S^-1 y over the rows.
    fn normal_equations(
        &self,
        set: &TrainingSet,
        k: &Array2<f64>,
        factor: &Array2<f64>,
        y: &[f64],
    ) -> Option<(Array2<f64>, Vec<f64>)> {
        let weights = set.weights();
        let mut families: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (i, row) in set.rows().iter().enumerate() {
            families.entry(&row.method_family).or_default().push(i);
        }
        let r = factor.ncols();
        let (mut normal, mut right) = (Array2::zeros((r, r)), vec![0.0; r]);
        for rows in families.values() {
            let f = factor.select(Axis(0), rows);
            // S^-1 F, rows of the family x columns.
            let solved = if self.tau == 0.0 {
                let mut solved = f.clone();
                rows.iter().zip(solved.outer_iter_mut()).for_each(|(&i, mut row)| row *= weights[i] / self.ridge);
                solved
            } else {
                let s = Array2::from_shape_fn((rows.len(), rows.len()), |(a, b)| {
                    let noise = if a == b { self.ridge / weights[rows[a]] } else { 0.0 };
                    self.tau * k[[rows[a], rows[b]]] + noise
                });
                let cholesky = Cholesky::new(s.view(), 0.0)?;
                let mut solved = Array2::zeros(f.raw_dim());
                for (column, mut out) in f.columns().into_iter().zip(solved.columns_mut()) {
                    out.iter_mut().zip(cholesky.solve(&column.to_vec())).for_each(|(o, x)| *o = x);
                }
                solved
            };
            normal += &f.t().dot(&solved);
            for (row, &i) in solved.outer_iter().zip(rows) {
                row.iter().zip(&mut right).for_each(|(s, sum)| *sum += s * y[i]);
            }
        }
        Some((normal, right))
    }

    /// The triplets that take part; `None` where the set has none.
    fn judged<'a>(
        &self,
        task: &TripletTask,
        set: &'a TrainingSet,
        data: &Standardized,
        mean: Option<&Regressor>,
        seed: u64,
    ) -> Option<Judged<'a>> {
        let all = set.triplets()?;
        let triplets = all.drawn(task.most, seed, "residual-triplets");
        if triplets.is_empty() {
            return None;
        }
        let mut seen = BTreeSet::new();
        let pairs: Vec<usize> = triplets.iter().flat_map(|t| t.pairs).filter(|&pair| seen.insert(pair)).collect();
        let mut raw = Array2::zeros((pairs.len(), all.columns().len()));
        for (&pair, mut row) in pairs.iter().zip(raw.outer_iter_mut()) {
            row.iter_mut().zip(all.pair(pair)).for_each(|(r, v)| *r = v);
        }
        let mean = match mean {
            Some(mean) => mean.predict_rows(raw.view()).iter().map(|p| p - mean.identity_mos).collect(),
            None => vec![0.0; pairs.len()],
        };
        let z = apply_rows(&data.standardizer, raw.view(), None);
        let z0 = apply_rows(&data.standardizer, raw.view(), Some(&data.inputs));
        Some(Judged { triplets, pairs, z, z0, mean })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Row;
    use crate::samples::Samples;
    use crate::samples::triplets::TripletSamples;
    use crate::train::neural::Known;
    use rand::Rng;
    use vernis_metric::descriptor::Role;
    use vernis_metric::math::cholesky::dot;
    use vernis_metric::metric::learned::Radial;

    const COLUMNS: usize = 5;

    fn columns() -> Vec<Column> {
        let role = |i| if i < 4 { Role::Difference } else { Role::Context };
        (0..COLUMNS).map(|i| Column { name: format!("c{i}"), family: "test".into(), role: role(i) }).collect()
    }

    fn samples(n: usize) -> Samples {
        let mut rng = seed::stream(2, "residual-test", 0);
        let features = Array2::from_shape_fn((n, COLUMNS), |_| rng.random::<f64>() - 0.5);
        let row = |i: usize| Row {
            material: format!("m{}", i / 3),
            group: format!("m{}", i / 3),
            method: format!("a{}", i % 3),
            method_family: format!("a{}", i % 3),
            material_type: None,
            mos: 4.0 - 2.0 * features[[i, 0]].abs() + 0.5 * features[[i, 1]] * features[[i, 4]],
            weight: 0.5 + (i % 2) as f64,
        };
        Samples::new(columns(), (0..n).map(row).collect(), features.clone()).unwrap()
    }

    fn with_triplets(samples: Samples) -> Samples {
        let mut rng = seed::stream(3, "residual-test", 0);
        let pairs = Array2::from_shape_fn((41, COLUMNS), |_| rng.random::<f32>() - 0.5);
        let triplet = |i: usize| {
            let nearer = pairs[(i, 2)].abs() < pairs[(i + 1, 2)].abs();
            let votes = if nearer { [5.0, 0.0] } else { [0.0, 5.0] };
            JudgedTriplet { pairs: [i, i + 1], votes, group: "unrated".into() }
        };
        let triplets = (0..40).map(triplet).collect();
        samples.with_triplets(TripletSamples::new(columns(), pairs, triplets).unwrap()).unwrap()
    }

    fn trainer() -> ResidualKernel {
        ResidualKernel {
            name: "test".into(),
            mean: None,
            keep: |_| true,
            kernel: Kernel { radial: Radial::Matern32, length: 1.7, linear: 0.2 },
            ridge: 0.1,
            tau: 0.3,
            landmarks: 1000,
            exchanged: 0.15,
            triplets: None,
        }
    }

    fn distance() -> SaturatedDistance {
        let columns = |all: &[Column]| (0..all.len()).filter(|&c| all[c].role == Role::Difference).collect();
        SaturatedDistance { name: "distance".into(), columns, triplets: 0, known: Known::default() }
    }

    #[test]
    fn all_rows_as_landmarks_give_the_gaussian_process_with_deviations() {
        let set = TrainingSet::whole(&samples(36));
        let model = trainer().train(&set, 1).unwrap();
        let data = Standardized::fit_smooth("test", &set, &|_| true).unwrap();
        let k = Distances::new(&data.z, &data.z0).centred(&trainer().kernel);
        // Rasmussen & Williams 2006, eq. 2.23, with the covariance of f alone between rows and predictions.
        let (rows, weights) = (set.rows(), set.weights());
        let covariance = Array2::from_shape_fn(k.raw_dim(), |(i, j)| {
            let same = if rows[i].method_family == rows[j].method_family { 0.3 * k[[i, j]] } else { 0.0 };
            k[[i, j]] + same + if i == j { 0.1 / weights[i] } else { 0.0 }
        });
        let y: Vec<f64> = set.mos().iter().map(|mos| mos - set.identical()).collect();
        let a = solve(covariance.view(), 0.0, &y).unwrap();
        for (i, predicted) in model.predict(set.features()).iter().enumerate() {
            let direct = set.identical() + dot(&k.row(i).to_vec(), &a);
            assert!((predicted - direct).abs() < 1e-5, "{predicted} {direct}");
        }
    }

    #[test]
    fn no_deviation_is_the_limit_of_a_small_one() {
        let set = TrainingSet::whole(&samples(36));
        let predict = |tau| ResidualKernel { tau, ..trainer() }.train(&set, 1).unwrap().predict(set.features());
        let (none, small) = (predict(0.0), predict(1e-9));
        assert!(none.iter().zip(&small).all(|(a, b)| (a - b).abs() < 1e-6));
    }

    #[test]
    fn the_metric_adds_to_its_distance_and_is_exact_for_identical_brdfs() {
        let set = TrainingSet::whole(&samples(36));
        let whole = ResidualKernel { mean: Some(distance()), landmarks: 12, ..trainer() };
        let model = whole.train(&set, 1).unwrap();
        let regressor = model.regressor().unwrap();
        assert_eq!(regressor.terms.len(), 2);
        assert_eq!(regressor.terms[0], distance().fit(&set, 1).unwrap().terms[0]);
        assert_eq!(regressor.predict(&[0.0, 0.0, 0.0, 0.0, 0.7]), set.identical());
        assert!(regressor.weight_count() <= 12 + 4);
    }

    #[test]
    fn triplets_bring_landmarks_and_are_agreed_with_more_often() {
        let samples = with_triplets(samples(36));
        let set = TrainingSet::whole(&samples);
        let task = TripletTask { mu: 0.05, most: 100, landmarks: 8 };
        let without = ResidualKernel { mean: Some(distance()), landmarks: 12, ..trainer() };
        let with = ResidualKernel { triplets: Some(task), ..without.clone() };
        let agreed = |trainer: &ResidualKernel| {
            let model = trainer.train(&set, 1).unwrap();
            let regressor = model.regressor().unwrap();
            let all = samples.triplets().unwrap();
            let chosen = all.triplets().iter().filter(|t| {
                let [a, b] = t.pairs.map(|pair| regressor.predict(&all.pair(pair)));
                (a > b) == (t.votes[0] > t.votes[1])
            });
            (chosen.count(), regressor.weight_count())
        };
        let ((before, few), (after, more)) = (agreed(&without), agreed(&with));
        assert!(after > before && more == few + 8, "{before} {after} {few} {more}");
        // Where the study has none, they change nothing.
        let plain = TrainingSet::whole(&samples.clone().without_triplets());
        let model = with.train(&plain, 1).unwrap();
        assert_eq!(model.regressor(), without.train(&plain, 1).unwrap().regressor());
    }

    #[test]
    fn refuses_impossible_options() {
        let set = TrainingSet::whole(&samples(36));
        let task = TripletTask { mu: 0.0, most: 1, landmarks: 1 };
        for bad in [
            ResidualKernel { landmarks: 0, ..trainer() },
            ResidualKernel { ridge: 0.0, ..trainer() },
            ResidualKernel { tau: -1.0, ..trainer() },
            ResidualKernel { exchanged: f64::NAN, ..trainer() },
            ResidualKernel { triplets: Some(task), ..trainer() },
        ] {
            assert!(matches!(bad.train(&set, 0), Err(TrainError::Option { .. })));
        }
    }
}
