//! An exported metric as a [`Metric`]: descriptors of two BRDFs, then its regressor.
//!
//! Cost: that of the descriptors, see [`BrdfFeatures`]; the regressor takes less than a millisecond.

use super::exported::{ExportedError, ExportedMetric, Score};
use crate::brdf::Brdf;
use crate::descriptor::{BrdfFeatures, Setup};
use crate::io::read_at_most;
use crate::metric::{Metric, MetricError, PreparedMetric, Properties};
use std::path::Path;
use std::sync::Arc;

/// Far more than an ensemble of networks needs.
const MOST_BYTES: u64 = 256 << 20;

/// The text of the metric that comes with the library.
const SHIPPED: &str = include_str!("vernis.vernis.json");

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

    /// Reads a `*.vernis.json` file whose descriptors need no light probe and no mesh.
    ///
    /// # Errors
    /// A file that cannot be read, is no exported metric, is of a newer format, or takes other descriptors.
    pub fn load(path: &Path) -> Result<Self, ExportedError> {
        let file = path.display().to_string();
        let unreadable = |reason: String| ExportedError::Read { file: file.clone(), reason };
        let bytes = read_at_most(path, MOST_BYTES).map_err(|e| unreadable(e.to_string()))?;
        let text = String::from_utf8(bytes).map_err(|e| unreadable(e.to_string()))?;
        Self::parse(&text, &file)
    }

    /// The metric `vernis` that comes with the library, trained on the open part of the study of Lavoué et al. 2021.
    pub fn shipped() -> Result<Self, ExportedError> {
        Self::parse(SHIPPED, "the embedded metric")
    }

    fn parse(text: &str, file: &str) -> Result<Self, ExportedError> {
        let setup = Setup::standard();
        Ok(Self { exported: ExportedMetric::parse(text, file, &setup)?, setup })
    }

    /// What computes the descriptors.
    pub fn setup(&self) -> &Setup {
        &self.setup
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

    /// The distance before it is cut off at zero ([`ExportedMetric::signed_distance`]).
    pub fn signed_distance(&self, reference: &BrdfFeatures, candidate: &BrdfFeatures) -> Result<f64, MetricError> {
        let raw = self.exported.descriptors.set.compare(reference, candidate, &self.setup);
        let failed = |e: ExportedError| MetricError::Unusable { side: "descriptors", reason: e.to_string() };
        self.exported.signed_distance(&raw).map_err(failed)
    }

    /// As [`LearnedMetric::score`], from the BRDFs themselves.
    pub fn compare(&self, reference: &dyn Brdf, candidate: &dyn Brdf) -> Result<Score, MetricError> {
        self.score(&self.features(reference, "reference")?, &self.features(candidate, "candidate")?)
    }
}

impl Metric for LearnedMetric {
    fn name(&self) -> &str {
        &self.exported.name
    }

    fn properties(&self) -> Properties {
        let made_of = if self.exported.provenance.synthetic { "SYNTHETIC ratings" } else { "human ratings" };
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

    fn as_learned(&self) -> Option<&LearnedMetric> {
        Some(self)
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
