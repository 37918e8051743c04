//! Where finished rows go: standard output in the order of the table, or a file beside the target until all are there.

use super::super::{to_standard, user_error};
use super::work::Found;
use crate::report::spreadsheet::cell;
use anyhow::{Context, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use vernis_metric::io::write_atomically;
use vernis_metric::metric::{Metric, learned};

/// The columns of the output.
pub struct Columns {
    names: Vec<String>,
    metrics: usize,
    /// Places of the metrics that give a score.
    learned: Vec<usize>,
}

impl Columns {
    /// Those of the table, then one a metric, scores and a reason; every name once.
    pub fn new(header: &csv::StringRecord, metrics: &[Arc<dyn Metric>]) -> Self {
        let gives_score = |m: &Arc<dyn Metric>| m.properties().family == learned::FAMILY;
        let learned: Vec<usize> = (0..metrics.len()).filter(|&m| gives_score(&metrics[m])).collect();
        let mut names = Names::default();
        for (place, name) in header.iter().enumerate() {
            if name.is_empty() && names.taken.contains("") {
                names.add(&format!("column {}", place + 1));
            } else {
                names.add(name);
            }
        }
        metrics.iter().for_each(|metric| names.add(&cell(metric.name())));
        for (i, &metric) in learned.iter().enumerate() {
            let plain = i == 0 && !header.iter().any(|column| column == "mos");
            let suffix = if plain { String::new() } else { format!(":{}", metrics[metric].name()) };
            ["mos", "mos_low", "mos_high"].iter().for_each(|name| names.add(&format!("{name}{suffix}")));
        }
        names.add("reason");
        Self { names: names.all, metrics: metrics.len(), learned }
    }

    /// The name of the column of reasons.
    pub fn reason(&self) -> &str {
        self.names.last().map_or("", String::as_str)
    }

    fn header(&self) -> Result<Vec<u8>> {
        line(&self.names)
    }

    /// A row of the table with what was found for it.
    pub fn row(&self, record: &csv::StringRecord, found: &Found) -> Result<Vec<u8>> {
        let mut cells: Vec<String> = record.iter().map(str::to_owned).collect();
        match found {
            Ok(found) => {
                cells.extend(found.iter().map(|m| m.value.to_string()));
                for &metric in &self.learned {
                    let score = found.get(metric).and_then(|m| m.score);
                    let numbers = score.map(|s| [s.mos, s.low, s.high].map(|x| x.to_string()));
                    cells.extend(numbers.unwrap_or_default());
                }
                cells.push(String::new());
            }
            Err(reason) => {
                cells.extend(vec![String::new(); self.metrics + 3 * self.learned.len()]);
                cells.push(cell(reason).into_owned());
            }
        }
        line(&cells)
    }
}

/// Names of which none is there twice.
#[derive(Default)]
struct Names {
    all: Vec<String>,
    taken: BTreeSet<String>,
}

impl Names {
    fn add(&mut self, name: &str) {
        let numbered = (2..).map(|k| format!("{name}:{k}"));
        let free = std::iter::once(name.to_owned()).chain(numbered).find(|name| !self.taken.contains(name));
        self.all.extend(free.clone());
        self.taken.extend(free);
    }
}

fn line(cells: &[String]) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(cells)?;
    writer.into_inner().context("a row could not be put together")
}

/// The file that holds the finished rows until all are.
pub fn partial(out: &Path) -> PathBuf {
    let mut name = out.file_name().unwrap_or_default().to_owned();
    name.push(".partial");
    out.with_file_name(name)
}

/// What takes finished rows.
pub struct Sink {
    header: Vec<u8>,
    place: Place,
}

enum Place {
    /// Rows that wait for an earlier one, and the next to be written.
    Standard { waiting: BTreeMap<usize, Vec<u8>>, next: usize, open: bool },
    /// All rows, as they are needed in the end.
    File { out: PathBuf, partial: File, rows: Vec<Vec<u8>> },
}

impl Sink {
    /// Standard output; the header is written.
    pub fn standard(columns: &Columns) -> Result<Self> {
        let header = columns.header()?;
        let place = Place::Standard { waiting: BTreeMap::new(), next: 0, open: to_standard(&header)? };
        Ok(Self { header, place })
    }

    /// A file; its partial form is begun.
    pub fn file(out: &Path, columns: &Columns, rows: usize) -> Result<Self> {
        let (header, path) = (columns.header()?, partial(out));
        let unwritable = |e: std::io::Error| user_error(format!("{}: {e}", path.display()));
        // Made anew: a link of that name is not followed, and a run that writes it already is not disturbed.
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(unwritable(error)),
            _ => {}
        }
        let mut file = File::options().write(true).create_new(true).open(&path).map_err(unwritable)?;
        file.write_all(&header).map_err(unwritable)?;
        Ok(Self { header, place: Place::File { out: out.to_owned(), partial: file, rows: vec![Vec::new(); rows] } })
    }

    /// Whether anybody wants more.
    pub fn is_open(&self) -> bool {
        !matches!(self.place, Place::Standard { open: false, .. })
    }

    /// Where `done` finished rows are, for a message.
    pub fn kept(&self, done: usize) -> String {
        match &self.place {
            Place::File { out, .. } if done > 0 => format!("; {done} finished rows are in {}", partial(out).display()),
            _ => String::new(),
        }
    }

    /// Takes the finished row at `place` of the table.
    pub fn take(&mut self, place: usize, row: Result<Vec<u8>>) -> Result<()> {
        let row = row?;
        match &mut self.place {
            Place::Standard { waiting, next, open } => {
                waiting.insert(place, row);
                while let Some(row) = waiting.remove(next) {
                    *next += 1;
                    *open = *open && to_standard(&row)?;
                }
            }
            Place::File { out, partial: file, rows } => {
                file.write_all(&row).with_context(|| partial(out).display().to_string())?;
                rows[place] = row;
            }
        }
        Ok(())
    }

    /// Puts the whole file in place of its partial form.
    pub fn finish(self) -> Result<()> {
        let Place::File { out, partial: file, rows } = self.place else { return Ok(()) };
        let bytes: Vec<u8> = self.header.into_iter().chain(rows.into_iter().flatten()).collect();
        write_atomically(&out, &bytes).with_context(|| out.display().to_string())?;
        drop(file);
        let path = partial(&out);
        std::fs::remove_file(&path).with_context(|| path.display().to_string())
    }
}
