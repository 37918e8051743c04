//! Judgements of similarity in triplets: which of two materials looks more like a reference.
//!
//! The layout is that of Lagunas et al. 2019 (doi:10.1145/3306346.3323036), a JSON object with
//!
//! * `answers`: `[reference, a, b]`, the numbers of materials;
//! * `agreement`: `[votes for a, votes for b]`, one a triplet;
//!
//! and a text file with one material a line: its number, a tab and its name.

use super::DatasetError;
use serde::Deserialize;
use std::path::Path;
use vernis_metric::io::read_at_most;

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

#[derive(Deserialize)]
struct File {
    answers: Vec<[usize; 3]>,
    agreement: Vec<[u32; 2]>,
}

impl Triplets {
    /// Reads the triplets, and the names of their materials.
    ///
    /// # Errors
    /// A file that cannot be read, another layout, no triplet, a number without a name, a material compared with itself.
    pub fn load(triplets: &Path, materials: &Path) -> Result<Self, DatasetError> {
        let bytes = |path: &Path| {
            read_at_most(path, MOST_BYTES)
                .map_err(|e| DatasetError::Unreadable { path: path.into(), reason: e.to_string() })
        };
        let wrong = |found: String, allowed: &str| DatasetError::Content {
            place: triplets.display().to_string(),
            found,
            allowed: allowed.to_owned(),
        };
        let names = names(materials, &bytes(materials)?)?;
        let File { answers, agreement } = serde_json::from_slice(&bytes(triplets)?).map_err(|e| {
            wrong(
                format!("cannot be read ({e})"),
                "it must be a JSON object with `answers`, [reference, a, b], and `agreement`, [votes for a, votes for b]",
            )
        })?;
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
            Ok(Triplet { reference, candidates: [a, b], votes })
        };
        let all = answers.iter().zip(&agreement).enumerate().map(triplet).collect::<Result<Vec<_>, _>>()?;
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
            ("{}", "1\tgold\n", "m.txt has `1\tgold` on line 1"),
            ("{}", "0\tgold\ntin\n", "m.txt has `tin` on line 2"),
            ("{}", "", "m.txt has no material"),
        ] {
            let message = load(json, names).unwrap_err();
            assert!(message.contains(parts), "{message}");
        }
    }
}
