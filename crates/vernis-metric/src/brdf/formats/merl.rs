//! MERL `.binary`: measured isotropic BRDFs in half/difference coordinates.
//!
//! Three little-endian i32 (90, 90, 180; or 90, 90, 360 for approximations that are not reciprocal), then the planes
//! R, G, B of f64, index = phi_d + n_phi (theta_d + 90 theta_h). A BRDF value (1/sr) is the stored number times
//! (1, 1.15, 1.66)/1500. A negative number marks a missing measurement.
//!
//! Source: Matusik et al. 2003, doi:10.1145/882262.882343, and the reader published with the data.
//! Cost: one pass over the bytes of the file.

use super::{read_in_parts, table_error, unfit_grid, write_fresh};
use crate::brdf::{BrdfError, Grid, TabulatedBrdf};
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

/// Reads a file of either size; its bytes are not kept.
///
/// # Errors
/// A size or header that is neither, a NaN or infinity, or no valid cell at all.
pub fn read(path: &Path) -> Result<TabulatedBrdf, BrdfError> {
    let begin = |head: &[u8], size| grid(path, head, size).map(Decoder::new);
    let (decoder, found) = read_in_parts(path, begin, |decoder, part| decoder.take(part.as_chunks().0))?;
    decoder.finish(path, found)
}

/// The table in the bytes of a file; `path` is for messages.
///
/// # Errors
/// As [`read`].
pub fn decode(path: &Path, bytes: &[u8]) -> Result<TabulatedBrdf, BrdfError> {
    let mut decoder = Decoder::new(grid(path, bytes, bytes.len() as u64)?);
    decoder.take(bytes[HEADER..].as_chunks().0);
    decoder.finish(path, bytes.len() as u64)
}

/// A table whose numbers come one part after the other.
struct Decoder {
    grid: Grid,
    values: Vec<[f32; 3]>,
    valid: Vec<bool>,
    /// How many numbers came.
    count: usize,
    /// The first number that is not finite as a value: its channel, its cell, and itself.
    strange: Option<(usize, usize, f64)>,
}

impl Decoder {
    fn new(grid: Grid) -> Self {
        let n = grid.len();
        Self { grid, values: vec![[0.0; 3]; n], valid: vec![true; n], count: 0, strange: None }
    }

    fn take(&mut self, mut numbers: &[[u8; 8]]) {
        let n = self.grid.len();
        while !numbers.is_empty() && self.count < 3 * n {
            let (channel, first) = (self.count / n, self.count % n);
            let (part, rest) = numbers.split_at(numbers.len().min(n - first));
            let cells = self.values[first..].iter_mut().zip(&mut self.valid[first..]);
            let mut is_strange = false;
            for (bytes, (value, valid)) in part.iter().zip(cells) {
                let stored = f64::from_le_bytes(*bytes);
                value[channel] = (stored * SCALE[channel]) as f32;
                *valid &= stored >= 0.0;
                is_strange |= !value[channel].is_finite();
            }
            if is_strange && self.strange.is_none() {
                let values = self.values[first..].iter().zip(part);
                let found = values.enumerate().find(|(_, (value, _))| !value[channel].is_finite());
                self.strange = found.map(|(k, (_, bytes))| (channel, first + k, f64::from_le_bytes(*bytes)));
            }
            self.count += part.len();
            numbers = rest;
        }
    }

    /// The table; `size`: the number of bytes that there were.
    fn finish(self, path: &Path, size: u64) -> Result<TabulatedBrdf, BrdfError> {
        let grid = self.grid;
        let n_phi = grid.shape()[2];
        if self.count < 3 * grid.len() {
            return Err(wrong_size(path, size, format!("{} for its header 90x90x{n_phi}", file_size(grid))));
        }
        if let Some((channel, cell, found)) = self.strange {
            let (row, column, phi) = (cell / (90 * n_phi), cell / n_phi % 90, cell % n_phi);
            return Err(BrdfError::Value {
                path: path.to_owned(),
                place: format!("{} plane, cell theta_h {row}, theta_d {column}, phi_d {phi}", ["R", "G", "B"][channel]),
                found,
                allowed: "a finite number, negative where the measurement is missing",
            });
        }
        TabulatedBrdf::new(grid, self.values, self.valid).map_err(table_error(path))
    }
}

fn wrong_size(path: &Path, found: u64, allowed: String) -> BrdfError {
    BrdfError::Size { path: path.to_owned(), format: "MERL", found, allowed }
}

/// The grid of the table in a file, by its first bytes and its size.
pub(in crate::brdf) fn grid(path: &Path, head: &[u8], size: u64) -> Result<Grid, BrdfError> {
    let wrong = |allowed| wrong_size(path, size, allowed);
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
