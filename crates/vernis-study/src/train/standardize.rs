//! Standardisation fitted on training rows: z = gain clip((p(x) - mean) / scale), p(x) = sign(x) |x|^0.7 or a smooth form of it.
//!
//! Mean and standard deviation are weighted by the rows' training weights. A column that does not vary over the
//! training rows is left out, for nothing can be learned from it.

use super::TrainError;
use crate::samples::split::TrainingSet;
use ndarray::{Array2, ArrayView2};
use vernis_metric::descriptor::{Column, Family, Role};
use vernis_metric::metric::learned::{Clip, Feature, Input, Standardizer, soft_power};

/// Standardised features are clipped to this many standard deviations.
const LIMIT: f64 = 4.0;
/// Between the square root, which flattens large differences, and none, which lets the tails rule.
const POWER: f64 = 0.7;
/// The pictures under lamps tell more than any other family, by cross-validation on the open study.
const LIGHTS_GAIN: f64 = 1.6;
/// Of the smooth power: its softening is this share of a column's standard deviation.
const SOFTENING: f64 = 0.05;

/// A training set in standardised units.
pub(super) struct Standardized {
    pub inputs: Vec<Input>,
    pub standardizer: Standardizer,
    /// Rows x features.
    pub z: Array2<f64>,
    /// The same rows with every difference at zero.
    pub z0: Array2<f64>,
}

/// Weighted mean and standard deviation.
fn spread(values: impl Iterator<Item = f64> + Clone, weights: &[f64]) -> (f64, f64) {
    let total: f64 = weights.iter().sum();
    let mean = values.clone().zip(weights).map(|(x, w)| w * x).sum::<f64>() / total;
    let square = values.zip(weights).map(|(x, w)| w * ((x - mean) * (x - mean))).sum::<f64>() / total;
    (mean, square.sqrt())
}

fn varies(mean: f64, scale: f64) -> bool {
    scale > 1e-12 * mean.abs() && scale.is_normal()
}

impl Standardized {
    /// With the plain power and a hard limit. Fails where no difference varies over the rows.
    pub(super) fn fit(trainer: &str, set: &TrainingSet) -> Result<Self, TrainError> {
        Self::fit_to(trainer, set, &|_| true, Clip::Hard)
    }

    /// With derivatives everywhere, from the columns that `keep` accepts; `inputs` are all columns. Fails where no difference varies
    /// over the rows.
    #[cfg(feature = "train")]
    pub(super) fn fit_smooth(
        trainer: &str,
        set: &TrainingSet,
        keep: &dyn Fn(&Column) -> bool,
    ) -> Result<Self, TrainError> {
        Self::fit_to(trainer, set, keep, Clip::Smooth)
    }

    fn fit_to(
        trainer: &str,
        set: &TrainingSet,
        keep: &dyn Fn(&Column) -> bool,
        clip: Clip,
    ) -> Result<Self, TrainError> {
        let inputs: Vec<Input> = set.columns().iter().map(Input::from).collect();
        let weights = set.weights();
        let mut features = Vec::new();
        for (input, column) in set.features().columns().into_iter().enumerate() {
            if !keep(&set.columns()[input]) {
                continue;
            }
            let softening = match clip {
                Clip::Hard => 0.0,
                _ => SOFTENING * spread(column.iter().copied(), &weights).1,
            };
            let (mean, scale) = spread(column.iter().map(|&x| soft_power(x, POWER, softening)), &weights);
            if varies(mean, scale) {
                let gain = if set.columns()[input].family == Family::Lights.name() { LIGHTS_GAIN } else { 1.0 };
                features.push(Feature { input, mean, scale, gain, softening });
            }
        }
        if !features.iter().any(|f| inputs[f.input].role == Role::Difference) {
            return Err(TrainError::NoDifference { trainer: trainer.to_owned() });
        }
        let standardizer = Standardizer { limit: LIMIT, power: POWER, clip, features };
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
