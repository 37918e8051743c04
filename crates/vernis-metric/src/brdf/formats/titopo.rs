//! Titopo: tabulated BRDFs in standard coordinates, the format of the rated approximations.
//!
//! `.titopo` has no header: little-endian f32 over `[theta_i 0..89 deg][theta_o 0..89 deg][phi_o 0..359 deg][RGB]`,
//! with phi_i = 0, sampled at the lower edges of the cells; 34,992,000 bytes. `.titopoh` holds every second sample of
//! each axis; 4,374,000 bytes. Values are BRDFs (1/sr, cosine not included). Negative and non-finite numbers occur and
//! mean that nothing is known there; fresh files mark such cells by NaN.
//!
//! Source: the data of Lavoue et al. 2021, doi:10.1111/cgf.142636. Cost: one parallel pass over the bytes of the file.

use super::{extension, read_checked, table_error, unfit_grid, write_fresh};
use crate::brdf::{BrdfError, Grid, TabulatedBrdf};
use rayon::prelude::*;
use std::io::Write;
use std::path::Path;

/// The larger of the two sizes.
pub(super) const MOST_BYTES: u64 = 3 * 4 * 90 * 90 * 360;

/// Reads a `.titopo` or `.titopoh` file; the extension says which.
///
/// # Errors
/// Any other size than the exact one, or no valid cell at all.
pub fn read(path: &Path) -> Result<TabulatedBrdf, BrdfError> {
    decode(path, &bytes(path)?)
}

/// The bytes of a file that is a table by its size.
pub(in crate::brdf) fn bytes(path: &Path) -> Result<Vec<u8>, BrdfError> {
    read_checked(path, |_, size| grid(path, size).map(drop))
}

/// The table in the bytes of a file whose name is `path`.
///
/// # Errors
/// As [`read`].
pub fn decode(path: &Path, bytes: &[u8]) -> Result<TabulatedBrdf, BrdfError> {
    let grid = grid(path, bytes.len() as u64)?;
    let (cells, _) = bytes.as_chunks::<12>();
    let (values, valid): (Vec<[f32; 3]>, Vec<bool>) = cells
        .par_iter()
        .with_min_len(1 << 14)
        .map(|cell| {
            let value: [f32; 3] = std::array::from_fn(|c| f32::from_le_bytes(std::array::from_fn(|b| cell[4 * c + b])));
            (value, value.iter().all(|v| v.is_finite() && *v >= 0.0))
        })
        .unzip();
    TabulatedBrdf::new(grid, values, valid).map_err(table_error(path))
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
