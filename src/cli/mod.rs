//! The command line: argument definitions, one file per subcommand, progress bars and exit codes.
//!
//! Exit codes: 0 success, 1 a fault of vernis or of the machine, 2 a mistake in what the user gave, 3 a fit that did not
//! converge (its best result so far is written), 130 and 143 a command that SIGINT (Ctrl-C) or SIGTERM ended (`signals.rs`).

mod cells;
#[cfg(feature = "train")]
mod claims;
mod compare;
mod compare_images;
mod data;
mod describe;
mod evaluate;
#[cfg(feature = "train")]
mod experiment;
mod export;
#[cfg(feature = "train")]
mod extract;
mod fit;
mod judging;
#[cfg(feature = "train")]
mod landscape;
mod limits;
mod manifold;
mod metrics;
#[cfg(feature = "train")]
mod optimizers;
mod output;
mod plausible;
mod progress;
mod refit;
mod render;
#[cfg(feature = "train")]
mod rendering;
mod report;
mod scale;
mod score;
#[cfg(feature = "train")]
mod scores;
mod signals;
mod study;
#[cfg(feature = "train")]
mod study_input;
mod sweep;
mod table;
#[cfg(feature = "train")]
mod train;
mod view;
mod workspace;

use anyhow::Result;
use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{Args, Parser, Subcommand};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Mutex;
use vernis_metric::io::{for_terminal, one_line, start_threads};

/// Beyond the cores of any one machine; far more threads than cores take minutes to start.
const MOST_THREADS: usize = 1024;

#[derive(Parser)]
#[command(name = "vernis", version, about = "How different do two materials look? Perceptual metrics for BRDFs.")]
struct Cli {
    #[command(flatten)]
    shared: Shared,
    #[command(subcommand)]
    command: Command,
}

/// Options of every subcommand.
#[derive(Args, Clone)]
struct Shared {
    /// Folder with the input data (ratings, measured and fitted BRDFs) [default: that of the variable VERNIS_DATA].
    // Variables are read below: clap would show an option that a variable sets as one that the usage demands.
    #[arg(long, global = true, value_name = "DIR", value_parser = folder())]
    data: Option<PathBuf>,
    /// Cache folder for what takes time: descriptors, distances, rendered pictures [default: that of the variable VERNIS_CACHE, else $XDG_CACHE_HOME/vernis or
    /// ~/.cache/vernis].
    #[arg(long, global = true, value_name = "DIR", value_parser = folder())]
    cache: Option<PathBuf>,
    /// Folder with what metrics on pictures need and may not ship: tables, weights of networks (`vernis data weights` lists the files)
    /// [default: that of the variable VERNIS_WEIGHTS].
    #[arg(long, global = true, value_name = "DIR", value_parser = folder())]
    weights: Option<PathBuf>,
    /// Number of worker threads, 1 to 1024 [default: one per core]. Does not change results.
    #[arg(long, global = true, value_name = "N")]
    threads: Option<usize>,
}

/// Takes an empty path, unlike clap's own: it means that there is none, whatever the variable says.
fn folder() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().map(PathBuf::from)
}

#[derive(Subcommand)]
enum Command {
    /// Train a metric on a study and measure it under nested cross-validation.
    #[cfg(feature = "train")]
    Train(train::TrainArgs),
    /// Measure all metrics on a study under nested cross-validation, without exporting one.
    #[cfg(feature = "train")]
    Benchmark(train::BenchmarkArgs),
    /// Compute all descriptors and distances of a study, or of a shard of it, into a Parquet file.
    #[cfg(feature = "train")]
    Extract(extract::ExtractArgs),
    /// Join the Parquet files of all shards of a study.
    #[cfg(feature = "train")]
    Merge(extract::MergeArgs),
    /// Compare two BRDFs.
    Compare(compare::CompareArgs),
    /// Compare two pictures.
    CompareImages(compare_images::CompareImagesArgs),
    /// Compare many pairs, from a CSV file to a CSV file.
    Score(score::ScoreArgs),
    /// Sweep the parameters of the transport and energy distances over a study.
    Sweep(sweep::SweepArgs),
    /// Fit a model to a BRDF, with any metric as the loss.
    Fit(fit::FitArgs),
    /// Rebuild the candidates of a study from its references.
    Refit(refit::RefitArgs),
    /// Make approximations of a reference that lie on a manifold through many references.
    Manifold(manifold::ManifoldArgs),
    /// Experiments that take minutes or hours, and their reports.
    #[cfg(feature = "train")]
    Experiment(experiment::ExperimentArgs),
    /// List the metrics.
    Metrics(metrics::MetricsArgs),
    /// Describe one BRDF: what it is, and its descriptors; or list the materials of an archive.
    Describe(describe::DescribeArgs),
    /// The values of a BRDF at pairs of directions, from a CSV file to a CSV file.
    Evaluate(evaluate::EvaluateArgs),
    /// Render a BRDF, a scene, or the stimuli of a study.
    Render(render::RenderArgs),
    /// Statistics of a study's ratings: means, agreement, material types, illuminations, screening.
    Study(study::StudyArgs),
    /// One page of a study: its ratings, its materials, and how metrics agree with them.
    Report(report::ReportArgs),
    /// Studies and the files that they need.
    Data(data::DataArgs),
}

/// A mistake in what the user gave: exit code 2.
#[derive(Debug)]
pub struct UserError(String);

impl std::fmt::Display for UserError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for UserError {}

/// Marks an error as the user's to mend.
fn user_error(message: impl std::fmt::Display) -> anyhow::Error {
    UserError(message.to_string()).into()
}

/// Writes results to standard output; names and paths in them cannot act on a terminal. A reader that has seen enough, such as
/// `head`, is no fault of anybody.
fn print(text: impl std::fmt::Display) -> Result<()> {
    to_standard(for_terminal(&text.to_string()).as_bytes()).map(drop)
}

/// Writes bytes to standard output as they are, for the table of another program. Returns whether its reader is still there.
fn to_standard(bytes: &[u8]) -> Result<bool> {
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(anyhow::Error::new(error).context("standard output")),
    }
}

/// Says on standard error what a reader of files found unusual, once: a study may be read twice.
fn say_once(text: &str) {
    static SAID: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    if SAID.lock().is_ok_and(|mut said| said.insert(text.to_owned())) {
        note(text);
    }
}

/// Writes one line to standard error; what it names cannot act on a terminal.
fn note(text: impl std::fmt::Display) {
    tell(&format!("{}\n", one_line(&text.to_string())));
}

/// The same of something that went wrong and can be done without.
/// That `--weights` names a folder.
fn check_weights_folder(folder: &std::path::Path) -> Result<()> {
    if folder.is_dir() {
        return Ok(());
    }
    Err(user_error(format!("--weights {} is no folder; it must be the name of one", folder.display())))
}

fn warning(text: impl std::fmt::Display) {
    note(format_args!("vernis: warning: {text}"));
}

/// The only place that writes to standard error, progress bars apart. Where it cannot be written, there is nobody to tell, and the
/// work goes on.
fn tell(text: &str) {
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}

/// What the arguments cannot be, or the help that they ask for.
fn usage(error: &clap::Error) -> u8 {
    if error.use_stderr() {
        // It repeats arguments as they were given.
        tell(&for_terminal(&error.render().to_string()));
        return 2;
    }
    match error.print() {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            note(format_args!("vernis: standard output: {error}"));
            1
        }
        _ => 0,
    }
}

/// The whole program: parses the arguments, the name of the program first, runs the subcommand, reports what went wrong in one
/// message, and returns the exit code. It writes to standard output and error, catches signals, and starts the worker threads of the
/// process: it is meant to be called once.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    crate::dataset::notice::listen(say_once);
    let mut cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => return usage(&error),
    };
    let folders = &mut cli.shared;
    for (folder, variable) in [
        (&mut folders.data, "VERNIS_DATA"),
        (&mut folders.cache, "VERNIS_CACHE"),
        (&mut folders.weights, "VERNIS_WEIGHTS"),
    ] {
        *folder = folder.take().or_else(|| std::env::var_os(variable).map(PathBuf::from));
        folder.take_if(|path| path.as_os_str().is_empty());
    }
    match dispatch(cli) {
        Ok(()) => 0,
        Err(error) => {
            note(format_args!("vernis: {error:#}"));
            exit_code(&error)
        }
    }
}

/// The exit code of what went wrong.
fn exit_code(error: &anyhow::Error) -> u8 {
    if error.chain().any(|cause| cause.is::<UserError>()) {
        2
    } else if error.chain().any(|cause| cause.is::<fit::NotConverged>()) {
        3
    } else {
        error.chain().find_map(|cause| cause.downcast_ref()).map_or(1, signals::Ended::code)
    }
}

fn start_workers(asked: Option<usize>) -> Result<()> {
    let allowed = |n: &usize| (1..=MOST_THREADS).contains(n);
    if let Some(n) = asked.filter(|n| !allowed(n)) {
        return Err(user_error(format!("--threads is {n}; it must be 1 to {MOST_THREADS}")));
    }
    start_threads(asked.and_then(NonZeroUsize::new)).map_err(|e| anyhow::anyhow!("{e}; ask for fewer with --threads"))
}

fn dispatch(cli: Cli) -> Result<()> {
    start_workers(cli.shared.threads)?;
    match cli.command {
        #[cfg(feature = "train")]
        Command::Train(args) => train::train(&cli.shared, args),
        #[cfg(feature = "train")]
        Command::Benchmark(args) => train::benchmark(&cli.shared, args),
        #[cfg(feature = "train")]
        Command::Extract(args) => extract::extract(&cli.shared, args),
        #[cfg(feature = "train")]
        Command::Merge(args) => extract::merge(args),
        Command::Compare(args) => compare::run(&cli.shared, args),
        Command::CompareImages(args) => compare_images::run(&cli.shared, args),
        Command::Score(args) => score::run(&cli.shared, args),
        Command::Sweep(args) => sweep::run(&cli.shared, args),
        Command::Fit(args) => fit::run(&cli.shared, args),
        Command::Refit(args) => refit::run(&cli.shared, args),
        Command::Manifold(args) => manifold::run(&cli.shared, args),
        #[cfg(feature = "train")]
        Command::Experiment(args) => experiment::run(&cli.shared, args),
        Command::Metrics(args) => metrics::run(&cli.shared, args),
        Command::Describe(args) => describe::run(&cli.shared, args),
        Command::Evaluate(args) => evaluate::run(&cli.shared, args),
        Command::Render(args) => render::run(&cli.shared, args),
        Command::Study(args) => study::run(&cli.shared, args),
        Command::Report(args) => report::run(&cli.shared, args),
        Command::Data(args) => data::run(&cli.shared, args),
    }
}
