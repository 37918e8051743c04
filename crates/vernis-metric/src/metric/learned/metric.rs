//! An exported metric as a [`Metric`]: descriptors of two BRDFs, then its regressor.
//!
//! The gradient is exact. It goes backwards through everything that the distance goes through: the regressor
//! ([`super::Regressor::gradient`]), every descriptor ([`DescriptorSet::gradient`](crate::descriptor::DescriptorSet::gradient)),
//! the pictures ([`Operator`](crate::light::Operator)) and the averages about the nodes ([`Sites`]). The reference is constant in
//! it, its context included. Where a function has a kink, one subgradient is taken: 0 at zero difference, and 0 for a value that
//! counts as 0 because it is negative. Descriptors of version 1 have no gradient.
//!
//! Cost: that of the descriptors, see [`BrdfFeatures`]; the regressor takes less than a millisecond. Value and gradient together
//! cost two to three values.

use super::exported::{ExportedError, ExportedMetric};
use super::regressor::Function;
use crate::brdf::{Brdf, IdentifiedBrdf};
use crate::descriptor::{BrdfFeatures, Cache, CacheWarning, DescriptorError, DescriptorOptions, Setup};
use crate::io::read_text_at_most;
use crate::light::Sites;
use crate::math::Rgb;
use crate::metric::{Gradient, Measured, Metric, MetricError, Nodes, PreparedMetric, Properties, Score, Side};
use std::path::Path;
use std::sync::Arc;

/// Far more than an ensemble of networks needs.
const MOST_BYTES: u64 = 256 << 20;

/// Layout of the directions that descriptors of version 2 look at: theta_h, theta_d, phi_d.
const NODES: &str = "half-difference-averages-57x16x20";

/// The texts of the metrics that come with the library, under their names there.
const SHIPPED: [(&str, &str); 3] = [
    ("vernis", include_str!("vernis.vernis.json")),
    ("vernis-loss", include_str!("vernis-loss.vernis.json")),
    ("vernis-1", include_str!("vernis-1.vernis.json")),
];

/// An exported metric and what computes its descriptors.
#[derive(Debug, Clone)]
pub struct LearnedMetric {
    exported: Arc<ExportedMetric>,
    setup: Arc<Setup>,
}

impl LearnedMetric {
    /// `setup` must be the one that `exported` was read or made for.
    pub fn new(exported: ExportedMetric, setup: Arc<Setup>) -> Result<Self, MetricError> {
        if exported.descriptors.setup == setup.id() {
            return Ok(Self { exported: Arc::new(exported), setup });
        }
        let reason = format!("it takes descriptors of setup {}, found {}", exported.descriptors.setup, setup.id());
        Err(MetricError::NotComputed { metric: exported.name, reason })
    }

    /// Reads a `*.vernis.json` file whose descriptors need no light probe and no mesh.
    ///
    /// # Errors
    /// A file that cannot be read, is no exported metric, is of a newer format, or needs a probe or a mesh.
    pub fn load(path: &Path) -> Result<Self, ExportedError> {
        Self::load_with(path, &DescriptorOptions::default())
    }

    /// Reads a `*.vernis.json` file. The probe and the mesh of `options` are used where its descriptors need them.
    ///
    /// # Errors
    /// As [`LearnedMetric::load`]; a probe or a mesh that is not the one that the metric was trained with.
    pub fn load_with(path: &Path, options: &DescriptorOptions) -> Result<Self, ExportedError> {
        let file = path.display().to_string();
        let unreadable = |reason: String| ExportedError::Read { file: file.clone(), reason };
        let text = read_text_at_most(path, MOST_BYTES).map_err(|e| unreadable(e.to_string()))?;
        Self::parse(&text, &file, options)
    }

    /// The metric `vernis` that comes with the library, trained on the open part of the study of Lavoué et al. 2021.
    pub fn shipped() -> Result<Self, ExportedError> {
        Self::embedded(SHIPPED[0])
    }

    /// The metrics that come with the library: [`LearnedMetric::shipped`]; `vernis-loss`, the metric to fit with, which is the distance
    /// that `vernis` begins with; and `vernis-1`, version 1 of `vernis`, whose scores stand in older reports.
    pub fn all_shipped() -> Result<Vec<Self>, ExportedError> {
        SHIPPED.map(Self::embedded).into_iter().collect()
    }

    fn embedded((name, text): (&str, &str)) -> Result<Self, ExportedError> {
        let metric = Self::parse(text, &format!("the embedded metric {name}"), &DescriptorOptions::default())?;
        Ok(if metric.exported.name == name { metric } else { metric.renamed(name.to_owned()) })
    }

    fn parse(text: &str, file: &str, options: &DescriptorOptions) -> Result<Self, ExportedError> {
        let exported = ExportedMetric::parse(text, file)?;
        let setup = Setup::find(&exported.descriptors.setup, options)
            .map_err(|e| ExportedError::Setup { file: file.to_owned(), source: Box::new(e) })?;
        Ok(Self { exported: Arc::new(exported), setup })
    }

    /// The same metric under another name, for where its own is in use.
    #[must_use]
    pub fn renamed(mut self, name: String) -> Self {
        Arc::make_mut(&mut self.exported).name = name;
        self
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
    pub fn features(&self, brdf: &dyn Brdf, side: Side) -> Result<BrdfFeatures, MetricError> {
        BrdfFeatures::compute(brdf, &self.setup).map_err(|e| MetricError::Unusable { side, reason: e.to_string() })
    }

    /// Distance, mean opinion score and interval.
    pub fn score(&self, reference: &BrdfFeatures, candidate: &BrdfFeatures) -> Result<Score, MetricError> {
        let raw = self.exported.descriptors.set.compare(reference, candidate, &self.setup);
        self.exported.score(&raw).map_err(|e| self.of_pair(&e))
    }

    /// What a fit minimises ([`ExportedMetric::loss_and_gradient`]).
    pub fn loss(&self, reference: &BrdfFeatures, candidate: &BrdfFeatures) -> Result<f64, MetricError> {
        let raw = self.exported.descriptors.set.compare(reference, candidate, &self.setup);
        self.exported.loss_and_gradient(&raw).map(|(value, _)| value).map_err(|e| self.of_pair(&e))
    }

    /// The directions at which its descriptors look.
    fn nodes(&self) -> Arc<Nodes> {
        Nodes::shared(NODES, |id| {
            let sites = Sites::of(self.setup.sampling());
            Nodes::new(id, sites.wi().to_vec(), sites.wo().to_vec())
        })
    }

    /// Whether it is a metric in the mathematical sense, symmetric and with a triangle inequality, among BRDFs that are measured
    /// everywhere.
    fn is_true_metric(&self) -> bool {
        self.exported.regressor.terms.iter().all(|term| matches!(term.function, Function::Saturated { .. }))
    }

    fn is_differentiable(&self) -> bool {
        self.exported.descriptors.set.is_differentiable(&self.setup)
    }

    /// The distance before it is cut off at zero ([`ExportedMetric::signed_distance`]).
    pub fn signed_distance(&self, reference: &BrdfFeatures, candidate: &BrdfFeatures) -> Result<f64, MetricError> {
        let raw = self.exported.descriptors.set.compare(reference, candidate, &self.setup);
        self.exported.signed_distance(&raw).map_err(|e| self.of_pair(&e))
    }

    /// A number that is not finite is a matter of the two BRDFs; anything else, of the metric.
    fn of_pair(&self, error: &ExportedError) -> MetricError {
        let reason = error.to_string();
        match error {
            ExportedError::NotFinite { .. } => MetricError::Unusable { side: Side::Pair, reason },
            _ => MetricError::NotComputed { metric: self.exported.name.clone(), reason },
        }
    }

    /// As [`LearnedMetric::score`], from the BRDFs themselves.
    pub fn compare(&self, reference: &dyn Brdf, candidate: &dyn Brdf) -> Result<Score, MetricError> {
        self.score(&self.features(reference, Side::Reference)?, &self.features(candidate, Side::Candidate)?)
    }
}

impl Metric for LearnedMetric {
    fn name(&self) -> &str {
        &self.exported.name
    }

    fn properties(&self) -> Properties {
        let scale = self.exported.scale;
        let on = if scale.is_grades() { String::new() } else { format!(", scores on {scale}") };
        let made_of = if self.exported.provenance.synthetic { "SYNTHETIC ratings" } else { "human ratings" };
        Properties {
            family: super::FAMILY,
            unit: "MOS",
            symmetric: self.is_true_metric(),
            usable_as_loss: true,
            differentiable: self.is_differentiable(),
            summary: format!(
                "learned from {made_of} of {} pairs ({}), version {}{on}",
                self.exported.provenance.rows, self.exported.provenance.study, self.exported.metric_version
            ),
            source: "vernis; see the model card",
            rough: !self.is_true_metric(),
            synthetic: self.exported.provenance.synthetic,
        }
    }

    fn prepare(&self, reference: &dyn Brdf) -> Result<Box<dyn PreparedMetric>, MetricError> {
        Ok(Box::new(Prepared { metric: self.clone(), reference: self.features(reference, Side::Reference)? }))
    }

    fn version(&self) -> &str {
        &self.exported.metric_version
    }

    /// Name, version and a hash of the file: two metrics that were trained apart may share a name.
    fn identity(&self) -> String {
        format!("{} {} {}", self.name(), self.version(), self.exported.content())
    }

    fn measure_kept(
        &self,
        reference: &IdentifiedBrdf,
        candidate: &IdentifiedBrdf,
        cache: &Cache,
    ) -> Option<Result<(Measured, Vec<CacheWarning>), MetricError>> {
        let features = |brdf: &IdentifiedBrdf, side: Side| {
            let unusable = |error: DescriptorError| MetricError::Unusable { side, reason: error.to_string() };
            // A model is evaluated as fast as its features are read, and a fit would fill the folder with its candidates.
            let found = match brdf.is_open() {
                true => {
                    let warning = cache.prepare(&self.setup);
                    let computed = brdf.brdf().map_err(DescriptorError::from);
                    computed.and_then(|brdf| Ok((BrdfFeatures::compute(brdf, &self.setup)?, warning)))
                }
                false => cache.features(brdf, &self.setup),
            };
            found.map_err(unusable)
        };
        let measure = || {
            let (reference, of_reference) = features(reference, Side::Reference)?;
            let (candidate, of_candidate) = features(candidate, Side::Candidate)?;
            let warnings = of_reference.into_iter().chain(of_candidate).collect();
            Ok((measured(self.score(&reference, &candidate)?), warnings))
        };
        Some(measure())
    }

    fn warm_up(&self, cache: &Cache) -> Option<CacheWarning> {
        cache.prepare(&self.setup)
    }
}

fn measured(score: Score) -> Measured {
    Measured { value: score.distance, channels: None, score: Some(score) }
}

struct Prepared {
    metric: LearnedMetric,
    reference: BrdfFeatures,
}

impl PreparedMetric for Prepared {
    fn distance(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        self.measure(candidate).map(|measured| measured.value)
    }

    fn measure(&self, candidate: &dyn Brdf) -> Result<Measured, MetricError> {
        Ok(measured(self.metric.score(&self.reference, &self.metric.features(candidate, Side::Candidate)?)?))
    }

    fn loss(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        self.metric.loss(&self.reference, &self.metric.features(candidate, Side::Candidate)?)
    }

    fn nodes(&self) -> Option<Arc<Nodes>> {
        self.metric.is_differentiable().then(|| self.metric.nodes())
    }

    fn distance_at(&self, values: &[Rgb]) -> Result<f64, MetricError> {
        Ok(self.metric.score(&self.reference, &self.of_values(values)?)?.distance)
    }

    /// Of the distance before it is cut off at zero: the same wherever that is positive.
    fn gradient_at(&self, values: &[Rgb]) -> Result<Gradient, MetricError> {
        self.gradient_of(values, ExportedMetric::signed_distance_and_gradient)
    }

    fn loss_gradient_at(&self, values: &[Rgb]) -> Result<Gradient, MetricError> {
        self.gradient_of(values, ExportedMetric::loss_and_gradient)
    }
}

/// A value of an exported metric and its derivative by the descriptors.
type ByDescriptors = fn(&ExportedMetric, &[f64]) -> Result<(f64, Vec<f64>), ExportedError>;

impl Prepared {
    fn of_values(&self, values: &[Rgb]) -> Result<BrdfFeatures, MetricError> {
        let metric = &self.metric;
        if !metric.is_differentiable() {
            return Err(MetricError::NoNodes);
        }
        metric.nodes().check(metric.name(), values)?;
        BrdfFeatures::of_values(values, &metric.setup)
            .map_err(|e| MetricError::Unusable { side: Side::Candidate, reason: e.to_string() })
    }

    fn gradient_of(&self, values: &[Rgb], of: ByDescriptors) -> Result<Gradient, MetricError> {
        let (metric, candidate) = (&self.metric, self.of_values(values)?);
        let (set, setup) = (&metric.exported.descriptors.set, &*metric.setup);
        let raw = set.compare(&self.reference, &candidate, setup);
        let (value, by_descriptor) = of(&metric.exported, &raw).map_err(|e| metric.of_pair(&e))?;
        let derivatives = set
            .gradient(&self.reference, &candidate, setup, values, &by_descriptor)
            .map_err(|_| MetricError::NoGradient { metric: metric.name().to_owned() })?;
        Ok(Gradient { value, derivatives })
    }
}
