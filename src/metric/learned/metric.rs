//! An exported metric as a [`Metric`]: descriptors of two BRDFs, then its regressor.
//!
//! Cost: that of the descriptors, see [`BrdfFeatures`]; the regressor takes less than a millisecond.

use super::exported::{ExportedMetric, Score};
use crate::brdf::Brdf;
use crate::descriptor::{BrdfFeatures, Setup};
use crate::metric::{Metric, MetricError, PreparedMetric, Properties};
use std::sync::Arc;

/// An exported metric and what computes its descriptors.
#[derive(Debug, Clone)]
pub struct LearnedMetric {
    exported: ExportedMetric,
    setup: Arc<Setup>,
}

impl LearnedMetric {
    /// `setup` must be the one that `exported` was read or made for.
    pub fn new(exported: ExportedMetric, setup: Arc<Setup>) -> Result<Self, MetricError> {
        if exported.descriptors.setup == setup.id() {
            return Ok(Self { exported, setup });
        }
        Err(MetricError::Unusable {
            side: "metric",
            reason: format!(
                "{} takes descriptors of setup {}, found {}",
                exported.name,
                exported.descriptors.setup,
                setup.id()
            ),
        })
    }

    /// What the file holds.
    pub fn exported(&self) -> &ExportedMetric {
        &self.exported
    }

    /// What depends on one BRDF alone; `side` names it in errors.
    pub fn features(&self, brdf: &dyn Brdf, side: &'static str) -> Result<BrdfFeatures, MetricError> {
        BrdfFeatures::compute(brdf, &self.setup).map_err(|e| MetricError::Unusable { side, reason: e.to_string() })
    }

    /// Distance, mean opinion score and interval.
    pub fn score(&self, reference: &BrdfFeatures, candidate: &BrdfFeatures) -> Result<Score, MetricError> {
        let raw = self.exported.descriptors.set.compare(reference, candidate, &self.setup);
        self.exported.score(&raw).map_err(|e| MetricError::Unusable { side: "descriptors", reason: e.to_string() })
    }
}

impl Metric for LearnedMetric {
    fn name(&self) -> &str {
        &self.exported.name
    }

    fn properties(&self) -> Properties {
        let made_of = if self.exported.provenance.synthetic { "simulated ratings" } else { "human ratings" };
        Properties {
            unit: "MOS",
            symmetric: false,
            usable_as_loss: true,
            summary: format!(
                "learned from {made_of} of {} pairs ({}), version {}",
                self.exported.provenance.rows, self.exported.provenance.study, self.exported.metric_version
            ),
            source: "vernis; see the model card",
        }
    }

    fn prepare<'a>(&'a self, reference: &dyn Brdf) -> Result<Box<dyn PreparedMetric + 'a>, MetricError> {
        Ok(Box::new(Prepared { metric: self, reference: self.features(reference, "reference")? }))
    }
}

struct Prepared<'a> {
    metric: &'a LearnedMetric,
    reference: BrdfFeatures,
}

impl PreparedMetric for Prepared<'_> {
    fn distance(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        let candidate = self.metric.features(candidate, "candidate")?;
        Ok(self.metric.score(&self.reference, &candidate)?.distance)
    }
}
