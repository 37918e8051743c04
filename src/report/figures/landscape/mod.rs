//! How metrics follow one parameter of a material: sweeps, landscapes, and odd pairs.

mod pairs;
mod panel;

use super::figure;
use super::marks::{self, Canvas, Drawn};
use crate::experiment::landscape::record::{LandscapeRecord, Line, MetricNote, Sweep};
use crate::report::{Figure, ReportError};
use panel::{Curve, Panel, Panels, Style};
use plotters::prelude::DrawingBackend;

/// All figures of the experiment.
///
/// # Errors
/// [`ReportError::Figure`].
pub fn all(record: &LandscapeRecord) -> Result<Vec<Figure>, ReportError> {
    Ok(vec![sweeps(record)?, landscapes(record)?, pairs::figure_of(record)?])
}

/// Distances on the way out from each material, a panel a sweep. Other reports may show it as well.
///
/// # Errors
/// [`ReportError::Figure`].
pub fn sweeps(record: &LandscapeRecord) -> Result<Figure, ReportError> {
    let caption = format!(
        "Distances of a material to itself with one parameter changed: {}. The vertical line is the reference; a distance should grow \
         away from it on both sides. Grey: beyond what people rated. {} Hue is turned in CIELAB at one lightness and chroma; albedo and \
         f0 are luminances; alpha, albedo and f0 have logarithmic axes.",
        materials(record),
        units(&record.metrics, "of its panel")
    );
    let panels = by_row(
        record.sweeps.iter().map(|sweep| of_sweep(sweep, &record.metrics)).collect(),
        rows(record.sweeps.len(), record),
    );
    let title = format!("Distances on the way out from a material ({})", axis(&record.metrics));
    picture("sweeps", caption, title, panels, Style::Marks, record)
}

/// What a fit minimises, a panel a line.
///
/// # Errors
/// [`ReportError::Figure`].
pub fn landscapes(record: &LandscapeRecord) -> Result<Figure, ReportError> {
    let flat: Vec<String> = record
        .lines
        .iter()
        .flat_map(|line| {
            let missing = line.of_metric.iter().zip(&record.metrics).filter(|(course, _)| course.scaled().is_none());
            missing.map(|(_, metric)| format!("{} on {}, {}", metric.name, line.material, line.name))
        })
        .collect();
    let flat = if flat.is_empty() {
        String::new()
    } else {
        format!(" Not above zero there, and not drawn: {}.", flat.join("; "))
    };
    let caption = format!(
        "What a fit minimises, near the reference (vertical line) and on the way from a wrong start (at 1) to a fit (at 0), in {} points. \
         Each loss is divided by its own value at the end of the line, on the right, or on the left where the line ends at the \
         reference, so that shapes can be compared and heights cannot; it has no unit.{flat} A smooth bowl leads a search to its lowest \
         point; a dent or a step stops it.",
        record.steps
    );
    let panels = by_row(record.lines.iter().map(of_line).collect(), rows(record.lines.len(), record));
    let title = "What a fit minimises, as a share of the end of each line".to_owned();
    picture("landscapes", caption, title, panels, Style::Lines, record)
}

fn of_sweep<'a>(sweep: &'a Sweep, metrics: &[MetricNote]) -> Panel<'a> {
    let distances: Vec<&[f64]> = sweep.of_metric.iter().map(|swept| &swept.distances[..]).collect();
    let curves = on_one_axis(metrics, &distances).into_iter().enumerate();
    Panel {
        title: title(&sweep.material, &sweep.parameter, &sweep.unit),
        values: &sweep.values,
        logarithmic: sweep.logarithmic,
        degrees: sweep.unit == "deg",
        reference: sweep.reference,
        clear: Some(sweep.rated),
        curves: curves.map(|(metric, values)| Curve { metric, values }).collect(),
    }
}

fn of_line(line: &Line) -> Panel<'_> {
    let courses = line.of_metric.iter().enumerate();
    Panel {
        title: title(&line.material, &line.name, &line.unit),
        values: &line.values,
        logarithmic: line.logarithmic,
        degrees: line.unit == "deg",
        reference: line.values[line.reference],
        clear: None,
        curves: courses.filter_map(|(metric, course)| Some(Curve { metric, values: course.scaled()? })).collect(),
    }
}

fn picture(
    name: &'static str,
    caption: String,
    title: String,
    panels: Vec<Panel<'_>>,
    style: Style,
    record: &LandscapeRecord,
) -> Result<Figure, ReportError> {
    let columns = distinct(record).len();
    let legend = Legend::of(&record.metrics).map_err(|reason| ReportError::Figure { figure: name, reason })?;
    figure(name, caption, &Panels { title, panels, columns, style, legend })
}

/// Names of the materials in order.
fn distinct(record: &LandscapeRecord) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for sweep in &record.sweeps {
        if !names.contains(&sweep.material.as_str()) {
            names.push(&sweep.material);
        }
    }
    names
}

fn materials(record: &LandscapeRecord) -> String {
    distinct(record).join(", ")
}

fn rows(panels: usize, record: &LandscapeRecord) -> usize {
    panels / distinct(record).len().max(1)
}

/// Panels by material as panels by parameter: a column a material.
fn by_row(panels: Vec<Panel<'_>>, rows: usize) -> Vec<Panel<'_>> {
    let mut indexed: Vec<(usize, Panel<'_>)> =
        panels.into_iter().enumerate().map(|(i, p)| (i % rows.max(1), p)).collect();
    indexed.sort_by_key(|(row, _)| *row);
    indexed.into_iter().map(|(_, panel)| panel).collect()
}

fn title(material: &str, name: &str, unit: &str) -> String {
    if unit == "1" { format!("{material}, {name}") } else { format!("{material}, {name} ({unit})") }
}

/// The numbers of each metric on one axis: as they are where they are in MOS; others so that their largest is that of those in MOS,
/// or 1 where none is.
fn on_one_axis(metrics: &[MetricNote], values: &[&[f64]]) -> Vec<Vec<f64>> {
    let largest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    let in_mos = metrics.iter().zip(values).filter(|(metric, _)| metric.is_in_mos());
    let top = in_mos.map(|(_, values)| largest(values)).fold(0.0, f64::max);
    let top = if top > 0.0 { top } else { 1.0 };
    let scaled = |(metric, values): (&MetricNote, &&[f64])| {
        let own = largest(values);
        let factor = if metric.is_in_mos() || own <= 0.0 { 1.0 } else { top / own };
        values.iter().map(|value| factor * value).collect()
    };
    metrics.iter().zip(values).map(scaled).collect()
}

/// What an axis of [`on_one_axis`] says.
fn axis(metrics: &[MetricNote]) -> &'static str {
    if metrics.iter().any(MetricNote::is_in_mos) { "MOS" } else { "scaled" }
}

/// Which metrics are in MOS and which are scaled, in sentences.
fn units(metrics: &[MetricNote], of: &str) -> String {
    let names = |in_mos: bool| -> Vec<&str> {
        metrics.iter().filter(|m| m.is_in_mos() == in_mos).map(|m| m.name.as_str()).collect()
    };
    let (mos, others) = (names(true), names(false));
    match (mos.is_empty(), others.is_empty()) {
        (false, true) => "Distances are in points of mean opinion score (MOS).".to_owned(),
        (false, false) => format!(
            "{} in points of mean opinion score (MOS); {} scaled to the largest MOS distance {of}, so that only the shape counts.",
            mos.join(", "),
            others.join(", ")
        ),
        (true, _) => format!("Each metric is scaled to its own largest distance {of}, so that only shapes count."),
    }
}

/// The names of metrics with their marks, in lines that fit the picture.
struct Legend {
    /// Metric, name, line, left end.
    entries: Vec<(usize, String, usize, f64)>,
}

/// Size of the words in panels and legends.
const SMALL: f64 = 15.0;
const LINE: f64 = 24.0;

impl Legend {
    fn of(metrics: &[MetricNote]) -> Result<Self, String> {
        let (mut left, mut line, mut entries) = (30.0, 0, Vec::new());
        for (index, metric) in metrics.iter().enumerate() {
            let name = if metric.is_in_mos() { format!("{} (MOS)", metric.name) } else { metric.name.clone() };
            let room = 60.0 + marks::width(&name, SMALL)?;
            if left + room > f64::from(super::WIDTH) && left > 30.0 {
                (left, line) = (30.0, line + 1);
            }
            entries.push((index, name, line, left));
            left += room;
        }
        Ok(Self { entries })
    }

    fn height(&self) -> f64 {
        LINE * self.entries.last().map_or(0, |(_, _, line, _)| line + 1) as f64
    }

    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>, top: f64, style: Style) -> Drawn {
        for (index, name, line, left) in &self.entries {
            let y = top + LINE * (*line as f64 + 0.5);
            style.sample(canvas, *index, (*left, y))?;
            canvas.words(name, (left + 34.0, y), SMALL, marks::Anchor::Left)?;
        }
        Ok(())
    }
}
