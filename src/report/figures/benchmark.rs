//! The figures of a benchmark: predicted against rated, agreement of selected metrics, of all Lp metrics, errors by
//! material, ablation.

use super::curves::{Curves, Learning};
use super::image_metrics;
use super::marks::{self, Anchor, BLUE, Canvas, Drawn, FAINT, INK, ORANGE, Picture};
use super::{Axis, Square, TEXT, TITLE, WIDTH, drawn, legend, observed, round_step, shown, task};
use crate::evaluation::agreement::Figure as AgreementFigure;
use crate::evaluation::bootstrap::{Difference, Interval};
use crate::evaluation::records::{
    BenchmarkRecord, Judgement, MetricKind, MetricRecord, PredictionRecord, RowSet, Split,
};
use crate::report::{Figure, ReportError, tables};
use plotters::prelude::DrawingBackend;
use std::collections::BTreeSet;
use vernis_metric::io::counted;
use vernis_metric::math::rating_scale::RatingScale;

/// Materials in the figure of errors.
const MOST_MATERIALS: usize = 40;

/// Every figure that `record` has the data for.
pub fn all(record: &BenchmarkRecord) -> Result<Vec<Figure>, ReportError> {
    let mut figures = Vec::new();
    let subject = tables::subject(record);
    let rows = rows(record);
    if let Some(scatter) = Scatter::of(record) {
        let caption = format!(
            "Mean opinion score predicted by {subject} for materials that it has not seen, against that of the raters; \
             on the diagonal they agree. {rows}. One mark per rated pair, by approximation method."
        );
        figures.push(task("scatter", caption, scatter));
    }
    for (name, bars, caption) in [
        (
            "agreement",
            agreement(record),
            "Agreement of selected metrics on materials that neither they nor their logistic maps have seen".to_owned(),
        ),
        ("lp", lp(record), "Agreement of the Lp distances, with the logistic map fitted on other materials".to_owned()),
        (
            "image-metrics",
            image_metrics::bars(record),
            format!(
                "Agreement of {subject}, of other metrics on BRDFs, and of metrics on pictures, {}",
                image_metrics::WORDS
            ),
        ),
        (
            "ablation",
            ablation(record),
            format!(
                "Agreement of {0} on unseen materials: first with all of its descriptors (full), then retrained with others; the \
                 number of descriptors is in brackets. Every bar is {0}, which is another model than {subject}",
                record.retrained
            ),
        ),
    ] {
        if !bars.rows.is_empty() {
            let caption = format!(
                "{caption}. {rows}. Pearson correlation after the logistic map (no border) and Spearman correlation (black \
                 border), with 95 % intervals of a bootstrap by material."
            );
            figures.push(task(name, caption, bars));
        }
    }
    let importance = importance(record);
    if !importance.rows.is_empty() {
        let caption = format!(
            "Loss of {} when descriptors are exchanged between unseen rows: loss of Pearson correlation (no border) and of \
             Spearman correlation (black border), with 95 % intervals of a bootstrap by material. {rows}. Families first, then the \
             descriptors that cost most.",
            record.retrained
        );
        figures.push(task("importance", caption, importance));
    }
    if let Some(learning) = Learning::of(record) {
        let caption = format!(
            "Agreement of {} on unseen materials when it is trained on fewer groups of materials: Pearson (no border) and Spearman \
             correlation (black border), with 95 % intervals of a bootstrap by material. {rows}.",
            record.retrained
        );
        figures.push(task("learning", caption, learning));
    }
    for (name, curves) in [("curves", Curves::of_brdfs(record)), ("image-curves", Curves::of_pictures(record))] {
        let Some(curves) = curves else { continue };
        let metrics = curves.metrics();
        let caption = format!(
            "Mean opinion scores against the distances {}, with the logistic curve fitted on these same {}, in sample. One mark per \
             rated pair, by approximation method; the closer to the curve, the better.",
            metrics.join(", "),
            counted(record.rows, "rated pair")
        );
        figures.push(task(name, caption, curves));
    }
    let strips = Strips::of(record);
    if !strips.materials.is_empty() {
        let caption = format!(
            "Errors of {subject}, predicted minus rated MOS, on the materials where they are largest. {rows}. One mark per rated \
             pair, by approximation method; right of zero the metric predicts too high a number."
        );
        figures.push(task("residuals", caption, strips));
    }
    drawn(figures)
}

/// Which rows bars and marks are of, as a sentence without its end.
fn rows(record: &BenchmarkRecord) -> String {
    format!(
        "Rows: {} of {}, each predicted by the one of {} that held its material and its sisters out",
        counted(record.rows, "rated pair"),
        counted(record.materials, "material"),
        counted(record.folds, "fold")
    )
}

/// Names of the methods in a fixed order, which decides their marks.
fn methods(predictions: &[PredictionRecord]) -> Vec<&str> {
    predictions.iter().map(|p| p.method.as_str()).collect::<BTreeSet<_>>().into_iter().collect()
}

/// Predicted against rated.
struct Scatter<'a> {
    title: String,
    methods: Vec<&'a str>,
    /// Method, rated, predicted.
    points: Vec<(usize, f64, f64)>,
    range: (f64, f64),
    scale: RatingScale,
}

impl<'a> Scatter<'a> {
    fn of(record: &'a BenchmarkRecord) -> Option<Self> {
        let subject = record.headline.first()?;
        let methods = methods(&record.predictions);
        let point = |p: &PredictionRecord| {
            Some((methods.iter().position(|m| *m == p.method)?, p.mos, *p.predicted.get(subject)?))
        };
        let points: Vec<(usize, f64, f64)> = record.predictions.iter().filter_map(point).collect();
        if points.is_empty() {
            return None;
        }
        let scale = record.scale;
        let range = points.iter().fold((scale.low(), scale.high()), |(low, high), p| (low.min(p.2), high.max(p.2)));
        let margin = scale.width(0.15);
        Some(Self {
            title: observed(&format!("{subject}: predicted and rated"), record.synthetic),
            methods,
            points,
            range: (range.0 - margin, range.1 + margin),
            scale,
        })
    }
}

impl Picture for Scatter<'_> {
    fn size(&self) -> (u32, u32) {
        (WIDTH, 740)
    }

    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>) -> Drawn {
        Square {
            title: &self.title,
            x_label: "rated MOS",
            y_label: "predicted MOS",
            range: self.range,
            step_of: (self.scale.low(), self.scale.high()),
            methods: &self.methods,
            points: &self.points,
        }
        .draw(canvas)
    }
}

/// Two horizontal bars a row, with intervals.
pub(super) struct Bars {
    pub title: String,
    pub rows: Vec<BarRow>,
    /// The end of the axis.
    pub most: f64,
}

pub(super) struct BarRow {
    label: String,
    /// Pearson after the logistic map, Spearman.
    bars: [(f64, Interval); 2],
    /// Begins a new group of rows.
    pub gap: bool,
}

impl BarRow {
    pub fn of(label: String, judgement: Option<&Judgement>, gap: bool) -> Option<Self> {
        let judgement = judgement?;
        let bar = |figure| Some((judgement.agreement.get(figure)?, judgement.intervals.get(figure)?));
        Some(Self { label, bars: [bar(AgreementFigure::Plcc)?, bar(AgreementFigure::Srocc)?], gap })
    }
}

pub(super) fn unseen(metric: &MetricRecord) -> Option<&Judgement> {
    metric.judgement(Split::UnseenMaterial, RowSet::All)
}

fn agreement(record: &BenchmarkRecord) -> Bars {
    let metrics = record.headline_metrics();
    let rows = metrics.iter().filter_map(|m| BarRow::of(m.name.clone(), unseen(m), false)).collect();
    Bars { title: observed("Agreement with the ratings, unseen materials", record.synthetic), rows, most: 1.0 }
}

fn lp(record: &BenchmarkRecord) -> Bars {
    let stem = |name: &str| name.split('.').next().unwrap_or_default().to_owned();
    let mut rows: Vec<BarRow> = Vec::new();
    for metric in record.metrics.iter().filter(|m| m.kind == MetricKind::Lp) {
        let gap = rows.last().is_some_and(|last| stem(&last.label) != stem(&metric.name));
        rows.extend(BarRow::of(metric.name.clone(), unseen(metric), gap));
    }
    Bars { title: observed("Lp distances", record.synthetic), rows, most: 1.0 }
}

fn ablation(record: &BenchmarkRecord) -> Bars {
    // The same model on all of its descriptors, not the metric that the run is about.
    let full = record.retrained_metric().and_then(|m| BarRow::of(format!("{} (full)", m.name), unseen(m), false));
    let parts = record.ablation.iter().enumerate().filter_map(|(i, found)| {
        let label = format!("{} ({})", found.name, found.columns);
        BarRow::of(label, found.judgement(Split::UnseenMaterial, RowSet::All), i == 0)
    });
    let rows = if record.ablation.is_empty() { Vec::new() } else { full.into_iter().chain(parts).collect() };
    let title = format!("Ablation of {} by descriptors, unseen materials", record.retrained);
    Bars { title: observed(&title, record.synthetic), rows, most: 1.0 }
}

/// Losses, so that what matters most is the longest.
fn importance(record: &BenchmarkRecord) -> Bars {
    let families: BTreeSet<&str> =
        record.importance.iter().filter(|found| found.columns > 1).map(|found| found.name.as_str()).collect();
    let mut rows: Vec<BarRow> = Vec::new();
    for found in &record.importance {
        let loss = |d: Difference| (-d.difference, Interval { low: -d.interval.high, high: -d.interval.low });
        if let (Some(plcc), Some(srocc)) = (found.plcc_change.map(loss), found.srocc_change.map(loss)) {
            let is_family = families.contains(found.name.as_str());
            let label = if is_family { format!("{} ({})", found.name, found.columns) } else { found.name.clone() };
            let gap = !is_family && rows.len() == families.len();
            rows.push(BarRow { label, bars: [plcc, srocc], gap });
        }
    }
    let most =
        rows.iter().flat_map(|row| row.bars).map(|(value, interval)| interval.high.max(value)).fold(0.05, f64::max);
    let title = format!("Loss of agreement of {} when descriptors are exchanged", record.retrained);
    let title = observed(&title, record.synthetic);
    Bars { title, rows, most: (most * 20.0).ceil() / 20.0 }
}

const BARS_TOP: f64 = 92.0;
/// More rows than this are drawn closer together.
const ROOMY: usize = 16;

impl Bars {
    /// Heights of a bar, and of the space between rows.
    fn heights(&self) -> (f64, f64) {
        if self.rows.len() > ROOMY { (9.0, 5.0) } else { (13.0, 8.0) }
    }

    fn bottom(&self) -> f64 {
        let (bar, space) = self.heights();
        let row = |r: &BarRow| 2.0 * bar + space + if r.gap { 2.0 * space } else { 0.0 };
        BARS_TOP + self.rows.iter().map(row).sum::<f64>()
    }

    fn step(&self) -> f64 {
        if self.most > 0.5 { 0.2 } else { 0.05 }
    }

    fn axis(&self) -> Result<Axis, String> {
        let widths: Vec<f64> = self.rows.iter().map(|r| marks::width(&r.label, TEXT)).collect::<Result<_, _>>()?;
        let margin = widths.iter().fold(40.0f64, |a, &b| a.max(b)) + 36.0;
        let lowest = self.rows.iter().flat_map(|r| r.bars).map(|b| b.1.low.min(b.0)).fold(0.0, f64::min);
        let step = self.step();
        Ok(Axis {
            data: ((lowest / step).floor() * step, self.most),
            pixels: (margin.min(420.0), f64::from(WIDTH) - 80.0),
        })
    }
}

impl Picture for Bars {
    fn size(&self) -> (u32, u32) {
        (WIDTH, (self.bottom() + 40.0).ceil() as u32)
    }

    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>) -> Drawn {
        let (x, bottom, (bar, space)) = (self.axis()?, self.bottom(), self.heights());
        canvas.words(&self.title, (20.0, 24.0), TITLE, Anchor::Left)?;
        for (i, (name, colour)) in [("PLCC", BLUE), ("SROCC", ORANGE)].into_iter().enumerate() {
            let left = x.pixels.0 + 120.0 * i as f64;
            canvas.bar((left, 58.0 - bar / 2.0), (left + 24.0, 58.0 + bar / 2.0), colour, i == 1)?;
            canvas.words(name, (left + 32.0, 58.0), TEXT, Anchor::Left)?;
        }
        let digits = if self.most > 0.5 { 1 } else { 2 };
        for tick in x.ticks(self.step()) {
            canvas.line((x.at(tick), BARS_TOP - 10.0), (x.at(tick), bottom), FAINT, 1.0)?;
            canvas.words(&format!("{:.digits$}", tick + 0.0), (x.at(tick), bottom + 16.0), TEXT, Anchor::Middle)?;
        }
        let mut top = BARS_TOP;
        for row in &self.rows {
            top += if row.gap { 2.0 * space } else { 0.0 };
            canvas.words(&row.label, (x.pixels.0 - 12.0, top + bar), TEXT, Anchor::Right)?;
            for (i, ((value, interval), colour)) in row.bars.into_iter().zip([BLUE, ORANGE]).enumerate() {
                let (y, middle) = (top + bar * i as f64, top + bar * (i as f64 + 0.5));
                canvas.bar((x.at(0.0), y), (x.at(value), y + bar - 1.0), colour, i == 1)?;
                canvas.line((x.at(interval.low), middle), (x.at(interval.high), middle), INK, 1.5)?;
                for end in [interval.low, interval.high] {
                    canvas.line((x.at(end), middle - bar / 3.0), (x.at(end), middle + bar / 3.0), INK, 1.5)?;
                }
                let right = x.at(interval.high.max(value).max(0.0)) + 8.0;
                canvas.words(
                    &format!("{value:.0$}", digits + 1),
                    (right, middle),
                    bar.min(12.0) + 1.0,
                    Anchor::Left,
                )?;
            }
            top += 2.0 * bar + space;
        }
        canvas.line((x.at(0.0), BARS_TOP - 10.0), (x.at(0.0), bottom), INK, 1.0)
    }
}

/// Errors of each material on a line of its own.
struct Strips<'a> {
    title: String,
    methods: Vec<&'a str>,
    /// Name, and (method, error) of its rows; the largest errors first.
    materials: Vec<(&'a str, Vec<(usize, f64)>)>,
    scale: RatingScale,
}

impl<'a> Strips<'a> {
    fn of(record: &'a BenchmarkRecord) -> Self {
        let subject = tables::subject(record);
        let methods = methods(&record.predictions);
        let errors = |material: &str| -> Vec<(usize, f64)> {
            let rows = record.predictions.iter().filter(|p| p.material == material);
            rows.filter_map(|p| Some((methods.iter().position(|m| *m == p.method)?, p.predicted.get(subject)? - p.mos)))
                .collect()
        };
        let materials: Vec<(&str, Vec<(usize, f64)>)> = record
            .residuals
            .iter()
            .take(MOST_MATERIALS)
            .map(|r| (r.material.as_str(), errors(&r.material)))
            .filter(|(_, errors)| !errors.is_empty())
            .collect();
        let words = format!("Largest errors: {} of {}", materials.len(), counted(record.residuals.len(), "material"));
        Self { title: observed(&words, record.synthetic), methods, materials, scale: record.scale }
    }
}

const STRIP: f64 = 22.0;
const STRIPS_TOP: f64 = 76.0;

impl Picture for Strips<'_> {
    fn size(&self) -> (u32, u32) {
        let legend = 26.0 * self.methods.len() as f64;
        let bottom = STRIPS_TOP + (STRIP * self.materials.len() as f64).max(legend);
        (WIDTH, (bottom + 60.0).ceil() as u32)
    }

    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>) -> Drawn {
        let errors = self.materials.iter().flat_map(|m| &m.1);
        let grade = self.scale.unit().abs();
        let reach = (errors.fold(grade, |a, e| a.max(e.1.abs())) / grade * 2.0).ceil() / 2.0 * grade;
        let widths: Vec<f64> = self.materials.iter().map(|m| marks::width(m.0, TEXT)).collect::<Result<_, _>>()?;
        let margin = widths.iter().fold(40.0f64, |a, &b| a.max(b)) + 36.0;
        let x = Axis { data: (-reach, reach), pixels: (margin.min(360.0), 690.0) };
        let bottom = STRIPS_TOP + STRIP * self.materials.len() as f64;
        canvas.words(&self.title, (20.0, 24.0), TITLE, Anchor::Left)?;
        canvas.words("predicted minus rated MOS", (x.at(0.0), bottom + 42.0), TEXT, Anchor::Middle)?;
        let step = match self.scale.is_grades() {
            true if reach > 2.0 => 1.0,
            true => 0.5,
            false => round_step(reach),
        };
        for tick in x.ticks(step) {
            let colour = if tick == 0.0 { INK } else { FAINT };
            canvas.line((x.at(tick), STRIPS_TOP - 16.0), (x.at(tick), bottom), colour, 1.0)?;
            canvas.words(&shown(tick), (x.at(tick), bottom + 16.0), TEXT, Anchor::Middle)?;
        }
        for (i, (material, errors)) in self.materials.iter().enumerate() {
            let y = STRIPS_TOP + STRIP * i as f64;
            canvas.words(material, (x.pixels.0 - 12.0, y), TEXT, Anchor::Right)?;
            canvas.line((x.pixels.0, y), (x.pixels.1, y), FAINT, 1.0)?;
            for &(method, error) in errors {
                canvas.mark(method, (x.at(error), y), 5.0)?;
            }
        }
        legend(canvas, &self.methods, 716.0, STRIPS_TOP)
    }
}
