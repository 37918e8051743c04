//! `vernis experiment rendering`: the noise of rendering beside the differences that metrics on stimuli are to tell.

use super::progress::Bar;
use super::{Shared, limits, print, user_error, workspace};
use crate::dataset::Study;
use crate::experiment::rendering::{RenderingNoise, RenderingOptions, rendering_noise};
use anyhow::Result;
use clap::Args;
use std::sync::Arc;
use vernis_metric::metric::Metric;

/// The metrics of the paper, and those that stand in for them.
const METRICS: [&str; 6] = ["ssim", "icid-cielab", "hdr-vdp", "cielab", "flip", "cvvdp"];

/// Render pairs with several seeds, and compare the noise of metrics on stimuli with the differences between candidates.
#[derive(Args)]
#[command(after_help = "\
Prints Markdown. The cache keeps pictures and distances: an interrupted run continues. On two cores, eight materials by three
seeds take about ten minutes.

Examples:
  vernis experiment rendering --data ~/brdf-data
  vernis experiment rendering --metric ssim --options samples=16,size=290x450 --data ~/brdf-data")]
pub struct RenderingArgs {
    /// A study by name, or a CSV file.
    #[arg(long, default_value = "lavoue2021-open")]
    study: String,
    /// A metric on pictures; may be given several times [default: ssim, icid-cielab, hdr-vdp, cielab, flip, cvvdp].
    #[arg(long = "metric", short = 'm', value_name = "NAME")]
    metrics: Vec<String>,
    /// Options of stimulus[...] for all of them, such as samples=16,size=290x450.
    #[arg(long, value_name = "KEY=VALUE,...")]
    options: Option<String>,
    /// Number of references, one of each group of sister materials, 1 to 10000.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = limits::integer(1..=10_000_usize))]
    materials: usize,
    /// Number of seeds, 2 to 100.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = limits::integer(2..=100_u64))]
    seeds: u64,
    /// Seed of the order of the materials.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = limits::seed)]
    seed: u64,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(shared: &Shared, args: &RenderingArgs) -> Result<()> {
    let registry = workspace::registry(shared)?;
    let names: Vec<String> = match &args.metrics[..] {
        [] => METRICS.map(str::to_owned).into(),
        given => given.to_vec(),
    };
    let by_seed = |name: &String| -> Result<Vec<Arc<dyn Metric>>> {
        let options = args.options.as_ref().map_or_else(String::new, |options| format!(",{options}"));
        let named = |seed: u64| registry.get(&format!("stimulus[{name}{options},seed={seed}]")).map_err(user_error);
        (0..args.seeds).map(named).collect()
    };
    let metrics = names.iter().map(by_seed).collect::<Result<Vec<_>>>()?;
    let study = Study::load(&args.study, shared.data.as_deref()).map_err(user_error)?;
    let options = RenderingOptions {
        metrics: &metrics,
        materials: args.materials,
        seed: args.seed,
        data: shared.data.clone(),
        cache: workspace::cache(shared)?,
    };
    let bar = Bar::new();
    let found = rendering_noise(&study, &options, &|stage, progress| bar.update(stage, progress));
    bar.finish();
    let (found, warnings) = found.map_err(workspace::experiment_error)?;
    workspace::warn(&warnings);
    print(if args.json { serde_json::to_string_pretty(&found)? + "\n" } else { text(&found, args.seeds) })
}

fn text(found: &[RenderingNoise], seeds: u64) -> String {
    let mut text = format!(
        "Noise is the standard deviation of a distance over {seeds} seeds; the gap is the difference to the nearest other candidate of the \
         same reference.\n\n| metric | candidates | noise / distance | noise / gap, median | noise below a tenth of the gap |\n\
         | :--- | ---: | ---: | ---: | ---: |\n"
    );
    for row in found {
        text += &format!(
            "| {} | {} | {:.4} | {:.3} | {:.0} % |\n",
            row.metric,
            row.candidates,
            row.relative,
            row.median,
            100.0 * row.small
        );
    }
    text
}
