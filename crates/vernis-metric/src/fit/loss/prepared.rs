//! Any metric of the registry as a loss.

use super::{DifferentiableLoss, Loss, or_infinite};
use crate::brdf::Brdf;
use crate::brdf::models::{AnalyticBrdf, DifferentiableBrdf};
use crate::metric::{Metric, MetricError, Nodes, PreparedMetric};
use std::sync::Arc;

/// A metric whose reference is fixed.
pub struct MetricLoss {
    name: String,
    prepared: Box<dyn PreparedMetric>,
    /// Where the metric has a gradient.
    nodes: Option<Arc<Nodes>>,
}

impl MetricLoss {
    /// # Errors
    /// Those of [`Metric::prepare`].
    pub fn new(metric: &dyn Metric, reference: &dyn Brdf) -> Result<Self, MetricError> {
        let prepared = metric.prepare(reference)?;
        let nodes = prepared.nodes().filter(|_| metric.properties().differentiable);
        Ok(Self { name: metric.name().to_owned(), prepared, nodes })
    }
}

impl Loss for MetricLoss {
    fn name(&self) -> &str {
        &self.name
    }

    fn value(&self, candidate: &dyn AnalyticBrdf) -> Result<f64, MetricError> {
        or_infinite(self.prepared.loss(candidate))
    }

    fn distance(&self, candidate: &dyn AnalyticBrdf) -> Result<f64, MetricError> {
        or_infinite(self.prepared.distance(candidate))
    }

    fn refusal(&self, candidate: &dyn AnalyticBrdf) -> Option<MetricError> {
        self.prepared.loss(candidate).err()
    }

    fn as_differentiable(&self) -> Option<&dyn DifferentiableLoss> {
        self.nodes.as_ref().map(|_| self as &dyn DifferentiableLoss)
    }
}

impl DifferentiableLoss for MetricLoss {
    /// By the chain rule: sum over nodes and channels of d loss/d value times d value/d parameter.
    fn gradient(&self, candidate: &dyn DifferentiableBrdf) -> Result<(f64, Vec<f64>), MetricError> {
        let Some(nodes) = &self.nodes else { return Err(MetricError::NoGradient { metric: self.name.clone() }) };
        let of_values = self.prepared.loss_gradient_at(&nodes.evaluate(candidate))?;
        let count = candidate.parameters().len();
        let takes_part = |node: usize| of_values.derivatives[node] != [0.0; 3];
        let gradient = nodes.sums(count, takes_part, |node, wi, wo, sums| {
            // Models are black below the horizon, whatever their parameters.
            if wi.z <= 0.0 || wo.z <= 0.0 {
                return;
            }
            let mut d = vec![[0.0; 3]; count];
            candidate.value_and_gradient(wi, wo, &mut d);
            for (sum, d) in sums.iter_mut().zip(&d) {
                *sum += (0..3).map(|c| of_values.derivatives[node][c] * d[c]).sum::<f64>();
            }
        });
        Ok((of_values.value, gradient))
    }

    fn smooth_power(&self) -> f64 {
        self.prepared.smooth_power()
    }
}
