//! What people said of a study's stimuli, without the BRDFs: raw scores where a study has them, else their means.

use super::manifest::{Manifest, NAMES};
use super::raw_layout::RawLayout;
use super::raw_ratings::RawRatings;
use super::{Completeness, DatasetError, DeclaredScale, RatedPair, Study, StudyFile, published, synthetic};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use vernis_metric::math::rating_scale::RatingScale;

/// The method of a hidden reference: the reference shown as if it were an approximation.
pub const REFERENCE: &str = "REFERENCE";

/// What was rated: one candidate of one material, under one illumination where the study has several.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Stimulus {
    /// Name of the reference's material.
    pub material: String,
    /// The approximation method, or [`REFERENCE`].
    pub method: String,
    /// Methods of one family are fits of one model, or points of one manifold.
    pub method_family: String,
    /// Name of the illumination, where the study states it.
    pub illumination: Option<String>,
    /// The material with its sisters.
    pub group: String,
    /// Such as `Dielectric` or `Metal`, where the study says.
    pub material_type: Option<String>,
}

impl Stimulus {
    /// Whether the reference itself was shown.
    pub fn is_reference(&self) -> bool {
        self.method == REFERENCE
    }
}

/// Scores, on the study's scale.
#[derive(Debug, Clone)]
pub enum Scores {
    /// Mean opinion scores by stimulus.
    Means(Vec<f64>),
    /// Every score of every participant.
    Raw(RawRatings),
}

/// The ratings of a study.
#[derive(Debug, Clone)]
pub struct StudyOpinions {
    /// Name of the study, or the path of its file.
    pub name: String,
    /// Ratings come from simulated observers; every output says so.
    pub synthetic: bool,
    /// How much of the study is at hand.
    pub completeness: Completeness,
    /// The scale of the scores.
    pub scale: RatingScale,
    /// The files that were read.
    pub files: Vec<StudyFile>,
    /// What was rated.
    pub stimuli: Vec<Stimulus>,
    /// What people said of the stimuli.
    pub scores: Scores,
}

impl StudyOpinions {
    /// Loads the ratings of a study by the names of [`Study::load`]. BRDFs are not needed: of a published study, the
    /// files of ratings and material types are.
    ///
    /// # Errors
    /// An unknown name, or a missing or malformed file.
    pub fn load(name_or_path: &str, data: Option<&Path>) -> Result<Self, DatasetError> {
        Self::load_on(name_or_path, data, None)
    }

    /// As [`StudyOpinions::load`]; `scale` is that of a CSV file's ratings, as for [`Study::load_on`].
    ///
    /// # Errors
    /// Those of [`StudyOpinions::load`]; a scale for a study that declares its own.
    pub fn load_on(
        name_or_path: &str,
        data: Option<&Path>,
        scale: Option<DeclaredScale>,
    ) -> Result<Self, DatasetError> {
        Study::check_scale(name_or_path, scale)?;
        if name_or_path == synthetic::NAME {
            return Ok(synthetic::sessions::simulate(&synthetic::generate(synthetic::SEED)?, synthetic::SEED).opinions);
        }
        if NAMES.contains(&name_or_path) {
            return published::opinions(&Manifest::embedded(name_or_path)?, data);
        }
        let study = Study::load_on(name_or_path, data, scale)?;
        let (stimuli, means) = study.pairs.iter().map(|p| (of_pair(p), study.scale.stated(p.mos))).unzip();
        Ok(Self {
            name: study.name,
            synthetic: study.synthetic,
            completeness: study.completeness,
            scale: study.scale,
            files: study.files,
            stimuli,
            scores: Scores::Means(means),
        })
    }

    /// Raw ratings alone, from a CSV file with the columns of [`RawLayout::default`], or from the `.toml` that maps
    /// other columns to these.
    pub fn load_raw(path: &Path) -> Result<Self, DatasetError> {
        Self::load_raw_on(path, None)
    }

    /// As [`StudyOpinions::load_raw`]; `scale` is that of the scores where no `.toml` declares one.
    ///
    /// # Errors
    /// Those of [`StudyOpinions::load_raw`]; a `.toml` that declares another scale.
    pub fn load_raw_on(path: &Path, scale: Option<DeclaredScale>) -> Result<Self, DatasetError> {
        let (mut layout, csv) = RawLayout::of(path)?;
        if let (Some(declared), Some(given)) = (layout.scale, scale)
            && declared != given
        {
            let reason = format!("it declares the scale {declared}, and --scale is {given}; they must be the same");
            return Err(DatasetError::Unreadable { path: path.into(), reason });
        }
        layout.scale = layout.scale.or(scale);
        super::raw_ratings::load(&csv, &layout)
    }

    /// These raw ratings instead of the scores of `self`. Material types and groups that `raw` does not state are
    /// those of the study's materials, and methods belong to the study's families.
    pub fn with_raw(&self, mut raw: Self) -> Self {
        let known: BTreeMap<&str, &Stimulus> = self.stimuli.iter().map(|s| (s.material.as_str(), s)).collect();
        let families: BTreeMap<&str, &String> =
            self.stimuli.iter().map(|s| (s.method.as_str(), &s.method_family)).collect();
        for stimulus in &mut raw.stimuli {
            if let Some(family) = families.get(stimulus.method.as_str()) {
                stimulus.method_family.clone_from(family);
            }
            let Some(of_study) = known.get(stimulus.material.as_str()) else { continue };
            if stimulus.group == stimulus.material {
                stimulus.group.clone_from(&of_study.group);
            }
            if stimulus.material_type.is_none() {
                stimulus.material_type.clone_from(&of_study.material_type);
            }
        }
        let files = self.files.iter().chain(&raw.files).cloned().collect();
        Self { name: self.name.clone(), synthetic: self.synthetic || raw.synthetic, files, ..raw }
    }
}

/// The stimulus that a rated pair is: a hidden reference where its candidate is the reference.
pub(super) fn of_pair(pair: &RatedPair) -> Stimulus {
    let hidden = pair.is_hidden_reference();
    let named = |name: &String| if hidden { REFERENCE.to_owned() } else { name.clone() };
    Stimulus {
        material: pair.material.clone(),
        method: named(&pair.method),
        method_family: named(&pair.method_family),
        illumination: None,
        group: pair.group.clone(),
        material_type: pair.material_type.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(dir: &tempfile::TempDir, name: &str, text: &str) -> std::path::PathBuf {
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    #[test]
    fn a_published_study_needs_only_its_ratings() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir(dir.path().join("lavoue2021")).unwrap();
        let ratings = "METHOD;BRDF;DISTANCE\nSGD;pink-fabric2;0.5\nLEGENDRE;pink-fabric2;0.25\nSGD;steel;0\n";
        write(&dir, "lavoue2021/PerceptualDistances.csv", ratings);
        write(&dir, "lavoue2021/MaterialType.csv", "BRDF;Type\npink-fabric2;Dielectric\nsteel;Metal\n");
        let full = StudyOpinions::load("lavoue2021", Some(dir.path())).unwrap();
        assert_eq!(full.completeness, Completeness { found: 3, known: 1926 });
        assert_eq!((full.stimuli[0].group.as_str(), full.files.len()), ("pink-fabric", 2));
        assert!(matches!(&full.scores, Scores::Means(m) if m == &[3.0, 4.0, 5.0]));
        // LEGENDRE is no method that small open files rebuild.
        let open = StudyOpinions::load("lavoue2021-open", Some(dir.path())).unwrap();
        assert!(matches!(&open.scores, Scores::Means(m) if m == &[3.0, 5.0]));
    }

    #[test]
    fn raw_ratings_take_types_groups_and_families_of_the_study() {
        let dir = tempfile::tempdir().unwrap();
        let pairs = "reference,candidate,mos,material,group,material_type,method,method_family\n\
                     a.binary,b.binary,3,chalk,stones,Dielectric,GGX,microfacets\n";
        let study = write(&dir, "s.csv", pairs);
        let rows = "participant,material,method,score\np,chalk,GGX,3\nq,chalk,GGX,4\np,gold,SGD,2\n";
        let raw = StudyOpinions::load_raw(&write(&dir, "raw.csv", rows)).unwrap();
        assert_eq!(raw.name, "raw.csv");
        let joined = StudyOpinions::load(&study.to_string_lossy(), None).unwrap().with_raw(raw);
        assert_eq!((joined.name.as_str(), joined.files.len()), ("s.csv", 2));
        let facts: Vec<_> = joined.stimuli.iter().map(|s| (s.group.as_str(), s.material_type.as_deref())).collect();
        assert_eq!(facts, [("stones", Some("Dielectric")), ("gold", None)]);
        let families: Vec<_> = joined.stimuli.iter().map(|s| s.method_family.as_str()).collect();
        assert_eq!(families, ["microfacets", "SGD"]);
        assert!(matches!(joined.scores, Scores::Raw(r) if r.judgements.len() == 3));
    }
}
