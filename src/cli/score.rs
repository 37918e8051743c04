//! `vernis score`: many pairs from a CSV file, in order, with one column a metric.

use super::progress::Bar;
use super::workspace::MetricChoice;
use super::{Shared, print, user_error, workspace};
use anyhow::{Context, Result};
use clap::Args;
use std::path::{Path, PathBuf};
use vernis::dataset::csv_table::{csv_error, line_of};
use vernis_metric::brdf::OpenBrdf;
use vernis_metric::io::Progress;
use vernis_metric::metric::registry::{Distance, distances};

/// Compare many pairs, from a CSV file to a CSV file.
#[derive(Args)]
#[command(after_help = "\
PAIRS.csv has a header with at least the columns `reference` and `candidate`, each a BRDF as `vernis compare --help`
describes. The output has the same rows in the same order, one more column per metric, and `mos`, `mos_low`, `mos_high` for
a learned metric, on the scale of its ratings (with `:NAME` appended for each learned metric after the first, and if PAIRS.csv has its own `mos`).

Examples:
  vernis score pairs.csv --metric vernis --metric D9.Cl --out scores.csv
  vernis score pairs.csv --metric all-lp --out lp.csv")]
pub struct ScoreArgs {
    /// CSV file with the columns reference,candidate.
    pairs: PathBuf,
    #[command(flatten)]
    choice: MetricChoice,
    /// CSV file to write.
    #[arg(long, value_name = "CSV")]
    out: PathBuf,
}

/// The rows of a file and where its two columns stand.
struct Pairs {
    header: csv::StringRecord,
    /// Each with its line in the file.
    rows: Vec<(u64, csv::StringRecord)>,
    reference: usize,
    candidate: usize,
}

impl Pairs {
    fn read(path: &Path) -> Result<Self> {
        let file = path.display();
        let bytes = std::fs::read(path).map_err(|e| user_error(format!("{file}: {e}")))?;
        let mut reader = csv::ReaderBuilder::new().flexible(true).trim(csv::Trim::All).from_reader(&bytes[..]);
        let header = reader.headers().map_err(|e| user_error(csv_error(path, &e)))?.clone();
        let column = |name: &str| {
            header.iter().position(|h| h == name).ok_or_else(|| {
                let found = header.iter().collect::<Vec<_>>().join(", ");
                user_error(format!(
                    "{file}, line 1: no column `{name}`; the columns are {found}; reference and candidate are needed"
                ))
            })
        };
        let (reference, candidate) = (column("reference")?, column("candidate")?);
        let mut rows = Vec::new();
        for record in reader.records() {
            let record = record.map_err(|e| user_error(csv_error(path, &e)))?;
            let line = line_of(&bytes, &record);
            if record.len() != header.len() {
                let (found, needed) = (record.len(), header.len());
                return Err(user_error(format!(
                    "{file}, line {line}: the row has {found} fields; it must have {needed}, as the header has"
                )));
            }
            for (column, name) in [(reference, "reference"), (candidate, "candidate")] {
                if record.get(column).is_none_or(str::is_empty) {
                    return Err(user_error(format!("{file}, line {line}: `{name}` is empty; it must be a BRDF")));
                }
            }
            rows.push((line, record));
        }
        if rows.is_empty() {
            return Err(user_error(format!("{file}: there is no pair after the header; there must be at least one")));
        }
        Ok(Self { header, rows, reference, candidate })
    }
}

pub fn run(shared: &Shared, args: ScoreArgs) -> Result<()> {
    let metrics = args.choice.metrics()?;
    let pairs = Pairs::read(&args.pairs)?;
    let (folder, name) = workspace::output_file(&args.out)?;
    workspace::warm_up(shared, &metrics)?;

    let bar = Bar::new();
    let mut found: Vec<Vec<Distance>> = Vec::with_capacity(pairs.rows.len());
    // Neighbouring rows often share their reference.
    let mut last: Option<(String, OpenBrdf)> = None;
    for (i, (line, row)) in pairs.rows.iter().enumerate() {
        let at = |e: String| user_error(format!("{}, line {line}: {e}", args.pairs.display()));
        let notation = &row[pairs.reference];
        let reference = match &last {
            Some((known, open)) if known == notation => open.clone(),
            _ => workspace::open(notation, shared.data.as_deref()).map_err(|e| at(format!("{e:#}")))?,
        };
        let candidate =
            workspace::open(&row[pairs.candidate], shared.data.as_deref()).map_err(|e| at(format!("{e:#}")))?;
        let values = distances(&metrics, reference.brdf.as_ref(), candidate.brdf.as_ref());
        found.push(values.map_err(|e| at(e.to_string()))?);
        last = Some((notation.to_owned(), reference));
        bar.update("pairs", Progress { done: i + 1, total: pairs.rows.len() });
    }
    bar.finish();
    folder.write(&name, &to_csv(&pairs, &found)?)?;
    let scales = found.first().map_or(String::new(), |first| workspace::scales(first));
    print(format!("{} pairs, {} metrics: {}\n{scales}", pairs.rows.len(), metrics.len(), args.out.display()))
}

fn to_csv(pairs: &Pairs, found: &[Vec<Distance>]) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut header: Vec<String> = pairs.header.iter().map(str::to_owned).collect();
    let first = found.first().map(Vec::as_slice).unwrap_or_default();
    header.extend(first.iter().map(|d| d.metric.clone()));
    for (i, d) in first.iter().filter(|d| d.score.is_some()).enumerate() {
        let plain = i == 0 && !pairs.header.iter().any(|column| column == "mos");
        let suffix = if plain { String::new() } else { format!(":{}", d.metric) };
        header.extend(["mos", "mos_low", "mos_high"].map(|c| format!("{c}{suffix}")));
    }
    writer.write_record(&header)?;
    for ((_, row), distances) in pairs.rows.iter().zip(found) {
        let mut record: Vec<String> = row.iter().map(str::to_owned).collect();
        record.extend(distances.iter().map(|d| d.value.to_string()));
        for s in distances.iter().filter_map(|d| d.score) {
            record.extend([s.mos, s.low, s.high].map(|x| x.to_string()));
        }
        writer.write_record(&record)?;
    }
    writer.into_inner().context("the table of scores could not be put together")
}
