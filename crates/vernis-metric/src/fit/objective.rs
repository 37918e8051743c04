//! A loss and a model as the function that an optimiser sees.

use super::loss::{DifferentiableLoss, Loss};
use super::optimizer::{Method, Objective, Outcome};
use super::{FitError, Space};
use crate::brdf::models::AnalyticBrdf;
use std::sync::Arc;

/// A loss in the coordinates of the search, to the power at which it is smooth where gradients are used.
pub(super) struct LossObjective<'a> {
    space: &'a Space,
    loss: &'a dyn Loss,
    power: f64,
}

impl<'a> LossObjective<'a> {
    pub fn new(space: &'a Space, loss: &'a dyn Loss, method: Method) -> Self {
        let smooth = loss.as_differentiable().map_or(1.0, DifferentiableLoss::smooth_power);
        Self { space, loss, power: if method == Method::Lbfgs { smooth } else { 1.0 } }
    }

    /// Refuses a gradient method where there is no gradient.
    pub fn check(&self, method: Method) -> Result<(), FitError> {
        if method != Method::Lbfgs {
            return Ok(());
        }
        let model = self.space.build(&self.space.start())?;
        if model.as_differentiable().is_none() {
            return Err(FitError::NoGradient { what: format!("the model {}", self.space.model()) });
        }
        match self.loss.as_differentiable() {
            Some(_) => Ok(()),
            None => Err(FitError::NoGradient { what: format!("the metric {}", self.loss.name()) }),
        }
    }

    /// The model at a parameter vector; `None` where the model itself refuses it, though each parameter is within its bounds.
    fn model(&self, p: &[f64]) -> Result<Option<Arc<dyn AnalyticBrdf>>, FitError> {
        match self.space.build(p) {
            Err(FitError::Model(_)) => Ok(None),
            built => built.map(Some),
        }
    }

    /// The value and the history as the metric has them.
    pub fn undo_power(&self, outcome: &mut Outcome) {
        if self.power != 1.0 {
            let root = |value: &mut f64| *value = value.max(0.0).powf(1.0 / self.power);
            root(&mut outcome.value);
            outcome.history.iter_mut().for_each(|h| root(&mut h.value));
        }
    }
}

impl Objective for LossObjective<'_> {
    fn bounds(&self) -> &[(f64, f64)] {
        self.space.bounds()
    }

    fn value(&self, x: &[f64]) -> Result<f64, FitError> {
        let Some(model) = self.model(&self.space.parameters(x))? else { return Ok(f64::INFINITY) };
        let value = self.loss.value(&*model)?;
        Ok(if self.power == 1.0 { value } else { value.powf(self.power) })
    }

    fn gradient(&self, x: &[f64]) -> Result<(f64, Vec<f64>), FitError> {
        let p = self.space.parameters(x);
        let no_value = || Ok((f64::INFINITY, vec![0.0; x.len()]));
        let Some(model) = self.model(&p)? else { return no_value() };
        let none = |what: &str| FitError::NoGradient { what: what.to_owned() };
        let loss = self.loss.as_differentiable().ok_or_else(|| none(self.loss.name()))?;
        let model = model.as_differentiable().ok_or_else(|| none(self.space.model()))?;
        let (value, mut gradient) = match loss.gradient(model) {
            Err(error) if error.is_about_candidate_values() => return no_value(),
            other => other?,
        };
        let outer = self.power * value.powf(self.power - 1.0);
        gradient.iter_mut().zip(self.space.slopes(&p)).for_each(|(g, slope)| *g *= outer * slope);
        // A slope that is no number leads nowhere.
        if gradient.iter().any(|g| !g.is_finite()) {
            return no_value();
        }
        Ok((value.powf(self.power), gradient))
    }
}
