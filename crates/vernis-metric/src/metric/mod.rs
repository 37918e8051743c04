//! Distances between BRDFs: the trait, the classical metrics, the learned ones, and the registry of all by name.

pub mod graph;
pub mod kernel;
pub mod learned;
pub mod lp;
pub mod registry;
pub mod transport;

use crate::brdf::{Brdf, Grid};
use crate::io::did_you_mean;
use crate::math::{Rgb, Vec3};
use graph::{GraphGrid, GraphMetric};
use learned::LearnedMetric;
use lp::LpVariant;
use thiserror::Error;

/// What a user must know of a metric before using it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Properties {
    /// Unit of the distance, `"1"` where it has none.
    pub unit: &'static str,
    /// `distance(a, b) == distance(b, a)`.
    pub symmetric: bool,
    /// Can drive a fit: cheap enough, and without flat regions by design.
    pub usable_as_loss: bool,
    /// One line for lists.
    pub summary: String,
    /// Paper, equation, DOI.
    pub source: &'static str,
}

#[derive(Debug, Clone, PartialEq, Error)]
pub enum MetricError {
    #[error("{side}: {reason}")]
    Unusable { side: &'static str, reason: String },
    #[error("{metric}: the distance is {value}, which is not a finite number")]
    NotFinite { metric: String, value: f64 },
    #[error("{metric}: reference and candidate have no valid cell in common")]
    NoCommonCell { metric: String },
    #[error("{side}: the BRDF has no valid cell on the grid of the metric")]
    NoValidCell { side: &'static str },
    #[error(
        "{metric}: different grids, the reference on {reference}, the candidate on {candidate}; allowed: the same grid"
    )]
    DifferentGrids { metric: String, reference: String, candidate: String },
    #[error("{metric}: {reason}")]
    NotComputed { metric: String, reason: String },
    #[error("no table was made for the grid {grid}")]
    NoTable { grid: GraphGrid },
    #[error("{metric}: the distance has no gradient")]
    NoGradient { metric: String },
    #[error("{what}: found {found}, allowed: {allowed}")]
    Parameter { what: String, found: String, allowed: String },
    #[error("there is no metric `{name}`; {}", did_you_mean(.nearest))]
    Unknown { name: String, nearest: Vec<String> },
    #[error("the metric that comes with this build cannot be read: {reason}")]
    Shipped { reason: String },
    #[error("the name `{name}` is taken by another metric or group")]
    NameTaken { name: String },
}

/// A distance from a reference to a candidate: exactly zero for identical BRDFs, larger is worse, never NaN.
pub trait Metric: Send + Sync {
    /// The registry name, such as `D9.Cl`.
    fn name(&self) -> &str;

    fn properties(&self) -> Properties;

    /// Pays for the fixed side once: a fit compares one reference with many candidates.
    fn prepare<'a>(&'a self, reference: &dyn Brdf) -> Result<Box<dyn PreparedMetric + 'a>, MetricError>;

    fn distance(&self, reference: &dyn Brdf, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        self.prepare(reference)?.distance(candidate)
    }

    /// The Lp variant that this metric is, if it is one: many of them cost one pass over a pair
    /// ([`registry::distances`]).
    fn as_lp(&self) -> Option<LpVariant> {
        None
    }

    /// The metric on graphs that this is, if it is one: many of them share the tables of a pair
    /// ([`registry::distances`]), and it has a divergence a channel.
    fn as_graph(&self) -> Option<&dyn GraphMetric> {
        None
    }

    /// The learned metric that this is, if it is one: it says more than a distance.
    fn as_learned(&self) -> Option<&LearnedMetric> {
        None
    }
}

/// A metric whose reference is fixed.
pub trait PreparedMetric: Send + Sync {
    fn distance(&self, candidate: &dyn Brdf) -> Result<f64, MetricError>;

    /// The gradient with respect to the candidate, where the metric has one.
    fn as_differentiable(&self) -> Option<&dyn DifferentiableMetric> {
        None
    }
}

/// A metric, its reference fixed, whose distance has a gradient with respect to the candidate.
pub trait DifferentiableMetric: PreparedMetric {
    /// The distance and its derivatives with respect to the candidate's values.
    ///
    /// # Errors
    /// Those of [`PreparedMetric::distance`]; [`MetricError::NoGradient`].
    fn gradient(&self, candidate: &dyn Brdf) -> Result<TableGradient, MetricError>;
}

/// How a distance changes with the values of the candidate at the cells where the metric looks.
///
/// An optimiser of tables steps along `derivatives`. The derivative with respect to a parameter p of a model f is the chain
/// rule's: sum over cells and channels of `derivatives[cell][channel]` * df/dp at `grid.directions(cell)`.
#[derive(Debug, Clone, PartialEq)]
pub struct TableGradient {
    /// The distance itself.
    pub value: f64,
    /// The cells.
    pub grid: Grid,
    /// d value / d f (R, G, B), f the BRDF (1/sr, cosine not included) at the directions of each cell of `grid`; 0 for cells
    /// that take no part, and everywhere where both BRDFs are the same. A candidate that is a table on another grid is
    /// resampled to this one first, which the derivatives do not follow.
    pub derivatives: Vec<[f64; 3]>,
}

impl TableGradient {
    /// The derivative along a change of the candidate: `change(wi, wo)` is the derivative of its value (R, G, B).
    pub fn along(&self, mut change: impl FnMut(Vec3, Vec3) -> Rgb) -> f64 {
        let directions = self.grid.all_directions();
        let term = |(cell, d): (usize, &[f64; 3])| {
            if *d == [0.0; 3] {
                return 0.0;
            }
            let (wi, wo) = directions.get(cell);
            let change = change(wi, wo);
            (0..3).map(|c| d[c] * change[c]).sum()
        };
        self.derivatives.iter().enumerate().map(term).sum()
    }
}
