//! `vernis experiment`: questions that take hours to answer, and their reports.

use super::claims::{self, NoiseArgs, TripletsArgs};
use super::landscape::{self, LandscapeArgs};
use super::output::{self, Inputs, Replace};
use super::progress::Bar;
use super::scale::ScaleArgs;
use super::{Shared, cells, limits, print, signals, user_error, workspace};
use anyhow::Result;
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};
use vernis::dataset::{Study, manifest};
use vernis::experiment::BenchmarkOptions;
use vernis::experiment::losses::{Found, LossesOptions, losses};
use vernis::experiment::plan::Plan;
use vernis::experiment::rebuilt::{RebuiltOptions, hypotheses, rebuilt};
use vernis::report;

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
    /// Which rebuilt candidates explain the ratings of their method?
    Rebuilt(RebuiltArgs),
    /// How well could any metric agree with ratings as noisy as these?
    Noise(NoiseArgs),
    /// Do metrics agree with people on which of two materials looks more like a third?
    Triplets(TripletsArgs),
    /// How do metrics follow one parameter of a material?
    Landscape(LandscapeArgs),
}

/// Fit GGX, Ward and Blinn-Phong under six losses, and judge the fits by metrics that were not the loss.
#[derive(Args)]
#[command(after_help = "\
Each trained metric becomes a file in OUT/metrics, each fit a file in OUT/fits; after an interruption (Ctrl-C, exit code 130;
SIGTERM, 143) the same command continues with the next one. Files of another study or of other settings are refused. On two
cores, 30 materials take about an hour.

Examples:
  vernis experiment losses --data ~/brdf-data --out out/losses
  vernis experiment losses --data ~/brdf-data --out out/losses --report   # the materials finished so far")]
pub struct LossesArgs {
    /// A study by name, or a CSV file: its references are fitted, its ratings train the learned metrics.
    #[arg(long, default_value = "lavoue2021-open")]
    study: String,
    #[command(flatten)]
    scale: ScaleArgs,
    /// Folder to write to.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Number of references to fit, one of each group of sister materials, 2 to 10000.
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = limits::integer(2..=10_000_usize))]
    materials: usize,
    /// Grid on which transport and the energy distance compare, THETA_IxTHETA_OxPHI_D [default: 12x12x48].
    #[arg(long, value_name = "GRID")]
    grid: Option<String>,
    /// The old spelling of --grid.
    #[arg(long, hide = true)]
    graph_grid: Option<String>,
    /// Cells of an Lp metric per cell of its search, along each axis, 1 to 15 [default: 5].
    #[arg(long, value_name = "N", value_parser = limits::integer(1..=15_usize))]
    coarsening: Option<usize>,
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
        Question::Rebuilt(args) => run_rebuilt(shared, &args),
        Question::Noise(args) => claims::noise(shared, &args),
        Question::Triplets(args) => claims::triplets(shared, &args),
        Question::Landscape(args) => landscape::run(shared, &args),
    }
}

fn options(shared: &Shared, args: &LossesArgs) -> Result<LossesOptions> {
    let (grid, coarsening) = cells(args)?;
    Ok(LossesOptions {
        data: shared.data.clone(),
        cache: workspace::cache(shared)?,
        folder: args.out.clone(),
        materials: args.materials,
        coarsening,
        graph_grid: grid.parse().map_err(|e| user_error(format!("--grid: {e}")))?,
        max_evaluations: args.max_evaluations,
        folds: args.folds,
        resamples: args.resamples,
        seed: args.seed,
        compute: !args.report,
    })
}

/// Grid of the metrics on graphs, and coarsening of the Lp metrics.
fn cells(args: &LossesArgs) -> Result<(&str, usize)> {
    let (grid, coarsening) = cells::read(args.grid.as_deref(), args.coarsening)?;
    Ok((grid.or(args.graph_grid.as_deref()).unwrap_or("12x12x48"), coarsening.unwrap_or(5)))
}

fn run_losses(shared: &Shared, args: &LossesArgs) -> Result<()> {
    let options = options(shared, args)?;
    let study = Study::load_on(&args.study, shared.data.as_deref(), args.scale.declared).map_err(user_error)?;
    // The learned metrics are trained in these folds: a study that cannot be is refused before the work.
    let (folds, data) = (Some(args.folds), shared.data.clone());
    let how =
        BenchmarkOptions { folds, data, resamples: args.resamples, seed: args.seed, ..BenchmarkOptions::default() };
    Plan::of(&study, &how).map_err(workspace::experiment_error)?;
    let inputs = Inputs::default().file(&args.study);
    let folder = output::folder(Some(&args.out), PathBuf::new, &["report.md"], &inputs, Replace::CONTINUES)?;
    let bar = Bar::new();
    signals::resumable(
        &bar,
        format!(
            "the metrics and fits that are finished are kept in {}; the same command continues from there",
            args.out.display()
        ),
    )?;
    let found = losses(&study, &options, &|stage, progress| bar.update(stage, progress));
    bar.finish();
    let Found { record, warnings } = found.map_err(user_error)?;
    workspace::warn(&warnings);
    let text = report::losses::markdown(&record, &command_line(args, &study, &options));
    let path = folder.write("report.md", text.as_bytes())?;
    print(format!("{}report: {}\n", report::losses::text(&record), path.display()))
}

/// What to type for the same bytes: without folders, which do not matter.
fn command_line(args: &LossesArgs, study: &Study, options: &LossesOptions) -> String {
    let name = Path::new(&study.name).file_name().unwrap_or_default().to_string_lossy();
    format!(
        "vernis experiment losses --study {name}{} --materials {} --coarsening {} --grid {} --max-evaluations {} --folds {} \
         --resamples {} --seed {}",
        args.scale.option(),
        args.materials,
        options.coarsening,
        options.graph_grid,
        args.max_evaluations,
        args.folds,
        args.resamples,
        args.seed
    )
}

/// Predict a method's ratings from candidates rebuilt in several ways, with a judge that saw neither method nor material.
#[derive(Args)]
#[command(after_help = "\
The study is `lavoue2021-open`, whose candidates are reconstructions. The experiment covers ABC (index of refraction), WARD
(form of the lobe) and BAGHER, and then the metric's agreement without the rows of ABC and WARD. On two cores it takes about
five minutes.

Example:
  vernis experiment rebuilt --data ~/brdf-data --out out/rebuilt")]
pub struct RebuiltArgs {
    /// Folder to write to.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Cross-validation folds, by material: 2 to the number of groups of materials.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = limits::folds)]
    folds: usize,
    /// Bootstrap resamples of materials, 40 to 20000.
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = limits::resamples)]
    resamples: usize,
    /// Seed of folds, training and resamples.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = limits::seed)]
    seed: u64,
    #[command(flatten)]
    replace: Replace,
    /// Print the record as JSON instead of the tables.
    #[arg(long)]
    json: bool,
}

fn run_rebuilt(shared: &Shared, args: &RebuiltArgs) -> Result<()> {
    let study = Study::load(manifest::OPEN, shared.data.as_deref()).map_err(user_error)?;
    study.validate(args.folds).map_err(user_error)?;
    let names = ["report.md", "rebuilt.json"];
    let folder = output::folder(Some(&args.out), PathBuf::new, &names, &Inputs::default(), args.replace)?;
    let options = RebuiltOptions {
        data: shared.data.clone(),
        cache: workspace::cache(shared)?,
        folds: args.folds,
        resamples: args.resamples,
        seed: args.seed,
    };
    let bar = Bar::new();
    let found = rebuilt(&study, &hypotheses(), &options, &|stage, progress| bar.update(stage, progress));
    bar.finish();
    let record = found.map_err(workspace::experiment_error)?;
    let command =
        format!("vernis experiment rebuilt --folds {} --resamples {} --seed {}", args.folds, args.resamples, args.seed);
    let path = folder.write("report.md", report::rebuilt::markdown(&record, &command).as_bytes())?;
    let json = format!("{}\n", serde_json::to_string_pretty(&record)?);
    folder.write("rebuilt.json", json.as_bytes())?;
    if args.json {
        return print(json);
    }
    print(format!("{}report: {}\n", report::rebuilt::text(&record), path.display()))
}
