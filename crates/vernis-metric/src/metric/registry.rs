//! All metrics by name.
//!
//! A new metric becomes known everywhere (command line, benchmark, contract tests) by one [`Registry::add`] in
//! [`Registry::standard`].

use super::kernel::KernelMetric;
use super::learned::LearnedMetric;
use super::lp::{LpMetric, LpVariant};
use super::transport::TransportMetric;
use super::{Measured, Metric, MetricError, PreparedMetrics, Score, Side};
use crate::brdf::{Brdf, BrdfError, IdentifiedBrdf};
use crate::descriptor::{Cache, CacheWarning};
use crate::io::nearest;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Metrics with unique names, in the order in which they were added.
#[derive(Clone, Default)]
pub struct Registry {
    metrics: Vec<Arc<dyn Metric>>,
    /// Groups that were added, by name.
    groups: Vec<(String, Vec<Arc<dyn Metric>>)>,
}

/// A name that stands for several metrics.
struct Group {
    name: &'static str,
    contains: fn(&str) -> bool,
}

const GROUPS: [Group; 1] = [Group {
    name: "all-lp",
    contains: |metric| metric.parse().is_ok_and(|variant| LpVariant::of_study().any(|s| s == variant)),
}];

impl Registry {
    /// Every metric of this library.
    ///
    /// # Errors
    /// [`MetricError::Shipped`] if the metric that comes with this build cannot be read.
    pub fn standard() -> Result<Self, MetricError> {
        let mut registry = Self::default();
        let shipped = LearnedMetric::all_shipped().map_err(|e| MetricError::Shipped { reason: e.to_string() })?;
        for metric in shipped {
            registry.add(Arc::new(metric))?;
        }
        for variant in LpVariant::every() {
            registry.add(Arc::new(LpMetric::new(variant)))?;
        }
        registry.add(Arc::new(TransportMetric::preset()?))?;
        for metric in KernelMetric::presets() {
            registry.add(Arc::new(metric))?;
        }
        Ok(registry)
    }

    /// Adds a metric.
    ///
    /// # Errors
    /// [`MetricError::NameTaken`] if its name is that of another metric or of a group.
    pub fn add(&mut self, metric: Arc<dyn Metric>) -> Result<(), MetricError> {
        if self.names().any(|name| name == metric.name()) {
            return Err(MetricError::NameTaken { name: metric.name().to_owned() });
        }
        self.metrics.push(metric);
        Ok(())
    }

    /// Adds a name that stands for several metrics, which need not be in the registry themselves.
    ///
    /// # Errors
    /// [`MetricError::NameTaken`] if a metric or another group has the name.
    pub fn add_group(&mut self, name: &str, metrics: Vec<Arc<dyn Metric>>) -> Result<(), MetricError> {
        if self.names().any(|known| known == name) {
            return Err(MetricError::NameTaken { name: name.to_owned() });
        }
        self.groups.push((name.to_owned(), metrics));
        Ok(())
    }

    /// The metric of `file` under a name that none of these has, `NAME@FILE` where one has its name: a file never hides a metric that
    /// is built in, and its numbers never stand under that one's name. A copy of the metric that is built in is that metric.
    pub fn beside(&self, metric: LearnedMetric, file: &Path) -> LearnedMetric {
        let name = metric.name();
        let same = self.get(name).is_ok_and(|known| known.identity() == metric.identity());
        if same || !self.knows(name) {
            return metric;
        }
        let own = format!("{name}@{}", file.file_name().unwrap_or_default().to_string_lossy());
        metric.renamed(own)
    }

    /// The metrics, for lists.
    pub fn iter(&self) -> impl Iterator<Item = &Arc<dyn Metric>> {
        self.metrics.iter()
    }

    /// Every name that [`Registry::resolve`] understands: groups, then metrics.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let added = self.groups.iter().map(|(name, _)| name.as_str());
        GROUPS.iter().map(|group| group.name).chain(added).chain(self.metrics.iter().map(|metric| metric.name()))
    }

    /// Whether `name` means a metric, a member of a family or a group here, so that no file may go by it.
    pub fn knows(&self, name: &str) -> bool {
        self.names().any(|known| known.eq_ignore_ascii_case(name)) || self.get(name).is_ok()
    }

    /// The metric called `name`, or the member of a family that `family[key=value,...]` describes
    /// ([`Metric::member`]).
    ///
    /// # Errors
    /// [`MetricError::Unknown`] with the nearest names; [`MetricError::Parameter`] for wrong options.
    pub fn get(&self, name: &str) -> Result<Arc<dyn Metric>, MetricError> {
        if let Some(found) = self.metrics.iter().find(|metric| metric.name() == name) {
            return Ok(found.clone());
        }
        let Some((family, _)) = name.split_once('[') else { return Err(self.unknown(name)) };
        self.get(family)?.member(name)
    }

    /// The metric called `name`, or all of a group: `all-lp` stands for the 36 of the study.
    ///
    /// # Errors
    /// [`MetricError::Unknown`] with the nearest names.
    pub fn resolve(&self, name: &str) -> Result<Vec<Arc<dyn Metric>>, MetricError> {
        if let Some((_, metrics)) = self.groups.iter().find(|(group, _)| group == name) {
            return Ok(metrics.clone());
        }
        match GROUPS.iter().find(|group| group.name == name) {
            Some(group) => Ok(self.metrics.iter().filter(|metric| (group.contains)(metric.name())).cloned().collect()),
            None => Ok(vec![self.get(name)?]),
        }
    }

    fn unknown(&self, name: &str) -> MetricError {
        MetricError::Unknown { name: name.to_owned(), nearest: nearest(name, self.names()) }
    }
}

/// What one metric says of one pair.
#[derive(Debug, Clone, PartialEq)]
pub struct Distance {
    /// The metric's registry name.
    pub metric: String,
    /// The distance, in the metric's unit.
    pub value: f64,
    /// The distance of each channel alone (R, G, B), where the metric has one.
    pub channels: Option<[f64; 3]>,
    /// Mean opinion score and its interval, where the metric was learned from ratings.
    pub score: Option<Score>,
}

/// The values of many metrics for one pair, in the order of `metrics`; work that metrics share is done once
/// ([`PreparedMetrics`]).
///
/// # Errors
/// Those of [`PreparedMetrics::new`] and [`PreparedMetrics::measure`].
pub fn distances(
    metrics: &[Arc<dyn Metric>],
    reference: &dyn Brdf,
    candidate: &dyn Brdf,
) -> Result<Vec<Distance>, MetricError> {
    let found = PreparedMetrics::new(metrics, reference)?.measure(candidate)?;
    Ok(metrics.iter().zip(found).map(|(metric, measured)| Distance::new(&**metric, measured)).collect())
}

/// As [`distances`], of BRDFs whose content is known, with what could not be kept for the next time. What the cache keeps of a single BRDF
/// is taken from there; where that is all that the metrics need, no BRDF is decoded.
///
/// # Errors
/// As [`distances`]; a BRDF that cannot be decoded is [`MetricError::Unusable`].
pub fn distances_kept(
    metrics: &[Arc<dyn Metric>],
    reference: &IdentifiedBrdf,
    candidate: &IdentifiedBrdf,
    cache: &Cache,
) -> Result<(Vec<Distance>, Vec<CacheWarning>), MetricError> {
    let (mut found, mut warnings) = (BTreeMap::new(), Vec::new());
    let mut others: Vec<(usize, Arc<dyn Metric>)> = Vec::new();
    for (place, metric) in metrics.iter().enumerate() {
        match metric.measure_kept(reference, candidate, cache).transpose()? {
            Some((measured, unkept)) => {
                found.insert(place, Distance::new(&**metric, measured));
                warnings.extend(unkept);
            }
            None => others.push((place, metric.clone())),
        }
    }
    let (places, others): (Vec<usize>, Vec<Arc<dyn Metric>>) = others.into_iter().unzip();
    if !others.is_empty() {
        warnings.extend(others.iter().filter_map(|metric| metric.warm_up(cache)));
        let unusable = |side| move |error: BrdfError| MetricError::Unusable { side, reason: error.to_string() };
        let reference = reference.brdf().map_err(unusable(Side::Reference))?;
        let candidate = candidate.brdf().map_err(unusable(Side::Candidate))?;
        found.extend(places.into_iter().zip(distances(&others, reference, candidate)?));
    }
    Ok((found.into_values().collect(), warnings))
}

impl Distance {
    fn new(metric: &dyn Metric, measured: Measured) -> Self {
        let Measured { value, channels, score } = measured;
        Self { metric: metric.name().to_owned(), value, channels, score }
    }
}
