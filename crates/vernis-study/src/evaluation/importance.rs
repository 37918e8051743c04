//! What a model leans on, and how much more it would learn from more materials.
//!
//! *Permutation importance*: the values of a descriptor, or of a family of them together, are exchanged between rows that the
//! model has not seen; what its agreement loses, it owed to them. Descriptors that say the same stand in for each other, so
//! small figures do not mean that they could all be left out: for that there is the ablation. Source: Breiman 2001,
//! doi:10.1023/A:1010933404324, section 10.
//!
//! *Learning curve*: agreement of models that were trained on a share of each fold's training materials.

use super::EvaluationError;
use super::agreement::Predictions;
use super::cross_validation::{FoldPredictions, FoldScores, assemble, fold_seed, run_folds, training_error};
use crate::dataset::Row;
use crate::samples::Samples;
use crate::samples::split::Fold;
use crate::train::Trainer;
use rand::Rng;
use std::collections::BTreeSet;
use vernis_metric::math::parallel;
use vernis_metric::math::seed;

/// Shares of the training materials that a learning curve has.
pub const SHARES: [f64; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];

/// The numbers below n in a random order (Fisher & Yates).
fn shuffled(n: usize, rng: &mut impl Rng) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n).collect();
    (1..n).rev().for_each(|i| order.swap(i, rng.random_range(0..=i)));
    order
}

/// Out-of-fold predictions with the columns of each of `sets` taken from other rows, the same for all sets.
pub(super) fn permuted(
    samples: &Samples,
    folds: &[Fold],
    trainer: &dyn Trainer,
    seed: u64,
    sets: &[Vec<usize>],
) -> Result<Vec<Predictions>, EvaluationError> {
    let order = shuffled(samples.len(), &mut seed::stream(seed, "permutation importance", 0));
    let of_fold = |index: usize| -> Result<Vec<FoldPredictions>, EvaluationError> {
        let fold = &folds[index];
        let model = trainer
            .train(&fold.training, fold_seed(seed, index))
            .map_err(|source| training_error(trainer.name(), index, fold, source))?;
        let predict = |columns: &Vec<usize>| {
            let mut features = fold.held_out.features().to_owned();
            for (k, &row) in fold.held_out.indices().iter().enumerate() {
                columns.iter().for_each(|&c| features[[k, c]] = samples.features()[[order[row], c]]);
            }
            FoldPredictions::direct(model.predict(features.view()))
        };
        Ok(sets.iter().map(predict).collect())
    };
    let by_fold = parallel::try_map(folds.len(), of_fold)?;
    let of_set = |set: usize| {
        let predicted = by_fold.iter().map(|fold| fold[set].clone()).collect();
        Ok(assemble(trainer.name(), samples, folds, predicted)?.predictions)
    };
    (0..sets.len()).map(of_set).collect()
}

/// The groups of materials that a `share` of each fold's training side holds, fold by fold. Smaller shares are subsets of
/// larger ones.
pub fn groups_of_share(folds: &[Fold], seed: u64, share: f64) -> Vec<BTreeSet<&str>> {
    fn of_fold(index: usize, fold: &Fold, seed: u64, share: f64) -> BTreeSet<&str> {
        let groups: BTreeSet<&str> = fold.training.rows().iter().map(|row| row.group.as_str()).collect();
        let groups: Vec<&str> = groups.into_iter().collect();
        let order = shuffled(groups.len(), &mut seed::stream(seed, "learning curve", index as u64));
        let number = (share * groups.len() as f64).ceil() as usize;
        order.into_iter().take(number).map(|k| groups[k]).collect()
    }
    folds.iter().enumerate().map(|(index, fold)| of_fold(index, fold, seed, share)).collect()
}

/// Out-of-fold predictions of models that saw a `share` of the groups of materials on each fold's training side, and how many
/// groups that was on average.
pub(super) fn with_share(
    samples: &Samples,
    folds: &[Fold],
    trainer: &dyn Trainer,
    seed: u64,
    share: f64,
) -> Result<(Predictions, f64), EvaluationError> {
    let kept = groups_of_share(folds, seed, share);
    let found = run_folds(trainer.name(), samples, folds, |index, fold| {
        let keep = |row: &Row| kept[index].contains(row.group.as_str());
        let model = trainer.train(&fold.training.filter(keep), fold_seed(seed, index))?;
        Ok(FoldScores::Mos(model.predict(fold.held_out.features()), None))
    })?;
    let groups = kept.iter().map(BTreeSet::len).sum::<usize>() as f64 / folds.len() as f64;
    Ok((found.predictions, groups))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::cross_validation::cross_validate;
    use crate::samples::split::grouped_folds;
    use crate::train::kernel::KernelRidge;
    use ndarray::Array2;
    use vernis_metric::descriptor::{Column, Role};

    /// Ratings fall with the first column; the second is noise.
    fn samples() -> Samples {
        let column = |name: &str| Column { name: name.into(), family: "f".into(), role: Role::Difference };
        let value = |i: usize, salt: f64| ((i as f64 * 12.9898 + salt).sin() * 43758.5453).fract().abs();
        let row = |i: usize| Row {
            material: format!("m{}", i / 4),
            group: format!("m{}", i / 4),
            method: format!("a{}", i % 4),
            method_family: "a".into(),
            material_type: None,
            mos: 5.0 - 3.0 * value(i, 0.0),
            weight: 1.0,
        };
        let features = Array2::from_shape_fn((160, 2), |(i, c)| value(i, c as f64));
        Samples::new(vec![column("tells"), column("noise")], (0..160).map(row).collect(), features).unwrap()
    }

    fn error(samples: &Samples, found: &Predictions) -> f64 {
        let squares = samples.rows().iter().zip(&found.mos).map(|(row, mos)| (row.mos - mos).powi(2));
        (squares.sum::<f64>() / samples.len() as f64).sqrt()
    }

    #[test]
    fn what_tells_is_missed_and_noise_is_not() {
        let samples = samples();
        let folds = grouped_folds(&samples, 5, 1).unwrap();
        let trainer = KernelRidge::full();
        let whole = cross_validate(&samples, &folds, &trainer, 1).unwrap().predictions;
        let found = permuted(&samples, &folds, &trainer, 1, &[vec![], vec![0], vec![1], vec![0, 1]]).unwrap();
        assert_eq!(found[0].mos, whole.mos);
        let errors: Vec<f64> = found.iter().map(|p| error(&samples, p)).collect();
        assert!(errors[1] > errors[0] + 0.5 && (errors[2] - errors[0]).abs() < 0.1, "{errors:?}");
        assert!((errors[3] - errors[1]).abs() < 0.1, "{errors:?}");
    }

    #[test]
    fn a_whole_share_is_the_whole() {
        let samples = samples();
        let folds = grouped_folds(&samples, 5, 1).unwrap();
        let trainer = KernelRidge::full();
        let whole = cross_validate(&samples, &folds, &trainer, 1).unwrap().predictions;
        let (found, groups) = with_share(&samples, &folds, &trainer, 1, 1.0).unwrap();
        assert_eq!((found.mos, groups), (whole.mos, 32.0));
        assert_eq!(with_share(&samples, &folds, &trainer, 1, 0.2).unwrap().1, 7.0);
    }
}
