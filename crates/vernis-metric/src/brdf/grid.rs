//! The cells of a reflectance table and the way between cells and directions.

use super::Brdf;
use crate::math::coordinates::{fold_reciprocal, half_difference};
use crate::math::{Rgb, Vec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// How far below the edge of a cell, in cells, its content begins: a value that belongs at an edge must find its own
/// cell whatever the last digit of its angle.
pub(super) const SNAP: f64 = 1e-9;

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
    HalfDifference {
        /// Cells along the angle between half vector and normal.
        theta_h: usize,
        /// Cells along the angle between half vector and incident direction.
        theta_d: usize,
        /// Cells along the azimuth of the incident direction about the half vector.
        phi_d: usize,
    },
    /// Standard coordinates with phi_i = 0: both polar angles over 0 to 90 degrees, `phi_d` over 0 to 360 degrees.
    Standard {
        /// Cells along the polar angle of the incident direction.
        theta_i: usize,
        /// Cells along the polar angle of the outgoing direction.
        theta_o: usize,
        /// Cells along the difference of the two azimuths.
        phi_d: usize,
        /// Where in a cell its value belongs.
        anchor: Anchor,
    },
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

    /// Whether the grid has no cell.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The directions `(wi, wo)` at which the value of cell `index` belongs. `wi` or `wo` may lie below the horizon on
    /// a half/difference grid. Who needs many of them takes [`Grid::all_directions`].
    pub fn directions(&self, index: usize) -> (Vec3, Vec3) {
        let [_, n1, n2] = self.shape();
        let sines = |axis, k| self.angle(axis, k).sin_cos();
        self.directions_of(sines(0, index / (n1 * n2)), sines(1, index / n2 % n1), sines(2, index % n2))
    }

    /// [`Grid::directions`] of every cell, with the trigonometry of each axis done once.
    pub fn all_directions(self) -> GridDirections {
        let shape = self.shape();
        let sines = std::array::from_fn(|axis| (0..shape[axis]).map(|k| self.angle(axis, k).sin_cos()).collect());
        GridDirections { grid: self, sines }
    }

    /// The angle, in radians, at which the values of index `k` along `axis` belong.
    fn angle(&self, axis: usize, k: usize) -> f64 {
        self.edge(axis, k as f64 + self.anchor())
    }

    /// Where in its cell a value belongs: 0 at the lower edge, 0.5 at the centre.
    pub(super) fn anchor(&self) -> f64 {
        match self {
            Self::Standard { anchor: Anchor::Edge, .. } => 0.0,
            _ => 0.5,
        }
    }

    /// The angle, in radians, at the position `x` along `axis`; bin k covers k to k + 1.
    pub(super) fn edge(&self, axis: usize, x: f64) -> f64 {
        let x = x / self.shape()[axis] as f64;
        match (self, axis) {
            (_, 2) => x * self.phi_span(),
            (Self::HalfDifference { .. }, 0) => x * x * FRAC_PI_2,
            _ => x * FRAC_PI_2,
        }
    }

    /// For each index of `other` along `axis`, the bin of `self` that contains its angle; both grids have the same
    /// coordinates.
    pub(super) fn bins_of(&self, other: Self, axis: usize) -> Vec<usize> {
        let n = self.shape()[axis];
        let bin = |x: f64| if axis == 2 { bin_of_turn(x, n) } else { bin(x, n) };
        self.positions_of(other, axis).map(bin).collect()
    }

    /// For each index of `other` along `axis`, where its angle lies along that axis of `self`; both grids have the same
    /// coordinates.
    pub(super) fn positions_of(&self, other: Self, axis: usize) -> impl Iterator<Item = f64> {
        let n = self.shape()[axis] as f64;
        let span = self.phi_span();
        let root = axis == 0 && matches!(self, Self::HalfDifference { .. });
        let position = move |angle: f64| match axis {
            2 => angle.rem_euclid(span) / span * n,
            _ if root => (angle / FRAC_PI_2).sqrt() * n,
            _ => angle / FRAC_PI_2 * n,
        };
        (0..other.shape()[axis]).map(move |k| position(other.angle(axis, k)))
    }

    /// The range of the last axis: half a turn where reciprocity makes the other half redundant.
    pub(super) fn phi_span(&self) -> f64 {
        match *self {
            Self::HalfDifference { theta_d, phi_d, .. } if phi_d <= 2 * theta_d => PI,
            _ => 2.0 * PI,
        }
    }

    /// Directions from the (sine, cosine) of the three angles of a cell.
    fn directions_of(&self, a: (f64, f64), b: (f64, f64), phi: (f64, f64)) -> (Vec3, Vec3) {
        match self {
            Self::HalfDifference { .. } => {
                let ((sin_h, cos_h), (sin_d, cos_d)) = (a, b);
                let (x, y) = (sin_d * phi.1, sin_d * phi.0);
                // Rotated about y by theta_h; wo is the mirror image of wi about the half vector.
                let rotate = |x: f64, y: f64| Vec3::new(cos_h * x + sin_h * cos_d, y, cos_h * cos_d - sin_h * x);
                (rotate(x, y), rotate(-x, -y))
            }
            Self::Standard { .. } => (Vec3::new(a.0, 0.0, a.1), Vec3::new(b.0 * phi.1, b.0 * phi.0, b.1)),
        }
    }

    /// The cell that contains a pair of directions; `None` when either is below the horizon.
    pub fn cell(&self, wi: Vec3, wo: Vec3) -> Option<usize> {
        let [n0, n1, n2] = self.shape();
        let [a, b, phi] = self.position(wi, wo)?;
        Some((bin(a, n0) * n1 + bin(b, n1)) * n2 + bin_of_turn(phi, n2))
    }

    /// Where a pair of directions lies along each axis; bin k covers k to k + 1. `None` when either is below the horizon.
    pub(super) fn position(&self, wi: Vec3, wo: Vec3) -> Option<[f64; 3]> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return None;
        }
        let [n0, n1, n2] = self.shape().map(|n| n as f64);
        Some(match *self {
            Self::HalfDifference { .. } => {
                let c = half_difference(wi, wo);
                let span = self.phi_span();
                let phi = if span < 4.0 { fold_reciprocal(c.phi_d) } else { c.phi_d.rem_euclid(span) };
                [(c.theta_h / FRAC_PI_2).max(0.0).sqrt() * n0, c.theta_d / FRAC_PI_2 * n1, phi / span * n2]
            }
            Self::Standard { .. } => {
                let polar = |w: Vec3| (w.x * w.x + w.y * w.y).sqrt().atan2(w.z) / FRAC_PI_2;
                // The pole has no azimuth; `atan2` would make one up from the signs of its zeros.
                let azimuth = |w: Vec3| if w.x == 0.0 && w.y == 0.0 { 0.0 } else { w.y.atan2(w.x) };
                let phi = (azimuth(wo) - azimuth(wi)).rem_euclid(2.0 * PI) / (2.0 * PI);
                [polar(wi) * n0, polar(wo) * n1, phi * n2]
            }
        })
    }
}

/// The bin of a position between 0 and n.
fn bin(x: f64, n: usize) -> usize {
    ((x.max(0.0) + SNAP) as usize).min(n - 1)
}

/// The bin of a position on a circle of circumference n.
fn bin_of_turn(x: f64, n: usize) -> usize {
    (x + SNAP) as usize % n
}

/// The directions of every cell of a grid: three short tables of sines.
pub struct GridDirections {
    grid: Grid,
    sines: [Vec<(f64, f64)>; 3],
}

impl GridDirections {
    /// The same as [`Grid::directions`], bit for bit.
    pub fn get(&self, index: usize) -> (Vec3, Vec3) {
        let [_, n1, n2] = self.grid.shape();
        let row = index / n2;
        self.at([row / n1, row % n1, index % n2])
    }

    /// The grid whose directions these are.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// The values of `brdf` on a circle of a grid in standard coordinates, that is, at all azimuths of one pair of polar angles;
    /// `circle` counts these pairs. `None` where there is no measurement. Of a BRDF that is its own mirror image, the first half alone:
    /// [`GridDirections::on_circle`] finds the others. If it is reciprocal too, and the grid has the same polar angles along both axes,
    /// both circles of a pair of angles are evaluated at the same directions, so that they have the same bits.
    pub(crate) fn evaluate_circle(&self, brdf: &dyn Brdf, circle: usize) -> Vec<Option<Rgb>> {
        let [_, polar, azimuths] = self.grid.shape();
        let half = if self.grid.anchor() == 0.0 { azimuths / 2 + 1 } else { azimuths.div_ceil(2) };
        let evaluated = if brdf.is_mirror_symmetric() { half } else { azimuths };
        let (i, o) = (circle / polar, circle % polar);
        let exchangeable = self.sines[0] == self.sines[1] && brdf.is_mirror_symmetric() && brdf.is_reciprocal();
        let (i, o) = if exchangeable { (i.min(o), i.max(o)) } else { (i, o) };
        let (wi, wo): (Vec<_>, Vec<_>) = (0..evaluated).map(|k| self.at([i, o, k])).unzip();
        let mut values = vec![None; evaluated];
        brdf.eval_in_gamut(&wi, &wo, &mut values);
        values
    }

    /// Where the value at azimuth `k` stands among the first `evaluated` ones.
    pub(crate) fn on_circle(&self, k: usize, evaluated: usize) -> usize {
        let [_, _, azimuths] = self.grid.shape();
        match k {
            k if k < evaluated => k,
            k if self.grid.anchor() == 0.0 => azimuths - k,
            k => azimuths - 1 - k,
        }
    }

    /// The directions of the cell with these indices along the axes.
    pub fn at(&self, [i, j, k]: [usize; 3]) -> (Vec3, Vec3) {
        let [a, b, phi] = &self.sines;
        self.grid.directions_of(a[i], b[j], phi[k])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::coordinates::{HalfDifference, half_difference_directions, standard_directions};

    #[test]
    fn every_cell_finds_itself() {
        let grids = [Grid::MERL, Grid::MERL_FULL, Grid::TITOPO, Grid::TITOPO_HALF];
        for grid in grids {
            let all = grid.all_directions();
            for index in (0..grid.len()).step_by(97) {
                let (wi, wo) = all.get(index);
                assert_eq!((wi, wo), grid.directions(index));
                // At the pole the azimuth is undefined, and below the horizon there is no cell.
                let pole = wi.z > 1.0 - 1e-9 || wo.z > 1.0 - 1e-9;
                if wi.z > 0.0 && wo.z > 0.0 && !pole {
                    assert_eq!(grid.cell(wi, wo), Some(index), "{grid:?}");
                }
            }
        }
    }

    #[test]
    fn directions_are_those_of_the_coordinates() {
        let near = |a: Vec3, b: Vec3| assert!((a - b).length() < 1e-14, "{a:?} {b:?}");
        let degrees = f64::to_radians;
        let (wi, wo) = Grid::TITOPO.directions((20 * 90 + 30) * 360 + 250);
        let (ei, eo) = standard_directions(degrees(20.0), degrees(30.0), degrees(250.0));
        near(wi, ei);
        near(wo, eo);
        let (wi, wo) = Grid::MERL.directions((45 * 90 + 30) * 180 + 77);
        let row = 45.5f64 / 90.0;
        let (ei, eo) = half_difference_directions(HalfDifference {
            theta_h: row * row * FRAC_PI_2,
            theta_d: degrees(30.5),
            phi_d: degrees(77.5),
        });
        near(wi, ei);
        near(wo, eo);
    }

    #[test]
    fn the_reciprocal_grid_does_not_tell_directions_apart() {
        let (wi, wo) = standard_directions(0.3, 1.1, 2.0);
        assert_eq!(Grid::MERL.cell(wi, wo), Grid::MERL.cell(wo, wi));
        assert_ne!(Grid::MERL_FULL.cell(wi, wo), Grid::MERL_FULL.cell(wo, wi));
        assert_eq!(Grid::MERL.cell(-wi, wo), None);
    }
}
