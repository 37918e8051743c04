//! `vernis experiment`: questions that take minutes or hours to answer, and their reports.

use super::claims::{self, NoiseArgs, TripletsArgs, VersionsArgs};
use super::judging::Judging;
use super::landscape::{self, LandscapeArgs};
use super::optimizers::{self, OptimizersArgs};
use super::output::{self, Inputs, Replace};
use super::progress::Bar;
use super::rendering::{self, RenderingArgs};
use super::scale::ScaleArgs;
use super::{Shared, cells, limits, print, signals, user_error, workspace};
use crate::dataset::{Study, manifest};
use crate::experiment::BenchmarkOptions;
use crate::experiment::losses::{Found, LossesOptions, losses};
use crate::experiment::plan::Plan;
use crate::experiment::rebuilt::{RebuiltOptions, Way, hypotheses, rebuilt};
use crate::experiment::trials::{self, TrialOptions};
use crate::report;
use anyhow::Result;
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};
use vernis_metric::metric::registry::Registry;

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
    /// What does this version of the metric gain over version 1?
    Versions(VersionsArgs),
    /// What does a gradient spare in a fit?
    Optimizers(OptimizersArgs),
    /// How much of a distance between stimuli is the noise of rendering?
    Rendering(RenderingArgs),
}

/// Fit GGX, Ward, Blinn-Phong and principled under ten losses, and judge the fits by metrics that were not the loss.
#[derive(Args)]
#[command(after_help = "\
Each trained metric becomes a file in OUT/metrics, each fit a file in OUT/fits; after an interruption (Ctrl-C, exit code 130;
SIGTERM, 143) the same command continues with the next one. Files of another study or of other settings are refused. On two
cores, 32 materials take several hours.

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
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = limits::integer(2..=10_000_usize))]
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
    /// Bootstrap resamples of materials, 40 to 20000. A table has more than 150 comparisons: with 2000 resamples no p could be below
    /// 0.05 after Holm's correction.
    #[arg(long, value_name = "N", default_value_t = 20000, value_parser = limits::resamples)]
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
        Question::Versions(args) => claims::versions(shared, &args),
        Question::Optimizers(args) => optimizers::run(shared, &args),
        Question::Rendering(args) => rendering::run(shared, &args),
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
        conditions: workspace::conditions(shared)?,
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
(form of the lobe), BAGHER, and the family of DUPUY, GGX and BECKMAN, and then the metric's agreement without the rows of the methods
whose candidates were chosen with ratings. On two cores it takes about ten minutes.

--refit takes a method that the study does not rebuild: ABC-OURS, BLINN-PHONG-OURS, LAFORTUNE-OURS, WARD-OURS, CHEBYCHEV or LEGENDRE. Its
model is fitted to every reference, in each way that the paper leaves open, and the judge is asked about the fits; nothing learns from
them. Each fit becomes a file in OUT/fits; after an interruption (Ctrl-C, exit code 130; SIGTERM, 143) the same command continues. A fit
takes a second or two.

Examples:
  vernis experiment rebuilt --data ~/brdf-data --out out/rebuilt
  vernis experiment rebuilt --data ~/brdf-data --out out/rebuilt --refit WARD-OURS --refit BLINN-PHONG-OURS")]
pub struct RebuiltArgs {
    /// Folder to write to.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Judge fits of this method as well, made now; may be given several times.
    #[arg(long, value_name = "METHOD")]
    refit: Vec<String>,
    /// Cells of D4.Cl per cell of the search of such fits, along each axis, 1 to 15.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = limits::integer(1..=15_usize))]
    coarsening: usize,
    #[command(flatten)]
    judging: Judging,
    #[command(flatten)]
    replace: Replace,
    /// Print the record as JSON instead of the tables.
    #[arg(long)]
    json: bool,
}

fn run_rebuilt(shared: &Shared, args: &RebuiltArgs) -> Result<()> {
    let study = Study::load(manifest::OPEN, shared.data.as_deref()).map_err(user_error)?;
    study.validate(args.judging.folds).map_err(user_error)?;
    let names = ["report.md", "rebuilt.json"];
    let folder = output::folder(Some(&args.out), PathBuf::new, &names, &Inputs::default(), args.replace)?;
    let options = RebuiltOptions {
        data: shared.data.clone(),
        cache: workspace::cache(shared)?,
        folds: args.judging.folds,
        resamples: args.judging.resamples,
        seed: args.judging.seed,
    };
    let bar = Bar::new();
    let refits = refits(shared, args, &study, &bar)?;
    let found = rebuilt(&study, &hypotheses(), &refits, &options, &|stage, progress| bar.update(stage, progress));
    bar.finish();
    let record = found.map_err(workspace::experiment_error)?;
    let asked: String = args.refit.iter().map(|method| format!(" --refit {method}")).collect();
    let coarsening = if asked.is_empty() { String::new() } else { format!(" --coarsening {}", args.coarsening) };
    let command = format!(
        "vernis experiment rebuilt{asked}{coarsening} --folds {} --resamples {} --seed {}",
        args.judging.folds, args.judging.resamples, args.judging.seed
    );
    let path = folder.write("report.md", report::rebuilt::markdown(&record, &command).as_bytes())?;
    let json = format!("{}\n", serde_json::to_string_pretty(&record)?);
    folder.write("rebuilt.json", json.as_bytes())?;
    if args.json {
        return print(json);
    }
    print(format!("{}report: {}\n", report::rebuilt::text(&record), path.display()))
}

/// The fits that `--refit` asks for.
fn refits(shared: &Shared, args: &RebuiltArgs, study: &Study, bar: &Bar) -> Result<Vec<Way>> {
    let asked = trials::trials_of(&args.refit).map_err(|e| user_error(format!("--refit: {e}")))?;
    if asked.is_empty() {
        return Ok(Vec::new());
    }
    signals::resumable(
        bar,
        format!("the fits that are finished are kept in {}; the same command continues from there", args.out.display()),
    )?;
    let options = TrialOptions {
        data: shared.data.clone(),
        folder: args.out.join("fits"),
        metric: Registry::standard()?.get("D4.Cl")?,
        coarsening: args.coarsening,
    };
    let mut ways = Vec::new();
    for trial in &asked {
        let tried = trials::make(study, trial, &options, &|stage, progress| bar.update(stage, progress));
        let tried = tried.map_err(workspace::experiment_error)?;
        workspace::warn(&tried.warnings);
        ways.push(tried.way);
    }
    Ok(ways)
}
