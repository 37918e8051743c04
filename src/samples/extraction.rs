//! A study becomes a matrix: one row a rated pair, one column a descriptor or a classical distance.
//!
//! The pairs of one reference are done together by one worker, which reads the reference once and one candidate after the
//! other. Everything is cached by the content of the BRDFs: an interrupted run loses the pair in hand, and a table that the
//! cache knows is read, for its content, but not decoded. Memory: at most a reference and a candidate a worker thread, 250 MB
//! where they are tables, and 2 kB a pair.

use super::graph_distances::{self, GraphDistances};
use super::{Samples, SamplesError};
use crate::dataset::{RatedPair, Study};
use crate::samples::workers::in_order;
use ndarray::Array2;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use thiserror::Error;
use vernis_metric::brdf::{BrdfError, ContentHash, IdentifiedBrdf};
use vernis_metric::descriptor::{
    Cache, CacheWarning, Column, DescriptorError, DescriptorSet, Progress, Role, Setup, features as features_of,
};
use vernis_metric::light::NodeTable;
use vernis_metric::metric::lp::{LpDistances, LpReference, LpVariant};
use vernis_metric::metric::{Metric, MetricError};

/// Family of the columns that hold Lp distances; each column has the metric's own name.
pub const LP_FAMILY: &str = "lp";

/// Part of the cache key of Lp distances: raise it when one of them changes.
const LP_VERSION: u32 = 2;

#[derive(Debug, Error)]
pub enum ExtractionError {
    #[error(transparent)]
    Descriptor(#[from] DescriptorError),
    #[error(transparent)]
    Open(#[from] BrdfError),
    #[error("{reference} against {candidate}: {source}")]
    Distance { reference: String, candidate: String, source: Box<MetricError> },
    #[error(transparent)]
    Samples(#[from] SamplesError),
    #[error("{found} numbers were computed, expected {expected}")]
    Incomplete { found: usize, expected: usize },
}

/// Where a matrix is computed from, and what it tells meanwhile.
pub struct MatrixBuilder<'a> {
    pub set: &'a DescriptorSet,
    pub setup: &'a Setup,
    /// Metrics on graphs whose distances become columns as well; they are symmetric.
    pub graphs: &'a [Arc<dyn Metric>],
    /// Folder that relative sources are looked up in.
    pub base: Option<&'a Path>,
    pub cache: Option<&'a Cache>,
    /// Called from any thread each time a pair is done.
    pub progress: &'a (dyn Fn(Progress) + Sync),
}

/// A study as numbers.
#[derive(Debug, Clone)]
pub struct StudyMatrix {
    /// The columns of the descriptor set, then one a Lp variant of the study, then one a metric on graphs.
    pub samples: Samples,
    /// Of reference and candidate of every pair.
    pub contents: Vec<[ContentHash; 2]>,
    pub tables: NodeTables,
    /// What could not be kept for the next run.
    pub warnings: Vec<CacheWarning>,
}

/// What embeddings are learned from: 50 kB a BRDF.
#[derive(Debug, Clone)]
pub struct NodeTables {
    /// By material, that of its first pair.
    pub references: BTreeMap<String, NodeTable>,
    /// By row.
    pub candidates: Vec<NodeTable>,
}

/// What a pair gave.
struct PairRow {
    values: Vec<f64>,
    swapped: Vec<f64>,
    contents: [ContentHash; 2],
    candidate: NodeTable,
    warnings: Vec<CacheWarning>,
}

/// What the pairs of a reference gave, in their order.
struct ReferenceRows {
    reference: NodeTable,
    warning: Option<CacheWarning>,
    rows: Vec<PairRow>,
}

/// Versions of the distances that stand beside the descriptors.
pub fn distance_versions() -> String {
    format!("lp {LP_VERSION}, graphs {}", graph_distances::VERSION)
}

impl MatrixBuilder<'_> {
    /// Descriptors and the 36 Lp distances of every pair of `study`, in the order of its pairs; the same for any number
    /// of threads.
    ///
    /// # Errors
    /// Of the references in the order of their first pair, the first that cannot be read, or compared with a candidate. What was
    /// computed by then stays in the cache.
    pub fn build(&self, study: &Study) -> Result<StudyMatrix, ExtractionError> {
        let groups = study.by_reference();
        let (done, total) = (AtomicUsize::new(0), study.pairs.len());
        let step = || (self.progress)(Progress { done: done.fetch_add(1, Ordering::Relaxed) + 1, total });
        let found = in_order(groups.len(), |group| self.of_reference(study, &groups[group], &step))?;
        let mut references = BTreeMap::new();
        let mut warnings = Vec::new();
        let mut rows: BTreeMap<usize, PairRow> = BTreeMap::new();
        for (indices, of_reference) in groups.iter().zip(found) {
            for &index in indices {
                let material = &study.pairs[index].material;
                references.entry(material.clone()).or_insert_with(|| of_reference.reference.clone());
            }
            warnings.extend(of_reference.warning);
            rows.extend(indices.iter().copied().zip(of_reference.rows));
        }
        let mut columns = self.set.columns();
        let of_family = |name: String| Column { name, family: LP_FAMILY.to_owned(), role: Role::Difference };
        columns.extend(LpVariant::of_study().map(|variant| of_family(variant.to_string())));
        columns.extend(graph_distances::columns(self.graphs));
        let (mut values, mut swapped, mut contents, mut candidates) = (vec![], vec![], vec![], vec![]);
        for row in rows.into_values() {
            values.extend(row.values);
            swapped.extend(row.swapped);
            contents.push(row.contents);
            candidates.push(row.candidate);
            warnings.extend(row.warnings);
        }
        let shape = (total, columns.len());
        let matrix = |numbers: Vec<f64>| {
            let found = numbers.len();
            Array2::from_shape_vec(shape, numbers)
                .map_err(|_| ExtractionError::Incomplete { found, expected: shape.0 * shape.1 })
        };
        let samples = Samples::new(columns, study.pairs.iter().map(RatedPair::row).collect(), matrix(values)?)?;
        let samples = samples.with_swapped(matrix(swapped)?)?;
        Ok(StudyMatrix { samples, contents, tables: NodeTables { references, candidates }, warnings })
    }

    fn of_reference(
        &self,
        study: &Study,
        indices: &[usize],
        step: &dyn Fn(),
    ) -> Result<ReferenceRows, ExtractionError> {
        let first = indices.first().and_then(|&index| study.pairs.get(index));
        let pair = first.ok_or(ExtractionError::Incomplete { found: 0, expected: 1 })?;
        let reference = pair.reference.identify(self.base)?;
        let (features, warning) = features_of(&reference, self.setup, self.cache)?;
        let mut lp = LpColumns { reference: &reference, cache: self.cache, evaluated: None };
        let mut graphs = GraphDistances::new(self.graphs, &reference, self.cache);
        let mut rows = Vec::with_capacity(indices.len());
        for &index in indices {
            let candidate = study.pairs[index].candidate.identify(self.base)?;
            let (of_candidate, warning) = features_of(&candidate, self.setup, self.cache)?;
            let mut warnings: Vec<CacheWarning> = warning.into_iter().collect();
            let mut values = self.set.compare(&features, &of_candidate, self.setup);
            let mut swapped = self.set.compare(&of_candidate, &features, self.setup);
            // These distances are the same either way.
            let mut distances = lp.of(&candidate, &mut warnings)?;
            distances.extend(graphs.of(&candidate, &mut warnings)?);
            swapped.extend(&distances);
            values.extend(distances);
            let contents = [reference.content, candidate.content];
            rows.push(PairRow { values, swapped, contents, candidate: of_candidate.table().clone(), warnings });
            step();
        }
        Ok(ReferenceRows { reference: features.table().clone(), warning, rows })
    }
}

/// The 36 Lp distances from one reference, which is evaluated once, and only where the cache lacks a pair.
struct LpColumns<'a> {
    reference: &'a IdentifiedBrdf,
    cache: Option<&'a Cache>,
    evaluated: Option<LpReference>,
}

impl LpColumns<'_> {
    fn of(
        &mut self,
        candidate: &IdentifiedBrdf,
        warnings: &mut Vec<CacheWarning>,
    ) -> Result<Vec<f64>, ExtractionError> {
        let key = format!("lp {LP_VERSION} {} {}", self.reference.content, candidate.content);
        if let Some(kept) = self.cache.and_then(|c| c.load_values(&key)) {
            return Ok(kept);
        }
        let reference = self.reference;
        let failed = |source| ExtractionError::distance(reference, candidate, source);
        let prepared = match &mut self.evaluated {
            Some(prepared) => prepared,
            none => none.insert(LpReference::new(reference.brdf()?).map_err(failed)?),
        };
        let distances = LpDistances::of_study_from(prepared, candidate.brdf()?).map_err(failed)?;
        let values: Vec<f64> = distances.of_study().map(|(_, value)| value).collect();
        warnings.extend(self.cache.and_then(|c| c.store_values(&key, &values).err()));
        Ok(values)
    }
}

impl ExtractionError {
    pub(super) fn distance(reference: &IdentifiedBrdf, candidate: &IdentifiedBrdf, source: MetricError) -> Self {
        let (reference, candidate) = (reference.notation.clone(), candidate.notation.clone());
        Self::Distance { reference, candidate, source: Box::new(source) }
    }
}
