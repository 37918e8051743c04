//! `vernis experiment landscape`: how metrics follow one parameter of a material.

use super::output::{self, Inputs, Replace};
use super::progress::Bar;
use super::{Shared, limits, print, workspace};
use crate::experiment::landscape::{LandscapeOptions, default_metrics, landscape};
use crate::report;
use anyhow::Result;
use clap::Args;
use std::path::{Path, PathBuf};
use vernis_metric::descriptor::DescriptorOptions;
use vernis_metric::metric::registry::Registry;

/// Change one parameter of a plastic, a metal and a fabric, and see how distances and losses follow.
#[derive(Args)]
#[command(after_help = "\
Needs no data. Writes report.md, record.json and figures as SVG and PNG. On two cores it takes a few minutes for each learned
metric.

Examples:
  vernis experiment landscape --out out/landscape
  vernis experiment landscape --metric vernis --metric D9.Cl --out out/landscape --replace")]
pub struct LandscapeArgs {
    /// A metric by name, `all-lp`, or the path of an exported metric; may be given several times [default: those of vernis, vernis-loss,
    /// vernis-1 and D4.Cl.CR that this build has].
    #[arg(long = "metric", short = 'm', value_name = "NAME|FILE")]
    metrics: Vec<String>,
    /// Folder to write to.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Candidates of a sweep between the reference and the end of what people rated, in each direction, 2 to 1000.
    #[arg(long, value_name = "N", default_value_t = LandscapeOptions::default().points, value_parser = limits::integer(2..=1000_usize))]
    points: usize,
    /// Points of a landscape from one end to the other, an odd number, 5 to 10001.
    #[arg(long, value_name = "N", default_value_t = LandscapeOptions::default().steps, value_parser = limits::integer(5..=10_001_usize))]
    steps: usize,
    #[command(flatten)]
    replace: Replace,
    /// Print the record as JSON instead of the tables.
    #[arg(long)]
    json: bool,
}

pub fn run(shared: &Shared, args: &LandscapeArgs) -> Result<()> {
    let metrics = match args.metrics.is_empty() {
        true => default_metrics(&Registry::standard()?)?,
        false => workspace::metrics(shared, &args.metrics, &DescriptorOptions::default())?,
    };
    let mut names: Vec<String> = report::landscape::FILES.map(str::to_owned).into();
    names.extend(report::landscape::FIGURES.iter().flat_map(|name| [format!("{name}.svg"), format!("{name}.png")]));
    let inputs = Inputs::default().files(&args.metrics);
    let folder = output::folder(Some(&args.out), PathBuf::new, &names, &inputs, args.replace)?;
    workspace::warm_up(shared, &metrics)?;
    let options = LandscapeOptions { points: args.points, steps: args.steps };
    let bar = Bar::new();
    let found = landscape(&metrics, &options, &|stage, progress| bar.update(stage, progress));
    bar.finish();
    let record = found.map_err(workspace::experiment_error)?;
    let path = report::landscape::write(&folder, &record, &command_line(args))?;
    if args.json {
        return print(format!("{}\n", serde_json::to_string_pretty(&record)?));
    }
    print(format!("{}report: {}\n", report::landscape::text(&record), path.display()))
}

/// What to type for the same bytes: without folders, which do not matter.
fn command_line(args: &LandscapeArgs) -> String {
    let file = |name: &String| Path::new(name).file_name().unwrap_or_default().to_string_lossy().into_owned();
    let metrics: String = args.metrics.iter().map(|name| format!(" --metric {}", file(name))).collect();
    format!("vernis experiment landscape{metrics} --points {} --steps {}", args.points, args.steps)
}
