//! A study that a user writes: a CSV file with one row a rated pair.
//!
//! Columns, by name and in any order: `reference`, `candidate` (sources in the notation of every command; relative
//! paths start beside the file, else where every command looks) and `mos` (1 to 5); optional `weight` (default 1),
//! `material` (default: the reference as written), `group` (default: the material), `method` (default `unnamed`),
//! `method_family` (default: the method) and `material_type`.

use super::csv_table::{CsvTable, MOST_BYTES};
use super::error::field;
use super::{Completeness, DatasetError, RatedPair, Study, StudyFile};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use vernis_metric::brdf::{BrdfSource, ContentHash};
use vernis_metric::io::read_at_most;

const REQUIRED: [&str; 3] = ["reference", "candidate", "mos"];
const OPTIONAL: [&str; 6] = ["weight", "material", "group", "method", "method_family", "material_type"];

/// Loads the study in the file at `path`.
pub fn load(path: &Path) -> Result<Study, DatasetError> {
    let unreadable = |e: std::io::Error| DatasetError::Unreadable { path: path.into(), reason: e.to_string() };
    let bytes = read_at_most(path, MOST_BYTES).map_err(unreadable)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let pairs = parse(path, &bytes, folder)?;
    let file_name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let name = study_name(&file_name);
    if pairs.is_empty() {
        return Err(DatasetError::NoPairs { study: name, reason: format!("{} has no row", path.display()) });
    }
    let file = StudyFile { name: file_name, content: ContentHash::of(&bytes), as_published: None };
    let completeness = Completeness { found: pairs.len(), known: pairs.len() };
    Ok(Study { name, synthetic: false, completeness, files: vec![file], pairs })
}

/// The name of its file, ending included, so that no file is taken for a study that vernis knows by that name: a file without an
/// ending that is called like one has `./` before it.
fn study_name(file: &str) -> String {
    if Study::known().contains(&file) { format!("./{file}") } else { file.to_owned() }
}

fn parse(path: &Path, bytes: &[u8], folder: &Path) -> Result<Vec<RatedPair>, DatasetError> {
    let mut table = CsvTable::new(path, bytes, b',')?;
    let columns = check_header(path, table.header())?;
    let mut pairs: Vec<RatedPair> = Vec::new();
    let mut groups: BTreeMap<String, (String, u64)> = BTreeMap::new();
    let mut seen = BTreeSet::new();
    while let Some((line, record)) = table.next_row()? {
        if let Some(i) = record.iter().position(|f| f.contains(|c: char| c.is_control() && c != '\t')) {
            let allowed = "text in one line; is a quotation mark missing?".into();
            return Err(field(path, line, &table.header()[i], format!("`{}`", &record[i]), allowed));
        }
        let cell = |name: &str| columns.get(name).and_then(|&i| record.get(i)).unwrap_or("");
        let pair = parse_row(path, line, &cell, folder)?;
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
    Ok(pairs)
}

fn check_header(path: &Path, header: &csv::StringRecord) -> Result<BTreeMap<String, usize>, DatasetError> {
    let columns_allowed = || format!("{}, and optionally {}", REQUIRED.join(", "), OPTIONAL.join(", "));
    let mut columns = BTreeMap::new();
    for (i, name) in header.iter().enumerate() {
        if !REQUIRED.contains(&name) && !OPTIONAL.contains(&name) {
            return Err(field(path, 1, "a column", format!("`{name}`"), format!("one of {}", columns_allowed())));
        }
        if columns.insert(name.to_owned(), i).is_some() {
            return Err(field(path, 1, &format!("column `{name}`"), "given twice".into(), "given once".into()));
        }
    }
    match REQUIRED.iter().find(|name| !columns.contains_key(**name)) {
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
) -> Result<RatedPair, DatasetError> {
    let or = |name: &str, default: &str| if cell(name).is_empty() { default.to_owned() } else { cell(name).to_owned() };
    for name in REQUIRED {
        if cell(name).is_empty() {
            return Err(field(path, line, name, "empty".into(), "filled in every row".into()));
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

/// A checked source, with its path beside the study file where that exists. Other relative paths stay as written, and
/// are looked for when they are opened, as every command looks for them.
fn source(path: &Path, line: u64, column: &'static str, text: &str, folder: &Path) -> Result<BrdfSource, DatasetError> {
    let beside = folder.join(text).to_string_lossy().into_owned();
    let place = beside.split('?').next().unwrap_or(&beside);
    let collection = place.rsplit_once(':').map_or(place, |(collection, _)| collection);
    let is_beside = Path::new(place).is_file() || Path::new(collection).is_file();
    let notation = if is_beside { &beside } else { text };
    BrdfSource::parse(notation).map_err(|cause| DatasetError::Source {
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
        parse(Path::new("s.csv"), text.as_bytes(), Path::new("nowhere"))
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
        let pairs = parse(&dir.path().join("s.csv"), text.as_bytes(), dir.path()).unwrap();
        let beside = |s: &str| dir.path().join(s).to_string_lossy().into_owned();
        assert_eq!(notation(&pairs[0].reference), beside("y.titopo"));
        assert_eq!(notation(&pairs[0].candidate), beside("x.fit:teflon?eta=2.5"));
        assert_eq!(notation(&pairs[1].reference), "z.binary");
        assert_eq!(notation(&pairs[1].candidate), beside("x.fit:nylon"));
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
        let message = parse(Path::new("s.csv"), b"reference,candidate,mos\na,\xff,3\n", Path::new("")).err();
        assert!(message.map(|e| e.to_string()).unwrap_or_default().contains("line 2: a field is not UTF-8"));
    }
}
