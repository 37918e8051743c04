//! Named columns in an Apache Parquet file, which any dataframe engine reads: flat, one row group, uncompressed.
//!
//! Readers of the format find everything from the end of the file: the footer, its length (u32, little-endian) and the magic
//! `PAR1`. Between the columns and the footer, where they do not look, stands a seal: the SHA-256 of all other bytes. The crate
//! that reads the format panics where a footer is damaged; it only ever sees files whose seal is whole.
//!
//! Source of the format: <https://parquet.apache.org/docs/file-format/>, by the crate of the Arrow project.

use crate::dataset::DatasetError;
use parquet::basic::{Compression, ConvertedType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::{KeyValue, RowGroupMetaData};
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{ChunkReader, FileReader, SerializedFileReader};
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::record::Field;
use parquet::schema::types::Type;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use vernis_metric::io::open_regular;

/// Bytes of the seal.
const SEAL: usize = 32;
/// Length of the footer and magic, at the end.
const TAIL: usize = 8;
/// The last bytes of a file.
const MAGIC: &[u8] = b"PAR1";
/// Hundreds of times what the study takes.
const MOST_BYTES: u64 = 4 << 30;
/// Rows times columns; a file of few bytes can say that one value stands in all of them.
const MOST_CELLS: u64 = 1 << 28;

/// The values of one column.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    Text(Vec<Option<String>>),
    Number(Vec<f64>),
    Count(Vec<usize>),
}

impl Values {
    fn field(&self, name: &str) -> Result<Arc<Type>, ParquetError> {
        let (physical, repetition, converted) = match self {
            Self::Text(_) => (Physical::BYTE_ARRAY, Repetition::OPTIONAL, ConvertedType::UTF8),
            Self::Number(_) => (Physical::DOUBLE, Repetition::REQUIRED, ConvertedType::NONE),
            Self::Count(_) => (Physical::INT64, Repetition::REQUIRED, ConvertedType::NONE),
        };
        let field = Type::primitive_type_builder(name, physical);
        Ok(Arc::new(field.with_repetition(repetition).with_converted_type(converted).build()?))
    }

    fn write(&self, column: &mut SerializedColumnWriter<'_>) -> Result<(), ParquetError> {
        match self {
            Self::Text(texts) => {
                let present: Vec<ByteArray> = texts.iter().flatten().map(|text| text.as_str().into()).collect();
                let levels: Vec<i16> = texts.iter().map(|text| i16::from(text.is_some())).collect();
                column.typed::<ByteArrayType>().write_batch(&present, Some(&levels), None)?;
            }
            Self::Number(numbers) => {
                column.typed::<DoubleType>().write_batch(numbers, None, None)?;
            }
            Self::Count(counts) => {
                let counts: Vec<i64> = counts.iter().map(|&count| count as i64).collect();
                column.typed::<Int64Type>().write_batch(&counts, None, None)?;
            }
        }
        Ok(())
    }
}

/// The bytes of a file with `columns`, all of one length, and `header` under `key` among its metadata.
pub fn write(key: &str, header: &str, columns: &[(String, Values)]) -> Result<Vec<u8>, ParquetError> {
    let fields = columns.iter().map(|(name, values)| values.field(name)).collect::<Result<_, _>>()?;
    let schema = Type::group_type_builder("rows").with_fields(fields).build()?;
    let header = KeyValue::new(key.to_owned(), header.to_owned());
    let properties = WriterProperties::builder().set_key_value_metadata(Some(vec![header])).build();
    let mut writer = SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    for (_, values) in columns {
        let missing = || ParquetError::General("a column of the schema has no writer".to_owned());
        let mut column = group.next_column()?.ok_or_else(missing)?;
        values.write(&mut column)?;
        column.close()?;
    }
    group.close()?;
    let mut bytes = writer.into_inner()?;
    let footer = footer(&bytes).ok_or_else(|| ParquetError::General("the file has no footer".to_owned()))?;
    let seal: [u8; SEAL] = Sha256::digest(&bytes).into();
    bytes.splice(footer..footer, seal);
    Ok(bytes)
}

/// Where the footer of a file begins.
fn footer(bytes: &[u8]) -> Option<usize> {
    let (body, tail) = bytes.split_at_checked(bytes.len().checked_sub(TAIL)?)?;
    let (length, magic) = tail.split_first_chunk::<4>()?;
    let length = usize::try_from(u32::from_le_bytes(*length)).ok()?;
    (magic == MAGIC).then_some(body.len().checked_sub(length)?)
}

/// Whether a file is as [`write`] made it.
fn is_whole(bytes: &[u8]) -> bool {
    let whole = || {
        let (before, footer) = bytes.split_at_checked(footer(bytes)?)?;
        let (columns, seal) = before.split_last_chunk::<SEAL>()?;
        let found = Sha256::new().chain_update(columns).chain_update(footer).finalize();
        (found.as_slice() == seal).then_some(())
    };
    whole().is_some()
}

/// The header under `key`, and the columns by name.
///
/// # Errors
/// A file that cannot be read, that is no Parquet, or that has other kinds of columns than [`write`] makes.
pub fn read(path: &Path, key: &str) -> Result<(String, BTreeMap<String, Values>), DatasetError> {
    let wrong = |found: String, allowed: &str| DatasetError::Content {
        place: path.display().to_string(),
        found,
        allowed: allowed.to_owned(),
    };
    let broken = |cause: ParquetError| wrong(format!("cannot be read ({cause})"), "it must be a whole Parquet file");
    let unreadable = |e: std::io::Error| DatasetError::Unreadable { path: path.into(), reason: e.to_string() };
    let unsealed = || {
        let allowed = "it must be a Parquet file as `vernis extract` or `vernis merge` wrote it";
        wrong("has no valid seal (it is damaged, cut off, or of another origin)".into(), allowed)
    };
    let mut file = open_regular(path).map_err(unreadable)?;
    let size = file.metadata().map_err(unreadable)?.len();
    // A file that is none at its end is not read, however large it is.
    let mut tail = Vec::new();
    let read = file.seek(SeekFrom::Start(size.saturating_sub(TAIL as u64)));
    read.and_then(|_| (&file).take(TAIL as u64).read_to_end(&mut tail)).map_err(unreadable)?;
    if !tail.ends_with(MAGIC) || size > MOST_BYTES {
        return Err(unsealed());
    }
    // What is looked at is what was sealed, whatever becomes of the file meanwhile.
    let bytes = file.get_bytes(0, size as usize).map_err(broken)?;
    if !is_whole(&bytes) {
        return Err(unsealed());
    }
    // Anybody can seal a file. The reader panics at some that no writer makes.
    let hostile = || wrong("is no Parquet file that a program writes".into(), "it must be of `vernis extract`");
    catch_unwind(AssertUnwindSafe(|| columns(bytes, key, &wrong))).unwrap_or_else(|_| Err(hostile()))
}

/// [`read`] of sealed bytes; `wrong` makes an error of what was found and what is allowed.
fn columns(
    bytes: impl ChunkReader + 'static,
    key: &str,
    wrong: &dyn Fn(String, &str) -> DatasetError,
) -> Result<(String, BTreeMap<String, Values>), DatasetError> {
    let broken = |cause: ParquetError| wrong(format!("cannot be read ({cause})"), "it must be a whole Parquet file");
    let reader = SerializedFileReader::new(bytes).map_err(broken)?;
    let plain = |group: &RowGroupMetaData| group.columns().iter().all(|c| c.compression() == Compression::UNCOMPRESSED);
    if !reader.metadata().row_groups().iter().all(plain) {
        return Err(wrong("has compressed columns".into(), "it must have none, as `vernis extract` writes it"));
    }
    let metadata = reader.metadata().file_metadata();
    let rows = reader
        .metadata()
        .row_groups()
        .iter()
        .map(|group| group.num_rows().max(0))
        .sum::<i64>()
        .max(metadata.num_rows());
    let cells = (rows as u64).saturating_mul(metadata.schema().get_fields().len() as u64);
    if cells > MOST_CELLS {
        return Err(wrong(format!("says that it has {cells} cells"), &format!("it must have at most {MOST_CELLS}")));
    }
    let header = metadata.key_value_metadata().into_iter().flatten().find(|pair| pair.key == key);
    let header = header.and_then(|pair| pair.value.clone());
    let header = header
        .ok_or_else(|| wrong(format!("has no `{key}` in its metadata"), "it must be a file of `vernis extract`"))?;
    let mut columns: Vec<(String, Values)> = Vec::new();
    for field in metadata.schema().get_fields() {
        let empty = match field.is_primitive().then(|| field.get_physical_type()) {
            Some(Physical::BYTE_ARRAY) => Values::Text(Vec::new()),
            Some(Physical::DOUBLE) => Values::Number(Vec::new()),
            Some(Physical::INT64) => Values::Count(Vec::new()),
            _ => {
                return Err(wrong(
                    format!("has column {} of another kind", field.name()),
                    "it must be text, double or int64",
                ));
            }
        };
        columns.push((field.name().to_owned(), empty));
    }
    for (number, row) in reader.get_row_iter(None).map_err(broken)?.enumerate() {
        let row = row.map_err(broken)?;
        for ((name, values), (_, field)) in columns.iter_mut().zip(row.get_column_iter()) {
            match (values, field) {
                (Values::Text(texts), Field::Str(text)) => texts.push(Some(text.clone())),
                (Values::Text(texts), Field::Null) => texts.push(None),
                (Values::Number(numbers), Field::Double(value)) => numbers.push(*value),
                (Values::Count(counts), Field::Long(value)) if *value >= 0 => counts.push(*value as usize),
                (_, other) => {
                    let found = format!("has {other} in column {name}, row {number}");
                    return Err(wrong(found, "it must be text, a number, or a count of at least 0, as in the schema"));
                }
            }
        }
    }
    Ok((header, columns.into_iter().collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;
    use vernis_metric::math::seed::stream;

    /// A file as [`write`] makes it, its seal made anew after `change`.
    fn sealed_again(change: impl Fn(&mut Vec<u8>)) -> Vec<u8> {
        let columns = [
            ("text".to_owned(), Values::Text(vec![Some("a".into()), None, Some("b".into())])),
            ("number".to_owned(), Values::Number(vec![1.0, 2.0, 3.0])),
            ("count".to_owned(), Values::Count(vec![1, 2, 3])),
        ];
        let mut bytes = write("key", "header", &columns).unwrap();
        let at = footer(&bytes).unwrap();
        bytes.drain(at - SEAL..at);
        change(&mut bytes);
        let Some(at) = footer(&bytes) else { return bytes };
        let seal: [u8; SEAL] = Sha256::digest(&bytes).into();
        bytes.splice(at..at, seal);
        bytes
    }

    #[test]
    fn a_hostile_file_with_a_whole_seal_is_an_error_or_a_table() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.parquet");
        let load = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            read(&path, "key")
        };
        assert_eq!(load(&sealed_again(|_| ())).unwrap().1.len(), 3);
        let mut refused = 0;
        for case in 0..2000 {
            let hit = |bytes: &mut Vec<u8>| {
                let mut random = stream(1, "hostile parquet", case);
                for _ in 0..random.random_range(1..4) {
                    // The last eight bytes only say where the footer is.
                    let at = random.random_range(0..bytes.len() - TAIL);
                    bytes[at] = random.random_range(0..=255);
                }
            };
            if let Err(error) = load(&sealed_again(hit)) {
                assert!(error.to_string().contains("x.parquet"), "{error}");
                refused += 1;
            }
        }
        assert!(refused > 200, "only {refused} damaged files were refused");
    }
}
