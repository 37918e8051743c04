//! Figures, as SVG and PNG: what the pictures of a benchmark, of a study's ratings and of landscapes share.

pub mod benchmark;
mod curves;
mod image_metrics;
pub mod landscape;
mod marks;
pub mod spectrum;
pub mod study;

use super::{Figure, ReportError};
use marks::{Anchor, Canvas, Drawn, FAINT, INK, Picture};
use plotters::prelude::DrawingBackend;
use rayon::prelude::*;
use vernis_metric::math::rating_scale::RatingScale;

const WIDTH: u32 = 900;
const TITLE: f64 = 22.0;
const TEXT: f64 = 18.0;
/// PNG pixels for one of the SVG.
const PNG_SCALE: u32 = 2;

fn figure(name: &'static str, caption: String, picture: &impl Picture) -> Result<Figure, ReportError> {
    let failed = |reason| ReportError::Figure { figure: name, reason };
    let (svg, png) = (marks::svg(picture).map_err(failed)?, marks::png(picture, PNG_SCALE).map_err(failed)?);
    Ok(Figure { name, caption, svg, png })
}

/// A figure that is still to be drawn.
type Task<'a> = Box<dyn FnOnce() -> Result<Figure, ReportError> + Send + 'a>;

fn task<'a>(name: &'static str, caption: String, picture: impl Picture + Send + 'a) -> Task<'a> {
    Box::new(move || figure(name, caption, &picture))
}

/// The figures of `tasks`, in their order. Most of the time goes into compressing PNG files.
fn drawn(tasks: Vec<Task<'_>>) -> Result<Vec<Figure>, ReportError> {
    tasks.into_par_iter().map(|task| task()).collect()
}

/// A linear axis from data to pixels.
#[derive(Clone, Copy)]
struct Axis {
    data: (f64, f64),
    pixels: (f64, f64),
}

impl Axis {
    fn at(&self, value: f64) -> f64 {
        let t = (value - self.data.0) / (self.data.1 - self.data.0);
        self.pixels.0 + t * (self.pixels.1 - self.pixels.0)
    }

    /// Multiples of `step` inside the data range.
    fn ticks(&self, step: f64) -> impl Iterator<Item = f64> {
        let (first, last) = ((self.data.0 / step - 1e-9).ceil() as i64, (self.data.1 / step + 1e-9).floor() as i64);
        (first..=last).map(move |i| i as f64 * step)
    }
}

/// A square plot: points with a mark by method, a diagonal, and the methods beside it.
struct Square<'a> {
    title: &'a str,
    x_label: &'a str,
    y_label: &'a str,
    range: (f64, f64),
    /// The ends of the scale, which decide the ticks.
    step_of: (f64, f64),
    methods: &'a [&'a str],
    /// Method, x, y.
    points: &'a [(usize, f64, f64)],
}

impl Square<'_> {
    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>) -> Drawn {
        let x = Axis { data: self.range, pixels: (60.0, 660.0) };
        let y = Axis { data: self.range, pixels: (680.0, 80.0) };
        canvas.words(self.title, (20.0, 24.0), TITLE, Anchor::Left)?;
        canvas.words(self.y_label, (20.0, 58.0), TEXT, Anchor::Left)?;
        canvas.words(self.x_label, (660.0, 724.0), TEXT, Anchor::Right)?;
        for tick in x.ticks(round_step(self.step_of.1 - self.step_of.0)) {
            canvas.line((x.at(tick), y.pixels.0), (x.at(tick), y.pixels.1), FAINT, 1.0)?;
            canvas.line((x.pixels.0, y.at(tick)), (x.pixels.1, y.at(tick)), FAINT, 1.0)?;
            canvas.words(&shown(tick), (x.at(tick), 698.0), TEXT, Anchor::Middle)?;
            canvas.words(&shown(tick), (48.0, y.at(tick)), TEXT, Anchor::Right)?;
        }
        canvas.line((x.pixels.0, y.pixels.0), (x.pixels.1, y.pixels.1), INK, 1.0)?;
        for &(method, at_x, at_y) in self.points {
            canvas.mark(method, (x.at(at_x), y.at(at_y)), 4.5)?;
        }
        legend(canvas, self.methods, 690.0, 90.0)
    }
}

/// 1, 2 or 5 times a power of ten, four to ten of which reach `most`.
fn round_step(most: f64) -> f64 {
    let rough = most.max(1e-9) / 4.0;
    let power = 10f64.powf(rough.log10().floor());
    power
        * if rough >= 5.0 * power {
            5.0
        } else if rough >= 2.0 * power {
            2.0
        } else {
            1.0
        }
}

/// What an axis of scores says.
fn scored(scale: RatingScale) -> String {
    if scale.is_grades() { "MOS".to_owned() } else { format!("MOS, {scale}") }
}

/// A tick without what rounding left of it.
fn shown(tick: f64) -> String {
    format!("{}", (tick * 1e9).round() / 1e9 + 0.0)
}

/// A title that says where observers were simulated.
fn observed(words: &str, synthetic: bool) -> String {
    format!("{words}{}", if synthetic { " (SYNTHETIC observers)" } else { "" })
}

fn legend<B: DrawingBackend>(canvas: &Canvas<B>, methods: &[&str], x: f64, top: f64) -> Drawn {
    for (i, method) in methods.iter().enumerate() {
        let y = top + 26.0 * i as f64;
        canvas.mark(i, (x, y), 6.0)?;
        canvas.words(method, (x + 16.0, y), TEXT, Anchor::Left)?;
    }
    Ok(())
}
