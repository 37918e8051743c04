//! Studies: training, benchmarks, and the whole program.

use crate::compute::long;
use crate::fault::Fault;
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;
use vernis::dataset::Study;
use vernis::evaluation::records::BenchmarkRecord;
use vernis::experiment::train::loss_name;
use vernis::experiment::{BenchmarkOptions, TrainOptions};
use vernis::report::tables;
use vernis_metric::descriptor::Cache;

/// How a study is measured.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options {
    study: String,
    data: Option<PathBuf>,
    cache: Option<PathBuf>,
    name: Option<String>,
    folds: Option<usize>,
    resamples: usize,
    seed: u64,
    variants: bool,
}

impl Options {
    fn study(&self) -> Result<Study, Fault> {
        Ok(Study::load(&self.study, self.data.as_deref())?)
    }

    fn benchmark(&self, warnings: &mut Vec<String>) -> BenchmarkOptions {
        let cache = self.cache.as_deref().and_then(|folder| match Cache::open(folder) {
            Ok(cache) => Some(cache),
            Err(error) => {
                warnings.push(format!("{error}; going on without a cache"));
                None
            }
        });
        BenchmarkOptions {
            data: self.data.clone(),
            cache,
            folds: self.folds,
            resamples: self.resamples,
            seed: self.seed,
            variants: self.variants,
            ..BenchmarkOptions::default()
        }
    }
}

/// A metric and the one to fit with, as files, and the record of the measurement.
#[pyclass(frozen, get_all, module = "vernis._vernis")]
pub struct Trained {
    name: String,
    metric: String,
    loss_name: String,
    loss: String,
    measured: Measured,
}

/// The record of a measurement, its headlines as text, and what a user is to be warned of.
type Measured = (String, String, Vec<String>);

fn measured(record: &BenchmarkRecord, warnings: Vec<String>) -> Result<Measured, Fault> {
    let json = vernis::serde_json::to_string(record).map_err(|e| Fault::Failed(e.to_string()))?;
    let summary = tables::headlines(record).iter().map(tables::Table::to_text).collect::<Vec<_>>().join("\n");
    Ok((json, summary, warnings))
}

/// The study where none is named, and what is missing where it is not the open one.
#[pyfunction]
pub fn default_study(data: Option<PathBuf>) -> Result<(String, Option<String>), Fault> {
    let (study, missing) = Study::open_or_embedded(data.as_deref())?;
    Ok((study.name, missing.map(|missing| missing.to_string())))
}

/// Trains a metric on a study.
#[pyfunction]
pub fn train(py: Python<'_>, options: Options, progress: Option<Py<PyAny>>) -> Result<Trained, Fault> {
    long(py, progress.as_ref(), |observer, _| {
        let mut warnings = Vec::new();
        let study = options.study()?;
        let how = TrainOptions { name: options.name.clone(), benchmark: options.benchmark(&mut warnings) };
        let trained = vernis::experiment::train(&study, &how, observer)?;
        warnings.extend(trained.warnings.iter().map(ToString::to_string));
        Ok(Trained {
            name: trained.metric.name.clone(),
            metric: trained.metric.to_json()?,
            loss_name: loss_name(&trained.metric.name),
            loss: trained.loss.to_json()?,
            measured: measured(&trained.benchmark, warnings)?,
        })
    })
}

/// Measures all metrics on a study.
#[pyfunction]
pub fn benchmark(py: Python<'_>, options: Options, progress: Option<Py<PyAny>>) -> Result<Measured, Fault> {
    long(py, progress.as_ref(), |observer, _| {
        let mut warnings = Vec::new();
        let study = options.study()?;
        let record = vernis::experiment::benchmark(&study, &options.benchmark(&mut warnings), observer)?;
        measured(&record, warnings)
    })
}

/// The program `vernis` with these arguments, its name first; returns the exit code.
#[pyfunction]
pub fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| vernis::cli::run(arguments))
}
