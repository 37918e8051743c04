//! One fit from beginning to end.
//!
//! 1. The loss of the metric, and a cheaper one for the search: fewer cells for Lp, a coarser grid for metrics on graphs.
//! 2. The starts: staged, a fit under the logarithm (D9.Cl), or given parameters; further ones by rank, then by chance.
//! 3. A search from each start under the cheap loss, in parallel; the best one counts. A learned metric that starts from a fit
//!    under the logarithm is let in by degrees instead ([`Blend`]), or, for comparison, at once ([`Start::LogAtOnce`]).
//! 4. A polish under the metric itself, with steps of a hundredth: by L-BFGS where there are gradients, else by the method
//!    of the search.

use super::direct;
use super::loss::{Blend, Lattice, Loss, LpLoss, MetricLoss};
use super::objective::LossObjective;
use super::optimizer::{Improvement, Limits, Method, Outcome, StopReason, minimise};
use super::start::{Candidate, staged};
use super::{FitError, Space};
use crate::brdf::Brdf;
use crate::brdf::models::AnalyticBrdf;
use crate::io::{Observer, Progress};
use crate::math::seed;
use crate::metric::lp::{Formula, LpMetric, LpVariant};
use crate::metric::{Metric, MetricError};
use rand::Rng;
use rayon::prelude::*;
use std::any::Any;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The loss whose minimum is the start of a fit under a learned metric.
const LOG: LpVariant = LpVariant::new(Formula::D9, true, false);
/// t of the blends before the learned metric itself.
const BLENDS: [f64; 3] = [0.25, 0.5, 0.75];
/// At each of them, one part in so many of the evaluations.
const BLEND_SHARE: usize = 6;
/// First step of a search, of a blend, and of a polish, in the coordinates of [`Space`].
const STEP: f64 = 0.2;
const BLEND_STEP: f64 = 0.1;
const POLISH_STEP: f64 = 0.01;
const TOLERANCE: f64 = 1e-3;
/// Of a learned metric: a hundredth of a parameter is nothing that anybody sees.
const LEARNED_TOLERANCE: f64 = 1e-2;
const POLISH_TOLERANCE: f64 = 1e-4;
/// Evaluations of a polish: those under the whole metric are dear.
const POLISH_EVALUATIONS: usize = 8;
/// A random start moves every coordinate by up to so much.
const SCATTER: f64 = 1.0;

/// Where a fit begins.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Start {
    /// [`staged`].
    Staged,
    /// At the result of a fit under D9.Cl; a learned metric is then let in by degrees.
    Log,
    /// There as well, but a learned metric is the loss from the first step on.
    LogAtOnce,
    /// At these parameters.
    Parameters(Vec<f64>),
}

impl Start {
    /// The name that fit files use, such as `log-at-once`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Staged => "staged",
            Self::Log => "log",
            Self::LogAtOnce => "log-at-once",
            Self::Parameters(_) => "parameters",
        }
    }
}

/// What to fit and how.
#[derive(Clone)]
pub struct Fitting<'a> {
    /// The identifier of the model.
    pub model: &'a str,
    /// The loss.
    pub metric: &'a dyn Metric,
    /// `None`: at a log fit for learned metrics, staged for others.
    pub start: Option<Start>,
    /// How each start is searched.
    pub method: Method,
    /// How many starts are searched from.
    pub starts: usize,
    /// Of the random starts.
    pub seed: u64,
    /// Cells of the metric to one cell of the search, along each axis; 1 searches on the metric's own grid.
    pub coarsening: usize,
    /// For each start; `None`: 5000 for Lp, 400 for others.
    pub max_evaluations: Option<usize>,
}

/// The result of a fit.
pub struct Fitted {
    /// The model with the parameters that were found.
    pub model: Arc<dyn AnalyticBrdf>,
    /// The metric's distance at the start.
    pub value_at_start: f64,
    /// The metric's distance at the end.
    pub value: f64,
    /// How the search ended.
    pub stop: StopReason,
    /// Name of the search method, such as `lbfgs`.
    pub method: &'static str,
    /// Name of the start, see [`Start::name`].
    pub start: &'static str,
    /// Of all searches and starts; those of the polish apart.
    pub evaluations: usize,
    /// Evaluations of the polish under the metric itself.
    pub polish_evaluations: usize,
    /// Improvements of the search that won, under the loss of the search.
    pub history: Vec<Improvement>,
}

/// Where the searches begin.
struct Starts {
    candidates: Vec<Candidate>,
    /// The loss of the log fits that they are the results of.
    log: Option<LpLoss>,
}

impl<'a> Fitting<'a> {
    /// As the command line has it where nothing else is said.
    pub fn new(model: &'a str, metric: &'a dyn Metric) -> Self {
        let (start, method) = (None, Method::HookeJeeves);
        Self { model, metric, start, method, starts: 1, seed: 1, coarsening: 3, max_evaluations: None }
    }

    /// Fits the model to `reference`.
    ///
    /// A search that spends its evaluations is no error: [`Fitted::stop`] says so, and the best point so far is returned.
    ///
    /// # Errors
    /// [`FitError::UnknownModel`], [`FitError::Setting`], [`FitError::NoGradient`], [`FitError::Start`], and those of the metric.
    pub fn run(&self, reference: &dyn Brdf, observer: Observer<'_>) -> Result<Fitted, FitError> {
        self.check()?;
        if direct::is_direct(self.model) {
            return direct::fit(self.model, self.metric, reference);
        }
        let space = Space::of(self.model)?;
        let coarse = self.metric.coarser(self.coarsening);
        let search_metric = coarse.as_deref().unwrap_or(self.metric);
        let search = loss_of(search_metric, reference, self.coarsening)?;
        let evaluations = AtomicUsize::new(0);
        let Starts { candidates, log } = self.starts(&space, reference, &*search, &evaluations, observer)?;
        let first = space.build(&candidates[0].parameters)?;
        let (outcome, spent) = match (&log, self.metric.properties().rough) {
            (Some(log), true) => self.blended(&space, &candidates[0], log, &*search, observer)?,
            _ => self.search(&space, &candidates, &*search, observer)?,
        };
        let whole = match self.is_coarse(coarse.is_some()) {
            true => Some(loss_of(self.metric, reference, 1)?),
            false => None,
        };
        let whole = whole.as_deref().unwrap_or(&*search);
        let at_start = whole.value(&*first)?;
        let mut parameters = space.parameters(&outcome.x);
        let mut value = whole.value(&*space.build(&parameters)?)?;
        let mut polish_evaluations = 0;
        if self.is_coarse(coarse.is_some()) {
            let polished = self.polish(&space, &outcome.x, whole, observer)?;
            polish_evaluations = polished.evaluations;
            if polished.value < value {
                (parameters, value) = (space.parameters(&polished.x), polished.value);
            }
        }
        Ok(Fitted {
            model: space.build(&parameters)?,
            // A learned loss may be negative; its distance is not.
            value_at_start: at_start.max(0.0),
            value: value.max(0.0),
            stop: outcome.stop,
            method: self.method.name(),
            start: self.start_or_default().name(),
            evaluations: evaluations.into_inner() + spent,
            polish_evaluations,
            history: outcome.history,
        })
    }

    fn check(&self) -> Result<(), FitError> {
        let wrong = |what, found: usize, allowed: &str| {
            Err(FitError::Setting { what, found: found.to_string(), allowed: allowed.to_owned() })
        };
        if !self.metric.properties().usable_as_loss {
            return Err(FitError::Setting {
                what: "metric",
                found: self.metric.name().to_owned(),
                allowed: "a metric without jumps, and D6 has jumps".to_owned(),
            });
        }
        match (self.starts, self.coarsening, self.max_evaluations) {
            (0, _, _) | (1001.., _, _) => wrong("starts", self.starts, "1 to 1000"),
            (_, 0, _) | (_, 16.., _) => {
                wrong("grid", self.coarsening, "1 to 15 cells of the metric per cell of the search")
            }
            (_, _, Some(n @ ..10)) => wrong("max-evaluations", n, "10 or more"),
            _ => Ok(()),
        }
    }

    fn start_or_default(&self) -> Start {
        let rough = self.metric.properties().rough;
        self.start.clone().unwrap_or(if rough { Start::Log } else { Start::Staged })
    }

    /// Whether the search runs on fewer cells than the metric has.
    fn is_coarse(&self, coarse_metric: bool) -> bool {
        let lattice = lp_variant(self.metric).is_some_and(LpLoss::is_available);
        coarse_metric || (lattice && self.coarsening > 1)
    }

    fn limits(&self, step: f64) -> Limits {
        let default = if lp_variant(self.metric).is_some() { 5000 } else { 400 };
        Limits { max_evaluations: self.max_evaluations.unwrap_or(default), step, tolerance: TOLERANCE }
    }

    fn starts(
        &self,
        space: &Space,
        reference: &dyn Brdf,
        search: &dyn Loss,
        evaluations: &AtomicUsize,
        observer: Observer<'_>,
    ) -> Result<Starts, FitError> {
        let count = || {
            let done = evaluations.fetch_add(1, Ordering::Relaxed) + 1;
            observer("starts", Progress { done, total: 0 });
        };
        let lattice = || Lattice::new(reference, self.coarsening.max(3), 80);
        let mut log = None;
        let mut starts = match self.start_or_default() {
            Start::Staged => staged(space, &lattice()?, search, self.starts, &count)?,
            Start::Log | Start::LogAtOnce => {
                let loss = LpLoss::new(reference, LOG, self.coarsening.max(2))?.ok_or_else(no_log)?;
                let starts = staged(space, &lattice()?, &loss, self.starts, &count)?;
                let limits = Limits { max_evaluations: 5000, step: STEP, tolerance: TOLERANCE };
                let fit = |start: &Candidate| {
                    let objective = LossObjective::new(space, &loss, Method::HookeJeeves);
                    minimise(Method::HookeJeeves, &objective, &space.scaled(&start.parameters), limits, &|_| count())
                };
                let fitted = starts.par_iter().map(fit).collect::<Result<Vec<_>, _>>()?;
                log = Some(loss);
                fitted.into_iter().map(|o| Candidate { parameters: space.parameters(&o.x), value: o.value }).collect()
            }
            Start::Parameters(parameters) => {
                space.build(&parameters)?;
                vec![Candidate { parameters, value: 0.0 }]
            }
        };
        let mut rng = seed::stream(self.seed, "fit starts", 0);
        while starts.len() < self.starts {
            let mut u = space.scaled(&starts[0].parameters);
            u.iter_mut().for_each(|u| *u += rng.random_range(-SCATTER..SCATTER));
            u.iter_mut().zip(space.bounds()).for_each(|(u, b)| *u = u.clamp(b.0, b.1));
            starts.push(Candidate { parameters: space.parameters(&u), value: f64::INFINITY });
        }
        Ok(Starts { candidates: starts, log })
    }

    /// The best of the searches from all starts, and the evaluations of all.
    fn search(
        &self,
        space: &Space,
        starts: &[Candidate],
        loss: &dyn Loss,
        observer: Observer<'_>,
    ) -> Result<(Outcome, usize), FitError> {
        let limits = self.limits(STEP);
        let done = AtomicUsize::new(0);
        let total = limits.max_evaluations * starts.len();
        let count = |_| observer("search", Progress { done: done.fetch_add(1, Ordering::Relaxed) + 1, total });
        let objective = LossObjective::new(space, loss, self.method);
        objective.check(self.method)?;
        let from =
            |start: &Candidate| minimise(self.method, &objective, &space.scaled(&start.parameters), limits, &count);
        let outcomes: Vec<Result<Outcome, FitError>> = starts.par_iter().map(from).collect();
        let mut best: Option<Outcome> = None;
        for (k, outcome) in outcomes.into_iter().enumerate() {
            let outcome = match outcome {
                // A random start may lie where the metric has no value.
                Err(FitError::Start { .. }) if k > 0 => continue,
                other => other?,
            };
            if best.as_ref().is_none_or(|b| outcome.value < b.value) {
                best = Some(outcome);
            }
        }
        let mut best = best.ok_or_else(|| FitError::Start { reason: "no start has a finite loss".to_owned() })?;
        objective.undo_power(&mut best);
        Ok((best, done.into_inner()))
    }

    /// From a log fit to the learned metric by degrees.
    fn blended(
        &self,
        space: &Space,
        start: &Candidate,
        log: &dyn Loss,
        learned: &dyn Loss,
        observer: Observer<'_>,
    ) -> Result<(Outcome, usize), FitError> {
        let model = space.build(&start.parameters)?;
        let (of_log, of_learned) = (log.value(&*model)?, learned.value(&*model)?);
        // At a perfect fit there is nothing to scale.
        let scale = if of_log > 0.0 && of_learned > 0.0 { of_learned / of_log } else { 1.0 };
        let limits = self.limits(BLEND_STEP);
        let total = limits.max_evaluations;
        let mut x = space.scaled(&start.parameters);
        let mut spent = 0;
        let blends = if self.start == Some(Start::LogAtOnce) { &[][..] } else { &BLENDS };
        for &t in blends {
            let blend = Blend { a: log, b: learned, scale, t };
            let objective = LossObjective::new(space, &blend, self.method);
            objective.check(self.method)?;
            let limits = Limits { max_evaluations: total / BLEND_SHARE, tolerance: LEARNED_TOLERANCE, ..limits };
            let count = |n| observer("search", Progress { done: spent + n, total });
            let outcome = minimise(self.method, &objective, &x, limits, &count)?;
            x = outcome.x;
            spent += outcome.evaluations;
        }
        let objective = LossObjective::new(space, learned, self.method);
        let limits = Limits { max_evaluations: total - spent, tolerance: LEARNED_TOLERANCE, ..limits };
        let count = |n| observer("search", Progress { done: spent + n, total });
        let outcome = minimise(self.method, &objective, &x, limits, &count)?;
        let evaluations = spent + outcome.evaluations;
        Ok((outcome, evaluations))
    }

    fn polish(&self, space: &Space, x: &[f64], loss: &dyn Loss, observer: Observer<'_>) -> Result<Outcome, FitError> {
        let smooth = LossObjective::new(space, loss, Method::Lbfgs).check(Method::Lbfgs).is_ok();
        let method = if smooth { Method::Lbfgs } else { self.method };
        let objective = LossObjective::new(space, loss, method);
        let total = POLISH_EVALUATIONS;
        let limits = Limits { max_evaluations: total, step: POLISH_STEP, tolerance: POLISH_TOLERANCE };
        let count = |done| observer("polish", Progress { done, total });
        let mut outcome = minimise(method, &objective, x, limits, &count)?;
        objective.undo_power(&mut outcome);
        Ok(outcome)
    }
}

fn no_log() -> MetricError {
    MetricError::NotComputed { metric: LOG.to_string(), reason: "it compares colours".to_owned() }
}

/// The Lp variant that a metric is, if it is one: those have a loss on fewer cells.
fn lp_variant(metric: &dyn Metric) -> Option<LpVariant> {
    (metric as &dyn Any).downcast_ref::<LpMetric>().map(LpMetric::variant)
}

/// The loss of a metric; `coarsening` counts for Lp alone.
fn loss_of(metric: &dyn Metric, reference: &dyn Brdf, coarsening: usize) -> Result<Box<dyn Loss>, MetricError> {
    if let Some(variant) = lp_variant(metric)
        && let Some(loss) = LpLoss::new(reference, variant, coarsening)?
    {
        return Ok(Box::new(loss));
    }
    Ok(Box::new(MetricLoss::new(metric, reference)?))
}
