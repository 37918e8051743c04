//! Figures, as SVG and PNG: what the pictures of a benchmark and of a study's ratings share.

pub mod benchmark;
mod marks;
pub mod spectrum;
pub mod study;

use super::{Figure, ReportError};
use marks::{Anchor, Canvas, Drawn, Picture};
use plotters::prelude::DrawingBackend;

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
