//! `vernis train` and `vernis benchmark`: the main job, from a study to a metric and a report.

use super::progress::Bar;
use super::{Shared, print, user_error, workspace};
use crate::brdf::BrdfSource;
use crate::brdf::formats::materials;
use crate::dataset::split::TrainingSet;
use crate::dataset::{Study, synthetic};
use crate::descriptor::light::Light;
use crate::descriptor::{Cache, DescriptorOptions, DescriptorSet, Lights, Setup, ShapeChoice, VERSION};
use crate::evaluation::records::{BenchmarkRecord, RowSet, Split};
use crate::evaluation::study_benchmark::{RunInfo, StudyBenchmark, data_hashes, protocol, run};
use crate::metric::Metric;
use crate::metric::learned::Regressor;
use crate::metric::learned::exported::{DataHash, Descriptors, ExportedMetric, Provenance, Reached};
use crate::metric::registry::Registry;
use crate::report::{OutputFolder, pictures, tables, write_benchmark};
use crate::train::embedding_folds::{Learner, TableBank, embedded_folds};
use crate::train::ensemble::bootstrap_members;
use crate::train::matrix::MatrixBuilder;
use crate::train::{Predictor, Trainer, recipe};
use anyhow::{Context, Result};
use clap::Args;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The study that is used where the data folder has it.
const OPEN_STUDY: &str = "lavoue2021-open";
/// Archives of measured materials that nobody rated, from which embeddings may be learned.
const UNRATED: [&str; 2] = ["nbrdf/rgl-isotropic_nbrdf.zip", "nbrdf/nielsen_nbrdf.zip"];

/// What a run is about.
#[derive(Args)]
pub struct StudyOptions {
    /// A study by name (lavoue2021-open, lavoue2021, synthetic) or a CSV file [default: lavoue2021-open if the data folder
    /// has it, else synthetic].
    #[arg(long, value_name = "STUDY")]
    study: Option<String>,
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
    #[arg(long, default_value_t = 2000)]
    resamples: usize,
    /// A light probe (latitude/longitude, Radiance .hdr) instead of the lights defined by code.
    #[arg(long, value_name = "HDR")]
    lights: Option<PathBuf>,
    /// A mesh (ASCII .ply) whose normals weight the pictures instead of the sphere's.
    #[arg(long, value_name = "PLY")]
    shape: Option<PathBuf>,
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
    setup: Arc<Setup>,
    bench: StudyBenchmark,
    /// The compact columns of every row.
    training: TrainingSet,
}

pub fn train(shared: &Shared, args: TrainArgs) -> Result<()> {
    let job = Job::run(shared, &args.options, "train")?;
    let default = match job.study.name.as_str() {
        OPEN_STUDY => recipe::NAME.to_owned(),
        other => format!("{}-{}", recipe::NAME, Path::new(other).file_stem().unwrap_or_default().to_string_lossy()),
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

/// The named study, or the open one if it is here, or the embedded one; says which, and how to get the other.
fn load_study(shared: &Shared, options: &StudyOptions) -> Result<Study> {
    let data = shared.data.as_deref();
    if let Some(name) = &options.study {
        return Study::load(name, data).map_err(user_error);
    }
    match Study::load(OPEN_STUDY, data) {
        Ok(study) => {
            eprintln!("study {OPEN_STUDY}: human ratings; `--study {}` is the embedded one", synthetic::NAME);
            Ok(study)
        }
        Err(missing) => {
            eprintln!("study {}: SYNTHETIC observers, generated by code.", synthetic::NAME);
            eprintln!("For human ratings name a data folder with --data DIR or VERNIS_DATA ({missing}).");
            eprintln!("`vernis data list` says what belongs there and where to get it.");
            Study::load(synthetic::NAME, data).map_err(user_error)
        }
    }
}

impl Job {
    /// The page, with pictures of the materials on which the metric is furthest off.
    fn write_report(&self, shared: &Shared) -> Result<PathBuf> {
        let (record, light) = (&self.bench.record, Light::lamps(PICTURED_LAMPS));
        let materials = pictures::of_study(&self.study, shared.data.as_deref(), Some(record), &light, MOST_PICTURED)?;
        Ok(write_benchmark(&self.folder, record, &materials, "lamps that are defined by code")?)
    }

    fn run(shared: &Shared, options: &StudyOptions, command: &str) -> Result<Self> {
        if options.resamples < 2 {
            return Err(user_error(format!("--resamples: found {}, allowed 2 or more", options.resamples)));
        }
        if options.folds.is_some_and(|folds| folds < 2) {
            return Err(user_error("--folds: found fewer than 2, allowed 2 or more"));
        }
        let study = load_study(shared, options)?;
        let folds = folds_of(options, &study);
        study.validate(folds).map_err(user_error)?;
        if !study.completeness.is_whole() {
            let c = study.completeness;
            eprintln!("{}: {} of {} rated pairs are here", study.name, c.found, c.known);
        }
        // Found unwritable before the work, not after it.
        let short = Path::new(&study.name).file_stem().unwrap_or_default().to_owned();
        let out = options.out.clone().unwrap_or_else(|| Path::new("out").join(short));
        let folder = OutputFolder::create(out).map_err(user_error)?;
        let cache = workspace::cache(shared)?;
        let setup = Setup::new(&DescriptorOptions {
            lights: options.lights.clone().map_or(Lights::default(), Lights::Probe),
            shape: options.shape.clone().map_or(ShapeChoice::default(), ShapeChoice::Mesh),
        })
        .map_err(user_error)?;
        let bar = Bar::new();
        let bench = Self::measure(shared, options, command, &study, cache.as_ref(), &setup, &bar);
        bar.finish();
        let (bench, training) = bench?;
        Ok(Self { study, folder, setup, bench, training })
    }

    fn measure(
        shared: &Shared,
        options: &StudyOptions,
        command: &str,
        study: &Study,
        cache: Option<&Cache>,
        setup: &Setup,
        bar: &Bar,
    ) -> Result<(StudyBenchmark, TrainingSet)> {
        let base = shared.data.as_deref();
        bar.stage("picture operators");
        workspace::warn(cache.and_then(|c| c.prepare(setup)));
        let set = DescriptorSet::all();
        let progress = |stage, p| bar.update(stage, p);
        let matrix = MatrixBuilder { set: &set, setup, graphs: &graphs(study)?, base, cache, progress: &progress }
            .build(study)
            .map_err(user_error)?;
        workspace::warn(&matrix.warnings);
        bar.stage("embeddings");
        let samples = &matrix.samples;
        let compact = samples.select_columns(recipe::uses);
        let others = if study.synthetic { Vec::new() } else { unrated(base)? };
        let bank = TableBank::gather(study, &others, base, cache, setup).map_err(user_error)?;
        let protocol = protocol(study, folds_of(options, study), options.resamples, options.seed);
        let embedded = [Learner::PrincipalComponents, Learner::Autoencoder]
            .map(|learner| {
                let folds = [protocol.folds, protocol.method_folds];
                Ok((learner.name(), embedded_folds(&bank, &compact, learner, folds, options.seed)?))
            })
            .into_iter()
            .collect::<Result<Vec<_>>>()?;
        let info = RunInfo { command: command_line(command, study, options, setup), versions: versions(setup) };
        let stage = |label: &str| bar.label(label);
        let bench = run(study, samples, embedded, &protocol, &info, &stage)?;
        Ok((bench, TrainingSet::whole(&compact)))
    }
}

/// The embedded study is there to show the whole job on any machine, in a minute or two.
fn default_folds(study: &Study) -> usize {
    if study.synthetic { 5 } else { 10 }
}

fn folds_of(options: &StudyOptions, study: &Study) -> usize {
    options.folds.unwrap_or_else(|| default_folds(study))
}

/// The transport and the energy distance that take part. The embedded study is there to be quick: a coarser grid.
fn graphs(study: &Study) -> Result<Vec<Arc<dyn Metric>>> {
    let registry = Registry::standard()?;
    let names = if study.synthetic { ["ot[grid=6x6x24,kappa=4]", "energy[grid=6x6x24]"] } else { ["ot", "energy"] };
    Ok(names.into_iter().map(|name| registry.get(name)).collect::<Result<_, _>>()?)
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
fn command_line(command: &str, study: &Study, options: &StudyOptions, setup: &Setup) -> String {
    let name = Path::new(&study.name).file_name().unwrap_or_default().to_string_lossy();
    let mut line = format!("vernis {command} --study {name} --seed {}", options.seed);
    let folds = (folds_of(options, study), default_folds(study));
    for (flag, (value, default)) in [("folds", folds), ("resamples", (options.resamples, 2000))] {
        if value != default {
            line += &format!(" --{flag} {value}");
        }
    }
    if options.lights.is_some() || options.shape.is_some() {
        line += &format!(" ({})", setup.id());
    }
    line
}

fn versions(setup: &Setup) -> BTreeMap<String, String> {
    [
        ("vernis", env!("CARGO_PKG_VERSION").to_owned()),
        ("descriptors", format!("{VERSION} ({})", setup.id())),
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
        Descriptors { setup: job.setup.id().to_owned(), set: DescriptorSet::extended() },
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
