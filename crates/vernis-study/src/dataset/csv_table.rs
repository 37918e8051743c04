//! CSV files whose first row names their columns, as the world writes them: one reader for studies, ratings, pairs and scores.
//!
//! * Between fields: a comma, a semicolon, a tab or a bar, found by the names of the columns; the line `sep=;` of spreadsheets.
//! * Names of columns: case does not count, nor whether their words are joined by `_`, `-` or a blank.
//! * Numbers: a decimal comma where no number of the file has a point.
//! * Text: UTF-8 with or without a byte order mark; lines end as they do on any system; blanks around fields and rows without
//!   content do not count.
//!
//! What is not as usual is told ([`super::notice`]) in one line.

use super::DatasetError;
use super::error::field;
use super::notice;
use std::borrow::Cow;
use std::path::Path;
use vernis_metric::io::{did_you_mean, nearest, number, shown};

/// Largest table of text that is read.
pub const MOST_BYTES: u64 = 256 << 20;

/// What may stand between fields where nothing is stated.
const DELIMITERS: [u8; 4] = [b',', b';', b'\t', b'|'];

/// What becomes of columns that have no meaning here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Others {
    /// Their names are told; one that is like a known name is refused, for it may be a slip.
    Told,
    /// Whoever asked for the table knows of them.
    Kept,
}

/// What is looked for in a table.
pub struct Expected<'a> {
    /// The columns that have a meaning.
    pub known: &'a [&'a str],
    /// Whether the column of a name, as written here or else in the file, holds numbers.
    pub is_number: &'a dyn Fn(&str) -> bool,
    /// What becomes of other columns.
    pub others: Others,
    /// What stands between fields, where it is stated.
    pub delimiter: Option<u8>,
    /// What stands between fields of files of this kind: nothing is told of it.
    pub usual: u8,
}

/// A field that is no finite number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NoNumber {
    /// Line in the file.
    pub line: u64,
    /// Place among the columns that were asked for.
    pub place: usize,
    /// What stands there.
    pub found: String,
}

/// A CSV file, read whole.
pub struct CsvTable {
    header: csv::StringRecord,
    written: csv::StringRecord,
    rows: Vec<(u64, csv::StringRecord)>,
}

impl CsvTable {
    /// Of the `bytes` of the file at `path`.
    ///
    /// # Errors
    /// Text that is not UTF-8, a header without known delimiter, a column whose name is like a known one, rows with more or fewer
    /// fields than the header has, decimal points and commas in one file.
    pub fn read(path: &Path, bytes: &[u8], expected: &Expected<'_>) -> Result<Self, DatasetError> {
        let text = Text::of(path, bytes)?;
        let delimiter = expected.delimiter.or(text.stated).unwrap_or_else(|| found_delimiter(&text.bytes, expected));
        let mut reader = builder(delimiter).from_reader(&text.bytes[..]);
        let written = reader.headers().map_err(|e| csv_error(path, &e))?.clone();
        let mut said = Vec::new();
        if delimiter != expected.usual && expected.delimiter.is_none() {
            said.push(format!("with {} between fields", named(delimiter)));
        }
        let header = known_names(&written, expected.known);
        one_field(path, &header, expected)?;
        let mut rows = Vec::new();
        for record in reader.records() {
            let mut record = record.map_err(|e| csv_error(path, &e))?;
            if record.iter().skip(header.len()).all(str::is_empty) {
                // Delimiters at the end of a row.
                record.truncate(header.len());
            }
            if record.len() > 1 && record.iter().all(str::is_empty) {
                continue;
            }
            let line = line_of(&text.bytes, &record) + text.lines_before;
            if record.len() != header.len() {
                return Err(wrong_number(path, line, record.len(), header.len(), delimiter));
            }
            rows.push((line, record));
        }
        let numbers: Vec<usize> = (0..header.len()).filter(|&i| (expected.is_number)(&header[i])).collect();
        if with_points(path, &header, &numbers, &mut rows)? {
            said.push("decimal commas".to_owned());
        }
        let renamed = header.iter().zip(&written).filter(|(name, found)| name != found);
        said.extend(renamed.map(|(name, found)| format!("`{}` as {name}", shown(found, 100))));
        let mut told = if said.is_empty() { Vec::new() } else { vec![format!("read {}", listed(&said))] };
        if expected.others == Others::Told {
            told.extend(others(path, &header, expected)?);
        }
        if !told.is_empty() {
            notice::tell(&format!("{}: {}", shown(&path.display().to_string(), 400), told.join("; ")));
        }
        Ok(Self { header, written, rows })
    }

    /// The names of the columns: known ones as they are known, others as the file has them.
    pub fn header(&self) -> &csv::StringRecord {
        &self.header
    }

    /// The names of the columns as the file has them.
    pub fn written(&self) -> &csv::StringRecord {
        &self.written
    }

    /// The place of the column called `name`.
    ///
    /// # Errors
    /// Two columns of that name.
    pub fn column(&self, path: &Path, name: &str) -> Result<Option<usize>, DatasetError> {
        let mut places = (0..self.header.len()).filter(|&i| &self.header[i] == name);
        match (places.next(), places.next()) {
            (_, Some(_)) => Err(field(path, 1, &format!("column `{name}`"), "given twice".into(), "given once".into())),
            (place, None) => Ok(place),
        }
    }

    /// The rows, each with the line on which it begins; numbers have decimal points.
    pub fn rows(&self) -> &[(u64, csv::StringRecord)] {
        &self.rows
    }

    /// The numbers in `columns`, row by row: as many a row as there are columns.
    ///
    /// # Errors
    /// The first field that is no finite number.
    pub fn numbers(&self, columns: &[usize]) -> Result<Vec<f64>, NoNumber> {
        let mut numbers = Vec::with_capacity(self.rows.len() * columns.len());
        for (line, row) in &self.rows {
            for (place, &column) in columns.iter().enumerate() {
                let found = row.get(column).unwrap_or_default();
                match found.parse().ok().filter(|x: &f64| x.is_finite()) {
                    Some(number) => numbers.push(number),
                    None => return Err(NoNumber { line: *line, place, found: found.to_owned() }),
                }
            }
        }
        Ok(numbers)
    }

    /// The table as it was written, with the columns `names` to the right of it: `values` has one element a row, and nothing for cells
    /// that stay empty.
    ///
    /// # Errors
    /// What the writer of CSV says.
    pub fn with_columns(&self, names: &[&str; 3], values: &[Option<[f64; 3]>]) -> Result<Vec<u8>, csv::Error> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(self.written().iter().chain(names.iter().copied()))?;
        for ((_, row), value) in self.rows.iter().zip(values) {
            let cells = value.map_or_else(|| [const { String::new() }; 3], |value| value.map(number));
            writer.write_record(row.iter().chain(cells.iter().map(String::as_str)))?;
        }
        writer.into_inner().map_err(|e| e.into_error().into())
    }
}

fn builder(delimiter: u8) -> csv::ReaderBuilder {
    let mut builder = csv::ReaderBuilder::new();
    builder.delimiter(delimiter).trim(csv::Trim::All).flexible(true);
    builder
}

/// The text of a file, without what spreadsheets put before it.
struct Text<'a> {
    bytes: Cow<'a, [u8]>,
    /// By a first line `sep=;`.
    stated: Option<u8>,
    /// Lines that were taken away at the start.
    lines_before: u64,
}

impl<'a> Text<'a> {
    fn of(path: &Path, bytes: &'a [u8]) -> Result<Self, DatasetError> {
        let wide = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
        if wide || bytes.iter().take(4).any(|b| *b == 0) {
            let reason = "the text is UTF-16; it must be UTF-8: save it as `CSV UTF-8`".to_owned();
            return Err(DatasetError::Unreadable { path: path.into(), reason });
        }
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        let mut text = Self { bytes: Cow::Borrowed(bytes), stated: None, lines_before: 0 };
        if bytes.contains(&b'\r') && !bytes.contains(&b'\n') {
            let lines = bytes.iter().map(|b| if *b == b'\r' { b'\n' } else { *b }).collect();
            text.bytes = Cow::Owned(lines);
        }
        let end = text.bytes.iter().position(|b| *b == b'\n').unwrap_or(text.bytes.len());
        let first = text.bytes[..end].trim_ascii();
        // It is written with and without quotation marks.
        let first = first.strip_prefix(b"\"").and_then(|rest| rest.strip_suffix(b"\"")).unwrap_or(first);
        if let [s, e, p, b'=', delimiter] = first
            && [s, e, p].iter().zip(b"sep").all(|(a, b)| a.eq_ignore_ascii_case(b))
        {
            text.stated = Some(*delimiter);
            let rest = text.bytes.get(end + 1..).unwrap_or_default().to_vec();
            (text.bytes, text.lines_before) = (Cow::Owned(rest), 1);
        }
        Ok(text)
    }
}

/// A name regardless of case and of what joins its words.
fn folded(name: &str) -> String {
    name.to_lowercase().replace([' ', '-'], "_")
}

/// The delimiter that makes the most known names of the first row; where none makes any, the one that makes the most fields.
fn found_delimiter(bytes: &[u8], expected: &Expected<'_>) -> u8 {
    let known: Vec<String> = expected.known.iter().map(|name| folded(name)).collect();
    let judged = |delimiter: u8| {
        let header = builder(delimiter).from_reader(bytes).headers().cloned().unwrap_or_default();
        (header.iter().filter(|name| known.contains(&folded(name))).count(), header.len())
    };
    let mut best = (expected.usual, judged(expected.usual));
    for delimiter in DELIMITERS {
        let found = judged(delimiter);
        if found > best.1 {
            best = (delimiter, found);
        }
    }
    best.0
}

fn named(delimiter: u8) -> String {
    match delimiter {
        b'\t' => "tabs".to_owned(),
        other => format!("`{}`", char::from(other)),
    }
}

/// The header with known names as they are known, unless the file has a column of exactly that name beside.
fn known_names(written: &csv::StringRecord, known: &[&str]) -> csv::StringRecord {
    let of = |found: &str| {
        let like = known.iter().find(|name| folded(name) == folded(found));
        match like {
            Some(name) if !written.iter().any(|other| other == *name) => (*name).to_owned(),
            _ => found.to_owned(),
        }
    };
    written.iter().map(of).collect()
}

/// That a header of one field may have a delimiter that is not looked for.
fn one_field(path: &Path, header: &csv::StringRecord, expected: &Expected<'_>) -> Result<(), DatasetError> {
    match header.iter().next() {
        Some(only) if header.len() == 1 && !only.is_empty() && !expected.known.contains(&only) => {
            let allowed = match expected.delimiter {
                Some(delimiter) => format!("several columns with {} between fields", named(delimiter)),
                None => "several columns with `,`, `;`, tabs or `|` between fields".to_owned(),
            };
            Err(field(path, 1, "the header", format!("one column, `{only}`"), allowed))
        }
        _ => Ok(()),
    }
}

fn wrong_number(path: &Path, line: u64, found: usize, header: usize, delimiter: u8) -> DatasetError {
    let mut allowed = format!("{header}, as in the header");
    if found > header && delimiter == b',' {
        allowed += "; a field that holds a comma, as decimal sign or elsewhere, must be in quotation marks";
    }
    field(path, line, "the number of fields", found.to_string(), allowed)
}

/// Whether `text` is a number with a decimal comma.
fn has_decimal_comma(text: &str) -> bool {
    let digits = |part: &str| part.bytes().all(|b| b.is_ascii_digit());
    let Some((whole, rest)) = text.split_once(',') else { return false };
    let whole = whole.strip_prefix(['+', '-']).unwrap_or(whole);
    let (part, exponent) = rest.split_once(['e', 'E']).unwrap_or((rest, "0"));
    let exponent = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
    digits(whole) && digits(part) && digits(exponent) && !exponent.is_empty() && !(whole.is_empty() && part.is_empty())
}

/// Gives numbers with decimal commas decimal points; whether there were any.
fn with_points(
    path: &Path,
    header: &csv::StringRecord,
    numbers: &[usize],
    rows: &mut [(u64, csv::StringRecord)],
) -> Result<bool, DatasetError> {
    let find = |is: &dyn Fn(&str) -> bool| {
        rows.iter()
            .find_map(|(line, row)| numbers.iter().find(|&&i| is(&row[i])).map(|&i| (*line, i, row[i].to_owned())))
    };
    let Some((line, column, comma)) = find(&has_decimal_comma) else { return Ok(false) };
    if let Some((other, ..)) = find(&|text| text.contains('.') && text.parse::<f64>().is_ok()) {
        let allowed = format!("written with a decimal point, as on line {other}");
        return Err(field(path, line, &header[column], format!("`{comma}`"), allowed));
    }
    for (_, row) in rows {
        let point = |(i, text): (usize, &str)| {
            if numbers.contains(&i) && has_decimal_comma(text) { text.replace(',', ".") } else { text.to_owned() }
        };
        let mut changed: csv::StringRecord = row.iter().enumerate().map(point).collect();
        changed.set_position(row.position().cloned());
        *row = changed;
    }
    Ok(true)
}

/// What is told of columns that have no meaning here.
fn others(path: &Path, header: &csv::StringRecord, expected: &Expected<'_>) -> Result<Option<String>, DatasetError> {
    let mut ignored = Vec::new();
    for (i, name) in header.iter().enumerate().filter(|(_, name)| !expected.known.contains(name)) {
        // A column that is there already is not what was meant.
        let absent = expected.known.iter().filter(|known| !header.iter().any(|name| name == **known));
        let like = nearest(&folded(name), absent);
        if !like.is_empty() {
            let allowed = format!("one of {}; {}", expected.known.join(", "), did_you_mean(&like));
            return Err(field(path, 1, "a column", format!("`{name}`"), allowed));
        }
        ignored.push(match name {
            "" => format!("column {} (without a name)", i + 1),
            name => format!("`{}`", shown(name, 100)),
        });
    }
    Ok(match &ignored[..] {
        [] => None,
        [one] => Some(format!("{one} is ignored")),
        _ => Some(format!("{} are ignored", listed(&ignored))),
    })
}

/// `a`, `a and b`, `a, b and c`.
fn listed(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// The line on which a record of `bytes` begins: the reader counts from where it was left, before any blank lines.
fn line_of(bytes: &[u8], record: &csv::StringRecord) -> u64 {
    let Some(position) = record.position() else { return 0 };
    let rest = bytes.get(position.byte() as usize..).unwrap_or_default();
    let blank = rest.iter().take_while(|b| matches!(b, b'\r' | b'\n'));
    position.line() + blank.filter(|b| **b == b'\n').count() as u64
}

/// What the reader of CSV says, with the line.
fn csv_error(path: &Path, error: &csv::Error) -> DatasetError {
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

    const KNOWN: [&str; 4] = ["reference", "candidate", "mos", "method_family"];

    fn expected() -> Expected<'static> {
        Expected { known: &KNOWN, is_number: &|n| n == "mos", others: Others::Told, delimiter: None, usual: b',' }
    }

    fn read(bytes: impl AsRef<[u8]>) -> Result<CsvTable, DatasetError> {
        CsvTable::read(Path::new("t.csv"), bytes.as_ref(), &expected())
    }

    fn error(bytes: impl AsRef<[u8]>) -> String {
        read(bytes).err().map(|e| e.to_string()).unwrap_or_default()
    }

    #[test]
    fn rows_come_with_their_lines_and_need_as_many_fields_as_the_header() {
        let stated = Expected { delimiter: Some(b';'), others: Others::Kept, ..expected() };
        let read = |bytes: &[u8]| CsvTable::read(Path::new("t.csv"), bytes, &stated);
        let table = read(b"a; b\n1; 2\n\n\"3\n4\";5\n;\n").unwrap();
        assert_eq!(table.header(), vec!["a", "b"]);
        assert_eq!(table.rows()[0], (2, vec!["1", "2"].into()));
        assert_eq!(table.rows()[1], (4, vec!["3\n4", "5"].into()));
        assert_eq!(table.rows().len(), 2, "a row without content counts");
        let error = read(b"a;b\n1;2\n6\n").err().unwrap().to_string();
        assert_eq!(error, "t.csv, line 3: the number of fields is 1; it must be 2, as in the header");
    }

    #[test]
    fn a_table_reads_the_same_however_it_is_written() {
        let rows =
            [(2, vec!["a.json", "b.json", "4.5"].into()), (3, vec!["a.json", "c.json?ks=1,2,3", "-1.5e0"].into())];
        let texts = [
            "reference,candidate,mos\na.json,b.json,4.5\na.json,\"c.json?ks=1,2,3\",-1.5e0\n",
            "reference;candidate;mos\na.json;b.json;4.5;;\na.json;c.json?ks=1,2,3;-1.5e0;\n;;;;\n",
            "reference;candidate;mos\na.json;b.json;4,5\na.json;c.json?ks=1,2,3;-1,5e0\n",
            "reference\tcandidate\tmos\na.json\tb.json\t4.5\na.json\tc.json?ks=1,2,3\t-1.5e0\n",
            "reference|candidate|mos\na.json|b.json|4.5\na.json|c.json?ks=1,2,3|-1.5e0\n",
            "\u{feff}Reference,CANDIDATE,Mos\r\na.json,b.json,\"4,5\"\r\n\"a.json\",\"c.json?ks=1,2,3\",\"-1,5e0\"\r\n",
            "reference;candidate;mos\ra.json;b.json;4.5\ra.json;c.json?ks=1,2,3;-1.5e0\r",
        ];
        for text in texts {
            let table = read(text).unwrap_or_else(|e| panic!("{text}: {e}"));
            assert_eq!(table.header(), vec!["reference", "candidate", "mos"], "{text}");
            assert_eq!(table.rows(), rows, "{text}");
        }
        let table = read("sep=;\nreference;Method Family\na;b\n").unwrap();
        assert_eq!(table.header(), vec!["reference", "method_family"]);
        assert_eq!(table.written(), vec!["reference", "Method Family"]);
        assert_eq!(table.rows(), [(3, vec!["a", "b"].into())]);
        // The name itself comes before one that is like it.
        let table = read("Reference,reference\na,b\n").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(table.column(Path::new("t.csv"), "reference").unwrap(), Some(1));
    }

    #[test]
    fn what_cannot_be_told_is_named() {
        let wide: Vec<u8> = "reference,mos\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        for bytes in [wide.clone(), [&[0xff, 0xfe][..], &wide].concat()] {
            assert_eq!(error(bytes), "t.csv: the text is UTF-16; it must be UTF-8: save it as `CSV UTF-8`");
        }
        for (text, says) in [
            (
                "reference candidate mos\n",
                "line 1: the header is one column, `reference candidate mos`; it must be several",
            ),
            (
                "reference,mos\na,4,5\n",
                "line 2: the number of fields is 3; it must be 2, as in the header; a field that holds",
            ),
            (
                "reference;mos\na;4.5\na;4,5\n",
                "line 3: mos is `4,5`; it must be written with a decimal point, as on line 2",
            ),
            (
                "reference;mso\n",
                "line 1: a column is `mso`; it must be one of reference, candidate, mos, method_family; did",
            ),
        ] {
            let message = error(text);
            assert!(message.starts_with(&format!("t.csv, {says}")), "{message}");
        }
        assert!(error(b"reference,mos\na,\xff\n").contains("line 2: a field is not UTF-8"));
    }

    #[test]
    fn decimal_commas_are_told_from_lists_and_thousands() {
        for text in ["4,5", "-0,5", "+,5", "4,", "1,5e-3"] {
            assert!(has_decimal_comma(text), "{text}");
        }
        for text in ["4.5", "1,2,3", "1.234,5", ",", "a,5", "4,5e", "4"] {
            assert!(!has_decimal_comma(text), "{text}");
        }
    }
}
