//! A study becomes a matrix: one row a rated pair, one column a descriptor or a classical distance.
//!
//! The pairs of one reference are done together by one worker, which reads the reference once and one candidate after the
//! other; models and networks, which are small, eight at a time. Everything is cached by the content of the BRDFs: an
//! interrupted run loses the pairs in hand, and a table that the cache knows is read, for its content, but not decoded. Memory: at most
//! a reference and a candidate a worker thread, 250 MB where they are tables, and 2 kB a pair.

use super::distances::{self, PairDistances};
use super::{Samples, SamplesError};
use crate::dataset::{RatedPair, Study};
use crate::samples::workers::in_order;
use ndarray::Array2;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use thiserror::Error;
use vernis_metric::brdf::{BrdfError, ContentHash, IdentifiedBrdf};
use vernis_metric::descriptor::{Cache, CacheWarning, DescriptorError, DescriptorSet, Setup, features as features_of};
use vernis_metric::io::{Count, Progress};
use vernis_metric::light::NodeTable;
use vernis_metric::metric::{Metric, MetricError};

/// Models and networks that are compared with their reference in one pass.
const TOGETHER: usize = 8;

/// Why a study could not be turned into numbers.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum ExtractionError {
    #[error(transparent)]
    Descriptor(#[from] DescriptorError),
    #[error(transparent)]
    Open(#[from] BrdfError),
    #[error("{reference} against {candidate}: {source}")]
    Distance { reference: String, candidate: String, source: Box<MetricError> },
    #[error(transparent)]
    Samples(#[from] SamplesError),
    #[error("{found} numbers were computed; there must be {expected}")]
    Incomplete { found: usize, expected: usize },
}

/// Where a matrix is computed from, and what it tells meanwhile.
pub struct Extractor<'a> {
    /// The descriptors that become columns.
    pub set: &'a DescriptorSet,
    /// Lights and shape of the descriptors.
    pub setup: &'a Setup,
    /// Metrics whose distances become columns as well.
    pub metrics: &'a [Arc<dyn Metric>],
    /// Folder that relative sources are looked up in.
    pub base: Option<&'a Path>,
    /// Without a cache everything is computed.
    pub cache: Option<&'a Cache>,
    /// Called from any thread each time a pair is done.
    pub progress: &'a (dyn Fn(Progress) + Sync),
}

/// A study as numbers.
#[derive(Debug, Clone)]
pub struct Extraction {
    /// The columns of the descriptor set, then one a metric.
    pub samples: Samples,
    /// Of reference and candidate of every pair.
    pub contents: Vec<[ContentHash; 2]>,
    /// Sampled BRDFs, from which embeddings are learned.
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

impl Extractor<'_> {
    /// Descriptors and distances of every pair of `study`, in the order of its pairs; the same for any number of threads.
    ///
    /// # Errors
    /// Of the references in the order of their first pair, the first that cannot be read, or compared with a candidate. What was
    /// computed by then stays in the cache.
    pub fn extract(&self, study: &Study) -> Result<Extraction, ExtractionError> {
        let groups = study.by_reference();
        let total = study.pairs.len();
        let done = Count::of(total);
        let step = || done.one(self.progress);
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
        columns.extend(distances::columns(self.metrics));
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
        let samples = samples.with_swapped(matrix(swapped)?)?.with_identical(study.identical.clone(), study.scale);
        Ok(Extraction { samples, contents, tables: NodeTables { references, candidates }, warnings })
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
        let mut distances = PairDistances::new(self.metrics, &reference, self.cache);
        let mut rows = Vec::with_capacity(indices.len());
        let mut left = indices.iter();
        loop {
            // No more than one table at a time.
            let mut candidates: Vec<IdentifiedBrdf> = Vec::new();
            while candidates.len() < TOGETHER && candidates.last().is_none_or(IdentifiedBrdf::is_open) {
                let Some(&index) = left.next() else { break };
                candidates.push(study.pairs[index].candidate.identify(self.base)?);
            }
            if candidates.is_empty() {
                break;
            }
            let mut warnings = Vec::new();
            let mut of_candidates = Vec::with_capacity(candidates.len());
            for candidate in &candidates {
                let (of_candidate, warning) = features_of(candidate, self.setup, self.cache)?;
                warnings.extend(warning);
                of_candidates.push(of_candidate);
            }
            let of_metrics = distances.to(&candidates, &mut warnings)?;
            for ((candidate, of_candidate), of_metrics) in candidates.iter().zip(of_candidates).zip(of_metrics) {
                let mut values = self.set.compare(&features, &of_candidate, self.setup);
                let mut swapped = self.set.compare(&of_candidate, &features, self.setup);
                values.extend(of_metrics.distances);
                swapped.extend(of_metrics.swapped);
                let (contents, candidate) = ([reference.content, candidate.content], of_candidate.table().clone());
                rows.push(PairRow { values, swapped, contents, candidate, warnings: std::mem::take(&mut warnings) });
                step();
            }
        }
        Ok(ReferenceRows { reference: features.table().clone(), warning, rows })
    }
}

impl ExtractionError {
    pub(super) fn distance(reference: &IdentifiedBrdf, candidate: &IdentifiedBrdf, source: MetricError) -> Self {
        let (reference, candidate) = (reference.notation.clone(), candidate.notation.clone());
        Self::Distance { reference, candidate, source: Box::new(source) }
    }
}
