//! The file of a fit: a model file that also says how its parameters were found.
//!
//! ```text
//! format       1; a reader refuses newer ones
//! model        identifier of the model
//! parameters   by name, colours as three numbers, as in a model file
//! reference    {source, sha256}: what was fitted
//! metric       {name, version}: the loss; the version is that of the learned metric, or of this program
//! value_at_start, value   the metric's distance
//! start, optimizer, seed, starts, grid, max_evaluations   how it was searched; grid is the coarsening
//! stop         converged, no-descent, evaluation-limit or direct
//! evaluations, polish_evaluations
//! history      [[evaluations, loss of the search], ...]: improvements
//! program      name and version of the writer
//! ```
//!
//! It is a BRDF source wherever one is accepted: the reader of model files takes `model` and `parameters`.

use super::{FitError, Fitted, Fitting, direct};
use crate::brdf::formats::model_json::FIT_FORMAT;
use crate::brdf::models::AnalyticBrdf;
use crate::metric::Metric;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::path::Path;

const PROGRAM: &str = concat!("vernis ", env!("CARGO_PKG_VERSION"));

/// The loss of a fit.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MetricUsed {
    pub name: String,
    pub version: String,
}

impl MetricUsed {
    pub fn of(metric: &dyn Metric) -> Self {
        let learned = metric.as_learned().map(|m| m.exported().metric_version.clone());
        Self {
            name: metric.name().to_owned(),
            version: learned.unwrap_or_else(|| env!("CARGO_PKG_VERSION").to_owned()),
        }
    }
}

/// What was fitted.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReferenceUsed {
    /// In the notation of sources.
    pub source: String,
    pub sha256: String,
}

/// The content of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FitFile {
    pub format: u32,
    pub model: String,
    pub parameters: Map<String, Value>,
    pub reference: ReferenceUsed,
    pub metric: MetricUsed,
    pub value_at_start: f64,
    pub value: f64,
    pub start: String,
    pub optimizer: String,
    pub seed: u64,
    pub starts: usize,
    pub grid: usize,
    pub max_evaluations: Option<usize>,
    pub stop: super::optimizer::StopReason,
    pub evaluations: usize,
    pub polish_evaluations: usize,
    pub history: Vec<(usize, f64)>,
    pub program: String,
}

impl FitFile {
    /// `source` and `sha256` name the reference.
    pub fn new(fitting: &Fitting<'_>, fitted: &Fitted, source: &str, sha256: &str) -> Self {
        Self {
            format: FIT_FORMAT,
            model: fitted.model.model().to_owned(),
            parameters: by_name(&*fitted.model),
            reference: ReferenceUsed { source: source.to_owned(), sha256: sha256.to_owned() },
            metric: MetricUsed::of(fitting.metric),
            value_at_start: fitted.value_at_start,
            value: fitted.value,
            start: fitted.start.to_owned(),
            optimizer: fitted.method.to_owned(),
            seed: fitting.seed,
            starts: fitting.starts,
            grid: fitting.coarsening,
            max_evaluations: fitting.max_evaluations,
            stop: fitted.stop,
            evaluations: fitted.evaluations,
            polish_evaluations: fitted.polish_evaluations,
            history: fitted.history.iter().map(|h| (h.evaluations, h.value)).collect(),
            program: PROGRAM.to_owned(),
        }
    }

    /// Reads a file; `None` if it is none, or is of another format or program.
    pub fn read(path: &Path) -> Option<Self> {
        let file: Self = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
        (file.format == FIT_FORMAT && file.program == PROGRAM).then_some(file)
    }

    /// Whether fitting the reference with that content in this way gave this file.
    pub fn is_result_of(&self, fitting: &Fitting<'_>, sha256: &str) -> bool {
        let searched = self.optimizer == fitting.method.name()
            && fitting.start.as_ref().is_none_or(|s| self.start == s.name())
            && (self.seed, self.starts, self.grid) == (fitting.seed, fitting.starts, fitting.coarsening)
            && self.max_evaluations == fitting.max_evaluations;
        self.model == fitting.model
            && self.reference.sha256 == sha256
            && self.metric == MetricUsed::of(fitting.metric)
            && (searched || direct::is_direct(fitting.model))
    }

    /// The text of the file, ending in a line break.
    ///
    /// # Errors
    /// [`FitError::Write`].
    pub fn to_json(&self) -> Result<String, FitError> {
        let text = serde_json::to_string_pretty(self).map_err(|e| FitError::Write { reason: e.to_string() })?;
        Ok(text + "\n")
    }
}

/// The parameters of a model by field, colours as lists.
pub fn by_name(model: &dyn AnalyticBrdf) -> Map<String, Value> {
    let mut fields = Map::new();
    for (parameter, value) in model.schema().iter().zip(model.parameters()) {
        match parameter.name.rsplit_once('.') {
            Some((field, "r" | "g" | "b")) => {
                let entry = fields.entry(field).or_insert_with(|| Value::Array(Vec::new()));
                if let Value::Array(channels) = entry {
                    channels.push(json!(value));
                }
            }
            _ => {
                fields.insert(parameter.name.to_string(), json!(value));
            }
        }
    }
    fields
}
