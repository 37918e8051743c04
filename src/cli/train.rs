//! `vernis train` and `vernis benchmark`: the main job, from a study to a metric and a report.

use super::progress::Bar;
use super::study_input::{self as input, OPEN_STUDY, StudyInput};
use super::{Shared, print, user_error, workspace};
use anyhow::{Context, Result};
use clap::Args;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use vernis::dataset::Study;
use vernis::evaluation::records::{BenchmarkRecord, RowSet, Split};
use vernis::experiment::benchmark::{RunInfo, StudyBenchmark, data_hashes, protocol, run};
use vernis::report::pictures::{self, PictureError};
use vernis::report::{OutputFolder, tables, write_benchmark};
use vernis::samples::Samples;
use vernis::samples::split::TrainingSet;
use vernis::train::embedding_folds::{Learner, TableBank, embedded_folds};
use vernis::train::ensemble::bootstrap_members;
use vernis::train::{Predictor, Trainer, recipe};
use vernis_metric::brdf::BrdfSource;
use vernis_metric::brdf::formats::materials;
use vernis_metric::descriptor::{DescriptorSet, VERSION};
use vernis_metric::light::source::Light;
use vernis_metric::metric::learned::Regressor;
use vernis_metric::metric::learned::exported::{DataHash, Descriptors, ExportedMetric, Provenance, Reached};

/// Archives of measured materials that nobody rated, from which embeddings may be learned.
const UNRATED: [&str; 2] = ["nbrdf/rgl-isotropic_nbrdf.zip", "nbrdf/nielsen_nbrdf.zip"];

/// What a run is about.
#[derive(Args)]
pub struct StudyOptions {
    #[command(flatten)]
    input: StudyInput,
    /// A whole study in a file of `vernis extract` or `vernis merge`. BRDFs are not needed: embeddings, which would be learned
    /// from them, are left out, and so are pictures of BRDFs that are not there.
    #[arg(long, value_name = "PARQUET", conflicts_with_all = ["study", "lights", "shape"])]
    extracted: Option<PathBuf>,
    /// Seed of splits, resamples and initial weights. The same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for results [default: out/STUDY].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folds by material [default: 10; 5 for the embedded study].
    #[arg(long, value_name = "N")]
    folds: Option<usize>,
    /// Bootstrap resamples of materials.
    #[arg(long, default_value_t = 2000, value_parser = workspace::resamples)]
    resamples: usize,
    /// Print the benchmark record as JSON instead of the table.
    #[arg(long)]
    json: bool,
}

/// Train a metric on a study and measure it under nested cross-validation.
#[derive(Args)]
#[command(after_help = "\
Examples:
  vernis train                                     # the open study if VERNIS_DATA has it, else the embedded synthetic one
  vernis train --study lavoue2021-open --data ~/brdf-data --out out/open
  vernis train --study my-ratings.csv --name mine  # CSV: reference,candidate,mos and more; see datasets/README.md")]
pub struct TrainArgs {
    #[command(flatten)]
    options: StudyOptions,
    /// Name of the exported metric [default: vernis for the open study, else vernis-STUDY].
    #[arg(long)]
    name: Option<String>,
}

/// Measure all metrics on a study under nested cross-validation, without exporting one.
#[derive(Args)]
#[command(after_help = "\
Examples:
  vernis benchmark --study synthetic
  vernis benchmark --study lavoue2021-open --data ~/brdf-data --seed 7 --out out/seed-7")]
pub struct BenchmarkArgs {
    #[command(flatten)]
    options: StudyOptions,
}

/// Materials with pictures in the report, and the layout of the lamps they are under.
const MOST_PICTURED: usize = 10;
const PICTURED_LAMPS: usize = 1;

/// Everything between the arguments and the results.
struct Job {
    study: Study,
    folder: OutputFolder,
    setup_id: String,
    bench: StudyBenchmark,
    /// The compact columns of every row.
    training: TrainingSet,
    /// The study came without its BRDFs.
    extracted: bool,
}

pub fn train(shared: &Shared, args: TrainArgs) -> Result<()> {
    let job = Job::run(shared, &args.options, "train")?;
    let default = match job.study.name.as_str() {
        OPEN_STUDY => recipe::NAME.to_owned(),
        _ => format!("{}-{}", recipe::NAME, input::short_name(&job.study)),
    };
    let name = args.name.unwrap_or(default);
    let report = job.write_report(shared)?;
    let metric = export(&job, &name, args.options.seed)?;
    let path = job.folder.write(&format!("{name}.vernis.json"), metric.to_json()?.as_bytes())?;
    summary(&job, args.options.json)?;
    if !args.options.json {
        print(format!("metric: {}\nreport: {}\n", path.display(), report.display()))?;
    }
    Ok(())
}

pub fn benchmark(shared: &Shared, args: BenchmarkArgs) -> Result<()> {
    let job = Job::run(shared, &args.options, "benchmark")?;
    let report = job.write_report(shared)?;
    summary(&job, args.options.json)?;
    if !args.options.json {
        print(format!("report: {}\n", report.display()))?;
    }
    Ok(())
}

fn summary(job: &Job, json: bool) -> Result<()> {
    let record = &job.bench.record;
    if json {
        return print(format!("{}\n", serde_json::to_string_pretty(record)?));
    }
    let mut text = tables::headline(record).to_text();
    if record.synthetic {
        text += "SYNTHETIC: these ratings come from simulated observers and say nothing about people.\n";
    }
    print(&text)
}

/// A study as numbers.
struct Numbers {
    study: Study,
    samples: Samples,
    setup_id: String,
    /// What embeddings are learned from, where the BRDFs were read.
    bank: Option<TableBank>,
}

impl Job {
    /// The page, with pictures of the materials on which the metric is furthest off.
    fn write_report(&self, shared: &Shared) -> Result<PathBuf> {
        let (record, light) = (&self.bench.record, Light::lamps(PICTURED_LAMPS));
        let found = pictures::of_study(&self.study, shared.data.as_deref(), Some(record), &light, MOST_PICTURED);
        let materials = match found {
            Err(PictureError::Source(error)) if self.extracted => {
                eprintln!("no pictures of materials in the report: {error}");
                Vec::new()
            }
            found => found?,
        };
        Ok(write_benchmark(&self.folder, record, &materials, "lamps that are defined by code")?)
    }

    fn run(shared: &Shared, options: &StudyOptions, command: &str) -> Result<Self> {
        if options.folds.is_some_and(|folds| folds < 2) {
            return Err(user_error("--folds: found fewer than 2, allowed 2 or more"));
        }
        let bar = Bar::new();
        let (numbers, folder) = match &options.extracted {
            Some(path) => {
                let found = input::extracted(path)?;
                let folder = Self::folder(options, &found.study)?;
                let setup_id = found.versions.setup;
                eprintln!("{}: embeddings are left out, for they are learned from BRDFs", path.display());
                (Numbers { study: found.study, samples: found.samples, setup_id, bank: None }, folder)
            }
            None => {
                let study = options.input.study(shared)?;
                // Found unwritable before the work, not after it.
                let folder = Self::folder(options, &study)?;
                (Self::numbers(shared, options, study, &bar)?, folder)
            }
        };
        let bench = Self::measure(options, command, &numbers, &bar);
        bar.finish();
        let training = TrainingSet::whole(&numbers.samples.select_columns(recipe::uses));
        let Numbers { study, setup_id, .. } = numbers;
        Ok(Self { study, folder, setup_id, bench: bench?, training, extracted: options.extracted.is_some() })
    }

    /// The folder for results, for a study that can be judged.
    fn folder(options: &StudyOptions, study: &Study) -> Result<OutputFolder> {
        study.validate(folds_of(options, study)).map_err(user_error)?;
        let out = options.out.clone().unwrap_or_else(|| Path::new("out").join(input::short_name(study)));
        OutputFolder::create(out).map_err(user_error)
    }

    fn numbers(shared: &Shared, options: &StudyOptions, study: Study, bar: &Bar) -> Result<Numbers> {
        let (base, cache) = (shared.data.as_deref(), workspace::cache(shared)?);
        let setup = options.input.setup()?;
        let matrix = input::matrix(shared, &study, &setup, cache.as_ref(), bar);
        let matrix = matrix.inspect_err(|_| bar.finish())?;
        let others = if study.synthetic { Vec::new() } else { unrated(base)? };
        let bank = TableBank::new(&study, matrix.tables, &others, base, cache.as_ref(), &setup).map_err(user_error)?;
        Ok(Numbers { study, samples: matrix.samples, setup_id: setup.id().to_owned(), bank: Some(bank) })
    }

    fn measure(options: &StudyOptions, command: &str, numbers: &Numbers, bar: &Bar) -> Result<StudyBenchmark> {
        let Numbers { study, samples, setup_id, bank } = numbers;
        bar.stage("embeddings");
        let compact = samples.select_columns(recipe::uses);
        let protocol = protocol(study, folds_of(options, study), options.resamples, options.seed);
        let learn = |(bank, learner): (&TableBank, Learner)| {
            let folds = [protocol.folds, protocol.method_folds];
            Ok((learner.name(), embedded_folds(bank, &compact, learner, folds, options.seed)?))
        };
        let banks = bank.iter().flat_map(|bank| Learner::ALL.map(|learner| (bank, learner)));
        let embedded = banks.map(learn).collect::<Result<Vec<_>>>()?;
        let mut versions = versions(setup_id);
        if bank.is_none() {
            versions.insert("embeddings".into(), "left out, for they are learned from BRDFs".into());
        }
        let info = RunInfo { command: command_line(command, study, options, setup_id), versions };
        let stage = |label: &str| bar.label(label);
        Ok(run(study, samples, embedded, &protocol, &info, &stage)?)
    }
}

/// The embedded study is there to show the whole job on any machine, in a minute or two.
fn default_folds(study: &Study) -> usize {
    if study.synthetic { 5 } else { 10 }
}

fn folds_of(options: &StudyOptions, study: &Study) -> usize {
    options.folds.unwrap_or_else(|| default_folds(study))
}

/// Measured materials without ratings that the data folder holds.
fn unrated(data: Option<&Path>) -> Result<Vec<BrdfSource>> {
    let mut found = Vec::new();
    for archive in data.into_iter().flat_map(|data| UNRATED.map(|a| data.join(a))).filter(|path| path.is_file()) {
        for material in materials(&archive).map_err(user_error)? {
            found.push(BrdfSource::Notation(format!("{}:{material}", archive.display())));
        }
    }
    Ok(found)
}

/// What to type for the same bytes: without folders, which do not matter.
fn command_line(command: &str, study: &Study, options: &StudyOptions, setup_id: &str) -> String {
    let name = Path::new(&study.name).file_name().unwrap_or_default().to_string_lossy();
    let source = match options.extracted {
        Some(_) => format!("--extracted {}.parquet", input::short_name(study)),
        None => format!("--study {name}"),
    };
    let mut line = format!("vernis {command} {source} --seed {}", options.seed);
    let folds = (folds_of(options, study), default_folds(study));
    for (flag, (value, default)) in [("folds", folds), ("resamples", (options.resamples, 2000))] {
        if value != default {
            line += &format!(" --{flag} {value}");
        }
    }
    if options.input.has_options() {
        line += &format!(" ({setup_id})");
    }
    line
}

fn versions(setup_id: &str) -> BTreeMap<String, String> {
    [
        ("vernis", env!("CARGO_PKG_VERSION").to_owned()),
        ("descriptors", format!("{VERSION} ({setup_id})")),
        ("metric", recipe::METRIC_VERSION.to_owned()),
    ]
    .map(|(name, version)| (name.to_owned(), version))
    .into()
}

/// Trains on every row, with members on resampled materials.
fn export(job: &Job, name: &str, seed: u64) -> Result<ExportedMetric> {
    let portable = |model: &dyn Predictor| -> Result<Regressor> {
        model.regressor().cloned().context("the recipe's model has no portable form")
    };
    let model = recipe::metric().train(&job.training, seed)?;
    let members = bootstrap_members(&recipe::member(), &job.training, recipe::MEMBERS, seed)?;
    let members = members.iter().map(|m| portable(m.as_ref())).collect::<Result<Vec<_>>>()?;
    let record = &job.bench.record;
    let provenance = Provenance {
        study: record.study.clone(),
        synthetic: record.synthetic,
        rows: record.rows,
        materials: record.materials,
        data: data_hashes(&job.study).into_iter().map(|(name, sha256)| DataHash { name, sha256 }).collect(),
        seed,
        command: record.command.clone(),
        crate_version: env!("CARGO_PKG_VERSION").to_owned(),
        agreement: reached(record),
    };
    Ok(ExportedMetric::new(
        name,
        recipe::METRIC_VERSION,
        Descriptors { setup: job.setup_id.clone(), set: DescriptorSet::extended() },
        portable(model.as_ref())?,
        members,
        job.bench.interval,
        provenance,
    )?)
}

/// The headline figures of the learned metric.
fn reached(record: &BenchmarkRecord) -> Vec<Reached> {
    let Some(metric) = record.metric(recipe::NAME) else { return Vec::new() };
    let aside = format!("unseen material, without {}", record.set_aside.join(", "));
    let mut found = Vec::new();
    for (split, row_set, rows) in [
        (Split::UnseenMaterial, RowSet::All, "unseen material"),
        (Split::UnseenMaterial, RowSet::WithoutSetAside, aside.as_str()),
        (Split::UnseenMaterialAndMethod, RowSet::All, "unseen material and method"),
    ] {
        let Some(judgement) = metric.judgement(split, row_set) else { continue };
        let (agreement, intervals) = (&judgement.agreement, &judgement.intervals);
        for (measure, value, interval) in
            [("plcc", agreement.plcc, intervals.plcc), ("srocc", agreement.srocc, intervals.srocc)]
        {
            found.push(Reached {
                measure: measure.to_owned(),
                rows: rows.to_owned(),
                value,
                low: interval.low,
                high: interval.high,
            });
        }
    }
    found
}
