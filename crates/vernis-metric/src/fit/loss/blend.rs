//! The way to the minima of metrics with rough landscapes.
//!
//! Learned metrics have such landscapes: they were trained on few pairs, and a search from afar ends in the next hollow. The
//! cure is to start from a fit under the logarithm and to let the learned metric in by degrees,
//!
//!   blend_t = (1 - t) s log + t learned,   s = learned/log at the start, so that both count the same.

use super::{DifferentiableLoss, Loss};
use crate::brdf::models::{AnalyticBrdf, DifferentiableBrdf};
use crate::metric::MetricError;

/// (1 - t) s a + t b.
pub struct Blend<'a> {
    /// The loss at t = 0, apart from the factor s.
    pub a: &'a dyn Loss,
    /// The loss at t = 1.
    pub b: &'a dyn Loss,
    /// s.
    pub scale: f64,
    /// Between 0 and 1.
    pub t: f64,
}

impl Loss for Blend<'_> {
    fn name(&self) -> &str {
        self.b.name()
    }

    fn value(&self, candidate: &dyn AnalyticBrdf) -> Result<f64, MetricError> {
        Ok((1.0 - self.t) * self.scale * self.a.value(candidate)? + self.t * self.b.value(candidate)?)
    }

    fn refusal(&self, candidate: &dyn AnalyticBrdf) -> Option<MetricError> {
        self.b.refusal(candidate)
    }

    fn as_differentiable(&self) -> Option<&dyn DifferentiableLoss> {
        let both = self.a.as_differentiable().is_some() && self.b.as_differentiable().is_some();
        both.then_some(self)
    }
}

impl DifferentiableLoss for Blend<'_> {
    fn gradient(&self, candidate: &dyn DifferentiableBrdf) -> Result<(f64, Vec<f64>), MetricError> {
        let of = |loss: &dyn Loss| match loss.as_differentiable() {
            Some(loss) => loss.gradient(candidate),
            None => Err(MetricError::NoGradient { metric: loss.name().to_owned() }),
        };
        let ((a, by_a), (b, by_b)) = (of(self.a)?, of(self.b)?);
        let share = (1.0 - self.t) * self.scale;
        let gradient = by_a.iter().zip(&by_b).map(|(a, b)| share * a + self.t * b).collect();
        Ok((share * a + self.t * b, gradient))
    }

    fn smooth_power(&self) -> f64 {
        1.0
    }
}
