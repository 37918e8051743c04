//! What LPIPS and ST-LPIPS share: the features of a network at its taps, made unit length, and their weighted square differences.

use super::layers::{Layer, Sequence, numbers, tensor, wanted};
use super::tensors::{Tensors, Wanted};
use crate::metric::contract::{Comparison, DifferenceMap, ImageMetricError, PreparedReference, PreparedResult};
use crate::picture::EncodedPicture;
use burn::tensor::module::interpolate;
use burn::tensor::ops::{InterpolateMode, InterpolateOptions};
use burn::tensor::{Tensor, TensorData};
use std::sync::Arc;
use vernis_metric::math::parallel;

/// Names of the layers' shares in [`Comparison::details`].
const LAYERS: [&str; 7] = ["layer 1", "layer 2", "layer 3", "layer 4", "layer 5", "layer 6", "layer 7"];

/// Added to lengths of features, so that none is zero.
const EPSILON: f64 = 1e-10;

/// Pixels whose differences are summed together, channel by channel.
const CHUNK: usize = 1024;

/// A network, and what LPIPS does before and after it.
pub(super) struct PerceptualNetwork {
    /// Subtracted from a channel whose values are -1 to 1.
    pub shift: [f32; 3],
    /// By which it is divided then.
    pub scale: [f32; 3],
    sequence: Sequence,
    /// Weights of the channels of each tap.
    linear: Vec<Vec<f32>>,
}

/// The tensors of the linear layers: weights of the channels of each tap.
pub(super) fn wanted_linear(channels: &[usize]) -> Vec<Wanted> {
    let one = |(i, n): (usize, &usize)| Wanted::new(format!("lin{i}.model.1.weight"), [1, *n, 1, 1]);
    channels.iter().enumerate().map(one).collect()
}

/// The tensors of the network of `layers`.
pub(super) fn wanted_network(layers: &[Layer]) -> Vec<Wanted> {
    wanted(layers)
}

impl PerceptualNetwork {
    /// The network of `layers` with numbers of `network`, and linear layers of `linear` for taps of `channels` channels.
    pub(super) fn new(
        (shift, scale): ([f32; 3], [f32; 3]),
        layers: &[Layer],
        network: &mut Tensors,
        channels: &[usize],
        linear: impl FnMut(&str) -> Vec<f32>,
    ) -> Self {
        let names = wanted_linear(channels);
        let sequence = Sequence::new(layers, network);
        Self { shift, scale, sequence, linear: names.iter().map(|w| w.name.as_str()).map(linear).collect() }
    }

    /// The picture as the network takes it.
    fn input(&self, picture: &EncodedPicture) -> Tensor<4> {
        let (width, height) = (picture.width(), picture.height());
        let channel = |c: usize| {
            picture.pixels().iter().map(move |pixel| (2.0 * (pixel[c] / 255.0) - 1.0 - self.shift[c]) / self.scale[c])
        };
        let values: Vec<f32> = (0..3).flat_map(channel).collect();
        tensor(TensorData::new(values, [1, 3, height, width]))
    }

    fn features(&self, picture: &EncodedPicture) -> Vec<Features> {
        let mut all = Vec::new();
        self.sequence.run(self.input(picture), |_, x| all.push(Features::new(x)));
        all
    }

    /// Fixes a reference.
    pub(super) fn prepare(self: &Arc<Self>, reference: &EncodedPicture) -> PreparedResult {
        Ok(Box::new(PreparedPerceptual { network: self.clone(), reference: self.features(reference) }))
    }
}

/// Features at a tap.
struct Features {
    width: usize,
    height: usize,
    /// Channel by channel, each row by row.
    values: Vec<f32>,
    /// One over the length of the features of each pixel.
    inverse: Vec<f64>,
}

impl Features {
    fn new(x: &Tensor<4>) -> Self {
        let [_, channels, height, width] = x.dims();
        let values: Vec<f32> = numbers(x);
        let pixels = width * height;
        let mut inverse = vec![0.0f64; pixels];
        parallel::for_each_chunk(&mut inverse, CHUNK, |i, chunk| {
            for c in 0..channels {
                let from = c * pixels + i * CHUNK;
                for (sum, v) in chunk.iter_mut().zip(&values[from..from + CHUNK.min(pixels - i * CHUNK)]) {
                    *sum += f64::from(*v) * f64::from(*v);
                }
            }
            chunk.iter_mut().for_each(|sum| *sum = 1.0 / (sum.sqrt() + EPSILON));
        });
        Self { width, height, values, inverse }
    }

    /// The weighted sum over channels of square differences of the features of unit length, for each pixel.
    fn differences(&self, other: &Self, weights: &[f32]) -> Vec<f64> {
        let pixels = self.width * self.height;
        let mut sums = vec![0.0f64; pixels];
        parallel::for_each_chunk(&mut sums, CHUNK, |i, chunk| {
            let (start, count) = (i * CHUNK, chunk.len());
            let (inverse, other_inverse) = (&self.inverse[start..start + count], &other.inverse[start..start + count]);
            for (c, weight) in weights.iter().enumerate() {
                let from = c * pixels + start;
                let (a, b) = (&self.values[from..from + count], &other.values[from..from + count]);
                let weight = f64::from(*weight);
                for k in 0..count {
                    let difference = f64::from(a[k]) * inverse[k] - f64::from(b[k]) * other_inverse[k];
                    chunk[k] += weight * difference * difference;
                }
            }
        });
        sums
    }
}

struct PreparedPerceptual {
    network: Arc<PerceptualNetwork>,
    reference: Vec<Features>,
}

impl PreparedReference for PreparedPerceptual {
    fn compare(&self, test: &EncodedPicture, with_map: bool) -> Result<Comparison, ImageMetricError> {
        let (width, height) = (test.width(), test.height());
        let mut layers = Vec::new();
        let mut map: Option<Tensor<4>> = None;
        self.network.sequence.run(self.network.input(test), |tap, x| {
            let reference = &self.reference[tap];
            let differences = reference.differences(&Features::new(x), &self.network.linear[tap]);
            layers.push(differences.iter().sum::<f64>() / differences.len() as f64);
            if with_map {
                let values: Vec<f32> = differences.iter().map(|v| *v as f32).collect();
                let small = tensor(TensorData::new(values, [1, 1, reference.height, reference.width]));
                let options = InterpolateOptions::new(InterpolateMode::Bilinear)
                    .with_align_corners(false)
                    .with_output_size([height, width]);
                let large = interpolate(small, options);
                map = Some(map.take().map_or(large.clone(), |sum| sum + large));
            }
        });
        let distance = layers.iter().sum();
        let values = map.map(|map| numbers(&map));
        Ok(Comparison {
            distance,
            quality: distance,
            details: LAYERS.into_iter().zip(layers).collect(),
            map: values.map(|values| DifferenceMap { width, height, values, white: 1.0 }),
        })
    }
}
