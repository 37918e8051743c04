//! Distances between the graphs of a study's pairs, as columns beside the descriptors.
//!
//! Each BRDF of a pair becomes one table a grid, which all metrics share; values are cached by the content of the BRDFs, the
//! metric's name, which holds all of its parameters, and its grid. Memory: two tables of 9 MB a worker thread and grid,
//! and what the metrics take.

use super::matrix::MatrixError;
use crate::brdf::{BrdfSource, OpenBrdf};
use crate::dataset::samples::{Column, Role};
use crate::descriptor::{Cache, CacheWarning, Progress};
use crate::metric::graph::{CosineTable, GraphGrid, GraphMetric, PreparedTable, combine};
use crate::metric::{Metric, MetricError};
use ndarray::Array2;
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Family of the columns with transport distances.
pub const TRANSPORT_FAMILY: &str = "transport";
/// Family of the columns with energy distances and other kernel distances.
pub const ENERGY_FAMILY: &str = "energy";

/// Part of the cache key: raise it when a distance changes.
const VERSION: u32 = 3;

/// One column a metric, with the metric's own name.
pub fn columns(metrics: &[Arc<dyn Metric>]) -> Vec<Column> {
    let family = |name: &str| if name.starts_with("ot") { TRANSPORT_FAMILY } else { ENERGY_FAMILY };
    let column = |name: &str| Column { name: name.to_owned(), family: family(name).to_owned(), role: Role::Difference };
    metrics.iter().map(|m| column(m.name())).collect()
}

/// Where distances are computed from, and what is told meanwhile.
pub(super) struct GraphDistances<'a> {
    pub metrics: &'a [Arc<dyn Metric>],
    pub base: Option<&'a Path>,
    pub cache: Option<&'a Cache>,
    pub progress: &'a (dyn Fn(Progress) + Sync),
}

/// The tables of one BRDF, made when they are needed.
struct Tables<'a> {
    open: &'a OpenBrdf,
    side: &'static str,
    made: BTreeMap<GraphGrid, CosineTable>,
}

impl<'a> Tables<'a> {
    fn new(open: &'a OpenBrdf, side: &'static str) -> Self {
        Self { open, side, made: BTreeMap::new() }
    }

    fn on(&mut self, grid: GraphGrid) -> Result<&CosineTable, MetricError> {
        Ok(match self.made.entry(grid) {
            Entry::Occupied(table) => table.into_mut(),
            Entry::Vacant(place) => place.insert(CosineTable::of(self.open.brdf.as_ref(), grid, self.side)?),
        })
    }
}

/// The reference of some pairs: its tables, and what the metrics, in their order, have made of them.
struct Reference<'a> {
    tables: Tables<'a>,
    prepared: Vec<Option<Box<dyn PreparedTable + 'a>>>,
}

impl<'a> Reference<'a> {
    fn on(&mut self, number: usize, graph: &'a dyn GraphMetric) -> Result<&dyn PreparedTable, MetricError> {
        let prepared = match self.prepared[number].take() {
            Some(prepared) => prepared,
            None => graph.prepare_table(Cow::Owned(self.tables.on(graph.grid())?.clone()))?,
        };
        Ok(&**self.prepared[number].insert(prepared))
    }
}

/// Place of a pair in its study, its distances, and what of them could not be kept.
type Row = (usize, Vec<f64>, Vec<CacheWarning>);

impl GraphDistances<'_> {
    /// Pairs x metrics. Pairs of one reference are done together, so that its tables are made once.
    pub fn compute(&self, pairs: &[(BrdfSource, BrdfSource)]) -> Result<(Array2<f64>, Vec<CacheWarning>), MatrixError> {
        let mut by_reference: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        pairs.iter().enumerate().for_each(|(i, (r, _))| by_reference.entry(r.identity()).or_default().push(i));
        let (done, total) = (AtomicUsize::new(0), pairs.len());
        let of_group = |indices: &Vec<usize>| -> Result<Vec<Row>, MatrixError> {
            let Some(&first) = indices.first() else { return Ok(Vec::new()) };
            let reference = pairs[first].0.open(self.base)?;
            let prepared = self.metrics.iter().map(|_| None).collect();
            let mut of_reference = Reference { tables: Tables::new(&reference, "reference"), prepared };
            let mut rows = Vec::with_capacity(indices.len());
            for &i in indices {
                let candidate = pairs[i].1.open(self.base)?;
                let (values, warnings) = self.of_pair(&mut of_reference, &candidate)?;
                rows.push((i, values, warnings));
                (self.progress)(Progress { done: done.fetch_add(1, Ordering::Relaxed) + 1, total });
            }
            Ok(rows)
        };
        let groups: Vec<&Vec<usize>> = by_reference.values().collect();
        let found = groups.into_par_iter().map(of_group).collect::<Result<Vec<_>, _>>()?;
        let mut values = Array2::zeros((pairs.len(), self.metrics.len()));
        let mut warnings = Vec::new();
        for (i, row, more) in found.into_iter().flatten() {
            values.row_mut(i).iter_mut().zip(row).for_each(|(to, from)| *to = from);
            warnings.extend(more);
        }
        Ok((values, warnings))
    }

    fn of_pair<'b>(
        &'b self,
        reference: &mut Reference<'b>,
        candidate: &OpenBrdf,
    ) -> Result<(Vec<f64>, Vec<CacheWarning>), MatrixError> {
        let names = (reference.tables.open.notation.clone(), candidate.notation.clone());
        let failed = |source| {
            let (reference, candidate) = names.clone();
            MatrixError::Graph { reference, candidate, source: Box::new(source) }
        };
        let mut candidate = Tables::new(candidate, "candidate");
        let (mut values, mut warnings) = (Vec::with_capacity(self.metrics.len()), Vec::new());
        for (number, graph) in self.metrics.iter().enumerate().filter_map(|(k, m)| Some((k, m.as_graph()?))) {
            let contents = (reference.tables.open.content, candidate.open.content);
            let key = format!("graph {VERSION} {} {} {} {}", graph.name(), graph.grid(), contents.0, contents.1);
            let kept = self.cache.and_then(|c| c.load_values(&key)).and_then(|v| v.first().copied());
            let value = match kept {
                Some(value) => value,
                None => {
                    let mut distance = || {
                        let channels = reference.on(number, graph)?.channels(candidate.on(graph.grid())?)?;
                        combine(graph.name(), channels, graph.gamma())
                    };
                    let value = distance().map_err(failed)?;
                    warnings.extend(self.cache.and_then(|c| c.store_values(&key, &[value]).err()));
                    value
                }
            };
            values.push(value);
        }
        Ok((values, warnings))
    }
}
