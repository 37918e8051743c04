//! A study as numbers: extraction from BRDFs, the Parquet file, shards, and grouped splits.
//!
//! [`Samples`] is a matrix: one row a rated pair, one column a descriptor or a classical distance. [`split`] makes
//! [`split::TrainingSet`] and [`split::HeldOut`] out of it; trainers see nothing else.

pub mod distances;
#[cfg(feature = "train")]
pub mod extracted;
pub mod extraction;
pub mod further;
#[cfg(feature = "train")]
mod parquet;
pub mod shard;
pub mod split;
pub mod triplets;
mod workers;

use crate::dataset::opinions::REFERENCE;
use crate::dataset::{Basis, Identical, Row};
use ndarray::{Array2, ArrayView1, ArrayView2, Axis, concatenate};
use std::collections::{BTreeMap, BTreeSet};
use thiserror::Error;
use triplets::TripletSamples;
use vernis_metric::descriptor::{Column, Role};
use vernis_metric::math::rating_scale::RatingScale;

/// Why a table of samples cannot be used.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum SamplesError {
    #[error("the number of {what} is {found}; it must be {expected}")]
    Shape { what: &'static str, found: usize, expected: usize },
    #[error("column {name} is given twice; every descriptor must have its own name")]
    DuplicateColumn { name: String },
    #[error("row {row}: material {material} is in group {found}; it must be in {expected}, as in its other rows")]
    TwoGroups { row: usize, material: String, found: String, expected: String },
    #[error("row {row} ({material}, {method}): {column} is {value}; every descriptor must be finite")]
    NotFinite { row: usize, material: String, method: String, column: String, value: f64 },
    #[error("row {row} ({material}, {method}): {what} is {value}; it must be {allowed}")]
    Rating { row: usize, material: String, method: String, what: &'static str, value: f64, allowed: &'static str },
    #[error("pair {row} of the triplets: {column} is {value}; every descriptor must be finite")]
    TripletPair { row: usize, column: String, value: f64 },
    #[error("triplet {row}: {what} is {value}; it must be {allowed}")]
    Triplet { row: usize, what: &'static str, value: f64, allowed: &'static str },
    #[error("column {index} of the triplets is {found}; it must be {expected}, as in the rated pairs")]
    TripletColumn { index: usize, found: String, expected: String },
}

/// A study as numbers: `features` is rows x columns.
#[derive(Debug, Clone)]
pub struct Samples {
    columns: Vec<Column>,
    rows: Vec<Row>,
    features: Array2<f64>,
    swapped: Option<Array2<f64>>,
    identical: Identical,
    /// What the rule says, for parts without hidden references.
    assumed: Identical,
    triplets: Option<TripletSamples>,
}

impl Samples {
    /// Checked: shapes agree, column names are unique, descriptors are finite, scores lie in 1..=5, weights are
    /// positive and finite, and a material is in one group.
    pub fn new(columns: Vec<Column>, rows: Vec<Row>, features: Array2<f64>) -> Result<Self, SamplesError> {
        let shape = |what, found, expected| {
            if found == expected { Ok(()) } else { Err(SamplesError::Shape { what, found, expected }) }
        };
        shape("rows of the feature matrix", features.nrows(), rows.len())?;
        shape("columns of the feature matrix", features.ncols(), columns.len())?;
        check_columns(&columns)?;
        let mut group_of: BTreeMap<&str, &str> = BTreeMap::new();
        for (i, (row, values)) in rows.iter().zip(features.outer_iter()).enumerate() {
            let expected = *group_of.entry(&row.material).or_insert(&row.group);
            if expected != row.group {
                return Err(SamplesError::TwoGroups {
                    row: i,
                    material: row.material.clone(),
                    found: row.group.clone(),
                    expected: expected.to_owned(),
                });
            }
            check_row(i, row)?;
            if let Some((c, &value)) = columns.iter().zip(values).find(|(_, v)| !v.is_finite()) {
                return Err(SamplesError::NotFinite {
                    row: i,
                    material: row.material.clone(),
                    method: row.method.clone(),
                    column: c.name.clone(),
                    value,
                });
            }
        }
        let assumed = Identical::default();
        Ok(Self { columns, rows, features, swapped: None, identical: assumed.clone(), assumed, triplets: None })
    }

    /// With the score of identical BRDFs of a study that was rated on `scale`, a grade; without it is that of the rule for 1 to 5.
    #[must_use]
    pub fn with_identical(self, identical: Identical, scale: RatingScale) -> Self {
        Self { identical, assumed: Identical::assumed(scale), ..self }
    }

    /// With what `other` knows of identical BRDFs.
    #[must_use]
    pub fn identical_as(self, other: &Self) -> Self {
        Self { identical: other.identical.clone(), assumed: other.assumed.clone(), ..self }
    }

    /// With judged triplets, from which trainers may learn as well.
    ///
    /// # Errors
    /// Other columns than those of the rated pairs.
    pub fn with_triplets(self, triplets: TripletSamples) -> Result<Self, SamplesError> {
        let (found, expected) = (triplets.columns(), &self.columns);
        let name =
            |columns: &[Column], index: usize| columns.get(index).map_or("nothing".to_owned(), |c| c.name.clone());
        match (0..found.len().max(expected.len())).find(|&i| found.get(i) != expected.get(i)) {
            Some(index) => {
                let (found, expected) = (name(found, index), name(expected, index));
                Err(SamplesError::TripletColumn { index, found, expected })
            }
            None => Ok(Self { triplets: Some(triplets), ..self }),
        }
    }

    /// What [`Samples::with_triplets`] was given, as far as it belongs to these rows.
    pub fn triplets(&self) -> Option<&TripletSamples> {
        self.triplets.as_ref()
    }

    /// The same rows without triplets.
    #[must_use]
    pub fn without_triplets(self) -> Self {
        Self { triplets: None, ..self }
    }

    /// The triplets that belong to the rows at `indices`: without those of a group that has rows here, but none there. Triplets whose
    /// reference nobody rated belong to every part.
    fn triplets_of(&self, indices: &[usize]) -> Option<TripletSamples> {
        let triplets = self.triplets.as_ref()?;
        let mut gone: BTreeSet<&str> = self.rows.iter().map(|row| row.group.as_str()).collect();
        for &index in indices {
            gone.remove(self.rows[index].group.as_str());
        }
        Some(triplets.counted(|group| usize::from(!gone.contains(group))))
    }

    /// With the triplets of each rated group counted as often as `times` says.
    pub(super) fn with_counted_triplets(mut self, times: &BTreeMap<String, usize>) -> Self {
        let counted = |t: TripletSamples| t.counted(|group| times.get(group).copied().unwrap_or(1));
        self.triplets = self.triplets.map(counted);
        self
    }

    /// The score of identical BRDFs.
    pub fn identical(&self) -> &Identical {
        &self.identical
    }

    /// As part of a split these rows know the score of identical BRDFs by their own hidden references alone: rows whose method is
    /// [`REFERENCE`], or of which no descriptor tells candidate and reference apart. Without any the rule holds. What does not
    /// come from rated pairs is the same for every part.
    fn of_own_references(mut self) -> Self {
        if !matches!(self.identical.basis, Basis::HiddenReferences { .. }) {
            return self;
        }
        let compared: Vec<usize> =
            (0..self.columns.len()).filter(|&c| self.columns[c].role == Role::Difference).collect();
        let hidden = self.rows.iter().zip(self.features.outer_iter()).filter(|(row, values)| {
            row.method == REFERENCE || (!compared.is_empty() && compared.iter().all(|&c| values[c] == 0.0))
        });
        let own = Identical::of_hidden_references(hidden.map(|(row, _)| (row.mos, row.weight)));
        self.identical = own.unwrap_or_else(|| self.assumed.clone());
        self
    }

    /// The same pairs with reference and candidate exchanged, rows x columns: people who rate how alike two materials look
    /// would say the same, so that a trainer may learn from them as well.
    pub fn with_swapped(mut self, swapped: Array2<f64>) -> Result<Self, SamplesError> {
        let shape = |what, found, expected| {
            if found == expected { Ok(()) } else { Err(SamplesError::Shape { what, found, expected }) }
        };
        shape("rows of the swapped features", swapped.nrows(), self.rows.len())?;
        shape("columns of the swapped features", swapped.ncols(), self.columns.len())?;
        // The checks of the constructor hold for these numbers as well.
        Self::new(self.columns.clone(), self.rows.clone(), swapped.clone())?;
        self.swapped = Some(swapped);
        Ok(self)
    }

    /// What [`Samples::with_swapped`] was given.
    pub fn swapped(&self) -> Option<ArrayView2<'_, f64>> {
        self.swapped.as_ref().map(|s| s.view())
    }

    /// The rows, and after them the same pairs exchanged, at `weight` times their weight; without exchanged pairs the rows
    /// alone.
    pub(super) fn doubled(&self, weight: f64) -> Self {
        let Some(swapped) = &self.swapped else { return self.clone() };
        let added = self.rows.iter().map(|r| Row { weight: weight * r.weight, ..r.clone() });
        let rows: Vec<Row> = self.rows.iter().cloned().chain(added).collect();
        let width = self.columns.len();
        let features = Array2::from_shape_fn((rows.len(), width), |(i, j)| match i.checked_sub(self.rows.len()) {
            None => self.features[(i, j)],
            Some(i) => swapped[(i, j)],
        });
        Self { rows, features, swapped: None, ..self.clone() }
    }

    /// With the columns of `other`, which are of the same rows, after these. Exchanged pairs and triplets are left out.
    ///
    /// # Errors
    /// Another number of rows; a column of the same name.
    pub fn beside(&self, other: &Self) -> Result<Self, SamplesError> {
        let (found, expected) = (other.len(), self.len());
        let shape = |_| SamplesError::Shape { what: "rows beside others", found, expected };
        let features = concatenate(Axis(1), &[self.features.view(), other.features.view()]).map_err(shape)?;
        let columns = self.columns.iter().chain(&other.columns).cloned().collect();
        let (identical, assumed) = (self.identical.clone(), self.assumed.clone());
        Ok(Self { identical, assumed, ..Self::new(columns, self.rows.clone(), features)? })
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Name, family and role of each column.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// What each row belongs to, and its score.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Rows x columns.
    pub fn features(&self) -> ArrayView2<'_, f64> {
        self.features.view()
    }

    /// The values of column `index`, one a row.
    pub fn column(&self, index: usize) -> ArrayView1<'_, f64> {
        self.features.column(index)
    }

    /// The rows at `indices`, in that order, and the triplets of the groups that are left.
    pub fn select_rows(&self, indices: &[usize]) -> Self {
        Self {
            columns: self.columns.clone(),
            rows: indices.iter().map(|&i| self.rows[i].clone()).collect(),
            features: self.features.select(Axis(0), indices),
            swapped: self.swapped.as_ref().map(|s| s.select(Axis(0), indices)),
            identical: self.identical.clone(),
            assumed: self.assumed.clone(),
            triplets: self.triplets_of(indices),
        }
    }

    /// The columns that `keep` accepts, in their order.
    pub fn select_columns(&self, keep: impl Fn(&Column) -> bool) -> Self {
        let indices: Vec<usize> = (0..self.columns.len()).filter(|&i| keep(&self.columns[i])).collect();
        Self {
            columns: indices.iter().map(|&i| self.columns[i].clone()).collect(),
            rows: self.rows.clone(),
            features: self.features.select(Axis(1), &indices),
            swapped: self.swapped.as_ref().map(|s| s.select(Axis(1), &indices)),
            identical: self.identical.clone(),
            assumed: self.assumed.clone(),
            triplets: self.triplets.as_ref().map(|t| t.select_columns(&keep)),
        }
    }
}

fn check_columns(columns: &[Column]) -> Result<(), SamplesError> {
    let mut names = BTreeSet::new();
    match columns.iter().find(|c| !names.insert(&c.name)) {
        Some(c) => Err(SamplesError::DuplicateColumn { name: c.name.clone() }),
        None => Ok(()),
    }
}

fn check_row(index: usize, row: &Row) -> Result<(), SamplesError> {
    let error = |what, value, allowed| {
        let (material, method) = (row.material.clone(), row.method.clone());
        Err(SamplesError::Rating { row: index, material, method, what, value, allowed })
    };
    if !(1.0..=5.0).contains(&row.mos) {
        return error("mos", row.mos, "1 to 5");
    }
    if !(row.weight > 0.0 && row.weight.is_finite()) {
        return error("weight", row.weight, "finite and greater than 0");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn columns_stand_beside_others() {
        let column = |name: &str| Column { name: name.into(), family: "made-up".into(), role: Role::Difference };
        let rows = || vec![row("a", "a"), row("b", "b")];
        let one = Samples::new(vec![column("x")], rows(), array![[1.0], [2.0]]).unwrap();
        let other = Samples::new(vec![column("y")], rows(), array![[3.0], [4.0]]).unwrap();
        assert_eq!(one.beside(&other).unwrap().features(), array![[1.0, 3.0], [2.0, 4.0]]);
        assert!(one.beside(&one).is_err() && one.beside(&other.select_rows(&[0])).is_err());
    }

    fn row(material: &str, group: &str) -> Row {
        Row {
            material: material.into(),
            group: group.into(),
            method: "m".into(),
            method_family: "m".into(),
            material_type: None,
            mos: 3.0,
            weight: 1.0,
        }
    }

    fn columns() -> Vec<Column> {
        let column = |name: &str, role| Column { name: name.into(), family: "f".into(), role };
        vec![column("d", Role::Difference), column("c", Role::Context)]
    }

    fn samples() -> Samples {
        let rows = vec![row("a", "a"), row("b", "b"), row("c", "c")];
        Samples::new(columns(), rows, array![[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]).unwrap()
    }

    #[test]
    fn selections_keep_rows_and_columns_together() {
        let s = samples().select_rows(&[2, 0, 2]);
        assert_eq!(s.features(), array![[5.0, 6.0], [1.0, 2.0], [5.0, 6.0]]);
        assert_eq!(s.rows().iter().map(|r| r.material.as_str()).collect::<Vec<_>>(), ["c", "a", "c"]);
        let context = samples().select_columns(|c| c.role == Role::Context);
        assert_eq!(context.features(), array![[2.0], [4.0], [6.0]]);
        assert_eq!(context.columns().len(), 1);
    }

    #[test]
    fn a_part_knows_identical_brdfs_by_its_own_hidden_references() {
        let graded = |material: &str, method: &str, mos| Row { method: method.into(), mos, ..row(material, material) };
        let rows =
            vec![graded("a", "m", 2.0), graded("a", "m", 4.0), graded("b", REFERENCE, 3.0), graded("b", "m", 1.0)];
        let features = array![[1.0, 2.0], [0.0, 2.0], [0.1, 2.0], [0.3, 2.0]];
        let found = Identical { score: 3.5, basis: Basis::HiddenReferences { pairs: 2 } };
        let samples = Samples::new(columns(), rows, features).unwrap();
        assert_eq!(samples.identical().score, 4.5);
        let samples = samples.with_identical(found, RatingScale::GRADES);
        let of = |rows: &[usize]| samples.select_rows(rows).of_own_references().identical().score;
        assert_eq!([of(&[0, 1]), of(&[2, 3]), of(&[0, 3]), of(&[0, 1, 2, 3])], [4.0, 3.0, 4.5, 3.5]);
        // What the study declares is the same for every part.
        let declared = Identical { score: 4.39, basis: Basis::Declared { source: "paper".into() } };
        let samples = samples.with_identical(declared, RatingScale::GRADES);
        assert_eq!(samples.select_rows(&[0, 1]).of_own_references().identical().score, 4.39);
    }

    #[test]
    fn what_cannot_be_learned_from_is_refused() {
        let matrix = array![[1.0, 2.0], [3.0, 4.0]];
        let rows = || vec![row("a", "a"), row("b", "b")];
        let refused = |columns, rows, features| Samples::new(columns, rows, features).unwrap_err();
        assert!(matches!(
            refused(columns(), vec![row("a", "a")], matrix.clone()),
            SamplesError::Shape { found: 2, .. }
        ));
        let twice = vec![columns()[0].clone(), columns()[0].clone()];
        assert!(matches!(refused(twice, rows(), matrix.clone()), SamplesError::DuplicateColumn { .. }));
        let nan = array![[1.0, 2.0], [3.0, f64::NAN]];
        assert!(matches!(refused(columns(), rows(), nan), SamplesError::NotFinite { row: 1, .. }));
        let split = vec![row("a", "a"), row("a", "b")];
        assert!(matches!(refused(columns(), split, matrix.clone()), SamplesError::TwoGroups { row: 1, .. }));
        for (mos, weight) in [(0.9, 1.0), (f64::NAN, 1.0), (3.0, 0.0), (3.0, f64::INFINITY)] {
            let rows = vec![row("a", "a"), Row { mos, weight, ..row("b", "b") }];
            assert!(matches!(refused(columns(), rows, matrix.clone()), SamplesError::Rating { row: 1, .. }));
        }
    }
}
