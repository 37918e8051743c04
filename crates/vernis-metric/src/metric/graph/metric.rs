//! What the metrics on graphs have in common.

use super::{CosineTable, GraphGrid};
use crate::brdf::Brdf;
use crate::metric::{DifferentiableMetric, Metric, MetricError, PreparedMetric, TableGradient};
use std::borrow::Cow;
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

    /// Does once what depends on the reference alone.
    ///
    /// # Errors
    /// A table without a valid cell or with values that are too large; parameters that the grid is too fine for.
    fn prepare_table<'a>(&'a self, reference: Cow<'a, CosineTable>)
    -> Result<Box<dyn PreparedTable + 'a>, MetricError>;

    /// The divergence of each channel (R, G, B) of two tables.
    ///
    /// # Errors
    /// Those of [`GraphMetric::prepare_table`] and [`PreparedTable::channels`].
    fn channels(&self, reference: &CosineTable, candidate: &CosineTable) -> Result<[f64; 3], MetricError> {
        self.prepare_table(Cow::Borrowed(reference))?.channels(candidate)
    }
}

/// A metric on graphs, its reference fixed.
pub trait PreparedTable: Send + Sync {
    /// The divergence of each channel (R, G, B), not negative but for rounding.
    ///
    /// # Errors
    /// Tables on different grids, no cell in common, values that are too large for a finite divergence.
    fn channels(&self, candidate: &CosineTable) -> Result<[f64; 3], MetricError>;

    /// The divergences with their gradients.
    ///
    /// # Errors
    /// Those of [`PreparedTable::channels`]; [`MetricError::NoGradient`] where there is none.
    fn gradients(&self, candidate: &CosineTable) -> Result<ChannelGradients, MetricError>;
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

/// A metric on graphs as a metric on BRDFs.
pub struct PreparedGraph<'a> {
    metric: &'a dyn GraphMetric,
    reference: Box<dyn PreparedTable + 'a>,
}

impl<'a> PreparedGraph<'a> {
    /// # Errors
    /// A reference without a valid cell on the metric's grid, and those of [`GraphMetric::prepare_table`].
    pub fn new(metric: &'a dyn GraphMetric, reference: &dyn Brdf) -> Result<Self, MetricError> {
        let table = CosineTable::of(reference, metric.grid(), "reference")?;
        Ok(Self { metric, reference: metric.prepare_table(Cow::Owned(table))? })
    }

    fn candidate(&self, candidate: &dyn Brdf) -> Result<CosineTable, MetricError> {
        CosineTable::of(candidate, self.metric.grid(), "candidate")
    }
}

impl PreparedMetric for PreparedGraph<'_> {
    fn distance(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        let channels = self.reference.channels(&self.candidate(candidate)?)?;
        combine(self.metric.name(), channels, self.metric.gamma())
    }

    fn as_differentiable(&self) -> Option<&dyn DifferentiableMetric> {
        Some(self)
    }
}

impl DifferentiableMetric for PreparedGraph<'_> {
    fn gradient(&self, candidate: &dyn Brdf) -> Result<TableGradient, MetricError> {
        table_gradient(self.metric, &self.reference.gradients(&self.candidate(candidate)?)?)
    }
}

/// The scalar of the study and its gradient, from those of the channels.
///
/// # Errors
/// Those of [`combine`].
fn table_gradient(metric: &dyn GraphMetric, channels: &ChannelGradients) -> Result<TableGradient, MetricError> {
    let grid = metric.grid();
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
