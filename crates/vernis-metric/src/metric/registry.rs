//! All metrics by name.
//!
//! A new metric becomes known everywhere (command line, benchmark, contract tests) by one [`Registry::add`] in
//! [`Registry::standard`].

use super::graph::{CosineTable, GraphGrid, combine};
use super::kernel::KernelMetric;
use super::learned::{LearnedMetric, Score};
use super::lp::{LpDistances, LpMetric, LpVariant};
use super::transport::TransportMetric;
use super::{Metric, MetricError};
use crate::brdf::Brdf;
use crate::io::nearest;
use std::collections::BTreeSet;
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

    /// The metrics, for lists.
    pub fn iter(&self) -> impl Iterator<Item = &Arc<dyn Metric>> {
        self.metrics.iter()
    }

    /// Every name that [`Registry::resolve`] understands: groups, then metrics.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        GROUPS.iter().map(|group| group.name).chain(self.metrics.iter().map(|metric| metric.name()))
    }

    /// The metric called `name`, or the member of a family that `family[key=value,...]` describes
    /// ([`GraphMetric::member`](super::graph::GraphMetric::member)).
    ///
    /// # Errors
    /// [`MetricError::Unknown`] with the nearest names; [`MetricError::Parameter`] for wrong options.
    pub fn get(&self, name: &str) -> Result<Arc<dyn Metric>, MetricError> {
        if let Some(found) = self.metrics.iter().find(|metric| metric.name() == name) {
            return Ok(found.clone());
        }
        let Some((family, _)) = name.split_once('[') else { return Err(self.unknown(name)) };
        match self.get(family)?.as_graph() {
            Some(graph) => graph.member(name),
            None => Err(MetricError::Parameter {
                what: name.to_owned(),
                found: "options".to_owned(),
                allowed: format!("none, {family} is one metric"),
            }),
        }
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
        MetricError::Unknown { name: name.to_owned(), nearest: nearest(name, self.names()) }
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

/// The values of many metrics for one pair, in the order of `metrics`. All Lp variants share a single pass, all metrics on
/// graphs the tables of each grid.
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
    let graphs = GraphTables::of(metrics, reference, candidate)?;
    let distance = |metric: &Arc<dyn Metric>| {
        let name = metric.name().to_owned();
        if let (Some(lp), Some(variant)) = (&lp, metric.as_lp()) {
            return Ok(Distance { metric: name, value: lp.get(variant), channels: lp.channels(variant), score: None });
        }
        if let Some(graph) = metric.as_graph() {
            let (reference, candidate) = graphs.on(graph.grid())?;
            let channels = graph.channels(reference, candidate)?;
            let value = combine(&name, channels, graph.gamma())?;
            return Ok(Distance { metric: name, value, channels: Some(channels), score: None });
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

/// The tables of a pair on every grid that the metrics ask for.
struct GraphTables(Vec<(GraphGrid, CosineTable, CosineTable)>);

impl GraphTables {
    fn of(metrics: &[Arc<dyn Metric>], reference: &dyn Brdf, candidate: &dyn Brdf) -> Result<Self, MetricError> {
        let grids: BTreeSet<GraphGrid> = metrics.iter().filter_map(|m| m.as_graph()).map(|g| g.grid()).collect();
        let table = |brdf, grid, side| CosineTable::of(brdf, grid, side);
        let both = |grid| Ok((grid, table(reference, grid, "reference")?, table(candidate, grid, "candidate")?));
        grids.into_iter().map(both).collect::<Result<_, _>>().map(Self)
    }

    fn on(&self, grid: GraphGrid) -> Result<(&CosineTable, &CosineTable), MetricError> {
        let found = self.0.iter().find(|(on, _, _)| *on == grid);
        found.map(|(_, reference, candidate)| (reference, candidate)).ok_or(MetricError::NoTable { grid })
    }
}
