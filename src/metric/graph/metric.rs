//! What the metrics on graphs have in common.

use super::{CosineTable, GraphGrid};
use crate::brdf::Brdf;
use crate::metric::{DifferentiableMetric, Metric, MetricError, PreparedMetric, TableGradient};
use std::sync::Arc;

/// For each channel (R, G, B) the divergence, and its derivatives with respect to the candidate's f cos theta_i, one a cell.
pub type ChannelGradients = [(f64, Vec<f64>); 3];

/// A metric that compares the graphs of two BRDFs, channel by channel.
pub trait GraphMetric: Metric {
    /// The cells that are compared.
    fn grid(&self) -> GraphGrid;

    /// The same metric on `grid`, unless its name says which grid it is for.
    fn with_default_grid(&self, grid: GraphGrid) -> Arc<dyn Metric>;

    /// The member of this metric's family that `name` describes: `energy[alpha=.05]`.
    ///
    /// # Errors
    /// [`MetricError::Parameter`] for an unknown option or a value out of range.
    fn member(&self, name: &str) -> Result<Arc<dyn Metric>, MetricError>;

    /// The power to which the sum of the channels is taken.
    fn gamma(&self) -> f64;

    /// The divergence of each channel (R, G, B), not negative but for rounding.
    ///
    /// # Errors
    /// Tables on different grids, no cell in common, values that are too large for a finite divergence.
    fn channels(&self, reference: &CosineTable, candidate: &CosineTable) -> Result<[f64; 3], MetricError>;

    /// The divergences with their gradients.
    ///
    /// # Errors
    /// Those of [`GraphMetric::channels`]; [`MetricError::NoGradient`] where there is none.
    fn channel_gradients(
        &self,
        reference: &CosineTable,
        candidate: &CosineTable,
    ) -> Result<ChannelGradients, MetricError>;
}

/// (W_r^+ + W_g^+ + W_b^+)^gamma, the scalar of the study.
///
/// # Errors
/// [`MetricError::NotFinite`].
pub fn combine(metric: &str, channels: [f64; 3], gamma: f64) -> Result<f64, MetricError> {
    // `max` would hide a NaN.
    let bad = channels.into_iter().find(|w| !w.is_finite());
    match bad.unwrap_or_else(|| channels.iter().map(|w| w.max(0.0)).sum::<f64>().powf(gamma)) {
        value if value.is_finite() => Ok(value),
        value => Err(MetricError::NotFinite { metric: metric.to_owned(), value }),
    }
}

/// A graph metric with the table of its reference.
pub struct PreparedGraph<'a, M> {
    metric: &'a M,
    reference: CosineTable,
}

impl<'a, M: GraphMetric> PreparedGraph<'a, M> {
    pub fn new(metric: &'a M, reference: CosineTable) -> Self {
        Self { metric, reference }
    }
}

impl<M: GraphMetric> PreparedMetric for PreparedGraph<'_, M> {
    fn distance(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        let candidate = CosineTable::of(candidate, self.metric.grid(), "candidate")?;
        combine(self.metric.name(), self.metric.channels(&self.reference, &candidate)?, self.metric.gamma())
    }

    fn as_differentiable(&self) -> Option<&dyn DifferentiableMetric> {
        Some(self)
    }
}

impl<M: GraphMetric> DifferentiableMetric for PreparedGraph<'_, M> {
    fn gradient(&self, candidate: &dyn Brdf) -> Result<TableGradient, MetricError> {
        let (metric, grid) = (self.metric, self.metric.grid());
        let candidate = CosineTable::of(candidate, grid, "candidate")?;
        let channels = metric.channel_gradients(&self.reference, &candidate)?;
        let sum: f64 = channels.iter().map(|(w, _)| w.max(0.0)).sum();
        let value = combine(metric.name(), [0, 1, 2].map(|c| channels[c].0), metric.gamma())?;
        // The slope of s^gamma; where nothing differs, every direction is as good.
        let outer = if sum > 0.0 { metric.gamma() * value / sum } else { 0.0 };
        let [_, n_o, n_d] = grid.shape();
        let derivative = |cell: usize| {
            let cosine = grid.angle(0, cell / (n_o * n_d)).cos();
            [0, 1, 2].map(|c| if channels[c].0 > 0.0 { outer * cosine * channels[c].1[cell] } else { 0.0 })
        };
        let derivatives = (0..grid.len()).map(derivative).collect();
        Ok(TableGradient { value, grid: grid.cells(), derivatives })
    }
}
