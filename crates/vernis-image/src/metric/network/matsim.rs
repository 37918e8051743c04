//! MatSim: how far apart two materials are in a space that a network learned from people's judgements of similarity.
//!
//!   MatSim(x, y) = |e(x) - e(y)|
//!
//! e: 128 numbers that a ResNet-34 and a linear layer make of a picture; |.|: the Euclidean length. The picture's shorter side is
//! made 256 pixels (bilinear, antialiased, as Pillow does it), its middle 224 x 224 is taken, and codes are divided by 255.
//!
//! Source: Lagunas, Malpica, Serrano, Garces, Gutierrez and Masia 2019 (doi:10.1145/3306346.3323036), ResNet-34 by He et al. 2016
//! (doi:10.1109/CVPR.2016.90). Agrees with the network in PyTorch, filled by formula, within the rounding of its 32-bit numbers (2e-6 of the
//! distance); the authors' checkpoint was never at hand. This one
//! computes in 64 bits. The embeddings are not made unit length, as the authors' programs have it by default.
//!
//! Weights: `model_best.pth.tar`, see [`crate::metric::WEIGHTS_FILES`]. It is not shipped.
//!
//! Display: none; codes are taken as they are. Blind to: what lies outside the middle of the picture, viewing distance, and changes
//! that people did not take for another material, such as another shape or light, as far as it has learned so.

use super::layers::{Conv, numbers, tensor};
use super::loaded;
use super::resize::{SIDE, resized_middle};
use super::tensors::{self, Tensors, Wanted};
use crate::metric::contract::{
    Comparison, Conditions, ImageMetric, ImageMetricError, Need, PreparedReference, PreparedResult, Properties,
};
use crate::metric::weights::{Weights, WeightsError, WeightsFile};
use crate::picture::EncodedPicture;
use burn::tensor::activation::relu;
use burn::tensor::module::max_pool2d;
use burn::tensor::ops::MaxPoolOptions;
use burn::tensor::{Tensor, TensorData};
use std::path::Path;
use std::sync::Arc;

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

const FILES: &[&str] = &["model_best.pth.tar"];

/// Blocks and channels of the four stages of ResNet-34.
const STAGES: [(usize, usize); 4] = [(3, 64), (4, 128), (6, 256), (3, 512)];
/// Numbers of an embedding.
const EMBEDDING: usize = 128;
/// Added to variances, as PyTorch does.
const EPSILON: f64 = 1e-5;

/// The metric.
#[derive(Clone, Copy, Debug)]
pub struct MatSim;

impl ImageMetric for MatSim {
    fn name(&self) -> &'static str {
        "matsim"
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        Properties {
            needs: vec![Need::Weights { files: FILES }],
            has_map: false,
            ..Properties::new("distance of embeddings", "1, from 0", "Lagunas et al. 2019, doi:10.1145/3306346.3323036")
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, conditions: &Conditions) -> PreparedResult {
        let load = |weights: &Weights, files: &[&WeightsFile]| Network::read(&weights.checked(files[0])?);
        let network = loaded(self.name(), FILES, conditions, load)?;
        let reference = network.embedding(reference);
        Ok(Box::new(PreparedMatSim { network, reference }))
    }
}

struct PreparedMatSim {
    network: Arc<Network>,
    reference: Vec<f64>,
}

impl PreparedReference for PreparedMatSim {
    fn compare(&self, test: &EncodedPicture, _: bool) -> Result<Comparison, ImageMetricError> {
        let test = self.network.embedding(test);
        let squares = self.reference.iter().zip(&test).map(|(a, b)| (a - b) * (a - b));
        let distance = squares.sum::<f64>().sqrt();
        Ok(Comparison { distance, quality: distance, details: vec![], map: None })
    }
}

/// A convolution without a bias and the normalisation after it.
struct NormalisedConv {
    conv: String,
    norm: String,
    from: usize,
    to: usize,
    kernel: usize,
    stride: usize,
}

/// The statistics and the factors of a normalisation.
const NORM: [&str; 4] = ["weight", "bias", "running_mean", "running_var"];

impl NormalisedConv {
    fn wanted(&self) -> Vec<Wanted> {
        let weight = Wanted::new(format!("{}.weight", self.conv), [self.to, self.from, self.kernel, self.kernel]);
        let norm = NORM.iter().map(|part| Wanted::new(format!("{}.{part}", self.norm), [self.to]));
        std::iter::once(weight).chain(norm).collect()
    }

    /// Both as one convolution: y = (x - mean)/sqrt(variance + 1e-5) weight + bias.
    fn load(&self, path: &Path, tensors: &mut Tensors) -> Result<Conv, WeightsError> {
        let weight = tensors.take(&format!("{}.weight", self.conv));
        let [factor, bias, mean, variance] = NORM.map(|part| tensors.take(&format!("{}.{part}", self.norm)));
        if let Some(at) = variance.iter().position(|v| *v < 0.0) {
            let (name, value) = (&self.norm, variance[at]);
            let reason = format!("number {at} of tensor {name}.running_var is {value}; it must be at least 0");
            return Err(WeightsError::new(path, reason));
        }
        let scale = |c: usize| f64::from(factor[c]) / (f64::from(variance[c]) + EPSILON).sqrt();
        let size = self.from * self.kernel * self.kernel;
        let weight: Vec<f64> = weight.iter().enumerate().map(|(i, w)| f64::from(*w) * scale(i / size)).collect();
        let bias = (0..self.to).map(|c| f64::from(bias[c]) - f64::from(mean[c]) * scale(c)).collect::<Vec<f64>>();
        let weight = TensorData::new(weight, [self.to, self.from, self.kernel, self.kernel]);
        Ok(Conv::new(weight, Some(TensorData::new(bias, [self.to])), self.stride, self.kernel / 2))
    }
}

/// The convolutions of a block; the third leads around the others where size or channels change.
fn block(stage: usize, index: usize) -> Vec<NormalisedConv> {
    let to = STAGES[stage].1;
    let (from, stride) = match (stage, index) {
        (0, _) => (to, 1),
        (_, 0) => (STAGES[stage - 1].1, 2),
        _ => (to, 1),
    };
    let name = format!("new_model.{}.{index}", stage + 4);
    let one = |conv: &str, norm: &str, from: usize, kernel: usize, stride: usize| NormalisedConv {
        conv: format!("{name}.{conv}"),
        norm: format!("{name}.{norm}"),
        from,
        to,
        kernel,
        stride,
    };
    let mut convs = vec![one("conv1", "bn1", from, 3, stride), one("conv2", "bn2", to, 3, 1)];
    if stride != 1 {
        convs.push(one("downsample.0", "downsample.1", from, 1, stride));
    }
    convs
}

/// The first convolution, before all blocks.
fn first() -> NormalisedConv {
    let [conv, norm] = ["new_model.0", "new_model.1"].map(str::to_owned);
    NormalisedConv { conv, norm, from: 3, to: 64, kernel: 7, stride: 2 }
}

/// All blocks, in order.
fn blocks() -> impl Iterator<Item = Vec<NormalisedConv>> {
    (0..STAGES.len()).flat_map(|stage| (0..STAGES[stage].0).map(move |index| block(stage, index)))
}

/// The network.
struct Network {
    first: Conv,
    blocks: Vec<Vec<Conv>>,
    /// 128 rows of 512 numbers.
    weight: Vec<f64>,
    bias: Vec<f64>,
}

impl Network {
    fn read(path: &Path) -> Result<Self, WeightsError> {
        let mut wanted = first().wanted();
        wanted.extend(blocks().flatten().flat_map(|conv| conv.wanted()));
        let inputs = STAGES[3].1;
        wanted.extend([Wanted::new("fc.weight", [EMBEDDING, inputs]), Wanted::new("fc.bias", [EMBEDDING])]);
        // The layer that named materials while the network was trained, and counters of its training.
        let left_aside = |name: &str| name.starts_with("fc2.") || name.ends_with(".num_batches_tracked");
        let mut tensors = tensors::read(path, &wanted, left_aside)?;
        let mut load = |conv: &NormalisedConv| conv.load(path, &mut tensors);
        let first = load(&first())?;
        let blocks = blocks().map(|block| block.iter().map(&mut load).collect()).collect::<Result<_, _>>()?;
        let [weight, bias] =
            ["fc.weight", "fc.bias"].map(|name| tensors.take(name).into_iter().map(f64::from).collect());
        Ok(Self { first, blocks, weight, bias })
    }

    /// The embedding of a picture.
    fn embedding(&self, picture: &EncodedPicture) -> Vec<f64> {
        let codes = resized_middle(picture);
        let channel = |c: usize| codes.iter().map(move |code| f64::from(code[c]) / 255.0);
        let values: Vec<f64> = (0..3).flat_map(channel).collect();
        let x: Tensor<4> = tensor(TensorData::new(values, [1, 3, SIDE, SIDE]));
        let pool = MaxPoolOptions::new([3; 2]).with_stride([2; 2]).with_padding([1; 2]);
        let x = max_pool2d(relu(self.first.forward(x)), pool);
        let x = self.blocks.iter().fold(x, |x, block| {
            let y = block[1].forward(relu(block[0].forward(x.clone())));
            let around = block.get(2).map_or(x.clone(), |conv| conv.forward(x));
            relu(y + around)
        });
        let [_, channels, height, width] = x.dims();
        let pixels = height * width;
        let values: Vec<f64> = numbers(&x);
        let mean = |c: usize| values[c * pixels..(c + 1) * pixels].iter().sum::<f64>() / pixels as f64;
        let means: Vec<f64> = (0..channels).map(mean).collect();
        let rows = self.weight.chunks_exact(channels).zip(&self.bias);
        rows.map(|(row, bias)| bias + row.iter().zip(&means).map(|(w, m)| w * m).sum::<f64>()).collect()
    }
}
