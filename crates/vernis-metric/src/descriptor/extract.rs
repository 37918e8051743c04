//! The descriptors of a whole study, each BRDF opened and computed once.

use super::cache::{Cache, CacheWarning};
use super::features::BrdfFeatures;
use super::set::DescriptorSet;
use super::{DescriptorError, Setup};
use crate::brdf::{BrdfSource, IdentifiedBrdf};
use ndarray::Array2;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// How far an extraction has come, in BRDFs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    pub done: usize,
    pub total: usize,
}

/// The descriptors of a list of pairs.
#[derive(Debug, Clone)]
pub struct Extraction {
    /// Pairs x descriptors, in the order of the pairs and of [`DescriptorSet::columns`].
    pub values: Array2<f64>,
    /// The same with reference and candidate exchanged.
    pub swapped: Array2<f64>,
    /// What could not be kept for the next run.
    pub warnings: Vec<CacheWarning>,
}

/// Where an extraction reads from, and what it tells meanwhile.
pub struct Extractor<'a> {
    pub set: &'a DescriptorSet,
    pub setup: &'a Setup,
    /// Folder that relative sources are looked up in.
    pub base: Option<&'a Path>,
    /// Without a cache everything is computed.
    pub cache: Option<&'a Cache>,
    /// Called from any thread each time a BRDF is ready.
    pub progress: &'a (dyn Fn(Progress) + Sync),
}

impl Extractor<'_> {
    /// The descriptors of `(reference, candidate)` pairs, in parallel; the result does not depend on the number of threads.
    ///
    /// Errors: the first, in the order of the pairs, of the sources that cannot be opened or evaluated. What was computed
    /// for others by then stays in the cache. Memory: about 400 kB a distinct BRDF.
    pub fn extract(&self, pairs: &[(BrdfSource, BrdfSource)]) -> Result<Extraction, DescriptorError> {
        let mut index = BTreeMap::new();
        let mut sources: Vec<&BrdfSource> = Vec::new();
        for source in pairs.iter().flat_map(|(r, c)| [r, c]) {
            index.entry(source.identity()).or_insert_with(|| {
                sources.push(source);
                sources.len() - 1
            });
        }
        let number = |source: &BrdfSource| index[&source.identity()];
        let numbered: Vec<(usize, usize)> = pairs.iter().map(|(r, c)| (number(r), number(c))).collect();
        let done = AtomicUsize::new(0);
        let total = sources.len();
        let computed: Vec<Result<_, DescriptorError>> = sources
            .par_iter()
            .map(|source| {
                let result = self.features(source);
                (self.progress)(Progress { done: done.fetch_add(1, Ordering::Relaxed) + 1, total });
                result
            })
            .collect();
        let (features, warnings): (Vec<_>, Vec<_>) =
            computed.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
        let matrix = |pairs: Vec<(usize, usize)>| {
            let rows: Vec<f64> = pairs
                .par_iter()
                .flat_map_iter(|&(r, c)| self.set.compare(&features[r], &features[c], self.setup))
                .collect();
            let (found, columns) = (rows.len(), self.set.columns().len());
            Array2::from_shape_vec((pairs.len(), columns), rows)
                .map_err(|_| DescriptorError::Columns { found, expected: pairs.len() * columns })
        };
        let swapped = matrix(numbered.iter().map(|&(r, c)| (c, r)).collect())?;
        let values = matrix(numbered)?;
        Ok(Extraction { values, swapped, warnings: warnings.into_iter().flatten().collect() })
    }

    fn features(&self, source: &BrdfSource) -> Result<(BrdfFeatures, Option<CacheWarning>), DescriptorError> {
        features(&source.identify(self.base)?, self.setup, self.cache)
    }
}

/// The features of a BRDF, through the cache where there is one.
///
/// # Errors
/// A BRDF that cannot be decoded or evaluated, with its notation.
pub fn features(
    brdf: &IdentifiedBrdf,
    setup: &Setup,
    cache: Option<&Cache>,
) -> Result<(BrdfFeatures, Option<CacheWarning>), DescriptorError> {
    let computed = match cache {
        Some(cache) => cache.features(brdf, setup),
        None => brdf.brdf().map_err(DescriptorError::from).and_then(|b| Ok((BrdfFeatures::compute(b, setup)?, None))),
    };
    computed.map_err(|cause| match cause {
        // These name the file.
        DescriptorError::Open(_) => cause,
        cause => DescriptorError::Source { notation: brdf.notation.clone(), cause: Box::new(cause) },
    })
}
