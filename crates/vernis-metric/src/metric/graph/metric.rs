//! What the metrics on graphs have in common.

use super::{CosineTable, GraphGrid};
use crate::brdf::Brdf;
use crate::math::Rgb;
use crate::metric::{Gradient, Measured, Metric, MetricError, Nodes, PreparedMetric, PreparedShare, Share, Side};
use std::sync::Arc;

/// For each channel (R, G, B) the divergence, and its derivatives with respect to the candidate's f cos theta_i, one a cell.
pub type ChannelGradients = [(f64, Vec<f64>); 3];

/// A metric that compares the graphs of two BRDFs, channel by channel. [`share`], [`on_grid`] and [`coarser`] make the methods of
/// [`Metric`] out of it.
pub trait GraphMetric: Metric {
    /// The cells that are compared.
    fn grid(&self) -> GraphGrid;

    /// The same metric on `grid`, unless its name says which grid it is for.
    fn with_default_grid(&self, grid: GraphGrid) -> Arc<dyn GraphMetric>;

    /// The power to which the sum of the channels is taken.
    fn gamma(&self) -> f64;

    /// Does once what depends on the reference alone.
    ///
    /// # Errors
    /// A table without a valid cell or with values that are too large; parameters that the grid is too fine for.
    fn prepare_table(&self, reference: Arc<CosineTable>) -> Result<Box<dyn PreparedTable>, MetricError>;
}

/// [`Metric::share`] of a metric on graphs: metrics on one grid share the tables of both BRDFs.
pub fn share(metric: Arc<dyn GraphMetric>) -> Share {
    Share::new(format!("graph {}", metric.grid()), metric, together)
}

/// [`Metric::on_grid`] of a metric on graphs.
pub fn on_grid(metric: &dyn GraphMetric, grid: GraphGrid) -> Arc<dyn Metric> {
    metric.with_default_grid(grid)
}

/// [`Metric::coarser`] of a metric on graphs: one cell for `coarsening` along each axis, but at least four; `None` where its name
/// says which grid it is for.
pub fn coarser(metric: &dyn GraphMetric, coarsening: usize) -> Option<Arc<dyn Metric>> {
    const FEWEST: usize = 4;
    let [i, o, d] = metric.grid().shape().map(|n| (n / coarsening.max(1)).max(FEWEST));
    let coarse = metric.with_default_grid(GraphGrid::new(i, o, d).ok()?);
    (coarse.grid() != metric.grid()).then_some(coarse as Arc<dyn Metric>)
}

/// The methods of [`Metric`] that all metrics on graphs of this library have in common, for types with a `name`, `named` and `Clone`.
macro_rules! metric_methods {
    () => {
        fn prepare(&self, reference: &dyn Brdf) -> Result<Box<dyn PreparedMetric>, MetricError> {
            Ok(Box::new($crate::metric::graph::PreparedGraph::new(Arc::new(self.clone()), reference)?))
        }

        fn share(&self) -> Option<Share> {
            Some($crate::metric::graph::share(Arc::new(self.clone())))
        }

        /// Name and version, and the grid where the name leaves it open.
        fn identity(&self) -> String {
            format!("{} {} {}", self.name, self.version(), self.grid())
        }

        fn member(&self, name: &str) -> Result<Arc<dyn Metric>, MetricError> {
            Ok(Arc::new(Self::named(name)?))
        }

        fn on_grid(&self, grid: GraphGrid) -> Option<Arc<dyn Metric>> {
            Some($crate::metric::graph::on_grid(self, grid))
        }

        fn coarser(&self, coarsening: usize) -> Option<Arc<dyn Metric>> {
            $crate::metric::graph::coarser(self, coarsening)
        }
    };
}
pub(in crate::metric) use metric_methods;

/// Metrics on one grid.
struct Together {
    grid: GraphGrid,
    prepared: Vec<(Arc<dyn GraphMetric>, Box<dyn PreparedTable>)>,
}

fn together(metrics: Vec<Arc<dyn GraphMetric>>, reference: &dyn Brdf) -> Result<Box<dyn PreparedShare>, MetricError> {
    let grid = metrics.first().map_or(GraphGrid::STUDY, |metric| metric.grid());
    let table = Arc::new(CosineTable::of(reference, grid, Side::Reference)?);
    let prepare = |metric: Arc<dyn GraphMetric>| {
        let prepared = metric.prepare_table(table.clone())?;
        Ok((metric, prepared))
    };
    Ok(Box::new(Together { grid, prepared: metrics.into_iter().map(prepare).collect::<Result<_, MetricError>>()? }))
}

impl PreparedShare for Together {
    fn measure(&self, candidate: &dyn Brdf) -> Result<Vec<Measured>, MetricError> {
        let table = CosineTable::of(candidate, self.grid, Side::Candidate)?;
        self.prepared.iter().map(|(metric, prepared)| measured(&**metric, prepared.channels(&table)?)).collect()
    }
}

fn measured(metric: &dyn GraphMetric, channels: [f64; 3]) -> Result<Measured, MetricError> {
    let value = combine(metric.name(), channels, metric.gamma())?;
    Ok(Measured { value, channels: Some(channels), score: None })
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
pub struct PreparedGraph {
    metric: Arc<dyn GraphMetric>,
    reference: Box<dyn PreparedTable>,
}

impl PreparedGraph {
    /// # Errors
    /// A reference without a valid cell on the metric's grid, and those of [`GraphMetric::prepare_table`].
    pub fn new(metric: Arc<dyn GraphMetric>, reference: &dyn Brdf) -> Result<Self, MetricError> {
        let table = CosineTable::of(reference, metric.grid(), Side::Reference)?;
        let reference = metric.prepare_table(Arc::new(table))?;
        Ok(Self { metric, reference })
    }

    fn candidate(&self, candidate: &dyn Brdf) -> Result<CosineTable, MetricError> {
        CosineTable::of(candidate, self.metric.grid(), Side::Candidate)
    }
}

impl PreparedMetric for PreparedGraph {
    fn distance(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        self.measure(candidate).map(|measured| measured.value)
    }

    fn measure(&self, candidate: &dyn Brdf) -> Result<Measured, MetricError> {
        measured(&*self.metric, self.reference.channels(&self.candidate(candidate)?)?)
    }

    fn nodes(&self) -> Option<Arc<Nodes>> {
        Some(nodes(self.metric.grid()))
    }

    /// For a table the same number but for rounding: values on nodes hold no cosine, and what is divided out is multiplied in again.
    fn distance_at(&self, values: &[Rgb]) -> Result<f64, MetricError> {
        measured(&*self.metric, self.reference.channels(&self.checked(values)?)?).map(|measured| measured.value)
    }

    fn gradient_at(&self, values: &[Rgb]) -> Result<Gradient, MetricError> {
        node_gradient(&*self.metric, &self.reference.gradients(&self.checked(values)?)?)
    }

    fn smooth_power(&self) -> f64 {
        1.0 / self.metric.gamma()
    }
}

impl PreparedGraph {
    fn checked(&self, values: &[Rgb]) -> Result<CosineTable, MetricError> {
        let grid = self.metric.grid();
        nodes(grid).check(self.metric.name(), values)?;
        Ok(CosineTable::of_values(values, grid))
    }
}

/// The cell centres of `grid`.
fn nodes(grid: GraphGrid) -> Arc<Nodes> {
    Nodes::shared(&format!("graph-{grid}"), |id| {
        Nodes::of_cells(id, grid.cells(), grid.shape(), move |table| CosineTable::values_of_table(table, grid))
    })
}

/// The scalar of the study and its gradient, from those of the channels.
///
/// # Errors
/// Those of [`combine`].
fn node_gradient(metric: &dyn GraphMetric, channels: &ChannelGradients) -> Result<Gradient, MetricError> {
    let grid = metric.grid();
    let sum: f64 = channels.iter().map(|(w, _)| w.max(0.0)).sum();
    let value = combine(metric.name(), [0, 1, 2].map(|c| channels[c].0), metric.gamma())?;
    // The slope of s^gamma; where nothing differs, every direction is as good.
    let outer = if sum > 0.0 { metric.gamma() * value / sum } else { 0.0 };
    let [n_i, n_o, n_d] = grid.shape();
    let cosines: Vec<f64> = (0..n_i).map(|i| grid.angle(0, i).cos()).collect();
    let derivative = |cell: usize| {
        let scale = outer * cosines[cell / (n_o * n_d)];
        [0, 1, 2].map(|c| if channels[c].0 > 0.0 { scale * channels[c].1[cell] } else { 0.0 })
    };
    let derivatives = (0..grid.len()).map(derivative).collect();
    Ok(Gradient { value, derivatives })
}
