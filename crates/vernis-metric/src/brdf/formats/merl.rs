//! MERL `.binary`: measured isotropic BRDFs in half/difference coordinates.
//!
//! Three little-endian i32 (90, 90, 180; or 90, 90, 360 for approximations that are not reciprocal), then the planes
//! R, G, B of f64, index = phi_d + n_phi (theta_d + 90 theta_h). A BRDF value (1/sr) is the stored number times
//! (1, 1.15, 1.66)/1500. A negative number marks a missing measurement.
//!
//! Source: Matusik et al. 2003, doi:10.1145/882262.882343, and the reader published with the data.
//! Cost: one parallel pass over the bytes of the file.

use super::{read_checked, table_error, unfit_grid, write_fresh};
use crate::brdf::{BrdfError, Grid, TabulatedBrdf};
use rayon::prelude::*;
use std::io::Write;
use std::path::Path;

/// What the stored numbers of each channel are multiplied by.
pub const SCALE: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

/// The channel factors alone, which parameters fitted to unscaled data lack.
pub const CHANNEL_FACTORS: [f64; 3] = [1.0, 1.15, 1.66];

const HEADER: usize = 12;
/// The larger of the two sizes.
pub(super) const MOST_BYTES: u64 = HEADER as u64 + 3 * 8 * 90 * 90 * 360;
/// The mark of a missing measurement in fresh files.
const MISSING: f64 = -1.0;

/// Reads a file of either size.
///
/// # Errors
/// A size or header that is neither, a NaN or infinity, or no valid cell at all.
pub fn read(path: &Path) -> Result<TabulatedBrdf, BrdfError> {
    decode(path, &bytes(path)?)
}

/// The bytes of a file that is a table by its size and header.
pub(in crate::brdf) fn bytes(path: &Path) -> Result<Vec<u8>, BrdfError> {
    read_checked(path, |head, size| grid(path, head, size).map(drop))
}

/// The table in the bytes of a file; `path` is for messages.
///
/// # Errors
/// As [`read`].
pub fn decode(path: &Path, bytes: &[u8]) -> Result<TabulatedBrdf, BrdfError> {
    let grid = grid(path, bytes, bytes.len() as u64)?;
    let (numbers, _) = bytes[HEADER..].as_chunks::<8>();
    let n = grid.len();
    let stored = |channel: usize, cell: usize| f64::from_le_bytes(numbers[channel * n + cell]);
    let (values, valid): (Vec<[f32; 3]>, Vec<bool>) = (0..n)
        .into_par_iter()
        .with_min_len(1 << 14)
        .map(|cell| {
            let raw: [f64; 3] = std::array::from_fn(|channel| stored(channel, cell));
            (std::array::from_fn(|c| (raw[c] * SCALE[c]) as f32), raw.iter().all(|v| *v >= 0.0))
        })
        .unzip();
    let strange = |v: &[f32; 3]| v.iter().any(|x| !x.is_finite());
    if let Some(cell) = values.iter().position(strange) {
        let channel = (0..3).find(|&c| !values[cell][c].is_finite()).unwrap_or(0);
        let n_phi = grid.shape()[2];
        let (row, column, phi) = (cell / (90 * n_phi), cell / n_phi % 90, cell % n_phi);
        return Err(BrdfError::Value {
            path: path.to_owned(),
            place: format!("{} plane, cell theta_h {row}, theta_d {column}, phi_d {phi}", ["R", "G", "B"][channel]),
            found: stored(channel, cell),
            allowed: "a finite number, negative where the measurement is missing",
        });
    }
    TabulatedBrdf::new(grid, values, valid).map_err(table_error(path))
}

/// The grid of the table in a file, by its first bytes and its size.
pub(in crate::brdf) fn grid(path: &Path, head: &[u8], size: u64) -> Result<Grid, BrdfError> {
    let wrong = |allowed: String| BrdfError::Size { path: path.to_owned(), format: "MERL", found: size, allowed };
    let (Some(header), true) = (head.get(..HEADER), size > HEADER as u64) else {
        return Err(wrong(format!("{} or {}", file_size(Grid::MERL), file_size(Grid::MERL_FULL))));
    };
    let found: [i32; 3] = std::array::from_fn(|k| i32::from_le_bytes(std::array::from_fn(|b| header[4 * k + b])));
    let grid = match found {
        [90, 90, 180] => Grid::MERL,
        [90, 90, 360] => Grid::MERL_FULL,
        _ => return Err(BrdfError::Header { path: path.to_owned(), found }),
    };
    if size != file_size(grid) as u64 {
        return Err(wrong(format!("{} for its header 90x90x{}", file_size(grid), grid.shape()[2])));
    }
    Ok(grid)
}

/// Writes a table on [`Grid::MERL`] or [`Grid::MERL_FULL`]; masked cells become -1.
pub fn write(path: &Path, table: &TabulatedBrdf) -> Result<(), BrdfError> {
    let grid = table.grid();
    if grid != Grid::MERL && grid != Grid::MERL_FULL {
        return Err(unfit_grid(path, "MERL", table, "Grid::MERL or Grid::MERL_FULL"));
    }
    write_fresh(path, |out| {
        for n in grid.shape() {
            out.write_all(&(n as i32).to_le_bytes())?;
        }
        for (channel, scale) in SCALE.into_iter().enumerate() {
            for (value, valid) in table.values().iter().zip(table.valid()) {
                let stored = if *valid { f64::from(value[channel]) / scale } else { MISSING };
                out.write_all(&stored.to_le_bytes())?;
            }
        }
        Ok(())
    })
}

fn file_size(grid: Grid) -> usize {
    HEADER + 3 * 8 * grid.len()
}
