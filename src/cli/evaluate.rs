//! `vernis evaluate`: the values of a BRDF at pairs of directions, from a CSV file to a CSV file.

use super::{Shared, print, user_error, workspace};
use anyhow::{Context, Result};
use clap::Args;
use rayon::prelude::*;
use std::io::Read;
use std::path::{Path, PathBuf};
use vernis::dataset::csv_table::{csv_error, line_of};
use vernis_metric::brdf::{Brdf, BrdfSource};
use vernis_metric::io::{number, read_at_most, shown};
use vernis_metric::math::{Rgb, Vec3};

/// Largest table of directions that is read.
const MOST_BYTES: u64 = 1 << 30;
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
vectors in the frame whose +z is the normal, with commas, semicolons or tabs between fields. A length within 0.01 of 1 is normalised, any other is refused. The output has
the same rows and columns and r,g,b: linear RGB, 1/sr, cosine not included. They are empty where nothing is measured, 0 where
either direction is below the horizon, and may be negative for measured colours outside the gamut (RGL).

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
    /// Replace the output if it exists.
    #[arg(long)]
    replace: bool,
}

pub fn run(shared: &Shared, args: EvaluateArgs) -> Result<()> {
    let data = shared.data.as_deref();
    let out = if args.out == Path::new("-") { None } else { Some(output(&args, data)?) };
    let rows = Rows::read(&args.at)?;
    let open = workspace::open(&args.brdf, data)?;
    let values = rows.evaluate(&*open.brdf)?;
    let csv = rows.to_csv(&values)?;
    match out {
        None => print(String::from_utf8(csv).context("the table of values")?),
        Some((folder, name)) => {
            folder.write(&name, &csv)?;
            let missing = values.iter().filter(|value| value.is_none()).count();
            print(format!("{} pairs of directions, {missing} not measured: {}\n", values.len(), args.out.display()))
        }
    }
}

/// Where to write; never over what is read.
fn output(args: &EvaluateArgs, data: Option<&Path>) -> Result<(vernis::report::OutputFolder, String)> {
    let (out, shown) = (&args.out, args.out.display());
    if out.exists() {
        let source = BrdfSource::parse(&args.brdf).map_err(user_error)?.file(data);
        let same = |other: &Path| matches!((out.canonicalize(), other.canonicalize()), (Ok(a), Ok(b)) if a == b);
        if same(&args.at) || source.as_deref().is_some_and(same) {
            return Err(user_error(format!("--out {shown} is an input of this command; give it another name")));
        }
        if !args.replace && !out.is_dir() {
            return Err(user_error(format!("{shown} exists already; use --replace to replace it")));
        }
    }
    workspace::output_file(out)
}

/// The rows of a file and its directions.
struct Rows {
    place: String,
    header: csv::StringRecord,
    rows: Vec<csv::StringRecord>,
    /// Line in the file, wi, wo.
    directions: Vec<(u64, Vec3, Vec3)>,
}

impl Rows {
    fn read(path: &Path) -> Result<Self> {
        let standard = path == Path::new("-");
        let place = if standard { "standard input".to_owned() } else { shown(&path.display().to_string(), 200) };
        let bytes = if standard { from_standard_input() } else { read_at_most(path, MOST_BYTES) };
        let bytes = bytes.map_err(|e| user_error(format!("{place}: {e}")))?;
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
        let delimiter = delimiter(text);
        let mut reader =
            csv::ReaderBuilder::new().delimiter(delimiter).flexible(true).trim(csv::Trim::All).from_reader(text);
        let at = Path::new(&place);
        let header = reader.headers().map_err(|e| user_error(csv_error(at, &e)))?.clone();
        let columns = COLUMNS.map(|name| (name, header.iter().position(|h| h.eq_ignore_ascii_case(name))));
        if let Some((missing, _)) = columns.iter().find(|(_, column)| column.is_none()) {
            let found: Vec<_> = header.iter().map(|h| shown(h, 50)).take(20).collect();
            return Err(user_error(format!(
                "{place}, line 1: no column `{missing}`; the columns are {}; {} are needed",
                found.join(", "),
                COLUMNS.join(", ")
            )));
        }
        if let Some(taken) = VALUES.iter().find(|name| header.iter().any(|h| h.eq_ignore_ascii_case(name))) {
            return Err(user_error(format!("{place}, line 1: the column `{taken}` is there already; rename it")));
        }
        let columns = columns.map(|(_, column)| column.unwrap_or_default());
        let (mut rows, mut directions) = (Vec::new(), Vec::new());
        for record in reader.records() {
            let mut record = record.map_err(|e| user_error(csv_error(at, &e)))?;
            let line = line_of(text, &record);
            if record.len() != header.len() {
                let (found, needed) = (record.len(), header.len());
                return Err(user_error(format!(
                    "{place}, line {line}: the row has {found} fields; it must have {needed}, as the header has"
                )));
            }
            if delimiter != b',' {
                // The decimal comma of the languages that separate fields by a semicolon.
                let point = |(k, field): (usize, &str)| {
                    if columns.contains(&k) { field.replace(',', ".") } else { field.to_owned() }
                };
                let position = record.position().cloned();
                record = record.iter().enumerate().map(point).collect();
                record.set_position(position);
            }
            let (wi, wo) = pair(&record, columns).map_err(|e| user_error(format!("{place}, line {line}: {e}")))?;
            directions.push((line, wi, wo));
            rows.push(record);
        }
        Ok(Self { place, header, rows, directions })
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

    fn to_csv(&self, values: &[Option<Rgb>]) -> Result<Vec<u8>> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(self.header.iter().chain(VALUES))?;
        for (row, value) in self.rows.iter().zip(values) {
            let cells = value.map_or_else(|| [const { String::new() }; 3], |rgb| rgb.map(number));
            writer.write_record(row.iter().chain(cells.iter().map(String::as_str)))?;
        }
        writer.into_inner().context("the table of values could not be put together")
    }
}

fn from_standard_input() -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    std::io::stdin().lock().take(MOST_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MOST_BYTES {
        return Err(std::io::Error::new(
            std::io::ErrorKind::FileTooLarge,
            format!("there are more than {MOST_BYTES} bytes"),
        ));
    }
    Ok(bytes)
}

/// What separates the names of the header: a comma unless all of them stand between semicolons or tabs.
fn delimiter(text: &[u8]) -> u8 {
    let header = text.split(|b| matches!(b, b'\n' | b'\r')).find(|line| !line.is_empty()).unwrap_or_default();
    let fields = |delimiter: u8| header.split(move |b| *b == delimiter).count();
    *[b',', b';', b'\t'].iter().max_by_key(|d| (fields(**d) >= COLUMNS.len(), **d == b',')).unwrap_or(&b',')
}

/// The two directions of a row, of unit length.
fn pair(row: &csv::StringRecord, columns: [usize; 6]) -> Result<(Vec3, Vec3), String> {
    let mut numbers = [0.0; 6];
    for ((number, column), name) in numbers.iter_mut().zip(columns).zip(COLUMNS) {
        let field = row.get(column).unwrap_or_default();
        *number = field
            .parse()
            .ok()
            .filter(|x: &f64| x.is_finite())
            .ok_or_else(|| format!("{name} is `{}`; it must be a number", shown(field, 50)))?;
    }
    let [a, b, c, d, e, f] = numbers;
    let unit = |name: &str, w: Vec3| {
        let length = w.length();
        if (length - 1.0).abs() <= LENGTH {
            return Ok(w.normalized());
        }
        Err(format!("the length of {name} is {}; it must be 1, within {LENGTH}", number(length)))
    };
    Ok((unit("wi", Vec3::new(a, b, c))?, unit("wo", Vec3::new(d, e, f))?))
}
