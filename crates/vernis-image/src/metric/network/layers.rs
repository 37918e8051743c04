//! Layers of convolutional networks, by `burn` on its portable CPU backend.
//!
//! A network is a list of [`Layer`]s that says which tensors it needs ([`wanted`]); with their numbers it is a [`Sequence`]. Places
//! whose features a metric compares are marked by [`Layer::Tap`].

use super::tensors::{Tensors, Wanted};
use burn::tensor::activation::relu;
use burn::tensor::module::{conv2d, max_pool2d};
use burn::tensor::ops::{ConvOptions, MaxPoolOptions, PadMode};
use burn::tensor::{Device, Element, Tensor, TensorData};

/// A step of a network.
pub(super) enum Layer {
    /// A convolution with a square kernel and a bias: `<name>.weight`, `<name>.bias`.
    Conv { name: String, from: usize, to: usize, kernel: usize, stride: usize, padding: usize },
    /// max(x, 0).
    Relu,
    /// The largest value of a square window. With `ceil`, windows that reach over the right and lower edge count too.
    MaxPool { kernel: usize, stride: usize, ceil: bool },
    /// Every second value of the picture, reflected by 2 pixels at its edges and blurred by `<name>.filt`, 3 x 3.
    Blur { name: String, channels: usize },
    /// SqueezeNet's step: 1 x 1 to few channels (`<name>.squeeze`), then 1 x 1 (`.expand1x1`) and 3 x 3 (`.expand3x3`) beside each
    /// other, all with ReLU.
    Fire { name: String, from: usize, squeeze: usize, expand: usize },
    /// The features here are compared.
    Tap,
}

/// The three convolutions of [`Layer::Fire`]: name, channels before, channels after, side of the kernel.
fn fire(name: &str, from: usize, squeeze: usize, expand: usize) -> [(String, usize, usize, usize); 3] {
    [
        (format!("{name}.squeeze"), from, squeeze, 1),
        (format!("{name}.expand1x1"), squeeze, expand, 1),
        (format!("{name}.expand3x3"), squeeze, expand, 3),
    ]
}

fn wanted_conv(name: &str, from: usize, to: usize, kernel: usize) -> [Wanted; 2] {
    [Wanted::new(format!("{name}.weight"), [to, from, kernel, kernel]), Wanted::new(format!("{name}.bias"), [to])]
}

/// The tensors that a network needs, in the order of its layers.
pub(super) fn wanted(layers: &[Layer]) -> Vec<Wanted> {
    layers
        .iter()
        .flat_map(|layer| match layer {
            Layer::Conv { name, from, to, kernel, .. } => wanted_conv(name, *from, *to, *kernel).to_vec(),
            Layer::Blur { name, channels } => vec![Wanted::new(format!("{name}.filt"), [*channels, 1, 3, 3])],
            Layer::Fire { name, from, squeeze, expand } => fire(name, *from, *squeeze, *expand)
                .iter()
                .flat_map(|(name, from, to, kernel)| wanted_conv(name, *from, *to, *kernel))
                .collect(),
            Layer::Relu | Layer::MaxPool { .. } | Layer::Tap => vec![],
        })
        .collect()
}

/// The portable CPU backend.
pub(super) fn device() -> Device {
    Device::flex()
}

/// A tensor with the type of `data`.
pub(super) fn tensor<const D: usize>(data: TensorData) -> Tensor<D> {
    let dtype = data.dtype();
    Tensor::from_data(data, (&device(), dtype))
}

/// The numbers of a tensor, row by row; its type is T.
pub(super) fn numbers<T: Element>(x: &Tensor<4>) -> Vec<T> {
    x.to_data().try_into_vec().unwrap_or_else(|error| unreachable!("a network has numbers of one type: {error}"))
}

/// A convolution with zeros around the picture.
pub(super) struct Conv {
    weight: Tensor<4>,
    bias: Option<Tensor<1>>,
    options: ConvOptions<2>,
}

impl Conv {
    pub(super) fn new(weight: TensorData, bias: Option<TensorData>, stride: usize, padding: usize) -> Self {
        let options = ConvOptions::new([stride; 2], [padding; 2], [1; 2], 1);
        Self { weight: tensor(weight), bias: bias.map(tensor), options }
    }

    fn load(
        tensors: &mut Tensors,
        (name, from, to, kernel): (&str, usize, usize, usize),
        stride: usize,
        padding: usize,
    ) -> Self {
        let weight = TensorData::new(tensors.take(&format!("{name}.weight")), [to, from, kernel, kernel]);
        let bias = TensorData::new(tensors.take(&format!("{name}.bias")), [to]);
        Self::new(weight, Some(bias), stride, padding)
    }

    pub(super) fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        conv2d(x, self.weight.clone(), self.bias.clone(), self.options.clone())
    }
}

enum Step {
    Conv(Box<Conv>),
    Relu,
    MaxPool(MaxPoolOptions<2>),
    Blur(Box<Tensor<4>>),
    Fire(Box<[Conv; 3]>),
    Tap,
}

/// A network with its numbers.
pub(super) struct Sequence {
    steps: Vec<Step>,
}

impl Sequence {
    /// The network of `layers`; `tensors` has those of [`wanted`].
    pub(super) fn new(layers: &[Layer], tensors: &mut Tensors) -> Self {
        let mut step = |layer: &Layer| match layer {
            Layer::Conv { name, from, to, kernel, stride, padding } => {
                Step::Conv(Box::new(Conv::load(tensors, (name, *from, *to, *kernel), *stride, *padding)))
            }
            Layer::Relu => Step::Relu,
            Layer::MaxPool { kernel, stride, ceil } => {
                Step::MaxPool(MaxPoolOptions::new([*kernel; 2]).with_stride([*stride; 2]).with_ceil_mode(*ceil))
            }
            Layer::Blur { name, channels } => {
                let filter = tensors.take(&format!("{name}.filt"));
                Step::Blur(Box::new(tensor(TensorData::new(filter, [*channels, 1, 3, 3]))))
            }
            Layer::Fire { name, from, squeeze, expand } => {
                let convs = fire(name, *from, *squeeze, *expand);
                Step::Fire(Box::new(
                    convs.map(|(name, from, to, kernel)| Conv::load(tensors, (&name, from, to, kernel), 1, kernel / 2)),
                ))
            }
            Layer::Tap => Step::Tap,
        };
        Self { steps: layers.iter().map(&mut step).collect() }
    }

    /// Runs the network on a picture, [1, channels, rows, columns], and gives `each` the features of every tap in turn.
    pub(super) fn run(&self, picture: Tensor<4>, mut each: impl FnMut(usize, &Tensor<4>)) {
        let mut taps = 0;
        self.steps.iter().fold(picture, |x, step| match step {
            Step::Conv(conv) => conv.forward(x),
            Step::Relu => relu(x),
            Step::MaxPool(options) => max_pool2d(x, options.clone()),
            Step::Blur(filter) => {
                let options = ConvOptions::new([2; 2], [0; 2], [1; 2], filter.dims()[0]);
                conv2d(x.pad([(2, 2), (2, 2)], PadMode::Reflect), (**filter).clone(), None, options)
            }
            Step::Fire(convs) => {
                let [squeeze, small, large] = &**convs;
                let few = relu(squeeze.forward(x));
                Tensor::cat(vec![relu(small.forward(few.clone())), relu(large.forward(few))], 1)
            }
            Step::Tap => {
                each(taps, &x);
                taps += 1;
                x
            }
        });
    }
}
