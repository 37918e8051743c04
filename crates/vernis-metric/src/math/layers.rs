//! Dense layers, one after the other: what a trained perceptron is once training is over.
//!
//!   x_0 = x,   x_{k+1} = W_k a_k(x_k) + b_k,   a_0 the identity, a_k (k > 0) the activation
//!
//! W_k: outputs x inputs, row by row. Cost: one multiplication a weight.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A size that does not fit the one before it.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("the number of {what} is {found}; it must be {expected}")]
pub struct LayerMismatch {
    /// What has the size, in words.
    pub what: String,
    /// The size that it has.
    pub found: usize,
    /// The size that it must have.
    pub expected: usize,
}

/// One dense layer: `weights[o * inputs + i]`, `bias[o]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dense {
    /// Length of the input x.
    pub inputs: usize,
    /// Length of the output W x + b.
    pub outputs: usize,
    /// b, one number an output.
    pub bias: Vec<f64>,
    /// W, `outputs * inputs` numbers, row by row.
    pub weights: Vec<f64>,
}

impl Dense {
    /// W x + b.
    pub fn apply(&self, x: &[f64]) -> Vec<f64> {
        let dot = |w: &[f64]| -> f64 { w.iter().zip(x).map(|(w, x)| w * x).sum() };
        self.weights.chunks_exact(self.inputs).zip(&self.bias).map(|(w, b)| b + dot(w)).collect()
    }

    /// Weights, then bias.
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        self.weights.iter().chain(&self.bias).copied()
    }
}

/// What follows every layer but the last.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
#[non_exhaustive]
pub enum Activation {
    /// max(x, slope x).
    LeakyRelu {
        /// Factor of negative x.
        slope: f64,
    },
}

impl Activation {
    /// The activation of one number.
    pub fn apply(self, x: f64) -> f64 {
        match self {
            Activation::LeakyRelu { slope } => x.max(slope * x),
        }
    }
}

/// Layers one after the other, with an activation after each but the last; no layers are the identity. The layers must
/// pass [`check_layers`] for the length of `x`.
pub fn forward(layers: &[Dense], activation: Activation, x: &[f64]) -> Vec<f64> {
    let mut x = x.to_vec();
    for (i, layer) in layers.iter().enumerate() {
        if i > 0 {
            x.iter_mut().for_each(|v| *v = activation.apply(*v));
        }
        x = layer.apply(&x);
    }
    x
}

/// The number of outputs of layers that take `inputs` numbers.
///
/// # Errors
/// A layer without inputs or outputs, or sizes that do not chain.
pub fn check_layers(layers: &[Dense], inputs: usize) -> Result<usize, LayerMismatch> {
    let size = |what: &str, i: usize, found: usize, expected: usize| {
        if found == expected {
            return Ok(());
        }
        Err(LayerMismatch { what: format!("{what} of layer {i}"), found, expected })
    };
    let mut width = inputs;
    for (i, layer) in layers.iter().enumerate() {
        size("inputs", i, layer.inputs, width.max(1))?;
        size("outputs", i, layer.outputs, layer.outputs.max(1))?;
        size("weights", i, layer.weights.len(), layer.inputs.saturating_mul(layer.outputs))?;
        size("biases", i, layer.bias.len(), layer.outputs)?;
        width = layer.outputs;
    }
    Ok(width)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAKY: Activation = Activation::LeakyRelu { slope: 0.1 };

    fn layer(inputs: usize, weights: &[f64], bias: &[f64]) -> Dense {
        Dense { inputs, outputs: bias.len(), bias: bias.to_vec(), weights: weights.to_vec() }
    }

    #[test]
    fn two_layers_by_hand() {
        let layers = [layer(2, &[1.0, 2.0, -1.0, 0.5], &[0.5, 0.0]), layer(2, &[2.0, 10.0], &[1.0])];
        assert_eq!(check_layers(&layers, 2), Ok(1));
        // 1 + 2 + 0.5 = 3.5; -1 + 0.5 = -0.5, which leaks to -0.05.
        assert_eq!(forward(&layers, LEAKY, &[1.0, 1.0]), [1.0 + 7.0 - 0.5]);
        assert_eq!(forward(&[], LEAKY, &[-3.0]), [-3.0]);
    }

    #[test]
    fn layers_that_do_not_chain_are_refused() {
        let refused = |layers: &[Dense], inputs| check_layers(layers, inputs).unwrap_err().to_string();
        let good = layer(1, &[1.0], &[0.0]);
        assert_eq!(refused(std::slice::from_ref(&good), 2), "the number of inputs of layer 0 is 1; it must be 2");
        assert_eq!(
            refused(&[good.clone(), layer(1, &[1.0, 2.0], &[0.0])], 1),
            "the number of weights of layer 1 is 2; it must be 1"
        );
        // Without inputs or outputs there would be nothing to take rows of.
        assert_eq!(
            refused(&[layer(1, &[], &[]), layer(0, &[], &[1.0])], 1),
            "the number of outputs of layer 0 is 0; it must be 1"
        );
        assert_eq!(refused(&[layer(0, &[], &[1.0])], 0), "the number of inputs of layer 0 is 0; it must be 1");
    }
}
