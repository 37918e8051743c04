//! Agreement with judged triplets whose reference a metric has not seen.
//!
//! The folds are those by material group of the rated rows. A model that was trained on the other side of a fold, ratings and triplets
//! alike, chooses for each held-out triplet the pair with the better score, and half of each where scores are equal. References that
//! nobody rated are in no fold, and their triplets are always trained on: they are not judged. The figure is the share of triplets
//! with a majority whose majority is chosen; its interval resamples references with their sisters.

use super::EvaluationError;
use super::bootstrap::{Interval, Resamples};
use super::cross_validation::fold_seed;
use crate::samples::Samples;
use crate::samples::split::Fold;
use crate::samples::triplets::JudgedTriplet;
use crate::train::Trainer;
use ndarray::Array2;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use vernis_metric::math::parallel;

/// How a metric agrees with triplets whose reference it has not seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TripletAgreement {
    /// Name of the metric.
    pub metric: String,
    /// Triplets with a majority that were judged.
    pub triplets: usize,
    /// Groups of their references.
    pub groups: usize,
    /// The share whose majority the metric chooses.
    pub majority: f64,
    /// 95 %, over resamples of groups; `None` for one group.
    pub interval: Option<Interval>,
}

/// How much of a choice between two falls on the first: all where its `nearness` is larger, half where both are equal.
pub fn choice(nearness: [f64; 2]) -> f64 {
    match nearness {
        [a, b] if a > b => 1.0,
        [a, b] if a < b => 0.0,
        _ => 0.5,
    }
}

/// What agrees as a share of all, from the two numbers of each reference or group of them that count as often as `counts` says; `None`
/// where there is nothing to agree with.
pub fn share_agreeing(numbers: &[[f64; 2]], counts: &[u32]) -> Option<f64> {
    let total = |k: usize| numbers.iter().zip(counts).map(|(n, &c)| f64::from(c) * n[k]).sum::<f64>();
    (total(1) > 0.0).then(|| total(0) / total(1))
}

/// Agreeing and all majorities of a group of references.
type Counts = BTreeMap<String, [f64; 2]>;

/// The agreement of what `trainer` learns in each of `folds` with the triplets of `samples` that the fold holds out; `None` where there
/// are none.
///
/// # Errors
/// A fold on which nothing can be learned.
pub fn cross_validate_triplets(
    samples: &Samples,
    folds: &[Fold],
    trainer: &dyn Trainer,
    resamples: usize,
    seed: u64,
) -> Result<Option<TripletAgreement>, EvaluationError> {
    let Some(all) = samples.triplets() else { return Ok(None) };
    let of_fold = |index: usize| -> Result<Counts, EvaluationError> {
        let fold = &folds[index];
        let groups: BTreeSet<&str> = fold.held_out.rows().iter().map(|row| row.group.as_str()).collect();
        let held: Vec<&JudgedTriplet> =
            all.triplets().iter().filter(|t| t.is_untied() && groups.contains(&*t.group)).collect();
        let mut counts = Counts::new();
        if held.is_empty() {
            return Ok(counts);
        }
        let failed = |source| EvaluationError::Training {
            metric: trainer.name().to_owned(),
            fold: index,
            training_rows: fold.training.rows().len(),
            source: Box::new(source),
        };
        let model = trainer.train(&fold.training, fold_seed(seed, index)).map_err(failed)?;
        let pairs: BTreeSet<usize> = held.iter().flat_map(|t| t.pairs).collect();
        let pairs: Vec<usize> = pairs.into_iter().collect();
        let rows: Vec<Vec<f64>> = pairs.iter().map(|&pair| all.pair(pair)).collect();
        let columns = all.columns().len();
        let features = Array2::from_shape_fn((pairs.len(), columns), |(row, column)| rows[row][column]);
        let scores: BTreeMap<usize, f64> = pairs.into_iter().zip(model.predict(features.view())).collect();
        for triplet in held {
            let first = choice(triplet.pairs.map(|pair| scores[&pair]));
            let [votes_a, votes_b] = triplet.votes;
            let sums = counts.entry(triplet.group.to_string()).or_default();
            sums[0] += if votes_a > votes_b { first } else { 1.0 - first };
            sums[1] += 1.0;
        }
        Ok(counts)
    };
    let found = parallel::try_map(folds.len(), of_fold)?;
    let sums: Vec<[f64; 2]> = found.into_iter().flat_map(Counts::into_values).collect();
    let share = |counts: &[u32]| share_agreeing(&sums, counts);
    let Some(majority) = share(&vec![1; sums.len()]) else { return Ok(None) };
    let rows: Vec<Vec<usize>> = (0..sums.len()).map(|row| vec![row]).collect();
    let interval = match rows.len() {
        1 => None,
        _ => Resamples::draw(&rows, resamples, seed, "triplet references")?.interval(share),
    };
    let triplets = sums.iter().map(|s| s[1]).sum::<f64>() as usize;
    Ok(Some(TripletAgreement { metric: trainer.name().to_owned(), triplets, groups: sums.len(), majority, interval }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Row;
    use crate::samples::split::{TrainingSet, grouped_folds};
    use crate::samples::triplets::TripletSamples;
    use crate::train::{Predictor, TrainError};
    use ndarray::ArrayView2;
    use vernis_metric::descriptor::{Column, Role};

    /// Scores are the first column; refuses to see triplets of fewer or more than all but its fold's groups.
    struct FirstColumn;

    struct Scores;

    impl Predictor for Scores {
        fn predict(&self, features: ArrayView2<'_, f64>) -> Vec<f64> {
            features.column(0).to_vec()
        }
    }

    impl Trainer for FirstColumn {
        fn name(&self) -> &str {
            "first"
        }

        fn train(&self, set: &TrainingSet, _: u64) -> Result<Box<dyn Predictor>, TrainError> {
            let rated: BTreeSet<&str> = set.rows().iter().map(|row| row.group.as_str()).collect();
            let triplets = set.triplets().expect("triplets");
            assert!(triplets.triplets().iter().all(|t| rated.contains(&*t.group) || &*t.group == "unrated"));
            Ok(Box::new(Scores))
        }
    }

    #[test]
    fn held_out_triplets_are_judged_once_and_unrated_references_never() {
        let column = Column { name: "a".into(), family: "f".into(), role: Role::Difference };
        let row = |i: usize| Row {
            material: format!("m{i}"),
            group: format!("m{i}"),
            method: "x".into(),
            method_family: "x".into(),
            material_type: None,
            mos: 1.0 + (i % 4) as f64,
            weight: 1.0,
        };
        let features = Array2::from_shape_fn((6, 1), |(i, _)| i as f64);
        let samples = Samples::new(vec![column.clone()], (0..6).map(row).collect(), features).unwrap();
        let triplet = |group: &str, votes| JudgedTriplet { pairs: [1, 0], votes, group: group.into() };
        // Pair 1 has the better score: right, wrong, tied, right, and one that nobody judges.
        let triplets = vec![
            triplet("m0", [3.0, 1.0]),
            triplet("m1", [1.0, 2.0]),
            triplet("m1", [2.0, 2.0]),
            triplet("m4", [5.0, 0.0]),
            triplet("unrated", [0.0, 9.0]),
        ];
        let pairs = Array2::from_shape_fn((2, 1), |(i, _)| i as f32);
        let samples = samples.with_triplets(TripletSamples::new(vec![column], pairs, triplets).unwrap()).unwrap();
        let folds = grouped_folds(&samples, 3, 1).unwrap();
        let found = cross_validate_triplets(&samples, &folds, &FirstColumn, 100, 1).unwrap().unwrap();
        assert_eq!((found.triplets, found.groups, found.majority), (3, 3, 2.0 / 3.0));
        let interval = found.interval.unwrap();
        assert!(interval.low < found.majority && interval.high <= 1.0);
        let none = cross_validate_triplets(&samples.without_triplets(), &folds, &FirstColumn, 100, 1).unwrap();
        assert_eq!(none, None);
    }
}
