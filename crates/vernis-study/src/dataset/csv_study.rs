//! A study that a user writes: a CSV file with one row a rated pair.
//!
//! Columns, by name and in any order: `reference`, `candidate` (sources in the notation of every command; relative
//! paths by the rule of [`source_beside`]) and `mos` (1 to 5, or on the scale that is declared; `jod` and `dmos` declare
//! theirs by their names); optional `weight` (default 1), `material` (default: the reference as written), `group` (default: the
//! material), `method` (default `unnamed`),
//! `method_family` (default: the method) and `material_type`.

use super::csv_table::{CsvTable, Expected, MOST_BYTES, Others};
use super::error::field;
use super::scale::HOW_TO_DECLARE;
use super::{Completeness, DatasetError, DeclaredScale, Identical, RatedPair, Study, StudyFile};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use vernis_metric::brdf::{BrdfError, BrdfSource, ContentHash};
use vernis_metric::io::read_at_most;
use vernis_metric::math::rating_scale::RatingScale;

const REQUIRED: [&str; 3] = ["reference", "candidate", "mos"];
const OPTIONAL: [&str; 6] = ["weight", "material", "group", "method", "method_family", "material_type"];

/// Columns that hold the ratings, of which a file has one, and the scale that each stands for where none is declared.
const RATINGS: [(&str, DeclaredScale); 3] =
    [("mos", DeclaredScale::MOS), ("jod", DeclaredScale::JOD), ("dmos", DeclaredScale::DMOS)];

/// Loads the study in the file at `path`, whose ratings are on `scale`.
pub fn load(path: &Path, scale: Option<DeclaredScale>) -> Result<Study, DatasetError> {
    let unreadable = |e: std::io::Error| DatasetError::Unreadable { path: path.into(), reason: e.to_string() };
    let bytes = read_at_most(path, MOST_BYTES).map_err(unreadable)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let (pairs, scale) = parse(path, &bytes, folder, scale)?;
    let file_name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let name = study_name(&file_name);
    if pairs.is_empty() {
        return Err(DatasetError::NoPairs { study: name, reason: format!("{} has no row", path.display()) });
    }
    let file = StudyFile { name: file_name, content: ContentHash::of(&bytes), as_published: None };
    let completeness = Completeness { found: pairs.len(), known: pairs.len() };
    let identical = Identical::of_pairs(&pairs).unwrap_or_else(|| Identical::assumed(scale));
    Ok(Study { name, synthetic: false, completeness, scale, identical, files: vec![file], pairs })
}

/// The name of its file, ending included, so that no file is taken for a study that vernis knows by that name: a file without an
/// ending that is called like one has `./` before it.
fn study_name(file: &str) -> String {
    if Study::known().contains(&file) { format!("./{file}") } else { file.to_owned() }
}

/// The column of the ratings and their scale.
#[derive(Clone, Copy)]
struct Rated {
    column: &'static str,
    scale: DeclaredScale,
    declared: bool,
}

impl Rated {
    /// By the name of the column and what was declared.
    fn of(
        path: &Path,
        columns: &BTreeMap<String, usize>,
        declared: Option<DeclaredScale>,
    ) -> Result<Self, DatasetError> {
        let (column, by_name) = RATINGS.into_iter().find(|(name, _)| columns.contains_key(*name)).unwrap_or(RATINGS[0]);
        let scale = declared.unwrap_or(by_name);
        if column != "mos" && scale.larger_is_better() != by_name.larger_is_better() {
            let larger = if by_name.larger_is_better() { "better" } else { "worse" };
            let allowed = format!("on a scale where larger is {larger}, or be called mos");
            return Err(field(path, 1, &format!("column `{column}`"), format!("on the scale {scale}"), allowed));
        }
        Ok(Self { column, scale, declared: declared.is_some() || column != "mos" })
    }

    fn score(self, path: &Path, line: u64, text: &str) -> Result<f64, DatasetError> {
        let found = text.parse::<f64>().ok();
        if let Some(score) = found.filter(|&x| self.scale.contains(x)) {
            return Ok(score);
        }
        let mut allowed = self.scale.allowed();
        if !self.declared && found.is_some_and(f64::is_finite) {
            allowed += &format!("; {HOW_TO_DECLARE}");
        }
        Err(field(path, line, self.column, format!("`{text}`"), allowed))
    }
}

fn parse(
    path: &Path,
    bytes: &[u8],
    folder: &Path,
    declared: Option<DeclaredScale>,
) -> Result<(Vec<RatedPair>, RatingScale), DatasetError> {
    let known = [&REQUIRED[..], &OPTIONAL[..], &RATINGS.map(|(name, _)| name)[1..]].concat();
    let is_number = |name: &str| name == "weight" || RATINGS.iter().any(|(rating, _)| *rating == name);
    let expected =
        Expected { known: &known, is_number: &is_number, others: Others::Told, delimiter: None, usual: b',' };
    let table = CsvTable::read(path, bytes, &expected)?;
    let columns = check_header(path, table.header())?;
    let rated = Rated::of(path, &columns, declared)?;
    let mut pairs: Vec<RatedPair> = Vec::new();
    let mut groups: BTreeMap<String, (String, u64)> = BTreeMap::new();
    let mut seen = BTreeSet::new();
    for (line, record) in table.rows() {
        let line = *line;
        if let Some(i) = record.iter().position(|f| f.contains(|c: char| c.is_control() && c != '\t')) {
            let allowed = "text in one line; is a quotation mark missing?".into();
            return Err(field(path, line, &table.header()[i], format!("`{}`", &record[i]), allowed));
        }
        let cell = |name: &str| columns.get(name).and_then(|&i| record.get(i)).unwrap_or("");
        let pair = parse_row(path, line, &cell, folder, rated)?;
        let (group, first) = groups.entry(pair.material.clone()).or_insert_with(|| (pair.group.clone(), line));
        if *group != pair.group {
            let allowed = format!("`{group}`, the group of material {} on line {first}", pair.material);
            return Err(field(path, line, "group", format!("`{}`", pair.group), allowed));
        }
        if !seen.insert(["reference", "candidate", "material", "method"].map(|name| cell(name).to_owned())) {
            let found = format!("`{}`, `{}` again", cell("reference"), cell("candidate"));
            return Err(field(path, line, "the pair", found, "rated in one row per method".into()));
        }
        pairs.push(pair);
    }
    if pairs.is_empty() {
        return Ok((pairs, RatingScale::GRADES));
    }
    let scale = rated.scale.of_ratings(pairs.iter().map(|p| p.mos));
    let scale = scale.map_err(|reason| DatasetError::Unreadable { path: path.into(), reason })?;
    pairs.iter_mut().for_each(|p| p.mos = scale.grade(p.mos));
    Ok((pairs, scale))
}

fn check_header(path: &Path, header: &csv::StringRecord) -> Result<BTreeMap<String, usize>, DatasetError> {
    let columns_allowed = || format!("{}, and optionally {}", REQUIRED.join(", "), OPTIONAL.join(", "));
    let mut columns = BTreeMap::new();
    for (i, name) in header.iter().enumerate() {
        let rating = RATINGS.iter().any(|(rating, _)| *rating == name);
        if let Some((other, _)) =
            RATINGS.iter().find(|(other, _)| rating && columns.contains_key(*other) && *other != name)
        {
            let found = format!("beside `{other}`");
            return Err(field(path, 1, &format!("column `{name}`"), found, "the only column of ratings".into()));
        }
        // The reader of the table has told of other columns.
        if !REQUIRED.contains(&name) && !OPTIONAL.contains(&name) && !rating {
            continue;
        }
        if columns.insert(name.to_owned(), i).is_some() {
            return Err(field(path, 1, &format!("column `{name}`"), "given twice".into(), "given once".into()));
        }
    }
    let has = |name: &str| match name {
        "mos" => RATINGS.iter().any(|(rating, _)| columns.contains_key(*rating)),
        other => columns.contains_key(other),
    };
    match REQUIRED.iter().find(|name| !has(name)) {
        Some(name) => {
            let allowed = format!("given; the columns are {}", columns_allowed());
            Err(field(path, 1, &format!("column `{name}`"), "missing".into(), allowed))
        }
        None => Ok(columns),
    }
}

fn parse_row<'a>(
    path: &Path,
    line: u64,
    cell: &impl Fn(&str) -> &'a str,
    folder: &Path,
    rated: Rated,
) -> Result<RatedPair, DatasetError> {
    let or = |name: &str, default: &str| if cell(name).is_empty() { default.to_owned() } else { cell(name).to_owned() };
    for name in [REQUIRED[0], REQUIRED[1], rated.column] {
        if cell(name).is_empty() {
            return Err(field(path, line, name, "empty".into(), "filled in every row".into()));
        }
    }
    let number = |name: &str, text: &str, ok: &dyn Fn(f64) -> bool, allowed: &str| match text.parse::<f64>() {
        Ok(x) if ok(x) => Ok(x),
        _ => Err(field(path, line, name, format!("`{text}`"), allowed.into())),
    };
    let mos = rated.score(path, line, cell(rated.column))?;
    let weight = number("weight", &or("weight", "1"), &|x| x > 0.0 && x.is_finite(), "a finite number greater than 0")?;
    let material = or("material", cell("reference"));
    let method = or("method", "unnamed");
    Ok(RatedPair {
        reference: source(path, line, "reference", cell("reference"), folder)?,
        candidate: source(path, line, "candidate", cell("candidate"), folder)?,
        group: or("group", &material),
        material,
        method_family: or("method_family", &method),
        method,
        material_type: Some(cell("material_type")).filter(|t| !t.is_empty()).map(str::to_owned),
        mos,
        weight,
    })
}

/// A checked source of a table in `folder`: the one rule for relative paths in files. A path starts at the folder of the file
/// that names it, where that leads to a file; else it stays as written, and is looked for when it is opened as every command
/// looks for it: from the working directory, then in the data folder.
///
/// # Errors
/// A wrong notation.
pub fn source_beside(folder: &Path, notation: &str) -> Result<BrdfSource, BrdfError> {
    let beside = folder.join(notation).to_string_lossy().into_owned();
    let place = beside.split('?').next().unwrap_or(&beside);
    let collection = place.rsplit_once(':').map_or(place, |(collection, _)| collection);
    let is_beside = Path::new(place).is_file() || Path::new(collection).is_file();
    BrdfSource::parse(if is_beside { &beside } else { notation })
}

fn source(path: &Path, line: u64, column: &'static str, text: &str, folder: &Path) -> Result<BrdfSource, DatasetError> {
    source_beside(folder, text).map_err(|cause| DatasetError::Source {
        path: path.into(),
        line,
        column,
        cause: Box::new(cause),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse_text(text: &str) -> Result<Vec<RatedPair>, DatasetError> {
        Ok(parse(Path::new("s.csv"), text.as_bytes(), Path::new("nowhere"), None)?.0)
    }

    fn notation(source: &BrdfSource) -> &str {
        match source {
            BrdfSource::Notation(n) => n,
            _ => panic!("a CSV holds notations"),
        }
    }

    #[test]
    fn defaults_follow_from_what_is_written() {
        let pairs = parse_text("mos,candidate,reference\n4.5, a.titopo ,lib.zip:teflon\n").unwrap();
        let p = &pairs[0];
        assert_eq!((p.mos, p.weight), (4.5, 1.0));
        assert_eq!([&p.material, &p.group], ["lib.zip:teflon"; 2]);
        assert_eq!([&p.method, &p.method_family], ["unnamed"; 2]);
        assert_eq!(p.material_type, None);
        assert_eq!((notation(&p.reference), notation(&p.candidate)), ("lib.zip:teflon", "a.titopo"));
    }

    #[test]
    fn sources_beside_the_file_are_found_there() {
        let dir = tempfile::tempdir().unwrap();
        for file in ["x.fit", "y.titopo"] {
            std::fs::write(dir.path().join(file), "").unwrap();
        }
        let text = "reference,candidate,mos\ny.titopo,x.fit:teflon?eta=2.5,3\nz.binary,x.fit:nylon,3\n";
        let pairs = parse(&dir.path().join("s.csv"), text.as_bytes(), dir.path(), None).unwrap().0;
        let beside = |s: &str| dir.path().join(s).to_string_lossy().into_owned();
        assert_eq!(notation(&pairs[0].reference), beside("y.titopo"));
        assert_eq!(notation(&pairs[0].candidate), beside("x.fit:teflon?eta=2.5"));
        assert_eq!(notation(&pairs[1].reference), "z.binary");
        assert_eq!(notation(&pairs[1].candidate), beside("x.fit:nylon"));
    }

    #[test]
    fn ratings_become_grades_on_the_scale_that_is_declared() {
        let read = |text: &str, scale: Option<&str>| {
            let scale = scale.map(|s| s.parse().unwrap());
            let parsed = parse(Path::new("s.csv"), text.as_bytes(), Path::new("nowhere"), scale);
            parsed
                .map(|(pairs, scale)| (pairs.iter().map(|p| p.mos).collect::<Vec<_>>(), scale))
                .map_err(|e| e.to_string())
        };
        let rows = |column: &str, x: [f64; 2]| {
            format!("reference,candidate,{column}\na.binary,b.binary,{}\na.binary,c.binary,{}\n", x[0], x[1])
        };
        for (text, scale) in [
            (rows("mos", [2.0, 4.0]), None),
            (rows("mos", [25.0, 75.0]), Some("worst=0,best=100")),
            (rows("mos", [75.0, 25.0]), Some("worst=100,best=0")),
            (rows("dmos", [75.0, 25.0]), Some("worst=100,best=0")),
            (rows("dmos", [6.0, 2.0]), Some("worst=8,best=0")),
        ] {
            assert_eq!(read(&text, scale).unwrap().0, [2.0, 4.0], "{text}");
        }
        // What the name of the column says; open scales end at the worst rating, rounded outwards.
        let (grades, scale) = read(&rows("dmos", [7.1, 2.0]), None).unwrap();
        assert_eq!(
            (grades, scale.to_string()),
            (vec![1.4500000000000002, 4.0], "8 (worst rated) to 0 (best)".to_owned())
        );
        assert_eq!(read(&rows("jod", [6.0, 9.0]), None).unwrap().0, [1.0, 4.0]);
        assert_eq!(read(&rows("mos", [6.0, 9.0]), Some("jod")).unwrap().0, [1.0, 4.0]);
        for (text, scale, expected) in [
            (
                rows("mos", [82.0, 3.0]),
                None,
                "line 2: mos is `82`; it must be 1 (very poor) to 5 (excellent); if the study uses another scale, say so: --scale worst=0,best=100",
            ),
            (
                rows("mos", [82.0, 101.0]),
                Some("worst=0,best=100"),
                "line 3: mos is `101`; it must be 0 (worst) to 100 (best)",
            ),
            (rows("mos", [9.0, 10.5]), Some("jod"), "line 3: mos is `10.5`; it must be at most 10 (best)"),
            (rows("jod", [10.0, 10.0]), None, "all ratings are 10, the best of the scale"),
            (
                rows("dmos", [2.0, 4.0]),
                Some("mos"),
                "line 1: column `dmos` is on the scale mos; it must be on a scale where larger is worse",
            ),
            (
                "reference,candidate,mos,dmos\na.binary,b.binary,2,2\n".to_owned(),
                None,
                "line 1: column `dmos` is beside `mos`; it must be the only column of ratings",
            ),
        ] {
            let message = read(&text, scale).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn hidden_references_give_the_score_of_identical_brdfs() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.csv");
        let study = |rows: &str, scale: Option<&str>| {
            std::fs::write(&path, format!("reference,candidate,mos,method,weight\n{rows}")).unwrap();
            load(&path, scale.map(|s| s.parse().unwrap())).unwrap()
        };
        let found = study(
            "a.binary,b.binary,30,X,1\na.binary,a.binary,90,X,1\nc.binary,d.binary,80,REFERENCE,3\n",
            Some("worst=0,best=100"),
        );
        assert_eq!(found.scale.stated(found.identical.score), 82.5);
        assert_eq!(found.identical.basis, super::super::Basis::HiddenReferences { pairs: 2 });
        let assumed = study("a.binary,b.binary,30,X,1\n", Some("worst=100,best=0"));
        assert_eq!(assumed.scale.stated(assumed.identical.score), 12.5);
        let open = study("a.binary,b.binary,6,X,1\n", Some("jod"));
        assert_eq!(open.scale.score(open.identical.score), 10.0);
    }

    #[test]
    fn every_error_names_file_line_field_found_and_allowed() {
        let (a, b, c) = ("a.binary", "b.binary", "c.binary");
        let head = "reference,candidate,mos";
        for (text, expected) in [
            (
                "reference,candidate\n".into(),
                "line 1: column `mos` is missing; it must be given; the columns are reference, candidate, mos",
            ),
            (format!("{head},mood\n"), "line 1: a column is `mood`; it must be one of reference"),
            (format!("{head},mos\n"), "line 1: column `mos` is given twice"),
            (format!("{head}\n{a},{b},3\n{a},{b}\n"), "line 3: the number of fields is 2; it must be 3"),
            (format!("{head}\n{a},,3\n"), "line 2: candidate is empty"),
            (format!("{head}\n{a},{b},5.5\n"), "line 2: mos is `5.5`; it must be 1 (very poor)"),
            (format!("{head}\n\n{a},{b},x\n"), "line 3: mos is `x`"),
            (format!("{head},weight\n{a},{b},3,0\n"), "line 2: weight is `0`"),
            (format!("{head},weight\n{a},{b},3,inf\n"), "line 2: weight is `inf`"),
            (format!("{head},group\n{a},{b},3,g\n{a},{c},3,h\n"), "line 3: group is `h`; it must be `g`"),
            (format!("{head}\n{a},b.xyz,3\n"), "line 2: candidate: `b.xyz` is not a BRDF source"),
        ] {
            let message = parse_text(&text).err().map(|e| e.to_string()).unwrap_or_default();
            assert!(message.starts_with(&format!("s.csv, {expected}")), "{message}");
        }
        let message = parse(Path::new("s.csv"), b"reference,candidate,mos\na,\xff,3\n", Path::new(""), None).err();
        assert!(message.map(|e| e.to_string()).unwrap_or_default().contains("line 2: a field is not UTF-8"));
    }
}
