//! Files that hold reflectance functions, one file format each.

pub mod archive;
pub mod fit;
pub mod merl;
pub mod model_json;
pub mod nbrdf;
pub mod npf;
pub mod titopo;

use super::{BrdfError, Grid, TableError, TabulatedBrdf};
use memmap2::Mmap;
use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
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
                reason: format!("the extension is `{other}`; allowed: zip, fit, bin"),
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

/// Maps a file into memory.
pub(super) fn map(path: &Path) -> Result<Mmap, BrdfError> {
    let file = File::open(path).map_err(io_error(path))?;
    // SAFETY: the map is read-only and private to the reader of one file, which ends before it returns. Another
    // process that shortens the file meanwhile would stop this one; no file of this kind is written in place.
    unsafe { Mmap::map(&file) }.map_err(io_error(path))
}

/// The bytes of a file of at most `most` bytes.
///
/// # Errors
/// What the operating system says, or that there is more: nothing beyond is read.
pub(crate) fn read_at_most(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        let found = std::fs::metadata(path)?.len().max(most + 1);
        return Err(io::Error::new(
            io::ErrorKind::FileTooLarge,
            format!("the file has at least {found} bytes; allowed: at most {most}"),
        ));
    }
    Ok(bytes)
}

/// Writes a file through a temporary name in the same folder, so that a failure leaves an earlier file intact.
fn write_fresh(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<(), BrdfError> {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let temporary = path.with_file_name(format!(".{name}.{}.partial", std::process::id()));
    let written = File::create(&temporary).and_then(|file| {
        let mut out = BufWriter::with_capacity(1 << 20, file);
        content(&mut out)?;
        out.flush()?;
        std::fs::rename(&temporary, path)
    });
    if written.is_err() {
        // The first failure is the one to report.
        let _ = std::fs::remove_file(&temporary);
    }
    written.map_err(io_error(path))
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
