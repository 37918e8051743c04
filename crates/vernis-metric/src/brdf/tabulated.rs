//! A BRDF as a table: grid, values and a validity mask.

use super::Brdf;
use super::cell_finder::CellFinder;
use super::grid::Grid;
use crate::math::parallel;
use crate::math::{Rgb, Vec3};
use thiserror::Error;

/// Cells handed to a thread at a time.
const CHUNK: usize = 4096;

/// What is wrong with a table.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum TableError {
    #[error("the grid has {expected} cells, but {found} {what} were given")]
    Length { what: &'static str, expected: usize, found: usize },
    #[error("valid cell {index} holds {value:?}; a measured value must be finite and not negative")]
    Value { index: usize, value: [f32; 3] },
    #[error("the table has no valid cell")]
    NoValidCell,
}

/// A tabulated BRDF. Cells without a measurement are masked and take part in no sum.
#[derive(Debug, Clone)]
pub struct TabulatedBrdf {
    grid: Grid,
    values: Vec<[f32; 3]>,
    valid: Vec<bool>,
    finder: CellFinder,
}

impl TabulatedBrdf {
    /// The one checked constructor: `values` (linear RGB, 1/sr, cosine not included) and `valid` have one entry a cell,
    /// in the grid's order; every valid value is finite and not negative; at least one cell is valid.
    pub fn new(grid: Grid, values: Vec<[f32; 3]>, valid: Vec<bool>) -> Result<Self, TableError> {
        let expected = grid.len();
        if values.len() != expected {
            return Err(TableError::Length { what: "values", expected, found: values.len() });
        }
        if valid.len() != expected {
            return Err(TableError::Length { what: "mask entries", expected, found: valid.len() });
        }
        let bad =
            |(valid, v): (&bool, &[f32; 3])| *valid & v.iter().fold(false, |any, c| any | !c.is_finite() | (*c < 0.0));
        // A chunk at a time, without a way out inside: the compiler takes several cells at once.
        let chunks = valid.chunks(CHUNK).zip(values.chunks(CHUNK));
        let is_bad =
            |(valid, values): (&[bool], &[[f32; 3]])| valid.iter().zip(values).fold(false, |any, cell| any | bad(cell));
        if let Some(chunk) = chunks.map(is_bad).position(|is_bad| is_bad)
            && let Some(index) = (chunk * CHUNK..expected).find(|&i| bad((&valid[i], &values[i])))
        {
            return Err(TableError::Value { index, value: values[index] });
        }
        if !valid.contains(&true) {
            return Err(TableError::NoValidCell);
        }
        Ok(Self { grid, values, valid, finder: CellFinder::new(grid) })
    }

    /// `brdf` evaluated at every cell of `grid`, in parallel. Directions below the horizon and missing measurements
    /// become invalid cells; colours outside the gamut lose their negative components.
    pub fn tabulate(brdf: &dyn Brdf, grid: Grid) -> Result<Self, TableError> {
        let n = grid.len();
        let mut values = vec![[0.0f32; 3]; n];
        let mut valid = vec![false; n];
        let directions = grid.all_directions();
        parallel::for_each_chunk_of_two(&mut values, &mut valid, CHUNK, |chunk, values, valid| {
            let (wi, wo): (Vec<_>, Vec<_>) = (0..values.len()).map(|k| directions.get(chunk * CHUNK + k)).unzip();
            let mut out = vec![None; values.len()];
            brdf.eval_in_gamut(&wi, &wo, &mut out);
            for k in 0..values.len() {
                if let Some(c) = out[k] {
                    values[k] = c.map(|x| x as f32);
                    valid[k] = wi[k].z > 0.0 && wo[k].z > 0.0;
                }
            }
        });
        Self::new(grid, values, valid)
    }

    /// The table on another grid: each cell takes the value and the validity of the cell of `self` that contains its
    /// directions. Cells whose directions lie below the horizon are invalid.
    ///
    /// Between grids of the same coordinates the axes are matched one by one, which also keeps apart the cells at a
    /// pole, whose directions are the same.
    pub fn resampled(&self, grid: Grid) -> Result<Self, TableError> {
        let same_coordinates = std::mem::discriminant(&self.grid) == std::mem::discriminant(&grid);
        if same_coordinates {
            let [a, b, c] = std::array::from_fn(|axis| self.grid.bins_of(grid, axis));
            let [_, n1, n2] = self.grid.shape();
            self.gathered(grid, |index| {
                let row = index / c.len();
                Some((a[row / b.len()] * n1 + b[row % b.len()]) * n2 + c[index % c.len()])
            })
        } else {
            let directions = grid.all_directions();
            self.gathered(grid, |index| {
                let (wi, wo) = directions.get(index);
                self.finder.cell(wi, wo)
            })
        }
    }

    /// The table on `grid` whose cell `index` is a copy of the cell `source(index)`, or invalid where there is none.
    fn gathered(&self, grid: Grid, source: impl Fn(usize) -> Option<usize> + Sync) -> Result<Self, TableError> {
        let mut values = vec![[0.0f32; 3]; grid.len()];
        let mut valid = vec![false; grid.len()];
        parallel::for_each_chunk_of_two(&mut values, &mut valid, CHUNK, |chunk, values, valid| {
            for k in 0..values.len() {
                if let Some(cell) = source(chunk * CHUNK + k) {
                    values[k] = self.values[cell];
                    valid[k] = self.valid[cell];
                }
            }
        });
        Self::new(grid, values, valid)
    }

    /// The cells that the values belong to.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// One linear RGB value a cell; the values of invalid cells are unspecified.
    pub fn values(&self) -> &[[f32; 3]] {
        &self.values
    }

    /// Which cells hold a measurement.
    pub fn valid(&self) -> &[bool] {
        &self.valid
    }
}

impl Brdf for TabulatedBrdf {
    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        match self.finder.cell(wi, wo) {
            None => Some([0.0; 3]),
            Some(cell) => self.valid[cell].then(|| self.values[cell].map(f64::from)),
        }
    }

    fn as_table(&self) -> Option<&TabulatedBrdf> {
        Some(self)
    }
}
