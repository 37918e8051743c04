//! The judges of fits to one reference.

use super::OPINION;
use super::run::Probe;
use std::collections::BTreeMap;
use std::sync::Arc;
use vernis_metric::brdf::Brdf;
use vernis_metric::descriptor::{BrdfFeatures, DescriptorError, DescriptorSet, Family, Setup};
use vernis_metric::metric::learned::LearnedMetric;
use vernis_metric::metric::lp::{LpDistances, LpReference};
use vernis_metric::metric::{Metric, MetricError, PreparedMetric, PreparedMetrics, Side};

/// Lp distances that judge.
const LP: [&str; 4] = ["D1", "D4.Cl", "D4.Cl.CR", "D9.Cl"];
/// What is taken of the pictures under a probe: the ending of the judge's name, and the descriptor.
const PICTURES: [(&str, &str); 2] = [("log", "lights.dE4"), ("screen", "display.lamps.rms")];

/// Who judges beside the Lp distances.
pub(super) struct Panel<'a> {
    /// Transport, energy.
    pub graphs: &'a [Arc<dyn Metric>; 2],
    /// The learned metric that has seen neither reference nor fits.
    pub opinion: &'a LearnedMetric,
    /// Metrics on stimuli, and what they are called as judges.
    pub images: (&'a [Arc<dyn Metric>], Vec<&'a str>),
    /// Light probes under which pictures are compared.
    pub probes: &'a [Probe],
}

/// The judges, their reference fixed.
pub(super) struct Judges<'a> {
    lp: LpReference,
    graphs: [Box<dyn PreparedMetric>; 2],
    opinion: (&'a LearnedMetric, BrdfFeatures),
    images: PreparedMetrics,
    /// What the metrics on stimuli are called as judges.
    image_names: Vec<&'a str>,
    probes: Vec<(&'a Probe, BrdfFeatures)>,
}

impl<'a> Judges<'a> {
    pub fn new(reference: &dyn Brdf, panel: Panel<'a>) -> Result<Self, MetricError> {
        let Panel { graphs, opinion: judge, images: (images, image_names), probes } = panel;
        Ok(Self {
            lp: LpReference::new(reference)?,
            graphs: [graphs[0].prepare(reference)?, graphs[1].prepare(reference)?],
            opinion: (judge, judge.features(reference, Side::Reference)?),
            images: PreparedMetrics::new(images, reference)?,
            image_names,
            probes: probes
                .iter()
                .map(|probe| Ok((probe, features(reference, &probe.setup, Side::Reference)?)))
                .collect::<Result<_, MetricError>>()?,
        })
    }

    /// What every judge says.
    pub fn judge(&self, candidate: &dyn Brdf) -> Result<BTreeMap<String, f64>, MetricError> {
        let mut judged = BTreeMap::new();
        let distances = LpDistances::of_study_from(&self.lp, candidate)?;
        for name in LP {
            let distance = distances
                .by_name(name)
                .map_err(|e| MetricError::NotComputed { metric: name.to_owned(), reason: e.to_string() })?;
            judged.insert(name.to_owned(), distance);
        }
        for (name, graph) in ["ot", "energy"].into_iter().zip(&self.graphs) {
            judged.insert(name.to_owned(), graph.distance(candidate)?);
        }
        let (judge, reference) = &self.opinion;
        let score = judge.score(reference, &judge.features(candidate, Side::Candidate)?)?;
        judged.insert(OPINION.to_owned(), score.mos);
        judged.extend(self.images(candidate)?);
        let set = DescriptorSet::new(vec![Family::Lights, Family::Display]);
        let columns = set.columns();
        for (probe, reference) in &self.probes {
            let candidate = features(candidate, &probe.setup, Side::Candidate)?;
            let values = set.compare(reference, &candidate, &probe.setup);
            for (ending, descriptor) in PICTURES {
                let found = columns.iter().zip(&values).filter(|(column, _)| column.name == descriptor);
                judged.extend(found.map(|(_, value)| (format!("{}.{ending}", probe.name), *value)));
            }
        }
        Ok(judged)
    }

    /// What metrics on stimuli say.
    pub fn images(&self, candidate: &dyn Brdf) -> Result<BTreeMap<String, f64>, MetricError> {
        let found = self.images.measure(candidate)?;
        Ok(self.image_names.iter().zip(found).map(|(name, found)| ((*name).to_owned(), found.value)).collect())
    }
}

fn features(brdf: &dyn Brdf, setup: &Setup, side: Side) -> Result<BrdfFeatures, MetricError> {
    BrdfFeatures::compute(brdf, setup)
        .map_err(|e: DescriptorError| MetricError::Unusable { side, reason: e.to_string() })
}
