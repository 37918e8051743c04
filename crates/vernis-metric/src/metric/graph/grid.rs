//! The cells of a graph.

use crate::brdf::{Anchor, Grid};
use crate::metric::MetricError;
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Cells along each polar angle.
const POLAR: RangeInclusive<usize> = 2..=180;
/// Cells along the azimuth difference.
const AZIMUTHS: RangeInclusive<usize> = 2..=720;

/// Cells along theta_i, theta_o (0 to 90 degrees each) and phi_d (0 to 360 degrees), equally wide. A cell's value belongs
/// at its centre. Stored row-major in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct GraphGrid {
    theta_i: usize,
    theta_o: usize,
    phi_d: usize,
}

impl GraphGrid {
    /// The grid of the study: 45x45x180.
    pub const STUDY: Self = Self { theta_i: 45, theta_o: 45, phi_d: 180 };

    /// # Errors
    /// [`MetricError::Parameter`] outside 2 to 180 polar cells and 2 to 720 azimuths.
    pub fn new(theta_i: usize, theta_o: usize, phi_d: usize) -> Result<Self, MetricError> {
        let grid = Self { theta_i, theta_o, phi_d };
        if POLAR.contains(&theta_i) && POLAR.contains(&theta_o) && AZIMUTHS.contains(&phi_d) {
            return Ok(grid);
        }
        Err(wrong(grid.to_string()))
    }

    /// Cells along theta_i, theta_o, phi_d.
    pub fn shape(self) -> [usize; 3] {
        [self.theta_i, self.theta_o, self.phi_d]
    }

    /// Number of cells.
    pub fn len(self) -> usize {
        self.theta_i * self.theta_o * self.phi_d
    }

    /// Whether the grid has no cell.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// theta_i, theta_o, phi_d of the centre of the cells with index `k` along `axis`, in radians.
    pub fn angle(self, axis: usize, k: usize) -> f64 {
        let span = if axis == 2 { 2.0 * PI } else { FRAC_PI_2 };
        (k as f64 + 0.5) / self.shape()[axis] as f64 * span
    }

    /// The place of the cells with index `k` along `axis` in the base of a graph with alpha = 1: 0 to 1.
    pub fn position(self, axis: usize, k: usize) -> f64 {
        (k as f64 + 0.5) / self.shape()[axis] as f64
    }

    /// The same cells as a grid for tables: the way to the directions of a cell.
    pub fn cells(self) -> Grid {
        let Self { theta_i, theta_o, phi_d } = self;
        Grid::Standard { theta_i, theta_o, phi_d, anchor: Anchor::Centre }
    }
}

impl Default for GraphGrid {
    fn default() -> Self {
        Self::STUDY
    }
}

impl fmt::Display for GraphGrid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}x{}", self.theta_i, self.theta_o, self.phi_d)
    }
}

impl FromStr for GraphGrid {
    type Err = MetricError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let parts: Vec<_> = text.split('x').map(|part| part.trim().parse::<usize>()).collect();
        match parts.as_slice() {
            [Ok(i), Ok(o), Ok(d)] => Self::new(*i, *o, *d),
            _ => Err(wrong(text.to_owned())),
        }
    }
}

fn wrong(found: String) -> MetricError {
    let allowed = format!(
        "THETA_IxTHETA_OxPHI_D such as 45x45x180, with {} to {} polar cells and {} to {} azimuths",
        POLAR.start(),
        POLAR.end(),
        AZIMUTHS.start(),
        AZIMUTHS.end()
    );
    MetricError::Parameter { what: "grid".to_owned(), found: format!("`{found}`"), allowed }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_notation_round_trips_and_refuses_what_no_grid_is() {
        for text in ["45x45x180", "90x90x360", "6x6x24", "2x180x720"] {
            assert_eq!(text.parse::<GraphGrid>().unwrap().to_string(), text);
        }
        for text in
            ["", "45", "45x45", "45x45x180x3", "0x45x180", "45x1x180", "45x45x721", "181x45x180", "axbxc", "-1x4x4"]
        {
            let message = text.parse::<GraphGrid>().unwrap_err().to_string();
            assert!(message.starts_with(&format!("grid is `{text}`; it must be THETA_IxTHETA_OxPHI_D")), "{message}");
        }
    }

    #[test]
    fn centres_are_those_of_the_grid_for_tables() {
        let grid = GraphGrid::new(6, 5, 24).unwrap();
        let (i, o, d) = (4, 2, 17);
        let (wi, wo) = grid.cells().directions((i * 5 + o) * 24 + d);
        let (ei, eo) =
            crate::math::coordinates::standard_directions(grid.angle(0, i), grid.angle(1, o), grid.angle(2, d));
        assert!((wi - ei).length() < 1e-15 && (wo - eo).length() < 1e-15);
        assert!((grid.position(2, d) - grid.angle(2, d) / (2.0 * PI)).abs() < 1e-15);
    }
}
