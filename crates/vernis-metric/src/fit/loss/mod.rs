//! What a fit minimises: a metric with its reference, as a function of a model.
//!
//! | metric | loss | on which grid |
//! | --- | --- | --- |
//! | Lp without the colour differences | [`LpLoss`] | every n-th cell, all cells near the highlight |
//! | metrics on graphs | [`MetricLoss`] | a coarser grid of theirs |
//! | any other | [`MetricLoss`]; that of a learned metric is the prediction before it is cut off at zero | their own |

mod blend;
mod lattice;
mod lp;
mod prepared;

pub use blend::Blend;
pub use lattice::Lattice;
pub use lp::LpLoss;
pub use prepared::MetricLoss;

use crate::brdf::models::{AnalyticBrdf, DifferentiableBrdf};
use crate::metric::MetricError;

/// A function of a candidate. Infinite where the metric refuses the candidate for its values
/// ([`MetricError::is_about_candidate_values`]).
pub trait Loss: Send + Sync {
    /// What its values are, for messages.
    fn name(&self) -> &str;

    /// The loss of `candidate`.
    fn value(&self, candidate: &dyn AnalyticBrdf) -> Result<f64, MetricError>;

    /// The metric's distance to `candidate`, which is what a fit reports: the loss, unless the metric minimises something smoother.
    ///
    /// # Errors
    /// Those of the metric.
    fn distance(&self, candidate: &dyn AnalyticBrdf) -> Result<f64, MetricError> {
        self.value(candidate)
    }

    /// Why the loss of `candidate` is infinite, where the metric says so.
    fn refusal(&self, _candidate: &dyn AnalyticBrdf) -> Option<MetricError> {
        None
    }

    /// The loss with its gradient, if it has one.
    fn as_differentiable(&self) -> Option<&dyn DifferentiableLoss> {
        None
    }
}

/// A loss with derivatives by the parameters of the candidate.
pub trait DifferentiableLoss: Loss {
    /// The value, and its derivative by each parameter.
    fn gradient(&self, candidate: &dyn DifferentiableBrdf) -> Result<(f64, Vec<f64>), MetricError>;

    /// The power of the loss that is smooth where both sides agree: 2 for a root of a mean square.
    fn smooth_power(&self) -> f64;
}

/// A candidate that the metric refuses is no fault of anybody: a search merely has to turn round.
fn or_infinite(value: Result<f64, MetricError>) -> Result<f64, MetricError> {
    match value {
        Err(error) if error.is_about_candidate_values() => Ok(f64::INFINITY),
        other => other,
    }
}
