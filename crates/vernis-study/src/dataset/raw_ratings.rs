//! Raw ratings in long form: a CSV file with one row a judgement.
//!
//! Columns, by name and in any order: `participant`, `material`, `method` (the two name the pair; `REFERENCE` is the
//! reference shown as a candidate) and `score` (1 to 5, or on the scale that is declared); optional `illumination`, `seconds`
//! (time to answer), `gold` (the expected score of a control question, empty for every other row), `group` and `material_type`.
//! [`RawLayout`] maps other columns to these.

use super::csv_table::{CsvTable, Expected, MOST_BYTES, Others};
use super::error::field;
use super::opinions::{REFERENCE, Scores, Stimulus, StudyOpinions};
use super::raw_layout::RawLayout;
use super::scale::{DeclaredScale, HOW_TO_DECLARE};
use super::{Completeness, DatasetError, StudyFile};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use vernis_metric::brdf::ContentHash;
use vernis_metric::io::read_at_most;
use vernis_metric::math::rating_scale::RatingScale;

pub(super) const REQUIRED: [&str; 4] = ["participant", "material", "method", "score"];
pub(super) const OPTIONAL: [&str; 5] = ["illumination", "seconds", "gold", "group", "material_type"];

/// One score.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judgement {
    /// Index of the participant.
    pub participant: usize,
    /// Index of the stimulus.
    pub stimulus: usize,
    /// On the scale of the ratings.
    pub score: f64,
    /// Time to answer.
    pub seconds: Option<f64>,
}

/// The answer to a control question whose score is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GoldAnswer {
    /// Index of the participant.
    pub participant: usize,
    /// The score that the participant gave.
    pub score: f64,
    /// The score that is known to be right.
    pub expected: f64,
    /// Time to answer.
    pub seconds: Option<f64>,
}

/// Who said what. No participant judges a stimulus twice.
#[derive(Debug, Clone, PartialEq)]
pub struct RawRatings {
    /// Names of the participants.
    pub participants: Vec<String>,
    /// The scores, in the order of the file.
    pub judgements: Vec<Judgement>,
    /// Answers to control questions, which are no part of any mean.
    pub gold: Vec<GoldAnswer>,
}

/// Loads the raw ratings in the file at `path`.
///
/// # Errors
/// A file that cannot be read, a missing, repeated or unknown column, a score outside the scale, a judgement that is
/// there twice, a material in two groups or of two types, no judgement, or a single participant.
pub fn load(path: &Path, layout: &RawLayout) -> Result<StudyOpinions, DatasetError> {
    let unreadable = |e: std::io::Error| DatasetError::Unreadable { path: path.into(), reason: e.to_string() };
    let bytes = read_at_most(path, MOST_BYTES).map_err(unreadable)?;
    let (stimuli, raw) = parse(path, &bytes, layout)?;
    let all = raw.judgements.iter().map(|j| j.score).chain(raw.gold.iter().flat_map(|g| [g.score, g.expected]));
    let scale = layout.scale.unwrap_or(DeclaredScale::MOS).of_ratings(all);
    let scale = scale.map_err(|reason| DatasetError::Unreadable { path: path.into(), reason })?;
    let file_name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let file = StudyFile { name: file_name.clone(), content: ContentHash::of(&bytes), as_published: None };
    Ok(StudyOpinions {
        name: file_name,
        synthetic: false,
        completeness: Completeness { found: stimuli.len(), known: stimuli.len() },
        scale,
        files: vec![file],
        stimuli,
        scores: Scores::Raw(raw),
    })
}

fn parse(path: &Path, bytes: &[u8], layout: &RawLayout) -> Result<(Vec<Stimulus>, RawRatings), DatasetError> {
    let known: Vec<&str> = REQUIRED.into_iter().chain(OPTIONAL).map(|name| layout.column(name)).collect();
    let is_number = |name: &str| ["score", "seconds", "gold"].map(|number| layout.column(number)).contains(&name);
    let expected = Expected {
        known: &known,
        is_number: &is_number,
        others: if layout.ignore_others { Others::Kept } else { Others::Told },
        delimiter: layout.delimiter.and_then(|delimiter| u8::try_from(delimiter).ok()),
        usual: b',',
    };
    let table = CsvTable::read(path, bytes, &expected)?;
    let columns = check_header(path, table.header(), layout)?;
    let mut rows = Rows::new(path, layout);
    for (line, record) in table.rows() {
        rows.add(*line, &|name: &str| columns.get(name).and_then(|&i| record.get(i)).unwrap_or(""))?;
    }
    rows.finish()
}

fn check_header(
    path: &Path,
    header: &csv::StringRecord,
    layout: &RawLayout,
) -> Result<BTreeMap<&'static str, usize>, DatasetError> {
    let columns_allowed = || {
        let of = |names: &[&str]| names.iter().map(|n| layout.column(n).to_owned()).collect::<Vec<_>>().join(", ");
        format!("{}, and optionally {}", of(&REQUIRED), of(&OPTIONAL))
    };
    let mut columns = BTreeMap::new();
    for (i, found) in header.iter().enumerate() {
        let Some(name) = REQUIRED.into_iter().chain(OPTIONAL).find(|name| layout.column(name) == found) else {
            continue;
        };
        if columns.insert(name, i).is_some() {
            return Err(field(path, 1, &format!("column `{found}`"), "given twice".into(), "given once".into()));
        }
    }
    let optional = OPTIONAL.iter().filter(|name| layout.columns.contains_key(**name));
    match REQUIRED.iter().chain(optional).find(|name| !columns.contains_key(**name)) {
        Some(name) => {
            let allowed = format!("given; the columns are {}", columns_allowed());
            Err(field(path, 1, &format!("column `{}`", layout.column(name)), "missing".into(), allowed))
        }
        None => Ok(columns),
    }
}

/// The rows read so far.
struct Rows<'a> {
    path: &'a Path,
    layout: &'a RawLayout,
    participants: BTreeMap<String, usize>,
    stimuli: BTreeMap<[String; 3], usize>,
    /// Group and type of each material, and the line that stated them.
    materials: BTreeMap<String, ([String; 2], u64)>,
    listed: Vec<Stimulus>,
    judgements: Vec<Judgement>,
    gold: Vec<GoldAnswer>,
    seen: BTreeSet<(usize, usize)>,
}

impl RawRatings {
    /// Every score of a panel that rated on `scale` as a grade, 1 (worst) to 5 (best).
    #[must_use]
    pub fn in_grades(mut self, scale: RatingScale) -> Self {
        self.judgements.iter_mut().for_each(|j| j.score = scale.grade(j.score));
        for answer in &mut self.gold {
            (answer.score, answer.expected) = (scale.grade(answer.score), scale.grade(answer.expected));
        }
        self
    }
}

impl<'a> Rows<'a> {
    fn new(path: &'a Path, layout: &'a RawLayout) -> Self {
        Self {
            path,
            layout,
            participants: BTreeMap::new(),
            stimuli: BTreeMap::new(),
            materials: BTreeMap::new(),
            listed: Vec::new(),
            judgements: Vec::new(),
            gold: Vec::new(),
            seen: BTreeSet::new(),
        }
    }

    fn add<'c>(&mut self, line: u64, cell: &impl Fn(&str) -> &'c str) -> Result<(), DatasetError> {
        if let Some(name) = REQUIRED.iter().find(|name| cell(name).is_empty()) {
            return Err(self.wrong(line, name, "empty".into(), "filled in every row".into()));
        }
        let score = self.score(line, "score", cell("score"))?;
        let next = self.participants.len();
        let participant = *self.participants.entry(cell("participant").to_owned()).or_insert(next);
        let seconds = match cell("seconds") {
            "" => None,
            text => Some(text.parse::<f64>().ok().filter(|s| *s >= 0.0 && s.is_finite()).ok_or_else(|| {
                self.wrong(line, "seconds", format!("`{text}`"), "a finite number of at least 0, or empty".into())
            })?),
        };
        if !cell("gold").is_empty() {
            let expected = self.score(line, "gold", cell("gold"))?;
            self.gold.push(GoldAnswer { participant, score, expected, seconds });
            return Ok(());
        }
        let stimulus = self.stimulus(line, cell)?;
        if !self.seen.insert((participant, stimulus)) {
            let Stimulus { material, method, .. } = &self.listed[stimulus];
            let found = format!("a second score of {} for {material}, {method}", cell("participant"));
            return Err(self.wrong(
                line,
                "the row",
                found,
                "the only score of that participant for that stimulus".into(),
            ));
        }
        self.judgements.push(Judgement { participant, stimulus, score, seconds });
        Ok(())
    }

    /// The index of the row's stimulus.
    fn stimulus<'c>(&mut self, line: u64, cell: &impl Fn(&str) -> &'c str) -> Result<usize, DatasetError> {
        let material = cell("material").to_owned();
        let stated = ["group", "material_type"].map(|name| cell(name).to_owned());
        let (first, first_line) = self.materials.entry(material.clone()).or_insert_with(|| (stated.clone(), line));
        for (i, name) in ["group", "material_type"].into_iter().enumerate() {
            if first[i] != stated[i] {
                let allowed = format!("`{}`, as for material {material} on line {first_line}", first[i]);
                return Err(self.wrong(line, name, format!("`{}`", stated[i]), allowed));
            }
        }
        let method = match cell("method") {
            m if m == self.layout.reference_method => REFERENCE.to_owned(),
            m => m.to_owned(),
        };
        let illumination = cell("illumination").to_owned();
        if self.listed.first().is_some_and(|s| s.illumination.is_some() == illumination.is_empty()) {
            let found = if illumination.is_empty() { "empty".into() } else { format!("`{illumination}`") };
            return Err(self.wrong(line, "illumination", found, "filled in every row or in none".into()));
        }
        let next = self.listed.len();
        let index = *self.stimuli.entry([material.clone(), method.clone(), illumination.clone()]).or_insert(next);
        if index == next {
            let [group, material_type] = stated.map(|s| Some(s).filter(|s| !s.is_empty()));
            let group = group.unwrap_or_else(|| material.clone());
            let illumination = Some(illumination).filter(|i| !i.is_empty());
            let method_family = method.clone();
            self.listed.push(Stimulus { material, method, method_family, illumination, group, material_type });
        }
        Ok(index)
    }

    fn score(&self, line: u64, name: &str, text: &str) -> Result<f64, DatasetError> {
        let (found, scale) = (text.parse::<f64>().ok(), self.layout.scale.unwrap_or(DeclaredScale::MOS));
        found.filter(|&s| scale.contains(s)).ok_or_else(|| {
            let undeclared = self.layout.scale.is_none() && found.is_some_and(f64::is_finite);
            let how = if undeclared { format!("; {HOW_TO_DECLARE}") } else { String::new() };
            self.wrong(line, name, format!("`{text}`"), format!("{}{how}", scale.allowed()))
        })
    }

    fn wrong(&self, line: u64, name: &str, found: String, allowed: String) -> DatasetError {
        field(self.path, line, self.layout.column(name), found, allowed)
    }

    fn finish(self) -> Result<(Vec<Stimulus>, RawRatings), DatasetError> {
        let few = |reason: String| DatasetError::Unreadable { path: self.path.into(), reason };
        if self.judgements.is_empty() {
            return Err(few("it has no judgement of a stimulus; it must have at least 1".into()));
        }
        if self.participants.len() < 2 {
            let only = self.participants.keys().next().map_or("", String::as_str);
            return Err(few(format!("all scores are of one participant, {only}; there must be at least 2")));
        }
        let mut participants = vec![String::new(); self.participants.len()];
        for (name, index) in self.participants {
            participants[index] = name;
        }
        Ok((self.listed, RawRatings { participants, judgements: self.judgements, gold: self.gold }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, layout: &RawLayout) -> Result<(Vec<Stimulus>, RawRatings), DatasetError> {
        parse(Path::new("r.csv"), text.as_bytes(), layout)
    }

    const HEAD: &str = "participant,material,method,score";

    #[test]
    fn rows_become_judgements_and_gold_answers() {
        let text = "score,participant,illumination,material,method,seconds,gold,material_type,group\n\
                    4,ann,grace,steel,SGD,3.5,,Metal,metals\n2,bob,grace,steel,SGD,,,Metal,metals\n\
                    5,bob,uffizi,steel,REFERENCE,1,,Metal,metals\n\n1,ann,grace,x,y,2,5,,\n";
        let (stimuli, raw) = read(text, &RawLayout::default()).unwrap();
        assert_eq!(raw.participants, ["ann", "bob"]);
        let found: Vec<_> = raw.judgements.iter().map(|j| (j.participant, j.stimulus, j.score, j.seconds)).collect();
        assert_eq!(found, [(0, 0, 4.0, Some(3.5)), (1, 0, 2.0, None), (1, 1, 5.0, Some(1.0))]);
        assert_eq!(raw.gold, [GoldAnswer { participant: 0, score: 1.0, expected: 5.0, seconds: Some(2.0) }]);
        assert_eq!(stimuli.len(), 2);
        assert!(stimuli[1].is_reference() && !stimuli[0].is_reference());
        assert_eq!((stimuli[1].illumination.as_deref(), stimuli[0].group.as_str()), (Some("uffizi"), "metals"));
        assert_eq!(stimuli[0].material_type.as_deref(), Some("Metal"));
    }

    #[test]
    fn a_layout_maps_other_columns() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
        write("e.csv", "id;worker;BRDF;model;answer\n1;w1;steel;GROUND;4\n2;w2;steel;SGD;2\n");
        let map = "file = \"e.csv\"\ndelimiter = \";\"\nreference_method = \"GROUND\"\n[columns]\n\
                   participant = \"worker\"\nmaterial = \"BRDF\"\nmethod = \"model\"\nscore = \"answer\"\n";
        write("e.toml", map);
        let opinions = StudyOpinions::load_raw(&dir.path().join("e.toml")).unwrap();
        assert!(opinions.stimuli[0].is_reference() && opinions.stimuli[1].method == "SGD");
        assert_eq!((opinions.name.as_str(), opinions.files[0].name.as_str()), ("e.csv", "e.csv"));
        let broken = |text: &str| {
            write("b.toml", text);
            StudyOpinions::load_raw(&dir.path().join("b.toml")).unwrap_err().to_string()
        };
        assert!(broken("delimiter = \";\"\n").contains("b.toml: `file` is missing"));
        assert!(
            broken("file = \"e.csv\"\n[columns]\nrater = \"w\"\n")
                .contains("columns: a key is `rater`; it must be one of part")
        );
        assert!(broken("file = \"e.csv\"\ndelimiter = \"§\"\n").contains("delimiter is `§`; it must be one ASCII"));
        let message = broken(&map.replace("answer", "score"));
        assert!(
            message
                .contains("e.csv, line 1: column `score` is missing; it must be given; the columns are worker, BRDF"),
            "{message}"
        );
    }

    #[test]
    fn a_layout_declares_the_scale() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
        write("r.csv", &format!("{HEAD}\np,m,A,40\nq,m,A,20\n"));
        let read = |toml: &str, scale: Option<&str>| {
            write("r.toml", &format!("file = \"r.csv\"\n{toml}\n"));
            let scale = scale.map(|s| s.parse().unwrap());
            StudyOpinions::load_raw_on(&dir.path().join("r.toml"), scale).map_err(|e| e.to_string())
        };
        for (toml, scale) in [
            ("scale = {worst = 0, best = 100}", None),
            ("scale = [0, 100]", None),
            ("", Some("worst=0,best=100")),
            ("scale = [0, 100]", Some("worst=0,best=100")),
        ] {
            assert_eq!(read(toml, scale).unwrap().scale, RatingScale::new(0.0, 100.0).unwrap(), "{toml}");
        }
        let message = read("", None).unwrap_err();
        assert!(
            message.contains("score is `40`; it must be 1 (very poor) to 5 (excellent); if the study uses another"),
            "{message}"
        );
        assert!(message.contains("--scale worst=0,best=100"), "{message}");
        let message = read("scale = [0, 100]", Some("dmos")).unwrap_err();
        assert!(message.contains("r.toml: it declares the scale worst=0,best=100, and --scale is dmos"), "{message}");
        assert!(read("scale = 100", None).unwrap_err().contains("such as {worst = 0, best = 100}"));
    }

    #[test]
    fn every_error_names_file_line_field_found_and_allowed() {
        for (text, expected) in [
            (
                "participant,material,score\n".into(),
                "line 1: column `method` is missing; it must be given; the columns are participant,",
            ),
            (format!("{HEAD},mood\n"), "line 1: a column is `mood`; it must be one of participant, material, method"),
            (format!("{HEAD},score\n"), "line 1: column `score` is given twice"),
            (format!("{HEAD}\na,m,S,3\na,m\n"), "line 3: the number of fields is 2; it must be 4"),
            (format!("{HEAD}\na,m,S,6\n"), "line 2: score is `6`; it must be 1 (very poor) to 5"),
            (format!("{HEAD}\na,m,S,NaN\n"), "line 2: score is `NaN`"),
            (format!("{HEAD}\na,,S,3\n"), "line 2: material is empty"),
            (
                format!("{HEAD}\na,m,S,3\nb,m,S,3\n\na,m,S,4\n"),
                "line 5: the row is a second score of a for m, S; it must be the only score",
            ),
            (format!("{HEAD},seconds\na,m,S,3,-1\n"), "line 2: seconds is `-1`"),
            (format!("{HEAD},gold\na,m,S,3,9\n"), "line 2: gold is `9`; it must be 1"),
            (
                format!("{HEAD},group\na,m,S,3,g\nb,m,S,3,h\n"),
                "line 3: group is `h`; it must be `g`, as for material m",
            ),
            (format!("{HEAD},illumination\na,m,S,3,x\nb,m,S,3,\n"), "line 3: illumination is empty; it must be filled"),
        ] {
            let message = read(&text, &RawLayout::default()).err().map(|e| e.to_string()).unwrap_or_default();
            assert!(message.starts_with(&format!("r.csv, {expected}")), "{message}");
        }
        let refused = |text: String| read(&text, &RawLayout::default()).unwrap_err().to_string();
        let message = refused(format!("{HEAD}\na,m,S,3\na,n,S,3\n"));
        assert_eq!(message, "r.csv: all scores are of one participant, a; there must be at least 2");
        assert!(refused(format!("{HEAD},gold\na,m,S,3,3\n")).contains("no judgement of a stimulus"));
    }
}
