//! The two files of ratings of Lavoue et al. 2021 (doi:10.1111/cgf.142636), semicolons between fields as published.
//!
//! * `PerceptualDistances.csv`: `"METHOD";"BRDF";"DISTANCE"`, one row a rated pair, grade = 5 - 4 DISTANCE;
//! * `MaterialType.csv`: `BRDF;Type`, `Dielectric` or `Metal`.

use super::DatasetError;
use super::csv_table::{CsvTable, Expected, Others};
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

/// A line of a file and the fields of the columns that are read.
struct Line {
    number: u64,
    fields: Vec<String>,
}

fn read_lines(path: &Path, bytes: &[u8], columns: &[&str]) -> Result<Vec<Line>, DatasetError> {
    let is_number = |name: &str| name == "DISTANCE";
    let expected =
        Expected { known: columns, is_number: &is_number, others: Others::Told, delimiter: None, usual: b';' };
    let table = CsvTable::read(path, bytes, &expected)?;
    let place = |name: &&str| {
        table.column(path, name)?.ok_or_else(|| {
            let found = format!("`{}`", table.written().iter().collect::<Vec<_>>().join(";"));
            field(path, 1, "the header", found, format!("one with the columns {}", columns.join(";")))
        })
    };
    let places = columns.iter().map(place).collect::<Result<Vec<usize>, _>>()?;
    let line = |(number, row): &(u64, csv::StringRecord)| Line {
        number: *number,
        fields: places.iter().map(|&place| row[place].to_owned()).collect(),
    };
    Ok(table.rows().iter().map(line).collect())
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
        let message = ratings("METHOD;BRDF;DIFFERENCE\n").unwrap_err().to_string();
        assert!(message.contains("line 1: ") && message.contains("DIFFERENCE"), "{message}");
    }

    #[test]
    fn other_columns_signs_and_cases_are_read() {
        let text = "\u{feff}brdf,Distance,id,METHOD\r\nteflon,\"0,25\",7,SGD\r\n";
        let found = ratings(text).unwrap();
        assert_eq!((found[0].mos, found[0].material.as_str(), found[0].method.as_str()), (4.0, "teflon", "SGD"));
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
