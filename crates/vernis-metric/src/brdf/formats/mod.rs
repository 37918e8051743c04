//! Files that hold reflectance functions, one file format each.

pub mod archive;
pub mod fit;
mod foreign;
pub mod merl;
pub mod model_json;
pub mod nbrdf;
pub mod npf;
pub mod rgl;
pub mod titopo;

pub(super) use foreign::what_it_is;

use super::source::ContentHash;
use super::{BrdfError, Grid, TableError, TabulatedBrdf};
use crate::io::{NewFile, open_regular};
use sha2::{Digest, Sha256};
use std::io::{self, Read};
use std::path::Path;

/// The materials that an archive (`.zip`), a file of fits (`.fit`) or a factor file (`.bin`) holds, sorted.
pub fn materials(path: &Path) -> Result<Vec<String>, BrdfError> {
    let mut names = match extension(path).as_str() {
        "zip" => archive::materials(path)?,
        "fit" => fit::materials(path)?,
        "bin" => npf::materials(path)?,
        other => {
            return Err(BrdfError::Malformed {
                path: path.to_owned(),
                format: "collection of materials",
                reason: format!("the extension is `{other}`; it must be zip, fit or bin"),
            });
        }
    };
    names.sort();
    Ok(names)
}

/// The extension of a file name in lower case, empty if there is none.
pub(super) fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

fn io_error(path: &Path) -> impl Fn(std::io::Error) -> BrdfError {
    move |cause| BrdfError::Io { path: path.to_owned(), cause }
}

fn table_error(path: &Path) -> impl Fn(TableError) -> BrdfError {
    move |cause| BrdfError::Table { path: path.to_owned(), cause }
}

/// Bytes at the beginning of a file that tell its size: the header of a MERL table.
const HEAD: usize = 12;
/// Bytes read at a time where they are not kept: whole cells of either table, and little enough for a processor's cache.
const PART: usize = 12 << 14;

/// Reads a file whose size is known beforehand without keeping its bytes. `begin` sees the first [`HEAD`] bytes and the size of the file.
/// It may refuse before the rest is read: a wrong file may be of any size. `take` sees what follows, [`PART`] bytes at a time. Returns the
/// number of bytes that there were: fewer than the size where the file has shrunk since.
///
/// Files are read, not mapped: a mapped file that another process shortens ends this one without a message.
fn read_in_parts<S>(
    path: &Path,
    begin: impl FnOnce(&[u8], u64) -> Result<S, BrdfError>,
    mut take: impl FnMut(&mut S, &[u8]),
) -> Result<(S, u64), BrdfError> {
    let mut file = open_regular(path).map_err(io_error(path))?;
    let size = file.metadata().map_err(io_error(path))?.len();
    let mut part = Vec::with_capacity(PART);
    file.by_ref().take(HEAD as u64).read_to_end(&mut part).map_err(io_error(path))?;
    let mut state = begin(&part, size)?;
    let mut found = part.len() as u64;
    while found < size {
        part.clear();
        let rest = (PART as u64).min(size - found);
        let read = file.by_ref().take(rest).read_to_end(&mut part).map_err(io_error(path))?;
        if read == 0 {
            break;
        }
        take(&mut state, &part);
        found += read as u64;
    }
    Ok((state, found))
}

/// The SHA-256 of a file, whose bytes are not kept. `check` sees the first [`HEAD`] bytes and the size of the file, and refuses before the
/// rest is read.
pub(super) fn content(
    path: &Path,
    check: impl FnOnce(&[u8], u64) -> Result<(), BrdfError>,
) -> Result<ContentHash, BrdfError> {
    let begin = |head: &[u8], size| {
        check(head, size)?;
        Ok(Sha256::new_with_prefix(head))
    };
    let (hash, _) = read_in_parts(path, begin, |hash, part| hash.update(part))?;
    Ok(ContentHash(hash.finalize().into()))
}

/// Writes a file as a whole or not at all.
fn write_fresh(path: &Path, content: impl FnOnce(&mut NewFile) -> io::Result<()>) -> Result<(), BrdfError> {
    let write = || {
        let mut file = NewFile::create(path)?;
        content(&mut file)?;
        file.finish()
    };
    write().map_err(io_error(path))
}

fn unfit_grid(path: &Path, format: &'static str, table: &TabulatedBrdf, allowed: &'static str) -> BrdfError {
    let coordinates = match table.grid() {
        Grid::HalfDifference { .. } => "half/difference",
        Grid::Standard { .. } => "standard",
    };
    let [a, b, c] = table.grid().shape();
    let found = format!("a {a}x{b}x{c} table in {coordinates} coordinates");
    BrdfError::Grid { path: path.to_owned(), format, found, allowed }
}
