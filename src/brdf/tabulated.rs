//! A BRDF as a table: grid, values and a validity mask.

use super::Brdf;
use crate::math::coordinates::{
    HalfDifference, fold_reciprocal, half_difference, half_difference_directions, standard_directions,
};
use crate::math::{Rgb, Vec3};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};
use thiserror::Error;

/// Where in its cell a value of a [`Grid::Standard`] table belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Anchor {
    /// At the lower edge of the cell: index i of 90 means i degrees (Titopo files, and the study's own metrics).
    Edge,
    /// At the centre of the cell: index i of 90 means i + 0.5 degrees (the transport metrics).
    Centre,
}

/// The cells of a table. Cells are stored in row-major order of the fields as they are listed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Grid {
    /// MERL: `theta_h` rows are spaced by the square root, `theta_d` linearly over 0 to 90 degrees, and `phi_d`
    /// linearly over 0 to 180 degrees (180 columns, reciprocal) or 0 to 360 degrees (360 columns).
    HalfDifference { theta_h: usize, theta_d: usize, phi_d: usize },
    /// Standard coordinates with phi_i = 0: both polar angles over 0 to 90 degrees, `phi_d` over 0 to 360 degrees.
    Standard { theta_i: usize, theta_o: usize, phi_d: usize, anchor: Anchor },
}

impl Grid {
    /// The MERL grid, 90 x 90 x 180, whose reciprocal half is stored.
    pub const MERL: Self = Self::HalfDifference { theta_h: 90, theta_d: 90, phi_d: 180 };
    /// The MERL grid of non-reciprocal approximations, 90 x 90 x 360.
    pub const MERL_FULL: Self = Self::HalfDifference { theta_h: 90, theta_d: 90, phi_d: 360 };
    /// The Titopo grid, 90 x 90 x 360, one degree a cell, values at lower cell edges.
    pub const TITOPO: Self = Self::Standard { theta_i: 90, theta_o: 90, phi_d: 360, anchor: Anchor::Edge };
    /// The half-resolution Titopo grid, 45 x 45 x 180: every second sample of [`Grid::TITOPO`].
    pub const TITOPO_HALF: Self = Self::Standard { theta_i: 45, theta_o: 45, phi_d: 180, anchor: Anchor::Edge };

    /// Number of cells along each axis.
    pub fn shape(&self) -> [usize; 3] {
        match *self {
            Self::HalfDifference { theta_h, theta_d, phi_d } => [theta_h, theta_d, phi_d],
            Self::Standard { theta_i, theta_o, phi_d, .. } => [theta_i, theta_o, phi_d],
        }
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.shape().iter().product()
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The directions `(wi, wo)` at which the value of cell `index` belongs. `wi` or `wo` may lie below the horizon on
    /// a half/difference grid.
    pub fn directions(&self, index: usize) -> (Vec3, Vec3) {
        let [_, n1, n2] = self.shape();
        let (i, j, k) = (index / (n1 * n2), index / n2 % n1, index % n2);
        match *self {
            Self::HalfDifference { theta_h, theta_d, phi_d } => {
                let span = if phi_d > 2 * theta_d { 2.0 * PI } else { PI };
                let row = (i as f64 + 0.5) / theta_h as f64;
                half_difference_directions(HalfDifference {
                    theta_h: row * row * FRAC_PI_2,
                    theta_d: (j as f64 + 0.5) * FRAC_PI_2 / theta_d as f64,
                    phi_d: (k as f64 + 0.5) * span / phi_d as f64,
                })
            }
            Self::Standard { theta_i, theta_o, phi_d, anchor } => {
                let offset = if anchor == Anchor::Centre { 0.5 } else { 0.0 };
                standard_directions(
                    (i as f64 + offset) * FRAC_PI_2 / theta_i as f64,
                    (j as f64 + offset) * FRAC_PI_2 / theta_o as f64,
                    (k as f64 + offset) * 2.0 * PI / phi_d as f64,
                )
            }
        }
    }

    /// The cell that contains a pair of directions; `None` when either is below the horizon.
    pub fn cell(&self, wi: Vec3, wo: Vec3) -> Option<usize> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return None;
        }
        let bin = |x: f64, n: usize| (x.max(0.0) as usize).min(n - 1);
        let [n0, n1, n2] = self.shape();
        let (i, j, k) = match *self {
            Self::HalfDifference { theta_h, theta_d, phi_d } => {
                let c = half_difference(wi, wo);
                let phi = if phi_d > 2 * theta_d {
                    c.phi_d.rem_euclid(2.0 * PI) / (2.0 * PI)
                } else {
                    fold_reciprocal(c.phi_d) / PI
                };
                (
                    bin((c.theta_h / FRAC_PI_2).max(0.0).sqrt() * theta_h as f64, n0),
                    bin(c.theta_d / FRAC_PI_2 * theta_d as f64, n1),
                    bin(phi * phi_d as f64, n2),
                )
            }
            Self::Standard { theta_i, theta_o, phi_d, .. } => {
                // A value at a cell's edge must find its own cell after a round trip through directions.
                let snap = 1e-9;
                let polar = |w: Vec3| w.x.hypot(w.y).atan2(w.z) / FRAC_PI_2;
                let phi = (wo.y.atan2(wo.x) - wi.y.atan2(wi.x)).rem_euclid(2.0 * PI) / (2.0 * PI);
                (
                    bin(polar(wi) * theta_i as f64 + snap, n0),
                    bin(polar(wo) * theta_o as f64 + snap, n1),
                    bin(phi * phi_d as f64 + snap, usize::MAX) % n2,
                )
            }
        };
        Some((i * n1 + j) * n2 + k)
    }
}

/// What is wrong with a table.
#[derive(Debug, Clone, PartialEq, Error)]
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
        let bad = |v: &[f32; 3]| v.iter().any(|c| !c.is_finite() || *c < 0.0);
        if let Some(index) = (0..expected).find(|&i| valid[i] && bad(&values[i])) {
            return Err(TableError::Value { index, value: values[index] });
        }
        if !valid.contains(&true) {
            return Err(TableError::NoValidCell);
        }
        Ok(Self { grid, values, valid })
    }

    /// `brdf` evaluated at every cell of `grid`, in parallel. Directions below the horizon and missing measurements
    /// become invalid cells.
    pub fn tabulate(brdf: &dyn Brdf, grid: Grid) -> Result<Self, TableError> {
        let n = grid.len();
        let mut values = vec![[0.0f32; 3]; n];
        let mut valid = vec![false; n];
        const CHUNK: usize = 4096;
        values.par_chunks_mut(CHUNK).zip(valid.par_chunks_mut(CHUNK)).enumerate().for_each(
            |(chunk, (values, valid))| {
                let (wi, wo): (Vec<_>, Vec<_>) = (0..values.len()).map(|k| grid.directions(chunk * CHUNK + k)).unzip();
                let mut out = vec![None; values.len()];
                brdf.eval_batch(&wi, &wo, &mut out);
                for k in 0..values.len() {
                    if let Some(c) = out[k] {
                        values[k] = c.map(|x| x as f32);
                        valid[k] = wi[k].z > 0.0 && wo[k].z > 0.0;
                    }
                }
            },
        );
        Self::new(grid, values, valid)
    }

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
        match self.grid.cell(wi, wo) {
            None => Some([0.0; 3]),
            Some(cell) => self.valid[cell].then(|| self.values[cell].map(f64::from)),
        }
    }

    fn as_table(&self) -> Option<&TabulatedBrdf> {
        Some(self)
    }
}
