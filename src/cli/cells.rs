//! On which cells the metric of a fit compares, and its search looks.

use super::{limits, user_error};
use anyhow::Result;
use clap::Args;
use std::sync::Arc;
use vernis_metric::metric::Metric;

/// Grid and coarsening, as options.
#[derive(Args)]
pub struct Cells {
    /// Grid of the metrics on graphs, THETA_IxTHETA_OxPHI_D [default: 45x45x180].
    #[arg(long, value_name = "GRID")]
    grid: Option<String>,
    /// Cells of the metric per cell of the search, along each axis, 1 to 15; 1 searches on the metric's own cells [default: 3].
    #[arg(long, value_name = "N", value_parser = limits::integer(1..=15_usize))]
    coarsening: Option<usize>,
}

/// Cells of the metric per cell of the search where nobody says how many.
const COARSENING: usize = 3;

impl Cells {
    /// The metric on the grid that is named, and the coarsening.
    pub fn of(&self, metric: Arc<dyn Metric>) -> Result<(Arc<dyn Metric>, usize)> {
        let (grid, coarsening) = read(self.grid.as_deref(), self.coarsening)?;
        let coarsening = coarsening.unwrap_or(COARSENING);
        let Some(grid) = grid else { return Ok((metric, coarsening)) };
        let grid = grid.parse().map_err(|e| user_error(format!("--grid: {e}")))?;
        match metric.on_grid(grid) {
            Some(on_grid) => Ok((on_grid, coarsening)),
            None => Err(user_error(format!(
                "--grid needs a metric with a grid, and {} has none; ot, energy and mmd-* do",
                metric.name()
            ))),
        }
    }
}

/// Grid and coarsening; a grid that is one number is what `--coarsening` was called before, and is said to be.
pub fn read(grid: Option<&str>, coarsening: Option<usize>) -> Result<(Option<&str>, Option<usize>)> {
    let old = grid.and_then(|grid| grid.parse::<usize>().ok());
    match (old, coarsening) {
        (None, _) => Ok((grid, coarsening)),
        (Some(n), None) => {
            super::workspace::warn([format!(
                "--grid {n} is read as --coarsening {n}; --grid is a grid such as 45x45x180"
            )]);
            Ok((None, old))
        }
        (Some(n), Some(_)) => Err(user_error(format!("--grid is {n}; it must be a grid such as 45x45x180"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_is_a_grid_and_a_number_is_the_old_spelling_of_coarsening() {
        assert_eq!(read(None, None).unwrap(), (None, None));
        assert_eq!(read(Some("9x9x36"), Some(2)).unwrap(), (Some("9x9x36"), Some(2)));
        assert_eq!(read(Some("6"), None).unwrap(), (None, Some(6)));
        assert!(read(Some("6"), Some(2)).unwrap_err().to_string().starts_with("--grid is 6; it must be a grid"));
    }
}
