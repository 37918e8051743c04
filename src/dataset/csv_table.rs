//! CSV files whose first row names their columns: what studies and raw ratings have in common.

use super::DatasetError;
use super::error::field;
use std::path::Path;

/// Largest table of text that is read.
pub(super) const MOST_BYTES: u64 = 256 << 20;

/// A CSV file, read row by row. Blanks around fields do not count.
pub(super) struct CsvTable<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    header: csv::StringRecord,
    rows: csv::StringRecordsIntoIter<&'a [u8]>,
}

impl<'a> CsvTable<'a> {
    /// Of the `bytes` of the file at `path`.
    pub fn new(path: &'a Path, bytes: &'a [u8], delimiter: u8) -> Result<Self, DatasetError> {
        let mut reader =
            csv::ReaderBuilder::new().delimiter(delimiter).trim(csv::Trim::All).flexible(true).from_reader(bytes);
        let header = reader.headers().map_err(|e| csv_error(path, &e))?.clone();
        Ok(Self { path, bytes, header, rows: reader.into_records() })
    }

    /// The names of the columns.
    pub fn header(&self) -> &csv::StringRecord {
        &self.header
    }

    /// The next row and the line on which it begins.
    ///
    /// # Errors
    /// Text that is not UTF-8, more or fewer fields than the header has.
    pub fn next_row(&mut self) -> Result<Option<(u64, csv::StringRecord)>, DatasetError> {
        let Some(record) = self.rows.next() else { return Ok(None) };
        let record = record.map_err(|e| csv_error(self.path, &e))?;
        let line = line_of(self.bytes, &record);
        if record.len() != self.header.len() {
            let (found, allowed) = (record.len().to_string(), format!("{}, as in the header", self.header.len()));
            return Err(field(self.path, line, "the number of fields", found, allowed));
        }
        Ok(Some((line, record)))
    }
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

    #[test]
    fn rows_come_with_their_lines_and_need_as_many_fields_as_the_header() {
        let mut table = CsvTable::new(Path::new("t.csv"), b"a; b\n1; 2\n\n\"3\n4\";5\n6\n", b';').unwrap();
        assert_eq!(table.header(), vec!["a", "b"]);
        assert_eq!(table.next_row().unwrap().unwrap(), (2, vec!["1", "2"].into()));
        assert_eq!(table.next_row().unwrap().unwrap(), (4, vec!["3\n4", "5"].into()));
        let error = table.next_row().unwrap_err().to_string();
        assert_eq!(error, "t.csv, line 6: the number of fields is 1; it must be 2, as in the header");
        assert!(table.next_row().unwrap().is_none());
    }
}
