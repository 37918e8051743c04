//! How do metrics follow one parameter of a material, and what does a fit that minimises them see?
//!
//! * **Sweeps.** A plastic, a metal and a fabric ([`surface`]) are compared with themselves, one parameter changed: roughness,
//!   brightness, the share of the specular part, a second lobe, hue. A distance should grow on the way out from the reference. Its
//!   largest fall is the verdict, in the unit of the metric.
//! * **Landscapes.** What a fit minimises ([`PreparedMetric::loss`]) in fine steps near the reference, and on the way from a wrong
//!   start to a fit, along which all parameters of a model change together. A smooth loss with no hollow leads a search to its
//!   minimum.
//! * **Odd pairs.** Mirrors, blacks, metals of other colours, turned hues: what each metric says of them.
//!
//! Nothing is drawn by chance; the same bytes whatever the number of threads.
//! Cost: with M metrics and the defaults about 4,000 M evaluations.

mod pairs;
pub mod record;
mod shape;
pub mod surface;

pub use record::LandscapeRecord;

use super::ExperimentError;
use rayon::prelude::*;
use record::{Course, Fall, Line, MetricNote, Sweep, Swept};
use shape::{hollow, largest_bend, largest_fall, lowest};
use std::sync::Arc;
use surface::{MATERIALS, Material, Parameter, Surface};
use vernis_metric::brdf::Brdf;
use vernis_metric::brdf::models::AnalyticBrdf;
use vernis_metric::fit::{Fitting, Space};
use vernis_metric::io::{Count, Observer, Progress};
use vernis_metric::metric::registry::Registry;
use vernis_metric::metric::{Metric, MetricError, PreparedMetric};

/// The unit of metrics that were learned from ratings.
pub const MOS: &str = "MOS";
/// The metrics that are compared where none is named: those of these that the registry has.
pub const METRICS: [&str; 4] = ["vernis", "vernis-loss", "vernis-1", FITTED_WITH];
/// The name of the line from a wrong start to a fit.
pub const FROM_START: &str = "from a wrong start";
/// How far a distance may fall on the way out from the reference, MOS.
pub const ALLOWED: f64 = 0.05;
/// The same where the hue turns, MOS.
pub const ALLOWED_HUE: f64 = 0.15;

/// The model of the fit.
const MODEL: &str = "ggx";
/// The metric that the fit minimises: one end of the line must be the same for all metrics.
const FITTED_WITH: &str = "D4.Cl.CR";
/// Weight of the second lobe of what is fitted, which the model does not have: the fit is good and not perfect.
const FITTED_SECOND: f64 = 0.3;
/// Candidates of a sweep beyond what people rated, as a share of those within.
const BEYOND: usize = 2;

/// How finely metrics are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LandscapeOptions {
    /// Candidates of a sweep between the reference and the end of what people rated, in each direction; at least 2.
    pub points: usize,
    /// Points of a landscape from one end to the other; odd, so that the reference is one of them, and at least 5.
    pub steps: usize,
}

impl Default for LandscapeOptions {
    fn default() -> Self {
        Self { points: 12, steps: 201 }
    }
}

/// Those of [`METRICS`] that `registry` has.
///
/// # Errors
/// [`ExperimentError::MetricNamed`] if it has none of them.
pub fn default_metrics(registry: &Registry) -> Result<Vec<Arc<dyn Metric>>, ExperimentError> {
    let known: Vec<_> = METRICS.iter().filter_map(|name| registry.get(name).ok()).collect();
    if known.is_empty() {
        return registry.resolve(METRICS[0]).map_err(|e| named(METRICS[0], e));
    }
    Ok(known)
}

/// Sweeps, landscapes and odd pairs of `metrics`.
///
/// # Errors
/// [`ExperimentError::Setting`] where `options` are out of bounds or there is no metric; a metric without a distance for a pair of a
/// sweep or a landscape; a fit that fails.
pub fn landscape(
    metrics: &[Arc<dyn Metric>],
    options: &LandscapeOptions,
    progress: Observer<'_>,
) -> Result<LandscapeRecord, ExperimentError> {
    let setting = |what, found, allowed| Err(ExperimentError::Setting { what, found, allowed });
    let LandscapeOptions { points, steps } = *options;
    if steps < 5 || steps % 2 == 0 {
        return setting("the number of steps of a landscape", steps, "an odd number of at least 5");
    }
    let sweeps = sweeps(metrics, points, progress)?;
    Ok(LandscapeRecord {
        metrics: metrics.iter().map(note).collect(),
        points,
        steps,
        sweeps,
        lines: lines(metrics, steps, progress)?,
        pairs: pairs::all(metrics),
    })
}

/// The sweeps alone, by material, then by parameter.
///
/// # Errors
/// Those of [`landscape`].
pub fn sweeps(
    metrics: &[Arc<dyn Metric>],
    points: usize,
    progress: Observer<'_>,
) -> Result<Vec<Sweep>, ExperimentError> {
    let setting = |what, found, allowed| Err(ExperimentError::Setting { what, found, allowed });
    if metrics.is_empty() {
        return setting("the number of metrics", 0, "at least 1");
    }
    if points < 2 {
        return setting("the number of points of a sweep", points, "at least 2");
    }
    let all: Vec<(&Material, Parameter)> =
        MATERIALS.iter().flat_map(|material| Parameter::ALL.map(|parameter| (material, parameter))).collect();
    let count = Counter::new("sweeps", all.len(), progress);
    let sweep = |(material, parameter): (&Material, Parameter)| {
        let found = sweep(metrics, material, parameter, points);
        count.one();
        found
    };
    all.into_iter().map(sweep).collect()
}

fn sweep(
    metrics: &[Arc<dyn Metric>],
    material: &Material,
    parameter: Parameter,
    points: usize,
) -> Result<Sweep, ExperimentError> {
    let span = parameter.span(material);
    let outwards = |rated: f64, whole: f64| -> Vec<f64> {
        let within = (rated != span.reference).then(|| span.steps(span.reference, rated, points));
        let beyond = (whole != rated).then(|| span.steps(rated, whole, points.div_ceil(BEYOND)));
        within.into_iter().flatten().chain(beyond.into_iter().flatten()).collect()
    };
    let mut values = outwards(span.rated.0, span.whole.0);
    values.reverse();
    let reference = values.len();
    values.push(span.reference);
    values.extend(outwards(span.rated.1, span.whole.1));
    let name = parameter.name(material);
    let surfaces: Vec<Surface> = values.iter().map(|value| material.with(parameter, *value)).collect();
    let candidates: Vec<&dyn Brdf> = surfaces.iter().map(|surface| surface as &dyn Brdf).collect();
    let label = |i: usize| format!("{}, {name} {}", material.name, values[i]);
    let pairs = Pairs { reference: &material.reference(), name: material.name, candidates: &candidates, label: &label };
    let swept = |metric: &Arc<dyn Metric>| {
        let distances = pairs.ask(metric, |prepared, candidate| prepared.distance(candidate))?;
        let fall = |way: &[usize]| {
            let rated = way.iter().filter(|i| (span.rated.0..=span.rated.1).contains(&values[**i]));
            let fall = |way: &mut dyn Iterator<Item = &usize>| largest_fall(way.map(|i| distances[*i]));
            Fall { rated: fall(&mut { rated }), whole: fall(&mut way.iter()) }
        };
        let down: Vec<usize> = (0..=reference).rev().collect();
        let up: Vec<usize> = (reference..values.len()).collect();
        let [down, up] = [down, up].map(|way| (way.len() > 1).then(|| fall(&way)));
        Ok(Swept { distances, down, up })
    };
    let of_metric = metrics.iter().map(swept).collect::<Result<_, ExperimentError>>()?;
    Ok(Sweep {
        material: material.name.to_owned(),
        parameter: name.to_owned(),
        unit: parameter.unit().to_owned(),
        reference: span.reference,
        rated: span.rated,
        logarithmic: span.logarithmic,
        allowed: if parameter == Parameter::Hue { ALLOWED_HUE } else { ALLOWED },
        values,
        of_metric,
    })
}

fn lines(metrics: &[Arc<dyn Metric>], steps: usize, progress: Observer<'_>) -> Result<Vec<Line>, ExperimentError> {
    let count = Counter::new("landscapes", MATERIALS.len() * (Parameter::ALL.len() + 1), progress);
    let mut found = Vec::new();
    for material in &MATERIALS {
        for parameter in Parameter::ALL {
            found.push(near(metrics, material, parameter, steps)?);
            count.one();
        }
        found.push(from_start(metrics, material, steps)?);
        count.one();
    }
    Ok(found)
}

/// The landscape of one parameter near the reference.
fn near(
    metrics: &[Arc<dyn Metric>],
    material: &Material,
    parameter: Parameter,
    steps: usize,
) -> Result<Line, ExperimentError> {
    let span = parameter.span(material);
    let sides = [span.near.0, span.near.1].map(|end| end != span.reference);
    let each = (steps - 1) / sides.iter().filter(|side| **side).count().max(1);
    let outwards = |end: f64| (end != span.reference).then(|| span.steps(span.reference, end, each));
    let mut values: Vec<f64> = outwards(span.near.0).into_iter().flatten().collect();
    values.reverse();
    let reference = values.len();
    values.push(span.reference);
    values.extend(outwards(span.near.1).into_iter().flatten());
    let surfaces: Vec<Surface> = values.iter().map(|value| material.with(parameter, *value)).collect();
    let candidates: Vec<&dyn Brdf> = surfaces.iter().map(|surface| surface as &dyn Brdf).collect();
    let name = parameter.name(material);
    let line = Line {
        material: material.name.to_owned(),
        name: name.to_owned(),
        unit: parameter.unit().to_owned(),
        logarithmic: span.logarithmic,
        reference,
        values,
        of_metric: Vec::new(),
    };
    courses(metrics, &material.reference(), &candidates, line)
}

/// The landscape on the way from the start of a model to its fit, straight in the coordinates of a search. What is fitted has a second
/// lobe, which the model has not.
fn from_start(metrics: &[Arc<dyn Metric>], material: &Material, steps: usize) -> Result<Line, ExperimentError> {
    let reference = Surface { second: FITTED_SECOND, ..material.reference() };
    let failed = |source| ExperimentError::Fit {
        material: material.name.to_owned(),
        model: MODEL.to_owned(),
        loss: FITTED_WITH,
        source: Box::new(source),
    };
    let metric =
        Registry::standard().and_then(|registry| registry.get(FITTED_WITH)).map_err(|e| named(FITTED_WITH, e))?;
    let fitted = Fitting::new(MODEL, &*metric).run(&reference, &|_, _| ()).map_err(failed)?;
    let values: Vec<f64> = (0..steps).map(|i| i as f64 / (steps - 1) as f64).collect();
    let space = Space::of(MODEL).map_err(failed)?;
    let (from, to) = (space.scaled(&fitted.model.parameters()), space.scaled(&space.start()));
    let mixture = |t: &f64| {
        let u: Vec<f64> = from.iter().zip(&to).map(|(from, to)| from + t * (to - from)).collect();
        space.build(&space.parameters(&u)).map_err(failed)
    };
    let models: Vec<Arc<dyn AnalyticBrdf>> = values.iter().map(mixture).collect::<Result<_, _>>()?;
    let candidates: Vec<&dyn Brdf> = models.iter().map(|model| &**model as &dyn Brdf).collect();
    let line = Line {
        material: material.name.to_owned(),
        name: FROM_START.to_owned(),
        unit: "1".to_owned(),
        logarithmic: false,
        reference: 0,
        values,
        of_metric: Vec::new(),
    };
    courses(metrics, &reference, &candidates, line)
}

/// `line` with what each metric says of its candidates.
fn courses(
    metrics: &[Arc<dyn Metric>],
    reference: &dyn Brdf,
    candidates: &[&dyn Brdf],
    line: Line,
) -> Result<Line, ExperimentError> {
    let label = |i: usize| format!("{}, {} {}", line.material, line.name, line.values[i]);
    let pairs = Pairs { reference, name: &line.material, candidates, label: &label };
    // The length of a line is 1: slopes are told by that length.
    let step = 1.0 / (line.values.len().saturating_sub(1).max(1)) as f64;
    let course = |metric: &Arc<dyn Metric>| {
        let losses = pairs.ask(metric, |prepared, candidate| prepared.loss(candidate))?;
        let at_end = if line.reference + 1 == losses.len() { 0 } else { losses.len() - 1 };
        let (end, lowest) = (losses[at_end], lowest(&losses).unwrap_or(line.reference));
        let share = |x: f64| (end > 0.0).then(|| x / end);
        Ok(Course {
            end,
            lowest_at: line.values[lowest],
            hollow: share(hollow(&losses)),
            bend: share(largest_bend(&losses, step, &[line.reference, lowest])),
            losses,
        })
    };
    let of_metric = metrics.iter().map(course).collect::<Result<_, ExperimentError>>()?;
    Ok(Line { of_metric, ..line })
}

/// A reference and its candidates, and what errors call them.
struct Pairs<'a> {
    reference: &'a dyn Brdf,
    name: &'a str,
    candidates: &'a [&'a dyn Brdf],
    label: &'a (dyn Fn(usize) -> String + Sync),
}

impl Pairs<'_> {
    /// What `metric` says of each candidate, in order.
    fn ask(
        &self,
        metric: &Arc<dyn Metric>,
        question: impl Fn(&dyn PreparedMetric, &dyn Brdf) -> Result<f64, MetricError> + Sync,
    ) -> Result<Vec<f64>, ExperimentError> {
        let failed = |candidate: String, source| ExperimentError::Metric {
            reference: format!("{}, {}", metric.name(), self.name),
            candidate,
            source: Box::new(source),
        };
        let prepared = metric.prepare(self.reference).map_err(|e| failed("every candidate".to_owned(), e))?;
        let answer = |(i, candidate): (usize, &&dyn Brdf)| {
            question(&*prepared, *candidate).map_err(|e| failed((self.label)(i), e))
        };
        self.candidates.par_iter().enumerate().map(answer).collect()
    }
}

fn note(metric: &Arc<dyn Metric>) -> MetricNote {
    MetricNote {
        name: metric.name().to_owned(),
        version: metric.version().to_owned(),
        unit: metric.properties().unit.to_owned(),
    }
}

fn named(name: &str, source: MetricError) -> ExperimentError {
    ExperimentError::MetricNamed { name: name.to_owned(), source: Box::new(source) }
}

/// Tells how many parts of a stage are done.
struct Counter<'a> {
    stage: &'static str,
    done: Count,
    progress: Observer<'a>,
}

impl<'a> Counter<'a> {
    fn new(stage: &'static str, total: usize, progress: Observer<'a>) -> Self {
        progress(stage, Progress { done: 0, total });
        Self { stage, done: Count::of(total), progress }
    }

    fn one(&self) {
        self.done.one(|progress| (self.progress)(self.stage, progress));
    }
}
