//! `vernis evaluate`: the values of a BRDF at pairs of directions, from a CSV file to a CSV file.

use super::output::{self, Inputs, Replace, STANDARD};
use super::table::{self, Table};
use super::{Shared, print, to_standard, user_error, workspace};
use crate::dataset::csv_table::{CsvTable, Expected, Others};
use anyhow::{Context, Result};
use clap::Args;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use vernis_metric::brdf::Brdf;
use vernis_metric::io::{counted, number, shown};
use vernis_metric::math::{Rgb, Vec3};

const COLUMNS: [&str; 6] = ["wix", "wiy", "wiz", "wox", "woy", "woz"];
const VALUES: [&str; 3] = ["r", "g", "b"];
/// How far from 1 the length of a direction may be; it is normalised.
const LENGTH: f64 = 0.01;
/// Pairs evaluated at a time by a thread.
const CHUNK: usize = 1024;

/// The values of a BRDF at pairs of directions.
#[derive(Args)]
#[command(after_help = "\
The CSV file has a header with at least the columns wix,wiy,wiz (towards the light) and wox,woy,woz (towards the viewer), unit
vectors in the frame whose +z is the normal, with commas, semicolons or tabs between fields. A vector whose length is within
0.01 of 1 is normalised; any other is refused. The output has the same rows and columns and r,g,b: linear RGB, 1/sr, cosine not
included. They are empty where nothing is measured, 0 where either direction is below the horizon, and may be negative for
measured colours outside the gamut (RGL).

Examples:
  vernis evaluate alum-bronze.binary --at directions.csv
  vernis evaluate merl_nbrdf.zip:teflon --at directions.csv --out values.csv
  make-directions | vernis evaluate ward.json --at - | plot")]
pub struct EvaluateArgs {
    /// The BRDF, as `vernis compare --help` describes.
    brdf: String,
    /// CSV file with the columns wix,wiy,wiz,wox,woy,woz; - reads standard input.
    #[arg(long, value_name = "CSV|-")]
    at: PathBuf,
    /// CSV file to write; - is standard output.
    #[arg(long, short, value_name = "CSV|-", default_value = "-")]
    out: PathBuf,
    #[command(flatten)]
    replace: Replace,
}

pub fn run(shared: &Shared, args: EvaluateArgs) -> Result<()> {
    let data = shared.data.as_deref();
    let inputs = Inputs::default().file(&args.at).notation(&args.brdf, data);
    let out = (args.out != Path::new(STANDARD)).then(|| output::file(&args.out, &inputs, args.replace)).transpose()?;
    let rows = Rows::read(&args.at)?;
    let values = rows.evaluate(&*workspace::open_unhashed(&args.brdf, data)?)?;
    let csv = rows.table.with_columns(&VALUES, &values).context("the table of values could not be put together")?;
    match out {
        None => to_standard(&csv).map(drop),
        Some((folder, name)) => {
            folder.write(&name, &csv)?;
            let missing = values.iter().filter(|value| value.is_none()).count();
            let pairs = counted(values.len(), "pair");
            print(format!("{pairs} of directions, {missing} not measured: {}\n", args.out.display()))
        }
    }
}

/// The rows of a file and its directions.
struct Rows {
    place: String,
    table: CsvTable,
    /// Line in the file, wi, wo.
    directions: Vec<(u64, Vec3, Vec3)>,
}

impl Rows {
    fn read(path: &Path) -> Result<Self> {
        let input = Table::read(path)?;
        let place = input.name.display().to_string();
        let expected = Expected {
            known: &COLUMNS,
            is_number: &|name| COLUMNS.iter().any(|column| name.eq_ignore_ascii_case(column)),
            others: Others::Kept,
            delimiter: None,
            usual: b',',
        };
        let table = CsvTable::read(&input.name, &input.bytes, &expected).map_err(user_error)?;
        if let Some(taken) = VALUES.iter().find(|name| table.written().iter().any(|h| h.eq_ignore_ascii_case(name))) {
            return Err(user_error(format!("{place}, line 1: the column `{taken}` is there already; rename it")));
        }
        let mut columns = [0; 6];
        for (column, name) in columns.iter_mut().zip(COLUMNS) {
            *column = table::column(&table, &input.name, name, &COLUMNS)?;
        }
        let numbers = table.numbers(&columns).map_err(|bad| {
            let (line, name, found) = (bad.line, COLUMNS[bad.place], shown(&bad.found, 50));
            user_error(format!("{place}, line {line}: {name} is `{found}`; it must be a number"))
        })?;
        let mut directions = Vec::with_capacity(table.rows().len());
        for ((line, _), &[a, b, c, d, e, f]) in table.rows().iter().zip(numbers.as_chunks().0) {
            let unit = |name, w| unit(name, w).map_err(|e| user_error(format!("{place}, line {line}: {e}")));
            directions.push((*line, unit("wi", Vec3::new(a, b, c))?, unit("wo", Vec3::new(d, e, f))?));
        }
        Ok(Self { place, table, directions })
    }

    fn evaluate(&self, brdf: &dyn Brdf) -> Result<Vec<Option<Rgb>>> {
        let mut values = vec![None; self.directions.len()];
        values.par_chunks_mut(CHUNK).zip(self.directions.par_chunks(CHUNK)).for_each(|(values, directions)| {
            let (wi, wo): (Vec<Vec3>, Vec<Vec3>) = directions.iter().map(|(_, wi, wo)| (*wi, *wo)).unzip();
            brdf.eval_batch(&wi, &wo, values);
        });
        let bad = |value: &Option<Rgb>| value.is_some_and(|v| !v.iter().all(|x| x.is_finite()));
        match values.iter().position(bad) {
            None => Ok(values),
            Some(k) => Err(user_error(format!(
                "{}, line {}: the value of the BRDF is {:?}; it must be finite",
                self.place,
                self.directions[k].0,
                values[k].unwrap_or_default()
            ))),
        }
    }
}

/// A direction of length 1.
fn unit(name: &str, w: Vec3) -> Result<Vec3, String> {
    let length = w.length();
    if (length - 1.0).abs() <= LENGTH {
        return Ok(w.normalized());
    }
    Err(format!("the length of {name} is {}; it must be 1, within {LENGTH}", number(length)))
}
