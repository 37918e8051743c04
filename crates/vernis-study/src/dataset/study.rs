//! A study: pairs that people, or simulated observers, rated.

use super::manifest::{self, Manifest};
use super::{DatasetError, Identical};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use vernis_metric::brdf::{BrdfSource, ContentHash};
use vernis_metric::math::rating_scale::RatingScale;

/// What a row belongs to.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Name of the reference's material.
    pub material: String,
    /// Rows of one group are never on both sides of a split: materials with their sisters.
    pub group: String,
    /// Approximation method as the ratings name it.
    pub method: String,
    /// Methods of one family are left out together: `ABC` with `ABC-OURS`.
    pub method_family: String,
    /// Dielectric or metal, where the study says.
    pub material_type: Option<String>,
    /// Mean opinion score as a grade, 1 (worst) to 5 (best).
    pub mos: f64,
    /// Training weight, positive.
    pub weight: f64,
}

/// A reference, a candidate that approximates it, and how similar people found them.
#[derive(Debug, Clone)]
pub struct RatedPair {
    /// The source of the reference.
    pub reference: BrdfSource,
    /// The source of the candidate that approximates it.
    pub candidate: BrdfSource,
    /// Name of the reference's material.
    pub material: String,
    /// The material with its sisters: what folds are made of.
    pub group: String,
    /// The approximation method as the ratings name it, such as `SGD` or `GPLVM_APPROX.3`.
    pub method: String,
    /// Methods of one family are one model by different fits: `ABC` with `ABC-OURS`.
    pub method_family: String,
    /// Such as `Dielectric` or `Metal`, where the study says.
    pub material_type: Option<String>,
    /// Mean opinion score as a grade: 1 (worst) to 5 (best), whatever the study's scale ([`RatingScale::grade`]).
    pub mos: f64,
    /// Weight of the row in training, positive.
    pub weight: f64,
}

impl RatedPair {
    /// What the pair's row of a feature matrix belongs to.
    pub fn row(&self) -> Row {
        Row {
            material: self.material.clone(),
            group: self.group.clone(),
            method: self.method.clone(),
            method_family: self.method_family.clone(),
            material_type: self.material_type.clone(),
            mos: self.mos,
            weight: self.weight,
        }
    }
}

/// Rows of a study, by their methods, that figures are given for beside those on all rows.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedRows {
    /// What tables call them, such as `six published methods`.
    pub name: String,
    /// Methods as the ratings name them.
    pub methods: Vec<String>,
}

impl NamedRows {
    /// Names that records keep for other rows: every row, and all but the methods that are set aside.
    pub const RESERVED: [&'static str; 2] = ["all", "without-set-aside"];

    /// Whether `row` is one of them.
    pub fn has(&self, row: &Row) -> bool {
        self.methods.contains(&row.method)
    }
}

/// How much of a study is at hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Completeness {
    /// Rated pairs whose rating and BRDFs were found.
    pub found: usize,
    /// Rated pairs of the whole study.
    pub known: usize,
}

impl Completeness {
    /// Whether every rated pair was found.
    pub fn is_whole(self) -> bool {
        self.found == self.known
    }
}

/// A file that a study was made from, for provenance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyFile {
    /// Its path in the data folder, or the file name of a user's study: the same on every machine.
    pub name: String,
    /// SHA-256 of the file.
    pub content: ContentHash,
    /// Whether the content is what the study's manifest pins; `None` where nothing is pinned.
    pub as_published: Option<bool>,
}

/// A study: pairs that people (or simulated observers) rated.
#[derive(Debug, Clone)]
pub struct Study {
    /// Name of the study; of a user's, the name of its file, ending included: what `Study::load` takes, but for the folder.
    pub name: String,
    /// Ratings come from simulated observers; every output says so.
    pub synthetic: bool,
    /// How much of the study is at hand.
    pub completeness: Completeness,
    /// The scale on which it was rated.
    pub scale: RatingScale,
    /// The score of identical BRDFs.
    pub identical: Identical,
    /// Ratings and other small files that were read; empty for the embedded study.
    pub files: Vec<StudyFile>,
    /// The rated pairs that were found.
    pub pairs: Vec<RatedPair>,
}

impl Study {
    /// The pairs of every reference, by their places; references in the order of their first pair.
    pub fn by_reference(&self) -> Vec<Vec<usize>> {
        let mut known: BTreeMap<String, usize> = BTreeMap::new();
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for (place, pair) in self.pairs.iter().enumerate() {
            let group = *known.entry(pair.reference.identity()).or_insert(groups.len());
            match groups.get_mut(group) {
                Some(places) => places.push(place),
                None => groups.push(vec![place]),
            }
        }
        groups
    }

    /// The study with `pairs` of its pairs at most: evenly spaced among all when these are ordered by material and, within it, by rating.
    /// Every material and every part of the scale keep their share, as nearly as can be. The order of the pairs stays.
    #[must_use]
    pub fn thinned(mut self, pairs: usize) -> Self {
        let all = self.pairs.len();
        if pairs >= all {
            return self;
        }
        let mut order: Vec<usize> = (0..all).collect();
        // The sort is stable: equal ratings stay in the order of the study.
        order.sort_by(|&a, &b| {
            let [a, b] = [a, b].map(|place| &self.pairs[place]);
            a.material.cmp(&b.material).then(a.mos.total_cmp(&b.mos))
        });
        let chosen: BTreeSet<usize> = (0..pairs).map(|k| order[(2 * k + 1) * all / (2 * pairs)]).collect();
        let mut place = 0..;
        self.pairs.retain(|_| place.next().is_some_and(|place| chosen.contains(&place)));
        self
    }

    /// Its name for files: that of its file, without the ending, where it is one.
    pub fn short_name(&self) -> String {
        Path::new(&self.name).file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// The sets of rows that the manifest of a published study declares; none for other studies.
    ///
    /// # Errors
    /// A manifest that cannot be read.
    pub fn row_sets(&self) -> Result<Vec<NamedRows>, DatasetError> {
        if !manifest::NAMES.contains(&self.name.as_str()) {
            return Ok(Vec::new());
        }
        Ok(Manifest::embedded(&self.name)?.row_sets().to_vec())
    }

    /// Number of groups of materials.
    pub fn groups(&self) -> usize {
        self.pairs.iter().map(|p| p.group.as_str()).collect::<BTreeSet<_>>().len()
    }

    /// Whether a metric can be trained and judged on this study with `folds` folds by group.
    ///
    /// # Errors
    /// No pair, one material, fewer groups than folds, a material in two groups, or ratings that are all equal.
    pub fn validate(&self, folds: usize) -> Result<(), DatasetError> {
        let study = || self.name.clone();
        let Some(first) = self.pairs.first() else {
            return Err(DatasetError::NoPairs { study: study(), reason: "it is empty".into() });
        };
        let mut group_of: BTreeMap<&str, &str> = BTreeMap::new();
        for p in &self.pairs {
            let known = *group_of.entry(&p.material).or_insert(&p.group);
            if known != p.group {
                return Err(DatasetError::TwoGroups {
                    study: study(),
                    material: p.material.clone(),
                    first: known.to_owned(),
                    second: p.group.clone(),
                });
            }
        }
        if group_of.len() < 2 {
            return Err(DatasetError::OneMaterial { study: study(), material: first.material.clone() });
        }
        let groups = self.groups();
        if groups < folds {
            return Err(DatasetError::TooFewGroups { study: study(), groups, folds });
        }
        if self.pairs.iter().all(|p| p.mos == first.mos) {
            let mos = self.scale.stated(first.mos);
            return Err(DatasetError::EqualRatings { study: study(), pairs: self.pairs.len(), mos });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::synthetic;

    #[test]
    fn a_thinned_study_keeps_the_shares_of_materials_and_ratings() {
        let whole = Study::load(synthetic::NAME, None).unwrap();
        let count = |study: &Study| {
            let mut counts: BTreeMap<String, usize> = BTreeMap::new();
            study.pairs.iter().for_each(|p| *counts.entry(p.material.clone()).or_default() += 1);
            counts
        };
        let mean = |study: &Study| study.pairs.iter().map(|p| p.mos).sum::<f64>() / study.pairs.len() as f64;
        let all = whole.pairs.len();
        let fourth = whole.clone().thinned(all / 4);
        assert_eq!(fourth.pairs.len(), all / 4);
        for (material, found) in count(&whole) {
            let kept = count(&fourth).get(&material).copied().unwrap_or(0);
            assert!(kept.abs_diff(found / 4) <= 1, "{material}: {kept} of {found}");
        }
        assert!((mean(&fourth) - mean(&whole)).abs() < 0.1);
        let names = |study: &Study| -> Vec<String> { study.pairs.iter().map(|p| p.candidate.identity()).collect() };
        let places =
            names(&fourth).into_iter().map(|name| names(&whole).iter().position(|other| *other == name).unwrap());
        assert!(places.is_sorted());
        assert_eq!(names(&whole.clone().thinned(all)), names(&whole));
    }

    fn study(rows: &[(&str, &str, f64)]) -> Study {
        let source = |s: &str| BrdfSource::Notation(s.into());
        let pairs: Vec<RatedPair> = rows
            .iter()
            .map(|&(material, group, mos)| RatedPair {
                reference: source("a.binary"),
                candidate: source("b.binary"),
                material: material.into(),
                group: group.into(),
                method: "m".into(),
                method_family: "m".into(),
                material_type: None,
                mos,
                weight: 1.0,
            })
            .collect();
        let completeness = Completeness { found: pairs.len(), known: pairs.len() };
        Study {
            name: "test".into(),
            synthetic: false,
            completeness,
            scale: RatingScale::GRADES,
            identical: Identical::default(),
            files: Vec::new(),
            pairs,
        }
    }

    #[test]
    fn validation_names_what_is_wrong() {
        let problem = |rows: &[(&str, &str, f64)], folds| study(rows).validate(folds).unwrap_err();
        assert!(matches!(problem(&[], 2), DatasetError::NoPairs { .. }));
        assert!(matches!(problem(&[("a", "a", 1.0), ("a", "a", 2.0)], 2), DatasetError::OneMaterial { .. }));
        assert!(matches!(
            problem(&[("a", "g", 1.0), ("b", "g", 2.0)], 2),
            DatasetError::TooFewGroups { groups: 1, folds: 2, .. }
        ));
        assert!(matches!(problem(&[("a", "a", 3.0), ("b", "b", 3.0)], 2), DatasetError::EqualRatings { .. }));
        assert!(matches!(
            problem(&[("a", "a", 1.0), ("a", "b", 3.0), ("b", "b", 3.0)], 2),
            DatasetError::TwoGroups { .. }
        ));
        assert!(study(&[("a", "a", 1.0), ("b", "b", 3.0)]).validate(2).is_ok());
    }
}
