//! Judgements of similarity in triplets: which of two materials looks more like a reference.
//!
//! The layout is that of Lagunas et al. 2019 (doi:10.1145/3306346.3323036), a JSON object with
//!
//! * `answers`: `[reference, a, b]`, the numbers of materials;
//! * `agreement`: `[votes for a, votes for b]`, one a triplet;
//!
//! and a text file with one material a line: its number, a tab and its name.

use super::manifest::{self, Manifest, RatedManifest, RebuiltManifest, TripletFiles};
use super::{DatasetError, StudyFile};
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::Path;
use vernis_metric::brdf::formats::materials as members;
use vernis_metric::brdf::{BrdfSource, ContentHash};
use vernis_metric::io::{counted, did_you_mean, nearest, read_at_most};

/// Larger files are no triplets.
const MOST_BYTES: u64 = 256 << 20;

/// One question and its votes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Triplet {
    /// Place of the reference among the materials.
    pub reference: usize,
    /// Places of the two that were compared with it.
    pub candidates: [usize; 2],
    /// Votes for each of the two.
    pub votes: [u32; 2],
}

/// Triplets over named materials.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Triplets {
    /// Names of the materials.
    pub materials: Vec<String>,
    /// The questions, in the order of the file.
    pub triplets: Vec<Triplet>,
}

/// The triplets that belong to a published study, and the BRDFs of their materials.
#[derive(Debug, Clone)]
pub struct StudyTriplets {
    /// The questions and their votes.
    pub triplets: Triplets,
    /// The BRDF of every material, in their order: paths in the data folder.
    pub sources: Vec<BrdfSource>,
    /// The group of every material: with its sisters.
    pub groups: Vec<String>,
    /// The files that were read.
    pub files: Vec<StudyFile>,
}

#[derive(Deserialize)]
struct File {
    answers: Vec<[usize; 3]>,
    agreement: Vec<[u32; 2]>,
    /// The file also lists triplets with and without a majority apart.
    #[serde(default)]
    agreement_diff: Option<Vec<[u32; 2]>>,
    #[serde(default)]
    agreement_equal: Option<Vec<[u32; 2]>>,
}

/// More votes on one question are no votes of people.
const MOST_VOTES: u32 = 1_000_000;

impl StudyTriplets {
    /// The triplets of the study called `name` in the folder `data`; the text says why there are none.
    ///
    /// # Errors
    /// Files that are there but cannot be used: see [`Triplets::load`]; a material that the study cannot rebuild.
    pub fn of_study(name: &str, data: Option<&Path>) -> Result<Result<Self, String>, DatasetError> {
        let none = || Ok(Err("the study names no file of triplets".to_owned()));
        if !manifest::NAMES.contains(&name) {
            return none();
        }
        let Manifest { rated, rebuilt: Some(rebuilt) } = Manifest::embedded(name)? else { return none() };
        let Some(files) = &rebuilt.triplets else { return none() };
        let Some(data) = data else {
            return Ok(Err("there is no data folder to find them in".to_owned()));
        };
        let missing = [&files.answers, &files.materials].into_iter().find(|file| !data.join(file).exists());
        match missing {
            Some(file) => Ok(Err(format!("{file} is not in the data folder; `vernis data fetch {name}` brings it"))),
            None => Self::read(&rated, &rebuilt, files, data).map(Ok),
        }
    }

    fn read(
        rated: &RatedManifest,
        rebuilt: &RebuiltManifest,
        files: &TripletFiles,
        data: &Path,
    ) -> Result<Self, DatasetError> {
        let (answers, names) = (data.join(&files.answers), data.join(&files.materials));
        let triplets = Triplets::load(&answers, &names)?;
        let source = |material: &str| rebuilt.reference.replace("{material}", material);
        if let Some((archive, _)) = rebuilt.reference.split_once(".zip:") {
            let known = members(&data.join(format!("{archive}.zip"))).map_err(|e| DatasetError::Content {
                place: data.display().to_string(),
                found: format!("has an archive of references that cannot be read ({e})"),
                allowed: "the triplets need it".to_owned(),
            })?;
            let set: BTreeSet<&str> = known.iter().map(String::as_str).collect();
            if let Some(number) = triplets.materials.iter().position(|m| !set.contains(m.as_str())) {
                let name = &triplets.materials[number];
                return Err(DatasetError::Content {
                    place: names.display().to_string(),
                    found: format!("names material {number} `{name}`, which no BRDF stands for"),
                    allowed: format!(
                        "it must be one of the {} of {archive}.zip; {}",
                        counted(known.len(), "material"),
                        did_you_mean(&nearest(name, &known))
                    ),
                });
            }
        }
        let sources = triplets.materials.iter().map(|m| BrdfSource::Notation(source(m))).collect();
        let groups = triplets.materials.iter().map(|m| rated.group(m)).collect();
        let file = |name: &String| {
            let pinned = rebuilt.files.iter().find(|f| f.path == *name);
            let content = ContentHash::of(&bytes_of(&data.join(name))?);
            let as_published = pinned.map(|pinned| content.to_string() == pinned.sha256);
            Ok(StudyFile { name: name.clone(), content, as_published })
        };
        let files = [&files.answers, &files.materials].into_iter().map(file).collect::<Result<_, DatasetError>>()?;
        Ok(Self { triplets, sources, groups, files })
    }
}

fn bytes_of(path: &Path) -> Result<Vec<u8>, DatasetError> {
    read_at_most(path, MOST_BYTES).map_err(|e| DatasetError::Unreadable { path: path.into(), reason: e.to_string() })
}

impl File {
    /// Triplets and votes of the lists with and without a majority, where the file has both.
    fn parts(&self) -> Option<[(usize, u64); 2]> {
        let sum = |votes: &[[u32; 2]]| (votes.len(), votes.iter().flatten().map(|&v| u64::from(v)).sum());
        Some([sum(self.agreement_diff.as_ref()?), sum(self.agreement_equal.as_ref()?)])
    }
}

impl Triplets {
    /// Reads the triplets, and the names of their materials.
    ///
    /// # Errors
    /// A file that cannot be read, another layout, no triplet, a number without a name, a material compared with itself.
    pub fn load(triplets: &Path, materials: &Path) -> Result<Self, DatasetError> {
        let wrong = |found: String, allowed: &str| DatasetError::Content {
            place: triplets.display().to_string(),
            found,
            allowed: allowed.to_owned(),
        };
        let names = names(materials, &bytes_of(materials)?)?;
        let file: File = serde_json::from_slice(&bytes_of(triplets)?).map_err(|e| {
            wrong(
                format!("cannot be read ({e})"),
                "it must be a JSON object with `answers`, [reference, a, b], and `agreement`, [votes for a, votes for b]",
            )
        })?;
        let parts = file.parts();
        let File { answers, agreement, .. } = file;
        if answers.is_empty() || answers.len() != agreement.len() {
            let found = format!("has {} answers and {} agreements", answers.len(), agreement.len());
            return Err(wrong(found, "it must have as many of both, and at least one"));
        }
        let triplet = |(index, (&[reference, a, b], &votes)): (usize, (&[usize; 3], &[u32; 2]))| {
            if let Some(number) = [reference, a, b].into_iter().find(|&number| number >= names.len()) {
                let found = format!("has material {number} in triplet {index}");
                let allowed = format!("the materials are 0 to {}", names.len() - 1);
                return Err(wrong(found, &allowed));
            }
            if reference == a || reference == b || a == b {
                let found = format!("has triplet {index} of [{reference}, {a}, {b}]");
                return Err(wrong(found, "a triplet must be of three materials"));
            }
            if votes.iter().any(|&v| v > MOST_VOTES) {
                let found = format!("has triplet {index} with the votes {votes:?}");
                return Err(wrong(found, "a question must have at most 1000000 votes for each answer"));
            }
            Ok(Triplet { reference, candidates: [a, b], votes })
        };
        let all = answers.iter().zip(&agreement).enumerate().map(triplet).collect::<Result<Vec<_>, _>>()?;
        if let Some([untied, tied]) = parts {
            let found = [true, false].map(|is_untied| {
                let some = all.iter().filter(|t| (t.votes[0] != t.votes[1]) == is_untied);
                some.fold((0, 0), |(n, votes), t| (n + 1, votes + t.votes.map(u64::from).iter().sum::<u64>()))
            });
            if found != [untied, tied] {
                let list = |[untied, tied]: [(usize, u64); 2]| {
                    format!(
                        "{} triplets of {} votes with a majority and {} of {} without",
                        untied.0, untied.1, tied.0, tied.1
                    )
                };
                let (whole, apart) = (list(found), list([untied, tied]));
                let what = format!("has {whole} in `agreement`, and {apart} in `agreement_diff` and `agreement_equal`");
                return Err(wrong(what, "the votes must add up"));
            }
        }
        if all.iter().all(|triplet| triplet.votes == [0, 0]) {
            return Err(wrong("has no vote".to_owned(), "at least one triplet must have votes"));
        }
        Ok(Self { materials: names, triplets: all })
    }
}

fn names(path: &Path, bytes: &[u8]) -> Result<Vec<String>, DatasetError> {
    let wrong = |found: String| DatasetError::Content {
        place: path.display().to_string(),
        found,
        allowed: "every line must be a number, a tab and a name, with the numbers 0, 1, 2, ... in order".to_owned(),
    };
    let text = std::str::from_utf8(bytes).map_err(|_| wrong("is not UTF-8".to_owned()))?;
    let mut names: Vec<String> = Vec::new();
    for (line, row) in text.lines().enumerate().filter(|(_, row)| !row.trim().is_empty()) {
        let name = row.split_once('\t').filter(|(number, _)| number.trim().parse() == Ok(names.len()));
        match name.map(|(_, name)| name.trim()).filter(|name| !name.is_empty()) {
            Some(name) => names.push(name.to_owned()),
            None => return Err(wrong(format!("has `{row}` on line {}", line + 1))),
        }
    }
    if names.is_empty() { Err(wrong("has no material".to_owned())) } else { Ok(names) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(json: &str, materials: &str) -> Result<Triplets, String> {
        let place = tempfile::tempdir().unwrap();
        let (a, b) = (place.path().join("t.json"), place.path().join("m.txt"));
        std::fs::write(&a, json).unwrap();
        std::fs::write(&b, materials).unwrap();
        Triplets::load(&a, &b).map_err(|e| e.to_string())
    }

    const NAMES: &str = "0\tchalk\n1\tgold\n2\ttin foil\n";

    #[test]
    fn triplets_name_materials_by_number() {
        let found = load(r#"{"answers":[[2,0,1]],"agreement":[[3,1]],"more":1}"#, NAMES).unwrap();
        assert_eq!(found.materials, ["chalk", "gold", "tin foil"]);
        assert_eq!(found.triplets, [Triplet { reference: 2, candidates: [0, 1], votes: [3, 1] }]);
    }

    #[test]
    fn other_files_are_refused_with_what_is_wrong() {
        for (json, names, parts) in [
            ("{}", NAMES, "t.json cannot be read (missing field `answers`"),
            (r#"{"answers":[[2,0,1]],"agreement":[]}"#, NAMES, "has 1 answers and 0 agreements"),
            (r#"{"answers":[],"agreement":[]}"#, NAMES, "has 0 answers"),
            (
                r#"{"answers":[[3,0,1]],"agreement":[[1,1]]}"#,
                NAMES,
                "has material 3 in triplet 0, but the materials are 0 to 2",
            ),
            (r#"{"answers":[[0,0,1]],"agreement":[[1,1]]}"#, NAMES, "has triplet 0 of [0, 0, 1]"),
            (r#"{"answers":[[2,0,1]],"agreement":[[0,0]]}"#, NAMES, "has no vote"),
            (r#"{"answers":[[2,0,1]],"agreement":[[-1,0]]}"#, NAMES, "t.json cannot be read"),
            (
                r#"{"answers":[[2,0,1]],"agreement":[[3,1]],"agreement_diff":[[2,1]],"agreement_equal":[]}"#,
                NAMES,
                "has 1 triplets of 4 votes with a majority and 0 of 0 without in `agreement`, and 1 triplets of 3 votes",
            ),
            (r#"{"answers":[[2,0,1]],"agreement":[[3,9000000]]}"#, NAMES, "triplet 0 with the votes [3, 9000000]"),
            (r#"{"answers":[[2,0]],"agreement":[[3,1]]}"#, NAMES, "expected an array of length 3 at line 1 column"),
            ("{}", "1\tgold\n", "m.txt has `1\tgold` on line 1"),
            ("{}", "0\tgold\ntin\n", "m.txt has `tin` on line 2"),
            ("{}", "", "m.txt has no material"),
        ] {
            let message = load(json, names).unwrap_err();
            assert!(message.contains(parts), "{message}");
        }
    }
}
