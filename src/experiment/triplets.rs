//! Do metrics agree with people on which of two materials looks more like a third?
//!
//! A metric chooses the nearer of the two, and half of each where they are equally near. Two figures:
//!
//! * *votes*: the share of all votes that went to its choice. People disagree, so that no metric reaches 1;
//! * *majority*: the share of triplets with a majority whose majority it chooses.
//!
//! Intervals resample references, whose triplets hang together. Distances are kept in the cache: an interrupted run goes on.

use super::ExperimentError;
use crate::dataset::triplets::{Triplet, Triplets};
use crate::evaluation::triplets::{choice, share_agreeing};
use crate::samples::distances::PairDistances;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use vernis_metric::brdf::{BrdfSource, IdentifiedBrdf};
use vernis_metric::descriptor::{Cache, CacheWarning};
use vernis_metric::io::{Count, Observer};
use vernis_metric::math::quantile::Interval;
use vernis_metric::math::resampling::Resamples;
use vernis_metric::metric::Metric;

/// What is asked of which metrics.
pub struct TripletOptions<'a> {
    /// The metrics.
    pub metrics: &'a [Arc<dyn Metric>],
    /// The BRDF of every material, in their order.
    pub sources: &'a [BrdfSource],
    /// Folder that relative sources are looked up in.
    pub base: Option<&'a Path>,
    /// Without a cache everything is computed.
    pub cache: Option<&'a Cache>,
    /// Bootstrap resamples of references.
    pub resamples: usize,
    /// Of the resamples.
    pub seed: u64,
}

/// How metrics agree with triplets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TripletRecord {
    /// Triplets with votes.
    pub triplets: usize,
    /// Their votes.
    pub votes: u64,
    /// Those of them that have a majority.
    pub untied: usize,
    /// Materials that are references.
    pub references: usize,
    /// The share of votes of a metric that always chooses as the majority does.
    pub most: f64,
    /// Bootstrap resamples of references.
    pub resamples: usize,
    /// Of the resamples.
    pub seed: u64,
    /// The metrics, in the order in which they were asked for.
    pub metrics: Vec<MetricAgreement>,
}

/// How one metric agrees.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MetricAgreement {
    /// Name of the metric.
    pub name: String,
    /// Version of its numbers.
    pub version: String,
    /// The share of votes for its choices.
    pub votes: Share,
    /// The share of majorities that it chooses.
    pub majority: Share,
}

/// A share and its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Share {
    /// 0 to 1.
    pub value: f64,
    /// By bootstrap over references; `None` for one reference.
    pub interval: Option<Interval>,
}

/// The agreement of every metric, and what could not be kept for the next run.
///
/// # Errors
/// Another number of sources than of materials, one that cannot be read, a metric that fails, resamples out of range.
pub fn triplets(
    set: &Triplets,
    options: &TripletOptions<'_>,
    progress: Observer<'_>,
) -> Result<(TripletRecord, Vec<CacheWarning>), ExperimentError> {
    let opened: Vec<IdentifiedBrdf> =
        options.sources.iter().map(|source| source.identify(options.base)).collect::<Result<_, _>>()?;
    let rated: Vec<&Triplet> = set.triplets.iter().filter(|t| t.votes != [0, 0]).collect();
    let mut needed: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
    for triplet in &rated {
        needed.entry(triplet.reference).or_default().extend(triplet.candidates);
    }
    let needed: Vec<(usize, BTreeSet<usize>)> = needed.into_iter().collect();
    let done = Count::of(needed.iter().map(|(_, candidates)| candidates.len()).sum());
    let place = |index: usize| {
        opened.get(index).ok_or_else(|| ExperimentError::Write { reason: format!("material {index} has no BRDF") })
    };
    let of_reference = |(reference, candidates): &(usize, BTreeSet<usize>)| {
        let mut warnings = Vec::new();
        let mut distances = PairDistances::new(options.metrics, place(*reference)?, options.cache);
        let mut found = BTreeMap::new();
        for &candidate in candidates {
            found.insert((*reference, candidate), distances.one_way(place(candidate)?, &mut warnings)?);
            done.one(|found| progress("pairs", found));
        }
        Ok((found, warnings))
    };
    let all = needed.par_iter().map(of_reference).collect::<Result<Vec<_>, ExperimentError>>()?;
    let (mut distances, mut warnings) = (BTreeMap::new(), Vec::new());
    for (found, of_reference) in all {
        distances.extend(found);
        warnings.extend(of_reference);
    }
    Ok((judge(&rated, options.metrics, &distances, options.resamples, options.seed)?, warnings))
}

/// Sums of one reference: agreeing and all votes, then agreeing and all majorities.
type Sums = [[f64; 2]; 2];

fn judge(
    rated: &[&Triplet],
    metrics: &[Arc<dyn Metric>],
    distances: &BTreeMap<(usize, usize), Vec<f64>>,
    resamples: usize,
    seed: u64,
) -> Result<TripletRecord, ExperimentError> {
    let references: BTreeSet<usize> = rated.iter().map(|t| t.reference).collect();
    let rows: Vec<Vec<usize>> = (0..references.len()).map(|row| vec![row]).collect();
    let drawn = match rows.len() {
        0 | 1 => None,
        _ => Some(
            Resamples::draw(&rows, resamples, seed, "triplet references")
                .map_err(crate::evaluation::EvaluationError::from)?,
        ),
    };
    let agreement = |(index, metric): (usize, &Arc<dyn Metric>)| {
        let mut of_reference: BTreeMap<usize, Sums> = BTreeMap::new();
        for triplet in rated {
            let distance = |k: usize| distances.get(&(triplet.reference, triplet.candidates[k])).map(|all| all[index]);
            let (Some(a), Some(b)) = (distance(0), distance(1)) else { continue };
            let first = choice([-a, -b]);
            let [va, vb] = triplet.votes.map(f64::from);
            let [votes, majorities] = of_reference.entry(triplet.reference).or_default();
            votes[0] += first * va + (1.0 - first) * vb;
            votes[1] += va + vb;
            if va != vb {
                majorities[0] += if va > vb { first } else { 1.0 - first };
                majorities[1] += 1.0;
            }
        }
        let sums: Vec<Sums> = of_reference.into_values().collect();
        let share = |k: usize| {
            let numbers: Vec<[f64; 2]> = sums.iter().map(|of_reference| of_reference[k]).collect();
            let of = |counts: &[u32]| share_agreeing(&numbers, counts);
            let value = of(&vec![1; numbers.len()]).unwrap_or(f64::NAN);
            Share { value, interval: drawn.as_ref().and_then(|drawn| drawn.interval(of)) }
        };
        let (name, version) = (metric.name().to_owned(), metric.version().to_owned());
        MetricAgreement { name, version, votes: share(0), majority: share(1) }
    };
    let votes: u64 = rated.iter().flat_map(|t| t.votes).map(u64::from).sum();
    let most: u64 = rated.iter().map(|t| u64::from(t.votes[0].max(t.votes[1]))).sum();
    Ok(TripletRecord {
        triplets: rated.len(),
        votes,
        untied: rated.iter().filter(|t| t.votes[0] != t.votes[1]).count(),
        references: references.len(),
        most: most as f64 / votes as f64,
        resamples,
        seed,
        metrics: metrics.iter().enumerate().map(agreement).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use vernis_metric::metric::registry::Registry;

    #[test]
    fn votes_and_majorities_are_counted_and_ties_count_half() {
        let triplet = |reference, candidates, votes| Triplet { reference, candidates, votes };
        let all = [
            triplet(0, [1, 2], [3, 1]),
            triplet(0, [2, 1], [2, 2]),
            triplet(1, [0, 2], [1, 3]),
            triplet(2, [0, 1], [4, 0]),
        ];
        let rated: Vec<&Triplet> = all.iter().collect();
        // 0: 1 is nearer than 2; 1: 0 is nearer than 2; 2: both are as near.
        let near = [((0, 1), 1.0), ((0, 2), 2.0), ((1, 0), 1.0), ((1, 2), 2.0), ((2, 0), 1.0), ((2, 1), 1.0)];
        let distances = near.into_iter().map(|(pair, d)| (pair, vec![d])).collect();
        let metrics = [Registry::standard().unwrap().get("D1").unwrap()];
        let found = judge(&rated, &metrics, &distances, 200, 1).unwrap();
        // Votes: 3 of 4, 2 of 4, 1 of 4, 2 of 4; majorities: 1, -, 0, 1/2 of 3.
        let agreement = &found.metrics[0];
        assert_eq!((agreement.votes.value, agreement.majority.value), (8.0 / 16.0, 1.5 / 3.0));
        assert_eq!((found.triplets, found.votes, found.untied, found.references), (4, 16, 3, 3));
        assert_eq!(found.most, (3 + 2 + 3 + 4) as f64 / 16.0);
        // References alone have shares of votes of 5/8, 1/4 and 1/2.
        let interval = agreement.votes.interval.unwrap();
        assert!((0.25..=0.5).contains(&interval.low) && (0.5..=0.625).contains(&interval.high), "{interval:?}");
        assert!(judge(&rated, &metrics, &distances, 10, 1).is_err());
    }
}
