//! A trained model becomes an exported metric: one file that evaluates without any training library.

use super::{Predictor, TrainError};
use crate::dataset::Study;
use thiserror::Error;
use vernis_metric::math::rating_scale::RatingScale;
use vernis_metric::metric::learned::exported::{DataHash, Descriptors, Interval, Provenance, Reached};
use vernis_metric::metric::learned::{ExportedError, ExportedMetric, Regressor};

/// Why a model could not be exported.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum ExportError {
    #[error(transparent)]
    Train(#[from] Box<TrainError>),
    #[error(transparent)]
    Exported(#[from] Box<ExportedError>),
}

/// Everything about an exported metric but what was learned.
pub struct Export<'a> {
    /// Name of the metric.
    pub name: &'a str,
    /// Version of its numbers.
    pub metric_version: &'a str,
    /// The scale of its scores; models learn and predict grades, 1 to 5.
    pub scale: RatingScale,
    /// What the model's inputs are.
    pub descriptors: Descriptors,
    /// Of the grades that it predicts.
    pub interval: Interval,
    /// Where it comes from.
    pub provenance: Provenance,
}

impl Export<'_> {
    /// The metric that `model` of the trainer called `trainer` makes; `members` are models that were trained on resampled
    /// materials, for the spread of a score.
    ///
    /// # Errors
    /// [`TrainError::NotPortable`] for a model that only its training library can evaluate; parts that do not fit each other.
    pub fn of(
        self,
        trainer: &str,
        model: &dyn Predictor,
        members: &[Box<dyn Predictor>],
    ) -> Result<ExportedMetric, ExportError> {
        let portable = |model: &dyn Predictor| -> Result<Regressor, ExportError> {
            let none = || Box::new(TrainError::NotPortable { trainer: trainer.to_owned() });
            Ok(model.regressor().cloned().ok_or_else(none)?)
        };
        let members = members.iter().map(|member| portable(&**member)).collect::<Result<Vec<_>, _>>()?;
        let Self { name, metric_version, scale, descriptors, interval, provenance } = self;
        let regressor = portable(model)?;
        let metric = ExportedMetric::new(name, metric_version, descriptors, regressor, members, interval, provenance);
        Ok(metric.and_then(|metric| metric.on_scale(scale)).map_err(Box::new)?)
    }
}

/// Where a metric comes from: `rows` and `materials` are those that it was trained on.
pub fn provenance(
    study: &Study,
    rows: usize,
    materials: usize,
    seed: u64,
    command: String,
    agreement: Vec<Reached>,
) -> Provenance {
    let mut data: Vec<DataHash> =
        study.files.iter().map(|f| DataHash { name: f.name.clone(), sha256: f.content.to_string() }).collect();
    data.sort_by(|a, b| a.name.cmp(&b.name));
    data.dedup_by(|a, b| a.name == b.name);
    Provenance {
        study: study.name.clone(),
        synthetic: study.synthetic,
        rows,
        materials,
        data,
        seed,
        command,
        crate_version: env!("CARGO_PKG_VERSION").to_owned(),
        agreement,
    }
}
