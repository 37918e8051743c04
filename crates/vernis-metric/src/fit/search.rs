//! The searches of a fit: one from each start, and the polish of the best.
//!
//! A learned metric that starts from a fit under the logarithm is let in by degrees ([`Blend`]), or, for comparison, at once
//! ([`Start::LogAtOnce`]). Searches run in parallel and the best result counts; of equal ones, that of the first start.

use super::fitting::{Fitting, Rivals, Start, Starts};
use super::loss::{Blend, Loss};
use super::objective::LossObjective;
use super::optimizer::{Improvement, Limits, Method, Observer as Watch, Outcome, Patience, StopReason, minimise};
use super::start::Candidate;
use super::{FitError, Space};
use crate::io::{Count, Observer, Progress};
use crate::math::parallel;

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
/// L-BFGS under a learned metric, which has edges: it ends at steps below this, or when [`ROUND`] (variables + 1) evaluations have gained
/// no more than this share of what the whole search has.
const EDGE_TOLERANCE: f64 = 1e-6;
const ROUND: usize = 2;
const ROUND_SHARE: f64 = 0.015;
/// From how many other shapes such a search begins again at most, within which part of the evaluations: a value with its gradient
/// takes as long as two or three values, and a fit should take no longer than one without gradients. All five numbers were chosen on
/// the table of `vernis experiment optimizers`.
pub(super) const RIVALS: usize = 2;
pub(super) const RIVAL_SHARE: usize = 3;
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

/// What `further`, a search after `found`, adds to it. The reason to stop is that of the lower one, unless somebody wished it to end. A
/// rival that has spent the evaluations set aside for it leaves the first search's reason: that one came to its end, and the result is
/// lower still.
fn append(found: &mut Outcome, further: Outcome) {
    let improved = further.history.into_iter().filter(|step| step.value < found.value);
    let later = |step: Improvement| Improvement { evaluations: found.evaluations + step.evaluations, ..step };
    found.history.extend(improved.map(later).collect::<Vec<_>>());
    found.evaluations += further.evaluations;
    let lower = further.value < found.value && further.stop != StopReason::EvaluationLimit;
    if lower || further.stop == StopReason::Interrupted {
        found.stop = further.stop;
    }
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
        let done = Count::of(self.limits(STEP).max_evaluations * starts.candidates.len());
        let watch = |_| {
            done.one(|progress| observer("search", progress));
            self.go_on()
        };
        let from = |k: usize, start: &Candidate| match (&starts.log, self.metric.properties().rough) {
            (Some(log), true) => self.blended(space, start, log, loss, &watch),
            _ => {
                // They are rivals of the first.
                let none = Rivals::default();
                let rivals = if k == 0 { &starts.rivals } else { &none };
                self.descend(space, &objective, &space.scaled(&start.parameters), rivals, self.limits(STEP), &watch)
            }
        };
        let outcomes = parallel::map(starts.candidates.len(), |k| from(k, &starts.candidates[k]));
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
        Ok(Searched { outcome, from, spent: done.done() })
    }

    /// A search by the method of the fit.
    ///
    /// A learned loss has edges, moduli of differences and hollows of its kernel, and several minima. At an edge the steps of L-BFGS become
    /// short long before the minimum, which lies along the edge: no step is too short there, and the search ends when a whole round of
    /// evaluations gains next to nothing. Then it begins again from the other starts, while evaluations are left for them; one that
    /// falls too slowly to become the best is given up.
    fn descend(
        &self,
        space: &Space,
        objective: &LossObjective<'_>,
        start: &[f64],
        rivals: &Rivals,
        limits: Limits,
        watch: Watch<'_>,
    ) -> Result<Outcome, FitError> {
        if !self.has_rivals() {
            return minimise(self.method, objective, start, limits, watch);
        }
        let evaluations = ROUND * (start.len() + 1);
        let patience = Patience { evaluations, share: ROUND_SHARE, beat: f64::INFINITY };
        let limits = Limits { tolerance: EDGE_TOLERANCE, patience: Some(patience), ..limits };
        let most = limits.max_evaluations;
        let mut found = minimise(Method::Lbfgs, objective, start, limits, watch)?;
        for rival in &rivals.starts {
            let left = (rivals.shares * most / RIVAL_SHARE).saturating_sub(found.evaluations);
            if left == 0 || found.stop == StopReason::Interrupted {
                break;
            }
            let patience = Some(Patience { beat: found.value, ..patience });
            let limits = Limits { max_evaluations: left, patience, ..limits };
            let further = minimise(Method::Lbfgs, objective, &space.scaled(&rival.parameters), limits, watch);
            match further {
                // A start may lie where the metric has no value.
                Err(FitError::Start { .. }) => continue,
                further => append(&mut found, further?),
            }
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
        let mut outcome = self.descend(space, &objective, &x, &Rivals::default(), limits, watch)?;
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
        let limits = Limits {
            max_evaluations: total,
            step: POLISH_STEP,
            tolerance: POLISH_TOLERANCE,
            gain: GAIN,
            patience: None,
        };
        let watch = |done| {
            observer("polish", Progress { done, total });
            self.go_on()
        };
        let mut outcome = minimise(method, &objective, x, limits, &watch)?;
        objective.undo_power(&mut outcome);
        Ok(outcome)
    }
}
