//! Distances of a study's pairs, as columns beside the descriptors.
//!
//! Metrics that share work are computed together ([`PreparedMetrics`]): the 36 Lp distances by one pass, all metrics on one grid
//! from the same tables. What a group gives for a pair is kept in the cache under the contents of both BRDFs and the
//! [`identity`](Metric::identity) of each of its metrics, which holds their versions. Memory: what the metrics take for one
//! reference and one candidate.

use super::extraction::ExtractionError;
use std::sync::Arc;
use vernis_metric::brdf::{ContentHash, IdentifiedBrdf};
use vernis_metric::descriptor::{Cache, CacheWarning, Column, Role};
use vernis_metric::metric::{Metric, MetricError, PreparedMetrics, groups};

/// One column a metric, with the metric's own name and family.
pub fn columns(metrics: &[Arc<dyn Metric>]) -> Vec<Column> {
    let column = |metric: &Arc<dyn Metric>| Column {
        name: metric.name().to_owned(),
        family: match metric.properties().family {
            "" => metric.name().to_owned(),
            family => family.to_owned(),
        },
        role: Role::Difference,
    };
    metrics.iter().map(column).collect()
}

/// Metrics that are computed together.
struct Group {
    /// Their places among all.
    places: Vec<usize>,
    metrics: Vec<Arc<dyn Metric>>,
    /// A hash of what decides their numbers.
    identity: ContentHash,
    symmetric: bool,
    /// With the reference; made where the cache lacks a pair.
    prepared: Option<PreparedMetrics>,
}

impl Group {
    fn new(places: Vec<usize>, all: &[Arc<dyn Metric>]) -> Self {
        let metrics: Vec<_> = places.iter().map(|&place| all[place].clone()).collect();
        let identities: String = metrics.iter().map(|metric| metric.identity() + "\n").collect();
        let symmetric = metrics.iter().all(|metric| metric.properties().symmetric);
        Self { places, metrics, identity: ContentHash::of(identities.as_bytes()), symmetric, prepared: None }
    }

    fn key(&self, reference: ContentHash, candidate: ContentHash) -> String {
        format!("distances {} {reference} {candidate}", self.identity)
    }
}

/// The distances from one reference.
pub(crate) struct PairDistances<'a> {
    groups: Vec<Group>,
    count: usize,
    reference: &'a IdentifiedBrdf,
    cache: Option<&'a Cache>,
}

/// One number a metric.
pub(crate) struct Values {
    pub distances: Vec<f64>,
    /// The same with reference and candidate exchanged.
    pub swapped: Vec<f64>,
}

impl<'a> PairDistances<'a> {
    pub fn new(metrics: &[Arc<dyn Metric>], reference: &'a IdentifiedBrdf, cache: Option<&'a Cache>) -> Self {
        let groups = groups(metrics).into_iter().map(|places| Group::new(places, metrics)).collect();
        Self { groups, count: metrics.len(), reference, cache }
    }

    /// The distances to one candidate, one number a metric, without those of the exchanged pair.
    pub fn one_way(
        &mut self,
        candidate: &IdentifiedBrdf,
        warnings: &mut Vec<CacheWarning>,
    ) -> Result<Vec<f64>, ExtractionError> {
        let mut distances = vec![0.0; self.count];
        for group in &mut self.groups {
            let found = of_group(group, self.reference, candidate, self.cache, warnings)?;
            group.places.iter().zip(found).for_each(|(&place, value)| distances[place] = value);
        }
        Ok(distances)
    }

    /// The distances to one candidate.
    pub fn to(
        &mut self,
        candidate: &IdentifiedBrdf,
        warnings: &mut Vec<CacheWarning>,
    ) -> Result<Values, ExtractionError> {
        let (mut distances, mut swapped) = (vec![0.0; self.count], vec![0.0; self.count]);
        for group in &mut self.groups {
            let forth = of_group(group, self.reference, candidate, self.cache, warnings)?;
            let back = match group.symmetric {
                true => forth.clone(),
                false => exchanged(group, self.reference, candidate, self.cache, warnings)?,
            };
            for ((&place, forth), back) in group.places.iter().zip(forth).zip(back) {
                (distances[place], swapped[place]) = (forth, back);
            }
        }
        Ok(Values { distances, swapped })
    }
}

fn of_group(
    group: &mut Group,
    reference: &IdentifiedBrdf,
    candidate: &IdentifiedBrdf,
    cache: Option<&Cache>,
    warnings: &mut Vec<CacheWarning>,
) -> Result<Vec<f64>, ExtractionError> {
    let key = group.key(reference.content, candidate.content);
    if let Some(kept) = cache.and_then(|c| c.load_values(&key)).filter(|kept| kept.len() == group.places.len()) {
        return Ok(kept);
    }
    let failed = |source: MetricError| ExtractionError::distance(reference, candidate, source);
    let prepared = match &mut group.prepared {
        Some(prepared) => prepared,
        none => none.insert(PreparedMetrics::new(&group.metrics, reference.brdf()?).map_err(failed)?),
    };
    keep(prepared, candidate, &key, cache, warnings, &failed)
}

/// With the candidate as the reference, which no other pair has: nothing is kept for the next.
fn exchanged(
    group: &Group,
    reference: &IdentifiedBrdf,
    candidate: &IdentifiedBrdf,
    cache: Option<&Cache>,
    warnings: &mut Vec<CacheWarning>,
) -> Result<Vec<f64>, ExtractionError> {
    let key = group.key(candidate.content, reference.content);
    if let Some(kept) = cache.and_then(|c| c.load_values(&key)).filter(|kept| kept.len() == group.places.len()) {
        return Ok(kept);
    }
    let failed = |source: MetricError| ExtractionError::distance(candidate, reference, source);
    let prepared = PreparedMetrics::new(&group.metrics, candidate.brdf()?).map_err(failed)?;
    keep(&prepared, reference, &key, cache, warnings, &failed)
}

fn keep(
    prepared: &PreparedMetrics,
    candidate: &IdentifiedBrdf,
    key: &str,
    cache: Option<&Cache>,
    warnings: &mut Vec<CacheWarning>,
    failed: &dyn Fn(MetricError) -> ExtractionError,
) -> Result<Vec<f64>, ExtractionError> {
    let measured = prepared.measure(candidate.brdf()?).map_err(failed)?;
    let values: Vec<f64> = measured.into_iter().map(|m| m.value).collect();
    warnings.extend(cache.and_then(|c| c.store_values(key, &values).err()));
    Ok(values)
}
