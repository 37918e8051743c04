//! `vernis refit`: the candidates of a study, made anew from its references.

use super::progress::Bar;
use super::view::View;
use super::{Shared, fit, limits, print, user_error, workspace};
use anyhow::Result;
use clap::Args;
use std::collections::BTreeMap;
use std::path::PathBuf;
use vernis::dataset::Study;
use vernis::experiment::refit::{METHODS, Outcome, Refit, RefitOptions, refit};
use vernis::report::OutputFolder;
use vernis_metric::fit::optimizer::StopReason;

/// Rebuild the candidates of a study from its references.
#[derive(Args)]
#[command(after_help = "\
Writes one model file per fit, MATERIAL.METHOD.json, and the tables refit.csv and refit.md. Skips fits whose file exists and
has the same settings. The ratings belong to the published fits: a refitted candidate has none.

Examples:
  vernis refit --study lavoue2021-open --data DIR --out refits
  vernis refit --study pairs.csv --method WARD --method GGX --out refits")]
pub struct RefitArgs {
    /// A study by name, or a CSV file.
    #[arg(long, value_name = "NAME|CSV")]
    study: String,
    /// A method of the study; may be given several times [default: all].
    #[arg(long, value_name = "NAME")]
    method: Vec<String>,
    /// The loss, for fits that minimise one.
    #[arg(long, short = 'l', value_name = "NAME|FILE", default_value = "D4.Cl")]
    metric: String,
    #[command(flatten)]
    view: View,
    /// Cells of the metric per cell of the search, along each axis, 1 to 15.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = limits::integer(1..=15_usize))]
    grid: usize,
    /// Folder to write to.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
}

pub fn run(shared: &Shared, args: RefitArgs) -> Result<()> {
    let metric = workspace::one_metric(&args.metric, &args.view.options())?;
    let methods = methods(&args.method)?;
    let study = Study::load(&args.study, shared.data.as_deref()).map_err(user_error)?;
    let folder = OutputFolder::create(&args.out).map_err(user_error)?;
    workspace::warm_up(shared, std::slice::from_ref(&metric))?;
    let bar = Bar::new();
    let options =
        RefitOptions { data: shared.data.clone(), folder: args.out.clone(), metric, methods, coarsening: args.grid };
    let all = refit(&study, &options, &|stage, progress| bar.update(stage, progress));
    bar.finish();
    let all = all.map_err(fit::named)?;
    workspace::warn(all.iter().filter_map(|refit| refit.warning.as_ref()));
    folder.write("refit.csv", &to_csv(&all)?)?;
    let table = to_markdown(&all, options.metric.name());
    folder.write("refit.md", table.as_bytes())?;
    print(format!("{table}\n{}\n", args.out.join("refit.csv").display()))
}

fn methods(names: &[String]) -> Result<Vec<(&'static str, &'static str)>> {
    if names.is_empty() {
        return Ok(METHODS.to_vec());
    }
    let known = || METHODS.map(|(name, _)| name).join(", ");
    let find = |name: &String| {
        METHODS
            .into_iter()
            .find(|(known, _)| known.eq_ignore_ascii_case(name))
            .ok_or_else(|| user_error(format!("--method is {name}; it must be one of {}", known())))
    };
    names.iter().map(find).collect()
}

fn state(outcome: &Outcome) -> &'static str {
    match outcome {
        Outcome::None(_) => "none",
        Outcome::Fitted(file) | Outcome::Kept(file) => file.stop.name(),
    }
}

fn to_csv(all: &[Refit]) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(["material", "method", "model", "metric", "value", "stop", "evaluations", "file", "reason"])?;
    for r in all {
        let file = r.outcome.file();
        let text = |of: &dyn Fn(&vernis_metric::fit::FitFile) -> String| file.map(of).unwrap_or_default();
        let reason = if let Outcome::None(reason) = &r.outcome { reason.as_str() } else { "" };
        writer.write_record([
            r.material.as_str(),
            r.method,
            r.model,
            &text(&|f| f.metric.name.clone()),
            &text(&|f| f.value.to_string()),
            state(&r.outcome),
            &text(&|f| (f.evaluations + f.polish_evaluations).to_string()),
            if file.is_some() { r.file.as_str() } else { "" },
            reason,
        ])?;
    }
    Ok(writer.into_inner().map_err(|e| e.into_error())?)
}

/// One row a method: how many fits, and the quartiles of their loss.
fn to_markdown(all: &[Refit], metric: &str) -> String {
    let mut by_method: BTreeMap<usize, Vec<&Refit>> = BTreeMap::new();
    for refit in all {
        let place = METHODS.iter().position(|(name, _)| *name == refit.method).unwrap_or(METHODS.len());
        by_method.entry(place).or_default().push(refit);
    }
    let mut text = format!(
        "| method | model | fits | not converged | none | {metric}: lower quartile | median | upper quartile |\n\
         | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |\n"
    );
    for refits in by_method.values() {
        let files: Vec<_> = refits.iter().filter_map(|r| r.outcome.file()).collect();
        let mut values: Vec<f64> = files.iter().map(|f| f.value).collect();
        values.sort_by(f64::total_cmp);
        let quartile = |q: usize| match values.len() {
            0 => "-".to_owned(),
            n => format!("{:.4}", values[(n - 1) * q / 4]),
        };
        let unfinished = files.iter().filter(|f| f.stop == StopReason::EvaluationLimit).count();
        text += &format!(
            "| {} | {} | {} | {unfinished} | {} | {} | {} | {} |\n",
            refits[0].method,
            refits[0].model,
            files.len(),
            refits.len() - files.len(),
            quartile(1),
            quartile(2),
            quartile(3)
        );
    }
    text + "\nRatings belong to the published fits: these candidates carry none.\n"
}
