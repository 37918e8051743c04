//! The rows of a table of pairs, their paths looked up.

use super::super::table::{self, Table};
use super::super::user_error;
use crate::dataset::csv_study::source_beside;
use crate::dataset::csv_table::{CsvTable, Expected, Others};
use anyhow::Result;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use vernis_metric::brdf::formats::materials;
use vernis_metric::brdf::{BrdfError, BrdfSource};

const NEEDED: [&str; 2] = ["reference", "candidate"];

/// One row of the table.
pub struct PairRow {
    /// Where it begins in the file.
    pub line: u64,
    /// As it is in the file.
    pub record: csv::StringRecord,
    /// Reference and candidate, both of which are there, or why not.
    pub sources: Result<[BrdfSource; 2], String>,
}

/// A table of pairs.
pub struct Pairs {
    /// What the file is called in messages.
    pub name: String,
    /// As it is in the file.
    pub header: csv::StringRecord,
    /// In the order of the file.
    pub rows: Vec<PairRow>,
}

impl Pairs {
    /// Of a file, or of standard input. Every path is looked up.
    pub fn read(path: &Path, data: Option<&Path>) -> Result<Self> {
        let table = Table::read(path)?;
        Self::of(&table.name, &table.folder, &table.bytes, data)
    }

    fn of(path: &Path, folder: &Path, bytes: &[u8], data: Option<&Path>) -> Result<Self> {
        let expected =
            Expected { known: &NEEDED, is_number: &|_| false, others: Others::Kept, delimiter: None, usual: b',' };
        let table = CsvTable::read(path, bytes, &expected).map_err(user_error)?;
        let place = |name: &str| table::column(&table, path, name, &NEEDED);
        let places = [place(NEEDED[0])?, place(NEEDED[1])?];
        let mut lookup = Lookup { folder, data, known: BTreeMap::new(), collections: BTreeMap::new() };
        let row = |(line, record): &(u64, csv::StringRecord)| {
            let sources = places.map(|place| lookup.find(table.header().get(place), &record[place]));
            let sources = match sources {
                [Ok(reference), Ok(candidate)] => Ok([reference, candidate]),
                [Err(reason), _] | [_, Err(reason)] => Err(reason),
            };
            PairRow { line: *line, record: record.clone(), sources }
        };
        let rows: Vec<PairRow> = table.rows().iter().map(row).collect();
        if rows.is_empty() {
            let path = path.display();
            return Err(user_error(format!("{path}: there is no pair after the header; there must be at least one")));
        }
        Ok(Self { name: path.display().to_string(), header: table.written().clone(), rows })
    }

    /// The BRDFs of all rows.
    pub fn sources(&self) -> impl Iterator<Item = &BrdfSource> {
        self.rows.iter().filter_map(|row| row.sources.as_ref().ok()).flatten()
    }

    /// Line and reason of every row whose BRDFs are not there.
    pub fn bad(&self) -> Vec<(u64, &str)> {
        self.rows.iter().filter_map(|row| Some((row.line, row.sources.as_ref().err()?.as_str()))).collect()
    }
}

/// Where BRDFs are looked up, and what was found: a file of many rows is looked up once.
struct Lookup<'a> {
    folder: &'a Path,
    data: Option<&'a Path>,
    known: BTreeMap<String, Result<BrdfSource, String>>,
    /// The materials of files with many.
    collections: BTreeMap<PathBuf, Option<Vec<String>>>,
}

impl Lookup<'_> {
    fn find(&mut self, column: Option<&str>, notation: &str) -> Result<BrdfSource, String> {
        if notation.is_empty() {
            return Err(format!("`{}` is empty; it must be a BRDF", column.unwrap_or_default()));
        }
        if let Some(known) = self.known.get(notation) {
            return known.clone();
        }
        let found = self.locate(notation).map_err(|e| e.to_string());
        self.known.insert(notation.to_owned(), found.clone());
        found
    }

    fn locate(&mut self, notation: &str) -> Result<BrdfSource, BrdfError> {
        let source = source_beside(self.folder, notation)?;
        let Some(path) = source.locate(self.data)? else { return Ok(source) };
        let place = source.notation().split('?').next().unwrap_or_default();
        let Some(material) = place.rsplit_once(':').map(|(_, material)| material) else { return Ok(source) };
        // A file that cannot be listed says so when it is opened.
        let listed = self.collections.entry(path.clone()).or_insert_with(|| materials(&path).ok());
        match listed {
            Some(names) if names.binary_search_by(|name| name.as_str().cmp(material)).is_err() => {
                let nearest = vernis_metric::io::nearest(material, names);
                Err(BrdfError::UnknownMaterial { path, found: material.to_owned(), nearest })
            }
            _ => Ok(source),
        }
    }
}
