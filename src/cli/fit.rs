//! `vernis fit`: the parameters of a model from a BRDF, under any metric.

use super::cells::Cells;
use super::export::Exports;
use super::output::{self, Inputs, Replace};
use super::progress::Bar;
use super::signals::Signals;
use super::view::View;
use super::{Shared, limits, plausible, print, user_error, workspace};
use crate::report::OutputFolder;
use anyhow::{Result, anyhow};
use clap::Args;
use std::path::{Path, PathBuf};
use vernis_metric::brdf::formats::model_json;
use vernis_metric::fit::export::Renderer;
use vernis_metric::fit::optimizer::StopReason;
use vernis_metric::fit::{AtBound, FitError, FitFile, Fitting, Start};
use vernis_metric::io::{counted, decimals};

/// Fit a model to a BRDF.
#[derive(Args)]
#[command(after_help = "\
The result is a model file that every subcommand reads as a BRDF. Its `stop` says how the search ended:
  converged       steps became small, or a round of them gained next to nothing. Under learned metrics lbfgs then tries two
                  other shapes of the lobe, and for models of ten parameters or more a fit under D9.Cl; the lowest counts
  nothing-moved   no step from the start lowers the loss
  no-descent      lbfgs: the gradient shows no way down any more
  flat            no step changes the loss by a millionth: the result means nothing; exit code 3
  evaluation-limit  the evaluations were spent first; exit code 3
  interrupted     Ctrl-C or SIGTERM ended it; exit code 130 or 143. A second signal ends the program at once
  direct          there was nothing to search for
The file is written in every case, with the best so far.

A renderer that has the fitted model gets its exact counterpart, any other the nearest material that it has, fitted to the fit. What
the translation costs is printed and stands in both files: the distance between fit and material in the metric of the fit, in
vernis-loss and in vernis, and the opinion score that these predict for the pair.

Examples:
  vernis fit alum-bronze.binary --model ggx --metric D4.Cl --out ggx.json
  vernis fit merl_nbrdf.zip:teflon --model ward-duer --metric D9.Cl --optimizer lbfgs --starts 4 --out ward.json
  vernis fit merl_nbrdf.zip:teflon --model ggx --out learned.json    # under vernis-loss, the metric to fit with
  vernis fit merl_nbrdf.zip:teflon --model ggx+blinn-phong --metric ot --start ggx+blinn-phong.json --out ot.json
  vernis fit merl_nbrdf.zip:teflon --model principled --out teflon.json --export mitsuba,gltf
  vernis compare merl_nbrdf.zip:teflon learned.json")]
pub struct FitArgs {
    /// The BRDF to fit, as `vernis compare --help` describes.
    reference: String,
    /// A model, or a sum of models such as ggx+ward. dupuy, dupuy-ggx and dupuy-beckmann are computed from the
    /// reference without a search.
    #[arg(long)]
    model: String,
    /// The loss: a metric by name, or the path of an exported metric.
    #[arg(long, short = 'm', short_alias = 'l', value_name = "NAME|FILE", default_value = "vernis-loss")]
    metric: String,
    #[command(flatten)]
    view: View,
    /// staged, log (fits under D9.Cl, then moves gradually to a learned metric), log-at-once (moves at once), or a file of
    /// parameters [default: log for learned metrics whose landscape has hollows, such as vernis, else staged].
    #[arg(long, value_name = "staged|log|log-at-once|FILE.json")]
    start: Option<String>,
    /// hooke-jeeves, nelder-mead, or lbfgs where metric and model have gradients [default: lbfgs for learned metrics where the model
    /// has a gradient, else hooke-jeeves].
    #[arg(long, value_name = "NAME")]
    optimizer: Option<String>,
    #[command(flatten)]
    cells: Cells,
    /// Number of starts to search from, 1 to 1000; the best result is kept. Starts beyond those that the reference suggests are random.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = limits::integer(1..=1000_usize))]
    starts: usize,
    /// Seed of the random starts.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = limits::seed)]
    seed: u64,
    /// Maximum number of evaluations for each start, 10 to 100000000 [default: 5000 for Lp metrics, 400 for others].
    #[arg(long, value_name = "N", value_parser = limits::integer(10..=100_000_000_usize))]
    max_evaluations: Option<usize>,
    /// The file to write.
    #[arg(long, short, value_name = "JSON")]
    out: PathBuf,
    /// Also write a material for a renderer: mitsuba, pbrt, materialx or gltf; may be given several times. The file is called as
    /// that of the fit, and ends in .xml, .pbrt, .mtlx or .gltf.
    #[arg(long, value_name = "RENDERER", value_delimiter = ',')]
    export: Vec<String>,
    #[command(flatten)]
    replace: Replace,
    /// Print the content of the file instead of a summary.
    #[arg(long)]
    json: bool,
}

/// The search spent its evaluations, or the loss is flat; the best result so far was written.
#[derive(Debug)]
pub struct NotConverged(String);

impl std::fmt::Display for NotConverged {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for NotConverged {}

pub fn run(shared: &Shared, args: FitArgs) -> Result<()> {
    let (metric, coarsening) = args.cells.of(workspace::one_metric(shared, &args.metric, &args.view.options())?)?;
    let bar = Bar::new();
    let signals = Signals::caught(&bar)?;
    let start = args.start.as_deref().map(|s| start(s, &args.model)).transpose()?;
    let default = Fitting::new(&args.model, &*metric);
    let fitting = Fitting {
        start,
        method: args.optimizer.as_deref().map_or(Ok(default.method), |name| name.parse().map_err(user_error))?,
        starts: args.starts,
        seed: args.seed,
        coarsening,
        max_evaluations: args.max_evaluations,
        interrupt: signals.interrupt(),
        ..default
    };
    let renderers =
        args.export.iter().map(|name| name.parse().map_err(user_error)).collect::<Result<Vec<Renderer>>>()?;
    let (folder, name) = output(shared, &args)?;
    let exports = Exports::beside(&args.out, &renderers, &metric, &inputs(shared, &args), args.replace)?;
    let reference = workspace::open(&args.reference, shared.data.as_deref())?;
    plausible::warn(&args.reference, &*reference.brdf);
    workspace::warm_up(shared, &[exports.metrics(), vec![metric.clone()]].concat())?;
    let observer = |stage: &str, progress| bar.update(stage, progress);
    let fitted = fitting.run(&*reference.brdf, &observer);
    let fitted = fitted.inspect_err(|_| bar.finish()).map_err(named)?;
    let mut file = FitFile::new(&fitting, &fitted, &args.reference, &reference.content.to_string());
    folder.write(&name, file.to_json()?.as_bytes())?;
    let mut lines = String::new();
    if !exports.is_empty() && fitted.stop != StopReason::Interrupted {
        // The fit is kept, whatever becomes of the materials.
        let what = format!("{} of {} under {} {}", args.model, args.reference, file.metric.name, file.metric.version);
        let written = exports.write(&*fitted.model, &what, &fitting.interrupt, &observer);
        for (export, line) in written.inspect_err(|_| bar.finish())? {
            file.exports.push(export);
            lines += &line;
        }
        folder.write(&name, file.to_json()?.as_bytes())?;
    }
    bar.finish();
    let ended = fitting.interrupt.is_raised() && fitted.stop != StopReason::Interrupted;
    print(if args.json { file.to_json()? } else { summary(&file, &args.out) + &lines })?;
    let (model, spent, out) = (&args.model, fitted.evaluations, args.out.display());
    match fitted.stop {
        _ if ended => Err(signals
            .ended(format!("{model}: interrupted while the materials were made; they are the best so far; {out} is whole"))
            .into()),
        StopReason::EvaluationLimit => Err(NotConverged(format!(
            "{model}: {spent} evaluations did not suffice; the best result so far was written; raise --max-evaluations"
        ))
        .into()),
        StopReason::Flat => Err(NotConverged(format!(
            "{model}: the loss is {} and no step of a parameter changes it by a millionth: the result means nothing, though it \
             was written; look in {} for values that no reflectance has",
            decimals(fitted.value, 6),
            args.reference
        ))
        .into()),
        StopReason::Interrupted => Err(signals
            .ended(format!("{model}: interrupted after {spent} evaluations; the best result so far was written to {out}"))
            .into()),
        _ => Ok(()),
    }
}

/// The error of a fit as one of the command line: all but a failed write are the user's to mend.
pub fn named(error: FitError) -> anyhow::Error {
    match error {
        FitError::Write { .. } => anyhow!(error),
        _ => user_error(error),
    }
}

fn start(text: &str, model: &str) -> Result<Start> {
    match text {
        "staged" => Ok(Start::Staged),
        "log" => Ok(Start::Log),
        "log-at-once" => Ok(Start::LogAtOnce),
        path if path.ends_with(".json") => {
            let parameters = model_json::read(Path::new(path)).map_err(user_error)?;
            if parameters.model() != model {
                let found = parameters.model();
                return Err(user_error(format!("--start {path} is a {found}; it must hold parameters of {model}")));
            }
            let built = parameters.build().map_err(|e| user_error(format!("--start {path}: {e}")))?;
            Ok(Start::Parameters(built.parameters()))
        }
        other => Err(user_error(format!(
            "--start is {other}; it must be staged, log, log-at-once, or a .json file of parameters"
        ))),
    }
}

/// The folder and the name of the file to write; found unwritable before the work.
fn output(shared: &Shared, args: &FitArgs) -> Result<(OutputFolder, String)> {
    let path = &args.out;
    if path.extension().is_none_or(|extension| extension != "json") || path.is_dir() {
        return Err(user_error(format!("--out is {}; it must be the name of a .json file", path.display())));
    }
    output::file(path, &inputs(shared, args), args.replace)
}

/// The files that the fit reads.
fn inputs(shared: &Shared, args: &FitArgs) -> Inputs {
    let inputs = Inputs::default().notation(&args.reference, shared.data.as_deref()).view(&args.view);
    inputs.file(&args.metric).files(&args.start)
}

fn summary(file: &FitFile, path: &Path) -> String {
    let mut text = format!(
        "{} of {} under {} {}\n{} at the start, {} at the end ({}, {})\n",
        file.model,
        file.reference.source,
        file.metric.name,
        file.metric.version,
        decimals(file.value_at_start, 6),
        decimals(file.value, 6),
        file.stop.name(),
        counted(file.evaluations + file.polish_evaluations, "evaluation"),
    );
    // Tables of hundreds of numbers are for the file.
    if file.parameters.len() <= 16 {
        let width = file.parameters.keys().map(String::len).max().unwrap_or(0).max(8);
        for (field, value) in &file.parameters {
            let numbers = match value {
                serde_json::Value::Array(all) => all.iter().filter_map(|v| v.as_f64()).collect(),
                one => one.as_f64().into_iter().collect::<Vec<f64>>(),
            };
            let numbers: Vec<String> = numbers.into_iter().map(|x| format!("{x:.5}")).collect();
            text += &format!("  {field:width$} {}\n", numbers.join("  "));
        }
    }
    if !file.at_bounds.is_empty() {
        // As many as a line takes; the file has all.
        const SHOWN: usize = 8;
        let of = |b: &AtBound| format!("{} {} ({})", b.parameter, b.value, b.bound.name());
        let shown: Vec<String> = file.at_bounds.iter().take(SHOWN).map(of).collect();
        let more = file.at_bounds.len().saturating_sub(SHOWN);
        let more = if more > 0 { format!(", and {more} more") } else { String::new() };
        text += &format!("on their bounds: {}{more}\n", shown.join(", "));
    }
    text + &format!("{}\n", path.display())
}
