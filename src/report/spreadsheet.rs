//! The records of a benchmark as CSV, every figure with all its digits; names of splits and figures as in the JSON.

use super::ReportError;
use crate::evaluation::agreement::Figure;
use crate::evaluation::records::{BenchmarkRecord, Judgement, RowSet};
use serde::Serialize;
use std::borrow::Cow;
use vernis_metric::io::one_line;

/// A name as a cell of a table. A program of spreadsheets takes a cell that begins with `=`, `+`, `-`, `@`, a tab or a return for a
/// formula, unless it is a number: an apostrophe before it says that it is text.
pub fn cell(name: &str) -> Cow<'_, str> {
    let text = one_line(name);
    let formula = name.starts_with(['=', '+', '-', '@', '\t', '\r']) && name.parse::<f64>().is_err();
    if formula { Cow::Owned(format!("'{text}")) } else { text }
}

/// A set of rows as a cell: the word or name that it has in the JSON.
fn rows_cell(row_set: &RowSet) -> String {
    cell(&String::from(row_set.clone())).into_owned()
}

/// File names and contents: `metrics.csv`, `ablation.csv`, `differences.csv`, `residuals.csv`, `predictions.csv`.
pub fn all(record: &BenchmarkRecord) -> Result<Vec<(&'static str, Vec<u8>)>, ReportError> {
    Ok(vec![
        ("metrics.csv", metrics(record)?),
        ("ablation.csv", ablation(record)?),
        ("differences.csv", differences(record)?),
        ("residuals.csv", residuals(record)?),
        ("predictions.csv", predictions(record)?),
    ])
}

/// One row a metric, split, set of rows and figure.
fn metrics(record: &BenchmarkRecord) -> Result<Vec<u8>, ReportError> {
    let header =
        ["metric", "version", "kind", "split", "row_set", "rows", "figure", "value", "low", "high", "fold_mean"];
    let rows = record.metrics.iter().flat_map(|metric| {
        let judgements = metric.judgements.iter().flat_map(figures);
        let (name, version) = (cell(&metric.name), metric.version.as_deref().map(cell));
        judgements.map(move |figure| (name.clone(), version.clone(), metric.kind, figure))
    });
    write("metrics.csv", &header, rows)
}

fn ablation(record: &BenchmarkRecord) -> Result<Vec<u8>, ReportError> {
    let header = ["descriptors", "columns", "split", "row_set", "rows", "figure", "value", "low", "high", "fold_mean"];
    let rows = record.ablation.iter().flat_map(|found| {
        let judgements = found.judgements.iter().flat_map(figures);
        judgements.map(move |figure| (cell(&found.name), found.columns, figure))
    });
    write("ablation.csv", &header, rows)
}

/// Split, set of rows, number of rows, figure, value, low, high, mean of the folds' own.
fn figures(judgement: &Judgement) -> impl Iterator<Item = impl Serialize> {
    Figure::ALL.iter().filter_map(|&figure| {
        let (value, interval) = (judgement.agreement.get(figure)?, judgement.intervals.get(figure)?);
        let fold_mean = match figure {
            Figure::Plcc => judgement.fold_means.map(|means| means.plcc),
            Figure::Srocc => judgement.fold_means.map(|means| means.srocc),
            _ => None,
        };
        let (split, row_set, rows) = (judgement.split, rows_cell(&judgement.row_set), judgement.rows);
        Some((split, row_set, rows, figure, value, interval.low, interval.high, fold_mean))
    })
}

fn differences(record: &BenchmarkRecord) -> Result<Vec<u8>, ReportError> {
    let header = [
        "a",
        "b",
        "figure",
        "split",
        "row_set",
        "difference",
        "low",
        "high",
        "p",
        "holm_p",
        "zou_low",
        "zou_high",
        "steiger_p",
    ];
    let rows = record.differences.iter().map(|d| {
        let (paired, check) = (d.paired, d.cross_check);
        (
            (cell(&d.a), cell(&d.b), d.figure, d.split, rows_cell(&d.row_set)),
            (paired.difference, paired.interval.low, paired.interval.high, paired.p, d.holm_p),
            (check.map(|c| c.zou.low), check.map(|c| c.zou.high), check.map(|c| c.steiger_p)),
        )
    });
    write("differences.csv", &header, rows)
}

fn residuals(record: &BenchmarkRecord) -> Result<Vec<u8>, ReportError> {
    let header = ["material", "rows", "bias", "rms", "worst_method", "worst_error"];
    let rows = record
        .residuals
        .iter()
        .map(|r| (cell(&r.material), r.rows, r.bias, r.rms, cell(&r.worst_method), r.worst_error));
    write("residuals.csv", &header, rows)
}

/// One row a rated pair, one column a metric of the headline.
fn predictions(record: &BenchmarkRecord) -> Result<Vec<u8>, ReportError> {
    let names: Vec<Cow<'_, str>> = record.headline.iter().map(|name| cell(name)).collect();
    let mut header = vec!["material", "group", "method", "method_family", "mos"];
    header.extend(names.iter().map(|name| &**name));
    let rows = record.predictions.iter().map(|row| {
        let predicted: Vec<Option<f64>> = record.headline.iter().map(|m| row.predicted.get(m).copied()).collect();
        let names = [&row.material, &row.group, &row.method, &row.method_family].map(|name| cell(name));
        (names, row.mos, predicted)
    });
    write("predictions.csv", &header, rows)
}

fn write(
    what: &'static str,
    header: &[&str],
    rows: impl Iterator<Item = impl Serialize>,
) -> Result<Vec<u8>, ReportError> {
    let failed = |reason: String| ReportError::Format { what, reason };
    let mut writer = csv::WriterBuilder::new().has_headers(false).from_writer(Vec::new());
    writer.write_record(header).map_err(|e| failed(e.to_string()))?;
    for row in rows {
        writer.serialize(row).map_err(|e| failed(e.to_string()))?;
    }
    writer.into_inner().map_err(|e| failed(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_no_formula() {
        for (name, expected) in [
            ("=HYPERLINK(\"http://x\",\"y\")", "'=HYPERLINK(\"http://x\",\"y\")"),
            ("@SUM(A1)", "'@SUM(A1)"),
            ("+1+cmd|' /C calc'!A0", "'+1+cmd|' /C calc'!A0"),
            ("-2+3", "'-2+3"),
            ("\t=1", "'\\t=1"),
            ("a\u{1b}[2J\nb", "a\\u001b[2J\\nb"),
            // Numbers are numbers, and other names are as they were.
            ("-0.5", "-0.5"),
            ("+3e-7", "+3e-7"),
            ("gold-paint", "gold-paint"),
            ("", ""),
        ] {
            assert_eq!(cell(name), expected);
        }
    }
}
