//! An exported metric that computes its own descriptors: from two BRDFs to a score.
//!
//! Cost: sampling a BRDF and taking its pictures, about 20 ms (once a reference when prepared), then about 1 ms a pair.

use super::exported::{DescriptorSet as ExportedSet, ExportedError, ExportedMetric, KnownDescriptors, Score};
use crate::brdf::Brdf;
use crate::descriptor::{BrdfFeatures, DescriptorSet, Setup};
use crate::metric::{Metric, MetricError, PreparedMetric, Properties};
use std::path::Path;
use std::sync::Arc;

/// Name of the descriptor set that exported metrics take.
pub const COMPACT: &str = "compact-48";

/// The text of the metric that comes with the library, `vernis`.
const SHIPPED: &str = include_str!("vernis.vernis.json");

/// Which descriptors an exported metric trained with `setup` takes.
pub fn compact_descriptors(setup: &Setup) -> ExportedSet {
    ExportedSet { set: COMPACT.to_owned(), setup: setup.id().to_owned() }
}

/// A learned metric, ready to compare BRDFs.
#[derive(Debug, Clone)]
pub struct LearnedMetric {
    exported: ExportedMetric,
    set: DescriptorSet,
    /// For each input of the regressor, its position among the descriptors of the set.
    order: Vec<usize>,
    setup: Arc<Setup>,
}

impl LearnedMetric {
    /// Reads the text of a `*.vernis.json` file, which `file` names in errors, for descriptors computed with `setup`.
    ///
    /// # Errors
    /// Text that is not an exported metric, one of a newer format, or one trained on other descriptors than `setup` gives.
    pub fn parse(text: &str, file: &str, setup: Arc<Setup>) -> Result<Self, ExportedError> {
        let set = DescriptorSet::compact();
        let columns: Vec<String> = set.columns().into_iter().map(|c| c.name).collect();
        let known = KnownDescriptors { descriptors: compact_descriptors(&setup), columns };
        let exported = ExportedMetric::parse(text, file, std::slice::from_ref(&known))?;
        let position = |name: &String| {
            known.columns.iter().position(|c| c == name).ok_or_else(|| ExportedError::UnknownColumn {
                file: file.to_owned(),
                set: COMPACT.to_owned(),
                column: name.clone(),
            })
        };
        let order = exported.regressor.inputs.iter().map(|i| position(&i.name)).collect::<Result<_, _>>()?;
        Ok(Self { exported, set, order, setup })
    }

    /// Reads a file whose descriptors need no light probe and no mesh.
    pub fn load(path: &Path) -> Result<Self, ExportedError> {
        Self::load_with(path, Setup::standard())
    }

    /// Reads a file whose descriptors are computed with `setup`.
    pub fn load_with(path: &Path, setup: Arc<Setup>) -> Result<Self, ExportedError> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path)
            .map_err(|e| ExportedError::Read { file: file.clone(), reason: e.to_string() })?;
        Self::parse(&text, &file, setup)
    }

    /// The metric that comes with the library, trained on the open part of the study of Lavoué et al. 2021.
    pub fn shipped() -> Result<Self, ExportedError> {
        Self::parse(SHIPPED, "the embedded metric", Setup::standard())
    }

    pub fn exported(&self) -> &ExportedMetric {
        &self.exported
    }

    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// What the metric keeps of a BRDF; `side` names it in errors.
    pub fn features(&self, brdf: &dyn Brdf, side: &'static str) -> Result<BrdfFeatures, MetricError> {
        BrdfFeatures::compute(brdf, &self.setup)
            .map_err(|e| MetricError::Unusable { side, reason: e.to_string() })
    }

    /// Distance, mean opinion score and its interval.
    pub fn score_features(&self, reference: &BrdfFeatures, candidate: &BrdfFeatures) -> Result<Score, MetricError> {
        let raw = self.set.compare(reference, candidate, &self.setup);
        let inputs: Vec<f64> = self.order.iter().map(|&i| raw[i]).collect();
        self.exported
            .score(&inputs)
            .map_err(|e| MetricError::Unusable { side: "descriptors", reason: e.to_string() })
    }

    /// As [`LearnedMetric::score_features`], from the BRDFs themselves.
    pub fn score(&self, reference: &dyn Brdf, candidate: &dyn Brdf) -> Result<Score, MetricError> {
        self.score_features(&self.features(reference, "reference")?, &self.features(candidate, "candidate")?)
    }
}

impl Metric for LearnedMetric {
    fn name(&self) -> &str {
        &self.exported.name
    }

    fn properties(&self) -> Properties {
        let p = &self.exported.provenance;
        let synthetic = if p.synthetic { " by SYNTHETIC observers" } else { "" };
        Properties {
            unit: "MOS below that of identical BRDFs",
            symmetric: false,
            usable_as_loss: true,
            summary: format!(
                "learned, version {}, from {} pairs of {} materials of {}, rated{synthetic}",
                self.exported.metric_version, p.rows, p.materials, p.study
            ),
            source: "this library; ratings of Lavoue et al. 2021, doi:10.1111/cgf.142636, unless synthetic",
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
        Ok(self.metric.score_features(&self.reference, &candidate)?.distance)
    }
}
