//! Fits under the logarithm (D9.Cl), from which a fit under another metric begins.
//!
//! They depend on model and reference and not on that metric: fits under several metrics can share them.

use super::fitting::Fitting;
use super::loss::{Lattice, LpLoss};
use super::objective::LossObjective;
use super::optimizer::{Limits, Method, minimise};
use super::search::STEP;
use super::start::{Candidate, staged};
use super::{FitError, Space};
use crate::brdf::Brdf;
use crate::io::Count;
use crate::math::parallel;
use crate::metric::MetricError;
use crate::metric::lp::{Formula, LpVariant};
use std::ops::ControlFlow;

/// The loss whose minimum is the start.
const LOG: LpVariant = LpVariant::new(Formula::D9, true, false);
/// Evaluations of each fit under it.
const EVALUATIONS: usize = 5000;
/// Fits that end nearer to each other than this, in every coordinate, are one start.
const SAME_START: f64 = 1e-2;

/// The results of [`Fitting::log_fits`], the best first.
#[derive(Debug, Clone)]
pub struct LogFits {
    pub(super) model: String,
    pub(super) coarsening: usize,
    pub(super) starts: usize,
    pub(super) candidates: Vec<Candidate>,
    /// That the fits took.
    pub(super) evaluations: usize,
}

impl LogFits {
    /// The identifier of the model that was fitted.
    pub fn model(&self) -> &str {
        &self.model
    }
}

impl Fitting<'_> {
    /// The fits under D9.Cl from which a fit of this model to `reference` begins where [`Fitting::needs_log_fits`] says so. The metric has
    /// no part in it: give them as `log_fits` to fits of the same model to the same reference under several metrics, and they are
    /// made once.
    ///
    /// # Errors
    /// [`FitError::UnknownModel`], those of the reference.
    pub fn log_fits(&self, reference: &dyn Brdf) -> Result<LogFits, FitError> {
        let count = || self.go_on();
        self.make_log_fits(&Space::of(self.model)?, reference, &self.log_loss(reference)?, &count)
    }

    pub(super) fn make_log_fits(
        &self,
        space: &Space,
        reference: &dyn Brdf,
        loss: &LpLoss,
        observer: &(dyn Fn() -> ControlFlow<()> + Sync),
    ) -> Result<LogFits, FitError> {
        let evaluations = Count::default();
        let count = || {
            evaluations.one(|_| ());
            observer()
        };
        let starts = staged(space, &self.lattice(reference)?, loss, self.starts, &count)?;
        let limits = Limits { max_evaluations: EVALUATIONS, ..self.limits(STEP) };
        let fit = |start: &Candidate| {
            let objective = LossObjective::new(space, loss, Method::HookeJeeves);
            minimise(Method::HookeJeeves, &objective, &space.scaled(&start.parameters), limits, &|_| count())
        };
        let mut fitted = parallel::try_map(starts.len(), |k| fit(&starts[k]))?;
        fitted.sort_by(|a, b| a.value.total_cmp(&b.value));
        let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < SAME_START);
        let mut distinct: Vec<Vec<f64>> = Vec::new();
        let mut candidates = Vec::new();
        for found in fitted {
            if !distinct.iter().any(|other| near(other, &found.x)) {
                candidates.push(Candidate { parameters: space.parameters(&found.x), value: found.value });
                distinct.push(found.x);
            }
        }
        let (model, evaluations) = (self.model.to_owned(), evaluations.done());
        Ok(LogFits { model, coarsening: self.coarsening, starts: self.starts, candidates, evaluations })
    }

    /// The results of the log fits, made here where they are not given; either way their evaluations count.
    pub(super) fn log_candidates(
        &self,
        space: &Space,
        reference: &dyn Brdf,
        loss: &LpLoss,
        evaluations: &Count,
        observer: &(dyn Fn() -> ControlFlow<()> + Sync),
    ) -> Result<Vec<Candidate>, FitError> {
        match &self.log_fits {
            Some(found) => {
                evaluations.more(found.evaluations, |_| ());
                Ok(found.candidates.clone())
            }
            None => Ok(self.make_log_fits(space, reference, loss, observer)?.candidates),
        }
    }

    pub(super) fn log_loss(&self, reference: &dyn Brdf) -> Result<LpLoss, FitError> {
        let found = LpLoss::new(reference, LOG, self.coarsening.max(2))?;
        let no_log = || MetricError::NotComputed { metric: LOG.to_string(), reason: "it compares colours".to_owned() };
        Ok(found.ok_or_else(no_log)?)
    }

    /// The cells that starts are found on.
    pub(super) fn lattice(&self, reference: &dyn Brdf) -> Result<Lattice, MetricError> {
        Lattice::new(reference, self.coarsening.max(3), 80)
    }
}
