//! `vernis experiment noise` and `vernis experiment triplets`: commands that print what is claimed elsewhere.

use super::judging::Judging;
use super::progress::Bar;
use super::study::{RatingsArgs, describe, load};
use super::workspace::MetricChoice;
use super::{Shared, limits, print, user_error, workspace};
use crate::dataset::Study;
use crate::dataset::triplets::Triplets;
use crate::evaluation::bootstrap::Difference;
use crate::experiment::triplets::{Share, TripletOptions, TripletRecord, triplets as agreement};
use crate::experiment::versions::{VersionsOptions, VersionsRecord, versions as compare_versions};
use crate::panel::noise::{Bound, NoiseBound, NoiseOptions, bound};
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;
use vernis_metric::brdf::BrdfSource;
use vernis_metric::math::quantile::Interval;

/// Simulate panels to find the correlations that no metric can exceed because the ratings are noisy.
#[derive(Args)]
#[command(after_help = "\
The noise of a mean of n scores has the variance a (-x^2 + 6x - 5)/n. a and n are those of the study's scores where it has
them, otherwise 0.20 and 30. Prints Markdown. Each interval contains 95 % of single panels on resampled materials.

Examples:
  vernis experiment noise --study lavoue2021-open --data ~/brdf-data
  vernis experiment noise --study my-ratings.csv --raters 12 --json")]
pub struct NoiseArgs {
    #[command(flatten)]
    ratings: RatingsArgs,
    /// Parameter a of the noise, 0 to 1 [default: that of the study's scores, else 0.20].
    #[arg(long, value_name = "A", value_parser = share)]
    a: Option<f64>,
    /// Scores of each stimulus, 1 to 100000 [default: those of the study, else 30].
    #[arg(long, value_name = "N", value_parser = limits::integer(1..=100_000_u32))]
    raters: Option<u32>,
    /// Simulated panels, 40 to 20000.
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = limits::resamples)]
    simulations: usize,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Compare the distances of metrics with the votes of people on triplets of materials.
#[derive(Args)]
#[command(after_help = "\
TRIPLETS.json holds `answers`, lists of [reference, a, b], and `agreement`, lists of [votes for a, votes for b]. MATERIALS.txt
names the numbers: a number, a tab and a name per line. Each name is a material of the archive. Prints Markdown. Intervals
contain 95 % of bootstrap resamples of the references. The cache keeps finished distances: an interrupted run continues.

Examples:
  vernis experiment triplets --metric vernis --metric D9.Cl --triplets answers_processed_train.json \\
      --materials index_to_material.txt --archive nbrdf/merl_nbrdf.zip --data ~/brdf-data")]
pub struct TripletsArgs {
    #[command(flatten)]
    choice: MetricChoice,
    /// The triplets and their votes.
    #[arg(long, value_name = "JSON", value_parser = limits::file)]
    triplets: PathBuf,
    /// The names of the materials, by number.
    #[arg(long, value_name = "TXT", value_parser = limits::file)]
    materials: PathBuf,
    /// Archive of the materials' BRDFs: a path, or a path in the data folder.
    #[arg(long, value_name = "ZIP", default_value = "nbrdf/merl_nbrdf.zip")]
    archive: String,
    /// Bootstrap resamples of references, 40 to 20000.
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = limits::resamples)]
    resamples: usize,
    /// Seed of the resamples.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = limits::seed)]
    seed: u64,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Compare the recipe of this version of the metric with that of version 1, on the rows that version 1 knew.
#[derive(Args)]
#[command(after_help = "\
Prints Markdown. Takes about five minutes on two cores once descriptors are cached.

Example:
  vernis experiment versions --data ~/brdf-data")]
pub struct VersionsArgs {
    /// A study by name, or a CSV file.
    #[arg(long, default_value = "lavoue2021-open")]
    study: String,
    #[command(flatten)]
    judging: Judging,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

fn share(text: &str) -> Result<f64, String> {
    let allowed = || "it must be a number from 0 to 1".to_owned();
    text.trim().parse().ok().filter(|a| (0.0..=1.0).contains(a)).ok_or_else(allowed)
}

pub fn noise(shared: &Shared, args: &NoiseArgs) -> Result<()> {
    let ratings = load(shared, &args.ratings)?;
    let record = describe(&ratings, &args.ratings)?;
    let options = NoiseOptions {
        a: args.a,
        raters: args.raters.map(f64::from),
        simulations: args.simulations,
        seed: args.ratings.seed(),
    };
    let found = bound(&record, &options).map_err(|e| user_error(format!("{}: {e}", record.study)))?;
    print(if args.json { serde_json::to_string_pretty(&found)? + "\n" } else { noise_text(&found) })
}

fn noise_text(found: &NoiseBound) -> String {
    let origin = if found.a_is_found { "as in the study's scores" } else { "assumed or given" };
    let row = |name: &str, bound: &Bound| format!("| {name} | {:.3} | {} |\n", bound.value, interval(bound.interval));
    let mut text = format!(
        "{}: {} rated stimuli, {} groups of materials\n\nA metric that knew the true mean scores would agree with a panel of {} \
         scores each, noise a = {:.3} ({origin}), as follows ({} panels, seed {}):\n\n| figure | bound | 95 % of panels |\n\
         | :--- | ---: | ---: |\n",
        found.study,
        found.stimuli,
        found.groups,
        number(found.raters),
        found.a,
        found.simulations,
        found.seed
    );
    text += &(row("PLCC", &found.plcc) + &row("SROCC", &found.srocc));
    if found.synthetic {
        text += "\nSYNTHETIC: these ratings come from simulated observers and say nothing about people.\n";
    }
    text
}

/// A number of raters, which may be a mean.
fn number(x: f64) -> String {
    if x.fract() == 0.0 { format!("{x:.0}") } else { format!("{x:.1}") }
}

fn interval(interval: Interval) -> String {
    format!("[{:.3}, {:.3}]", interval.low, interval.high)
}

pub fn triplets(shared: &Shared, args: &TripletsArgs) -> Result<()> {
    let metrics = args.choice.metrics(shared)?;
    let set = Triplets::load(&args.triplets, &args.materials).map_err(user_error)?;
    let source = |name: &String| BrdfSource::parse(&format!("{}:{name}", args.archive)).map_err(user_error);
    let sources = set.materials.iter().map(source).collect::<Result<Vec<_>>>()?;
    workspace::warm_up(shared, &metrics)?;
    let cache = workspace::cache(shared)?;
    let options = TripletOptions {
        metrics: &metrics,
        sources: &sources,
        base: shared.data.as_deref(),
        cache: cache.as_ref(),
        resamples: args.resamples,
        seed: args.seed,
    };
    let bar = Bar::new();
    let found = agreement(&set, &options, &|stage, progress| bar.update(stage, progress));
    bar.finish();
    let (record, warnings) = found.map_err(workspace::experiment_error)?;
    workspace::warn(&warnings);
    print(if args.json { serde_json::to_string_pretty(&record)? + "\n" } else { triplets_text(&record) })
}

pub fn versions(shared: &Shared, args: &VersionsArgs) -> Result<()> {
    let study = Study::load(&args.study, shared.data.as_deref()).map_err(user_error)?;
    let options = VersionsOptions {
        data: shared.data.clone(),
        cache: workspace::cache(shared)?,
        folds: args.judging.folds,
        resamples: args.judging.resamples,
        seed: args.judging.seed,
    };
    let bar = Bar::new();
    let found = compare_versions(&study, &options, &|stage, progress| bar.update(stage, progress));
    bar.finish();
    let record = found.map_err(workspace::experiment_error)?;
    print(if args.json { serde_json::to_string_pretty(&record)? + "\n" } else { versions_text(&record) })
}

fn versions_text(record: &VersionsRecord) -> String {
    let triplets =
        record.no_triplets.as_ref().map_or("and judged triplets".to_owned(), |why| format!("and no triplets ({why})"));
    let mut text = format!(
        "{} rows of {} ({}). Version 1 learns from these rows alone, version 2 from {} rows {triplets}; all out of fold, {} folds, {} \
         resamples of materials, seed {}.\n\n| recipe | not seen | PLCC | SROCC | PLCC minus version 1 | SROCC minus version 1 |\n\
         | :--- | :--- | ---: | ---: | ---: | ---: |\n",
        record.rows, record.study, record.rows_are, record.all_rows, record.folds, record.resamples, record.seed
    );
    for found in &record.agreement {
        let figure = |(value, range): (f64, Interval)| format!("{value:.3} {}", interval(range));
        let difference = |k: usize| {
            let of = |all: &[Difference; 2]| {
                format!("{:+.3} [{:+.3}, {:+.3}]", all[k].difference, all[k].interval.low, all[k].interval.high)
            };
            found.differences.as_ref().map_or("-".to_owned(), of)
        };
        text += &format!(
            "| {} | {} | {} | {} | {} | {} |\n",
            found.recipe,
            found.split.label(),
            figure(found.plcc),
            figure(found.srocc),
            difference(0),
            difference(1)
        );
    }
    text
}

fn triplets_text(record: &TripletRecord) -> String {
    let mut text = format!(
        "{} triplets of {} references, {} votes; {} triplets have a majority. A metric that always chose as the majority would get \
         {:.3} of the votes ({} resamples of references, seed {}).\n\n\
         | metric | version | share of votes | share of majorities |\n| :--- | :--- | ---: | ---: |\n",
        record.triplets, record.references, record.votes, record.untied, record.most, record.resamples, record.seed
    );
    let shown = |share: &Share| {
        let range = share.interval.map(|range| format!(" {}", interval(range))).unwrap_or_default();
        format!("{:.3}{range}", share.value)
    };
    for metric in &record.metrics {
        let (votes, majority) = (shown(&metric.votes), shown(&metric.majority));
        text += &format!("| {} | {} | {votes} | {majority} |\n", metric.name, metric.version);
    }
    text
}
