//! Splits that keep groups together. `TrainingSet` and `HeldOut` are different types made only here, so handing
//! held-out rows to a trainer does not compile.

use super::samples::{Column, Row, Samples};
use crate::math::seed;
use ndarray::ArrayView2;
use rand::seq::SliceRandom;
use std::collections::{BTreeMap, BTreeSet};
use thiserror::Error;

#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SplitError {
    #[error("{folds} folds need at least {folds} groups of materials, but the study has {groups}")]
    TooFewGroups { folds: usize, groups: usize },
    #[error("a cross-validation needs at least 2 folds, found {folds}")]
    TooFewFolds { folds: usize },
    #[error("the {side} side of the split is empty ({what})")]
    EmptySide { side: &'static str, what: String },
}

/// Rows that a model may learn from.
#[derive(Debug, Clone)]
pub struct TrainingSet {
    samples: Samples,
}

/// Rows that a model may only predict.
#[derive(Debug, Clone)]
pub struct HeldOut {
    samples: Samples,
    indices: Vec<usize>,
}

/// One split of a set of samples.
#[derive(Debug, Clone)]
pub struct Fold {
    pub training: TrainingSet,
    pub held_out: HeldOut,
}

impl TrainingSet {
    /// Every row of a study, for the final model.
    pub fn whole(samples: &Samples) -> Self {
        Self { samples: samples.clone() }
    }

    pub fn columns(&self) -> &[Column] {
        self.samples.columns()
    }

    pub fn rows(&self) -> &[Row] {
        self.samples.rows()
    }

    /// Rows x columns.
    pub fn features(&self) -> ArrayView2<'_, f64> {
        self.samples.features()
    }

    /// Mean opinion scores, one a row.
    pub fn mos(&self) -> Vec<f64> {
        self.samples.rows().iter().map(|r| r.mos).collect()
    }

    /// Training weights, one a row.
    pub fn weights(&self) -> Vec<f64> {
        self.samples.rows().iter().map(|r| r.weight).collect()
    }

    /// Splits the training rows again, for anything that must be chosen: `k` grouped folds, or as many as there are
    /// groups where those are fewer.
    pub fn inner_folds(&self, k: usize, seed: u64) -> Result<Vec<Fold>, SplitError> {
        let groups = groups(&self.samples).len();
        grouped_folds(&self.samples, k.min(groups), seed)
    }

    /// The rows that `keep` accepts.
    pub fn filter(&self, keep: impl Fn(&Row) -> bool) -> Self {
        let indices: Vec<usize> = (0..self.samples.len()).filter(|&i| keep(&self.samples.rows()[i])).collect();
        Self { samples: self.samples.select_rows(&indices) }
    }

    /// The columns that `keep` accepts.
    pub fn select_columns(&self, keep: impl Fn(&Column) -> bool) -> Self {
        Self { samples: self.samples.select_columns(keep) }
    }

    /// A bootstrap resample by group: as many groups as there are, drawn with replacement.
    pub fn resample_groups(&self, seed: u64, index: u64) -> Self {
        use rand::Rng;
        let by_group = groups(&self.samples);
        let all: Vec<&Vec<usize>> = by_group.values().collect();
        let mut rng = seed::stream(seed, "resample-groups", index);
        let rows: Vec<usize> =
            (0..all.len()).flat_map(|_| all[rng.random_range(0..all.len())].iter().copied()).collect();
        Self { samples: self.samples.select_rows(&rows) }
    }
}

impl HeldOut {
    /// Rows x columns.
    pub fn features(&self) -> ArrayView2<'_, f64> {
        self.samples.features()
    }

    /// What the rows belong to, scores included: for judging, never for training.
    pub fn rows(&self) -> &[Row] {
        self.samples.rows()
    }

    /// Positions of the rows in the samples that were split.
    pub fn indices(&self) -> &[usize] {
        &self.indices
    }
}

fn groups(samples: &Samples) -> BTreeMap<&str, Vec<usize>> {
    let mut groups: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (i, row) in samples.rows().iter().enumerate() {
        groups.entry(&row.group).or_default().push(i);
    }
    groups
}

fn fold(
    samples: &Samples,
    what: &str,
    held: impl Fn(&Row) -> bool,
    train: impl Fn(&Row) -> bool,
) -> Result<Fold, SplitError> {
    let pick = |keep: &dyn Fn(&Row) -> bool| -> Vec<usize> {
        (0..samples.len()).filter(|&i| keep(&samples.rows()[i])).collect()
    };
    let (held_rows, train_rows) = (pick(&held), pick(&train));
    for (side, rows) in [("held-out", &held_rows), ("training", &train_rows)] {
        if rows.is_empty() {
            return Err(SplitError::EmptySide { side, what: what.to_owned() });
        }
    }
    Ok(Fold {
        training: TrainingSet { samples: samples.select_rows(&train_rows) },
        held_out: HeldOut { samples: samples.select_rows(&held_rows), indices: held_rows },
    })
}

/// The groups of each of `k` folds, balanced by number of rows: groups in random order, each to the smallest fold.
fn assign(samples: &Samples, k: usize, seed: u64) -> Result<Vec<BTreeSet<String>>, SplitError> {
    let groups = groups(samples);
    if k < 2 {
        return Err(SplitError::TooFewFolds { folds: k });
    }
    if groups.len() < k {
        return Err(SplitError::TooFewGroups { folds: k, groups: groups.len() });
    }
    let mut order: Vec<(&str, usize)> = groups.iter().map(|(g, rows)| (*g, rows.len())).collect();
    order.shuffle(&mut seed::stream(seed, "grouped-folds", k as u64));
    let mut folds = vec![(0usize, BTreeSet::new()); k];
    for (group, size) in order {
        let smallest = (0..k).min_by_key(|&f| (folds[f].0, f)).unwrap_or(0);
        folds[smallest].0 += size;
        folds[smallest].1.insert(group.to_owned());
    }
    Ok(folds.into_iter().map(|(_, groups)| groups).collect())
}

/// `k` folds by group (materials with their sisters): every row is held out exactly once.
pub fn grouped_folds(samples: &Samples, k: usize, seed: u64) -> Result<Vec<Fold>, SplitError> {
    assign(samples, k, seed)?
        .iter()
        .map(|held| fold(samples, "a grouped fold", |r| held.contains(&r.group), |r| !held.contains(&r.group)))
        .collect()
}

/// One fold a method family: neither the family nor, with `k` material folds inside, the material has been seen.
/// Every row is held out exactly once.
pub fn method_and_group_folds(samples: &Samples, k: usize, seed: u64) -> Result<Vec<Fold>, SplitError> {
    let families: BTreeSet<&str> = samples.rows().iter().map(|r| r.method_family.as_str()).collect();
    let assigned = assign(samples, k, seed)?;
    let mut folds = Vec::new();
    for family in families {
        for held in &assigned {
            let is_held = |r: &Row| r.method_family == family && held.contains(&r.group);
            // A small family may have no row among a fold's materials.
            if samples.rows().iter().any(is_held) {
                folds.push(fold(samples, family, is_held, |r| r.method_family != family && !held.contains(&r.group))?);
            }
        }
    }
    Ok(folds)
}

/// One fold a material type: trained on the other types (dielectrics to metals and back).
pub fn material_type_folds(samples: &Samples) -> Result<Vec<Fold>, SplitError> {
    let types: BTreeSet<&String> = samples.rows().iter().filter_map(|r| r.material_type.as_ref()).collect();
    types
        .into_iter()
        .map(|t| {
            fold(
                samples,
                t,
                |r| r.material_type.as_ref() == Some(t),
                |r| r.material_type.as_ref().is_some_and(|other| other != t),
            )
        })
        .collect()
}
