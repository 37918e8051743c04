//! Distances of a study's pairs, as columns beside the descriptors.
//!
//! Metrics that share work are computed together ([`PreparedMetrics`]): the 36 Lp distances by one pass, all metrics on one grid
//! from the same tables. What a group gives for a pair is kept in the cache under the contents of both BRDFs and the
//! [`identity`](Metric::identity) of each of its metrics, which holds their versions. Memory: what the metrics take for one
//! reference and the candidates that are measured together.

use super::extraction::ExtractionError;
use std::slice;
use std::sync::Arc;
use vernis_metric::brdf::{ContentHash, IdentifiedBrdf};
use vernis_metric::descriptor::{Cache, CacheWarning, Column, Role};
use vernis_metric::metric::{Measured, Metric, MetricError, PreparedMetrics, groups};

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
pub struct PairDistances<'a> {
    groups: Vec<Group>,
    count: usize,
    reference: &'a IdentifiedBrdf,
    cache: Option<&'a Cache>,
}

/// One number a metric.
pub struct Values {
    /// From the reference to the candidate.
    pub distances: Vec<f64>,
    /// The same with reference and candidate exchanged.
    pub swapped: Vec<f64>,
}

impl<'a> PairDistances<'a> {
    /// Nothing is computed yet. With a cache, what it has is not computed again.
    pub fn new(metrics: &[Arc<dyn Metric>], reference: &'a IdentifiedBrdf, cache: Option<&'a Cache>) -> Self {
        let groups = groups(metrics).into_iter().map(|places| Group::new(places, metrics)).collect();
        Self { groups, count: metrics.len(), reference, cache }
    }

    /// The distances to one candidate, one number a metric, without those of the exchanged pair.
    ///
    /// # Errors
    /// What a metric cannot compare.
    pub fn one_way(
        &mut self,
        candidate: &IdentifiedBrdf,
        warnings: &mut Vec<CacheWarning>,
    ) -> Result<Vec<f64>, ExtractionError> {
        let mut distances = vec![0.0; self.count];
        for group in &mut self.groups {
            let found = of_group(group, self.reference, slice::from_ref(candidate), self.cache, warnings)?.concat();
            group.places.iter().zip(found).for_each(|(&place, value)| distances[place] = value);
        }
        Ok(distances)
    }

    /// The distances to each of `candidates`.
    ///
    /// # Errors
    /// What a metric cannot compare.
    pub fn to(
        &mut self,
        candidates: &[IdentifiedBrdf],
        warnings: &mut Vec<CacheWarning>,
    ) -> Result<Vec<Values>, ExtractionError> {
        let nothing = || Values { distances: vec![0.0; self.count], swapped: vec![0.0; self.count] };
        let mut values: Vec<Values> = candidates.iter().map(|_| nothing()).collect();
        for group in &mut self.groups {
            let found = of_group(group, self.reference, candidates, self.cache, warnings)?;
            for ((values, forth), candidate) in values.iter_mut().zip(found).zip(candidates) {
                let back = match group.symmetric {
                    true => forth.clone(),
                    false => exchanged(group, self.reference, candidate, self.cache, warnings)?,
                };
                for ((&place, forth), back) in group.places.iter().zip(forth).zip(back) {
                    (values.distances[place], values.swapped[place]) = (forth, back);
                }
            }
        }
        Ok(values)
    }
}

/// What the cache has, and the rest in one pass.
fn of_group(
    group: &mut Group,
    reference: &IdentifiedBrdf,
    candidates: &[IdentifiedBrdf],
    cache: Option<&Cache>,
    warnings: &mut Vec<CacheWarning>,
) -> Result<Vec<Vec<f64>>, ExtractionError> {
    let keys: Vec<String> = candidates.iter().map(|c| group.key(reference.content, c.content)).collect();
    let load = |key: &String| cache?.load_values(key).filter(|kept| kept.len() == group.places.len());
    let mut found: Vec<Option<Vec<f64>>> = keys.iter().map(load).collect();
    let missing: Vec<usize> = (0..candidates.len()).filter(|&k| found[k].is_none()).collect();
    let Some(&first) = missing.first() else { return Ok(found.into_iter().flatten().collect()) };
    let failed = |k: usize| {
        let candidate = &candidates[k];
        move |source: MetricError| ExtractionError::distance(reference, candidate, source)
    };
    let prepared = match &mut group.prepared {
        Some(prepared) => prepared,
        none => none.insert(PreparedMetrics::new(&group.metrics, reference.brdf()?).map_err(failed(first))?),
    };
    let brdfs = missing.iter().map(|&k| candidates[k].brdf()).collect::<Result<Vec<_>, _>>();
    // Where one of them fails, one after the other, so that those before it are kept and it is named.
    let together = brdfs.ok().and_then(|brdfs| prepared.measure_all(&brdfs).ok()).unwrap_or_default();
    let mut together = together.into_iter();
    for k in missing {
        let measured = match together.next() {
            Some(measured) => measured,
            None => prepared.measure(candidates[k].brdf()?).map_err(failed(k))?,
        };
        found[k] = Some(keep(measured, &keys[k], cache, warnings));
    }
    Ok(found.into_iter().flatten().collect())
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
    let measured = prepared.measure(reference.brdf()?).map_err(failed)?;
    Ok(keep(measured, &key, cache, warnings))
}

fn keep(measured: Vec<Measured>, key: &str, cache: Option<&Cache>, warnings: &mut Vec<CacheWarning>) -> Vec<f64> {
    let values: Vec<f64> = measured.into_iter().map(|m| m.value).collect();
    warnings.extend(cache.and_then(|c| c.store_values(key, &values).err()));
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use vernis_metric::brdf::models::Lambert;
    use vernis_metric::brdf::{Brdf, OpenBrdf};
    use vernis_metric::math::{Rgb, Vec3};
    use vernis_metric::metric::registry::Registry;

    struct Negative;

    impl Brdf for Negative {
        fn eval(&self, _wi: Vec3, _wo: Vec3) -> Option<Rgb> {
            Some([-1.0; 3])
        }
    }

    fn open(name: &str, brdf: impl Brdf + 'static) -> IdentifiedBrdf {
        let content = ContentHash::of(name.as_bytes());
        OpenBrdf { notation: name.to_owned(), content, brdf: Arc::new(brdf) }.into()
    }

    fn grey(albedo: f64) -> IdentifiedBrdf {
        open(&format!("grey {albedo}"), Lambert::new([albedo; 3]).unwrap())
    }

    fn metrics() -> Vec<Arc<dyn Metric>> {
        let registry = Registry::standard().unwrap();
        ["D9.Cl", "D6", "energy[grid=6x6x24]"].map(|name| registry.get(name).unwrap()).to_vec()
    }

    #[test]
    fn candidates_together_are_as_far_away_as_one_by_one() {
        let (metrics, reference) = (metrics(), grey(0.5));
        let candidates = [grey(0.2), grey(0.5), grey(0.7)];
        let together = PairDistances::new(&metrics, &reference, None).to(&candidates, &mut Vec::new()).unwrap();
        for (candidate, together) in candidates.iter().zip(together) {
            let alone = PairDistances::new(&metrics, &reference, None).one_way(candidate, &mut Vec::new()).unwrap();
            assert_eq!((&alone, &alone), (&together.distances, &together.swapped), "{}", candidate.notation);
        }
    }

    #[test]
    fn a_candidate_that_fails_is_named_and_those_before_it_are_kept() {
        let (metrics, reference) = (metrics(), grey(0.5));
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::open(folder.path()).unwrap();
        let mut distances = PairDistances::new(&metrics[..1], &reference, Some(&cache));
        let candidates = [grey(0.2), open("bad", Negative), grey(0.7)];
        let Err(error) = distances.to(&candidates, &mut Vec::new()) else { panic!("a negative BRDF was measured") };
        assert!(error.to_string().starts_with("grey 0.5 against bad: "), "{error}");
        let group = &distances.groups[0];
        let kept = candidates.map(|c| cache.load_values(&group.key(reference.content, c.content)).is_some());
        assert_eq!(kept, [true, false, false]);
    }
}
