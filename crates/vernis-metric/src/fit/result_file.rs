//! The file of a fit: a model file that also says how its parameters were found.
//!
//! ```text
//! format       1; a reader refuses newer ones
//! readable_from  the first version of vernis that reads this format
//! model        identifier of the model
//! parameters   by name, colours as three numbers, as in a model file
//! reference    {source, sha256}: what was fitted
//! metric       {name, version, identity}: the loss, the version of its numbers, and what else decides them
//! value_at_start, value   the metric's distance; null at a start where it has none
//! exports      [{renderer, file, model, parameters, exact, costs}, ...]: materials of renderers, each with what the translation costs
//! at_bounds    [{parameter, bound, value}, ...]: parameters that stand on a bound of the model's, lower or upper
//! start, optimizer, seed, starts, grid, max_evaluations   how it was searched; grid is the coarsening
//! stop         converged, no-descent, nothing-moved, flat, evaluation-limit, interrupted or direct
//! evaluations, polish_evaluations
//! history      [[evaluations, loss of the search], ...]: improvements
//! fit_version  of the search: the same settings and versions give the same file
//! program      name and version of the writer
//! seal         SHA-256 of the rest: a kept fit that was changed is made again
//! ```
//!
//! The first files had neither seal, fit_version, identity nor at_bounds, and the version of the program in place of that of a
//! classical metric.
//!
//! It is a BRDF source wherever one is accepted: the reader of model files takes `model` and `parameters`.

use super::export::Export;
use super::optimizer::StopReason;
use super::{AtBound, FitError, Fitted, Fitting, direct};
use crate::brdf::formats::model_json::{FIT_FORMAT, FIT_READABLE_FROM};
use crate::brdf::models::AnalyticBrdf;
use crate::io::{SealError, read_at_most, seal_of, unique_keys};
use crate::metric::Metric;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::fmt;
use std::path::Path;

const PROGRAM: &str = concat!("vernis ", env!("CARGO_PKG_VERSION"));
/// Far more than any fit needs.
const MOST_BYTES: u64 = 4 << 20;
/// Of starts, searches and polish: it changes when the same settings give other parameters.
pub const FIT_VERSION: &str = "5";
/// Of files that do not say theirs.
const FIRST_FIT_VERSION: &str = "1";

/// The loss of a fit.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MetricUsed {
    /// Registry name of the metric.
    pub name: String,
    /// Version of the metric's numbers.
    pub version: String,
    /// [`Metric::identity`]: the grid of a metric on graphs, the file of a learned one; `None` in the first files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub identity: Option<String>,
}

impl MetricUsed {
    /// Name, version and identity of `metric`.
    pub fn of(metric: &dyn Metric) -> Self {
        let [name, version] = [metric.name(), metric.version()].map(str::to_owned);
        Self { name, version, identity: Some(metric.identity()) }
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
    /// The metric's distance at the first start; infinite, and null in the file, where it has none there.
    #[serde(with = "or_null")]
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
    pub stop: StopReason,
    /// Evaluations of all searches and starts, without the polish.
    pub evaluations: usize,
    /// Evaluations of the polish under the metric itself.
    pub polish_evaluations: usize,
    /// Improvements of the search that won: evaluations so far, loss of the search.
    pub history: Vec<(usize, f64)>,
    /// Parameters that stand on a bound.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub at_bounds: Vec<AtBound>,
    /// Materials of renderers in place of the model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub exports: Vec<Export>,
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
            at_bounds: fitted.at_bounds.clone(),
            exports: Vec::new(),
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

    /// Whether fitting the reference with that content in this way gave this file, to its end.
    pub fn is_result_of(&self, fitting: &Fitting<'_>, sha256: &str) -> bool {
        self.stop != StopReason::Interrupted && self.differences(fitting, sha256).is_empty()
    }

    /// In what this file differs from that of fitting the reference with that content in this way.
    pub fn differences(&self, fitting: &Fitting<'_>, sha256: &str) -> Vec<Difference> {
        let mut all = Vec::new();
        let mut compare = |what: &'static str, found: &str, asked: &str| {
            if found != asked {
                all.push(Difference { what, found: found.to_owned(), asked: asked.to_owned() });
            }
        };
        let (metric, number) = (MetricUsed::of(fitting.metric), |n: usize| n.to_string());
        compare("model", &self.model, fitting.model);
        compare("the SHA-256 of the reference", &self.reference.sha256, sha256);
        compare("metric", &self.metric.name, &metric.name);
        if self.metric.name == metric.name {
            compare(METRIC_VERSION, &self.metric.version, &metric.version);
            if let (Some(found), Some(asked)) = (&self.metric.identity, &metric.identity)
                && self.metric.version == metric.version
            {
                compare("the metric's identity", found, asked);
            }
        }
        if !direct::is_direct(fitting.model) {
            compare("optimizer", &self.optimizer, fitting.method.name());
            if let Some(start) = &fitting.start {
                compare("start", &self.start, start.name());
            }
            compare("seed", &self.seed.to_string(), &fitting.seed.to_string());
            compare("starts", &number(self.starts), &number(fitting.starts));
            compare("coarsening", &number(self.grid), &number(fitting.coarsening));
            let most = |n: Option<usize>| n.map_or("the default".to_owned(), number);
            compare("max-evaluations", &most(self.max_evaluations), &most(fitting.max_evaluations));
        }
        compare(FITS_VERSION, self.fit_version.as_deref().unwrap_or(FIRST_FIT_VERSION), FIT_VERSION);
        all
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

const METRIC_VERSION: &str = "the version of the metric";
const FITS_VERSION: &str = "the version of fits";

/// One thing in which a kept result differs from the one that is asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// Such as `seed`.
    pub what: &'static str,
    /// In the kept result.
    pub found: String,
    /// In the one that is asked for.
    pub asked: String,
}

impl Difference {
    /// Whether only another version of vernis made the result: what is asked for is the same, and the numbers are computed again.
    pub fn is_version(&self) -> bool {
        [METRIC_VERSION, FITS_VERSION].contains(&self.what)
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} is {} there and {} here", self.what, self.found, self.asked)
    }
}

/// A number that JSON may not have: infinity is null.
mod or_null {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        value.is_finite().then_some(*value).serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
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
