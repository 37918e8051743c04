//! Distances between BRDFs: the trait, the classical metrics, the learned ones, and the registry of all by name.

pub mod graph;
pub mod kernel;
pub mod learned;
pub mod lp;
mod nodes;
pub mod registry;
mod share;
pub mod transport;

pub use nodes::{Gradient, Nodes};
pub use share::{PreparedMetrics, PreparedResult, PreparedShare, Share, ShareKey, groups};

use crate::brdf::{Brdf, IdentifiedBrdf};
use crate::descriptor::{Cache, CacheWarning};
use crate::io::did_you_mean;
use crate::math::rating_scale::RatingScale;
use crate::math::{Rgb, Vec3};
use graph::GraphGrid;
use serde::{Deserialize, Serialize};
use std::any::Any;
use std::fmt;
use std::sync::Arc;
use thiserror::Error;

/// What a user must know of a metric before using it.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Properties {
    /// Metrics of one kind, for tables and ablations, such as `lp`; empty for a kind of its own.
    pub family: &'static str,
    /// Unit of the distance, `"1"` where it has none.
    pub unit: &'static str,
    /// `distance(a, b) == distance(b, a)`.
    pub symmetric: bool,
    /// Can drive a fit: cheap enough, and without flat regions by design.
    pub usable_as_loss: bool,
    /// [`PreparedMetric::gradient_at`] works: it has a gradient with respect to the candidate's values.
    pub differentiable: bool,
    /// Its landscape has hollows: a fit starts near the minimum of a smoother metric and lets this one in by degrees.
    pub rough: bool,
    /// It was learned from simulated observers: its numbers say nothing about people.
    pub synthetic: bool,
    /// One line for lists.
    pub summary: String,
    /// Paper, equation, DOI.
    pub source: &'static str,
}

/// What an error of a comparison is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Side {
    /// The fixed BRDF.
    Reference,
    /// The BRDF that approximates it.
    Candidate,
    /// Both together, such as a descriptor of the pair.
    Pair,
    /// A BRDF that is compared with nothing yet.
    Alone,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Reference => "reference",
            Self::Candidate => "candidate",
            Self::Pair => "reference and candidate",
            Self::Alone => "the BRDF",
        })
    }
}

/// Why there is no distance.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum MetricError {
    #[error("{side}: {reason}")]
    Unusable { side: Side, reason: String },
    #[error("{metric}: the distance is {value}; it must be a finite number")]
    NotFinite { metric: String, value: f64 },
    #[error("{metric}: reference and candidate have no valid cell in common")]
    NoCommonCell { metric: String },
    #[error("{side}: the BRDF has no valid cell on the grid of the metric")]
    NoValidCell { side: Side },
    #[error(
        "{metric}: reference and candidate have different grids, {reference} and {candidate}; they must have the same grid"
    )]
    DifferentGrids { metric: String, reference: String, candidate: String },
    #[error("{metric}: {reason}")]
    NotComputed { metric: String, reason: String },
    /// The values of `side` spread further than the method can follow.
    #[error("{metric}: {reason}")]
    TooWide { metric: String, side: Side, reason: String },
    #[error("{metric}: the distance has no gradient")]
    NoGradient { metric: String },
    #[error("the metric cannot work on values: it has no nodes, and no gradient")]
    NoNodes,
    #[error("{metric}: {found} values were given; the nodes `{nodes}` take {expected}, one RGB value a node")]
    ValueCount { metric: String, nodes: String, found: usize, expected: usize },
    /// `channel` is 0 to 2, red to blue.
    #[error(
        "node {node} of `{nodes}` (wi {}, wo {}): {} is {value}; it must be finite and not negative",
        coordinates(.wi), coordinates(.wo), ["red", "green", "blue"][*.channel % 3]
    )]
    NodeValue { nodes: String, node: usize, wi: Vec3, wo: Vec3, channel: usize, value: f64 },
    #[error("{what} is {found}; it must be {allowed}")]
    Parameter { what: String, found: String, allowed: String },
    #[error("{name}: {metric} is one metric and has no options")]
    NoOptions { metric: String, name: String },
    #[error("there is no metric `{name}`; {}", did_you_mean(.nearest))]
    Unknown { name: String, nearest: Vec<String> },
    #[error("the metric that comes with this build cannot be read: {reason}")]
    Shipped { reason: String },
    #[error("the name `{name}` is taken by another metric or group")]
    NameTaken { name: String },
}

fn coordinates(w: &Vec3) -> String {
    format!("[{:.4}, {:.4}, {:.4}]", w.x, w.y, w.z)
}

impl MetricError {
    /// Whether another candidate may have a distance to the same reference: its values are what is wrong. A search counts such a
    /// candidate as infinitely bad and turns round; any other error ends it.
    pub fn is_about_candidate_values(&self) -> bool {
        match self {
            Self::NotFinite { .. } | Self::NodeValue { .. } => true,
            Self::Unusable { side, .. } | Self::NoValidCell { side } | Self::TooWide { side, .. } => {
                matches!(side, Side::Candidate | Side::Pair)
            }
            _ => false,
        }
    }
}

/// What a metric that was learned from ratings predicts for a pair.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// In points of mean opinion score (MOS) worse than identical BRDFs, 0 or more: identical BRDFs get 0, larger is worse.
    pub distance: f64,
    /// Mean opinion score, on the scale.
    pub mos: f64,
    /// Lower end of the interval, on the scale.
    pub low: f64,
    /// Upper end of the interval, on the scale.
    pub high: f64,
    /// The scale of the ratings that the metric was learned from.
    pub scale: RatingScale,
}

/// The score and its interval in words, such as `predicted MOS 4.21 of 5, 95 % between 3.70 and 4.60`.
impl fmt::Display for Score {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [mos, low, high] = [self.mos, self.low, self.high].map(|x| self.scale.show(x));
        if self.scale.is_grades() {
            return write!(f, "predicted MOS {mos} of 5, 95 % between {low} and {high}");
        }
        write!(f, "predicted score {mos} on {}, 95 % between {low} and {high}", self.scale)
    }
}

/// What a metric says of a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// The distance.
    pub value: f64,
    /// The distance of each channel alone (R, G, B), where the metric has one.
    pub channels: Option<[f64; 3]>,
    /// Mean opinion score and its interval, where the metric was learned from ratings.
    pub score: Option<Score>,
}

impl Measured {
    /// A distance and no more.
    pub fn distance(value: f64) -> Self {
        Self { value, channels: None, score: None }
    }

    /// The distance, those of the channels, and the score with its interval: each must be finite.
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        let channels = self.channels.into_iter().flatten();
        let score = self.score.into_iter().flat_map(|s| [s.distance, s.mos, s.low, s.high]);
        std::iter::once(self.value).chain(channels).chain(score)
    }
}

/// A distance from a reference to a candidate: exactly zero for identical BRDFs, larger is worse, never NaN.
///
/// Four methods make a metric. The others say what it has in common with other metrics, what a fit may do with it, and which
/// members its family has; their defaults are right for a metric that stands alone.
pub trait Metric: Any + Send + Sync {
    /// The registry name, such as `D9.Cl`.
    fn name(&self) -> &str;

    /// The version of its numbers: it changes whenever a distance changes by more than rounding. Caches, journals, extracted
    /// studies, fits and reports carry it, so that numbers of two versions never mix. It stands beside the algorithm.
    fn version(&self) -> &str;

    /// What a user must know of it: family, unit, symmetry, use as a loss.
    fn properties(&self) -> Properties;

    /// Pays for the fixed side once: a fit compares one reference with many candidates. What is prepared owns all it needs.
    ///
    /// # Errors
    /// A reference that the metric cannot compare with anything.
    fn prepare(&self, reference: &dyn Brdf) -> Result<Box<dyn PreparedMetric>, MetricError>;

    /// # Errors
    /// Those of [`Metric::prepare`] and [`PreparedMetric::distance`].
    fn distance(&self, reference: &dyn Brdf, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        self.prepare(reference)?.distance(candidate)
    }

    /// What decides its numbers: name and version, and whatever else a metric of the same name may differ in. Part of the keys
    /// under which distances are kept.
    fn identity(&self) -> String {
        format!("{} {}", self.name(), self.version())
    }

    /// Its part in work that it does together with other metrics ([`PreparedMetrics`]).
    fn share(&self) -> Option<Share> {
        None
    }

    /// The member of this metric's family that `name` describes, such as `energy[alpha=0.05]`.
    ///
    /// # Errors
    /// [`MetricError::Parameter`] for an unknown option or a value out of range, and where the metric has no options.
    fn member(&self, name: &str) -> Result<Arc<dyn Metric>, MetricError> {
        Err(MetricError::NoOptions { metric: self.name().to_owned(), name: name.to_owned() })
    }

    /// The same metric on `grid`, unless its name says which grid it is for; `None` where it looks at no grid of cells.
    fn on_grid(&self, _grid: GraphGrid) -> Option<Arc<dyn Metric>> {
        None
    }

    /// The same metric at about one of `coarsening` cells along each axis, for the search of a fit; `None` where it cannot be
    /// had with fewer.
    fn coarser(&self, _coarsening: usize) -> Option<Arc<dyn Metric>> {
        None
    }

    /// What [`PreparedMetric::measure`] gives, by what the cache keeps of each table: one that it knows is not decoded. `None` where the
    /// metric keeps nothing of a single BRDF.
    ///
    /// # Errors
    /// Those of [`Metric::prepare`] and [`PreparedMetric::measure`]; a BRDF that cannot be decoded is [`MetricError::Unusable`].
    fn measure_kept(
        &self,
        _reference: &IdentifiedBrdf,
        _candidate: &IdentifiedBrdf,
        _cache: &Cache,
    ) -> Option<Result<(Measured, Vec<CacheWarning>), MetricError>> {
        None
    }

    /// Takes what every comparison needs, whatever the BRDFs, from the cache, or makes and keeps it there.
    fn warm_up(&self, _cache: &Cache) -> Option<CacheWarning> {
        None
    }
}

/// A metric whose reference is fixed.
pub trait PreparedMetric: Send + Sync {
    /// # Errors
    /// A candidate that the metric cannot compare with the reference, a distance that is not finite.
    fn distance(&self, candidate: &dyn Brdf) -> Result<f64, MetricError>;

    /// All that the metric says of the candidate.
    ///
    /// # Errors
    /// Those of [`PreparedMetric::distance`].
    fn measure(&self, candidate: &dyn Brdf) -> Result<Measured, MetricError> {
        self.distance(candidate).map(Measured::distance)
    }

    /// What a fit minimises: the distance, before it is cut off at zero where that is done. It may be negative.
    ///
    /// # Errors
    /// Those of [`PreparedMetric::distance`].
    fn loss(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        self.distance(candidate)
    }

    /// The directions at which the metric looks, shared by all prepared metrics of the process that look there; `None` for a metric
    /// that cannot work on values.
    fn nodes(&self) -> Option<Arc<Nodes>> {
        None
    }

    /// The distance to a candidate that is given by its values on [`PreparedMetric::nodes`]: linear RGB, 1/sr, cosine not included,
    /// one a node. For the values that [`Nodes::evaluate`] gives of a BRDF without missing measurements it is the distance to that BRDF,
    /// to the last bit unless the metric says otherwise.
    ///
    /// # Errors
    /// [`MetricError::NoNodes`]; [`MetricError::ValueCount`]; [`MetricError::NodeValue`] for a value that is negative or not
    /// finite, missing measurements included; those of [`PreparedMetric::distance`].
    fn distance_at(&self, _values: &[Rgb]) -> Result<f64, MetricError> {
        Err(MetricError::NoNodes)
    }

    /// The same distance and its derivatives with respect to these values.
    ///
    /// # Errors
    /// Those of [`PreparedMetric::distance_at`]; [`MetricError::NoGradient`].
    fn gradient_at(&self, _values: &[Rgb]) -> Result<Gradient, MetricError> {
        Err(MetricError::NoNodes)
    }

    /// What a fit minimises ([`PreparedMetric::loss`]) and its derivatives.
    ///
    /// # Errors
    /// Those of [`PreparedMetric::gradient_at`].
    fn loss_gradient_at(&self, values: &[Rgb]) -> Result<Gradient, MetricError> {
        self.gradient_at(values)
    }

    /// The power of the distance that is smooth where both sides agree: 2 for a root of a mean square.
    fn smooth_power(&self) -> f64 {
        1.0
    }
}
