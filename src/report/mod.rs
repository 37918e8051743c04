//! Records become files that people read: tables, CSV, JSON, pictures, a page. Nothing here computes a statistic.

#[cfg(feature = "train")]
pub mod figures;
pub mod gallery;
pub mod image_metrics;
pub mod landscape;
pub mod losses;
pub mod markdown;
pub mod optimizers;
pub mod output;
pub mod page;
pub mod pictures;
#[cfg(feature = "train")]
pub mod rebuilt;
pub mod spreadsheet;
pub mod study;
pub mod sweep;
pub mod tables;

use crate::evaluation::records::BenchmarkRecord;
use crate::panel::StudyRecord;
use gallery::Gallery;
use maud::html;
pub use output::OutputFolder;
use page::Head;
use page::materials::Material;
use serde::Serialize;
use std::path::PathBuf;
use thiserror::Error;

/// Why a report could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum ReportError {
    #[error("{path}: cannot write there: {source}; it must be a folder that can be created and written to")]
    Unwritable { path: PathBuf, source: std::io::Error },
    /// Another process writes into the folder.
    #[error(transparent)]
    Lock(vernis_metric::io::LockError),
    #[error("{path}: {source}")]
    Write { path: PathBuf, source: std::io::Error },
    #[error("the figure {figure} could not be drawn: {reason}")]
    Figure { figure: &'static str, reason: String },
    #[error("{what} could not be written down: {reason}")]
    Format { what: &'static str, reason: String },
}

/// The files of a page, beside its figures: those that are written for every study, and those that a benchmark has.
pub const FILES: [&str; 9] = [
    "report.html",
    "report.md",
    "study.json",
    "benchmark.json",
    "metrics.csv",
    "ablation.csv",
    "differences.csv",
    "residuals.csv",
    "predictions.csv",
];

/// A drawn figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// The file name without its ending.
    pub name: &'static str,
    /// One sentence: what is shown, and how to read it.
    pub caption: String,
    /// The text of the SVG file.
    pub svg: String,
    /// The bytes of the PNG file.
    pub png: Vec<u8>,
}

/// Writes the numbers of `record`: `benchmark.json`, and tables as CSV. Returns the names of the files.
pub fn write_numbers(folder: &OutputFolder, record: &BenchmarkRecord) -> Result<Vec<&'static str>, ReportError> {
    let tables = spreadsheet::all(record)?;
    let mut names = vec![write_json(folder, "benchmark.json", record)?];
    for (name, bytes) in tables {
        folder.write(name, &bytes)?;
        names.push(name);
    }
    Ok(names)
}

fn write_json(folder: &OutputFolder, name: &'static str, record: &impl Serialize) -> Result<&'static str, ReportError> {
    let json =
        serde_json::to_vec_pretty(record).map_err(|e| ReportError::Format { what: name, reason: e.to_string() })?;
    folder.write(name, &json)?;
    Ok(name)
}

/// Writes everything that `record` holds: `report.html`, `report.md`, `benchmark.json`, CSV tables, and each figure
/// as SVG and PNG; `materials` are shown in the page. Returns its path. Each file is replaced whole or not at all.
pub fn write_benchmark(
    folder: &OutputFolder,
    record: &BenchmarkRecord,
    materials: &[Material],
    light: &str,
) -> Result<PathBuf, ReportError> {
    let figures = draw(record)?;
    write_figures(folder, &figures)?;
    let names = write_numbers(folder, record)?;
    folder.write("report.md", page::benchmark::markdown(record, &figures).as_bytes())?;
    let head = Head {
        title: page::benchmark::title(record),
        synthetic: record.synthetic,
        provenance: page::benchmark::provenance(record),
    };
    let body = html! {
        (page::benchmark::body(record, &figures))
        (page::materials::section(materials, OPEN_MATERIALS, light, record.scale, None))
        (page::files(&names))
    };
    folder.write("report.html", page::document(&head, &page::benchmark::headline(record), &body).as_bytes())
}

/// Materials that are unfolded at first.
const OPEN_MATERIALS: usize = 10;

/// What a page on a study may show.
pub struct Whole<'a> {
    /// The statistics of its ratings.
    pub study: &'a StudyRecord,
    /// The judgement of metrics on it.
    pub benchmark: Option<&'a BenchmarkRecord>,
    /// Materials whose pictures are shown.
    pub materials: &'a [Material],
    /// The light of the pictures, in words.
    pub light: &'a str,
    /// Stimuli that are shown beside the pictures, and on a page of their own.
    pub gallery: Option<&'a Gallery>,
    /// Energy of light probes by degree of spherical harmonics.
    #[cfg(feature = "train")]
    pub probes: &'a [figures::spectrum::Spectrum],
    /// What was looked for and is not here, a sentence each.
    pub missing: &'a [String],
}

/// Writes the page of a study: its ratings, and how metrics agree with them; and `gallery.html` where there are stimuli. Returns the
/// path of `report.html`.
pub fn write_whole(folder: &OutputFolder, whole: &Whole<'_>) -> Result<PathBuf, ReportError> {
    let (of_ratings, mut missing) = draw_whole(whole)?;
    missing.extend_from_slice(whole.missing);
    write_figures(folder, &of_ratings)?;
    let mut names = vec![write_json(folder, "study.json", whole.study)?];
    let mut judged = (html! {}, html! {});
    let mut provenance = page::study::provenance(whole.study);
    if let Some(record) = whole.benchmark {
        let figures = draw(record)?;
        write_figures(folder, &figures)?;
        names.extend(write_numbers(folder, record)?);
        judged = (page::benchmark::headline(record), page::benchmark::body(record, &figures));
        provenance.extend(page::benchmark::provenance(record));
    }
    if let Some(gallery) = whole.gallery {
        folder.write(page::gallery::FILE, page::gallery::page(gallery)?.as_bytes())?;
    }
    let title = match whole.benchmark {
        Some(record) => page::benchmark::title(record),
        None => study::title(whole.study),
    };
    let head = Head { title, synthetic: whole.study.synthetic, provenance };
    let body = html! {
        (judged.1)
        h2 { "Ratings" }
        (page::study::body(whole.study, &of_ratings, &missing))
        (page::materials::section(whole.materials, OPEN_MATERIALS, whole.light, whole.study.scale, whole.gallery))
        (page::files(&names))
    };
    folder.write("report.html", page::document(&head, &judged.0, &body).as_bytes())
}

fn write_figures(folder: &OutputFolder, figures: &[Figure]) -> Result<(), ReportError> {
    for figure in figures {
        folder.write(&format!("{}.svg", figure.name), figure.svg.as_bytes())?;
        folder.write(&format!("{}.png", figure.name), &figure.png)?;
    }
    Ok(())
}

#[cfg(feature = "train")]
fn draw_whole(whole: &Whole<'_>) -> Result<(Vec<Figure>, Vec<String>), ReportError> {
    let mut figures = figures::study::all(whole.study)?;
    figures.extend(figures::spectrum::figure_of(whole.probes)?);
    Ok((figures, figures::study::missing(whole.study)))
}

#[cfg(not(feature = "train"))]
fn draw_whole(_whole: &Whole<'_>) -> Result<(Vec<Figure>, Vec<String>), ReportError> {
    Ok((Vec::new(), vec!["All figures: this program was built without the feature `train`.".to_owned()]))
}

#[cfg(feature = "train")]
fn draw(record: &BenchmarkRecord) -> Result<Vec<Figure>, ReportError> {
    figures::benchmark::all(record)
}

/// Figures need the `train` feature; without it the page has its tables alone.
#[cfg(not(feature = "train"))]
fn draw(_record: &BenchmarkRecord) -> Result<Vec<Figure>, ReportError> {
    Ok(Vec::new())
}
