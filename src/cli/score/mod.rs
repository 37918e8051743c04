//! `vernis score`: many pairs from a CSV file, in order, with one column a metric.

mod pairs;
mod sink;
mod work;

use super::output::{self, Inputs, Replace, STANDARD};
use super::progress::Bar;
use super::workspace::MetricChoice;
use super::{Shared, print, user_error, workspace};
use anyhow::Result;
use clap::Args;
use pairs::Pairs;
use sink::{Columns, Sink};
use std::path::{Path, PathBuf};
use vernis_metric::io::{Progress, counted};
use work::Scorer;

/// Compare many pairs, from a CSV file to a CSV file.
#[derive(Args)]
#[command(after_help = "\
PAIRS.csv has a header with at least the columns `reference` and `candidate`, each a BRDF as `vernis compare --help`
describes; a relative path starts at the folder of PAIRS.csv, otherwise at the working directory or the data folder. Between
fields may stand commas, semicolons or tabs. The output has the same rows in the same order and more columns: one per metric;
`mos`, `mos_low`, `mos_high` for a learned metric, on the scale of its ratings (with `:NAME` appended for each learned metric
after the first, and if PAIRS.csv has its own `mos`); and `reason`, which says why a row has no numbers. Names that are taken
get `:2`.

All paths are looked up before the first distance. A row that cannot be computed is reported with its line, its cells stay
empty, and the exit code is 2 when all others are done. With --strict it ends the command instead. Rows are appended to
CSV.partial as they finish, so an interrupted run loses only the rows in hand; CSV appears when all are done. On standard
output, rows appear in their order.

Examples:
  vernis score pairs.csv --metric vernis --metric D9.Cl --out scores.csv
  vernis score pairs.csv --metric all-lp --out lp.csv
  make-pairs | vernis score - --metric D9.Cl | sort-pairs")]
pub struct ScoreArgs {
    /// CSV file with the columns reference,candidate; `-` is standard input.
    pairs: PathBuf,
    #[command(flatten)]
    choice: MetricChoice,
    /// CSV file to write; `-` is standard output.
    #[arg(long, value_name = "CSV", default_value = STANDARD)]
    out: PathBuf,
    #[command(flatten)]
    replace: Replace,
    /// End at the first row that cannot be computed, without a result.
    #[arg(long)]
    strict: bool,
}

/// Rows that failed are told one by one up to this many; the column `reason` has all.
const TOLD: usize = 20;

pub fn run(shared: &Shared, args: ScoreArgs) -> Result<()> {
    let metrics = args.choice.metrics(shared)?;
    let to_standard = args.out == Path::new(STANDARD);
    let mut inputs = args.choice.inputs().files((args.pairs != Path::new(STANDARD)).then_some(&args.pairs));
    if !to_standard {
        check_output(&args, &inputs)?;
    }
    let pairs = Pairs::read(&args.pairs, shared.data.as_deref())?;
    if !to_standard {
        inputs = inputs.sources(pairs.sources(), shared.data.as_deref());
        check_output(&args, &inputs)?;
    }
    let bad = pairs.bad();
    let total = pairs.rows.len();
    if let Some((line, reason)) = bad.first().filter(|_| args.strict || bad.len() == total) {
        return Err(user_error(refusal(&pairs, *line, reason, bad.len(), args.strict)));
    }
    workspace::warm_up(shared, &metrics)?;
    let columns = Columns::new(&pairs.header, &metrics);
    let bar = Bar::new();
    let (mut failed, mut scales) = (0, None);
    let mut tell = |line: u64, reason: &str| {
        failed += 1;
        if failed <= TOLD {
            bar.line(&format!("vernis: {}, line {line}: {reason}", pairs.name));
        }
    };
    bad.iter().for_each(|(line, reason)| tell(*line, reason));
    let mut sink = if to_standard { Sink::standard(&columns)? } else { Sink::file(&args.out, &columns, total)? };
    bar.update("pairs", Progress { done: 0, total });
    let scorer = Scorer { pairs: &pairs, metrics: &metrics, data: shared.data.as_deref() };
    let done = scorer.run(&mut |done, row, found| {
        let (line, record) = (pairs.rows[row].line, &pairs.rows[row].record);
        if let Err(reason) = &found {
            if args.strict {
                return Err(user_error(format!("{}, line {line}: {reason}{}", pairs.name, sink.kept(done))));
            }
            if pairs.rows[row].sources.is_ok() {
                tell(line, reason);
            }
        }
        if let (None, Ok(found)) = (&scales, &found) {
            let scores = metrics.iter().zip(found).map(|(metric, found)| (metric.name(), found.score));
            scales = Some(workspace::scales(scores));
        }
        sink.take(row, columns.row(record, &found))?;
        bar.update("pairs", Progress { done: done + 1, total });
        Ok(sink.is_open())
    });
    bar.finish();
    done?;
    sink.finish()?;
    if !to_standard {
        let (pairs, metrics) = (counted(total, "pair"), counted(metrics.len(), "metric"));
        print(format!("{pairs}, {metrics}: {}\n{}", args.out.display(), scales.unwrap_or_default()))?;
    }
    match failed {
        0 => Ok(()),
        n => Err(user_error(format!(
            "{} of {} could not be computed; the column `{}` says why",
            n,
            counted(total, "row"),
            columns.reason()
        ))),
    }
}

/// That the file and its partial form may be written.
fn check_output(args: &ScoreArgs, inputs: &Inputs) -> Result<()> {
    output::file(&args.out, inputs, args.replace)?;
    output::file(&sink::partial(&args.out), inputs, args.replace).map(drop)
}

/// Why nothing is computed at all.
fn refusal(pairs: &Pairs, line: u64, reason: &str, bad: usize, strict: bool) -> String {
    let first = format!("{}, line {line}: {reason}", pairs.name);
    match (bad, strict) {
        (1, _) => first,
        (n, true) => format!("{first}; so are {} more of {} rows", n - 1, pairs.rows.len()),
        (n, false) => format!("{first}; none of the {n} rows can be computed"),
    }
}
