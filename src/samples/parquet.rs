//! Named columns in an Apache Parquet file, which any dataframe engine reads: flat, one row group, uncompressed.
//!
//! Readers of the format find everything from the end of the file: the footer, its length (u32, little-endian) and the magic
//! `PAR1`. Between the columns and the footer, where they do not look, stands a seal: the SHA-256 of all other bytes. The crate
//! that reads the format panics where a footer is damaged; it only ever sees files whose seal is whole.
//!
//! Source of the format: <https://parquet.apache.org/docs/file-format/>, by the crate of the Arrow project.

use crate::dataset::DatasetError;
use parquet::basic::{ConvertedType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::record::Field;
use parquet::schema::types::Type;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use vernis_metric::io::read_at_most;

/// Bytes of the seal.
const SEAL: usize = 32;
/// Length of the footer and magic, at the end.
const TAIL: usize = 8;
/// Hundreds of times what the study takes.
const MOST_BYTES: u64 = 4 << 30;

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
    (magic == b"PAR1").then_some(body.len().checked_sub(length)?)
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
    if !is_whole(&read_at_most(path, MOST_BYTES).map_err(unreadable)?) {
        let allowed = "it must be a Parquet file as `vernis extract` or `vernis merge` wrote it";
        return Err(wrong("has no valid seal (it is damaged, cut off, or of another origin)".into(), allowed));
    }
    let file = File::open(path).map_err(unreadable)?;
    let reader = SerializedFileReader::new(file).map_err(broken)?;
    let metadata = reader.metadata().file_metadata();
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
