//! The command line: argument definitions, one file per subcommand, progress bars and exit codes.
//!
//! Exit codes: 0 success, 1 a fault of vernis or of the machine, 2 a mistake in what the user gave, 3 a fit that did not
//! converge (its best result so far is written).

#[cfg(feature = "train")]
mod claims;
mod compare;
mod data;
mod describe;
#[cfg(feature = "train")]
mod experiment;
#[cfg(feature = "train")]
mod extract;
mod fit;
mod limits;
mod manifold;
mod metrics;
mod progress;
mod refit;
mod report;
mod score;
mod study;
#[cfg(feature = "train")]
mod study_input;
mod sweep;
#[cfg(feature = "train")]
mod train;
mod view;
mod workspace;

use anyhow::Result;
use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{Args, Parser, Subcommand};
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

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
pub struct Shared {
    /// Folder with the input data (ratings, measured and fitted BRDFs).
    #[arg(long, global = true, env = "VERNIS_DATA", value_name = "DIR", value_parser = folder())]
    data: Option<PathBuf>,
    /// Cache folder for computed descriptors [default: $XDG_CACHE_HOME/vernis or ~/.cache/vernis].
    #[arg(long, global = true, env = "VERNIS_CACHE", value_name = "DIR", value_parser = folder())]
    cache: Option<PathBuf>,
    /// Number of worker threads, 1 to 1024 [default: one per core]. Does not change results.
    #[arg(long, global = true, value_name = "N")]
    threads: Option<usize>,
}

/// Takes an empty path, unlike clap's own: a variable that is set to nothing means that none was given.
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
    /// Experiments that take hours, and their reports.
    #[cfg(feature = "train")]
    Experiment(experiment::ExperimentArgs),
    /// List the metrics.
    Metrics(metrics::MetricsArgs),
    /// Describe one BRDF: what it is, and its descriptors.
    Describe(describe::DescribeArgs),
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

/// Writes results to standard output. A reader that has seen enough, such as `head`, is no fault of anybody.
fn print(text: impl std::fmt::Display) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match write!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(anyhow::Error::new(error).context("standard output"))
        }
        _ => Ok(()),
    }
}

/// Parses the arguments, runs the subcommand, reports what went wrong in one message.
pub fn run() -> ExitCode {
    let mut cli = Cli::parse();
    for folder in [&mut cli.shared.data, &mut cli.shared.cache] {
        folder.take_if(|path| path.as_os_str().is_empty());
    }
    match dispatch(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("vernis: {error:#}");
            let any = |is: fn(&(dyn std::error::Error + 'static)) -> bool| error.chain().any(is);
            ExitCode::from(match () {
                () if any(|cause| cause.is::<UserError>()) => 2,
                () if any(|cause| cause.is::<fit::NotConverged>()) => 3,
                () => 1,
            })
        }
    }
}

fn dispatch(cli: Cli) -> Result<()> {
    if let Some(n) = cli.shared.threads {
        if !(1..=MOST_THREADS).contains(&n) {
            return Err(user_error(format!("--threads is {n}; it must be 1 to {MOST_THREADS}")));
        }
        rayon::ThreadPoolBuilder::new().num_threads(n).build_global()?;
    }
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
        Command::Score(args) => score::run(&cli.shared, args),
        Command::Sweep(args) => sweep::run(&cli.shared, args),
        Command::Fit(args) => fit::run(&cli.shared, args),
        Command::Refit(args) => refit::run(&cli.shared, args),
        Command::Manifold(args) => manifold::run(&cli.shared, args),
        #[cfg(feature = "train")]
        Command::Experiment(args) => experiment::run(&cli.shared, args),
        Command::Metrics(args) => metrics::run(&cli.shared, args),
        Command::Describe(args) => describe::run(&cli.shared, args),
        Command::Study(args) => study::run(&cli.shared, args),
        Command::Report(args) => report::run(&cli.shared, args),
        Command::Data(args) => data::run(&cli.shared, args),
    }
}
