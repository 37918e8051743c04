//! Judged triplets as numbers: which of two pairs with the same reference looks more alike.
//!
//! A trainer may learn from them beside the ratings. They belong to the group of their reference, so that a split leaves out those
//! whose reference it holds out. Memory: 4 bytes a descriptor of each distinct pair, shared by all parts of a split.

use super::SamplesError;
use super::extraction::{ExtractionError, Extractor};
use crate::dataset::triplets::StudyTriplets;
use crate::samples::workers::in_order;
use ndarray::Array2;
use rand::seq::SliceRandom;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use vernis_metric::descriptor::{BrdfFeatures, CacheWarning, Column, features as features_of};
use vernis_metric::io::Count;
use vernis_metric::math::seed;

/// One question and its votes.
#[derive(Debug, Clone, PartialEq)]
pub struct JudgedTriplet {
    /// Rows of (reference, a) and (reference, b) among the pairs.
    pub pairs: [usize; 2],
    /// Votes for a and for b; a resample that draws the reference's group twice counts them twice.
    pub votes: [f64; 2],
    /// Group of the reference: its material with sisters.
    pub group: Arc<str>,
}

impl JudgedTriplet {
    /// Whether more people voted for one of the two than for the other.
    pub fn is_untied(&self) -> bool {
        self.votes[0] != self.votes[1]
    }
}

/// Triplets and the descriptors of their pairs.
#[derive(Debug, Clone)]
pub struct TripletSamples {
    columns: Vec<Column>,
    /// Distinct pairs x columns.
    pairs: Arc<Array2<f32>>,
    triplets: Vec<JudgedTriplet>,
}

impl TripletSamples {
    /// `pairs` is distinct pairs x columns.
    ///
    /// # Errors
    /// Another number of columns, a descriptor that is not finite, a triplet of pairs that are not there, votes that are not finite
    /// numbers of at least 0 with a positive sum.
    pub fn new(columns: Vec<Column>, pairs: Array2<f32>, triplets: Vec<JudgedTriplet>) -> Result<Self, SamplesError> {
        if pairs.ncols() != columns.len() {
            let (found, expected) = (pairs.ncols(), columns.len());
            return Err(SamplesError::Shape { what: "columns of the pairs of triplets", found, expected });
        }
        for (row, values) in pairs.outer_iter().enumerate() {
            if let Some((column, &value)) = columns.iter().zip(values).find(|(_, v)| !v.is_finite()) {
                let (column, value) = (column.name.clone(), f64::from(value));
                return Err(SamplesError::TripletPair { row, column, value });
            }
        }
        for (row, triplet) in triplets.iter().enumerate() {
            let wrong = |what, value, allowed| Err(SamplesError::Triplet { row, what, value, allowed });
            if let Some(&pair) = triplet.pairs.iter().find(|&&pair| pair >= pairs.nrows()) {
                return wrong("a pair", pair as f64, "smaller than the number of pairs");
            }
            if let Some(&votes) = triplet.votes.iter().find(|v| !(v.is_finite() && **v >= 0.0)) {
                return wrong("a number of votes", votes, "finite and at least 0");
            }
            if triplet.votes == [0.0, 0.0] {
                return wrong("the sum of votes", 0.0, "greater than 0");
            }
        }
        Ok(Self { columns, pairs: Arc::new(pairs), triplets })
    }

    /// Name, family and role of each column.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The triplets, all with votes.
    pub fn triplets(&self) -> &[JudgedTriplet] {
        &self.triplets
    }

    /// The descriptors of a pair, in the order of the columns.
    pub fn pair(&self, row: usize) -> Vec<f64> {
        self.pairs.row(row).iter().map(|&v| f64::from(v)).collect()
    }

    /// The values of one column for a pair.
    pub fn value(&self, row: usize, column: usize) -> f32 {
        self.pairs[(row, column)]
    }

    /// At most `most` of the triplets that are not tied, drawn from the stream `label` of `seed`.
    pub fn drawn(&self, most: usize, seed: u64, label: &str) -> Vec<&JudgedTriplet> {
        let mut untied: Vec<&JudgedTriplet> = self.triplets.iter().filter(|t| t.is_untied()).collect();
        untied.shuffle(&mut seed::stream(seed, label, 0));
        untied.truncate(most);
        untied
    }

    /// The triplets of each group as often as `times` says.
    pub(super) fn counted(&self, times: impl Fn(&str) -> usize) -> Self {
        let mut triplets = Vec::with_capacity(self.triplets.len());
        for triplet in &self.triplets {
            let times = times(&triplet.group);
            if times > 0 {
                triplets.push(JudgedTriplet { votes: triplet.votes.map(|v| v * times as f64), ..triplet.clone() });
            }
        }
        Self { triplets, columns: self.columns.clone(), pairs: Arc::clone(&self.pairs) }
    }

    /// The columns that `keep` accepts, in their order.
    pub(super) fn select_columns(&self, keep: impl Fn(&Column) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.columns.len()).filter(|&i| keep(&self.columns[i])).collect();
        if kept.len() == self.columns.len() {
            return self.clone();
        }
        Self {
            columns: kept.iter().map(|&i| self.columns[i].clone()).collect(),
            pairs: Arc::new(self.pairs.select(ndarray::Axis(1), &kept)),
            triplets: self.triplets.clone(),
        }
    }
}

impl Extractor<'_> {
    /// The descriptors of both pairs of every triplet with votes; the metrics of the extractor take no part. The same for any number
    /// of threads.
    ///
    /// # Errors
    /// Of the materials in their order, the first whose BRDF cannot be read.
    pub fn triplets(&self, study: &StudyTriplets) -> Result<(TripletSamples, Vec<CacheWarning>), ExtractionError> {
        let judged: Vec<_> = study.triplets.triplets.iter().filter(|t| t.votes != [0, 0]).collect();
        let used: BTreeSet<usize> =
            judged.iter().flat_map(|t| [t.reference, t.candidates[0], t.candidates[1]]).collect();
        let used: Vec<usize> = used.into_iter().collect();
        let done = Count::of(used.len());
        let step = || done.one(self.progress);
        let found = in_order(used.len(), |k| {
            let brdf = study.sources[used[k]].identify(self.base)?;
            let of_material = features_of(&brdf, self.setup, self.cache)?;
            step();
            Ok::<_, ExtractionError>(of_material)
        })?;
        let mut warnings = Vec::new();
        let mut features: BTreeMap<usize, BrdfFeatures> = BTreeMap::new();
        for (&material, (of_material, warning)) in used.iter().zip(found) {
            features.insert(material, of_material);
            warnings.extend(warning);
        }
        let pairs: BTreeSet<(usize, usize)> =
            judged.iter().flat_map(|t| t.candidates.map(|candidate| (t.reference, candidate))).collect();
        let pairs: Vec<(usize, usize)> = pairs.into_iter().collect();
        let rows = in_order(pairs.len(), |k| {
            let of = |material| {
                features.get(material).ok_or(ExtractionError::Incomplete { found: k, expected: pairs.len() })
            };
            let values = self.set.compare(of(&pairs[k].0)?, of(&pairs[k].1)?, self.setup);
            Ok::<_, ExtractionError>(values.into_iter().map(|v| v as f32).collect::<Vec<f32>>())
        })?;
        let columns = self.set.columns();
        let (shape, numbers) = ((pairs.len(), columns.len()), rows.concat());
        let found = numbers.len();
        let matrix = Array2::from_shape_vec(shape, numbers)
            .map_err(|_| ExtractionError::Incomplete { found, expected: shape.0 * shape.1 })?;
        let row_of: BTreeMap<(usize, usize), usize> =
            pairs.iter().enumerate().map(|(row, &pair)| (pair, row)).collect();
        let groups: Vec<Arc<str>> = study.groups.iter().map(|group| Arc::from(group.as_str())).collect();
        let triplets = judged.iter().map(|t| JudgedTriplet {
            pairs: t.candidates.map(|candidate| row_of[&(t.reference, candidate)]),
            votes: t.votes.map(f64::from),
            group: Arc::clone(&groups[t.reference]),
        });
        Ok((TripletSamples::new(columns, matrix, triplets.collect())?, warnings))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;
    use vernis_metric::descriptor::Role;

    fn columns() -> Vec<Column> {
        ["a", "b"].map(|name| Column { name: name.into(), family: "f".into(), role: Role::Difference }).into()
    }

    fn triplet(pairs: [usize; 2], votes: [f64; 2], group: &str) -> JudgedTriplet {
        JudgedTriplet { pairs, votes, group: group.into() }
    }

    fn samples() -> TripletSamples {
        let triplets =
            vec![triplet([0, 1], [3.0, 1.0], "g"), triplet([1, 2], [2.0, 2.0], "h"), triplet([2, 0], [0.0, 4.0], "h")];
        TripletSamples::new(columns(), array![[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], triplets).unwrap()
    }

    #[test]
    fn groups_count_as_often_as_they_are_drawn_and_ties_are_not_drawn() {
        let twice = samples().counted(|group| if group == "h" { 2 } else { 0 });
        let votes: Vec<[f64; 2]> = twice.triplets().iter().map(|t| t.votes).collect();
        assert_eq!(votes, [[4.0, 4.0], [0.0, 8.0]]);
        assert_eq!(samples().drawn(10, 1, "test").len(), 2);
        assert_eq!(samples().drawn(1, 1, "test").len(), 1);
        let second = samples().select_columns(|c| c.name == "b");
        assert_eq!((second.pair(1), second.columns().len()), (vec![4.0], 1));
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let pairs = array![[1.0f32, 2.0], [3.0, 4.0]];
        let refused = |pairs: Array2<f32>, t: JudgedTriplet| {
            TripletSamples::new(columns(), pairs, vec![t]).unwrap_err().to_string()
        };
        for (found, part) in [
            (refused(pairs.clone(), triplet([0, 2], [1.0, 0.0], "g")), "triplet 0: a pair is 2; it must be smaller"),
            (refused(pairs.clone(), triplet([0, 1], [-1.0, 0.0], "g")), "a number of votes is -1"),
            (refused(pairs.clone(), triplet([0, 1], [0.0, 0.0], "g")), "the sum of votes is 0"),
            (refused(array![[1.0], [2.0]], triplet([0, 1], [1.0, 0.0], "g")), "columns of the pairs of triplets is 1"),
            (refused(array![[1.0, f32::NAN]], triplet([0, 0], [1.0, 0.0], "g")), "b is NaN"),
        ] {
            assert!(found.contains(part), "{found}");
        }
    }
}
