//! Any metric of the registry as a loss.

use super::{DifferentiableLoss, Loss, or_infinite};
use crate::brdf::Brdf;
use crate::brdf::models::{AnalyticBrdf, DifferentiableBrdf};
use crate::metric::{Metric, MetricError, PreparedMetric};
use rayon::prelude::*;

/// Cells that a thread handles at a time; the sums of chunks are added up in order.
const CHUNK: usize = 2048;

/// A metric whose reference is fixed.
pub struct MetricLoss {
    name: String,
    prepared: Box<dyn PreparedMetric>,
}

impl MetricLoss {
    /// # Errors
    /// Those of [`Metric::prepare`].
    pub fn new(metric: &dyn Metric, reference: &dyn Brdf) -> Result<Self, MetricError> {
        Ok(Self { name: metric.name().to_owned(), prepared: metric.prepare(reference)? })
    }
}

impl Loss for MetricLoss {
    fn name(&self) -> &str {
        &self.name
    }

    fn value(&self, candidate: &dyn AnalyticBrdf) -> Result<f64, MetricError> {
        or_infinite(self.prepared.loss(candidate))
    }

    fn refusal(&self, candidate: &dyn AnalyticBrdf) -> Option<MetricError> {
        self.prepared.loss(candidate).err()
    }

    fn as_differentiable(&self) -> Option<&dyn DifferentiableLoss> {
        self.prepared.as_differentiable().map(|_| self as &dyn DifferentiableLoss)
    }
}

impl DifferentiableLoss for MetricLoss {
    /// By the chain rule: sum over cells and channels of d distance/d value times d value/d parameter.
    fn gradient(&self, candidate: &dyn DifferentiableBrdf) -> Result<(f64, Vec<f64>), MetricError> {
        let none = || MetricError::NoGradient { metric: self.name.clone() };
        let metric = self.prepared.as_differentiable().ok_or_else(none)?;
        let table = metric.gradient(candidate)?;
        let directions = table.grid.all_directions();
        let count = candidate.parameters().len();
        let chunk = |(index, derivatives): (usize, &[[f64; 3]])| {
            let (mut sums, mut d) = (vec![0.0; count], vec![[0.0; 3]; count]);
            for (k, outer) in derivatives.iter().enumerate().filter(|(_, outer)| **outer != [0.0; 3]) {
                let (wi, wo) = directions.get(index * CHUNK + k);
                candidate.value_and_gradient(wi, wo, &mut d);
                for (sum, d) in sums.iter_mut().zip(&d) {
                    *sum += (0..3).map(|c| outer[c] * d[c]).sum::<f64>();
                }
            }
            sums
        };
        let parts: Vec<Vec<f64>> = table.derivatives.par_chunks(CHUNK).enumerate().map(chunk).collect();
        let mut gradient = vec![0.0; count];
        parts.iter().for_each(|part| gradient.iter_mut().zip(part).for_each(|(g, p)| *g += p));
        Ok((table.value, gradient))
    }

    fn smooth_power(&self) -> f64 {
        self.prepared.as_differentiable().map_or(1.0, |metric| metric.smooth_power())
    }
}
