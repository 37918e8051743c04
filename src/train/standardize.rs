//! Standardisation fitted on training rows: z = gain clip((sign(x) |x|^power - mean) / scale, -limit, limit).
//!
//! Mean and standard deviation are weighted by the rows' training weights. A column that does not vary over the
//! training rows is left out, for nothing can be learned from it.

use super::TrainError;
use crate::samples::split::TrainingSet;
use ndarray::{Array2, ArrayView2};
use vernis_metric::descriptor::Family;
use vernis_metric::descriptor::Role;
use vernis_metric::metric::learned::{Feature, Input, Standardizer, sign_power};

/// Standardised features are clipped to this many standard deviations.
const LIMIT: f64 = 4.0;
/// Between the square root, which flattens large differences, and none, which lets the tails rule.
const POWER: f64 = 0.7;
/// The pictures under lamps tell more than any other family, by cross-validation on the open study.
const LIGHTS_GAIN: f64 = 1.6;

/// A training set in standardised units.
pub(super) struct Standardized {
    pub inputs: Vec<Input>,
    pub standardizer: Standardizer,
    /// Rows x features.
    pub z: Array2<f64>,
    /// The same rows with every difference at zero.
    pub z0: Array2<f64>,
}

impl Standardized {
    /// Fails where no difference varies over the rows.
    pub(super) fn fit(trainer: &str, set: &TrainingSet) -> Result<Self, TrainError> {
        let inputs: Vec<Input> = set.columns().iter().map(Input::from).collect();
        let weights = set.weights();
        let total: f64 = weights.iter().sum();
        let mut features = Vec::new();
        for (input, column) in set.features().columns().into_iter().enumerate() {
            let weighted = |f: &dyn Fn(f64) -> f64| -> f64 {
                column.iter().zip(&weights).map(|(&x, w)| w * f(sign_power(x, POWER))).sum::<f64>() / total
            };
            let mean = weighted(&|x| x);
            let scale = weighted(&|x| (x - mean) * (x - mean)).sqrt();
            if scale > 1e-12 * mean.abs() && scale.is_normal() {
                let gain = if set.columns()[input].family == Family::Lights.name() { LIGHTS_GAIN } else { 1.0 };
                features.push(Feature { input, mean, scale, gain });
            }
        }
        if !features.iter().any(|f| inputs[f.input].role == Role::Difference) {
            return Err(TrainError::NoDifference { trainer: trainer.to_owned() });
        }
        let standardizer = Standardizer { limit: LIMIT, power: POWER, features };
        let z = apply_rows(&standardizer, set.features(), None);
        let z0 = apply_rows(&standardizer, set.features(), Some(&inputs));
        Ok(Self { inputs, standardizer, z, z0 })
    }
}

/// Rows x inputs to rows x features; with `at_identity`, every difference of those inputs at zero.
pub(super) fn apply_rows(
    standardizer: &Standardizer,
    raw: ArrayView2<'_, f64>,
    at_identity: Option<&[Input]>,
) -> Array2<f64> {
    let mut z = Array2::zeros((raw.nrows(), standardizer.features.len()));
    for (row, mut out) in raw.outer_iter().zip(z.outer_iter_mut()) {
        let row = row.to_vec();
        let values = match at_identity {
            None => standardizer.apply(&row),
            Some(inputs) => standardizer.apply_at_identity(&row, inputs),
        };
        out.iter_mut().zip(values).for_each(|(o, v)| *o = v);
    }
    z
}
