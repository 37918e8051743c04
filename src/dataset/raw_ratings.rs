//! Raw ratings in long form: a CSV file with one row a judgement.
//!
//! Columns, by name and in any order: `participant`, `material`, `method` (the two name the pair; `REFERENCE` is the
//! reference shown as a candidate) and `score` (1 to 5); optional `illumination`, `seconds` (time to answer), `gold`
//! (the expected score of a control question, empty for every other row), `group` and `material_type`.
//! [`RawLayout`] maps other columns to these.

use super::csv_study::{csv_error, line_of};
use super::opinions::{REFERENCE, Scores, Stimulus, StudyOpinions};
use super::raw_layout::RawLayout;
use super::{Completeness, DatasetError, StudyFile};
use crate::brdf::ContentHash;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

pub(super) const REQUIRED: [&str; 4] = ["participant", "material", "method", "score"];
pub(super) const OPTIONAL: [&str; 5] = ["illumination", "seconds", "gold", "group", "material_type"];

/// One score.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judgement {
    /// Index of the participant.
    pub participant: usize,
    /// Index of the stimulus.
    pub stimulus: usize,
    /// 1 (very poor) to 5 (excellent).
    pub score: f64,
    /// Time to answer.
    pub seconds: Option<f64>,
}

/// The answer to a control question whose score is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GoldAnswer {
    /// Index of the participant.
    pub participant: usize,
    pub score: f64,
    pub expected: f64,
    /// Time to answer.
    pub seconds: Option<f64>,
}

/// Who said what. No participant judges a stimulus twice.
#[derive(Debug, Clone, PartialEq)]
pub struct RawRatings {
    pub participants: Vec<String>,
    pub judgements: Vec<Judgement>,
    /// Answers to control questions, which are no part of any mean.
    pub gold: Vec<GoldAnswer>,
}

/// Loads the raw ratings in the file at `path`.
///
/// # Errors
/// A file that cannot be read, a missing, repeated or unknown column, a score outside 1 to 5, a judgement that is
/// there twice, a material in two groups or of two types, no judgement, or a single participant.
pub fn load(path: &Path, layout: &RawLayout) -> Result<StudyOpinions, DatasetError> {
    let unreadable = |e: std::io::Error| DatasetError::Unreadable { path: path.into(), reason: e.to_string() };
    let bytes = std::fs::read(path).map_err(unreadable)?;
    let (stimuli, raw) = parse(path, &bytes, layout)?;
    let file_name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let file = StudyFile { name: file_name, content: ContentHash::of(&bytes), as_published: None };
    Ok(StudyOpinions {
        name: path.file_stem().map_or_else(|| "ratings".into(), |s| s.to_string_lossy().into_owned()),
        synthetic: false,
        completeness: Completeness { found: stimuli.len(), known: stimuli.len() },
        files: vec![file],
        stimuli,
        scores: Scores::Raw(raw),
    })
}

fn parse(path: &Path, bytes: &[u8], layout: &RawLayout) -> Result<(Vec<Stimulus>, RawRatings), DatasetError> {
    let delimiter = u8::try_from(layout.delimiter).unwrap_or(b',');
    let mut reader =
        csv::ReaderBuilder::new().delimiter(delimiter).trim(csv::Trim::All).flexible(true).from_reader(bytes);
    let header = reader.headers().map_err(|e| csv_error(path, &e))?.clone();
    let columns = check_header(path, &header, layout)?;
    let mut rows = Rows::new(path, layout);
    for record in reader.records() {
        let record = record.map_err(|e| csv_error(path, &e))?;
        let line = line_of(bytes, &record);
        if record.len() != header.len() {
            let (found, allowed) = (record.len().to_string(), format!("{} as in the header", header.len()));
            return Err(field(path, line, "the number of fields", found, allowed));
        }
        rows.add(line, &|name: &str| columns.get(name).and_then(|&i| record.get(i)).unwrap_or(""))?;
    }
    rows.finish()
}

fn check_header(
    path: &Path,
    header: &csv::StringRecord,
    layout: &RawLayout,
) -> Result<BTreeMap<&'static str, usize>, DatasetError> {
    let allowed = || {
        let of = |names: &[&str]| names.iter().map(|n| layout.column(n).to_owned()).collect::<Vec<_>>().join(", ");
        format!("{}, and optionally {}", of(&REQUIRED), of(&OPTIONAL))
    };
    let mut columns = BTreeMap::new();
    for (i, found) in header.iter().enumerate() {
        let Some(name) = REQUIRED.into_iter().chain(OPTIONAL).find(|name| layout.column(name) == found) else {
            if layout.ignore_others {
                continue;
            }
            return Err(field(path, 1, "a column", format!("`{found}`"), allowed()));
        };
        if columns.insert(name, i).is_some() {
            return Err(field(path, 1, "a column", format!("`{found}` twice"), "each column once".into()));
        }
    }
    let optional = OPTIONAL.iter().filter(|name| layout.columns.contains_key(**name));
    match REQUIRED.iter().chain(optional).find(|name| !columns.contains_key(**name)) {
        Some(name) => Err(field(path, 1, &format!("column `{}`", layout.column(name)), "missing".into(), allowed())),
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
            return Err(self.wrong(line, name, "empty".into(), "a value in every row".into()));
        }
        let score = self.score(line, "score", cell("score"))?;
        let next = self.participants.len();
        let participant = *self.participants.entry(cell("participant").to_owned()).or_insert(next);
        let seconds = match cell("seconds") {
            "" => None,
            text => Some(text.parse::<f64>().ok().filter(|s| *s >= 0.0 && s.is_finite()).ok_or_else(|| {
                self.wrong(line, "seconds", format!("`{text}`"), "a finite number of at least 0, or nothing".into())
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
            return Err(self.wrong(line, "the row", found, "one score a participant and stimulus".into()));
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
                let allowed = format!("`{}`, that of material {material} on line {first_line}", first[i]);
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
            return Err(self.wrong(line, "illumination", found, "a value in every row, or in none".into()));
        }
        let next = self.listed.len();
        let index = *self.stimuli.entry([material.clone(), method.clone(), illumination.clone()]).or_insert(next);
        if index == next {
            let [group, material_type] = stated.map(|s| Some(s).filter(|s| !s.is_empty()));
            let group = group.unwrap_or_else(|| material.clone());
            let illumination = Some(illumination).filter(|i| !i.is_empty());
            self.listed.push(Stimulus { material, method, illumination, group, material_type });
        }
        Ok(index)
    }

    fn score(&self, line: u64, name: &str, text: &str) -> Result<f64, DatasetError> {
        let score = text.parse::<f64>().ok().filter(|s| (1.0..=5.0).contains(s));
        score.ok_or_else(|| self.wrong(line, name, format!("`{text}`"), "1 (very poor) to 5 (excellent)".into()))
    }

    fn wrong(&self, line: u64, name: &str, found: String, allowed: String) -> DatasetError {
        field(self.path, line, self.layout.column(name), found, allowed)
    }

    fn finish(self) -> Result<(Vec<Stimulus>, RawRatings), DatasetError> {
        let few = |reason: String| DatasetError::Unreadable { path: self.path.into(), reason };
        if self.judgements.is_empty() {
            return Err(few("it has no judgement of a stimulus; allowed: at least 1".into()));
        }
        if self.participants.len() < 2 {
            let only = self.participants.keys().next().map_or("", String::as_str);
            return Err(few(format!("all scores are of one participant, {only}; allowed: at least 2")));
        }
        let mut participants = vec![String::new(); self.participants.len()];
        for (name, index) in self.participants {
            participants[index] = name;
        }
        Ok((self.listed, RawRatings { participants, judgements: self.judgements, gold: self.gold }))
    }
}

fn field(path: &Path, line: u64, field: &str, found: String, allowed: String) -> DatasetError {
    DatasetError::Field { path: path.into(), line, field: field.into(), found, allowed }
}
