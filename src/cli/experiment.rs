//! `vernis experiment`: questions that take hours to answer, and their reports.

use super::progress::Bar;
use super::{Shared, print, user_error, workspace};
use anyhow::Result;
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};
use vernis::dataset::Study;
use vernis::experiment::ExperimentError;
use vernis::experiment::losses::Loss;
use vernis::experiment::losses::record::LossesRecord;
use vernis::experiment::losses::run::{Experiment, Probe, Settings, materials};
use vernis::experiment::losses::unseen::UnseenTraining;
use vernis::report::{OutputFolder, losses};
use vernis::train::recipe;
use vernis_metric::descriptor::{DescriptorOptions, Lights, Setup, ShapeChoice};
use vernis_metric::metric::graph::GraphGrid;

/// The study's light probes.
const PROBES: [(&str, &str); 2] =
    [("grace", "envmaps/grace_probe_latlong.hdr"), ("uffizi", "envmaps/uffizi_spica.hdr")];
/// The models that are fitted.
const MODELS: [&str; 3] = ["ggx", "ward-duer", "blinn-phong"];

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
}

/// Fit GGX, Ward and Blinn-Phong under six losses, and judge the fits by metrics that were not the loss.
#[derive(Args)]
#[command(after_help = "\
Each metric that was trained is a file under OUT/metrics, each fit one under OUT/fits; an experiment that was interrupted goes on
with the next one. With two cores 30 materials take about an hour.

Examples:
  vernis experiment losses --data ~/brdf-data --out out/losses
  vernis experiment losses --data ~/brdf-data --out out/losses --report   # of the materials that are finished")]
pub struct LossesArgs {
    /// A study by name, or a CSV file: its references are fitted, its ratings train the learned metrics.
    #[arg(long, default_value = "lavoue2021-open")]
    study: String,
    /// Folder to write to.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// How many references, one of each group of sisters.
    #[arg(long, value_name = "N", default_value_t = 30)]
    materials: usize,
    /// Cells of an Lp metric to a cell of its search, along each axis.
    #[arg(long, value_name = "N", default_value_t = 5)]
    grid: usize,
    /// Cells that transport and the energy distance compare, THETA_IxTHETA_OxPHI_D.
    #[arg(long, value_name = "CELLS", default_value = "12x12x48")]
    graph_grid: String,
    /// Evaluations of a search under a learned metric.
    #[arg(long, value_name = "N", default_value_t = 400)]
    max_evaluations: usize,
    /// Folds by material for the learned metrics.
    #[arg(long, value_name = "N", default_value_t = 5)]
    folds: usize,
    /// Bootstrap resamples of materials.
    #[arg(long, default_value_t = 2000, value_parser = workspace::resamples)]
    resamples: usize,
    /// Of the order of materials, folds, training and resamples.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Fit nothing: report the materials that are finished.
    #[arg(long)]
    report: bool,
}

pub fn run(shared: &Shared, args: ExperimentArgs) -> Result<()> {
    match args.experiment {
        Question::Losses(args) => run_losses(shared, &args),
    }
}

fn settings(args: &LossesArgs) -> Result<Settings> {
    for (flag, found, least) in
        [("materials", args.materials, 2), ("folds", args.folds, 2), ("max-evaluations", args.max_evaluations, 10)]
    {
        if found < least {
            return Err(user_error(format!("--{flag}: found {found}, allowed {least} or more")));
        }
    }
    let grid: GraphGrid = args.graph_grid.parse().map_err(|e| user_error(format!("--graph-grid: {e}")))?;
    Ok(Settings {
        models: MODELS.map(str::to_owned).to_vec(),
        losses: Loss::ALL.to_vec(),
        coarsening: args.grid,
        max_evaluations: args.max_evaluations,
        transport: format!("ot[grid={grid},kappa=4]"),
        energy: format!("energy[grid={grid}]"),
        seed: args.seed,
        folds: args.folds,
    })
}

/// The two light probes, which belong to the data folder.
fn probes(data: Option<&Path>) -> Result<Vec<Probe>> {
    let probe = |(name, path): (&str, &str)| {
        let path = data.map_or_else(|| PathBuf::from(path), |data| data.join(path));
        let options = DescriptorOptions { lights: Lights::Probe(path), shape: ShapeChoice::Sphere };
        Ok(Probe { name: name.to_owned(), setup: Setup::new(&options).map_err(user_error)? })
    };
    PROBES.into_iter().map(probe).collect()
}

fn run_losses(shared: &Shared, args: &LossesArgs) -> Result<()> {
    let settings = settings(args)?;
    let data = shared.data.as_deref();
    let study = Study::load(&args.study, data).map_err(user_error)?;
    study.validate(args.folds).map_err(user_error)?;
    let probes = probes(data)?;
    let folder = OutputFolder::create(&args.out).map_err(user_error)?;
    let [fits, metrics] = ["fits", "metrics"].map(|name| OutputFolder::create(args.out.join(name)));
    let (fits, metrics) = (fits.map_err(user_error)?, metrics.map_err(user_error)?);
    let keep = |folder: &OutputFolder, name: &str, text: &str| {
        let written = folder.write(name, text.as_bytes()).map(drop);
        written.map_err(|e| ExperimentError::Write { reason: e.to_string() })
    };
    let cache = workspace::cache(shared)?;
    let bar = Bar::new();
    bar.stage("picture operators");
    workspace::warn(cache.iter().flat_map(|c| probes.iter().filter_map(|p| c.prepare(&p.setup))));
    let unseen = UnseenTraining {
        study: &study,
        base: data,
        cache: cache.as_ref(),
        trainer: &recipe::metric(),
        folds: args.folds,
        seed: args.seed,
        folder: metrics.path(),
        write: &|name, text| keep(&metrics, name, text),
        progress: &|stage, progress| bar.update(stage, progress),
    }
    .run()
    .map_err(user_error)?;
    let experiment = Experiment {
        study: &study,
        settings: &settings,
        unseen: &unseen,
        probes: &probes,
        base: data,
        folder: fits.path(),
        write: &|name, text| keep(&fits, name, text),
        progress: &|progress| bar.update("fits", progress),
    };
    let records = experiment.run(&materials(&study, args.materials, args.seed), args.report);
    bar.finish();
    let record = LossesRecord::new(&study, &settings, &records.map_err(user_error)?, args.resamples);
    let record = record.map_err(user_error)?;
    let report = folder.write("report.md", losses::markdown(&record, &command_line(args, &study)).as_bytes())?;
    print(format!("{}report: {}\n", losses::text(&record), report.display()))
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
