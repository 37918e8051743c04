//! A study becomes a matrix: one row a rated pair, one column a descriptor or a classical distance.
//!
//! Descriptors come from [`crate::descriptor::Extractor`], the Lp distances from one pass over each pair of tables; both
//! are cached by the content of the BRDFs. Memory: at most 93 MB a worker thread, 400 kB a BRDF.

use super::graph_distances::{self, GraphDistances};
use crate::brdf::{BrdfError, BrdfSource, OpenBrdf};
use crate::dataset::Study;
use crate::dataset::samples::{Column, Role, Samples, SamplesError};
use crate::descriptor::{Cache, CacheWarning, DescriptorError, DescriptorSet, Extractor, Progress, Setup};
use crate::metric::lp::{LpDistances, LpReference, LpVariant};
use crate::metric::{Metric, MetricError};
use ndarray::{Array2, Axis, concatenate};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use thiserror::Error;

/// Family of the columns that hold Lp distances; each column has the metric's own name.
pub const LP_FAMILY: &str = "lp";

/// Part of the cache key of Lp distances: raise it when one of them changes.
const LP_VERSION: u32 = 2;

#[derive(Debug, Error)]
pub enum MatrixError {
    #[error(transparent)]
    Descriptor(#[from] DescriptorError),
    #[error(transparent)]
    Open(#[from] BrdfError),
    #[error("{reference} against {candidate}: {source}")]
    Lp { reference: String, candidate: String, source: Box<MetricError> },
    #[error("{reference} against {candidate}: {source}")]
    Graph { reference: String, candidate: String, source: Box<MetricError> },
    #[error(transparent)]
    Samples(#[from] SamplesError),
    #[error("the distances of {found} pairs were computed, expected {expected}")]
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
    /// Called from any thread: the name of the stage and how far it is.
    pub progress: &'a (dyn Fn(&'static str, Progress) + Sync),
}

/// Place of a pair in its study, its Lp distances, and what of them could not be kept.
type LpRow = (usize, Vec<f64>, Option<CacheWarning>);

/// A study as numbers.
#[derive(Debug, Clone)]
pub struct StudyMatrix {
    /// The columns of the descriptor set, then one a Lp variant of the study, then one a metric on graphs.
    pub samples: Samples,
    /// What could not be kept for the next run.
    pub warnings: Vec<CacheWarning>,
}

impl MatrixBuilder<'_> {
    /// Descriptors and the 36 Lp distances of every pair of `study`, in the order of its pairs; the same for any number
    /// of threads.
    pub fn build(&self, study: &Study) -> Result<StudyMatrix, MatrixError> {
        let pairs: Vec<(BrdfSource, BrdfSource)> =
            study.pairs.iter().map(|p| (p.reference.clone(), p.candidate.clone())).collect();
        let progress = |p: Progress| (self.progress)("descriptors", p);
        let extractor =
            Extractor { set: self.set, setup: self.setup, base: self.base, cache: self.cache, progress: &progress };
        let extraction = extractor.extract(&pairs)?;
        let mut warnings = extraction.warnings;
        let (lp, lp_warnings) = self.lp_distances(&pairs)?;
        warnings.extend(lp_warnings);
        let mut columns = self.set.columns();
        columns.extend(LpVariant::of_study().map(|v| Column {
            name: v.to_string(),
            family: LP_FAMILY.to_owned(),
            role: Role::Difference,
        }));
        let progress = |p: Progress| (self.progress)("transport and energy", p);
        let distances =
            GraphDistances { metrics: self.graphs, base: self.base, cache: self.cache, progress: &progress };
        let (graphs, graph_warnings) = distances.compute(&pairs)?;
        warnings.extend(graph_warnings);
        columns.extend(graph_distances::columns(self.graphs));
        // These distances are the same either way.
        let beside_distances = |values: &Array2<f64>| {
            concatenate(Axis(1), &[values.view(), lp.view(), graphs.view()])
                .map_err(|_| MatrixError::Incomplete { found: lp.nrows(), expected: pairs.len() })
        };
        let rows = study.pairs.iter().map(|p| p.row()).collect();
        let samples = Samples::new(columns, rows, beside_distances(&extraction.values)?)?;
        Ok(StudyMatrix { samples: samples.with_swapped(beside_distances(&extraction.swapped)?)?, warnings })
    }

    /// Pairs x the 36 variants. Pairs of one reference are done together, so that it is evaluated once.
    fn lp_distances(
        &self,
        pairs: &[(BrdfSource, BrdfSource)],
    ) -> Result<(Array2<f64>, Vec<CacheWarning>), MatrixError> {
        let mut by_reference: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        pairs.iter().enumerate().for_each(|(i, (r, _))| by_reference.entry(r.identity()).or_default().push(i));
        let (done, total) = (AtomicUsize::new(0), pairs.len());
        let of_group = |indices: &Vec<usize>| -> Result<Vec<LpRow>, MatrixError> {
            let Some(&first) = indices.first() else { return Ok(Vec::new()) };
            let reference = pairs[first].0.open(self.base)?;
            let mut evaluated = None;
            let mut found = Vec::with_capacity(indices.len());
            for &i in indices {
                let candidate = pairs[i].1.open(self.base)?;
                let (values, warning) = self.lp_of_pair(&reference, &candidate, &mut evaluated)?;
                found.push((i, values, warning));
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                (self.progress)("Lp distances", Progress { done, total });
            }
            Ok(found)
        };
        let groups: Vec<&Vec<usize>> = by_reference.values().collect();
        let found: Vec<_> = groups.into_par_iter().map(of_group).collect::<Result<Vec<_>, _>>()?;
        let mut values = Array2::zeros((pairs.len(), LpVariant::of_study().count()));
        let mut warnings = Vec::new();
        for (i, row, warning) in found.into_iter().flatten() {
            values.row_mut(i).iter_mut().zip(row).for_each(|(to, from)| *to = from);
            warnings.extend(warning);
        }
        Ok((values, warnings))
    }

    fn lp_of_pair(
        &self,
        reference: &OpenBrdf,
        candidate: &OpenBrdf,
        evaluated: &mut Option<LpReference>,
    ) -> Result<(Vec<f64>, Option<CacheWarning>), MatrixError> {
        let key = format!("lp {LP_VERSION} {} {}", reference.content, candidate.content);
        if let Some(kept) = self.cache.and_then(|c| c.load_values(&key)) {
            return Ok((kept, None));
        }
        let failed = |source| {
            let (reference, candidate) = (reference.notation.clone(), candidate.notation.clone());
            MatrixError::Lp { reference, candidate, source: Box::new(source) }
        };
        let prepared = match evaluated {
            Some(prepared) => prepared,
            None => evaluated.insert(LpReference::new(reference.brdf.as_ref()).map_err(failed)?),
        };
        let distances = LpDistances::of_study_from(prepared, candidate.brdf.as_ref()).map_err(failed)?;
        let values: Vec<f64> = distances.of_study().map(|(_, value)| value).collect();
        let warning = self.cache.and_then(|c| c.store_values(&key, &values).err());
        Ok((values, warning))
    }
}
