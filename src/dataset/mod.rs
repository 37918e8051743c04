//! Studies: rated pairs of BRDFs, where they come from, and how they are split.
//!
//! Nothing in this room knows how anything is computed from a BRDF.

pub mod csv_study;
pub mod csv_table;
mod error;
pub mod fetch;
pub mod inventory;
pub mod manifest;
pub mod opinions;
mod published;
mod ratings;
pub mod raw_layout;
pub mod raw_ratings;
pub mod synthetic;
pub mod verify;

pub use error::DatasetError;
pub use inventory::{StudyStatus, inventory};

use crate::samples::Row;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use vernis_metric::brdf::{BrdfSource, ContentHash};
use vernis_metric::io::nearest;

/// A reference, a candidate that approximates it, and how similar people found them.
#[derive(Debug, Clone)]
pub struct RatedPair {
    pub reference: BrdfSource,
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
    /// Mean opinion score, 1 (very poor) to 5 (excellent).
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

/// How much of a study is at hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Completeness {
    /// Rated pairs whose rating and BRDFs were found.
    pub found: usize,
    /// Rated pairs of the whole study.
    pub known: usize,
}

impl Completeness {
    pub fn is_whole(self) -> bool {
        self.found == self.known
    }
}

/// A file that a study was made from, for provenance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyFile {
    /// Its path in the data folder, or the file name of a user's study: the same on every machine.
    pub name: String,
    pub content: ContentHash,
    /// Whether the content is what the study's manifest pins; `None` where nothing is pinned.
    pub as_published: Option<bool>,
}

/// A study: pairs that people (or simulated observers) rated.
#[derive(Debug, Clone)]
pub struct Study {
    pub name: String,
    /// Ratings come from simulated observers; every output says so.
    pub synthetic: bool,
    pub completeness: Completeness,
    /// Ratings and other small files that were read; empty for the embedded study.
    pub files: Vec<StudyFile>,
    pub pairs: Vec<RatedPair>,
}

impl Study {
    /// Loads a study by name (`lavoue2021`, `lavoue2021-open`, `synthetic`) or from a CSV file, whose columns
    /// `datasets/README.md` describes.
    ///
    /// `data` is the folder that holds a published study's files as its manifest lists them; the other studies do not
    /// need it here. Sources of a published study are paths in that folder: BRDFs are opened later, one by one, with
    /// `BrdfSource::open(data)`.
    ///
    /// # Errors
    /// An unknown name, a missing or malformed file, or a study without a usable pair. A study that is only partly at
    /// hand loads; see [`Study::completeness`].
    pub fn load(name_or_path: &str, data: Option<&Path>) -> Result<Self, DatasetError> {
        if name_or_path == synthetic::NAME {
            return Ok(synthetic::generate(synthetic::SEED)?.study);
        }
        if manifest::NAMES.contains(&name_or_path) {
            return published::load(&manifest::Manifest::embedded(name_or_path)?, data);
        }
        let path = Path::new(name_or_path);
        if path.is_file() || path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")) {
            return csv_study::load(path);
        }
        Err(Self::unknown(name_or_path))
    }

    /// That there is no study `name`, with the nearest one there is.
    pub fn unknown(name: &str) -> DatasetError {
        let known = Self::known();
        DatasetError::UnknownStudy { name: name.into(), known: known.join(", "), nearest: nearest(name, &known) }
    }

    /// Names of the studies that need no file of the user's own.
    pub fn known() -> Vec<&'static str> {
        manifest::NAMES.iter().copied().chain([synthetic::NAME]).collect()
    }

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
            return Err(DatasetError::EqualRatings { study: study(), pairs: self.pairs.len(), mos: first.mos });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        Study { name: "test".into(), synthetic: false, completeness, files: Vec::new(), pairs }
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

    #[test]
    fn an_unknown_study_is_told_its_nearest_name() {
        let message = Study::load("lavoue2021-opne", None).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(message.contains("did you mean lavoue2021-open"), "{message}");
        assert!(message.contains("synthetic"), "{message}");
    }
}
