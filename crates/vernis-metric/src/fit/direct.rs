//! Models that are read off a reference instead of being searched for.
//!
//! `dupuy`, `dupuy-ggx` and `dupuy-beckmann`: facets from the light that comes straight back, by the power iteration of
//! [`Dupuy::from_retroreflection`], and the GGX and Beckmann surfaces of the same roughness. `rational-*`: by quadratic
//! programming ([`rational`]). The metric takes no part in either; its distance is only reported.

use super::optimizer::StopReason;
use super::{FitError, Fitted, rational};
use crate::brdf::Brdf;
use crate::brdf::models::{AnalyticBrdf, Dupuy};
use crate::metric::Metric;
use std::sync::Arc;

/// Whether [`fit`] knows the model.
pub fn is_direct(model: &str) -> bool {
    Dupuy::MODELS.contains(&model) || is_rational(model)
}

fn is_rational(model: &str) -> bool {
    model.starts_with("rational-") && !model.contains('+')
}

/// The model that the reference itself gives.
///
/// # Errors
/// [`FitError::Model`] where the reference sends no light straight back, or the roughness is out of bounds;
/// [`FitError::Infeasible`]; those of the metric.
pub fn fit(model: &str, metric: &dyn Metric, reference: &dyn Brdf) -> Result<Fitted, FitError> {
    let (fitted, method): (Arc<dyn AnalyticBrdf>, _) = if is_rational(model) {
        (rational::fit(model, reference)?, "quadratic-programming")
    } else {
        (Arc::new(Dupuy::extracted(model, reference).map_err(FitError::Model)?), "power-iteration")
    };
    let value = metric.distance(reference, &*fitted)?;
    Ok(Fitted {
        model: fitted,
        value_at_start: value,
        value,
        loss: value,
        stop: StopReason::Direct,
        method,
        start: "none",
        evaluations: 1,
        search_evaluations: 0,
        polish_evaluations: 0,
        history: Vec::new(),
        at_bounds: Vec::new(),
    })
}
