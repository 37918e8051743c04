//! The figures of a study's ratings: how much was rated, box plots of mean opinion scores, one illumination against the other.

use super::marks::{self, Anchor, BLUE, Canvas, Drawn, FAINT, INK, ORANGE, Picture};
use super::{Axis, Square, TEXT, TITLE, WIDTH, drawn, observed, round_step, scored, shown, task};
use crate::panel::record::{BoxSet, ManifoldCorrelation, NamedBox, StudyRecord};
use crate::panel::{BY_MODEL, BY_MODEL_AND_TYPE, BoxPlot};
use crate::report::study::manifold;
use crate::report::{Figure, ReportError};
use plotters::prelude::DrawingBackend;
use std::collections::{BTreeMap, BTreeSet};
use vernis_metric::math::rating_scale::RatingScale;

/// The figure of the samples of a manifold.
const MANIFOLD_FIGURE: &str = "mos-by-manifold-step";

/// File name of a figure, title of its box plots in the record, caption.
const BOXES: [(&str, &str, &str); 8] = [
    ("mos-by-type", "Approximations by material type", "Mean opinion scores of the approximations by type of material"),
    (
        "mos-of-references-by-type",
        "Hidden references by material type",
        "Mean opinion scores of the hidden references by type of material",
    ),
    ("mos-by-method", "By method", "Mean opinion scores by approximation method"),
    (
        "mos-by-method-and-type",
        "By method and material type",
        "Mean opinion scores by approximation method and type of material",
    ),
    (
        "mos-by-model",
        BY_MODEL,
        "Mean opinion scores by model; of several fits of a model to a material, the one with the best score",
    ),
    (
        "mos-by-model-and-type",
        BY_MODEL_AND_TYPE,
        "Mean opinion scores by model and type of material, the better of several fits",
    ),
    (
        "mos-by-light-and-type",
        "By illumination and material type, of what was rated under both",
        "Mean opinion scores by illumination and type of material, for stimuli rated under both illuminations",
    ),
    (
        MANIFOLD_FIGURE,
        "By step along the manifold",
        "Mean opinion scores of samples of a manifold of BRDFs, by the step from the reference",
    ),
];

/// Every figure that `record` has the data for.
///
/// # Errors
/// [`ReportError::Figure`].
pub fn all(record: &StudyRecord) -> Result<Vec<Figure>, ReportError> {
    let mut figures = Vec::new();
    let counts = Counts::of(record);
    if !counts.rows.is_empty() {
        let caption = "Number of materials on which each approximation method was rated.".to_owned();
        figures.push(task("methods", caption, counts));
    }
    for (name, title, caption) in BOXES {
        let Some(set) = record.boxes.iter().find(|set| set.title == title) else { continue };
        let mut words = boxed(caption);
        words.extend(set.note.iter().map(|note| format!(" {note}.")));
        words.extend(correlation(record, name).map(|found| format!(" {}.", manifold(found))));
        figures.push(task(name, words, Boxes::of(record, set, Of::Mos)));
        let widths = match name {
            "mos-by-type" => ("interval-widths", "mean opinion scores by type of material"),
            "mos-of-references-by-type" => {
                ("interval-widths-of-references", "mean opinion scores of the hidden references by type of material")
            }
            _ => continue,
        };
        if set.boxes.iter().any(|b| b.interval_width.is_some()) {
            let caption = boxed(&format!("Widths of the 95 % intervals of the {}", widths.1));
            figures.push(task(widths.0, caption, Boxes::of(record, set, Of::IntervalWidth)));
        }
    }
    if let Some(lights) = Lights::of(record) {
        let caption = format!(
            "Mean opinion scores under {} against those under {}, for stimuli rated under both; on the diagonal the \
             illumination makes no difference. One mark per approximation, by method.",
            lights.names[1], lights.names[0]
        );
        figures.push(task("illuminations", caption, lights));
    }
    drawn(figures)
}

/// What of the ratings cannot be drawn, and why: one sentence a figure.
pub fn missing(record: &StudyRecord) -> Vec<String> {
    let drawn = |title: &str| record.boxes.iter().any(|set| set.title == title);
    let mut missing = Vec::new();
    for (_, title, caption) in BOXES {
        if !drawn(title) {
            let why = match title {
                BY_MODEL | BY_MODEL_AND_TYPE => {
                    "no model that was fitted to every material was fitted in several ways, or the types of the materials are not \
                     known"
                }
                "Hidden references by material type" => {
                    "no hidden reference was rated, or the types of the materials are not known"
                }
                "By step along the manifold" => "no rated candidate is a manifold sample",
                "By illumination and material type, of what was rated under both" => {
                    "nothing was rated under two illuminations"
                }
                _ => "the study does not say what type its materials are",
            };
            missing.push(format!("{caption}: {why}."));
        }
    }
    let widths = record.boxes.iter().flat_map(|set| &set.boxes).any(|b| b.interval_width.is_some());
    if !widths {
        missing
            .push("Widths of the intervals of the mean opinion scores: the individual ratings are missing.".to_owned());
    }
    if record.illumination.is_none() {
        missing.push("One illumination against the other: nothing was rated under two illuminations.".to_owned());
    }
    missing
}

/// What the figure of the manifold's steps also tells.
fn correlation<'a>(record: &'a StudyRecord, figure: &str) -> Option<&'a ManifoldCorrelation> {
    record.manifold.as_ref().filter(|_| figure == MANIFOLD_FIGURE)
}

fn boxed(what: &str) -> String {
    format!(
        "{what}: median, quartiles, whiskers to the last value within 1.5 interquartile ranges, and outliers; a diamond \
         marks the mean, the bar through it its 95 % interval from a bootstrap by material. In brackets: the number of stimuli."
    )
}

/// One bar a method.
struct Counts {
    title: String,
    /// Method and number of materials; the most first.
    rows: Vec<(String, usize)>,
}

impl Counts {
    fn of(record: &StudyRecord) -> Self {
        let mut materials: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
        for rated in &record.opinions {
            materials.entry(&rated.stimulus.method).or_default().insert(&rated.stimulus.material);
        }
        let mut rows: Vec<(String, usize)> = materials.into_iter().map(|(m, of)| (m.to_owned(), of.len())).collect();
        rows.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        Self { title: observed("Materials rated, by approximation method", record.synthetic), rows }
    }
}

const ROW: f64 = 28.0;
const TOP: f64 = 64.0;

/// The left end of the axis beside the widest of some labels.
fn margin<'a>(labels: impl Iterator<Item = &'a str>) -> Result<f64, String> {
    let widths: Vec<f64> = labels.map(|label| marks::width(label, TEXT)).collect::<Result<_, _>>()?;
    Ok((widths.into_iter().fold(40.0, f64::max) + 36.0).min(460.0))
}

impl Picture for Counts {
    fn size(&self) -> (u32, u32) {
        (WIDTH, (TOP + ROW * self.rows.len() as f64 + 20.0) as u32)
    }

    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>) -> Drawn {
        let most = self.rows.iter().map(|r| r.1).max().unwrap_or(1) as f64;
        let left = margin(self.rows.iter().map(|r| r.0.as_str()))?;
        let x = Axis { data: (0.0, most), pixels: (left, f64::from(WIDTH) - 80.0) };
        canvas.words(&self.title, (20.0, 24.0), TITLE, Anchor::Left)?;
        for (i, (method, count)) in self.rows.iter().enumerate() {
            let y = TOP + ROW * (i as f64 + 0.5);
            canvas.words(method, (left - 12.0, y), TEXT, Anchor::Right)?;
            canvas.bar((x.at(0.0), y - 9.0), (x.at(*count as f64), y + 9.0), BLUE, false)?;
            canvas.words(&count.to_string(), (x.at(*count as f64) + 8.0, y), TEXT, Anchor::Left)?;
        }
        Ok(())
    }
}

/// What is boxed.
#[derive(Clone, Copy, PartialEq)]
enum Of {
    Mos,
    IntervalWidth,
}

/// Horizontal box plots, one a row.
struct Boxes<'a> {
    title: String,
    of: Of,
    scale: RatingScale,
    rows: Vec<(String, &'a NamedBox, &'a BoxPlot)>,
    /// Below the axis.
    words: String,
}

impl<'a> Boxes<'a> {
    fn of(record: &StudyRecord, set: &'a BoxSet, of: Of) -> Self {
        let plot = |named: &'a NamedBox| match of {
            Of::Mos => Some(&named.mos),
            Of::IntervalWidth => named.interval_width.as_ref(),
        };
        let row = |named: &'a NamedBox| {
            let plot = plot(named)?;
            Some((format!("{} ({})", named.levels.join(", "), plot.n), named, plot))
        };
        let mut rows: Vec<_> = set.boxes.iter().filter_map(row).collect();
        // Methods by their scores; what has an order or two levels a factor keeps it.
        if set.factors == ["method"] {
            let quality = |plot: &BoxPlot| record.scale.direction() * plot.median;
            rows.sort_by(|a, b| quality(b.2).total_cmp(&quality(a.2)).then_with(|| a.0.cmp(&b.0)));
        }
        let what = match of {
            Of::Mos => "Mean opinion scores",
            Of::IntervalWidth => "Widths of 95 % intervals of mean opinion scores",
        };
        let factors = set.factors.join(" and ");
        let title = if factors.is_empty() { what.to_owned() } else { format!("{what} by {factors}") };
        let of_references = set.title.starts_with("Hidden references");
        let title = if of_references { format!("{title}, hidden references") } else { title };
        let words = match &record.manifold {
            Some(found) if set.factors == ["step"] => {
                format!(
                    "Pearson {:.3}, Spearman {:.3} with the distance (i/{})^5",
                    found.pearson, found.spearman, found.steps
                )
            }
            _ => String::new(),
        };
        Self { title: observed(&title, record.synthetic), of, scale: record.scale, rows, words }
    }

    fn range(&self) -> (f64, f64) {
        match self.of {
            Of::Mos => (self.scale.low(), self.scale.high()),
            Of::IntervalWidth => {
                let ends = self.rows.iter().flat_map(|r| r.2.outliers.iter().chain(&r.2.whiskers));
                let grade = self.scale.unit().abs();
                (0.0, (ends.copied().fold(0.1 * grade, f64::max) / grade * 5.0).ceil() / 5.0 * grade)
            }
        }
    }
}

impl Picture for Boxes<'_> {
    fn size(&self) -> (u32, u32) {
        (WIDTH, (TOP + ROW * self.rows.len() as f64 + 66.0) as u32)
    }

    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>) -> Drawn {
        let left = margin(self.rows.iter().map(|r| r.0.as_str()))?;
        let x = Axis { data: self.range(), pixels: (left, f64::from(WIDTH) - 40.0) };
        let bottom = TOP + ROW * self.rows.len() as f64;
        canvas.words(&self.title, (20.0, 24.0), TITLE, Anchor::Left)?;
        let step = match self.of {
            Of::Mos => round_step(x.data.1 - x.data.0),
            Of::IntervalWidth if self.scale.is_grades() => 0.2,
            Of::IntervalWidth => round_step(x.data.1),
        };
        for tick in x.ticks(step) {
            canvas.line((x.at(tick), TOP - 6.0), (x.at(tick), bottom), FAINT, 1.0)?;
            let widths = self.of == Of::IntervalWidth && self.scale.is_grades();
            let label = if widths { format!("{:.1}", tick + 0.0) } else { shown(tick) };
            canvas.words(&label, (x.at(tick), bottom + 18.0), TEXT, Anchor::Middle)?;
        }
        canvas.words(&scored(self.scale), (x.pixels.1, bottom + 44.0), TEXT, Anchor::Right)?;
        if !self.words.is_empty() {
            canvas.words(&self.words, (20.0, bottom + 44.0), TEXT, Anchor::Left)?;
        }
        for (i, (label, named, plot)) in self.rows.iter().enumerate() {
            let y = TOP + ROW * (i as f64 + 0.5);
            canvas.words(label, (left - 12.0, y), TEXT, Anchor::Right)?;
            let [low, high] = plot.whiskers;
            canvas.line((x.at(low), y), (x.at(high), y), INK, 1.5)?;
            for end in [low, high] {
                canvas.line((x.at(end), y - 5.0), (x.at(end), y + 5.0), INK, 1.5)?;
            }
            let [q1, q3] = plot.quartiles;
            canvas.bar((x.at(q1), y - 9.0), (x.at(q3), y + 9.0), BLUE, true)?;
            canvas.line((x.at(plot.median), y - 9.0), (x.at(plot.median), y + 9.0), INK, 3.0)?;
            for outlier in &plot.outliers {
                canvas.ring((x.at(*outlier), y), 3.5)?;
            }
            if self.of == Of::Mos {
                if let Some(interval) = named.mean_interval {
                    canvas.line((x.at(interval.low), y), (x.at(interval.high), y), ORANGE, 3.0)?;
                }
                canvas.diamond((x.at(named.mean), y), 5.0)?;
            }
        }
        Ok(())
    }
}

/// Scores under two illuminations.
struct Lights<'a> {
    title: String,
    names: [&'a str; 2],
    scale: RatingScale,
    methods: Vec<&'a str>,
    /// Method, score under the first, score under the second.
    points: Vec<(usize, f64, f64)>,
}

impl<'a> Lights<'a> {
    fn of(record: &'a StudyRecord) -> Option<Self> {
        let [a, b] = &record.illumination.as_ref()?.illuminations;
        let under = |light: &str| -> BTreeMap<(&'a str, &'a str), f64> {
            let rated = record.opinions.iter().filter(|r| r.stimulus.illumination.as_deref() == Some(light));
            rated.map(|r| ((r.stimulus.material.as_str(), r.stimulus.method.as_str()), r.opinion.mos)).collect()
        };
        let (first, second) = (under(a), under(b));
        let both: Vec<_> = first.iter().filter_map(|(key, x)| Some((key.1, *x, *second.get(key)?))).collect();
        let methods: Vec<&str> = both.iter().map(|p| p.0).collect::<BTreeSet<_>>().into_iter().collect();
        let place = |method: &str| methods.iter().position(|m| *m == method).unwrap_or(0);
        let points: Vec<_> = both.iter().map(|(method, x, y)| (place(method), *x, *y)).collect();
        let title = observed(&format!("Mean opinion scores under {a} and {b}"), record.synthetic);
        (!points.is_empty()).then_some(Self { title, names: [a, b], scale: record.scale, methods, points })
    }
}

impl Picture for Lights<'_> {
    fn size(&self) -> (u32, u32) {
        (WIDTH, (110.0 + 26.0 * self.methods.len() as f64).max(740.0) as u32)
    }

    fn draw<B: DrawingBackend>(&self, canvas: &Canvas<B>) -> Drawn {
        Square {
            title: &self.title,
            x_label: &format!("MOS under {}", self.names[0]),
            y_label: &format!("MOS under {}", self.names[1]),
            range: (self.scale.low(), self.scale.high()),
            step_of: (self.scale.low(), self.scale.high()),
            methods: &self.methods,
            points: &self.points,
        }
        .draw(canvas)
    }
}
