//! An ensemble of multi-layer perceptrons that is exact for identical BRDFs.
//!
//! With z = (f, c) the standardised differences and context of a row and z0 = (0, c),
//!
//!   mos(z) = identity + mean_m (g_m(z) - g_m(z0)),
//!
//! g_m a perceptron with two hidden layers (leaky ReLU, Maas et al. 2013). Both evaluations share weights, dropout masks
//! and the noise on the context, as a siamese network. Each member minimises the weighted mean of
//!
//!   huber(r) = r^2 / 2 where |r| <= delta, else delta (|r| - delta / 2),   r = mos - rating     (Huber 1964)
//!
//! with Adam and decoupled weight decay (Loshchilov & Hutter 2019, algorithm 2), a cosine schedule, dropout (Srivastava
//! et al. 2014) and noise on the inputs (Bishop 1995, doi:10.1162/neco.1995.7.1.108). The number of epochs is
//! fixed, or chosen on inner folds by material that are trained side by side. Cost: measured in the benches, about a second for
//! 470 rows of 48
//! descriptors.

use super::network::{LEAK, Stack, cosine_rate, device, read, tensor};
use crate::samples::split::TrainingSet;
use crate::train::standardize::Standardized;
use crate::train::{INNER_FOLDS, Predictor, TrainError, Trainer, check_set};
use burn::optim::{AdamWConfig, GradientsParams};
use burn::tensor::{Device, Tensor};
use ndarray::Array2;
use rand::Rng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use vernis_metric::descriptor::Role;
use vernis_metric::math::seed;
use vernis_metric::metric::learned::{Activation, Function, Regressor, Term};

const NEEDED_ROWS: usize = 16;

/// Options of the ensemble.
#[derive(Debug, Clone, PartialEq)]
pub struct NeuralNetwork {
    /// Widths of the hidden layers.
    pub hidden: Vec<usize>,
    /// Networks whose mean is the prediction.
    pub members: usize,
    /// Passes over the training rows.
    pub epochs: usize,
    /// Stop where the inner folds say so, at the latest after `epochs`. Off by default: with this schedule the held-out
    /// error is flat near the end, and choosing costs twice the time and up to 0.01 of correlation.
    pub choose_epochs: bool,
    /// Rows in one step of the optimiser.
    pub batch: usize,
    /// Learning rate at the start of the cosine.
    pub rate: f64,
    /// Decoupled weight decay, as a factor of the learning rate.
    pub decay: f64,
    /// Probability that a hidden unit is left out; 0 by default, for the noise alone regularises as well.
    pub dropout: f64,
    /// Standard deviation of the noise on standardised inputs.
    pub noise: f64,
    /// Where the loss turns from square to linear, in MOS.
    pub delta: f64,
}

impl Default for NeuralNetwork {
    fn default() -> Self {
        Self {
            hidden: vec![32, 16],
            members: 4,
            epochs: 150,
            choose_epochs: false,
            batch: 64,
            rate: 3e-3,
            decay: 1e-2,
            dropout: 0.0,
            noise: 0.25,
            delta: 0.7,
        }
    }
}

/// What one member learns from, in standardised units.
struct Job {
    rows: Vec<usize>,
}

/// The rows that all jobs draw from.
struct Table<'a> {
    data: &'a Standardized,
    /// `data.z` and `data.z0`, rows x features.
    z: Vec<f32>,
    z0: Vec<f32>,
    /// Ratings less the identity's.
    target: Vec<f32>,
    weight: Vec<f32>,
    /// Whether a feature is a difference: zero in z0, so that it gets no noise there.
    difference: Vec<bool>,
}

impl Trainer for NeuralNetwork {
    fn name(&self) -> &str {
        "neural-network"
    }

    fn train(&self, set: &TrainingSet, seed: u64) -> Result<Box<dyn Predictor>, TrainError> {
        check_set(self.name(), set, NEEDED_ROWS)?;
        self.check()?;
        let data = Standardized::fit(self.name(), set)?;
        let single = |z: &Array2<f64>| z.iter().map(|&v| v as f32).collect::<Vec<f32>>();
        let table = Table {
            z: single(&data.z),
            z0: single(&data.z0),
            target: set.mos().iter().map(|m| (m - set.identical()) as f32).collect(),
            weight: set.weights().iter().map(|&w| w as f32).collect(),
            difference: data
                .standardizer
                .features
                .iter()
                .map(|f| data.inputs[f.input].role == Role::Difference)
                .collect(),
            data: &data,
        };
        let epochs = if self.choose_epochs { self.chosen_epochs(set, &table, seed)? } else { self.epochs };
        let all: Vec<Job> = (0..self.members).map(|_| Job { rows: (0..table.target.len()).collect() }).collect();
        let stack = self.fit(&table, &all, epochs, seed, "member", |_, _| ());
        let (members, finite) = stack.export();
        if !finite {
            return Err(TrainError::Diverged { trainer: self.name().into(), what: "a weight", epochs });
        }
        let regressor = Regressor {
            identity_mos: set.identical(),
            inputs: data.inputs,
            terms: vec![Term {
                weight: 1.0,
                standardizer: data.standardizer,
                function: Function::Network { activation: Activation::LeakyRelu { slope: LEAK }, members },
            }],
        };
        regressor.check().map_err(|source| TrainError::Regressor { trainer: self.name().into(), source })?;
        Ok(Box::new(regressor))
    }
}

impl NeuralNetwork {
    fn check(&self) -> Result<(), TrainError> {
        let counts = [
            ("the number of networks", self.members),
            ("the number of epochs", self.epochs),
            ("the size of a batch", self.batch),
        ];
        let counts = counts.into_iter().chain(self.hidden.iter().map(|&w| ("the width of a hidden layer", w)));
        let ranges = [
            ("the learning rate", self.rate, 1e-9, 1.0, "greater than 0 and at most 1"),
            ("weight decay", self.decay, 0.0, 10.0, "0 to 10"),
            ("dropout", self.dropout, 0.0, 0.95, "0 to 0.95"),
            ("input noise", self.noise, 0.0, 10.0, "0 to 10"),
            ("the Huber threshold", self.delta, 1e-6, 1e6, "greater than 0"),
        ];
        let bad_count = counts.filter(|c| c.1 == 0).map(|(what, _)| (what, 0.0, "at least 1"));
        let bad_range = ranges.into_iter().filter(|r| !(r.2..=r.3).contains(&r.1)).map(|r| (r.0, r.1, r.4));
        match bad_count.chain(bad_range).next() {
            None => Ok(()),
            Some((what, value, allowed)) => {
                Err(TrainError::Option { trainer: self.name().into(), what, value, allowed })
            }
        }
    }

    /// The number of epochs with the least error over inner folds, one network a fold.
    fn chosen_epochs(&self, set: &TrainingSet, table: &Table, seed: u64) -> Result<usize, TrainError> {
        let folds = set
            .inner_folds(INNER_FOLDS, seed)
            .map_err(|source| TrainError::Split { trainer: self.name().into(), source })?;
        let held: Vec<Vec<usize>> = folds.iter().map(|f| f.held_out.indices().to_vec()).collect();
        let jobs: Vec<Job> = held
            .iter()
            .map(|held| Job { rows: (0..table.target.len()).filter(|i| !held.contains(i)).collect() })
            .collect();
        let mut best = (f64::INFINITY, self.epochs);
        let step = (self.epochs / 15).max(1);
        self.fit(table, &jobs, self.epochs, seed, "inner-fold", |epoch, stack| {
            if epoch % step != 0 && epoch != self.epochs {
                return;
            }
            let error = held_out_error(table, &held, stack);
            if error < best.0 {
                best = (error, epoch);
            }
        });
        if best.0.is_finite() {
            return Ok(best.1);
        }
        Err(TrainError::Diverged { trainer: self.name().into(), what: "the held-out error", epochs: self.epochs })
    }

    /// Trains one network a job side by side for the first `epochs` of the schedule; `after` sees them after each epoch.
    fn fit(
        &self,
        table: &Table,
        jobs: &[Job],
        epochs: usize,
        seed: u64,
        label: &str,
        mut after: impl FnMut(usize, &Stack),
    ) -> Stack {
        let device = device();
        let widths: Vec<usize> =
            [table.difference.len()].into_iter().chain(self.hidden.iter().copied()).chain([1]).collect();
        let mut stack = Stack::new(jobs.len(), &widths, seed, label, &device);
        let mut optimizer = AdamWConfig::new().with_epsilon(1e-8).with_weight_decay(self.decay as f32).init();
        let mut streams: Vec<Stream> =
            (0..jobs.len()).map(|m| Stream::new(seed, &format!("{label}-batches"), m as u64)).collect();
        let mut order: Vec<Vec<usize>> = jobs.iter().map(|j| j.rows.clone()).collect();
        let batches = jobs.iter().map(|j| j.rows.len().div_ceil(self.batch)).max().unwrap_or(0);
        for epoch in 0..epochs {
            for (order, stream) in order.iter_mut().zip(&mut streams) {
                order.shuffle(&mut stream.rng);
            }
            for batch in 0..batches {
                let batch_data = self.batch(table, &order, batch, &mut streams, &device);
                let gradients = self.loss(&stack, batch_data).backward();
                let gradients = GradientsParams::from_grads(gradients, &stack);
                let rate = cosine_rate(self.rate, epoch * batches + batch, self.epochs * batches);
                stack = optimizer.step(rate, stack, gradients);
            }
            after(epoch + 1, &stack);
        }
        stack
    }

    /// Sum over members of the weighted mean loss: gradients of one member do not depend on the others.
    fn loss(&self, stack: &Stack, batch: Batch) -> Tensor<1> {
        let rows = batch.target.dims()[1];
        let g = stack.forward(batch.inputs, &batch.masks);
        let residual = (g.clone().narrow(1, 0, rows) - g.narrow(1, rows, rows) - batch.target).abs();
        let square = residual.clone().clamp_max(self.delta);
        let huber = square.clone() * (residual - square * 0.5);
        (huber * batch.weight).sum()
    }

    /// Batch number `batch` of every member: rows with noise, then the same rows at identity.
    fn batch(
        &self,
        table: &Table,
        order: &[Vec<usize>],
        batch: usize,
        streams: &mut [Stream],
        device: &Device,
    ) -> Batch {
        let (members, features, size) = (order.len(), table.difference.len(), self.batch);
        let mut inputs = vec![0.0f32; members * 2 * size * features];
        let (mut target, mut weight) = (Vec::with_capacity(members * size), Vec::with_capacity(members * size));
        for ((order, stream), inputs) in
            order.iter().zip(streams.iter_mut()).zip(inputs.chunks_mut(2 * size * features))
        {
            // The last batch is filled up with the first rows of the epoch.
            let rows: Vec<usize> = (0..size).map(|i| order[(batch * size + i) % order.len()]).collect();
            let total: f32 = rows.iter().map(|&r| table.weight[r]).sum();
            target.extend(rows.iter().map(|&r| table.target[r]));
            weight.extend(rows.iter().map(|&r| table.weight[r] / total));
            let (noisy, identity) = inputs.split_at_mut(size * features);
            let blocks = noisy.chunks_exact_mut(features).zip(identity.chunks_exact_mut(features));
            for (&row, (noisy, identity)) in rows.iter().zip(blocks) {
                let at = row * features;
                for j in 0..features {
                    let noise = stream.noise(self.noise);
                    let shared = if table.difference[j] { 0.0 } else { noise };
                    noisy[j] = table.z[at + j] + noise;
                    identity[j] = table.z0[at + j] + shared;
                }
            }
        }
        let masks = if self.dropout == 0.0 {
            Vec::new()
        } else {
            self.hidden.iter().map(|&width| self.mask(members, width, streams, device)).collect()
        };
        Batch {
            inputs: tensor(inputs, [members, 2 * size, features], device),
            target: tensor(target, [members, size, 1], device),
            weight: tensor(weight, [members, size, 1], device),
            masks,
        }
    }

    /// Dropout of one hidden layer, the same for a row and its identity.
    fn mask(&self, members: usize, width: usize, streams: &mut [Stream], device: &Device) -> Tensor<3> {
        let kept = (1.0 / (1.0 - self.dropout)) as f32;
        let mut values = Vec::with_capacity(members * 2 * self.batch * width);
        for stream in streams {
            let start = values.len();
            values.extend(
                (0..self.batch * width).map(
                    |_| {
                        if stream.rng.random::<f32>() < self.dropout as f32 { 0.0 } else { kept }
                    },
                ),
            );
            values.extend_from_within(start..);
        }
        tensor(values, [members, 2 * self.batch, width], device)
    }
}

/// Tensors of one step; weights of a member's rows sum to 1.
struct Batch {
    inputs: Tensor<3>,
    target: Tensor<3>,
    weight: Tensor<3>,
    masks: Vec<Tensor<3>>,
}

/// The random numbers of one member.
struct Stream {
    rng: ChaCha8Rng,
}

impl Stream {
    fn new(seed: u64, label: &str, member: u64) -> Self {
        Self { rng: seed::stream(seed, label, member) }
    }

    /// Uniform noise of this standard deviation: cheaper than a normal, and as good a regulariser.
    fn noise(&mut self, deviation: f64) -> f32 {
        const HALF_WIDTH: f64 = 1.732_050_807_568_877_2;
        (self.rng.random::<f32>() * 2.0 - 1.0) * (HALF_WIDTH * deviation) as f32
    }
}

/// Weighted squared error of member m over the rows `held[m]`, summed over members.
fn held_out_error(table: &Table, held: &[Vec<usize>], stack: &Stack) -> f64 {
    let (members, features) = (held.len(), table.difference.len());
    let longest = held.iter().map(Vec::len).max().unwrap_or(0);
    // Shorter folds are filled up with zeros that are not read.
    let mut inputs = vec![0.0f32; members * 2 * longest * features];
    let fill = |out: &mut [f32], z: &Array2<f64>, rows: &[usize]| {
        let values = rows.iter().flat_map(|&r| z.row(r).iter().copied().collect::<Vec<_>>());
        out.iter_mut().zip(values).for_each(|(o, v)| *o = v as f32);
    };
    for (rows, inputs) in held.iter().zip(inputs.chunks_mut(2 * longest * features)) {
        let (z, z0) = inputs.split_at_mut(longest * features);
        fill(z, &table.data.z, rows);
        fill(z0, &table.data.z0, rows);
    }
    let g = read(stack.forward(tensor(inputs, [members, 2 * longest, features], &device()), &[]));
    held.iter()
        .zip(g.chunks(2 * longest))
        .flat_map(|(rows, g)| rows.iter().enumerate().map(move |(i, &row)| (row, g[i] - g[longest + i])))
        .map(|(row, mos)| f64::from(table.weight[row]) * f64::from(mos - table.target[row]).powi(2))
        .sum()
}
