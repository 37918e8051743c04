//! `vernis refit`: the candidates of a study, made anew from its references.

use super::cells::Cells;
use super::output::{self, Inputs, Replace};
use super::progress::Bar;
use super::scale::ScaleArgs;
use super::view::View;
use super::{Shared, fit, print, signals, user_error, workspace};
use crate::dataset::Study;
use crate::experiment::refit::{METHODS, Outcome, Refit, RefitOptions, file_name, refit};
use crate::report::spreadsheet::cell;
use crate::report::{OutputFolder, markdown};
use anyhow::Result;
use clap::Args;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// Rebuild the candidates of a study from its references.
#[derive(Args)]
#[command(after_help = "\
Writes one model file per fit, MATERIAL.METHOD.json, and the tables refit.csv and refit.md. Keeps fits whose file is there and
has the same reference and settings; after an interruption (Ctrl-C, exit code 130; SIGTERM, 143) the same command continues.
Files of another reference or of other settings are refused before the work. The ratings belong to the published fits: a refitted
candidate has none. A file that is read is never replaced.

Examples:
  vernis refit --study lavoue2021-open --data DIR --out refits
  vernis refit --study pairs.csv --method WARD --method GGX --out refits")]
pub struct RefitArgs {
    /// A study by name, or a CSV file.
    #[arg(long, value_name = "NAME|CSV")]
    study: String,
    #[command(flatten)]
    scale: ScaleArgs,
    /// A method of the study; may be given several times [default: all].
    #[arg(long, value_name = "NAME")]
    method: Vec<String>,
    /// The loss, for fits that minimise one.
    #[arg(long, short = 'm', short_alias = 'l', value_name = "NAME|FILE", default_value = "D4.Cl")]
    metric: String,
    #[command(flatten)]
    view: View,
    #[command(flatten)]
    cells: Cells,
    /// Folder to write to.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
}

pub fn run(shared: &Shared, args: RefitArgs) -> Result<()> {
    let (metric, coarsening) = args.cells.of(workspace::one_metric(shared, &args.metric, &args.view.options())?)?;
    let methods = methods(&args.method)?;
    let study = Study::load_on(&args.study, shared.data.as_deref(), args.scale.declared).map_err(user_error)?;
    let references = study.pairs.iter().map(|pair| &pair.reference);
    let inputs = Inputs::default().files([&args.study, &args.metric]).view(&args.view);
    let inputs = inputs.sources(references, shared.data.as_deref());
    let names = names(&study, &methods);
    let folder = output::folder(Some(&args.out), PathBuf::new, &names, &inputs, Replace::CONTINUES)?;
    let folder = OutputFolder::claim(folder.path()).map_err(user_error)?;
    workspace::warm_up(shared, std::slice::from_ref(&metric))?;
    let bar = Bar::new();
    signals::resumable(
        &bar,
        format!("the fits that are finished are kept in {}; the same command continues from there", args.out.display()),
    )?;
    let (data, folder_of_fits) = (shared.data.clone(), args.out.clone());
    let options = RefitOptions { data, folder: folder_of_fits, metric, methods, coarsening, plain_start: false };
    let all = refit(&study, &options, &|stage, progress| bar.update(stage, progress));
    bar.finish();
    let all = all.map_err(fit::named)?;
    workspace::warn(all.iter().filter_map(|refit| refit.warning.as_ref()));
    folder.write("refit.csv", &to_csv(&all)?)?;
    let table = to_markdown(&all, options.metric.name());
    folder.write("refit.md", table.as_bytes())?;
    print(format!("{table}\n{}\n", args.out.join("refit.csv").display()))
}

/// The files that are written.
fn names(study: &Study, methods: &[(&str, &str)]) -> Vec<String> {
    let materials: BTreeSet<String> = study.pairs.iter().map(|pair| file_name(&pair.material)).collect();
    let fits = materials.iter().flat_map(|m| methods.iter().map(move |(method, _)| format!("{m}.{method}.json")));
    fits.chain(["refit.csv", "refit.md"].map(str::to_owned)).collect()
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
            &*cell(&r.material),
            r.method,
            r.model,
            &cell(&text(&|f| f.metric.name.clone())),
            &text(&|f| f.value.to_string()),
            state(&r.outcome),
            &text(&|f| (f.evaluations + f.polish_evaluations).to_string()),
            &cell(if file.is_some() { r.file.as_str() } else { "" }),
            &cell(reason),
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
    let metric = markdown::text(metric);
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
        let unfinished = files.iter().filter(|f| !f.stop.is_success()).count();
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
