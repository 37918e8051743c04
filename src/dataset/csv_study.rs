//! A study that a user writes: a CSV file with one row a rated pair.
//!
//! Columns, by name and in any order: `reference`, `candidate` (sources in the notation of every command) and `mos`
//! (1 to 5); optional `weight` (default 1), `material` (default: the reference as written), `group` (default: the
//! material), `method` (default `unnamed`), `method_family` (default: the method) and `material_type`.

use super::{Completeness, DatasetError, RatedPair, Study, StudyFile};
use crate::brdf::{BrdfSource, ContentHash};
use std::collections::BTreeMap;
use std::path::Path;

const REQUIRED: [&str; 3] = ["reference", "candidate", "mos"];
const OPTIONAL: [&str; 6] = ["weight", "material", "group", "method", "method_family", "material_type"];

/// Loads the study in the file at `path`. Relative sources start from `base`, or from the file's folder without one.
pub fn load(path: &Path, base: Option<&Path>) -> Result<Study, DatasetError> {
    let unreadable = |e: std::io::Error| DatasetError::Unreadable { path: path.into(), reason: e.to_string() };
    let bytes = std::fs::read(path).map_err(unreadable)?;
    let base = base.or_else(|| path.parent()).unwrap_or(Path::new(""));
    let pairs = parse(path, &bytes, base)?;
    let name = path.file_stem().map_or_else(|| "study".into(), |s| s.to_string_lossy().into_owned());
    if pairs.is_empty() {
        return Err(DatasetError::NoPairs { study: name, reason: format!("{} has no row", path.display()) });
    }
    let file = StudyFile { path: path.into(), content: ContentHash::of(&bytes), as_published: None };
    let completeness = Completeness { found: pairs.len(), known: pairs.len() };
    Ok(Study { name, synthetic: false, completeness, files: vec![file], pairs })
}

fn parse(path: &Path, bytes: &[u8], base: &Path) -> Result<Vec<RatedPair>, DatasetError> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(bytes);
    let header = reader.headers().map_err(|e| csv_error(path, &e))?.clone();
    let columns = check_header(path, &header)?;
    let mut pairs: Vec<RatedPair> = Vec::new();
    let mut groups: BTreeMap<String, (String, u64)> = BTreeMap::new();
    for record in reader.records() {
        let record = record.map_err(|e| csv_error(path, &e))?;
        let line = line_of(bytes, &record);
        if record.len() != header.len() {
            let (found, allowed) = (record.len().to_string(), format!("{} as in the header", header.len()));
            return Err(field(path, line, "the number of fields", found, allowed));
        }
        let cell = |name: &str| columns.get(name).and_then(|&i| record.get(i)).unwrap_or("");
        let pair = parse_row(path, line, &cell, base)?;
        let (group, first) = groups.entry(pair.material.clone()).or_insert_with(|| (pair.group.clone(), line));
        if *group != pair.group {
            let allowed = format!("`{group}`, the group of material {} on line {first}", pair.material);
            return Err(field(path, line, "group", format!("`{}`", pair.group), allowed));
        }
        pairs.push(pair);
    }
    Ok(pairs)
}

fn check_header(path: &Path, header: &csv::StringRecord) -> Result<BTreeMap<String, usize>, DatasetError> {
    let allowed = || format!("{}, and optionally {}", REQUIRED.join(", "), OPTIONAL.join(", "));
    let mut columns = BTreeMap::new();
    for (i, name) in header.iter().enumerate() {
        if !REQUIRED.contains(&name) && !OPTIONAL.contains(&name) {
            return Err(field(path, 1, "a column", format!("`{name}`"), allowed()));
        }
        if columns.insert(name.to_owned(), i).is_some() {
            return Err(field(path, 1, "a column", format!("`{name}` twice"), "each column once".into()));
        }
    }
    match REQUIRED.iter().find(|name| !columns.contains_key(**name)) {
        Some(name) => Err(field(path, 1, &format!("column `{name}`"), "missing".into(), allowed())),
        None => Ok(columns),
    }
}

fn parse_row<'a>(
    path: &Path,
    line: u64,
    cell: &impl Fn(&str) -> &'a str,
    base: &Path,
) -> Result<RatedPair, DatasetError> {
    let or = |name: &str, default: &str| if cell(name).is_empty() { default.to_owned() } else { cell(name).to_owned() };
    for name in REQUIRED {
        if cell(name).is_empty() {
            return Err(field(path, line, name, "empty".into(), "a value in every row".into()));
        }
    }
    let number = |name: &str, text: &str, ok: &dyn Fn(f64) -> bool, allowed: &str| match text.parse::<f64>() {
        Ok(x) if ok(x) => Ok(x),
        _ => Err(field(path, line, name, format!("`{text}`"), allowed.into())),
    };
    let mos = number("mos", cell("mos"), &|x| (1.0..=5.0).contains(&x), "1 (very poor) to 5 (excellent)")?;
    let weight = number("weight", &or("weight", "1"), &|x| x > 0.0 && x.is_finite(), "a finite number greater than 0")?;
    let material = or("material", cell("reference"));
    let method = or("method", "unnamed");
    Ok(RatedPair {
        reference: BrdfSource::Notation(resolve(base, cell("reference"))),
        candidate: BrdfSource::Notation(resolve(base, cell("candidate"))),
        group: or("group", &material),
        material,
        method_family: or("method_family", &method),
        method,
        material_type: Some(cell("material_type")).filter(|t| !t.is_empty()).map(str::to_owned),
        mos,
        weight,
    })
}

/// A source written relative to `base`; models written out as JSON and absolute paths stay as they are.
fn resolve(base: &Path, source: &str) -> String {
    if source.starts_with('{') { source.to_owned() } else { base.join(source).to_string_lossy().into_owned() }
}

fn field(path: &Path, line: u64, field: &str, found: String, allowed: String) -> DatasetError {
    DatasetError::Field { path: path.into(), line, field: field.into(), found, allowed }
}

/// The line on which a record of `bytes` begins: the reader counts from where it was left, before any blank lines.
pub fn line_of(bytes: &[u8], record: &csv::StringRecord) -> u64 {
    let Some(position) = record.position() else { return 0 };
    let rest = bytes.get(position.byte() as usize..).unwrap_or_default();
    let blank = rest.iter().take_while(|b| matches!(b, b'\r' | b'\n'));
    position.line() + blank.filter(|b| **b == b'\n').count() as u64
}

/// What the reader of CSV says, with the line.
pub fn csv_error(path: &Path, error: &csv::Error) -> DatasetError {
    match error.kind() {
        csv::ErrorKind::Utf8 { pos, .. } => {
            let line = pos.as_ref().map_or(0, |p| p.line());
            field(path, line, "a field", "not UTF-8".into(), "text in UTF-8".into())
        }
        _ => DatasetError::Unreadable { path: path.into(), reason: error.to_string() },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse_text(text: &str) -> Result<Vec<RatedPair>, DatasetError> {
        parse(Path::new("s.csv"), text.as_bytes(), Path::new("base"))
    }

    #[test]
    fn defaults_follow_from_what_is_written() {
        let pairs = parse_text("mos,candidate,reference\n4.5, a.titopo ,lib.zip:teflon\n").unwrap();
        let p = &pairs[0];
        assert_eq!((p.mos, p.weight), (4.5, 1.0));
        assert_eq!([&p.material, &p.group], ["lib.zip:teflon"; 2]);
        assert_eq!([&p.method, &p.method_family], ["unnamed"; 2]);
        assert_eq!(p.material_type, None);
        let BrdfSource::Notation(candidate) = &p.candidate else { panic!("a CSV holds notations") };
        assert_eq!(Path::new(candidate), Path::new("base").join("a.titopo"));
    }

    #[test]
    fn a_model_and_an_absolute_path_are_kept() {
        let text = "reference,candidate,mos\n/x/a.binary,\"{\"\"model\"\":\"\"lambert\"\"}\",2\n";
        let pairs = parse_text(text).unwrap();
        let notation = |s: &BrdfSource| match s {
            BrdfSource::Notation(n) => n.clone(),
            BrdfSource::Generated(_) => panic!("a CSV holds notations"),
        };
        assert_eq!(notation(&pairs[0].reference), "/x/a.binary");
        assert_eq!(notation(&pairs[0].candidate), "{\"model\":\"lambert\"}");
    }

    #[test]
    fn every_error_names_file_line_field_found_and_allowed() {
        for (text, expected) in [
            ("reference,candidate\n", "s.csv: line 1: column `mos` is missing; allowed: reference, candidate, mos"),
            ("reference,candidate,mos,mood\n", "s.csv: line 1: a column is `mood`; allowed: reference"),
            ("reference,candidate,mos,mos\n", "s.csv: line 1: a column is `mos` twice"),
            ("reference,candidate,mos\na,b,3\na,b\n", "s.csv: line 3: the number of fields is 2; allowed: 3"),
            ("reference,candidate,mos\na,,3\n", "s.csv: line 2: candidate is empty"),
            ("reference,candidate,mos\na,b,5.5\n", "s.csv: line 2: mos is `5.5`; allowed: 1 (very poor)"),
            ("reference,candidate,mos\n\na,b,x\n", "s.csv: line 3: mos is `x`"),
            ("reference,candidate,mos,weight\na,b,3,0\n", "s.csv: line 2: weight is `0`"),
            ("reference,candidate,mos,weight\na,b,3,inf\n", "s.csv: line 2: weight is `inf`"),
            ("reference,candidate,mos,group\na,b,3,g\na,c,3,h\n", "s.csv: line 3: group is `h`; allowed: `g`"),
        ] {
            let message = parse_text(text).err().map(|e| e.to_string()).unwrap_or_default();
            assert!(message.starts_with(expected), "{message}");
        }
        let message = parse(Path::new("s.csv"), b"reference,candidate,mos\na,\xff,3\n", Path::new("")).err();
        assert!(message.map(|e| e.to_string()).unwrap_or_default().contains("line 2: a field is not UTF-8"));
    }
}
