//! Learned metrics as losses, and the way to their minima.
//!
//! A learned distance is cut off at zero, where the network thinks a candidate no worse than a copy: flat ground for a search.
//! The loss is the number before that, in MOS, and may be negative.
//!
//! Learned metrics have rough landscapes: they were trained on few pairs, and a search from afar ends in the next hollow. The
//! cure is to start from a fit under the logarithm and to let the learned metric in by degrees,
//!
//!   blend_t = (1 - t) s log + t learned,   s = learned/log at the start, so that both count the same.

use super::{Loss, or_infinite};
use crate::brdf::Brdf;
use crate::brdf::models::AnalyticBrdf;
use crate::descriptor::BrdfFeatures;
use crate::metric::MetricError;
use crate::metric::learned::LearnedMetric;

/// A learned metric whose reference is fixed.
pub struct LearnedLoss<'a> {
    metric: &'a LearnedMetric,
    reference: BrdfFeatures,
}

impl<'a> LearnedLoss<'a> {
    /// # Errors
    /// Those of [`LearnedMetric::features`].
    pub fn new(metric: &'a LearnedMetric, reference: &dyn Brdf) -> Result<Self, MetricError> {
        Ok(Self { metric, reference: metric.features(reference, "reference")? })
    }
}

impl Loss for LearnedLoss<'_> {
    fn name(&self) -> &str {
        &self.metric.exported().name
    }

    fn value(&self, candidate: &dyn AnalyticBrdf) -> Result<f64, MetricError> {
        let features = self.metric.features(candidate, "candidate");
        or_infinite(features.and_then(|f| self.metric.signed_distance(&self.reference, &f)))
    }
}

/// (1 - t) s a + t b.
pub struct Blend<'a> {
    pub a: &'a dyn Loss,
    pub b: &'a dyn Loss,
    /// s.
    pub scale: f64,
    /// Between 0 and 1.
    pub t: f64,
}

impl Loss for Blend<'_> {
    fn name(&self) -> &str {
        self.b.name()
    }

    fn value(&self, candidate: &dyn AnalyticBrdf) -> Result<f64, MetricError> {
        Ok((1.0 - self.t) * self.scale * self.a.value(candidate)? + self.t * self.b.value(candidate)?)
    }
}
