//! Distances of odd pairs, a row a pair.

use super::super::marks::{Anchor, Canvas, Drawn, FAINT, INK, Picture};
use super::super::{Axis, TITLE, WIDTH, figure, round_step, shown};
use super::panel::Style;
use super::{Legend, SMALL, axis, on_one_axis, units};
use crate::experiment::landscape::record::{Answer, LandscapeRecord, OddPair};
use crate::report::landscape::answer;
use crate::report::{Figure, ReportError};
use plotters::prelude::DrawingBackend;

const NAME: &str = "pairs";
const ROW: f64 = 26.0;
const TOP: f64 = 52.0;

pub(super) fn figure_of(record: &LandscapeRecord) -> Result<Figure, ReportError> {
    let said = |pair: &OddPair| {
        let answers =
            pair.answers.iter().zip(&record.metrics).map(|(a, metric)| format!("{} {}", metric.name, answer(a)));
        format!("{}: {}", pair.name, answers.collect::<Vec<_>>().join(", "))
    };
    let caption = format!(
        "Distances of pairs whose difference everybody can name. {} A pair that a metric refuses has no mark. In the unit of each metric: {}.",
        units(&record.metrics, "of the figure"),
        record.pairs.iter().map(said).collect::<Vec<_>>().join("; ")
    );
    let legend = Legend::of(&record.metrics).map_err(|reason| ReportError::Figure { figure: NAME, reason })?;
    let answers = |k: usize| -> Vec<Option<f64>> {
        let of = |answer: &Answer| if let Answer::Distance(d) = answer { Some(*d) } else { None };
        record.pairs.iter().map(|pair| pair.answers.get(k).and_then(of)).collect()
    };
    let all: Vec<Vec<Option<f64>>> = (0..record.metrics.len()).map(answers).collect();
    // Those without an answer hold their place with a 0 that is not drawn.
    let numbers: Vec<Vec<f64>> = all.iter().map(|m| m.iter().map(|d| d.unwrap_or(0.0)).collect()).collect();
    let scaled = on_one_axis(&record.metrics, &numbers.iter().map(|n| &n[..]).collect::<Vec<_>>());
    let marks = scaled
        .iter()
        .zip(&all)
        .enumerate()
        .flat_map(|(metric, (scaled, asked))| {
            let answered = scaled.iter().zip(asked).enumerate().filter(|(_, (_, asked))| asked.is_some());
            answered.map(move |(row, (value, _))| Mark { metric, row, value: *value })
        })
        .collect();
    let names = record.pairs.iter().map(|pair| pair.name.as_str()).collect();
    figure(NAME, caption, &Rows { names, marks, legend, unit: axis(&record.metrics) })
}

struct Mark {
    metric: usize,
    row: usize,
    value: f64,
}

struct Rows<'a> {
    names: Vec<&'a str>,
    marks: Vec<Mark>,
    legend: Legend,
    /// What the axis says.
    unit: &'static str,
}

impl Picture for Rows<'_> {
    fn size(&self) -> (u32, u32) {
        (WIDTH, (TOP + self.legend.height() + ROW * self.names.len() as f64 + 66.0) as u32)
    }

    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>) -> Drawn {
        canvas.words("Distances of odd pairs", (20.0, 24.0), TITLE, Anchor::Left)?;
        self.legend.draw(canvas, TOP - 8.0, Style::Marks)?;
        let top = TOP + self.legend.height() + 8.0;
        let bottom = top + ROW * self.names.len() as f64;
        let most = self.marks.iter().map(|mark| mark.value).fold(f64::MIN_POSITIVE, f64::max);
        let x = Axis { data: (0.0, 1.04 * most), pixels: (360.0, 870.0) };
        for tick in x.ticks(round_step(most)) {
            canvas.line((x.at(tick), top), (x.at(tick), bottom), FAINT, 1.0)?;
            canvas.words(&shown(tick), (x.at(tick), bottom + 18.0), SMALL, Anchor::Middle)?;
        }
        canvas.words(self.unit, (x.pixels.1, bottom + 40.0), SMALL, Anchor::Right)?;
        canvas.line((x.pixels.0, top), (x.pixels.0, bottom), INK, 1.0)?;
        let centre = |row: usize| top + ROW * (row as f64 + 0.5);
        for (row, name) in self.names.iter().enumerate() {
            canvas.words(name, (348.0, centre(row)), SMALL, Anchor::Right)?;
            canvas.line((x.pixels.0, centre(row)), (x.pixels.1, centre(row)), FAINT, 1.0)?;
        }
        for mark in &self.marks {
            canvas.mark(mark.metric, (x.at(mark.value), centre(mark.row)), 4.5)?;
        }
        Ok(())
    }
}
