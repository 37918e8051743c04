//! Fits of models to BRDFs.

use crate::brdf::Brdf;
use crate::compute::long;
use crate::fault::Fault;
use crate::metric::Metric;
use pyo3::prelude::*;
use std::sync::Arc;
use vernis_metric::brdf::models;
use vernis_metric::fit::{FitError, FitFile, Fitting, Start};

/// Options of a fit; `None` leaves each to the library.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options {
    start: Option<String>,
    parameters: Option<Vec<f64>>,
    method: Option<String>,
    starts: usize,
    seed: u64,
    coarsening: usize,
    max_evaluations: Option<usize>,
}

/// The fitted model, and the fit as a file of the program holds it. `source` names the reference in the file.
#[pyfunction]
pub fn fit(
    py: Python<'_>,
    reference: &Brdf,
    source: &str,
    model: &str,
    metric: &Metric,
    options: Options,
    progress: Option<Py<PyAny>>,
) -> Result<(Brdf, String), Fault> {
    let default = Fitting::new(model, &*metric.metric);
    let start = match (options.start.as_deref(), options.parameters) {
        (None, None) => None,
        (_, Some(parameters)) => {
            models::build(model, &parameters)?;
            Some(Start::Parameters(parameters))
        }
        (Some("staged"), _) => Some(Start::Staged),
        (Some("log"), _) => Some(Start::Log),
        (Some("log-at-once"), _) => Some(Start::LogAtOnce),
        (Some(other), _) => {
            return Err(Fault::Input(format!(
                "start is {other}; it must be staged, log, log-at-once, or a BRDF of the model {model}"
            )));
        }
    };
    let method = match &options.method {
        Some(name) => name.parse().map_err(|e: FitError| Fault::from(e))?,
        None => default.method,
    };
    let (starts, seed, coarsening) = (options.starts, options.seed, options.coarsening);
    let fitting =
        Fitting { start, method, starts, seed, coarsening, max_evaluations: options.max_evaluations, ..default };
    let fitted = long(py, progress.as_ref(), |observer, interrupt| {
        let fitting = Fitting { interrupt: interrupt.clone(), ..fitting.clone() };
        Ok(fitting.run(&*reference.brdf, observer)?)
    });
    let fitted = reference.heard(fitted)?;
    let sha256 = reference.content.clone().unwrap_or_default();
    let file = FitFile::new(&fitting, &fitted, source, &sha256).to_json()?;
    let brdf: Arc<dyn vernis_metric::brdf::Brdf> = fitted.model;
    Ok((Brdf { brdf, function: None, content: None }, file))
}
