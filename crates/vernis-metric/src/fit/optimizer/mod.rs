//! Minimisers of a function of a few variables over a box.
//!
//! [`Method::HookeJeeves`] is the study's; [`Method::NelderMead`] needs no gradient either; [`Method::Lbfgs`] needs one.
//! All three are our own ([`crate::math::nelder_mead`] for the simplex): they are a page each, and what crates offer takes
//! no bounds (the L-BFGS and the simplex of `argmin`), or wraps another language.
//!
//! An optimiser sees its function through a `Run`, which counts evaluations, remembers the best point whatever happens
//! afterwards, and ends the search when the evaluations are spent or the observer says so. An evaluation of value and gradient
//! counts as one.
//!
//! A search that ends where nothing it tried changed the value by a millionth, steps of the first length along every variable
//! included, has found no minimum: the function is flat as far as it can tell ([`StopReason::Flat`]).

mod hooke_jeeves;
mod lbfgs;
mod nelder_mead;

use super::FitError;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::ControlFlow;
use std::str::FromStr;

/// Values that differ by less than this share are the same for a search.
pub const FLAT: f64 = 1e-6;

/// What is minimised: a function over a box. Infinity marks points where it has no value.
pub trait Objective: Sync {
    /// Smallest and largest value of each variable.
    fn bounds(&self) -> &[(f64, f64)];

    /// The value at `x`; infinite where there is none.
    fn value(&self, x: &[f64]) -> Result<f64, FitError>;

    /// The value and its derivatives.
    fn gradient(&self, x: &[f64]) -> Result<(f64, Vec<f64>), FitError>;
}

/// How a search proceeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Method {
    /// Pattern search, the study's method.
    HookeJeeves,
    /// The simplex of Nelder and Mead.
    NelderMead,
    /// Quasi-Newton with bounds.
    Lbfgs,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 3] = [Self::HookeJeeves, Self::NelderMead, Self::Lbfgs];

    /// The name that the command line and fit files use, such as `hooke-jeeves`.
    pub fn name(self) -> &'static str {
        match self {
            Self::HookeJeeves => "hooke-jeeves",
            Self::NelderMead => "nelder-mead",
            Self::Lbfgs => "lbfgs",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = FitError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|m| m.name() == text).ok_or_else(|| FitError::Setting {
            what: "optimizer",
            found: text.to_owned(),
            allowed: format!("one of {}", Self::ALL.map(Self::name).join(", ")),
        })
    }
}

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum StopReason {
    /// Steps, simplex or projected gradient fell below the tolerance, or a whole round of steps gained next to nothing. Of a fit with
    /// several starts: this holds of the first search, and another start may have given something lower since.
    Converged,
    /// No step along the descent direction lowers the value any more, though the gradient does not vanish.
    NoDescent,
    /// No step from the start lowers the value: the start is a minimum already, as far as the method can tell.
    NothingMoved,
    /// No step changes the value by a millionth: it does not depend on the variables, and the result means nothing.
    Flat,
    /// The evaluations were spent first.
    EvaluationLimit,
    /// Somebody wished it to end.
    Interrupted,
    /// A closed form or a convex programme: there is nothing to converge.
    Direct,
}

impl StopReason {
    /// Whether the result is a minimum as far as the method can tell.
    pub fn is_success(self) -> bool {
        !matches!(self, Self::EvaluationLimit | Self::Flat | Self::Interrupted)
    }

    /// The name that fit files use, such as `evaluation-limit`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::NoDescent => "no-descent",
            Self::NothingMoved => "nothing-moved",
            Self::Flat => "flat",
            Self::EvaluationLimit => "evaluation-limit",
            Self::Interrupted => "interrupted",
            Self::Direct => "direct",
        }
    }
}

/// When a search begins and ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// The search ends when it has spent this many evaluations.
    pub max_evaluations: usize,
    /// First step, in units of the variables.
    pub step: f64,
    /// Steps below this are not worth another evaluation.
    pub tolerance: f64,
    /// Of Hooke-Jeeves: a round of steps that gains less than this share of the value is not worth another one at the same step.
    pub gain: f64,
    /// When the search is given up although its steps are longer than the tolerance; `None`: never.
    pub patience: Option<Patience>,
}

/// How long a search may go on without gaining much. On a function with edges short steps do not tell a minimum: a search that creeps
/// along an edge may fall far later on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Patience {
    /// The search ends when so many evaluations have gained `share` of all that it gained, or less.
    pub evaluations: usize,
    /// A share of the value at the start minus the lowest value.
    pub share: f64,
    /// The search also ends when it would still be above this value after gaining as much again as in one and a half times `evaluations`;
    /// infinite: nothing is to be beaten.
    pub beat: f64,
}

/// An improvement on the way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Improvement {
    /// How many evaluations it took to get there.
    pub evaluations: usize,
    /// The value of the objective there.
    pub value: f64,
}

/// Where a search came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The best point seen.
    pub x: Vec<f64>,
    /// The value of the objective at `x`.
    pub value: f64,
    /// Why the search ended.
    pub stop: StopReason,
    /// Evaluations that the search took.
    pub evaluations: usize,
    /// Every improvement, in order; the first is the start.
    pub history: Vec<Improvement>,
}

/// Called with the evaluations so far; a search ends where the answer is [`ControlFlow::Break`], after its first evaluation.
pub type Observer<'a> = &'a (dyn Fn(usize) -> ControlFlow<()> + Sync);

/// The observer of a search that nobody watches.
pub fn unwatched(_evaluations: usize) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Minimises `objective` from `start`, which is moved into the box first.
///
/// # Errors
/// Those of the objective; [`FitError::Start`] if it has no value at the start.
pub fn minimise(
    method: Method,
    objective: &dyn Objective,
    start: &[f64],
    limits: Limits,
    observer: Observer<'_>,
) -> Result<Outcome, FitError> {
    let mut run = Run::new(objective, limits, observer);
    let start = run.inside(start.to_vec());
    let search = match method {
        Method::HookeJeeves => hooke_jeeves::search,
        Method::NelderMead => nelder_mead::search,
        Method::Lbfgs => lbfgs::search,
    };
    let found = match search(&mut run, start) {
        Err(Halt::GivenUp) => Ok(StopReason::Converged),
        other => other,
    };
    run.limits.patience = None;
    let found = found.and_then(|stop| if run.is_flat()? { Ok(StopReason::Flat) } else { Ok(stop) });
    let stop = match found {
        Ok(stop) => stop,
        // Given up: the search itself, above.
        Err(Halt::Spent | Halt::GivenUp) => StopReason::EvaluationLimit,
        Err(Halt::Interrupted) => StopReason::Interrupted,
        Err(Halt::Failed(error)) => return Err(*error),
    };
    if !run.best_value.is_finite() {
        return Err(FitError::Start { reason: "the loss has no finite value there".to_owned() });
    }
    let Run { best: x, best_value: value, evaluations, history, .. } = run;
    Ok(Outcome { x, value, stop, evaluations, history })
}

/// Whether no step of length `step` along a variable changes the value at `x` by a millionth.
///
/// # Errors
/// Those of the objective.
pub fn is_flat_around(objective: &dyn Objective, x: &[f64], step: f64) -> Result<bool, FitError> {
    let limits = Limits { max_evaluations: usize::MAX, step, tolerance: 0.0, gain: 0.0, patience: None };
    let mut run = Run::new(objective, limits, &unwatched);
    match run.value(x).and_then(|_| run.is_flat()) {
        Ok(flat) => Ok(flat),
        Err(Halt::Failed(error)) => Err(*error),
        Err(Halt::Spent | Halt::GivenUp | Halt::Interrupted) => Ok(false),
    }
}

/// Why an optimiser must stop in the middle of its work.
enum Halt {
    Spent,
    GivenUp,
    Interrupted,
    Failed(Box<FitError>),
}

/// One search: the objective, its limits and what was seen so far.
struct Run<'a> {
    objective: &'a dyn Objective,
    limits: Limits,
    observer: Observer<'a>,
    evaluations: usize,
    best: Vec<f64>,
    best_value: f64,
    /// The first finite value, and the largest share of it by which another one differs.
    first: Option<f64>,
    spread: f64,
    history: Vec<Improvement>,
}

impl<'a> Run<'a> {
    fn new(objective: &'a dyn Objective, limits: Limits, observer: Observer<'a>) -> Self {
        let best = vec![0.0; objective.bounds().len()];
        Self {
            objective,
            limits,
            observer,
            evaluations: 0,
            best,
            best_value: f64::INFINITY,
            first: None,
            spread: 0.0,
            history: Vec::new(),
        }
    }

    /// The point of the box next to `x`.
    fn inside(&self, mut x: Vec<f64>) -> Vec<f64> {
        self.move_inside(&mut x);
        x
    }

    fn move_inside(&self, x: &mut [f64]) {
        x.iter_mut().zip(self.objective.bounds()).for_each(|(x, &(low, high))| *x = x.clamp(low, high));
    }

    fn value(&mut self, x: &[f64]) -> Result<f64, Halt> {
        self.spend()?;
        let value = self.objective.value(x).map_err(|e| Halt::Failed(Box::new(e)))?;
        Ok(self.note(x, value))
    }

    fn gradient(&mut self, x: &[f64]) -> Result<(f64, Vec<f64>), Halt> {
        self.spend()?;
        let (value, gradient) = self.objective.gradient(x).map_err(|e| Halt::Failed(Box::new(e)))?;
        Ok((self.note(x, value), gradient))
    }

    fn spend(&mut self) -> Result<(), Halt> {
        if self.evaluations >= self.limits.max_evaluations {
            return Err(Halt::Spent);
        }
        if self.limits.patience.is_some_and(|patience| self.gives_up(patience)) {
            return Err(Halt::GivenUp);
        }
        // The first evaluation is always made: it is the best so far.
        let told = (self.observer)(self.evaluations + 1);
        if told.is_break() && self.evaluations > 0 {
            return Err(Halt::Interrupted);
        }
        self.evaluations += 1;
        Ok(())
    }

    fn gives_up(&self, patience: Patience) -> bool {
        // The lowest value `ago` evaluations ago.
        let before = |ago: usize| {
            let then = self.evaluations.checked_sub(ago)?;
            self.history.iter().rev().find(|step| step.evaluations <= then).map(|step| step.value)
        };
        let falls = |ago: usize| before(ago).map(|value| value - self.best_value);
        let all = self.first.map_or(0.0, |first| first - self.best_value);
        falls(patience.evaluations).is_some_and(|fall| fall <= patience.share * all)
            || falls(patience.evaluations * 3 / 2).is_some_and(|fall| self.best_value - fall > patience.beat)
    }

    /// Whether nothing that was tried changed the value, nor does a first step along any variable. Zero is a minimum of any loss.
    fn is_flat(&mut self) -> Result<bool, Halt> {
        if self.spread >= FLAT || self.best_value == 0.0 || !self.best_value.is_finite() {
            return Ok(false);
        }
        let (best, bounds) = (self.best.clone(), self.objective.bounds());
        for (k, &(low, high)) in bounds.iter().enumerate() {
            for sign in [1.0, -1.0] {
                let mut there = best.clone();
                there[k] = (best[k] + sign * self.limits.step).clamp(low, high);
                if there[k] != best[k] && (self.value(&there)?.is_infinite() || self.spread >= FLAT) {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// Keeps the best point. A NaN counts as no value.
    fn note(&mut self, x: &[f64], value: f64) -> f64 {
        let value = if value.is_nan() { f64::INFINITY } else { value };
        if value.is_finite() {
            let first = *self.first.get_or_insert(value);
            let share = if value == first { 0.0 } else { ((value - first) / first).abs() };
            self.spread = self.spread.max(share);
        }
        if value < self.best_value {
            (self.best, self.best_value) = (x.to_vec(), value);
            self.history.push(Improvement { evaluations: self.evaluations, value });
        }
        value
    }
}

#[cfg(test)]
mod tests;
