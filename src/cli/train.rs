//! `vernis train` and `vernis benchmark`: the main job at the command line.

use super::output::{self, Replace};
use super::progress::Bar;
use super::scores::ScoresArgs;
use super::study_input::StudyInput;
use super::{Shared, limits, note, print, user_error, workspace};
use crate::dataset::{DatasetError, Study, contradiction};
use crate::evaluation::records::BenchmarkRecord;
use crate::experiment::further::Further;
use crate::experiment::plan::Plan;
use crate::experiment::train::{RESAMPLES, Stage, loss_name, metric_file, metric_name, metrics};
use crate::experiment::{BenchmarkOptions, ExperimentError, Measurement, Purpose};
use crate::report::pictures::{self, PictureError};
use crate::report::{self, OutputFolder, tables, write_benchmark, write_numbers};
use crate::samples::extracted::ExtractedStudy;
use anyhow::Result;
use clap::Args;
use std::path::{Path, PathBuf};
use vernis_metric::metric::registry::Registry;

/// What a run is about.
#[derive(Args)]
pub struct StudyOptions {
    #[command(flatten)]
    input: StudyInput,
    /// A whole study in a file of `vernis extract` or `vernis merge`. BRDFs are not needed: embeddings, which are learned from
    /// BRDFs, are omitted, and so are pictures of missing BRDFs. With --study, a file that was extracted from another study, or
    /// from ratings that have changed since, is refused.
    #[arg(long, value_name = "PARQUET", conflicts_with_all = ["declared", "lights", "shape"])]
    extracted: Option<PathBuf>,
    /// Seed of splits, resamples and initial weights. The same seed gives the same bytes.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = limits::seed)]
    seed: u64,
    #[command(flatten)]
    scores: ScoresArgs,
    /// Judge a further metric by name, such as D4.Cl, ot[p=2,blur=0.02], or stimulus[ssim]: SSIM of rendered pictures; may be given
    /// several times. all-stimulus, all-stimulus-offset and all-stimulus-offset-minus-hidden stand for all metrics on pictures by one
    /// way to place the cameras.
    #[arg(long = "metric", short = 'm', value_name = "NAME", conflicts_with = "extracted")]
    metrics: Vec<String>,
    /// Folder for results [default: out/STUDY, where earlier results are replaced; in a folder named here they stay without
    /// --replace].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    replace: Replace,
    /// Cross-validation folds, by material: 2 to the number of groups of materials [default: 10; 5 for the embedded study].
    #[arg(long, value_name = "N", value_parser = limits::folds)]
    folds: Option<usize>,
    /// Bootstrap resamples of materials, 40 to 20000.
    #[arg(long, value_name = "N", default_value_t = RESAMPLES, value_parser = limits::resamples)]
    resamples: usize,
    /// Also judge the metric with one part changed, which says what each part is worth. Takes several minutes more.
    #[arg(long)]
    variants: bool,
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
    /// Name of the exported metric: letters, digits, `-`, `_` and `.` [default: vernis for the open study, else vernis-STUDY].
    #[arg(long, value_parser = limits::metric_name)]
    name: Option<String>,
}

/// Measure all metrics on a study under nested cross-validation, without exporting one.
#[derive(Args)]
#[command(after_help = "\
Examples:
  vernis benchmark --study synthetic
  vernis benchmark --study my-ratings.csv --scores lpips.csv --higher-is-better ssim
  vernis benchmark --study my-ratings.csv --metric 'stimulus[ssim]' --metric 'ot[p=2,blur=0.02]'
  vernis benchmark --study lavoue2021-open --data ~/brdf-data --seed 7 --out out/seed-7")]
pub struct BenchmarkArgs {
    #[command(flatten)]
    options: StudyOptions,
}

/// A measurement and where its results go.
struct Job {
    measurement: Measurement,
    folder: OutputFolder,
    /// The study came without its BRDFs.
    extracted: bool,
    /// How many of the record's sentences on what is left out were said.
    said: usize,
}

pub fn train(shared: &Shared, args: TrainArgs) -> Result<()> {
    let bar = Bar::new();
    if let Some(name) = &args.name {
        free_name(name)?;
        free_name(&loss_name(name))?;
    }
    let mut job = Job::run(shared, &args.options, Purpose::Train, args.name.as_deref(), &bar)?;
    let exported = job.explain(&bar).and_then(|()| {
        let metric = job.measurement.export(args.name.as_deref(), &|stage, progress| bar.update(stage, progress))?;
        let path = job.folder.write(&metric_file(&metric.name), metric.to_json()?.as_bytes())?;
        let loss = job.measurement.export_loss(args.name.as_deref(), &|stage, progress| bar.update(stage, progress))?;
        Ok((path, job.folder.write(&metric_file(&loss.name), loss.to_json()?.as_bytes())?))
    });
    // Whatever became of the one, the other is finished.
    let report = job.write_report(shared);
    bar.finish();
    let (path, loss) = exported.map_err(|error| job.later(error))?;
    let report = report.map_err(|error| job.later(error))?;
    summary(job.measurement.record(), args.options.json)?;
    if !args.options.json {
        print(format!(
            "metric: {}\nmetric to fit with: {}\nreport: {}\n",
            path.display(),
            loss.display(),
            report.display()
        ))?;
    }
    Ok(())
}

pub fn benchmark(shared: &Shared, args: BenchmarkArgs) -> Result<()> {
    let bar = Bar::new();
    let mut job = Job::run(shared, &args.options, Purpose::Benchmark, None, &bar)?;
    let explained = job.explain(&bar);
    bar.finish();
    let report = job.write_report(shared).map_err(|error| job.later(error))?;
    explained.map_err(|error| job.later(error))?;
    summary(job.measurement.record(), args.options.json)?;
    if !args.options.json {
        print(format!("report: {}\n", report.display()))?;
    }
    Ok(())
}

/// That no metric of the program has the name: one would hide the other. The open study's metric is called as it is by default.
fn free_name(name: &str) -> Result<()> {
    match Registry::standard()?.resolve(name) {
        Ok(_) => Err(user_error(format!("--name is {name}, which is a metric of vernis itself; give it another name"))),
        Err(_) => Ok(()),
    }
}

fn summary(record: &BenchmarkRecord, json: bool) -> Result<()> {
    let defeat = tables::defeat(record);
    if json {
        defeat.into_iter().for_each(note);
        return print(format!("{}\n", serde_json::to_string_pretty(record)?));
    }
    let tables: Vec<String> = tables::headlines(record).iter().map(tables::Table::to_text).collect();
    let mut text = tables.join("\n");
    text.extend(defeat.map(|defeat| defeat + "\n"));
    if record.synthetic {
        text += "SYNTHETIC: these ratings come from simulated observers and say nothing about people.\n";
    }
    print(&text)
}

impl Job {
    /// `name` is that of the metric that [`Purpose::Train`] exports, where one was given.
    fn run(shared: &Shared, options: &StudyOptions, purpose: Purpose, name: Option<&str>, bar: &Bar) -> Result<Self> {
        let mut how = BenchmarkOptions {
            data: shared.data.clone(),
            cache: if options.extracted.is_some() { None } else { workspace::cache(shared)? },
            descriptors: options.input.view.options(),
            folds: options.folds,
            resamples: options.resamples,
            variants: options.variants,
            seed: options.seed,
            scores: None,
            further: Further::default(),
        };
        let progress = |stage: &str, progress| bar.update(stage, progress);
        let exported = purpose == Purpose::Train;
        let name = |study: &Study| name.map_or_else(|| metric_name(study), str::to_owned);
        let files = |study: &Study| -> Vec<String> {
            let names = exported.then(|| [name(study), loss_name(&name(study))]);
            names.iter().flatten().map(|name| metric_file(name)).collect()
        };
        let (measurement, (folder, said)) = match &options.extracted {
            Some(path) => {
                let extracted = ExtractedStudy::load(path).map_err(user_error)?;
                let place = path.display().to_string();
                extracted.check_whole(&place).map_err(user_error)?;
                extracted.check_versions(&metrics(&extracted.study)?, &place).map_err(user_error)?;
                if options.input.is_named() {
                    let study = options.input.study(shared)?;
                    if let Some(differs) = contradiction::of_studies(&extracted.study, &study) {
                        let name = &study.name;
                        let message =
                            format!("{place} was not extracted from the study {name} as it is now: {differs}");
                        return Err(user_error(message));
                    }
                }
                how.scores = options.scores.load(&extracted.study)?;
                let folder = folder(options, &how, &extracted.study, files(&extracted.study))?;
                note(format_args!("{place}: embeddings are left out, for they are learned from BRDFs"));
                (Measurement::of_extracted(&extracted, &how, purpose, &progress), folder)
            }
            None => {
                let study = options.input.study(shared)?;
                how.further = further(shared, options, &study)?;
                // Found unwritable before the work, not after it.
                how.scores = options.scores.load(&study)?;
                let folder = folder(options, &how, &study, files(&study))?;
                (Measurement::of(&study, &how, purpose, &progress), folder)
            }
        };
        let measurement = measurement.map_err(workspace::experiment_error)?;
        workspace::warn(&measurement.warnings);
        let mut job = Self { measurement, folder, extracted: options.extracted.is_some(), said };
        job.keep()?;
        Ok(job)
    }

    /// Writes down what is finished, and says what had to be left out.
    fn keep(&mut self) -> Result<()> {
        let record = self.measurement.record();
        write_numbers(&self.folder, record)?;
        say(&record.left_out[self.said.min(record.left_out.len())..]);
        self.said = record.left_out.len();
        Ok(())
    }

    /// Adds what explains the measurement, stage by stage.
    fn explain(&mut self, bar: &Bar) -> Result<()> {
        for stage in Stage::ALL {
            let progress = |stage: &str, progress| bar.update(stage, progress);
            self.measurement.run(stage, &progress).map_err(workspace::experiment_error)?;
            self.keep()?;
        }
        Ok(())
    }

    /// An error of what follows the measurement, with where the measurement is.
    fn later(&self, error: anyhow::Error) -> anyhow::Error {
        let folder = self.folder.path().display();
        error.context(format!(
            "the measurement is finished and written ({folder}/benchmark.json), but what follows it failed"
        ))
    }

    /// The page, with pictures of the materials on which the metric is furthest off.
    fn write_report(&self, shared: &Shared) -> Result<PathBuf> {
        let record = self.measurement.record();
        let (study, data) = (self.measurement.study(), shared.data.as_deref());
        let materials = match pictures::of_benchmark(study, data, record) {
            Err(PictureError::Source(error)) if self.extracted => {
                note(format_args!("no pictures of materials in the report: {error}"));
                Vec::new()
            }
            found => found?,
        };
        Ok(write_benchmark(&self.folder, record, &materials, pictures::LAMPS_IN_WORDS)?)
    }
}

/// The metrics that are named to be judged as well.
fn further(shared: &Shared, options: &StudyOptions, study: &Study) -> Result<Further> {
    if options.metrics.is_empty() {
        return Ok(Further::default());
    }
    let metrics = workspace::metrics(shared, &options.metrics, &options.input.view.options())?;
    Further::new(metrics, study).map_err(workspace::experiment_error)
}

/// Says what is left out.
fn say(sentences: &[String]) {
    for sentence in sentences {
        note(sentence);
    }
}

/// The folder for results, `metrics` among them, for a study that can be judged; says what the study does not support, and returns
/// how many sentences that took.
fn folder(
    options: &StudyOptions,
    how: &BenchmarkOptions,
    study: &Study,
    metrics: Vec<String>,
) -> Result<(OutputFolder, usize)> {
    let plan = Plan::of(study, how).map_err(|error| match &error {
        ExperimentError::Study(cause) if matches!(**cause, DatasetError::TooFewGroups { .. }) => {
            user_error(format!("{error}; --folds sets their number"))
        }
        _ => workspace::experiment_error(error),
    })?;
    let default = || Path::new("out").join(study.short_name());
    let report = report::FILES.into_iter().filter(|name| *name != "study.json").map(str::to_owned);
    let names: Vec<String> = report.chain(metrics).collect();
    let inputs = options.input.inputs().files(&options.extracted).files(options.scores.file());
    let folder = output::folder(options.out.as_deref(), default, &names, &inputs, options.replace)?;
    say(&plan.left_out);
    Ok((folder, plan.left_out.len()))
}
