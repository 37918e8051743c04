//! A loss and a model as the function that an optimiser sees.

use super::loss::{DifferentiableLoss, Loss};
use super::optimizer::{Method, Objective, Outcome};
use super::{FitError, Space};
use crate::metric::MetricError;

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
        let value = self.loss.value(&*self.space.build(&self.space.parameters(x))?)?;
        Ok(if self.power == 1.0 { value } else { value.powf(self.power) })
    }

    fn gradient(&self, x: &[f64]) -> Result<(f64, Vec<f64>), FitError> {
        let p = self.space.parameters(x);
        let model = self.space.build(&p)?;
        let none = |what: &str| FitError::NoGradient { what: what.to_owned() };
        let loss = self.loss.as_differentiable().ok_or_else(|| none(self.loss.name()))?;
        let model = model.as_differentiable().ok_or_else(|| none(self.space.model()))?;
        let (value, mut gradient) = match loss.gradient(model) {
            Err(MetricError::Unusable { side: "candidate", .. } | MetricError::NotFinite { .. }) => {
                return Ok((f64::INFINITY, vec![0.0; x.len()]));
            }
            other => other?,
        };
        let outer = self.power * value.powf(self.power - 1.0);
        gradient.iter_mut().zip(self.space.slopes(&p)).for_each(|(g, slope)| *g *= outer * slope);
        Ok((value.powf(self.power), gradient))
    }
}
