//! Several small perceptrons of one shape, trained side by side as one tensor program.
//!
//! Layer l of member m computes x W_lm + b_lm. The weights of all members are stacked, [members, inputs, outputs], so that
//! one batched product serves them all: networks this small spend their time in the overhead of each operation, not in
//! arithmetic. Members do not interact; each has its own rows, initial weights, noise and dropout.
//!
//! All random numbers come from named streams on this side (see [`vernis_metric::math::seed`]), never from the tensor
//! library's generator, and the library runs single-threaded: the same seed gives the same bytes however many threads
//! train at the same time.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;
use vernis_metric::math::seed;
use vernis_metric::metric::learned::Dense;

/// Slope of every activation for negative inputs.
pub const LEAK: f64 = 0.1;

/// The device that trains: the portable CPU backend with gradients.
pub(super) fn device() -> Device {
    Device::flex().autodiff()
}

pub(super) fn tensor<const D: usize>(values: Vec<f32>, shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values, shape), device)
}

#[derive(Module, Debug)]
struct StackedDense {
    /// [members, inputs, outputs].
    weight: Param<Tensor<3>>,
    /// [members, 1, outputs].
    bias: Param<Tensor<3>>,
}

/// The stacked members.
#[derive(Module, Debug)]
pub(super) struct Stack {
    layers: Vec<StackedDense>,
}

impl Stack {
    /// Members with layers of the given widths, inputs first. Member m draws its weights from stream m of `label`,
    /// uniformly in +-1/sqrt(inputs) as LeCun et al. (1998), "Efficient BackProp", 4.6, have it up to a constant.
    pub(super) fn new(members: usize, widths: &[usize], seed: u64, label: &str, device: &Device) -> Self {
        let mut streams: Vec<_> = (0..members as u64).map(|m| seed::stream(seed, label, m)).collect();
        let layers = widths.windows(2).map(|w| {
            let (inputs, outputs) = (w[0], w[1]);
            let bound = 1.0 / (inputs as f32).sqrt();
            let mut draw = |n: usize| -> Vec<f32> {
                streams
                    .iter_mut()
                    .flat_map(|rng| (0..n).map(|_| rng.random_range(-bound..bound)).collect::<Vec<_>>())
                    .collect()
            };
            let weight = TensorData::new(draw(inputs * outputs), [members, inputs, outputs]);
            let bias = TensorData::new(draw(outputs), [members, 1, outputs]);
            StackedDense { weight: Param::from_data(weight, device), bias: Param::from_data(bias, device) }
        });
        Self { layers: layers.collect() }
    }

    /// [members, rows, inputs] to [members, rows, outputs]. The outputs of hidden layer l are multiplied by `masks[l]`
    /// (dropout), where there is one.
    pub(super) fn forward(&self, x: Tensor<3>, masks: &[Tensor<3>]) -> Tensor<3> {
        let last = self.layers.len() - 1;
        self.layers.iter().enumerate().fold(x, |x, (l, layer)| {
            let y = x.matmul(layer.weight.val()) + layer.bias.val();
            if l == last {
                return y;
            }
            // max(y, LEAK y), written with |y|: the library's own form gathers by a mask, at four times the cost.
            let y = y.clone() * (0.5 + 0.5 * LEAK) + y.abs() * (0.5 - 0.5 * LEAK);
            match masks.get(l) {
                Some(mask) => y * mask.clone(),
                None => y,
            }
        })
    }

    /// The layers of each member as plain data, and whether every number is finite.
    pub(super) fn export(&self) -> (Vec<Vec<Dense>>, bool) {
        let mut members: Vec<Vec<Dense>> = Vec::new();
        let mut finite = true;
        for layer in &self.layers {
            let [count, inputs, outputs] = layer.weight.val().dims();
            members.resize_with(count, Vec::new);
            let weights = read(layer.weight.val());
            let bias = read(layer.bias.val());
            finite &= weights.iter().chain(&bias).all(|v| v.is_finite());
            for (m, member) in members.iter_mut().enumerate() {
                let w = &weights[m * inputs * outputs..(m + 1) * inputs * outputs];
                member.push(Dense {
                    inputs,
                    outputs,
                    bias: bias[m * outputs..(m + 1) * outputs].iter().map(|&b| f64::from(b)).collect(),
                    weights: (0..outputs * inputs).map(|i| f64::from(w[(i % inputs) * outputs + i / inputs])).collect(),
                });
            }
        }
        (members, finite)
    }
}

/// The numbers of a tensor. What cannot be read counts as not finite.
pub(super) fn read<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    let length = tensor.shape().num_elements();
    tensor.try_into_vec_as::<f32>().unwrap_or_else(|_| vec![f32::NAN; length])
}

/// Cosine annealing from `rate` to 0 (Loshchilov & Hutter 2017, "SGDR", eq. 5, one cycle).
pub(super) fn cosine_rate(rate: f64, step: usize, steps: usize) -> f64 {
    0.5 * rate * (1.0 + (std::f64::consts::PI * step as f64 / steps as f64).cos())
}

#[cfg(test)]
mod tests {
    use super::*;
    use vernis_metric::metric::learned::{Activation, forward};

    #[test]
    fn exported_layers_compute_what_the_tensors_compute() {
        let (members, rows, widths) = (3, 20, [7, 32, 16, 1]);
        let stack = Stack::new(members, &widths, 11, "parity", &device());
        let mut rng = seed::stream(11, "parity-inputs", 0);
        let x: Vec<f32> = (0..members * rows * 7).map(|_| rng.random_range(-4.0..4.0)).collect();
        let tensors = read(stack.forward(tensor(x.clone(), [members, rows, 7], &device()), &[]));
        let (exported, finite) = stack.export();
        assert!(finite);
        for (i, row) in x.chunks(7).enumerate() {
            let row: Vec<f64> = row.iter().map(|&v| f64::from(v)).collect();
            let plain = forward(&exported[i / rows], Activation::LeakyRelu { slope: LEAK }, &row)[0];
            // Sums of at most 32 products of order 1 in f32: 32 x 6e-8, over three layers.
            assert!((plain - f64::from(tensors[i])).abs() < 1e-5, "{plain} {}", tensors[i]);
        }
    }
}
