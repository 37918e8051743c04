//! The two files of ratings of Lavoue et al. 2021 (doi:10.1111/cgf.142636), semicolons between fields.
//!
//! * `PerceptualDistances.csv`: `"METHOD";"BRDF";"DISTANCE"`, one row a rated pair, grade = 5 - 4 DISTANCE;
//! * `MaterialType.csv`: `BRDF;Type`, `Dielectric` or `Metal`.

use super::DatasetError;
use super::csv_table::{csv_error, line_of};
use super::error::field;
use super::manifest::{RatedManifest, matches_pattern};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// One row of the ratings.
#[derive(Debug, Clone, PartialEq)]
pub struct Rating {
    pub method: String,
    pub material: String,
    /// Mean opinion score as a grade, 1 to 5.
    pub mos: f64,
}

/// A line of a file and its fields.
struct Line {
    number: u64,
    fields: Vec<String>,
}

fn read_lines(path: &Path, bytes: &[u8], header: &[&str]) -> Result<Vec<Line>, DatasetError> {
    let mut reader = csv::ReaderBuilder::new().delimiter(b';').has_headers(false).flexible(true).from_reader(bytes);
    let mut lines = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| csv_error(path, &e))?;
        let number = line_of(bytes, &record);
        lines.push(Line { number, fields: record.iter().map(|f| f.trim().to_owned()).collect() });
    }
    let found = lines.first().map(|l| l.fields.join(";")).unwrap_or_default();
    if found != header.join(";") {
        return Err(field(path, 1, "the header", format!("`{found}`"), header.join(";")));
    }
    let rows = lines.split_off(1);
    match rows.iter().find(|l| l.fields.len() != header.len()) {
        Some(l) => {
            Err(field(path, l.number, "the number of fields", l.fields.len().to_string(), header.len().to_string()))
        }
        None => Ok(rows),
    }
}

/// Reads the ratings. Methods must be the manifest's, distances in 0..=1, and no pair is rated twice.
pub fn read_ratings(path: &Path, bytes: &[u8], manifest: &RatedManifest) -> Result<Vec<Rating>, DatasetError> {
    let mut seen = BTreeSet::new();
    let mut ratings = Vec::new();
    for line in read_lines(path, bytes, &["METHOD", "BRDF", "DISTANCE"])? {
        let [method, material, distance] = &line.fields[..] else { continue };
        let bad = |name, found: &str, allowed| Err(field(path, line.number, name, format!("`{found}`"), allowed));
        if manifest.method(method).is_none() {
            let names: Vec<&str> = manifest.methods.iter().map(|m| m.name.as_str()).collect();
            return bad("METHOD", method, format!("one of {}", names.join(", ")));
        }
        if material.is_empty() {
            return bad("BRDF", material, "the name of a material".into());
        }
        let d = match distance.parse::<f64>() {
            Ok(d) if (0.0..=1.0).contains(&d) => d,
            _ => return bad("DISTANCE", distance, "0 to 1".into()),
        };
        if !seen.insert((method.clone(), material.clone())) {
            return bad("the pair", &format!("{method};{material}"), "rated in one row".into());
        }
        ratings.push(Rating { method: method.clone(), material: material.clone(), mos: 5.0 - 4.0 * d });
    }
    Ok(ratings)
}

/// Reads which material is a dielectric and which a metal, by name.
pub fn read_types(
    path: &Path,
    bytes: &[u8],
    manifest: &RatedManifest,
) -> Result<BTreeMap<String, String>, DatasetError> {
    let mut types = BTreeMap::new();
    for line in read_lines(path, bytes, &["BRDF", "Type"])? {
        let [material, kind] = &line.fields[..] else { continue };
        if manifest.ratings.ignored_types.iter().any(|p| matches_pattern(p, material)) {
            continue;
        }
        if !["Dielectric", "Metal"].contains(&kind.as_str()) {
            return Err(field(path, line.number, "Type", format!("`{kind}`"), "Dielectric or Metal".into()));
        }
        types.insert(material.clone(), kind.clone());
    }
    Ok(types)
}

#[cfg(test)]
mod tests {
    use super::super::manifest::Manifest;
    use super::*;

    fn ratings(text: &str) -> Result<Vec<Rating>, DatasetError> {
        let manifest = Manifest::embedded("lavoue2021")?;
        read_ratings(Path::new("r.csv"), text.as_bytes(), &manifest.rated)
    }

    #[test]
    fn distance_becomes_mos() {
        let text = "\"METHOD\";\"BRDF\";\"DISTANCE\"\r\n\"SGD\";\"teflon\";0.25\r\n\"ABC\";\"teflon\";1\r\n";
        let mos: Vec<f64> = ratings(text).unwrap().iter().map(|r| r.mos).collect();
        assert_eq!(mos, [4.0, 1.0]);
    }

    #[test]
    fn a_bad_row_is_named_by_its_line() {
        let head = "METHOD;BRDF;DISTANCE\n";
        for (rows, line, what) in [
            ("SGD;teflon;0.5\nSGD;nylon;1.5\n", 3, "DISTANCE is `1.5`; it must be 0 to 1"),
            ("SGD;teflon;NaN\n", 2, "DISTANCE is `NaN`"),
            ("SGDD;teflon;0.5\n", 2, "METHOD is `SGDD`"),
            ("SGD;teflon\n", 2, "the number of fields is 2; it must be 3"),
            ("SGD;teflon;0\nABC;teflon;0\nSGD;teflon;0\n", 4, "the pair is `SGD;teflon`"),
        ] {
            let message = ratings(&format!("{head}{rows}")).unwrap_err().to_string();
            assert!(message.starts_with(&format!("r.csv, line {line}: {what}")), "{message}");
        }
        assert!(ratings("METHOD,BRDF,DISTANCE\n").unwrap_err().to_string().contains("the header"));
    }

    #[test]
    fn rows_that_are_no_material_are_ignored() {
        let manifest = Manifest::embedded("lavoue2021").unwrap();
        let text = "BRDF;Type\nteflon;Dielectric\nsteel_ntheta=64;Metal\nmerl_new_metal_001;CMetal\nsteel;Metal\n";
        let types = read_types(Path::new("t.csv"), text.as_bytes(), &manifest.rated).unwrap();
        assert_eq!(types.len(), 2);
        assert_eq!(types["steel"], "Metal");
    }
}
