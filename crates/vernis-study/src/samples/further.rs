//! Distances of metrics that somebody asked for beside those of the extraction: one column a metric, one way only.
//!
//! Each distance is kept in the cache under the contents of both BRDFs and the metric's [`identity`](Metric::identity), so that a
//! metric that is added later costs what it needs itself. An interrupted run loses the pair in hand.

use super::extraction::ExtractionError;
use super::workers::in_order;
use super::{Samples, distances};
use crate::dataset::{RatedPair, Study};
use ndarray::Array2;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use vernis_metric::brdf::ContentHash;
use vernis_metric::descriptor::{Cache, CacheWarning};
use vernis_metric::io::{Count, Progress};
use vernis_metric::metric::{Metric, PreparedMetrics};

/// Distances of the pairs of one reference, by place in the study.
type Rows = BTreeMap<usize, Vec<f64>>;

/// The distance of every pair of `study` by each of `metrics`, in their order; the same for any number of threads.
///
/// # Errors
/// Of the references in the order of their first pair, the first that cannot be read, or compared with a candidate.
pub fn further(
    study: &Study,
    metrics: &[Arc<dyn Metric>],
    base: Option<&Path>,
    cache: Option<&Cache>,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<(Samples, Vec<CacheWarning>), ExtractionError> {
    let mut warnings: Vec<CacheWarning> =
        cache.iter().flat_map(|cache| metrics.iter().filter_map(|metric| metric.warm_up(cache))).collect();
    let job = Job { study, metrics, identities: metrics.iter().map(|metric| metric.identity()).collect(), base, cache };
    let groups = study.by_reference();
    let total = study.pairs.len();
    let done = Count::of(total);
    let step = || done.one(progress);
    let found = in_order(groups.len(), |group| job.of_reference(&groups[group], &step))?;
    let mut rows = Rows::new();
    for (of_reference, of_cache) in found {
        rows.extend(of_reference);
        warnings.extend(of_cache);
    }
    let (shape, numbers) = ((total, metrics.len()), rows.into_values().flatten().collect::<Vec<f64>>());
    let found = numbers.len();
    let matrix = Array2::from_shape_vec(shape, numbers)
        .map_err(|_| ExtractionError::Incomplete { found, expected: shape.0 * shape.1 })?;
    let rows = study.pairs.iter().map(RatedPair::row).collect();
    Ok((Samples::new(distances::columns(metrics), rows, matrix)?, warnings))
}

struct Job<'a> {
    study: &'a Study,
    metrics: &'a [Arc<dyn Metric>],
    identities: Vec<String>,
    base: Option<&'a Path>,
    cache: Option<&'a Cache>,
}

impl Job<'_> {
    fn key(&self, metric: usize, [reference, candidate]: [ContentHash; 2]) -> String {
        format!("distance {} {reference} {candidate}", self.identities[metric])
    }

    fn kept(&self, metric: usize, contents: [ContentHash; 2]) -> Option<f64> {
        let values = self.cache?.load_values(&self.key(metric, contents))?;
        values.first().copied().filter(|_| values.len() == 1)
    }

    fn of_reference(&self, pairs: &[usize], step: &dyn Fn()) -> Result<(Rows, Vec<CacheWarning>), ExtractionError> {
        let first = pairs.first().ok_or(ExtractionError::Incomplete { found: 0, expected: 1 })?;
        let reference = self.study.pairs[*first].reference.identify(self.base)?;
        let mut rows: BTreeMap<usize, Vec<Option<f64>>> = BTreeMap::new();
        for &pair in pairs {
            let candidate = self.study.pairs[pair].candidate.identify(self.base)?;
            let contents = [reference.content, candidate.content];
            rows.insert(pair, (0..self.metrics.len()).map(|metric| self.kept(metric, contents)).collect());
        }
        let missing: Vec<usize> =
            (0..self.metrics.len()).filter(|&metric| rows.values().any(|row| row[metric].is_none())).collect();
        let mut warnings = Vec::new();
        let mut prepared = None;
        for (&pair, row) in &mut rows {
            if row.iter().any(Option::is_none) {
                let candidate = self.study.pairs[pair].candidate.identify(self.base)?;
                let failed = |source| ExtractionError::distance(&reference, &candidate, source);
                if prepared.is_none() {
                    let metrics: Vec<_> = missing.iter().map(|&metric| self.metrics[metric].clone()).collect();
                    prepared = Some(PreparedMetrics::new(&metrics, reference.brdf()?).map_err(failed)?);
                }
                let measured = match &prepared {
                    Some(prepared) => prepared.measure(candidate.brdf()?).map_err(failed)?,
                    None => Vec::new(),
                };
                for (&metric, measured) in missing.iter().zip(measured) {
                    let key = self.key(metric, [reference.content, candidate.content]);
                    warnings.extend(self.cache.and_then(|cache| cache.store_values(&key, &[measured.value]).err()));
                    row[metric] = Some(measured.value);
                }
            }
            step();
        }
        let whole = |row: Vec<Option<f64>>| row.into_iter().flatten().collect();
        Ok((rows.into_iter().map(|(pair, row)| (pair, whole(row))).collect(), warnings))
    }
}
