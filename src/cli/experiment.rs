//! `vernis experiment`: questions that take hours to answer, and their reports.

use super::claims::{self, NoiseArgs, TripletsArgs};
use super::progress::Bar;
use super::{Shared, limits, print, user_error, workspace};
use anyhow::Result;
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};
use vernis::dataset::Study;
use vernis::experiment::BenchmarkOptions;
use vernis::experiment::losses::{Found, LossesOptions, losses};
use vernis::experiment::plan::Plan;
use vernis::report::{self, OutputFolder};

/// Experiments.
#[derive(Args)]
pub struct ExperimentArgs {
    #[command(subcommand)]
    experiment: Question,
}

#[derive(Subcommand)]
enum Question {
    /// Which loss should a fit have?
    Losses(LossesArgs),
    /// How well could any metric agree with ratings as noisy as these?
    Noise(NoiseArgs),
    /// Do metrics agree with people on which of two materials looks more like a third?
    Triplets(TripletsArgs),
}

/// Fit GGX, Ward and Blinn-Phong under six losses, and judge the fits by metrics that were not the loss.
#[derive(Args)]
#[command(after_help = "\
Each trained metric becomes a file in OUT/metrics, each fit a file in OUT/fits; an interrupted experiment continues with the
next one. On two cores, 30 materials take about an hour.

Examples:
  vernis experiment losses --data ~/brdf-data --out out/losses
  vernis experiment losses --data ~/brdf-data --out out/losses --report   # the materials finished so far")]
pub struct LossesArgs {
    /// A study by name, or a CSV file: its references are fitted, its ratings train the learned metrics.
    #[arg(long, default_value = "lavoue2021-open")]
    study: String,
    /// Folder to write to.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Number of references to fit, one of each group of sister materials, 2 to 10000.
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = limits::integer(2..=10_000_usize))]
    materials: usize,
    /// Cells of an Lp metric per cell of its search, along each axis, 1 to 15.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = limits::integer(1..=15_usize))]
    grid: usize,
    /// Grid on which transport and the energy distance compare, THETA_IxTHETA_OxPHI_D.
    #[arg(long, value_name = "CELLS", default_value = "12x12x48")]
    graph_grid: String,
    /// Maximum number of evaluations of a search under a learned metric, 10 to 1000000.
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = limits::integer(10..=1_000_000_usize))]
    max_evaluations: usize,
    /// Cross-validation folds, by material, for the learned metrics: 2 to the number of groups of materials.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = limits::folds)]
    folds: usize,
    /// Bootstrap resamples of materials, 40 to 20000.
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = limits::resamples)]
    resamples: usize,
    /// Seed of the order of materials, folds, training and resamples.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = limits::seed)]
    seed: u64,
    /// Report the materials finished so far, without fitting.
    #[arg(long)]
    report: bool,
}

pub fn run(shared: &Shared, args: ExperimentArgs) -> Result<()> {
    match args.experiment {
        Question::Losses(args) => run_losses(shared, &args),
        Question::Noise(args) => claims::noise(shared, &args),
        Question::Triplets(args) => claims::triplets(shared, &args),
    }
}

fn options(shared: &Shared, args: &LossesArgs) -> Result<LossesOptions> {
    Ok(LossesOptions {
        data: shared.data.clone(),
        cache: workspace::cache(shared)?,
        folder: args.out.clone(),
        materials: args.materials,
        coarsening: args.grid,
        graph_grid: args.graph_grid.parse().map_err(|e| user_error(format!("--graph-grid: {e}")))?,
        max_evaluations: args.max_evaluations,
        folds: args.folds,
        resamples: args.resamples,
        seed: args.seed,
        compute: !args.report,
    })
}

fn run_losses(shared: &Shared, args: &LossesArgs) -> Result<()> {
    let options = options(shared, args)?;
    let study = Study::load(&args.study, shared.data.as_deref()).map_err(user_error)?;
    // The learned metrics are trained in these folds: a study that cannot be is refused before the work.
    let (folds, data) = (Some(args.folds), shared.data.clone());
    let how =
        BenchmarkOptions { folds, data, resamples: args.resamples, seed: args.seed, ..BenchmarkOptions::default() };
    Plan::of(&study, &how).map_err(workspace::experiment_error)?;
    let folder = OutputFolder::create(&args.out).map_err(user_error)?;
    let bar = Bar::new();
    let found = losses(&study, &options, &|stage, progress| bar.update(stage, progress));
    bar.finish();
    let Found { record, warnings } = found.map_err(user_error)?;
    workspace::warn(&warnings);
    let text = report::losses::markdown(&record, &command_line(args, &study));
    let path = folder.write("report.md", text.as_bytes())?;
    print(format!("{}report: {}\n", report::losses::text(&record), path.display()))
}

/// What to type for the same bytes: without folders, which do not matter.
fn command_line(args: &LossesArgs, study: &Study) -> String {
    let name = Path::new(&study.name).file_name().unwrap_or_default().to_string_lossy();
    format!(
        "vernis experiment losses --study {name} --materials {} --grid {} --graph-grid {} --max-evaluations {} --folds {} \
         --resamples {} --seed {}",
        args.materials, args.grid, args.graph_grid, args.max_evaluations, args.folds, args.resamples, args.seed
    )
}
