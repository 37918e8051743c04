//! Titopo: tabulated BRDFs in standard coordinates, the format of the rated approximations.
//!
//! `.titopo` has no header: little-endian f32 over `[theta_i 0..89 deg][theta_o 0..89 deg][phi_o 0..359 deg][RGB]`,
//! with phi_i = 0, sampled at the lower edges of the cells; 34,992,000 bytes. `.titopoh` holds every second sample of
//! each axis; 4,374,000 bytes. Values are BRDFs (1/sr, cosine not included). Negative and non-finite numbers occur and
//! mean that nothing is known there; fresh files mark such cells by NaN.
//!
//! Source: the data of Lavoue et al. 2021, doi:10.1111/cgf.142636. Cost: one pass over the bytes of the file.

use super::{extension, read_in_parts, table_error, unfit_grid, write_fresh};
use crate::brdf::{BrdfError, Grid, TabulatedBrdf};
use std::io::Write;
use std::path::Path;

/// The larger of the two sizes.
pub(super) const MOST_BYTES: u64 = 3 * 4 * 90 * 90 * 360;

/// Reads a `.titopo` or `.titopoh` file; the extension says which. Its bytes are not kept.
///
/// # Errors
/// Any other size than the exact one, or no valid cell at all.
pub fn read(path: &Path) -> Result<TabulatedBrdf, BrdfError> {
    let begin = |head: &[u8], size| {
        let mut decoder = Decoder::new(grid(path, size)?);
        decoder.take(head);
        Ok(decoder)
    };
    let (decoder, found) = read_in_parts(path, begin, Decoder::take)?;
    decoder.finish(path, found)
}

/// The table in the bytes of a file whose name is `path`.
///
/// # Errors
/// As [`read`].
pub fn decode(path: &Path, bytes: &[u8]) -> Result<TabulatedBrdf, BrdfError> {
    let size = bytes.len() as u64;
    let mut decoder = Decoder::new(grid(path, size)?);
    decoder.take(bytes);
    decoder.finish(path, size)
}

/// A table whose cells come one part after the other.
struct Decoder {
    values: Vec<[f32; 3]>,
    valid: Vec<bool>,
}

impl Decoder {
    fn new(grid: Grid) -> Self {
        Self { values: Vec::with_capacity(grid.len()), valid: Vec::with_capacity(grid.len()) }
    }

    /// The next whole cells.
    fn take(&mut self, bytes: &[u8]) {
        let (numbers, _) = bytes.as_chunks::<4>();
        let (cells, _) = numbers.as_chunks::<3>();
        let first = self.values.len();
        self.values.extend(cells.iter().map(|cell| cell.map(f32::from_le_bytes)));
        // Without a way out inside: the compiler takes several cells at once.
        let known = |value: &[f32; 3]| value.iter().fold(true, |all, v| all & v.is_finite() & (*v >= 0.0));
        self.valid.extend(self.values[first..].iter().map(known));
    }

    /// The table; `size`: the number of bytes that there were.
    fn finish(self, path: &Path, size: u64) -> Result<TabulatedBrdf, BrdfError> {
        TabulatedBrdf::new(grid(path, size)?, self.values, self.valid).map_err(table_error(path))
    }
}

/// The grid of the table in a file, by its size alone.
pub(in crate::brdf) fn grid(path: &Path, size: u64) -> Result<Grid, BrdfError> {
    let (format, grid) = kind(path);
    let allowed = 12 * grid.len();
    if size == allowed as u64 {
        return Ok(grid);
    }
    Err(BrdfError::Size { path: path.to_owned(), format, found: size, allowed: format!("exactly {allowed}") })
}

/// Writes a table on the grid that the extension of `path` stands for; masked cells become NaN.
pub fn write(path: &Path, table: &TabulatedBrdf) -> Result<(), BrdfError> {
    let (format, grid) = kind(path);
    if table.grid() != grid {
        let allowed = if grid == Grid::TITOPO { "Grid::TITOPO" } else { "Grid::TITOPO_HALF" };
        return Err(unfit_grid(path, format, table, allowed));
    }
    write_fresh(path, |out| {
        for (value, valid) in table.values().iter().zip(table.valid()) {
            for v in value {
                out.write_all(&if *valid { *v } else { f32::NAN }.to_le_bytes())?;
            }
        }
        Ok(())
    })
}

fn kind(path: &Path) -> (&'static str, Grid) {
    match extension(path).as_str() {
        "titopoh" => ("Titopo at half resolution", Grid::TITOPO_HALF),
        _ => ("Titopo", Grid::TITOPO),
    }
}
