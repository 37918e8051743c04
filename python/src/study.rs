//! Studies: training, benchmarks, and the whole program.

use crate::compute::long;
use crate::fault::Fault;
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;
use vernis::dataset::{Study, manifest, synthetic};
use vernis::evaluation::records::BenchmarkRecord;
use vernis::experiment::train::loss_name;
use vernis::experiment::{BenchmarkOptions, TrainOptions};
use vernis::report::tables;
use vernis_metric::descriptor::Cache;

/// How a study is measured.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options {
    study: Option<String>,
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
        if let Some(name) = &self.study {
            return Ok(Study::load(name, self.data.as_deref())?);
        }
        let open = Study::load(manifest::OPEN, self.data.as_deref());
        Ok(open.or_else(|_| Study::load(synthetic::NAME, None))?)
    }

    fn benchmark(&self) -> BenchmarkOptions {
        BenchmarkOptions {
            data: self.data.clone(),
            cache: self.cache.as_deref().and_then(|folder| Cache::open(folder).ok()),
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
    record: String,
    summary: String,
}

fn json(record: &BenchmarkRecord) -> Result<String, Fault> {
    vernis::serde_json::to_string(record).map_err(|e| Fault::Failed(e.to_string()))
}

fn summary(record: &BenchmarkRecord) -> String {
    tables::headlines(record).iter().map(tables::Table::to_text).collect::<Vec<_>>().join("\n")
}

/// Trains a metric on a study.
#[pyfunction]
pub fn train(py: Python<'_>, options: Options, progress: Option<Py<PyAny>>) -> Result<Trained, Fault> {
    long(py, progress.as_ref(), |observer, _| {
        let study = options.study()?;
        let how = TrainOptions { name: options.name.clone(), benchmark: options.benchmark() };
        let trained = vernis::experiment::train(&study, &how, observer)?;
        Ok(Trained {
            name: trained.metric.name.clone(),
            metric: trained.metric.to_json()?,
            loss_name: loss_name(&trained.metric.name),
            loss: trained.loss.to_json()?,
            record: json(&trained.benchmark)?,
            summary: summary(&trained.benchmark),
        })
    })
}

/// Measures all metrics on a study: the record, and its headlines as text.
#[pyfunction]
pub fn benchmark(py: Python<'_>, options: Options, progress: Option<Py<PyAny>>) -> Result<(String, String), Fault> {
    long(py, progress.as_ref(), |observer, _| {
        let record = vernis::experiment::benchmark(&options.study()?, &options.benchmark(), observer)?;
        Ok((json(&record)?, summary(&record)))
    })
}

/// The program `vernis` with these arguments, its name first; returns the exit code.
#[pyfunction]
pub fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| vernis::cli::run(arguments))
}
