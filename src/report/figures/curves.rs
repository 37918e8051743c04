//! Curves of a benchmark: ratings over distances, agreement over the number of materials.

use super::marks::{Anchor, BLUE, Canvas, Drawn, FAINT, INK, ORANGE, Picture};
use super::{Axis, TEXT, TITLE, WIDTH, observed, round_step, scored, shown};
use crate::evaluation::agreement::Figure;
use crate::evaluation::records::{BenchmarkRecord, CurveRecord, LearningPoint, MetricKind, RowSet, Split};
use plotters::prelude::DrawingBackend;
use std::collections::BTreeSet;
use vernis_image::stimulus::{Cameras, plain};
use vernis_metric::math::rating_scale::RatingScale;

/// Panels of ratings against distances, two a row, three where there are many.
pub(super) struct Curves<'a> {
    title: String,
    methods: Vec<&'a str>,
    panels: Vec<&'a CurveRecord>,
    scale: RatingScale,
}

/// More panels than this are smaller, three a row.
const FEW: usize = 8;
const TOP: f64 = 60.0;

impl<'a> Curves<'a> {
    /// Of distances between BRDFs.
    pub fn of_brdfs(record: &'a BenchmarkRecord) -> Option<Self> {
        Self::of(record, |name| record.metric(name).is_none_or(|metric| metric.kind != MetricKind::Image))
    }

    /// Of distances between pictures by the same camera.
    pub fn of_pictures(record: &'a BenchmarkRecord) -> Option<Self> {
        Self::of(record, |name| plain(name).is_some_and(|(_, cameras)| cameras == Cameras::Same))
    }

    /// The metrics that are shown.
    pub fn metrics(&self) -> Vec<&str> {
        self.panels.iter().map(|panel| panel.metric.as_str()).collect()
    }

    fn of(record: &'a BenchmarkRecord, shown: impl Fn(&str) -> bool) -> Option<Self> {
        let all = record.curves.iter().filter(|curve| !curve.points.is_empty());
        let panels: Vec<&CurveRecord> = all.filter(|curve| shown(&curve.metric)).collect();
        let methods: BTreeSet<&str> = panels.iter().flat_map(|c| &c.points).map(|p| p.method.as_str()).collect();
        let title = observed("Ratings and distances", record.synthetic);
        (!panels.is_empty()).then_some(Self {
            title,
            methods: methods.into_iter().collect(),
            panels,
            scale: record.scale,
        })
    }

    /// Panels a row.
    fn across(&self) -> usize {
        if self.panels.len() > FEW { 3 } else { 2 }
    }

    /// Width and height of a panel.
    fn panel(&self) -> (f64, f64) {
        (f64::from(WIDTH) / self.across() as f64, if self.across() == 2 { 400.0 } else { 300.0 })
    }

    /// Height of all panels.
    fn height(&self) -> f64 {
        self.panel().1 * self.panels.len().div_ceil(self.across()) as f64
    }
}

impl Picture for Curves<'_> {
    fn size(&self) -> (u32, u32) {
        let legend = 26.0 * self.methods.len().div_ceil(3) as f64;
        (WIDTH, (TOP + self.height() + legend + 30.0) as u32)
    }

    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>) -> Drawn {
        canvas.words(&self.title, (20.0, 24.0), TITLE, Anchor::Left)?;
        let (width, height) = self.panel();
        for (i, panel) in self.panels.iter().enumerate() {
            let corner = (width * (i % self.across()) as f64, TOP + height * (i / self.across()) as f64);
            let most = panel.points.iter().map(|p| p.distance).fold(0.0, f64::max);
            let x =
                Axis { data: (0.0, most.max(f64::MIN_POSITIVE)), pixels: (corner.0 + 50.0, corner.0 + width - 20.0) };
            let range = (self.scale.low(), self.scale.high());
            let y = Axis { data: range, pixels: (corner.1 + height - 60.0, corner.1 + 30.0) };
            canvas.words(&panel.metric, (x.pixels.1, y.pixels.0 + 44.0), TEXT, Anchor::Right)?;
            canvas.words(&scored(self.scale), (corner.0 + 20.0, corner.1 + 8.0), TEXT, Anchor::Left)?;
            for tick in y.ticks(round_step(range.1 - range.0)) {
                canvas.line((x.pixels.0, y.at(tick)), (x.pixels.1, y.at(tick)), FAINT, 1.0)?;
                canvas.words(&shown(tick), (x.pixels.0 - 12.0, y.at(tick)), TEXT, Anchor::Right)?;
            }
            // Narrow panels have room for half as many numbers.
            let step = round_step(if self.across() == 2 { most } else { 2.0 * most });
            for tick in x.ticks(step) {
                canvas.line((x.at(tick), y.pixels.0), (x.at(tick), y.pixels.1), FAINT, 1.0)?;
                let digits = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
                canvas.words(&format!("{tick:.digits$}"), (x.at(tick), y.pixels.0 + 18.0), TEXT, Anchor::Middle)?;
            }
            for point in &panel.points {
                let method = self.methods.iter().position(|m| *m == point.method).unwrap_or(0);
                canvas.mark(method, (x.at(point.distance), y.at(point.mos)), 3.5)?;
            }
            let mut curve: Vec<(f64, f64)> = panel.points.iter().map(|p| (p.distance, p.mapped)).collect();
            curve.sort_by(|a, b| a.0.total_cmp(&b.0));
            for ends in curve.windows(2) {
                let [from, to] = [ends[0], ends[1]].map(|(distance, mos)| (x.at(distance), y.at(mos)));
                canvas.line(from, to, INK, 3.0)?;
            }
        }
        let third = self.methods.len().div_ceil(3);
        let top = TOP + self.height() + 12.0;
        for (i, method) in self.methods.iter().enumerate() {
            let at = (30.0 + 290.0 * (i / third) as f64, top + 26.0 * (i % third) as f64);
            canvas.mark(i, at, 6.0)?;
            canvas.words(method, (at.0 + 16.0, at.1), TEXT, Anchor::Left)?;
        }
        Ok(())
    }
}

/// Agreement over the number of groups of materials that were trained on.
pub(super) struct Learning<'a> {
    title: String,
    points: &'a [LearningPoint],
}

impl<'a> Learning<'a> {
    pub fn of(record: &'a BenchmarkRecord) -> Option<Self> {
        let title = observed(&format!("Learning curve of {}", record.retrained), record.synthetic);
        (!record.learning_curve.is_empty()).then_some(Self { title, points: &record.learning_curve })
    }
}

impl Picture for Learning<'_> {
    fn size(&self) -> (u32, u32) {
        (WIDTH, 480)
    }

    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>) -> Drawn {
        let most = self.points.iter().map(|p| p.groups).fold(1.0, f64::max);
        let found = |point: &LearningPoint, figure| {
            let judgement = point.judgement(Split::UnseenMaterial, RowSet::All)?;
            Some((judgement.agreement.get(figure)?, judgement.intervals.get(figure)?))
        };
        let figures = [(Figure::Plcc, "PLCC", BLUE, -4.0), (Figure::Srocc, "SROCC", ORANGE, 4.0)];
        let lowest = self
            .points
            .iter()
            .flat_map(|point| figures.iter().filter_map(move |f| found(point, f.0)))
            .map(|(_, interval)| interval.low)
            .fold(0.9, f64::min);
        let x = Axis { data: (0.0, most * 1.05), pixels: (70.0, 760.0) };
        let y = Axis { data: ((lowest * 10.0).floor() / 10.0, 1.0), pixels: (400.0, 70.0) };
        canvas.words(&self.title, (20.0, 24.0), TITLE, Anchor::Left)?;
        canvas.words("groups of materials trained on", (x.pixels.1, 452.0), TEXT, Anchor::Right)?;
        for tick in y.ticks(0.1) {
            canvas.line((x.pixels.0, y.at(tick)), (x.pixels.1, y.at(tick)), FAINT, 1.0)?;
            canvas.words(&format!("{tick:.1}"), (x.pixels.0 - 12.0, y.at(tick)), TEXT, Anchor::Right)?;
        }
        for tick in x.ticks(round_step(most)) {
            canvas.words(&format!("{tick:.0}"), (x.at(tick), y.pixels.0 + 20.0), TEXT, Anchor::Middle)?;
        }
        for (place, &(figure, name, colour, aside)) in figures.iter().enumerate() {
            let mut before: Option<(f64, f64)> = None;
            for point in self.points {
                let Some((value, interval)) = found(point, figure) else { continue };
                let at = (x.at(point.groups) + aside, y.at(value));
                if let Some(before) = before {
                    canvas.line(before, at, colour, 2.5)?;
                }
                canvas.line((at.0, y.at(interval.low)), (at.0, y.at(interval.high)), INK, 1.5)?;
                canvas.bar((at.0 - 5.0, at.1 - 5.0), (at.0 + 5.0, at.1 + 5.0), colour, place == 1)?;
                before = Some(at);
            }
            let top = 90.0 + 26.0 * place as f64;
            canvas.bar((780.0, top - 5.0), (790.0, top + 5.0), colour, place == 1)?;
            canvas.words(name, (800.0, top), TEXT, Anchor::Left)?;
        }
        Ok(())
    }
}
