//! Records become files that people read: tables, CSV, JSON, pictures, a page. Nothing here computes a statistic.

#[cfg(feature = "train")]
pub mod figures;
pub mod losses;
#[cfg(feature = "train")]
mod marks;
pub mod output;
pub mod page;
pub mod spreadsheet;
pub mod study;
pub mod sweep;
pub mod tables;

use crate::evaluation::records::BenchmarkRecord;
pub use output::OutputFolder;
use std::path::PathBuf;
use thiserror::Error;

/// Why a report could not be made.
#[derive(Debug, Error)]
pub enum ReportError {
    #[error("{path}: cannot write there: {source}; allowed: a folder that can be created and written to")]
    Unwritable { path: PathBuf, source: std::io::Error },
    #[error("{path}: {source}")]
    Write { path: PathBuf, source: std::io::Error },
    #[error("the figure {figure} could not be drawn: {reason}")]
    Figure { figure: &'static str, reason: String },
    #[error("{what} could not be written down: {reason}")]
    Format { what: &'static str, reason: String },
}

/// A drawn figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// The file name without its ending.
    pub name: &'static str,
    /// One sentence: what is shown, and how to read it.
    pub caption: String,
    pub svg: String,
    pub png: Vec<u8>,
}

/// Writes everything that `record` holds: `report.html`, `report.md`, `benchmark.json`, CSV tables, and each figure
/// as SVG and PNG. Returns the path of the HTML page. Each file is replaced whole or not at all.
pub fn write_benchmark(folder: &OutputFolder, record: &BenchmarkRecord) -> Result<PathBuf, ReportError> {
    let figures = draw(record)?;
    for figure in &figures {
        folder.write(&format!("{}.svg", figure.name), figure.svg.as_bytes())?;
        folder.write(&format!("{}.png", figure.name), &figure.png)?;
    }
    for (name, bytes) in spreadsheet::all(record)? {
        folder.write(name, &bytes)?;
    }
    let json = serde_json::to_vec_pretty(record)
        .map_err(|e| ReportError::Format { what: "benchmark.json", reason: e.to_string() })?;
    folder.write("benchmark.json", &json)?;
    folder.write("report.md", page::markdown(record, &figures).as_bytes())?;
    folder.write("report.html", page::html(record, &figures).as_bytes())
}

#[cfg(feature = "train")]
fn draw(record: &BenchmarkRecord) -> Result<Vec<Figure>, ReportError> {
    figures::all(record)
}

/// Figures need the `train` feature; without it the page has its tables alone.
#[cfg(not(feature = "train"))]
fn draw(_record: &BenchmarkRecord) -> Result<Vec<Figure>, ReportError> {
    Ok(Vec::new())
}
