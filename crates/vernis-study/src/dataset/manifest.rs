//! Manifests: what a published study is made of and where its files come from, as `manifests/<study>.toml`
//! states it. The files are compiled in, so that a binary alone knows every study.

use super::identical::{Basis, Identical};
use super::raw_layout::RawLayout;
use super::{DatasetError, DeclaredScale, NamedRows};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};

/// Published studies, in the order in which they are listed.
pub const NAMES: [&str; 2] = ["lavoue2021", OPEN];
/// The part of the study that small open files rebuild: used where no study is named and the data folder has it.
pub const OPEN: &str = "lavoue2021-open";

const LAVOUE2021: &str = include_str!("../../manifests/lavoue2021.toml");
const LAVOUE2021_OPEN: &str = include_str!("../../manifests/lavoue2021-open.toml");

/// A published study.
#[derive(Debug, Clone)]
pub struct Manifest {
    /// Ratings, material types, sisters and method families; the whole study where nothing is rebuilt.
    pub rated: RatedManifest,
    /// How pairs of `rated` are rebuilt from other files than its tables.
    pub rebuilt: Option<RebuiltManifest>,
}

/// `manifest.toml` of a study that brings its ratings.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RatedManifest {
    /// Name of the study.
    pub name: String,
    /// Title of the publication.
    pub title: String,
    /// DOI of the publication.
    pub doi: String,
    /// Rated pairs of the whole study.
    pub pairs: usize,
    /// Where the ratings are.
    pub ratings: Ratings,
    /// The scale of the ratings; 1 (very poor) to 5 (excellent) where nothing is stated.
    #[serde(default = "grades")]
    pub scale: DeclaredScale,
    /// The score of identical BRDFs, where a source of the study states it.
    pub identical: Option<StatedIdentical>,
    /// The scores behind the means, in a file of the data folder that need not be there.
    pub raw_ratings: Option<RawLayout>,
    /// Where the candidates' tables may be.
    pub tables: Tables,
    /// Where the measured materials may be.
    pub references: References,
    /// The pinned files.
    #[serde(rename = "file")]
    pub files: Vec<PinnedFile>,
    /// What is too large or too numerous to pin by file.
    #[serde(rename = "collection")]
    pub collections: Vec<Collection>,
    /// The approximation methods.
    #[serde(rename = "method")]
    pub methods: Vec<Method>,
    /// Materials that are kept on one side of every split.
    pub sisters: Vec<Sisters>,
}

fn grades() -> DeclaredScale {
    DeclaredScale::MOS
}

/// The score of identical BRDFs, as a source of the study states it.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StatedIdentical {
    /// On the scale of the ratings.
    pub score: f64,
    /// Where it stands, and of what it is the mean.
    pub source: String,
}

/// Where the ratings are, in the data folder.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ratings {
    /// The CSV file of the ratings.
    pub file: String,
    /// The CSV file of the types of the materials.
    pub material_types: String,
    /// Patterns of the rows of `material_types` that are no material of the study.
    pub ignored_types: Vec<String>,
}

/// Where candidates' tables may be: `<folder><material>.<letter>.<extension>`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tables {
    /// Folders of the data folder, in the order in which they are searched; each ends with `/` or is empty.
    pub folders: Vec<String>,
    /// Extensions without the dot, in the order in which they are tried.
    pub extensions: Vec<String>,
}

/// Where the measured materials may be; `{material}` stands for the name.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct References {
    /// Sources in the data folder; the first that exists is taken.
    pub paths: Vec<String>,
}

/// A file of the data folder, pinned to one published content.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PinnedFile {
    /// In the data folder.
    pub path: String,
    /// What the file is for, in words.
    pub role: String,
    /// Address of the repository.
    pub source: String,
    /// Commit of the repository.
    pub revision: String,
    /// In the repository.
    pub source_path: String,
    /// Size in bytes, where it is pinned.
    pub bytes: Option<u64>,
    /// SHA-256 of its content, 64 lower-case hexadecimal digits.
    pub sha256: String,
    /// Licence, as the source states it.
    pub licence: String,
    /// A part of the file is of use too.
    #[serde(default)]
    pub extract_allowed: bool,
    /// The study loads without it.
    #[serde(default)]
    pub optional: bool,
}

impl PinnedFile {
    /// Where to get it, in one line.
    pub fn origin(&self) -> String {
        format!("{}, commit {}, {}", self.source, self.revision, self.source_path)
    }
}

/// Files too many or too large to pin one by one.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Collection {
    /// What the files are and where they belong, in words.
    pub what: String,
    /// Address of the source.
    pub source: String,
    /// The files at the source.
    pub source_path: String,
    /// Size in bytes, where it is known.
    pub bytes: Option<u64>,
    /// Algorithm and digits, such as `md5 7141af4c12b4c4feed299769260b3604`.
    pub checksum: Option<String>,
    /// Licence, as the source states it.
    pub licence: String,
}

impl Collection {
    /// Where to get it, in one line.
    pub fn origin(&self) -> String {
        format!("{}, {}", self.source, self.source_path)
    }
}

/// An approximation method as the ratings name it.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Method {
    /// Name of the method in the ratings.
    pub name: String,
    /// Methods of one family are left out together.
    pub family: String,
    /// The method's letter in the names of the study's tables.
    pub letter: char,
}

/// Materials that are kept on one side of every split.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sisters {
    /// Name of the group.
    pub group: String,
    /// Names of its materials; at most one `*` stands for any characters.
    pub pattern: String,
}

/// `manifest.toml` of a study that rebuilds the pairs of another one.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RebuiltManifest {
    /// Name of the study.
    pub name: String,
    /// Title of the study.
    pub title: String,
    /// DOI of the publication.
    pub doi: String,
    /// Rated pairs of the whole study.
    pub pairs: usize,
    /// The study whose ratings, sisters and families are used.
    pub ratings_of: String,
    /// Source of a reference; `{material}` stands for the name.
    pub reference: String,
    /// How the candidates of each method are rebuilt.
    #[serde(rename = "candidate")]
    pub candidates: Vec<Candidate>,
    /// Rows that figures are given for beside those on all rows.
    #[serde(default, rename = "row_set")]
    pub row_sets: Vec<NamedRows>,
    /// The pinned files that pairs are rebuilt from.
    #[serde(rename = "file")]
    pub files: Vec<PinnedFile>,
    /// How far the references are from the measured materials.
    pub reliability: Reliability,
    /// Judged triplets of the references' materials, in optional files.
    pub triplets: Option<TripletFiles>,
}

/// Where judged triplets are, in the data folder: see [`super::triplets`].
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TripletFiles {
    /// The JSON file of triplets and votes.
    pub answers: String,
    /// The names of the materials by number.
    pub materials: String,
}

/// How the candidates of a method are rebuilt.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Candidate {
    /// Name of the method in the ratings.
    pub method: String,
    /// The methods that a split leaves out together, where that is another family than that of the ratings' study.
    #[serde(default)]
    pub family: Option<String>,
    /// `{material}` stands for the name.
    pub source: String,
}

/// Errors of references that are stand-ins for measured materials.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reliability {
    /// The error at which a row weighs 1/2.
    pub scale: f64,
    /// By material; others are taken as exact.
    pub errors: BTreeMap<String, f64>,
}

impl Reliability {
    /// Training weight of the rows of a material: 1/(1 + (error/scale)^2).
    pub fn weight(&self, material: &str) -> f64 {
        self.errors.get(material).map_or(1.0, |e| 1.0 / (1.0 + (e / self.scale).powi(2)))
    }
}

impl Manifest {
    /// The compiled-in manifest of a study in [`NAMES`].
    pub fn embedded(name: &str) -> Result<Self, DatasetError> {
        let rated = RatedManifest::parse("lavoue2021", LAVOUE2021)?;
        let rebuilt = match name {
            "lavoue2021" => None,
            "lavoue2021-open" => Some(RebuiltManifest::parse(name, LAVOUE2021_OPEN)?),
            _ => return Err(manifest_error(name, "there is no such manifest".into())),
        };
        if let Some(rebuilt) = &rebuilt {
            rebuilt.check(&rated)?;
        }
        Ok(Self { rated, rebuilt })
    }

    /// The same study with `candidates` in place of its own.
    ///
    /// # Errors
    /// A study whose pairs are not rebuilt; a method that nobody rated.
    pub fn with_candidates(mut self, candidates: Vec<Candidate>) -> Result<Self, DatasetError> {
        let Some(rebuilt) = &mut self.rebuilt else {
            return Err(manifest_error(
                &self.rated.name,
                "its candidates are not rebuilt, so none can be replaced".into(),
            ));
        };
        rebuilt.candidates = candidates;
        rebuilt.check(&self.rated)?;
        Ok(self)
    }

    /// Name of the study.
    pub fn name(&self) -> &str {
        self.rebuilt.as_ref().map_or(&self.rated.name, |m| &m.name)
    }

    /// Title of the study.
    pub fn title(&self) -> &str {
        self.rebuilt.as_ref().map_or(&self.rated.title, |m| &m.title)
    }

    /// DOI of the publication.
    pub fn doi(&self) -> &str {
        self.rebuilt.as_ref().map_or(&self.rated.doi, |m| &m.doi)
    }

    /// Rated pairs of the whole study.
    pub fn pairs(&self) -> usize {
        self.rebuilt.as_ref().map_or(self.rated.pairs, |m| m.pairs)
    }

    /// The pinned files without which the study cannot be loaded, ratings first.
    pub fn needed_files(&self) -> Vec<&PinnedFile> {
        self.files().into_iter().filter(|file| !file.optional).collect()
    }

    /// Every pinned file, ratings first.
    pub fn files(&self) -> Vec<&PinnedFile> {
        let rebuilt = self.rebuilt.as_ref().map_or(&[][..], |m| &m.files);
        self.rated.files.iter().chain(rebuilt).collect()
    }

    /// Rows that figures are given for beside those on all rows.
    pub fn row_sets(&self) -> &[NamedRows] {
        self.rebuilt.as_ref().map_or(&[], |m| &m.row_sets)
    }

    /// The methods that a split leaves out together with `method`: what the rebuilt study says, else the study of the ratings.
    pub fn family(&self, method: &str) -> String {
        let rebuilt = self.rebuilt.iter().flat_map(|m| &m.candidates).find(|c| c.method == method);
        rebuilt.and_then(|c| c.family.clone()).unwrap_or_else(|| self.rated.family(method))
    }

    /// What the study needs beside its pinned files.
    pub fn collections(&self) -> &[Collection] {
        if self.rebuilt.is_some() { &[] } else { &self.rated.collections }
    }
}

impl RatedManifest {
    /// Parses and checks `manifest.toml`.
    pub fn parse(study: &str, text: &str) -> Result<Self, DatasetError> {
        let m: Self = from_toml(study, text)?;
        unique(study, "method", m.methods.iter().map(|x| x.name.as_str()))?;
        unique(study, "file", m.files.iter().map(|x| x.path.as_str()))?;
        for path in [&m.ratings.file, &m.ratings.material_types] {
            if !m.files.iter().any(|f| f.path == *path) {
                return Err(manifest_error(study, format!("{path} is used but not among the files")));
            }
        }
        m.files.iter().try_for_each(|f| check_sha256(study, f))?;
        let scale = m.scale.of_ratings([]).map_err(|_| {
            manifest_error(
                study,
                format!("scale is {}; it must have a worst end, for the ratings are given as shares of it", m.scale),
            )
        })?;
        if let Some(identical) = m.identical.as_ref().filter(|i| !scale.contains(i.score)) {
            return Err(manifest_error(study, format!("identical: score is {}; it must be {scale}", identical.score)));
        }
        let raw = m.raw_ratings.as_ref().map_or(Ok(()), RawLayout::check);
        raw.map_err(|reason| manifest_error(study, format!("raw_ratings: {reason}")))?;
        Ok(m)
    }

    /// The score of identical BRDFs, where the manifest states it.
    pub fn stated_identical(&self) -> Option<Identical> {
        let stated = self.identical.as_ref()?;
        let scale = self.scale.of_ratings([]).ok()?;
        Some(Identical { score: scale.grade(stated.score), basis: Basis::Declared { source: stated.source.clone() } })
    }

    /// The method called `name`, if the manifest lists it.
    pub fn method(&self, name: &str) -> Option<&Method> {
        self.methods.iter().find(|m| m.name == name)
    }

    /// The family of a method: what the manifest says, else the method itself.
    pub fn family(&self, method: &str) -> String {
        self.method(method).map_or(method, |m| &m.family).to_owned()
    }

    /// The group of a material: its sisters' where it has some, else its own name.
    pub fn group(&self, material: &str) -> String {
        let sisters = self.sisters.iter().find(|s| matches_pattern(&s.pattern, material));
        sisters.map_or(material, |s| &s.group).to_owned()
    }
}

impl RebuiltManifest {
    /// Parses and checks `manifest.toml`.
    pub fn parse(study: &str, text: &str) -> Result<Self, DatasetError> {
        let m: Self = from_toml(study, text)?;
        unique(study, "method", m.candidates.iter().map(|x| x.method.as_str()))?;
        unique(study, "file", m.files.iter().map(|x| x.path.as_str()))?;
        m.files.iter().try_for_each(|f| check_sha256(study, f))?;
        let sources = m.candidates.iter().map(|c| &c.source).chain([&m.reference]);
        for source in sources {
            let file = source.split(':').next().unwrap_or(source);
            if !m.files.iter().any(|f| f.path == file) {
                return Err(manifest_error(study, format!("{file} is used but not among the files")));
            }
        }
        unique(study, "row_set", m.row_sets.iter().map(|set| set.name.as_str()))?;
        for set in &m.row_sets {
            let wrong = |reason: String| Err(manifest_error(study, format!("row_set {}: {reason}", set.name)));
            if set.methods.is_empty() {
                return wrong("it names no method".into());
            }
            if NamedRows::RESERVED.contains(&set.name.as_str()) {
                return wrong("this name means other rows; choose another one".into());
            }
            if let Some(method) = set.methods.iter().find(|name| !m.candidates.iter().any(|c| c.method == **name)) {
                return wrong(format!("no candidate of the study is of the method {method}"));
            }
        }
        for path in m.triplets.iter().flat_map(|t| [&t.answers, &t.materials]) {
            if !m.files.iter().any(|f| f.path == *path && f.optional) {
                return Err(manifest_error(study, format!("{path} is used but not among the optional files")));
            }
        }
        let Reliability { scale, errors } = &m.reliability;
        let sound = scale.is_finite() && *scale > 0.0 && errors.values().all(|e| e.is_finite() && *e >= 0.0);
        if !sound {
            return Err(manifest_error(study, "reliability needs a positive scale and errors of at least 0".into()));
        }
        Ok(m)
    }

    fn check(&self, base: &RatedManifest) -> Result<(), DatasetError> {
        if self.ratings_of != base.name {
            return Err(manifest_error(&self.name, format!("no study {} to take ratings of", self.ratings_of)));
        }
        match self.candidates.iter().find(|c| base.method(&c.method).is_none()) {
            Some(c) => Err(manifest_error(&self.name, format!("{} has no method {}", base.name, c.method))),
            None => Ok(()),
        }
    }
}

/// Whether `name` fits `pattern`, in which at most one `*` stands for any characters.
pub fn matches_pattern(pattern: &str, name: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == name,
        Some((head, tail)) => name.len() >= head.len() + tail.len() && name.starts_with(head) && name.ends_with(tail),
    }
}

fn manifest_error(study: &str, reason: String) -> DatasetError {
    DatasetError::Manifest { study: study.into(), reason }
}

fn from_toml<T: serde::de::DeserializeOwned>(study: &str, text: &str) -> Result<T, DatasetError> {
    toml::from_str(text).map_err(|e| manifest_error(study, e.to_string().trim().replace('\n', " ")))
}

fn unique<'a>(study: &str, what: &str, names: impl Iterator<Item = &'a str>) -> Result<(), DatasetError> {
    let mut seen = BTreeSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(manifest_error(study, format!("{what} {name} is listed twice")));
        }
    }
    Ok(())
}

fn check_sha256(study: &str, file: &PinnedFile) -> Result<(), DatasetError> {
    let hex = file.sha256.len() == 64 && file.sha256.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b));
    if hex { Ok(()) } else { Err(manifest_error(study, format!("{}: sha256 is not 64 lower-case digits", file.path))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_embedded_manifest_parses() {
        for name in NAMES {
            let m = Manifest::embedded(name).unwrap();
            assert_eq!(m.name(), name);
            assert!(m.files().iter().all(|f| f.source.starts_with("https://") && f.revision.len() == 40));
        }
        // 2,026 BRDFs of which 100 are hidden references (Lavoue et al. 2021, section 3).
        assert_eq!(Manifest::embedded("lavoue2021").unwrap().pairs(), 2026 - 100);
        // Three methods on 100 materials, three on the 86 of Ngan et al. 2005, and three that are read off the references.
        assert_eq!(Manifest::embedded("lavoue2021-open").unwrap().pairs(), 3 * 100 + 3 * 86 + 3 * 100);
    }

    #[test]
    fn sisters_share_a_group_and_others_keep_their_name() {
        let m = Manifest::embedded("lavoue2021").unwrap();
        let m = m.rated;
        for (a, b) in [
            ("gold-metallic-paint", "gold-metallic-paint3"),
            ("pink-fabric", "pink-fabric2"),
            ("color-changing-paint1", "color-changing-paint3"),
            ("specular-black-phenolic", "specular-violet-phenolic"),
            ("white-fabric", "white-fabric2"),
            ("blue-metallic-paint", "blue-metallic-paint2"),
            ("green-metallic-paint", "green-metallic-paint2"),
            ("red-fabric", "red-fabric2"),
            ("silver-metallic-paint", "silver-metallic-paint2"),
        ] {
            assert_eq!(m.group(a), m.group(b));
        }
        for alone in
            ["black-phenolic", "gold-paint", "pink-felt", "steel", "red-metallic-paint", "dark-specular-fabric"]
        {
            assert_eq!(m.group(alone), alone);
        }
        // The tail of a pattern counts, and head and tail do not share characters.
        assert!(!matches_pattern("specular-*-phenolic", "specular-red-plastic"));
        assert!(!matches_pattern("specular-*-phenolic", "specular-phenolic"));
    }

    #[test]
    fn families_join_fits_of_one_model() {
        let m = Manifest::embedded("lavoue2021").unwrap();
        let family = |name: &str| m.rated.method(name).map(|x| x.family.clone()).unwrap();
        for (a, b) in [
            ("ABC", "ABC-OURS"),
            ("WARD", "WARD-OURS"),
            ("BLINN-PHONG", "BLINN-PHONG-OURS"),
            ("LAFORTUNE", "LAFORTUNE-OURS"),
            ("CHEBYCHEV", "LEGENDRE"),
            ("GPLVM_APPROX.1", "GPLVM_APPROX.6"),
        ] {
            assert_eq!(family(a), family(b));
        }
        let open = Manifest::embedded(OPEN).unwrap();
        assert_eq!([open.family("DUPUY"), open.family("GGX"), open.family("BECKMAN")], ["DUPUY"; 3]);
        assert_eq!((open.family("WARD"), m.family("GGX")), ("WARD".to_owned(), "GGX".to_owned()));
        let alone = ["BAGHER", "SGD", "ABC", "WARD", "DUPUY", "GGX", "BECKMAN"];
        assert_eq!(alone.iter().map(|a| family(a)).collect::<BTreeSet<_>>().len(), alone.len());
        assert_eq!(m.rated.methods.iter().map(|m| m.letter).collect::<BTreeSet<_>>().len(), m.rated.methods.len());
    }

    #[test]
    fn sets_of_rows_part_the_methods_of_the_open_study() {
        let rebuilt = Manifest::embedded("lavoue2021-open").unwrap().rebuilt.unwrap();
        let in_sets: Vec<&String> = rebuilt.row_sets.iter().flat_map(|set| &set.methods).collect();
        assert_eq!(in_sets, rebuilt.candidates.iter().map(|c| &c.method).collect::<Vec<_>>());
        assert_eq!(rebuilt.row_sets.iter().map(|set| set.methods.len()).collect::<Vec<_>>(), [6, 3]);
        let refused = |old: &str, new: &str| {
            assert!(LAVOUE2021_OPEN.contains(old), "{old}");
            RebuiltManifest::parse("lavoue2021-open", &LAVOUE2021_OPEN.replacen(old, new, 1)).unwrap_err().to_string()
        };
        let name = "name = \"six published methods\"";
        for (old, new, expected) in [
            (
                name,
                "name = \"three rebuilt from the reference\"",
                "row_set three rebuilt from the reference is listed twice",
            ),
            (name, "name = \"all\"", "row_set all: this name means other rows"),
            ("[\"SGD\", ", "[\"SDG\", ", "no candidate of the study is of the method SDG"),
            ("[\"DUPUY\", \"GGX\", \"BECKMAN\"]", "[]", "it names no method"),
        ] {
            let message = refused(old, new);
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn weights_fall_with_the_error_of_the_reference() {
        let rebuilt = Manifest::embedded("lavoue2021-open").unwrap().rebuilt.unwrap();
        let weight = |m: &str| rebuilt.reliability.weight(m);
        assert_eq!(weight("teflon"), 1.0);
        assert!((weight("steel") - 0.3065).abs() < 1e-4);
        assert!(weight("steel") < weight("chrome") && weight("chrome") < weight("nickel"));
    }

    #[test]
    fn a_study_states_its_scale_and_the_score_of_identical_brdfs() {
        let stated = Manifest::embedded("lavoue2021-open").unwrap().rated;
        assert_eq!(stated.scale, DeclaredScale::MOS);
        // Section 5.4 of the paper, under Grace, as the ratings.
        assert_eq!(stated.stated_identical().unwrap().score, 4.39);
        let with = |line: &str| {
            let text = LAVOUE2021.replacen("scale = {worst = 1, best = 5}", "", 1);
            RatedManifest::parse("lavoue2021", &text.replacen("identical = {", &format!("{line}\n#"), 1))
        };
        let percent = with("scale = {worst = 0, best = 100}\nidentical = {score = 75, source = \"a paper\"}").unwrap();
        assert_eq!(percent.stated_identical().unwrap().score, 4.0);
        assert!(with("").unwrap().stated_identical().is_none());
        let refused = |line: &str| with(line).unwrap_err().to_string();
        assert!(refused("scale = \"jod\"").contains("scale is jod; it must have a worst end"));
        assert!(
            refused("identical = {score = 7, source = \"\"}").contains("score is 7; it must be 1 (very poor) to 5")
        );
    }

    #[test]
    fn a_study_may_state_where_its_raw_ratings_are() {
        let with = |section: &str| {
            RatedManifest::parse("lavoue2021", &LAVOUE2021.replacen("[tables]", &format!("{section}\n[tables]"), 1))
        };
        let section = "[raw_ratings]\nfile = \"scores.csv\"\n[raw_ratings.columns]\nparticipant = \"worker\"\n";
        let layout = with(section).unwrap().raw_ratings.unwrap();
        assert_eq!(
            (layout.file.as_str(), layout.column("participant"), layout.delimiter),
            ("scores.csv", "worker", None)
        );
        assert!(layout.ignore_others && layout.column("score") == "score");
        let message = with(&section.replace("participant", "rater")).unwrap_err().to_string();
        assert!(
            message.contains("raw_ratings: columns: a key is `rater`; it must be one of participant, material"),
            "{message}"
        );
    }

    #[test]
    fn a_field_that_nobody_reads_is_refused() {
        let text = LAVOUE2021.replacen("doi =", "dio = 1\ndoi =", 1);
        let message = RatedManifest::parse("lavoue2021", &text).unwrap_err().to_string();
        assert!(message.contains("dio") && !message.contains('\n'), "{message}");
        let twice = LAVOUE2021.replacen("name = \"SGD\"", "name = \"GGX\"", 1);
        assert!(RatedManifest::parse("lavoue2021", &twice).unwrap_err().to_string().contains("GGX is listed twice"));
    }
}
