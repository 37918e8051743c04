//! A small autoencoder of BRDF tables: a code of a few numbers from which the table can be rebuilt.
//!
//! Rows of a matrix (log-mapped tables) are reduced to principal components s, divided by one common scale u, and
//!
//!   code = e(s / u),   s / u ~ d(code)
//!
//! are perceptrons with one hidden layer each (leaky ReLU), trained to minimise the mean squared error of the rebuilt
//! components, which is that of the rebuilt rows within the components' span. Noise on the inputs makes it a denoising
//! autoencoder (Vincent et al. 2010). The code is scaled to unit variance over the training rows, so that differences
//! of codes are comparable. Source: Hinton & Salakhutdinov (2006), doi:10.1126/science.1127647; of BRDFs Zheng et al.
//! (2022), doi:10.1111/cgf.14475. Cost: about a second for 200 rows.

use super::network::{LEAK, Stack, cosine_rate, device, read, tensor};
use crate::train::TrainError;
use crate::train::embedding::PrincipalComponents;
use burn::module::Module;
use burn::optim::{AdamWConfig, GradientsParams};
use ndarray::{Array2, ArrayView2};
use rand::Rng;
use vernis_metric::math::seed;
use vernis_metric::metric::learned::{Activation, Dense, forward};

const NAME: &str = "autoencoder";

/// Options of the autoencoder.
#[derive(Debug, Clone, PartialEq)]
pub struct Autoencoder {
    /// Principal components that enter; fewer where there are fewer rows.
    pub components: usize,
    /// Width of the hidden layers.
    pub hidden: usize,
    /// Numbers of the code.
    pub code: usize,
    /// Steps over all rows.
    pub epochs: usize,
    /// Learning rate at the start of the cosine.
    pub rate: f64,
    /// Decoupled weight decay, as a factor of the learning rate.
    pub decay: f64,
    /// Half-width of the uniform noise on the inputs, in units of their scale.
    pub noise: f64,
}

impl Default for Autoencoder {
    fn default() -> Self {
        Self { components: 64, hidden: 32, code: 8, epochs: 800, rate: 5e-3, decay: 1e-3, noise: 0.1 }
    }
}

/// The encoder as plain numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Encoder {
    /// The principal components that enter.
    pub components: PrincipalComponents,
    /// Divides the components' scores.
    pub scale: f64,
    /// From scaled scores to the code.
    pub layers: Vec<Dense>,
    /// Follows every layer but the last.
    pub activation: Activation,
    /// Share of the rows' variance, within the components' span, that the decoder rebuilds from the code.
    pub rebuilt: f64,
}

impl Encoder {
    /// The code of one row.
    pub fn encode(&self, row: &[f64]) -> Vec<f64> {
        let scores: Vec<f64> = self.components.scores(row).iter().map(|s| s / self.scale).collect();
        forward(&self.layers, self.activation, &scores)
    }
}

#[derive(Module, Debug)]
struct Halves {
    encoder: Stack,
    decoder: Stack,
}

impl Autoencoder {
    /// Learns from rows x columns.
    pub fn train(&self, rows: ArrayView2<'_, f64>, seed: u64) -> Result<Encoder, TrainError> {
        let sizes = [
            ("the width of the hidden layers", self.hidden),
            ("the size of the code", self.code),
            ("the number of epochs", self.epochs),
        ];
        if let Some((what, _)) = sizes.into_iter().find(|s| s.1 == 0) {
            return Err(TrainError::Option { trainer: NAME.into(), what, value: 0.0, allowed: "at least 1" });
        }
        let count = self.components.min(rows.nrows().saturating_sub(1)).min(rows.ncols());
        let components = PrincipalComponents::fit(rows, count)?;
        let scores = (&rows - &components.mean).dot(&components.components.t());
        let scale = (scores.iter().map(|s| s * s).sum::<f64>() / scores.len() as f64).sqrt();
        let scaled = scores / scale;

        let (halves, rebuilt) = self.fit(&scaled, seed);
        let (mut members, finite) = halves.encoder.export();
        let layers = members.pop().filter(|_| finite && rebuilt.is_finite());
        let Some(mut layers) = layers else {
            return Err(TrainError::Diverged { trainer: NAME.into(), what: "a weight", epochs: self.epochs });
        };
        let activation = Activation::LeakyRelu { slope: LEAK };
        normalise(&mut layers, activation, &scaled);
        Ok(Encoder { components, scale, layers, activation, rebuilt })
    }

    fn fit(&self, scaled: &Array2<f64>, seed: u64) -> (Halves, f64) {
        let device = device();
        let (n, d) = scaled.dim();
        let mut halves = Halves {
            encoder: Stack::new(1, &[d, self.hidden, self.code], seed, "encoder", &device),
            decoder: Stack::new(1, &[self.code, self.hidden, d], seed, "decoder", &device),
        };
        let clean: Vec<f32> = scaled.iter().map(|&v| v as f32).collect();
        let target = tensor(clean.clone(), [1, n, d], &device);
        let mut noise = seed::stream(seed, "autoencoder-noise", 0);
        let mut optimizer = AdamWConfig::new().with_epsilon(1e-8).with_weight_decay(self.decay as f32).init();
        for epoch in 0..self.epochs {
            let noisy = clean.iter().map(|v| v + (noise.random::<f32>() * 2.0 - 1.0) * self.noise as f32).collect();
            let code = halves.encoder.forward(tensor(noisy, [1, n, d], &device), &[]);
            let error = halves.decoder.forward(code, &[]) - target.clone();
            let gradients = (error.clone() * error).mean().backward();
            let gradients = GradientsParams::from_grads(gradients, &halves);
            halves = optimizer.step(cosine_rate(self.rate, epoch, self.epochs), halves, gradients);
        }
        let rebuilt = read(halves.decoder.forward(halves.encoder.forward(target, &[]), &[]));
        let error: f64 = rebuilt.iter().zip(scaled).map(|(r, s)| (f64::from(*r) - s).powi(2)).sum();
        (halves, 1.0 - error / scaled.iter().map(|s| s * s).sum::<f64>())
    }
}

/// Scales and shifts the last layer so that each number of the code has mean 0 and variance 1 over the rows. A number
/// that does not vary stays as it is.
fn normalise(layers: &mut [Dense], activation: Activation, rows: &Array2<f64>) {
    let codes: Vec<Vec<f64>> = rows.outer_iter().map(|r| forward(layers, activation, &r.to_vec())).collect();
    let Some(last) = layers.last_mut() else { return };
    let n = codes.len() as f64;
    for (o, weights) in last.weights.chunks_exact_mut(last.inputs).enumerate() {
        let mean = codes.iter().map(|c| c[o]).sum::<f64>() / n;
        let deviation = (codes.iter().map(|c| (c[o] - mean).powi(2)).sum::<f64>() / n).sqrt();
        let divisor = if deviation > 1e-9 { deviation } else { 1.0 };
        weights.iter_mut().for_each(|w| *w /= divisor);
        last.bias[o] = (last.bias[o] - mean) / divisor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vernis_metric::math::seed::stream;

    /// Rows on a curved surface with three parameters.
    fn rows() -> Array2<f64> {
        let mut rng = stream(7, "autoencoder-test", 0);
        let parameters: Vec<[f64; 3]> = (0..90).map(|_| std::array::from_fn(|_| rng.random::<f64>())).collect();
        Array2::from_shape_fn((90, 200), |(i, j)| {
            let ([a, b, c], x) = (parameters[i], j as f64 / 200.0);
            3.0 * a * (-((x - b) / (0.1 + 0.3 * c)).powi(2)).exp() + c * x
        })
    }

    #[test]
    fn rebuilds_a_curved_surface_better_than_as_many_components() {
        let rows = rows();
        let options = Autoencoder { code: 3, ..Autoencoder::default() };
        let encoder = options.train(rows.view(), 1).unwrap();
        let linear: f64 = PrincipalComponents::fit(rows.view(), 3).unwrap().explained.iter().sum();
        assert!(encoder.rebuilt > linear + 0.01, "{} {linear}", encoder.rebuilt);
        let codes: Vec<Vec<f64>> = rows.outer_iter().map(|r| encoder.encode(&r.to_vec())).collect();
        for o in 0..3 {
            let mean = codes.iter().map(|c| c[o]).sum::<f64>() / 90.0;
            let variance = codes.iter().map(|c| (c[o] - mean).powi(2)).sum::<f64>() / 90.0;
            assert!(mean.abs() < 1e-9 && (variance - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_encoder() {
        let rows = rows();
        let options = Autoencoder { epochs: 20, ..Autoencoder::default() };
        assert_eq!(options.train(rows.view(), 1).unwrap(), options.train(rows.view(), 1).unwrap());
        assert_ne!(options.train(rows.view(), 1).unwrap().layers, options.train(rows.view(), 2).unwrap().layers);
    }
}
