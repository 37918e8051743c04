//! The file of a fit: a model file that also says how its parameters were found.
//!
//! ```text
//! format       1; a reader refuses newer ones
//! readable_from  the first version of vernis that reads this format
//! model        identifier of the model
//! parameters   by name, colours as three numbers, as in a model file
//! reference    {source, sha256}: what was fitted
//! metric       {name, version}: the loss, and the version of its numbers
//! value_at_start, value   the metric's distance
//! start, optimizer, seed, starts, grid, max_evaluations   how it was searched; grid is the coarsening
//! stop         converged, no-descent, evaluation-limit or direct
//! evaluations, polish_evaluations
//! history      [[evaluations, loss of the search], ...]: improvements
//! fit_version  of the search: the same settings and versions give the same file
//! program      name and version of the writer
//! seal         SHA-256 of the rest: a kept fit that was changed is made again
//! ```
//!
//! The first files had neither seal nor fit_version, and the version of the program in place of that of a classical metric.
//!
//! It is a BRDF source wherever one is accepted: the reader of model files takes `model` and `parameters`.

use super::{FitError, Fitted, Fitting, direct};
use crate::brdf::formats::model_json::{FIT_FORMAT, FIT_READABLE_FROM};
use crate::brdf::models::AnalyticBrdf;
use crate::io::{SealError, read_at_most, seal_of, unique_keys};
use crate::metric::Metric;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::path::Path;

const PROGRAM: &str = concat!("vernis ", env!("CARGO_PKG_VERSION"));
/// Far more than any fit needs.
const MOST_BYTES: u64 = 4 << 20;
/// Of starts, searches and polish: it changes when the same settings give other parameters.
pub const FIT_VERSION: &str = "1";

/// The loss of a fit.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MetricUsed {
    /// Registry name of the metric.
    pub name: String,
    /// Version of the metric's numbers.
    pub version: String,
}

impl MetricUsed {
    /// Name and version of `metric`.
    pub fn of(metric: &dyn Metric) -> Self {
        Self { name: metric.name().to_owned(), version: metric.version().to_owned() }
    }
}

/// What was fitted.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReferenceUsed {
    /// In the notation of sources.
    pub source: String,
    /// SHA-256 of the reference's content, 64 hexadecimal digits.
    pub sha256: String,
}

/// The content of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FitFile {
    /// Version of the file format.
    pub format: u32,
    /// Identifier of the model.
    pub model: String,
    /// The parameters by field; a colour is a list of three numbers.
    pub parameters: Map<String, Value>,
    /// What was fitted.
    pub reference: ReferenceUsed,
    /// The loss.
    pub metric: MetricUsed,
    /// The metric's distance at the start.
    pub value_at_start: f64,
    /// The metric's distance at the end.
    pub value: f64,
    /// Name of the start, see [`Start::name`](super::Start::name).
    pub start: String,
    /// Name of the search method, such as `lbfgs`.
    pub optimizer: String,
    /// Seed of the random starts.
    pub seed: u64,
    /// How many starts were searched from.
    pub starts: usize,
    /// Coarsening: cells of the metric to one cell of the search, along each axis.
    pub grid: usize,
    /// Largest number of evaluations for each start, where one was set.
    pub max_evaluations: Option<usize>,
    /// Why the search ended.
    pub stop: super::optimizer::StopReason,
    /// Evaluations of all searches and starts, without the polish.
    pub evaluations: usize,
    /// Evaluations of the polish under the metric itself.
    pub polish_evaluations: usize,
    /// Improvements of the search that won: evaluations so far, loss of the search.
    pub history: Vec<(usize, f64)>,
    /// [`FIT_VERSION`] of the writer; `None` in the first files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit_version: Option<String>,
    /// Name and version of the program that wrote the file.
    pub program: String,
    /// The first version of vernis that reads this format.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readable_from: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    seal: Option<String>,
}

/// What is at the place of a fit that an earlier run may have left.
#[derive(Debug, Clone, PartialEq)]
pub enum KeptFit {
    /// A file that passed the reader's checks.
    Whole(Box<FitFile>),
    /// No file.
    Absent,
    /// A file that cannot be used, and why.
    Refused(String),
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
            fit_version: Some(FIT_VERSION.to_owned()),
            program: PROGRAM.to_owned(),
            readable_from: Some(FIT_READABLE_FROM.to_owned()),
            seal: None,
        }
    }

    /// Reads the file that an earlier run may have left at `path`.
    pub fn read(path: &Path) -> KeptFit {
        let bytes = match read_at_most(path, MOST_BYTES) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return KeptFit::Absent,
            Err(e) => return KeptFit::Refused(e.to_string()),
        };
        match Self::parse(&bytes) {
            Ok(file) => KeptFit::Whole(Box::new(file)),
            Err(reason) => KeptFit::Refused(reason),
        }
    }

    fn parse(bytes: &[u8]) -> Result<Self, String> {
        let unreadable = |e: serde_json::Error| format!("it cannot be read ({e})");
        unique_keys(bytes).map_err(unreadable)?;
        let mut file: Self = serde_json::from_slice(bytes).map_err(unreadable)?;
        match (file.format, file.seal.take()) {
            (FIT_FORMAT, Some(seal)) if seal_of(&file).is_ok_and(|own| own == seal) => file.seal = Some(seal),
            // Before seals, the version of a classical metric was that of the program.
            (FIT_FORMAT, None) if file.fit_version.is_none() => file.metric.version = legacy_version(&file.metric),
            (FIT_FORMAT, _) => return Err(SealError::Broken.to_string()),
            (newer, _) => {
                let from = file.readable_from.unwrap_or_else(|| "a newer version".to_owned());
                return Err(format!("format {newer} needs vernis {from}; this is {}", env!("CARGO_PKG_VERSION")));
            }
        }
        Ok(file)
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
            && self.fit_version.as_deref().unwrap_or("1") == FIT_VERSION
            && (searched || direct::is_direct(fitting.model))
    }

    /// The text of the file, ending in a line break.
    ///
    /// # Errors
    /// [`FitError::Write`].
    pub fn to_json(&self) -> Result<String, FitError> {
        let failed = |e: serde_json::Error| FitError::Write { reason: e.to_string() };
        let open = Self { seal: None, ..self.clone() };
        let sealed = Self { seal: Some(seal_of(&open).map_err(failed)?), ..open };
        Ok(serde_json::to_string_pretty(&sealed).map_err(failed)? + "\n")
    }
}

/// The version of the metric that made a file of vernis 0.1.0.
fn legacy_version(metric: &MetricUsed) -> String {
    const PROGRAM: &str = "0.1.0";
    match metric.name.split('[').next() {
        _ if metric.version != PROGRAM => &metric.version,
        Some("ot") => "4",
        Some("energy" | "mmd-gaussian" | "mmd-laplacian") => "1",
        _ => "2",
    }
    .to_owned()
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
