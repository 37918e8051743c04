//! `vernis experiment optimizers`: what a gradient spares in a fit.

use super::output::{self, Inputs, Replace};
use super::progress::Bar;
use super::{Shared, limits, print, user_error, workspace};
use crate::dataset::Study;
use crate::experiment::optimizers::{OptimizerOptions, optimizers};
use crate::report;
use anyhow::Result;
use clap::Args;
use std::path::{Path, PathBuf};
use vernis_metric::descriptor::DescriptorOptions;

/// Files of a run.
const FILES: [&str; 2] = ["optimizers.md", "optimizers.json"];
/// What is compared where nothing else is said.
const METRICS: [&str; 2] = ["vernis-loss", "vernis"];

/// Make the same fits by Hooke-Jeeves and by L-BFGS.
#[derive(Args)]
#[command(after_help = "\
Writes optimizers.md and optimizers.json. On two cores, 15 references take about a quarter of an hour.

Example:
  vernis experiment optimizers --data ~/brdf-data --out out/optimizers")]
pub struct OptimizersArgs {
    /// A study by name, or a CSV file: its references are fitted.
    #[arg(long, default_value = "lavoue2021-open")]
    study: String,
    /// A metric with a gradient, by name or as the path of an exported metric; may be given several times [default: vernis-loss and
    /// vernis].
    #[arg(long = "metric", short = 'm', value_name = "NAME|FILE")]
    metrics: Vec<String>,
    /// A model, or a sum of models, with a gradient; may be given several times [default: ggx, ward-duer and blinn-phong].
    #[arg(long = "model", value_name = "NAME")]
    models: Vec<String>,
    /// Number of references to fit, one of each group of sister materials, 1 to 10000.
    #[arg(long, value_name = "N", default_value_t = 15, value_parser = limits::integer(1..=10_000_usize))]
    materials: usize,
    /// Maximum number of evaluations of a search, 10 to 1000000.
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = limits::integer(10..=1_000_000_usize))]
    max_evaluations: usize,
    /// Seed of the order of the references.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = limits::seed)]
    seed: u64,
    /// Folder to write to.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    replace: Replace,
}

pub fn run(shared: &Shared, args: &OptimizersArgs) -> Result<()> {
    let named = |given: &[String], default: &[&str]| match given {
        [] => default.iter().map(|name| (*name).to_owned()).collect(),
        given => given.to_vec(),
    };
    let names: Vec<String> = named(&args.metrics, &METRICS);
    let models = named(&args.models, &["ggx", "ward-duer", "blinn-phong"]);
    let metrics = workspace::metrics(shared, &names, &DescriptorOptions::default())?;
    let inputs = Inputs::default().file(&args.study).files(&args.metrics);
    let folder = output::folder(Some(&args.out), PathBuf::new, &FILES, &inputs, args.replace)?;
    let study = Study::load(&args.study, shared.data.as_deref()).map_err(user_error)?;
    workspace::warm_up(shared, &metrics)?;
    let options = OptimizerOptions {
        metrics: &metrics,
        models,
        references: args.materials,
        max_evaluations: args.max_evaluations,
        seed: args.seed,
        data: shared.data.as_deref(),
    };
    let bar = Bar::new();
    let found = optimizers(&study, &options, &|stage, progress| bar.update(stage, progress));
    bar.finish();
    let record = found.map_err(workspace::experiment_error)?;
    folder.write(FILES[1], (serde_json::to_string_pretty(&record)? + "\n").as_bytes())?;
    folder.write(FILES[0], report::optimizers::markdown(&record, &command_line(args)).as_bytes())?;
    print(report::optimizers::summary(&record).to_text())
}

/// What to type for the same bytes: without folders, which do not matter.
fn command_line(args: &OptimizersArgs) -> String {
    let study = Path::new(&args.study).file_name().unwrap_or_default().to_string_lossy();
    let mut line = format!("vernis experiment optimizers --study {study}");
    line.extend(args.metrics.iter().map(|metric| format!(" --metric {metric}")));
    line.extend(args.models.iter().map(|model| format!(" --model {model}")));
    line + &format!(" --materials {} --max-evaluations {} --seed {}", args.materials, args.max_evaluations, args.seed)
}
