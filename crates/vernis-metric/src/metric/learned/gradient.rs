//! The exact derivative of a regressor by its raw descriptors, function by function.
//!
//! Of a term w (g(z) - g(z0)), z = z(x) and z0 with every difference at zero,
//!
//!   d/dx_i = w (dg/dz_k(z) - [input i describes the reference] dg/dz_k(z0)) dz_k/dx_i.
//!
//! Where a function has a kink, one of its subgradients is taken:
//!
//! | where | taken |
//! | --- | --- |
//! | saturated distance, z_k = 0 | 0, so that identical BRDFs are a minimum |
//! | exponential kernel at a landmark | 0 |
//! | leaky ReLU at 0 | 1, the slope above |
//! | hard clip | 1 at the limit, 0 beyond |
//! | plain power below 1 at 0 (infinite slope) | 0 |
//!
//! Cost: with the value, two to three times the value alone.

use super::regressor::{Function, Input, Kernel, Regressor, Term, at_identity, dot, saturated};
use crate::descriptor::Role;
use crate::math::layers::{Activation, Dense};

/// e of the smooth form of a saturated distance, a share of each scale: |z| becomes sqrt(z^2 + e^2) - e.
pub const SMOOTHING: f64 = 0.02;

/// Which form of a saturated distance is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Exact,
    Smooth,
}

impl Form {
    /// |z|, or its smooth form.
    fn magnitude(self, z: f64) -> f64 {
        match self {
            Self::Exact => z.abs(),
            Self::Smooth => z.hypot(SMOOTHING) - SMOOTHING,
        }
    }

    fn slope(self, z: f64) -> f64 {
        match self {
            Self::Exact if z == 0.0 => 0.0,
            Self::Exact => z.signum(),
            Self::Smooth => z / z.hypot(SMOOTHING),
        }
    }
}

impl Regressor {
    /// [`Regressor::predict`] and its derivative by every raw descriptor, in the order of `inputs`.
    ///
    /// # Panics
    /// As [`Regressor::predict`].
    pub fn gradient(&self, raw: &[f64]) -> (f64, Vec<f64>) {
        self.gradient_of(raw, Form::Exact)
    }

    /// The same of a prediction without kinks: in saturated distances |z| is sqrt(z^2 + e^2) - e, e = [`SMOOTHING`]. Still exactly
    /// `identity_mos` for identical BRDFs. A fit by gradients stalls at kinks.
    ///
    /// # Panics
    /// As [`Regressor::predict`].
    pub fn smooth_gradient(&self, raw: &[f64]) -> (f64, Vec<f64>) {
        self.gradient_of(raw, Form::Smooth)
    }

    fn gradient_of(&self, raw: &[f64], form: Form) -> (f64, Vec<f64>) {
        assert_eq!(raw.len(), self.inputs.len(), "descriptors and inputs of the regressor");
        let mut gradient = vec![0.0; raw.len()];
        let terms =
            self.terms.iter().map(|term| term.weight * term.add_gradient(raw, &self.inputs, form, &mut gradient));
        let difference: f64 = terms.sum();
        (self.identity_mos + difference, gradient)
    }
}

impl Term {
    /// g(z) - g(z0); adds its derivative, times the weight of the term, to `gradient`.
    fn add_gradient(&self, raw: &[f64], inputs: &[Input], form: Form, gradient: &mut [f64]) -> f64 {
        let z = self.standardizer.apply(raw);
        let z0 = self.standardizer.apply_at_identity(raw, inputs);
        let (mut by_z, mut by_z0) = (vec![0.0; z.len()], vec![0.0; z.len()]);
        let value = match &self.function {
            Function::Linear { weights } => {
                by_z.copy_from_slice(weights);
                by_z0.copy_from_slice(weights);
                dot(weights, &z) - dot(weights, &z0)
            }
            Function::Saturated { weights, limit } => {
                // z0 is 0 in every feature.
                let s: f64 = weights.iter().zip(&z).map(|(v, &z)| v * form.magnitude(z)).sum();
                let slope = -(-s / limit).exp();
                for ((by_z, v), &z) in by_z.iter_mut().zip(weights).zip(&z) {
                    *by_z = slope * v * form.slope(z);
                }
                saturated(s, *limit)
            }
            Function::Kernel { kernel, weights, landmarks } => {
                let origin = self.standardizer.origin(inputs);
                let landmarks = weights.iter().zip(landmarks.chunks_exact(z.len()));
                landmarks
                    .map(|(&w, b)| {
                        let b0 = at_identity(b, &origin);
                        let centred = |a: &[f64]| kernel.value(a, b) - kernel.value(a, &b0);
                        for (a, by_a) in [(&z, &mut by_z), (&z0, &mut by_z0)] {
                            kernel.add_gradient(w, a, b, by_a);
                            kernel.add_gradient(-w, a, &b0, by_a);
                        }
                        w * (centred(&z) - centred(&z0))
                    })
                    .sum()
            }
            Function::Network { activation, members } => {
                let n = members.len() as f64;
                let mean = |z: &[f64], by_z: &mut [f64]| {
                    members.iter().map(|layers| add_network(layers, *activation, z, 1.0 / n, by_z)).sum::<f64>() / n
                };
                mean(&z, &mut by_z) - mean(&z0, &mut by_z0)
            }
        };
        let slopes = self.standardizer.slopes(raw);
        for (k, f) in self.standardizer.features.iter().enumerate() {
            let moved = if inputs[f.input].role == Role::Difference { by_z[k] } else { by_z[k] - by_z0[k] };
            gradient[f.input] += self.weight * moved * slopes[k];
        }
        value
    }
}

impl Kernel {
    /// Adds w dk(a, b)/da to `by_a`.
    fn add_gradient(&self, w: f64, a: &[f64], b: &[f64], by_a: &mut [f64]) {
        let d = a.len() as f64;
        let squared: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
        let (radial, linear) = (w * self.radial_slope(squared.sqrt(), d), w * self.linear / d);
        for ((by_a, a), b) in by_a.iter_mut().zip(a).zip(b) {
            *by_a += radial * (a - b) + linear * b;
        }
    }
}

/// The output of a perceptron; adds `factor` times its derivative by the inputs to `by_z`.
fn add_network(layers: &[Dense], activation: Activation, z: &[f64], factor: f64, by_z: &mut [f64]) -> f64 {
    let Activation::LeakyRelu { slope } = activation;
    let mut x = z.to_vec();
    // What enters the activation of each hidden layer.
    let mut before = Vec::with_capacity(layers.len());
    for (i, layer) in layers.iter().enumerate() {
        if i > 0 {
            before.push(x.clone());
            x.iter_mut().for_each(|v| *v = activation.apply(*v));
        }
        x = layer.apply(&x);
    }
    let mut back = vec![factor];
    for (i, layer) in layers.iter().enumerate().rev() {
        let mut by_input = vec![0.0; layer.inputs];
        for (row, back) in layer.weights.chunks_exact(layer.inputs).zip(&back) {
            by_input.iter_mut().zip(row).for_each(|(sum, w)| *sum += w * back);
        }
        if i > 0 {
            let entered = &before[i - 1];
            by_input.iter_mut().zip(entered).filter(|(_, x)| **x < 0.0).for_each(|(sum, _)| *sum *= slope);
        }
        back = by_input;
    }
    by_z.iter_mut().zip(back).for_each(|(sum, back)| *sum += back);
    x[0]
}

#[cfg(test)]
mod tests {
    use super::super::regressor::Radial;
    use super::super::standardizer::{Clip, Feature, Standardizer};
    use super::*;
    use crate::math::seed;
    use rand::Rng;

    const FEATURES: usize = 6;

    fn inputs() -> Vec<Input> {
        let role = |i| if i < 4 { Role::Difference } else { Role::Context };
        (0..FEATURES).map(|i| Input { name: format!("c{i}"), role: role(i) }).collect()
    }

    fn random(label: &str, n: usize, size: f64) -> Vec<f64> {
        let mut rng = seed::stream(3, label, 0);
        (0..n).map(|_| size * (rng.random::<f64>() - 0.5)).collect()
    }

    fn standardizer(power: f64, clip: Clip, softening: f64) -> Standardizer {
        let feature = |input| Feature { input, mean: 0.1 * input as f64, scale: 0.7, gain: 1.3, softening };
        Standardizer { limit: 2.0, power, clip, features: (0..FEATURES).map(feature).collect() }
    }

    fn functions() -> Vec<Function> {
        let kernel = |radial| Function::Kernel {
            kernel: Kernel { radial, length: 0.8, linear: 0.2 },
            weights: random("weights", 9, 2.0),
            landmarks: random("landmarks", 9 * FEATURES, 3.0),
        };
        let layer = |inputs, outputs, label: &str| Dense {
            inputs,
            outputs,
            bias: random(&format!("{label}-bias"), outputs, 1.0),
            weights: random(label, inputs * outputs, 2.0),
        };
        let member = |m: usize| {
            let label = |layer| format!("{m}-{layer}");
            vec![layer(FEATURES, 5, &label(0)), layer(5, 4, &label(1)), layer(4, 1, &label(2))]
        };
        vec![
            Function::Linear { weights: random("linear", FEATURES, 2.0) },
            kernel(Radial::Exponential),
            kernel(Radial::Matern32),
            kernel(Radial::Gaussian),
            Function::Network { activation: Activation::LeakyRelu { slope: 0.1 }, members: vec![member(0), member(1)] },
        ]
    }

    fn saturated_regressor() -> Regressor {
        let standardizer = Standardizer::scaled((0..4).map(|input| (input, 0.5 + 0.2 * input as f64)));
        let weights = vec![0.3, 0.0, 0.7, 1.1];
        let term = Term { weight: 0.9, standardizer, function: Function::Saturated { weights, limit: 3.5 } };
        Regressor { identity_mos: 4.39, inputs: inputs(), terms: vec![term] }
    }

    fn of(standardizer: Standardizer, function: Function) -> Regressor {
        Regressor { identity_mos: 4.39, inputs: inputs(), terms: vec![Term { weight: 0.8, standardizer, function }] }
    }

    /// Largest error of the gradient against central differences of `value`, against the largest slope.
    fn error(raw: &[f64], gradient: &[f64], value: impl Fn(&[f64]) -> f64) -> f64 {
        let step = 1e-6;
        let numeric = |i: usize| {
            let moved = |by: f64| {
                let mut raw = raw.to_vec();
                raw[i] += by;
                value(&raw)
            };
            (moved(step) - moved(-step)) / (2.0 * step)
        };
        let largest = gradient.iter().fold(1e-3f64, |a, g| a.max(g.abs()));
        (0..raw.len()).map(|i| (numeric(i) - gradient[i]).abs() / largest).fold(0.0, f64::max)
    }

    #[test]
    fn every_function_agrees_with_central_differences() {
        let forms = [(0.7, Clip::Hard, 0.0), (0.7, Clip::Smooth, 0.05), (1.0, Clip::Hard, 0.0)];
        for (power, clip, softening) in forms {
            for function in functions() {
                let regressor = of(standardizer(power, clip, softening), function);
                regressor.check().unwrap();
                for k in 0..8 {
                    let raw = random(&format!("raw-{k}"), FEATURES, 5.0);
                    let (value, gradient) = regressor.gradient(&raw);
                    assert_eq!(value.to_bits(), regressor.predict(&raw).to_bits());
                    // Central differences of step h lose 1e-16/h, and h^2 of the third derivative.
                    let error = error(&raw, &gradient, |raw| regressor.predict(raw));
                    assert!(error < 1e-6, "{error} {:?} {clip:?}", regressor.terms[0].function);
                }
            }
        }
    }

    #[test]
    fn saturated_distances_agree_in_both_forms() {
        let regressor = saturated_regressor();
        regressor.check().unwrap();
        for k in 0..8 {
            let raw = random(&format!("raw-{k}"), FEATURES, 4.0);
            let (value, gradient) = regressor.gradient(&raw);
            assert_eq!(value.to_bits(), regressor.predict(&raw).to_bits());
            assert!(error(&raw, &gradient, |raw| regressor.predict(raw)) < 1e-7);
            let (smooth, gradient) = regressor.smooth_gradient(&raw);
            assert!(error(&raw, &gradient, |raw| regressor.smooth_gradient(raw).0) < 1e-7);
            // Each |z| loses at most the smoothing.
            let most: f64 = 0.9 * SMOOTHING * (0.3 + 0.7 + 1.1);
            assert!(smooth >= value && smooth - value <= most, "{smooth} {value}");
        }
    }

    #[test]
    fn identical_brdfs_get_the_identity_and_a_finite_gradient() {
        let mut all: Vec<Regressor> =
            functions().into_iter().map(|function| of(standardizer(0.7, Clip::Hard, 0.0), function)).collect();
        all.extend(functions().into_iter().map(|function| of(standardizer(0.7, Clip::Smooth, 0.05), function)));
        all.push(saturated_regressor());
        for regressor in all {
            let raw = [0.0, 0.0, 0.0, 0.0, 0.4, -1.2];
            let (value, gradient) = regressor.gradient(&raw);
            assert_eq!(value, regressor.identity_mos);
            assert!(gradient.iter().all(|g| g.is_finite()));
            let (value, gradient) = regressor.smooth_gradient(&raw);
            assert_eq!(value, regressor.identity_mos);
            assert!(gradient.iter().all(|g| g.is_finite()));
        }
        // The subgradient of the distance is 0 at the minimum.
        assert_eq!(saturated_regressor().gradient(&[0.0; FEATURES]).1, vec![0.0; FEATURES]);
    }

    #[test]
    fn the_smooth_clip_neither_overflows_nor_leaves_its_limits() {
        let standardizer = standardizer(0.7, Clip::Smooth, 0.05);
        for x in [1e300, -1e300, 1e12, 3.0, f64::MIN_POSITIVE] {
            let raw = [x; FEATURES];
            let z = standardizer.apply(&raw);
            assert!(z.iter().all(|z| z.abs() <= 2.0 * 1.3 && z.signum() == x.signum() || x.abs() < 1.0), "{z:?}");
            assert!(standardizer.slopes(&raw).iter().all(|s| s.is_finite() && *s >= 0.0));
        }
    }

    #[test]
    fn what_is_no_distance_is_refused() {
        let refused = |change: &dyn Fn(&mut Term)| {
            let mut regressor = saturated_regressor();
            change(&mut regressor.terms[0]);
            regressor.check().unwrap_err().to_string()
        };
        let message = refused(&|t| t.standardizer.features[1].input = 5);
        assert!(message.contains("c5, which describes the reference alone"), "{message}");
        let message = refused(&|t| t.standardizer.features[1].mean = 0.1);
        assert!(message.contains("mean of feature 1 of a saturated distance is 0.1"), "{message}");
        let message = refused(&|t| t.function = Function::Saturated { weights: vec![0.1, -0.1, 0.0, 0.0], limit: 3.0 });
        assert!(message.contains("a weight of the saturated distance is -0.1"), "{message}");
        let message = refused(&|t| t.function = Function::Saturated { weights: vec![0.1; 4], limit: 0.0 });
        assert!(message.contains("the limit of the saturated distance is 0.0"), "{message}");
        let message = refused(&|t| t.function = Function::Saturated { weights: vec![0.1; 3], limit: 1.0 });
        assert!(message.contains("weights of the saturated distance is 3; it must be 4"), "{message}");
    }
}
