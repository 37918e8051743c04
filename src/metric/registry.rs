//! All metrics by name.
//!
//! A new metric becomes known everywhere (command line, benchmark, contract tests) by one [`Registry::add`] in
//! [`Registry::standard`].

use super::learned::{LearnedMetric, Score};
use super::lp::{LpDistances, LpMetric, LpVariant};
use super::{Metric, MetricError};
use crate::brdf::Brdf;
use std::sync::Arc;

/// Metrics with unique names, in the order in which they were added.
#[derive(Clone, Default)]
pub struct Registry {
    metrics: Vec<Arc<dyn Metric>>,
}

/// A name that stands for several metrics.
struct Group {
    name: &'static str,
    contains: fn(&dyn Metric) -> bool,
}

const GROUPS: [Group; 1] = [Group {
    name: "all-lp",
    contains: |metric| metric.as_lp().is_some_and(|v| LpVariant::of_study().any(|s| s == v)),
}];

impl Registry {
    /// Every metric of this library.
    ///
    /// # Errors
    /// [`MetricError::Shipped`] if the metric that comes with this build cannot be read.
    pub fn standard() -> Result<Self, MetricError> {
        let mut registry = Self::default();
        let shipped = LearnedMetric::shipped().map_err(|e| MetricError::Shipped { reason: e.to_string() })?;
        registry.add(Arc::new(shipped))?;
        for variant in LpVariant::every() {
            registry.add(Arc::new(LpMetric::new(variant)))?;
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

    /// The metrics, for lists.
    pub fn iter(&self) -> impl Iterator<Item = &Arc<dyn Metric>> {
        self.metrics.iter()
    }

    /// Every name that [`Registry::resolve`] understands: groups, then metrics.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        GROUPS.iter().map(|group| group.name).chain(self.metrics.iter().map(|metric| metric.name()))
    }

    /// The metric called `name`.
    ///
    /// # Errors
    /// [`MetricError::Unknown`] with the nearest names.
    pub fn get(&self, name: &str) -> Result<Arc<dyn Metric>, MetricError> {
        let found = self.metrics.iter().find(|metric| metric.name() == name);
        found.cloned().ok_or_else(|| self.unknown(name))
    }

    /// The metric called `name`, or all of a group: `all-lp` stands for the 36 of the study.
    ///
    /// # Errors
    /// [`MetricError::Unknown`] with the nearest names.
    pub fn resolve(&self, name: &str) -> Result<Vec<Arc<dyn Metric>>, MetricError> {
        match GROUPS.iter().find(|group| group.name == name) {
            Some(group) => Ok(self.metrics.iter().filter(|metric| (group.contains)(&***metric)).cloned().collect()),
            None => Ok(vec![self.get(name)?]),
        }
    }

    fn unknown(&self, name: &str) -> MetricError {
        const SIMILAR: f64 = 0.5;
        const LISTED: usize = 3;
        let lower = name.to_lowercase();
        let similarity = |known: &str| strsim::normalized_damerau_levenshtein(&lower, &known.to_lowercase());
        let mut nearest: Vec<_> = self.names().map(|known| (similarity(known), known)).collect();
        nearest.retain(|(similarity, _)| *similarity >= SIMILAR);
        nearest.sort_by(|a, b| b.0.total_cmp(&a.0));
        let nearest = nearest.into_iter().take(LISTED).map(|(_, known)| known.to_owned()).collect();
        MetricError::Unknown { name: name.to_owned(), nearest }
    }
}

/// The value of one metric for one pair.
#[derive(Debug, Clone, PartialEq)]
pub struct Distance {
    /// The metric's registry name.
    pub metric: String,
    pub value: f64,
    /// The distance of each channel alone (R, G, B), where the metric has one.
    pub channels: Option<[f64; 3]>,
    /// Mean opinion score and its interval, where the metric was learned from ratings.
    pub score: Option<Score>,
}

/// The values of many metrics for one pair, in the order of `metrics`. All Lp variants share a single pass.
pub fn distances(
    metrics: &[Arc<dyn Metric>],
    reference: &dyn Brdf,
    candidate: &dyn Brdf,
) -> Result<Vec<Distance>, MetricError> {
    let variants: Vec<_> = metrics.iter().filter_map(|metric| metric.as_lp()).collect();
    let lp = match variants.is_empty() {
        true => None,
        false => Some(LpDistances::of_variants(reference, candidate, &variants)?),
    };
    let distance = |metric: &Arc<dyn Metric>| {
        let name = metric.name().to_owned();
        if let (Some(lp), Some(variant)) = (&lp, metric.as_lp()) {
            return Ok(Distance { metric: name, value: lp.get(variant), channels: lp.channels(variant), score: None });
        }
        let score = metric.as_learned().map(|learned| learned.compare(reference, candidate)).transpose()?;
        let value = match score {
            Some(score) => score.distance,
            None => metric.distance(reference, candidate)?,
        };
        Ok(Distance { metric: name, value, channels: None, score })
    };
    metrics.iter().map(distance).collect()
}
