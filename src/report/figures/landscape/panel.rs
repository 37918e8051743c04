//! Small panels of curves over one parameter, a column a material.

use super::super::marks::{Anchor, Canvas, Drawn, FAINT, INK, Picture, colour};
use super::super::{Axis, TITLE, WIDTH, round_step, shown};
use super::{Legend, SMALL};
use plotters::prelude::{DrawingBackend, RGBColor};

/// Behind values beyond what people rated.
const SHADE: RGBColor = RGBColor(240, 240, 237);
/// Outer height of a panel, and where its axes begin and end inside it.
const HEIGHT: f64 = 186.0;
const LEFT: f64 = 46.0;
const RIGHT: f64 = 22.0;
const UPPER: f64 = 28.0;
const LOWER: f64 = 30.0;
const TOP: f64 = 52.0;

/// Labels of an axis whose ticks are nearer than this would touch.
const LABEL: f64 = 40.0;

/// How curves are told apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Style {
    /// A mark at each point and a thin line.
    Marks,
    /// A line of its own width: too many points for marks.
    Lines,
}

impl Style {
    fn width(self, metric: usize) -> f64 {
        match self {
            Self::Marks => 1.2,
            Self::Lines => [3.2, 2.2, 1.4, 1.0][metric % 4],
        }
    }

    /// A sample for a legend, 26 pixels wide.
    pub fn sample<B: DrawingBackend>(self, canvas: &Canvas<B>, metric: usize, (x, y): (f64, f64)) -> Drawn {
        canvas.path(&[(x, y), (x + 26.0, y)], colour(metric), self.width(metric))?;
        if self == Self::Marks { canvas.mark(metric, (x + 13.0, y), 4.5) } else { Ok(()) }
    }
}

/// One metric in a panel.
pub(super) struct Curve {
    /// Its place in the legend.
    pub metric: usize,
    /// One number a value of the panel.
    pub values: Vec<f64>,
}

/// Curves over one parameter.
pub(super) struct Panel<'a> {
    pub title: String,
    /// Of the parameter, ascending.
    pub values: &'a [f64],
    pub logarithmic: bool,
    pub degrees: bool,
    pub reference: f64,
    /// The range that is not shaded; `None`: all of it.
    pub clear: Option<(f64, f64)>,
    pub curves: Vec<Curve>,
}

/// Panels in rows, under a title and a legend.
pub(super) struct Panels<'a> {
    pub title: String,
    pub panels: Vec<Panel<'a>>,
    pub columns: usize,
    pub style: Style,
    pub legend: Legend,
}

impl Picture for Panels<'_> {
    fn size(&self) -> (u32, u32) {
        let rows = self.panels.len().div_ceil(self.columns.max(1)) as f64;
        (WIDTH, (TOP + self.legend.height() + HEIGHT * rows + 8.0) as u32)
    }

    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>) -> Drawn {
        canvas.words(&self.title, (20.0, 24.0), TITLE, Anchor::Left)?;
        self.legend.draw(canvas, TOP - 8.0, self.style)?;
        let (columns, top) = (self.columns.max(1), TOP + self.legend.height());
        let width = f64::from(WIDTH) / columns as f64;
        for (i, panel) in self.panels.iter().enumerate() {
            let corner = (width * (i % columns) as f64, top + HEIGHT * (i / columns) as f64);
            panel.draw(canvas, corner, width, self.style)?;
        }
        Ok(())
    }
}

impl Panel<'_> {
    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>, corner: (f64, f64), width: f64, style: Style) -> Drawn {
        let place = |value: f64| if self.logarithmic { value.log10() } else { value };
        let (first, last) = (self.values[0], self.values[self.values.len() - 1]);
        let x = Axis { data: (place(first), place(last)), pixels: (corner.0 + LEFT, corner.0 + width - RIGHT) };
        let numbers = || self.curves.iter().flat_map(|curve| curve.values.iter().copied());
        let (low, high) = (numbers().fold(0.0, f64::min), numbers().fold(f64::MIN_POSITIVE, f64::max));
        let margin = 0.04 * (high - low);
        let low = if low < 0.0 { low - margin } else { 0.0 };
        let y = Axis { data: (low, high + margin), pixels: (corner.1 + HEIGHT - LOWER, corner.1 + UPPER) };
        canvas.words(&self.title, (corner.0 + LEFT, corner.1 + 13.0), SMALL, Anchor::Left)?;
        if let Some((from, to)) = self.clear {
            for (left, right) in [(first, from.max(first)), (to.min(last), last)] {
                if left < right {
                    let at = |value: f64, row: f64| (x.at(place(value)), row);
                    canvas.bar(at(left, y.pixels.1), at(right, y.pixels.0), SHADE, false)?;
                }
            }
        }
        let step = round_step(high - low);
        for tick in y.ticks(step) {
            canvas.line((x.pixels.0, y.at(tick)), (x.pixels.1, y.at(tick)), FAINT, 1.0)?;
        }
        // Every second label where they would touch.
        let sparse = y.ticks(step).count() > 6;
        for (_, tick) in y.ticks(step).enumerate().filter(|(i, _)| !sparse || i % 2 == 0) {
            canvas.words(&shown(tick), (x.pixels.0 - 8.0, y.at(tick)), SMALL, Anchor::Right)?;
        }
        let mut labelled = f64::NEG_INFINITY;
        for tick in self.ticks() {
            let at = x.at(place(tick));
            canvas.line((at, y.pixels.0), (at, y.pixels.0 + 4.0), INK, 1.0)?;
            if at - labelled >= LABEL {
                canvas.words(&shown(tick), (at, y.pixels.0 + 15.0), SMALL, Anchor::Middle)?;
                labelled = at;
            }
        }
        canvas.line((x.pixels.0, y.at(0.0)), (x.pixels.1, y.at(0.0)), INK, 1.0)?;
        let reference = x.at(place(self.reference));
        canvas.line((reference, y.pixels.1), (reference, y.pixels.0), INK, 1.0)?;
        for curve in &self.curves {
            let at = |(value, number): (&f64, &f64)| (x.at(place(*value)), y.at(*number));
            let points: Vec<(f64, f64)> = self.values.iter().zip(&curve.values).map(at).collect();
            canvas.path(&points, colour(curve.metric), style.width(curve.metric))?;
            if style == Style::Marks {
                points.iter().try_for_each(|point| canvas.mark(curve.metric, *point, 2.6))?;
            }
        }
        Ok(())
    }

    /// Up to about five round values of the parameter.
    fn ticks(&self) -> Vec<f64> {
        let (first, last) = (self.values[0], self.values[self.values.len() - 1]);
        let inside = |value: &f64| (first * (1.0 - 1e-9)..=last * (1.0 + 1e-9)).contains(value);
        if !self.logarithmic {
            let step = match self.degrees {
                true if last - first > 200.0 => 90.0,
                true => 15.0,
                false => round_step(last - first),
            };
            return Axis { data: (first, last), pixels: (0.0, 1.0) }.ticks(step).collect();
        }
        let decades = || (first.log10().floor() as i32..=last.log10().ceil() as i32).map(|power| 10f64.powi(power));
        let tens: Vec<f64> = decades().filter(inside).collect();
        if tens.len() > 1 {
            return tens;
        }
        // A narrow range: steps of 0.2, 0.5 and so on of its own.
        Axis { data: (first, last), pixels: (0.0, 1.0) }.ticks(round_step(last - first)).collect()
    }
}
