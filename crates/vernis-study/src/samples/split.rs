//! Splits that keep groups together. `TrainingSet` and `HeldOut` are different types made only here, so handing
//! held-out rows to a trainer does not compile.

use super::Samples;
use super::triplets::TripletSamples;
use crate::dataset::Row;
use ndarray::ArrayView2;
use rand::seq::SliceRandom;
use std::collections::{BTreeMap, BTreeSet};
use thiserror::Error;
use vernis_metric::descriptor::Column;
use vernis_metric::io::counted;
use vernis_metric::math::resampling::places;
use vernis_metric::math::seed;

/// Why a study could not be split into folds.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum SplitError {
    #[error("{} need at least {} of materials, but the study has {groups}", counted(*folds, "fold"), counted(*folds, "group"))]
    TooFewGroups { folds: usize, groups: usize },
    #[error("the number of folds is {folds}; it must be at least 2")]
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
    /// The rows to learn from.
    pub training: TrainingSet,
    /// The rows to predict.
    pub held_out: HeldOut,
}

impl TrainingSet {
    /// Every row of a study, for the final model.
    pub fn whole(samples: &Samples) -> Self {
        Self { samples: samples.clone() }
    }

    /// Name, family and role of each column.
    pub fn columns(&self) -> &[Column] {
        self.samples.columns()
    }

    /// What each row belongs to, and its score.
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

    /// The score of identical BRDFs, as far as these rows and what the study declares tell.
    pub fn identical(&self) -> f64 {
        self.samples.identical().score
    }

    /// Judged triplets to learn from, where the study has some: none whose reference, or a sister of it, is held out.
    pub fn triplets(&self) -> Option<&TripletSamples> {
        self.samples.triplets()
    }

    /// The same rows without triplets.
    #[must_use]
    pub fn without_triplets(self) -> Self {
        Self { samples: self.samples.without_triplets() }
    }

    /// Training weights, one a row.
    pub fn weights(&self) -> Vec<f64> {
        self.samples.rows().iter().map(|r| r.weight).collect()
    }

    /// Splits the training rows again, for anything that must be chosen: `k` grouped folds, or as many as there are
    /// groups where those are fewer.
    pub fn inner_folds(&self, k: usize, seed: u64) -> Result<Vec<Fold>, SplitError> {
        let groups = groups(&self.samples).len();
        // Two folds at least, so that one group is an error that says so.
        grouped_folds(&self.samples, k.min(groups).max(2), seed)
    }

    /// The rows, and after them the same pairs with reference and candidate exchanged, at `weight` times their weight. They
    /// stay in their groups, so that inner folds do not tear them from their originals.
    pub fn with_swapped(&self, weight: f64) -> Self {
        Self { samples: self.samples.doubled(weight) }
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
        let groups: Vec<Vec<usize>> = groups(&self.samples).into_values().collect();
        let drawn = places(groups.len(), seed, "resample-groups", index);
        let mut times: BTreeMap<String, usize> = BTreeMap::new();
        let mut rows = Vec::new();
        for group in drawn {
            rows.extend(&groups[group]);
            *times.entry(self.rows()[groups[group][0]].group.clone()).or_default() += 1;
        }
        Self { samples: self.samples.select_rows(&rows).with_counted_triplets(&times) }
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
        training: TrainingSet { samples: samples.select_rows(&train_rows).of_own_references() },
        held_out: HeldOut { samples: samples.select_rows(&held_rows).without_triplets(), indices: held_rows },
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

/// One fold a material type: trained on the other types (dielectrics to metals and back), without the sisters of
/// held-out materials. Rows whose type is unknown are on neither side.
pub fn material_type_folds(samples: &Samples) -> Result<Vec<Fold>, SplitError> {
    let types: BTreeSet<&String> = samples.rows().iter().filter_map(|r| r.material_type.as_ref()).collect();
    types
        .into_iter()
        .map(|t| {
            let is_held = |r: &Row| r.material_type.as_ref() == Some(t);
            let held: BTreeSet<&str> = samples.rows().iter().filter(|r| is_held(r)).map(|r| r.group.as_str()).collect();
            let trains = |r: &Row| r.material_type.as_ref().is_some_and(|other| other != t);
            fold(samples, t, is_held, |r| trains(r) && !held.contains(r.group.as_str()))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::triplets::JudgedTriplet;
    use ndarray::Array2;
    use vernis_metric::descriptor::Role;

    /// `groups` groups of two materials each, every material by three methods of two families; the only column is the
    /// row's number.
    fn samples(groups: usize) -> Samples {
        let mut rows = Vec::new();
        for g in 0..groups {
            for material in 0..2 {
                // Larger groups now and then, as sisters make them.
                for copy in 0..if g % 3 == 0 { 2 } else { 1 } {
                    for (method, family) in [("A", "A"), ("A-OURS", "A"), ("B", "B")] {
                        rows.push(Row {
                            material: format!("m{g}.{material}.{copy}"),
                            group: format!("g{g}"),
                            method: method.into(),
                            method_family: family.into(),
                            material_type: Some(if g % 2 == 0 { "Metal" } else { "Dielectric" }.into()),
                            mos: 1.0 + (rows.len() % 5) as f64,
                            weight: 1.0,
                        });
                    }
                }
            }
        }
        let features = Array2::from_shape_fn((rows.len(), 1), |(i, _)| i as f64);
        let column = Column { name: "row".into(), family: "test".into(), role: Role::Difference };
        Samples::new(vec![column], rows, features).unwrap()
    }

    fn groups_of(rows: &[Row]) -> BTreeSet<&str> {
        rows.iter().map(|r| r.group.as_str()).collect()
    }

    fn families_of(rows: &[Row]) -> BTreeSet<&str> {
        rows.iter().map(|r| r.method_family.as_str()).collect()
    }

    /// Every row is held out exactly once, under its own index, and no group is on both sides.
    fn check(samples: &Samples, folds: &[Fold]) {
        let mut times = vec![0; samples.len()];
        for fold in folds {
            assert!(groups_of(fold.training.rows()).is_disjoint(&groups_of(fold.held_out.rows())));
            for (&i, values) in fold.held_out.indices().iter().zip(fold.held_out.features().outer_iter()) {
                times[i] += 1;
                assert_eq!(values[0], i as f64);
            }
        }
        assert!(times.iter().all(|&t| t == 1));
    }

    #[test]
    fn grouped_folds_hold_each_row_out_once_and_balance_rows() {
        let s = samples(23);
        let folds = grouped_folds(&s, 5, 1).unwrap();
        check(&s, &folds);
        let sizes: Vec<usize> = folds.iter().map(|f| f.held_out.rows().len()).collect();
        // A group has at most 12 rows, so no two folds differ by more.
        assert!(sizes.iter().max().unwrap() - sizes.iter().min().unwrap() <= 12, "{sizes:?}");
        assert!(folds.iter().all(|f| f.training.rows().len() + f.held_out.rows().len() == s.len()));
    }

    #[test]
    fn the_seed_decides_and_nothing_else() {
        let s = samples(12);
        let held = |seed| -> Vec<Vec<usize>> {
            grouped_folds(&s, 4, seed).unwrap().iter().map(|f| f.held_out.indices().to_vec()).collect()
        };
        assert_eq!(held(7), held(7));
        assert_ne!(held(7), held(8));
    }

    #[test]
    fn inner_folds_never_see_the_outer_held_out_rows() {
        let s = samples(10);
        for outer in grouped_folds(&s, 5, 3).unwrap() {
            let forbidden = groups_of(outer.held_out.rows());
            for inner in outer.training.inner_folds(4, 9).unwrap() {
                assert!(groups_of(inner.training.rows()).is_disjoint(&groups_of(inner.held_out.rows())));
                assert!(groups_of(inner.training.rows()).is_disjoint(&forbidden));
                assert!(groups_of(inner.held_out.rows()).is_disjoint(&forbidden));
            }
        }
        // As many folds as groups where there are fewer.
        assert_eq!(TrainingSet::whole(&samples(3)).inner_folds(10, 0).unwrap().len(), 3);
    }

    #[test]
    fn method_folds_have_seen_neither_the_family_nor_the_material() {
        let s = samples(8);
        let folds = method_and_group_folds(&s, 4, 2).unwrap();
        check(&s, &folds);
        assert!(folds.iter().all(|f| families_of(f.training.rows()).is_disjoint(&families_of(f.held_out.rows()))));
    }

    #[test]
    fn triplets_whose_reference_is_held_out_stay_out_of_training() {
        let pairs = Array2::from_shape_fn((2, 1), |(i, _)| i as f32);
        // A triplet of every group, and one of a reference that nobody rated.
        let of = |group: String| JudgedTriplet { pairs: [0, 1], votes: [3.0, 1.0], group: group.into() };
        let triplets: Vec<JudgedTriplet> =
            (0..8).map(|g| of(format!("g{g}"))).chain([of("unrated".to_owned())]).collect();
        let s = samples(8);
        let s = s.clone().with_triplets(TripletSamples::new(s.columns().to_vec(), pairs, triplets).unwrap()).unwrap();
        let kept = |set: &TrainingSet| -> BTreeSet<String> {
            set.triplets().unwrap().triplets().iter().map(|t| t.group.to_string()).collect()
        };
        let whole = TrainingSet::whole(&s);
        assert_eq!(kept(&whole).len(), 9);
        let all = [grouped_folds(&s, 4, 1), method_and_group_folds(&s, 4, 2), material_type_folds(&s)];
        for fold in all.into_iter().flat_map(Result::unwrap) {
            let held: BTreeSet<String> = groups_of(fold.held_out.rows()).into_iter().map(str::to_owned).collect();
            let trained: BTreeSet<String> = groups_of(fold.training.rows()).into_iter().map(str::to_owned).collect();
            let found = kept(&fold.training);
            assert!(found.is_disjoint(&held) && found.contains("unrated"));
            // Those of every group that is trained on, and of no other.
            assert!(found.iter().all(|g| g == "unrated" || trained.contains(g)) && found.len() == trained.len() + 1);
            assert!(fold.held_out.samples.triplets().is_none());
            for inner in fold.training.inner_folds(2, 1).unwrap() {
                let held: BTreeSet<String> = groups_of(inner.held_out.rows()).into_iter().map(str::to_owned).collect();
                assert!(
                    kept(&inner.training).is_disjoint(&held) && kept(&inner.training).is_disjoint(&kept_out(&fold))
                );
            }
            assert_eq!(kept(&fold.training.with_swapped(0.1)), found);
        }
        assert_eq!(kept(&whole.filter(|row| row.group != "g3")).len(), 8);
        let drawn = whole.resample_groups(1, 0);
        let mut times: BTreeMap<&str, usize> = BTreeMap::new();
        drawn.rows().iter().for_each(|r| *times.entry(&r.group).or_default() += 1);
        for triplet in drawn.triplets().unwrap().triplets() {
            let of_group = whole.rows().iter().filter(|r| *r.group == *triplet.group).count().max(1);
            let expected = times.get(&*triplet.group).map_or(1, |n| n / of_group);
            assert_eq!(triplet.votes, [3.0 * expected as f64, expected as f64], "{}", triplet.group);
        }
        assert_eq!(drawn.triplets().unwrap().triplets().len(), groups_of(drawn.rows()).len() + 1);
    }

    fn kept_out(fold: &Fold) -> BTreeSet<String> {
        groups_of(fold.held_out.rows()).into_iter().map(str::to_owned).collect()
    }

    #[test]
    fn type_folds_train_on_the_other_type() {
        let s = samples(8);
        let folds = material_type_folds(&s).unwrap();
        check(&s, &folds);
        assert_eq!(folds.len(), 2);
        // Sisters of different types are kept from training too.
        let mut rows = s.rows().to_vec();
        rows[0].material_type = Some("Dielectric".into());
        let mixed = Samples::new(s.columns().to_vec(), rows, s.features().to_owned()).unwrap();
        check(&mixed, &material_type_folds(&mixed).unwrap());
    }

    #[test]
    fn a_resample_draws_whole_groups() {
        let training = TrainingSet::whole(&samples(9));
        let drawn = training.resample_groups(1, 0);
        let mut size: BTreeMap<&str, usize> = BTreeMap::new();
        training.rows().iter().for_each(|r| *size.entry(&r.group).or_default() += 1);
        let mut count: BTreeMap<&str, usize> = BTreeMap::new();
        drawn.rows().iter().for_each(|r| *count.entry(&r.group).or_default() += 1);
        let draws: usize = count.iter().map(|(g, n)| n / size[g]).sum();
        assert!(count.iter().all(|(g, n)| n % size[g] == 0));
        assert_eq!(draws, 9);
        assert_eq!(drawn.rows(), training.resample_groups(1, 0).rows());
        assert_ne!(drawn.rows(), training.resample_groups(1, 1).rows());
    }

    #[test]
    fn impossible_splits_say_why() {
        let s = samples(3);
        assert_eq!(grouped_folds(&s, 4, 0).unwrap_err(), SplitError::TooFewGroups { folds: 4, groups: 3 });
        assert_eq!(grouped_folds(&s, 1, 0).unwrap_err(), SplitError::TooFewFolds { folds: 1 });
        let one = TrainingSet::whole(&samples(1));
        assert_eq!(one.inner_folds(5, 0).unwrap_err(), SplitError::TooFewGroups { folds: 2, groups: 1 });
        let one_family = s.select_rows(&(0..s.len()).filter(|&i| s.rows()[i].method_family == "A").collect::<Vec<_>>());
        assert!(matches!(method_and_group_folds(&one_family, 2, 0), Err(SplitError::EmptySide { .. })));
    }
}
