//! One fit from beginning to end.
//!
//! 1. The loss of the metric, and a cheaper one for the search: fewer cells for Lp, a coarser grid for metrics on graphs.
//! 2. The starts: staged, fits under the logarithm (D9.Cl), or given parameters; further ones by rank, then by chance.
//! 3. A search from each start under the cheap loss, in parallel; the best one counts (`search.rs`). Under a learned metric
//!    L-BFGS begins again from other shapes of the lobe, until a third of the evaluations is spent, and with many parameters from
//!    a fit under the logarithm first.
//! 4. A polish under the metric itself, with steps of a hundredth: by L-BFGS where there are gradients, else by the method
//!    of the search.
//!
//! What was minimised is never larger at the end than at the first start. A fit that is interrupted gives the best of what it has.

use super::direct;
use super::log_fits::LogFits;
use super::loss::{Loss, LpLoss, MetricLoss};
use super::objective::LossObjective;
use super::optimizer::{FLAT, Improvement, Limits, Method, StopReason, is_flat_around};
use super::search::{GAIN, RIVALS, STEP, Searched, TOLERANCE};
use super::space::AtBound;
use super::start::{Candidate, ranked};
use super::{FitError, Space};
use crate::brdf::Brdf;
use crate::brdf::models::AnalyticBrdf;
use crate::io::{Count, Interrupt, Observer};
use crate::math::seed;
use crate::metric::learned::FAMILY;
use crate::metric::lp::{LpMetric, LpVariant};
use crate::metric::{Metric, MetricError};
use rand::Rng;
use std::any::Any;
use std::ops::ControlFlow;
use std::sync::Arc;

/// A random start moves every coordinate by up to so much.
const SCATTER: f64 = 1.0;
/// With so many parameters the sweeps of the staged start, one field at a time, miss good starts: a fit under a learned metric by
/// L-BFGS then begins at a log fit as well.
const MANY_PARAMETERS: usize = 10;
/// Staged starts that are nearer to each other than this, in every coordinate of their shapes, are one rival.
const SAME_START: f64 = 1e-2;

/// Where a fit begins.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Start {
    /// [`staged`](super::start::staged).
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
    /// `None`: at a log fit for metrics whose landscape has hollows
    /// ([`Properties::rough`](crate::metric::Properties::rough)), staged for others.
    pub start: Option<Start>,
    /// How each start is searched; [`Fitting::new`] takes L-BFGS for learned metrics with a gradient, where the model has one too, and
    /// the study's Hooke-Jeeves for all others.
    pub method: Method,
    /// How many starts are searched from; the best result counts.
    pub starts: usize,
    /// Of the random starts.
    pub seed: u64,
    /// Cells of the metric to one cell of the search, along each axis; 1 searches on the metric's own grid.
    pub coarsening: usize,
    /// For each start; `None`: 5000 for Lp, 400 for others.
    pub max_evaluations: Option<usize>,
    /// Fits under D9.Cl that are made already, for a fit that [begins at one](Fitting::needs_log_fits): [`Fitting::log_fits`] of the same
    /// model and reference, from the same starts on the same cells. `None`: the fit makes its own. The result is the same.
    pub log_fits: Option<&'a LogFits>,
    /// Once it is raised the fit ends early, with the best so far and [`StopReason::Interrupted`].
    pub interrupt: Interrupt,
}

/// The result of a fit.
pub struct Fitted {
    /// The model with the parameters that were found.
    pub model: Arc<dyn AnalyticBrdf>,
    /// The metric's distance at the first start; infinite where it has none there.
    pub value_at_start: f64,
    /// The metric's distance at the end.
    pub value: f64,
    /// What the search minimised, at the end: for learned metrics it may be negative.
    pub loss: f64,
    /// How the search that won ended.
    pub stop: StopReason,
    /// Name of the search method, such as `lbfgs`.
    pub method: &'static str,
    /// Name of the start, see [`Start::name`].
    pub start: &'static str,
    /// Of all searches and starts; those of the polish apart.
    pub evaluations: usize,
    /// Those of the searches alone, under the loss of the search.
    pub search_evaluations: usize,
    /// Evaluations of the polish under the metric itself.
    pub polish_evaluations: usize,
    /// Improvements of the search that won, under the loss of the search.
    pub history: Vec<Improvement>,
    /// Parameters that stand on a bound of the model's; none where nothing was searched for.
    pub at_bounds: Vec<AtBound>,
}

/// Where the searches begin.
pub(super) struct Starts {
    pub candidates: Vec<Candidate>,
    /// Where a search by gradients under a learned metric begins again: at a log fit where there are many parameters, and at other shapes
    /// than the first.
    pub rivals: Rivals,
    /// The loss of the log fits that they are the results of.
    pub log: Option<LpLoss>,
}

/// Where a search begins again, until so many [shares](super::search::RIVAL_SHARE) of its evaluations are spent.
#[derive(Default)]
pub(super) struct Rivals {
    pub starts: Vec<Candidate>,
    pub shares: usize,
}

impl<'a> Fitting<'a> {
    /// As the command line has it where nothing else is said.
    pub fn new(model: &'a str, metric: &'a dyn Metric) -> Self {
        Self {
            model,
            metric,
            start: None,
            method: default_method(model, metric),
            starts: 1,
            seed: 1,
            coarsening: 3,
            max_evaluations: None,
            log_fits: None,
            interrupt: Interrupt::new(),
        }
    }

    /// Fits the model to `reference`; the same whatever the number of threads.
    ///
    /// A search that spends its evaluations, or is interrupted, is no error: [`Fitted::stop`] says so, and the best point so far is
    /// returned.
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
        let evaluations = Count::default();
        let starts = self.starts(&space, reference, &*search, &evaluations, observer)?;
        let Searched { outcome, from, spent } = self.search(&space, &starts, &*search, observer)?;
        let is_coarse = self.is_coarse(coarse.is_some());
        let whole = if is_coarse { Some(loss_of(self.metric, reference, 1)?) } else { None };
        let whole = whole.as_deref().unwrap_or(&*search);
        let first = &starts.candidates[0].parameters;
        let at_start = whole.value(&*space.build(first)?)?;
        let (mut x, mut stop) = (outcome.x, outcome.stop);
        let mut value = whole.value(&*space.build(&space.parameters(&x))?)?;
        let mut polish_evaluations = 0;
        if is_coarse && value.is_finite() && !self.interrupt.is_raised() {
            let polished = self.polish(&space, &x, whole, observer)?;
            polish_evaluations = polished.evaluations;
            if polished.value < value {
                (x, value) = (polished.x, polished.value);
            }
        }
        let mut parameters = space.parameters(&x);
        if at_start < value {
            (x, parameters, value) = (space.scaled(first), first.clone(), at_start);
        }
        if !value.is_finite() {
            let refusal = whole.refusal(&*space.build(first)?);
            let reason = "the metric has a value neither there nor where the search ended".to_owned();
            return Err(FitError::Start { reason: refusal.map_or(reason.clone(), |e| format!("{reason} ({e})")) });
        }
        // Cells that the search leaves out may drown all others.
        if is_coarse && stop.is_success() && value > 0.0 && (at_start - value).abs() <= FLAT * value {
            let objective = LossObjective::new(&space, whole, self.method);
            if is_flat_around(&objective, &x, STEP)? {
                stop = StopReason::Flat;
            }
        }
        let origin = space.scaled(&starts.candidates[from].parameters);
        let still = |origin: &[f64]| x.iter().zip(origin).all(|(a, b)| (a - b).abs() <= 1e-12 * (1.0 + b.abs()));
        if stop.is_success() && value > 0.0 && (still(&origin) || still(&space.scaled(first))) {
            stop = StopReason::NothingMoved;
        }
        let model = space.build(&parameters)?;
        Ok(Fitted {
            value_at_start: whole.distance(&*space.build(first)?)?,
            value: whole.distance(&*model)?,
            model,
            loss: value,
            stop,
            method: self.method.name(),
            start: self.start_or_default().name(),
            evaluations: evaluations.done() + spent,
            search_evaluations: spent,
            polish_evaluations,
            history: outcome.history,
            at_bounds: space.at_bounds(&parameters),
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
        if let Some(LogFits { model, coarsening, starts, .. }) = self.log_fits
            && (model.as_str(), *coarsening, *starts) != (self.model, self.coarsening, self.starts)
        {
            return Err(FitError::Setting {
                what: "log-fits",
                found: format!("of {model}, coarsening {coarsening}, {starts} starts"),
                allowed: format!("of {}, coarsening {}, {} starts", self.model, self.coarsening, self.starts),
            });
        }
        match (self.starts, self.coarsening, self.max_evaluations) {
            (0, _, _) | (1001.., _, _) => wrong("starts", self.starts, "1 to 1000"),
            (_, 0, _) | (_, 16.., _) => {
                wrong("coarsening", self.coarsening, "1 to 15 cells of the metric per cell of the search")
            }
            (_, _, Some(n @ ..10)) => wrong("max-evaluations", n, "10 or more"),
            _ => Ok(()),
        }
    }

    /// Whether the fit begins at fits under D9.Cl, among others: then `log_fits` spares it making them.
    ///
    /// # Errors
    /// [`FitError::UnknownModel`].
    pub fn needs_log_fits(&self) -> Result<bool, FitError> {
        Ok(match self.start_or_default() {
            Start::Log | Start::LogAtOnce => true,
            Start::Staged => self.has_log_rival(&Space::of(self.model)?),
            Start::Parameters(_) => false,
        })
    }

    fn has_log_rival(&self, space: &Space) -> bool {
        self.has_rivals() && space.bounds().len() >= MANY_PARAMETERS
    }

    /// Whether the search begins again: L-BFGS under a learned metric does.
    pub(super) fn has_rivals(&self) -> bool {
        self.method == Method::Lbfgs && self.metric.properties().family == FAMILY
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

    pub(super) fn limits(&self, step: f64) -> Limits {
        let default = if lp_variant(self.metric).is_some() { 5000 } else { 400 };
        let max_evaluations = self.max_evaluations.unwrap_or(default);
        Limits { max_evaluations, step, tolerance: TOLERANCE, gain: GAIN, patience: None }
    }

    /// What an observer of a search answers.
    pub(super) fn go_on(&self) -> ControlFlow<()> {
        if self.interrupt.is_raised() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn starts(
        &self,
        space: &Space,
        reference: &dyn Brdf,
        search: &dyn Loss,
        evaluations: &Count,
        observer: Observer<'_>,
    ) -> Result<Starts, FitError> {
        let count = || {
            evaluations.one(|progress| observer("starts", progress));
            self.go_on()
        };
        let (mut log, mut rivals) = (None, Rivals::default());
        let mut starts = match self.start_or_default() {
            Start::Staged => {
                let staged = ranked(space, &self.lattice(reference)?, search, &count)?;
                rivals = Rivals { starts: staged.other_shapes(space, RIVALS, SAME_START), shares: 1 };
                if self.has_log_rival(space) {
                    let loss = self.log_loss(reference)?;
                    let found = self.log_candidates(space, reference, &loss, evaluations, &count)?;
                    rivals.starts.splice(0..0, found.into_iter().take(1));
                    rivals.shares += 1;
                }
                staged.best(self.starts)
            }
            Start::Log | Start::LogAtOnce => {
                let loss = self.log_loss(reference)?;
                let found = self.log_candidates(space, reference, &loss, evaluations, &count)?;
                log = Some(loss);
                found
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
        Ok(Starts { candidates: starts, rivals, log })
    }
}

/// An evaluation of a learned metric is dear, and its gradient tells more than a parameter's worth of them.
fn default_method(model: &str, metric: &dyn Metric) -> Method {
    let properties = metric.properties();
    let has_gradient = || {
        let built = Space::of(model).and_then(|space| space.build(&space.start()));
        built.is_ok_and(|model| model.as_differentiable().is_some())
    };
    if properties.family == FAMILY && properties.differentiable && has_gradient() {
        Method::Lbfgs
    } else {
        Method::HookeJeeves
    }
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
