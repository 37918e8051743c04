//! A true metric: a weighted city-block distance between descriptors, which saturates.
//!
//!   d(r, c) = A (1 - exp(-s/A)),   s = sum_k v_k |x_k| / scale_k,   v_k >= 0,   mos = identity - d
//!
//! x_k are descriptors that compare the two BRDFs, scale_k their weighted root mean square over the training rows. Where each x_k is
//! the change of a number of one BRDF, s is a city-block distance, and A (1 - exp(-s/A)) keeps symmetry and the triangle inequality.
//! Minimised over v, A = 3.5 e^theta and one offset b_m for each family of methods:
//!
//!   mean_w (y + d e^(b_m))^2 + 0.1 sum v + 0.02 sum b^2 + 0.01 theta^2 + 0.1 L,   y = rating - identity
//!   L = mean over votes of -ln sigmoid(3 (d(r, other) - d(r, chosen)))
//!
//! The offsets take up what a method's candidates have in common that no descriptor sees; predictions leave them out (b = 0), so
//! that they are those for a method of which nothing is known. L is over judged triplets, where the study has some; a vote is one
//! answer to which of two materials looks more like r.
//!
//! Full-batch Adam (Kingma & Ba 2015) with a cosine schedule; after each step negative weights are set to 0, so that many end there.
//! The tensors give the gradient; the parameters, some seventy, stay on this side. Cost: 200 passes over the rows and the triplets,
//! a third of a second for 430 rows and 3,000 triplets. Metrics that begin with the same distance, and members that are asked for
//! twice, are trained once ([`Known`]).

use super::network::{cosine_rate, device, read, tensor};
use crate::samples::split::TrainingSet;
use crate::train::{LEAST_ROWS, Predictor, TrainError, Trainer, check_set};
use burn::tensor::{Device, Tensor};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use vernis_metric::brdf::ContentHash;
use vernis_metric::descriptor::{Column, Role};
use vernis_metric::metric::learned::{Function, Input, Regressor, Standardizer, Term};

/// Sum of the weights at the start.
const START: f64 = 1.2;
/// A at the start, in grades.
const LIMIT: f64 = 3.5;
/// Slope of the choice between two materials, per grade.
const SLOPE: f64 = 3.0;
const WEIGHT_PENALTY: f64 = 0.1;
const OFFSET_PENALTY: f64 = 0.02;
const LIMIT_PENALTY: f64 = 0.01;
const TRIPLET_WEIGHT: f64 = 0.1;
const STEPS: usize = 200;
const RATE: f64 = 0.02;

/// Options of the saturated distance.
#[derive(Debug, Clone)]
pub struct SaturatedDistance {
    /// Name of the trainer.
    pub name: String,
    /// Places of the columns that it takes, among all columns.
    pub columns: fn(&[Column]) -> Vec<usize>,
    /// Judged triplets that it learns from at most.
    pub triplets: usize,
    /// What this trainer and its clones have learned.
    pub known: Known,
}

/// What trainers learned, by the numbers that they learned it from: the same numbers give the same weights. Clones share it. Memory: a
/// kilobyte a training.
#[derive(Clone, Default)]
pub struct Known(Arc<Mutex<BTreeMap<ContentHash, Vec<f64>>>>);

impl fmt::Debug for Known {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Known({})", self.0.lock().unwrap_or_else(PoisonError::into_inner).len())
    }
}

impl Known {
    /// What was learned from `numbers`, by `learn` the first time. Two threads that ask at once both learn, and find the same.
    fn or_learn(&self, numbers: ContentHash, learn: impl FnOnce() -> Vec<f64>) -> Vec<f64> {
        let known = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = known().get(&numbers).cloned();
        found.unwrap_or_else(|| {
            let learned = learn();
            known().insert(numbers, learned.clone());
            learned
        })
    }
}

/// The numbers of one training.
struct Numbers {
    features: usize,
    rows: usize,
    families: usize,
    triplets: usize,
    /// As [`Table`] has them, row by row.
    magnitudes: Vec<f32>,
    target: Vec<f32>,
    weight: Vec<f32>,
    family: Vec<f32>,
    votes: [Vec<f32>; 2],
}

/// The numbers of one training, as the tensors take them.
struct Table {
    /// Rows, then (r, a) of every triplet, then (r, b), each of |x_k| / scale_k.
    magnitudes: Tensor<2>,
    rows: usize,
    triplets: usize,
    /// y, rows x 1.
    target: Tensor<2>,
    /// Sum to 1, rows x 1.
    weight: Tensor<2>,
    /// rows x families, 1 where the row is of the family.
    family: Tensor<2>,
    /// Votes for a and for b, which all sum to 1, triplets x 1.
    votes: [Tensor<2>; 2],
}

/// v, then b, then theta.
struct Parameters {
    values: Vec<f64>,
    weights: usize,
    families: usize,
}

impl Trainer for SaturatedDistance {
    fn name(&self) -> &str {
        &self.name
    }

    /// The seed draws the triplets; nothing else is random.
    fn train(&self, set: &TrainingSet, seed: u64) -> Result<Box<dyn Predictor>, TrainError> {
        Ok(Box::new(self.fit(set, seed)?))
    }
}

impl SaturatedDistance {
    /// The model that [`Trainer::train`] gives.
    ///
    /// # Errors
    /// Too few rows, equal ratings, no column that varies, training that diverges.
    pub fn fit(&self, set: &TrainingSet, seed: u64) -> Result<Regressor, TrainError> {
        check_set(&self.name, set, LEAST_ROWS)?;
        let features = scales(set, &(self.columns)(set.columns()));
        if features.is_empty() {
            return Err(TrainError::NoDifference { trainer: self.name.clone() });
        }
        let numbers = self.numbers(set, &features, seed);
        let (weights, families) = (features.len(), numbers.families);
        let values = self.known.or_learn(numbers.hash(), || numbers.learned());
        let parameters = Parameters { values, weights, families };
        if parameters.values.iter().any(|v| !v.is_finite()) {
            return Err(TrainError::Diverged { trainer: self.name.clone(), what: "a weight", epochs: STEPS });
        }
        let limit = LIMIT * parameters.theta().exp();
        // Columns without weight are left out; one stays where none has any.
        let kept: Vec<usize> = (0..features.len()).filter(|&k| parameters.values[k] > 0.0).collect();
        let kept = if kept.is_empty() { vec![0] } else { kept };
        let regressor = Regressor {
            identity_mos: set.identical(),
            inputs: set.columns().iter().map(Input::from).collect(),
            terms: vec![Term {
                weight: 1.0,
                standardizer: Standardizer::scaled(kept.iter().map(|&k| features[k])),
                function: Function::Saturated { weights: kept.iter().map(|&k| parameters.values[k]).collect(), limit },
            }],
        };
        regressor.check().map_err(|source| TrainError::Regressor { trainer: self.name.clone(), source })?;
        Ok(regressor)
    }

    fn numbers(&self, set: &TrainingSet, features: &[(usize, f64)], seed: u64) -> Numbers {
        let mut magnitudes = Vec::new();
        for row in set.features().outer_iter() {
            magnitudes.extend(features.iter().map(|&(column, scale)| (row[column].abs() / scale) as f32));
        }
        let drawn = set.triplets().map(|all| (all, all.drawn(self.triplets, seed, "distance-triplets")));
        let mut votes = [Vec::new(), Vec::new()];
        if let Some((all, drawn)) = &drawn {
            let total: f64 = drawn.iter().flat_map(|t| t.votes).sum();
            for (side, votes) in votes.iter_mut().enumerate() {
                for triplet in drawn {
                    let of = |&(column, scale): &(usize, f64)| {
                        (f64::from(all.value(triplet.pairs[side], column)).abs() / scale) as f32
                    };
                    magnitudes.extend(features.iter().map(of));
                    votes.push((triplet.votes[side] / total) as f32);
                }
            }
        }
        let weights = set.weights();
        let total: f64 = weights.iter().sum();
        let known: BTreeSet<&str> = set.rows().iter().map(|row| row.method_family.as_str()).collect();
        let families: Vec<&str> = known.into_iter().collect();
        let family = set.rows().iter().flat_map(|row| {
            families.iter().map(|family| if **family == row.method_family { 1.0f32 } else { 0.0 }).collect::<Vec<_>>()
        });
        Numbers {
            features: features.len(),
            rows: set.rows().len(),
            families: families.len(),
            triplets: votes[0].len(),
            magnitudes,
            target: set.mos().iter().map(|mos| (mos - set.identical()) as f32).collect(),
            weight: weights.iter().map(|w| (w / total) as f32).collect(),
            family: family.collect(),
            votes,
        }
    }
}

impl Numbers {
    fn hash(&self) -> ContentHash {
        let sizes = [self.features, self.rows, self.families, self.triplets].map(|size| (size as u64).to_le_bytes());
        let [for_a, for_b] = &self.votes;
        let parts = [&self.magnitudes, &self.target, &self.weight, &self.family, for_a, for_b];
        let bytes = parts.into_iter().flatten().flat_map(|x| x.to_le_bytes());
        ContentHash::of(&sizes.into_iter().flatten().chain(bytes).collect::<Vec<u8>>())
    }

    fn table(&self, device: &Device) -> Table {
        let of = |values: &[f32], shape| tensor(values.to_vec(), shape, device);
        let column = |values: &[f32]| of(values, [values.len(), 1]);
        let [for_a, for_b] = &self.votes;
        Table {
            magnitudes: of(&self.magnitudes, [self.rows + 2 * self.triplets, self.features]),
            rows: self.rows,
            triplets: self.triplets,
            target: column(&self.target),
            weight: column(&self.weight),
            family: of(&self.family, [self.rows, self.families]),
            votes: [column(for_a), column(for_b)],
        }
    }

    /// The values of the parameters after all steps.
    fn learned(&self) -> Vec<f64> {
        let device = device();
        let table = self.table(&device);
        let mut values = vec![START / self.features as f64; self.features];
        values.resize(self.features + self.families + 1, 0.0);
        let mut parameters = Parameters { values, weights: self.features, families: self.families };
        let mut adam = Adam::new(parameters.values.len());
        for step in 0..STEPS {
            let gradient = table.gradient(&parameters, &device);
            adam.step(&mut parameters.values, &gradient, cosine_rate(RATE, step, STEPS));
            parameters.values[..self.features].iter_mut().for_each(|v| *v = v.max(0.0));
        }
        parameters.values
    }
}

/// Place and weighted root mean square of each column that is not 0 in every row.
fn scales(set: &TrainingSet, columns: &[usize]) -> Vec<(usize, f64)> {
    let weights = set.weights();
    let total: f64 = weights.iter().sum();
    let scale = |&column: &usize| {
        let values = set.features();
        let square: f64 = values.column(column).iter().zip(&weights).map(|(x, w)| w * x * x).sum();
        (column, (square / total).sqrt())
    };
    let compares = |column: &&usize| set.columns()[**column].role == Role::Difference;
    columns.iter().filter(compares).map(scale).filter(|(_, scale)| scale.is_normal()).collect()
}

impl Parameters {
    fn theta(&self) -> f64 {
        self.values[self.weights + self.families]
    }
}

impl Table {
    /// The derivative of the loss by every parameter.
    fn gradient(&self, at: &Parameters, device: &Device) -> Vec<f64> {
        let leaf = |values: &[f64]| {
            let values: Vec<f32> = values.iter().map(|&v| v as f32).collect();
            let length = values.len();
            tensor::<2>(values, [length, 1], device).require_grad()
        };
        let (v, rest) = at.values.split_at(at.weights);
        let (b, theta) = rest.split_at(at.families);
        let [v, b, theta] = [v, b, theta].map(leaf);
        let gradients = self.loss(&v, &b, &theta).backward();
        [v, b, theta]
            .iter()
            .flat_map(|leaf| {
                let length = leaf.dims()[0];
                leaf.grad(&gradients).map_or_else(|| vec![0.0; length], read)
            })
            .map(f64::from)
            .collect()
    }

    fn loss(&self, v: &Tensor<2>, b: &Tensor<2>, theta: &Tensor<2>) -> Tensor<1> {
        let limit = theta.clone().exp() * LIMIT;
        let s = self.magnitudes.clone().matmul(v.clone());
        let d = limit.clone() * ((s / limit).neg().exp().neg() + 1.0);
        let scaled = d.clone().narrow(0, 0, self.rows) * self.family.clone().matmul(b.clone()).exp();
        let residual = self.target.clone() + scaled;
        let mut loss = (self.weight.clone() * residual.clone() * residual).sum()
            + v.clone().sum() * WEIGHT_PENALTY
            + (b.clone() * b.clone()).sum() * OFFSET_PENALTY
            + (theta.clone() * theta.clone()).sum() * LIMIT_PENALTY;
        if self.triplets > 0 {
            let [a, other] = [0, 1].map(|side| d.clone().narrow(0, self.rows + side * self.triplets, self.triplets));
            // Distances are below A, a few grades, so that the exponentials are far from the range of f32.
            let logit = (other - a) * SLOPE;
            let [for_a, for_b] = self.votes.clone();
            let lost = for_a * logit.clone().neg().exp().log1p() + for_b * logit.exp().log1p();
            loss = loss + lost.sum() * TRIPLET_WEIGHT;
        }
        loss
    }
}

/// Adam (Kingma & Ba 2015, algorithm 1), with its usual constants.
struct Adam {
    first: Vec<f64>,
    second: Vec<f64>,
    steps: i32,
}

impl Adam {
    fn new(parameters: usize) -> Self {
        Self { first: vec![0.0; parameters], second: vec![0.0; parameters], steps: 0 }
    }

    fn step(&mut self, values: &mut [f64], gradient: &[f64], rate: f64) {
        const DECAYS: [f64; 2] = [0.9, 0.999];
        const EPSILON: f64 = 1e-8;
        self.steps += 1;
        let unbiased = DECAYS.map(|decay| 1.0 - decay.powi(self.steps));
        for (i, (value, g)) in values.iter_mut().zip(gradient).enumerate() {
            self.first[i] = DECAYS[0] * self.first[i] + (1.0 - DECAYS[0]) * g;
            self.second[i] = DECAYS[1] * self.second[i] + (1.0 - DECAYS[1]) * g * g;
            *value -= rate * (self.first[i] / unbiased[0]) / ((self.second[i] / unbiased[1]).sqrt() + EPSILON);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Row;
    use crate::samples::Samples;
    use crate::samples::triplets::{JudgedTriplet, TripletSamples};
    use ndarray::Array2;
    use rand::Rng;
    use vernis_metric::math::seed;

    const COLUMNS: usize = 4;

    fn columns() -> Vec<Column> {
        (0..COLUMNS).map(|i| Column { name: format!("c{i}"), family: "f".into(), role: Role::Difference }).collect()
    }

    fn trainer() -> SaturatedDistance {
        let columns = |all: &[Column]| (0..all.len()).collect();
        SaturatedDistance { name: "test".into(), columns, triplets: 100, known: Known::default() }
    }

    /// The distance of people: the first two columns count.
    fn true_distance(x: &[f64]) -> f64 {
        2.5 * (1.0 - (-(0.8 * x[0].abs() + 0.5 * x[1].abs())).exp())
    }

    fn samples(n: usize) -> Samples {
        let mut rng = seed::stream(5, "saturated-test", 0);
        let features = Array2::from_shape_fn((n, COLUMNS), |_| 2.0 * rng.random::<f64>() - 1.0);
        let row = |i: usize| Row {
            material: format!("m{i}"),
            group: format!("m{i}"),
            method: format!("a{}", i % 2),
            method_family: format!("a{}", i % 2),
            material_type: None,
            mos: 4.5 - true_distance(&features.row(i).to_vec()),
            weight: 1.0,
        };
        Samples::new(columns(), (0..n).map(row).collect(), features.clone()).unwrap()
    }

    /// Triplets that people answer by column 2 alone, which no rating depends on.
    fn with_triplets(samples: Samples) -> Samples {
        let mut rng = seed::stream(6, "saturated-test", 0);
        let pairs = Array2::from_shape_fn((60, COLUMNS), |_| 2.0 * rng.random::<f32>() - 1.0);
        let triplet = |i: usize| {
            let nearer = pairs[(i, 2)].abs() < pairs[(i + 1, 2)].abs();
            let votes = if nearer { [5.0, 0.0] } else { [0.0, 5.0] };
            JudgedTriplet { pairs: [i, i + 1], votes, group: "unrated".into() }
        };
        let triplets = (0..59).map(triplet).collect();
        samples.with_triplets(TripletSamples::new(columns(), pairs, triplets).unwrap()).unwrap()
    }

    fn weights(regressor: &Regressor) -> Vec<f64> {
        let Function::Saturated { weights, .. } = &regressor.terms[0].function else { panic!("a saturated distance") };
        let mut all = vec![0.0; COLUMNS];
        for (f, w) in regressor.terms[0].standardizer.features.iter().zip(weights) {
            all[f.input] = w / f.scale;
        }
        all
    }

    #[test]
    fn it_finds_the_columns_that_count_and_is_exact_for_identical_brdfs() {
        let set = TrainingSet::whole(&samples(120));
        let model = trainer().fit(&set, 1).unwrap();
        let weights = weights(&model);
        assert!(weights[0] > weights[1] && weights[1] > 3.0 * weights[2].max(weights[3]), "{weights:?}");
        assert_eq!(model.predict(&[0.0; COLUMNS]), set.identical());
        assert_eq!(model, trainer().fit(&set, 2).unwrap());
    }

    #[test]
    fn triplets_move_the_weights() {
        let plain = weights(&trainer().fit(&TrainingSet::whole(&samples(120)), 1).unwrap());
        let taught = weights(&trainer().fit(&TrainingSet::whole(&with_triplets(samples(120))), 1).unwrap());
        assert!(taught[2] > plain[2] + 0.02, "{plain:?} {taught:?}");
    }

    #[test]
    fn the_loss_has_the_derivative_that_the_tensors_give() {
        let set = TrainingSet::whole(&with_triplets(samples(40)));
        let (trainer, device) = (trainer(), device());
        let features = scales(&set, &[0, 1, 2, 3]);
        let numbers = trainer.numbers(&set, &features, 1);
        let (table, families) = (numbers.table(&device), numbers.families);
        let at = |values: Vec<f64>| Parameters { values, weights: COLUMNS, families };
        let values = vec![0.3, 0.2, 0.4, 0.1, 0.05, -0.1, 0.2];
        let loss = |values: &[f64]| {
            let leaf =
                |values: &[f64]| tensor::<2>(values.iter().map(|&v| v as f32).collect(), [values.len(), 1], &device);
            let (v, rest) = values.split_at(COLUMNS);
            let (b, theta) = rest.split_at(families);
            f64::from(read(table.loss(&leaf(v), &leaf(b), &leaf(theta)))[0])
        };
        let gradient = table.gradient(&at(values.clone()), &device);
        for i in 0..values.len() {
            let moved = |by: f64| {
                let mut values = values.clone();
                values[i] += by;
                loss(&values)
            };
            // In f32: 1e-7 of the loss over a step of 0.02, and the third derivative times its square.
            let numeric = (moved(0.01) - moved(-0.01)) / 0.02;
            assert!((numeric - gradient[i]).abs() < 2e-3, "{i} {numeric} {}", gradient[i]);
        }
    }

    #[test]
    fn the_same_numbers_are_learned_from_once_and_others_again() {
        let (trainer, set) = (trainer(), TrainingSet::whole(&samples(40)));
        let renamed = SaturatedDistance { name: "other".into(), ..trainer.clone() };
        let learned = || trainer.known.0.lock().unwrap().len();
        let first = trainer.fit(&set, 1).unwrap();
        // The seed draws triplets, and there are none.
        assert_eq!((renamed.fit(&set, 2).unwrap(), learned()), (first.clone(), 1));
        // A weight that no training gives shows that the answer is the one that was kept.
        trainer.known.0.lock().unwrap().values_mut().for_each(|values| values[0] += 5.0);
        assert!(weights(&renamed.fit(&set, 1).unwrap())[0] > 2.0 * weights(&first)[0]);
        let fewer = set.filter(|row| row.material != "m0");
        assert!(weights(&renamed.fit(&fewer, 1).unwrap())[0] < 2.0 * weights(&first)[0]);
        assert_eq!(learned(), 2);
        assert_eq!(super::tests::trainer().fit(&set, 1).unwrap(), first);
    }

    #[test]
    fn columns_without_numbers_are_an_error() {
        let nothing = SaturatedDistance { columns: |_| Vec::new(), ..trainer() };
        let found = nothing.fit(&TrainingSet::whole(&samples(20)), 1);
        assert!(matches!(found, Err(TrainError::NoDifference { .. })));
    }
}
