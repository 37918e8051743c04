//! Distances between the graphs of a study's pairs, as columns beside the descriptors.
//!
//! Each BRDF of a pair becomes one table a grid, which all metrics share; values are cached by the content of the BRDFs, the
//! metric's name, which holds all of its parameters, and its grid. Memory: two tables of 9 MB a grid, and what the metrics take.

use super::extraction::ExtractionError;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;
use vernis_metric::brdf::IdentifiedBrdf;
use vernis_metric::descriptor::{Cache, CacheWarning, Column, Role};
use vernis_metric::metric::graph::{CosineTable, GraphGrid, GraphMetric, PreparedTable, combine};
use vernis_metric::metric::{Metric, MetricError};

/// Family of the columns with transport distances.
pub const TRANSPORT_FAMILY: &str = "transport";
/// Family of the columns with energy distances and other kernel distances.
pub const ENERGY_FAMILY: &str = "energy";

/// Part of the cache key: raise it when a distance changes.
pub(super) const VERSION: u32 = 4;

/// One column a metric, with the metric's own name.
pub fn columns(metrics: &[Arc<dyn Metric>]) -> Vec<Column> {
    let family = |name: &str| if name.starts_with("ot") { TRANSPORT_FAMILY } else { ENERGY_FAMILY };
    let column = |name: &str| Column { name: name.to_owned(), family: family(name).to_owned(), role: Role::Difference };
    metrics.iter().map(|m| column(m.name())).collect()
}

/// The tables of one BRDF, made when they are needed.
struct Tables<'a> {
    brdf: &'a IdentifiedBrdf,
    side: &'static str,
    made: BTreeMap<GraphGrid, CosineTable>,
}

impl<'a> Tables<'a> {
    fn new(brdf: &'a IdentifiedBrdf, side: &'static str) -> Self {
        Self { brdf, side, made: BTreeMap::new() }
    }

    fn on(&mut self, grid: GraphGrid, failed: &Failed<'_>) -> Result<&CosineTable, ExtractionError> {
        Ok(match self.made.entry(grid) {
            Entry::Occupied(table) => table.into_mut(),
            Entry::Vacant(place) => place.insert(CosineTable::of(self.brdf.brdf()?, grid, self.side).map_err(failed)?),
        })
    }
}

/// Names the pair in an error.
type Failed<'a> = dyn Fn(MetricError) -> ExtractionError + 'a;

/// The distances from one reference: its tables, and what the metrics, in their order, have made of them. Both are made where
/// the cache lacks a pair.
pub(super) struct GraphDistances<'a> {
    metrics: Vec<&'a dyn GraphMetric>,
    tables: Tables<'a>,
    prepared: Vec<Option<Box<dyn PreparedTable + 'a>>>,
    cache: Option<&'a Cache>,
}

impl<'a> GraphDistances<'a> {
    pub fn new(metrics: &'a [Arc<dyn Metric>], reference: &'a IdentifiedBrdf, cache: Option<&'a Cache>) -> Self {
        let metrics: Vec<_> = metrics.iter().filter_map(|m| m.as_graph()).collect();
        let prepared = metrics.iter().map(|_| None).collect();
        Self { metrics, tables: Tables::new(reference, "reference"), prepared, cache }
    }

    /// One distance a metric.
    pub fn of(
        &mut self,
        candidate: &IdentifiedBrdf,
        warnings: &mut Vec<CacheWarning>,
    ) -> Result<Vec<f64>, ExtractionError> {
        let reference = self.tables.brdf;
        let failed = |source| ExtractionError::distance(reference, candidate, source);
        let mut candidate = Tables::new(candidate, "candidate");
        let mut values = Vec::with_capacity(self.metrics.len());
        for (number, &graph) in self.metrics.iter().enumerate() {
            let contents = (reference.content, candidate.brdf.content);
            let key = format!("graph {VERSION} {} {} {} {}", graph.name(), graph.grid(), contents.0, contents.1);
            let kept = self.cache.and_then(|c| c.load_values(&key)).and_then(|v| v.first().copied());
            let value = match kept {
                Some(value) => value,
                None => {
                    let table = candidate.on(graph.grid(), &failed)?;
                    let prepared = match &mut self.prepared[number] {
                        Some(prepared) => prepared,
                        none => {
                            let table = Cow::Owned(self.tables.on(graph.grid(), &failed)?.clone());
                            none.insert(graph.prepare_table(table).map_err(failed)?)
                        }
                    };
                    let channels = prepared.channels(table).map_err(failed)?;
                    let value = combine(graph.name(), channels, graph.gamma()).map_err(failed)?;
                    warnings.extend(self.cache.and_then(|c| c.store_values(&key, &[value]).err()));
                    value
                }
            };
            values.push(value);
        }
        Ok(values)
    }
}
