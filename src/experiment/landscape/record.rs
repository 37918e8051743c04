//! What the experiment finds.

use serde::{Deserialize, Serialize};

/// Sweeps, landscapes and odd pairs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LandscapeRecord {
    /// The metrics, in the order in which they were asked for: the order of every list by metric below.
    pub metrics: Vec<MetricNote>,
    /// Candidates of a sweep between the reference and the end of what people rated, in each direction.
    pub points: usize,
    /// Points of a landscape from one end to the other.
    pub steps: usize,
    /// By material, then by parameter.
    pub sweeps: Vec<Sweep>,
    /// By material: one a parameter, then the way from a wrong start to a fit.
    pub lines: Vec<Line>,
    /// Pairs of which everybody knows how different they look, or that have no measure.
    pub pairs: Vec<OddPair>,
}

/// A metric of the record.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MetricNote {
    /// Its registry name.
    pub name: String,
    /// The version of its numbers.
    pub version: String,
    /// The unit of its distance: `MOS` of metrics that were learned from ratings.
    pub unit: String,
}

impl MetricNote {
    /// Whether the distance is in points of mean opinion score.
    pub fn is_in_mos(&self) -> bool {
        self.unit == super::MOS
    }
}

/// The distances of a material to itself with one parameter changed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sweep {
    /// Name of the material.
    pub material: String,
    /// Name of the parameter.
    pub parameter: String,
    /// Unit of its values.
    pub unit: String,
    /// Its value in the material itself.
    pub reference: f64,
    /// Smallest and largest value within what people rated.
    pub rated: (f64, f64),
    /// Whether equal steps are equal ratios.
    pub logarithmic: bool,
    /// How far a distance may fall on the way out, in MOS.
    pub allowed: f64,
    /// Values of the parameter, ascending; the reference is among them.
    pub values: Vec<f64>,
    /// One entry a metric.
    pub of_metric: Vec<Swept>,
}

/// The distances of one metric along a sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Swept {
    /// One a value, in the metric's unit.
    pub distances: Vec<f64>,
    /// Towards smaller values; `None` where the reference is the smallest.
    pub down: Option<Fall>,
    /// Towards larger values; `None` where the reference is the largest.
    pub up: Option<Fall>,
}

impl Swept {
    /// The larger fall of the two directions within what people rated.
    pub fn rated_fall(&self) -> f64 {
        self.down.iter().chain(&self.up).map(|fall| fall.rated).fold(0.0, f64::max)
    }
}

/// The largest fall of a distance on the way out from the reference, in the metric's unit; 0 where it only rises.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fall {
    /// Within what people rated.
    pub rated: f64,
    /// Along the whole sweep.
    pub whole: f64,
}

/// What a fit minimises along a line of candidates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// Name of the material.
    pub material: String,
    /// Name of the parameter, or [`super::FROM_START`].
    pub name: String,
    /// Unit of `values`.
    pub unit: String,
    /// Whether equal steps are equal ratios.
    pub logarithmic: bool,
    /// Index of the reference, or of the fit.
    pub reference: usize,
    /// Values of the parameter, ascending; along the way from a wrong start, the share of that way, 0 at the fit and 1 at the start.
    pub values: Vec<f64>,
    /// One entry a metric.
    pub of_metric: Vec<Course>,
}

/// The loss of one metric along a line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Course {
    /// One a value, in the metric's unit; a loss may be below zero.
    pub losses: Vec<f64>,
    /// The loss at the end of the line: at the largest value, or at the smallest where the reference is the largest.
    pub end: f64,
    /// The value at which the loss is lowest.
    pub lowest_at: f64,
    /// Depth of the deepest hollow beside the lowest point, as a share of `end`; `None` where `end` is not above zero.
    pub hollow: Option<f64>,
    /// Largest change of slope between neighbouring segments, but at the reference and at the lowest point, where a distance has its
    /// corner; in `end` per length of the line. `None` where `end` is not above zero.
    pub bend: Option<f64>,
}

impl Course {
    /// The losses as shares of the one at the end of the line; `None` where that is not above zero.
    pub fn scaled(&self) -> Option<Vec<f64>> {
        (self.end > 0.0).then(|| self.losses.iter().map(|loss| loss / self.end).collect())
    }
}

/// A pair of simple surfaces.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OddPair {
    /// What the two are, in a few words.
    pub name: String,
    /// What kind of pair it is: `mirrors`, `blacks`, `metals` or `hue`.
    pub kind: String,
    /// One a metric.
    pub answers: Vec<Answer>,
}

/// What a metric says of an odd pair.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Answer {
    /// The distance, in the metric's unit.
    Distance(f64),
    /// Why it has none.
    Refused(String),
}
