//! Studies: training, benchmarks, and the whole program.

use crate::compute::long;
use crate::fault::Fault;
use crate::metric::registry;
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use vernis::dataset::Study;
use vernis::evaluation::records::BenchmarkRecord;
use vernis::experiment::further::Further;
use vernis::experiment::train::{Stage, loss_name, metric_file, metric_name};
use vernis::experiment::{BenchmarkOptions, Measurement, Purpose};
use vernis::report::{self, OutputFolder, pictures, tables, write_benchmark, write_numbers};
use vernis_metric::descriptor::Cache;
use vernis_metric::io::Observer;

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
    metrics: Vec<String>,
}

impl Options {
    fn study(&self) -> Result<Study, Fault> {
        Ok(Study::load(&self.study, self.data.as_deref())?)
    }

    fn benchmark(&self, study: &Study, warnings: &mut Vec<String>) -> Result<BenchmarkOptions, Fault> {
        let registry = registry()?;
        let further = self.metrics.iter().map(|name| registry.resolve(name)).collect::<Result<Vec<_>, _>>()?.concat();
        let cache = self.cache.as_deref().and_then(|folder| match Cache::open(folder) {
            Ok(cache) => Some(cache),
            Err(error) => {
                warnings.push(format!("{error}; going on without a cache"));
                None
            }
        });
        Ok(BenchmarkOptions {
            further: Further::new(further, study)?,
            data: self.data.clone(),
            cache,
            folds: self.folds,
            resamples: self.resamples,
            seed: self.seed,
            variants: self.variants,
            ..BenchmarkOptions::default()
        })
    }
}

/// The files of a metric, of the one to fit with, and of the report, and the record of the measurement.
#[pyclass(frozen, get_all, module = "vernis._vernis")]
pub struct Trained {
    metric: PathBuf,
    loss: PathBuf,
    report: PathBuf,
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

/// Trains a metric on a study. What is finished is written to `out` stage by stage, as the program does.
#[pyfunction]
pub fn train(py: Python<'_>, options: Options, out: PathBuf, progress: Option<Py<PyAny>>) -> Result<Trained, Fault> {
    long(py, progress.as_ref(), |observer, _| {
        let mut warnings = Vec::new();
        let study = options.study()?;
        let name = options.name.clone().unwrap_or_else(|| metric_name(&study));
        let how = options.benchmark(&study, &mut warnings)?;
        // Found unwritable before the work, not after it.
        let folder = OutputFolder::claim(out)?;
        spare(&options.study, &folder)?;
        let mut measurement = Measurement::of(&study, &how, Purpose::Train, observer)?;
        write_numbers(&folder, measurement.record())?;
        let (metric, loss, report) = finish(&mut measurement, &name, &options, &folder, observer).map_err(|fault| {
            fault.beneath(&format!(
                "the measurement is finished and written ({}), but what follows it failed",
                folder.path().join("benchmark.json").display()
            ))
        })?;
        warnings.extend(measurement.warnings.iter().map(ToString::to_string));
        Ok(Trained { metric, loss, report, measured: measured(measurement.record(), warnings)? })
    })
}

/// What follows the measurement; returns the paths of the metric, of the one to fit with, and of the report.
fn finish(
    measurement: &mut Measurement,
    name: &str,
    options: &Options,
    folder: &OutputFolder,
    observer: Observer<'_>,
) -> Result<(PathBuf, PathBuf, PathBuf), Fault> {
    for stage in Stage::ALL {
        measurement.run(stage, observer)?;
        write_numbers(folder, measurement.record())?;
    }
    let export = || -> Result<(PathBuf, PathBuf), Fault> {
        let metric = measurement.export(Some(name), observer)?;
        let metric = folder.write(&metric_file(name), metric.to_json()?.as_bytes())?;
        let loss = measurement.export_loss(Some(name), observer)?;
        Ok((metric, folder.write(&metric_file(&loss_name(name)), loss.to_json()?.as_bytes())?))
    };
    let exported = export();
    // Whatever became of the one, the other is finished.
    let (record, data) = (measurement.record(), options.data.as_deref());
    let materials = pictures::of_benchmark(measurement.study(), data, record).map_err(|e| Fault::Failed(e.to_string()));
    let page =
        materials.and_then(|materials| Ok(write_benchmark(folder, record, &materials, pictures::LAMPS_IN_WORDS)?));
    let (metric, loss) = exported?;
    Ok((metric, loss, page?))
}

/// That the study is none of the files that are written beside the metrics.
fn spare(study: &str, folder: &OutputFolder) -> Result<(), Fault> {
    let place = |path: &Path| path.canonicalize().ok();
    let Some(read) = place(Path::new(study)) else { return Ok(()) };
    match report::FILES.iter().find(|name| place(&folder.path().join(name)).as_ref() == Some(&read)) {
        Some(name) => Err(Fault::Input(format!(
            "out is {}, where {name} would replace the study {study}; choose another folder",
            folder.path().display()
        ))),
        None => Ok(()),
    }
}

/// Measures all metrics on a study.
#[pyfunction]
pub fn benchmark(py: Python<'_>, options: Options, progress: Option<Py<PyAny>>) -> Result<Measured, Fault> {
    long(py, progress.as_ref(), |observer, _| {
        let mut warnings = Vec::new();
        let study = options.study()?;
        let record = vernis::experiment::benchmark(&study, &options.benchmark(&study, &mut warnings)?, observer)?;
        measured(&record, warnings)
    })
}

/// The program `vernis` with these arguments, its name first; returns the exit code.
#[pyfunction]
pub fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| vernis::cli::run(arguments))
}
