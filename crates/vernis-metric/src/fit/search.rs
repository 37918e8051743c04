//! The searches of a fit: one from each start, and the polish of the best.
//!
//! A learned metric that starts from a fit under the logarithm is let in by degrees ([`Blend`]), or, for comparison, at once
//! ([`Start::LogAtOnce`]). Searches run in parallel and the best result counts; of equal ones, that of the first start.

use super::fitting::{Fitting, Start, Starts};
use super::loss::{Blend, Loss};
use super::objective::LossObjective;
use super::optimizer::{Improvement, Limits, Method, Observer as Watch, Outcome, StopReason, minimise};
use super::start::Candidate;
use super::{FitError, Space};
use crate::io::{Observer, Progress};
use crate::metric::learned::FAMILY;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// t of the blends before the learned metric itself.
const BLENDS: [f64; 3] = [0.25, 0.5, 0.75];
/// At each of them, one part in so many of the evaluations.
const BLEND_SHARE: usize = 6;
/// First step of a search, of a blend, and of a polish, in the coordinates of [`Space`].
pub(super) const STEP: f64 = 0.2;
const BLEND_STEP: f64 = 0.1;
const POLISH_STEP: f64 = 0.01;
pub(super) const TOLERANCE: f64 = 1e-3;
/// Of a round of steps, as a share of the loss.
pub(super) const GAIN: f64 = 1e-6;
/// Of a learned metric: a hundredth of a parameter is nothing that anybody sees.
const LEARNED_TOLERANCE: f64 = 1e-2;
/// Nor is half a hundredth of the loss: a thousandth of an opinion score, where the metric itself is off by tenths.
const LEARNED_GAIN: f64 = 5e-3;
/// How often steps along single parameters follow a search by gradients, how many evaluations they have, and their first length:
/// chosen on the table of `vernis experiment optimizers`.
const CROSSINGS: usize = 2;
const CROSSING_EVALUATIONS: usize = 48;
const CROSSING_STEP: f64 = 0.2;
const POLISH_TOLERANCE: f64 = 1e-4;
/// Evaluations of a polish: those under the whole metric are dear.
const POLISH_EVALUATIONS: usize = 8;

/// The best of the searches.
pub(super) struct Searched {
    pub outcome: Outcome,
    /// The start that it came from.
    pub from: usize,
    /// Evaluations of all searches.
    pub spent: usize,
}

/// What `further`, a search from the end of `found`, adds to it; `found` keeps its reason to stop.
fn append(found: &mut Outcome, further: Outcome) {
    let lower = further.history.into_iter().filter(|step| step.value < found.value);
    let later = |step: Improvement| Improvement { evaluations: found.evaluations + step.evaluations, ..step };
    found.history.extend(lower.map(later).collect::<Vec<_>>());
    found.evaluations += further.evaluations;
    if further.value < found.value {
        (found.x, found.value) = (further.x, further.value);
    }
}

impl Fitting<'_> {
    /// The best of the searches from all starts.
    pub(super) fn search(
        &self,
        space: &Space,
        starts: &Starts,
        loss: &dyn Loss,
        observer: Observer<'_>,
    ) -> Result<Searched, FitError> {
        let objective = LossObjective::new(space, loss, self.method);
        objective.check(self.method)?;
        let done = AtomicUsize::new(0);
        let total = self.limits(STEP).max_evaluations * starts.candidates.len();
        let watch = |_| {
            observer("search", Progress { done: done.fetch_add(1, Ordering::Relaxed) + 1, total });
            self.go_on()
        };
        let from = |start: &Candidate| match (&starts.log, self.metric.properties().rough) {
            (Some(log), true) => self.blended(space, start, log, loss, &watch),
            _ => self.descend(&objective, &space.scaled(&start.parameters), self.limits(STEP), &watch),
        };
        let outcomes: Vec<Result<Outcome, FitError>> = starts.candidates.par_iter().map(from).collect();
        let mut best: Option<(Outcome, usize)> = None;
        for (k, outcome) in outcomes.into_iter().enumerate() {
            let outcome = match outcome {
                // A start may lie where the metric has no value.
                Err(FitError::Start { .. }) => continue,
                other => other?,
            };
            if best.as_ref().is_none_or(|(b, _)| outcome.value < b.value) {
                best = Some((outcome, k));
            }
        }
        let Some((mut outcome, from)) = best else {
            let refusal = loss.refusal(&*space.build(&starts.candidates[0].parameters)?);
            let why = refusal.map_or(String::new(), |e| format!(" ({e})"));
            return Err(FitError::Start { reason: format!("the loss has no finite value there{why}") });
        };
        objective.undo_power(&mut outcome);
        Ok(Searched { outcome, from, spent: done.into_inner() })
    }

    /// A search by the method of the fit. A learned loss has edges: moduli of differences, and hollows of its kernel. A search by
    /// gradients stops at an edge that steps along single parameters cross, so these follow it, a few at a time, as long as they
    /// gain.
    fn descend(
        &self,
        objective: &LossObjective<'_>,
        start: &[f64],
        limits: Limits,
        watch: Watch<'_>,
    ) -> Result<Outcome, FitError> {
        let mut found = minimise(self.method, objective, start, limits, watch)?;
        if self.method != Method::Lbfgs || self.metric.properties().family != FAMILY {
            return Ok(found);
        }
        let left = |found: &Outcome| limits.max_evaluations.saturating_sub(found.evaluations);
        for _ in 0..CROSSINGS {
            if found.stop == StopReason::Interrupted || left(&found) < CROSSING_EVALUATIONS {
                break;
            }
            let before = found.value;
            let across = Limits { max_evaluations: CROSSING_EVALUATIONS, step: CROSSING_STEP, ..limits };
            let crossed = minimise(Method::HookeJeeves, objective, &found.x, across, watch)?;
            if crossed.stop == StopReason::Interrupted {
                found.stop = StopReason::Interrupted;
            }
            append(&mut found, crossed);
            let gained = found.value < before - GAIN * before.abs();
            if found.stop == StopReason::Interrupted || !gained || left(&found) < CROSSING_EVALUATIONS {
                break;
            }
            let onwards = Limits { max_evaluations: left(&found), step: CROSSING_STEP, ..limits };
            let further = minimise(Method::Lbfgs, objective, &found.x, onwards, watch)?;
            found.stop = further.stop;
            append(&mut found, further);
        }
        Ok(found)
    }

    /// From a log fit to the learned metric by degrees; the log fit itself where nothing better is found.
    fn blended(
        &self,
        space: &Space,
        start: &Candidate,
        log: &dyn Loss,
        learned: &dyn Loss,
        watch: Watch<'_>,
    ) -> Result<Outcome, FitError> {
        let model = space.build(&start.parameters)?;
        let (of_log, of_learned) = (log.value(&*model)?, learned.value(&*model)?);
        // At a perfect fit, and where one of them has no value, there is nothing to scale.
        let scalable = |value: f64| value > 0.0 && value.is_finite();
        let scale = if scalable(of_log) && scalable(of_learned) { of_learned / of_log } else { 1.0 };
        let limits = self.limits(BLEND_STEP);
        let total = limits.max_evaluations;
        let origin = space.scaled(&start.parameters);
        let mut x = origin.clone();
        let mut spent = 0;
        let blends = if self.start == Some(Start::LogAtOnce) { &[][..] } else { &BLENDS };
        for &t in blends {
            let blend = Blend { a: log, b: learned, scale, t };
            let objective = LossObjective::new(space, &blend, self.method);
            objective.check(self.method)?;
            let limits = Limits {
                max_evaluations: total / BLEND_SHARE,
                tolerance: LEARNED_TOLERANCE,
                gain: LEARNED_GAIN,
                ..limits
            };
            let outcome = minimise(self.method, &objective, &x, limits, watch)?;
            x = outcome.x;
            spent += outcome.evaluations;
            if outcome.stop == StopReason::Interrupted {
                break;
            }
        }
        let objective = LossObjective::new(space, learned, self.method);
        let limits =
            Limits { max_evaluations: total - spent, tolerance: LEARNED_TOLERANCE, gain: LEARNED_GAIN, ..limits };
        let mut outcome = self.descend(&objective, &x, limits, watch)?;
        if of_learned < outcome.value {
            (outcome.x, outcome.value) = (origin, of_learned);
            outcome.history = vec![Improvement { evaluations: 1, value: of_learned }];
        }
        Ok(outcome)
    }

    pub(super) fn polish(
        &self,
        space: &Space,
        x: &[f64],
        loss: &dyn Loss,
        observer: Observer<'_>,
    ) -> Result<Outcome, FitError> {
        let smooth = LossObjective::new(space, loss, Method::Lbfgs).check(Method::Lbfgs).is_ok();
        let method = if smooth { Method::Lbfgs } else { self.method };
        let objective = LossObjective::new(space, loss, method);
        let total = POLISH_EVALUATIONS;
        let limits = Limits { max_evaluations: total, step: POLISH_STEP, tolerance: POLISH_TOLERANCE, gain: GAIN };
        let watch = |done| {
            observer("polish", Progress { done, total });
            self.go_on()
        };
        let mut outcome = minimise(method, &objective, x, limits, &watch)?;
        objective.undo_power(&mut outcome);
        Ok(outcome)
    }
}
