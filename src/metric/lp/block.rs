//! The samples of both BRDFs for one pair of polar angles, and where they come from.

use super::{AZIMUTHS, POLAR};
use crate::brdf::{Brdf, Grid, GridDirections, TableError, TabulatedBrdf};
use crate::math::Rgb;
use crate::metric::MetricError;
use rayon::prelude::*;

/// One channel of a block.
pub(super) type Plane = [f64; AZIMUTHS];

/// Azimuths of a folded plane that stand for two: all but 0 and 180 degrees, and one black cell.
pub(super) const FOLDED_TWICE: usize = AZIMUTHS / 2;

/// The values of a BRDF at one (theta_i, theta_o) and all azimuth differences, one plane a channel.
#[derive(Clone)]
pub(super) struct Block {
    pub rgb: [Plane; 3],
    pub valid: [bool; AZIMUTHS],
}

impl Block {
    pub fn new() -> Self {
        Self { rgb: [[0.0; AZIMUTHS]; 3], valid: [false; AZIMUTHS] }
    }

    /// Fills the planes from interleaved samples.
    fn set<T: Copy + Into<f64>>(&mut self, values: &[[T; 3]], valid: &[bool]) {
        let [red, green, blue] = &mut self.rgb;
        for (k, value) in values.iter().enumerate().take(AZIMUTHS) {
            (red[k], green[k], blue[k]) = (value[0].into(), value[1].into(), value[2].into());
        }
        self.valid.copy_from_slice(valid);
    }

    /// Moves the azimuths 1 to 179 to the front, where [`FOLDED_TWICE`] cells count twice, and 0 and 180 degrees behind
    /// them. Black cells fill the gaps: equal in both blocks, they add exactly zero.
    pub fn fold(&mut self) {
        for plane in &mut self.rgb {
            let (front, back) = (plane[0], plane[AZIMUTHS / 2]);
            plane.copy_within(1..AZIMUTHS / 2, 0);
            plane[FOLDED_TWICE - 1] = 0.0;
            plane[FOLDED_TWICE..FOLDED_TWICE + 4].copy_from_slice(&[front, back, 0.0, 0.0]);
        }
    }

    /// Blackens the cells that are invalid in either block, in both, and counts the others. Equal values add
    /// exactly zero to every sum, so that nothing after this needs the masks.
    pub fn mask(&mut self, other: &mut Self) -> u64 {
        let both = |(a, b): (&bool, &bool)| u64::from(*a & *b);
        let count = self.valid.iter().zip(&other.valid).map(both).sum();
        if count < AZIMUTHS as u64 {
            for k in (0..AZIMUTHS).filter(|&k| !(self.valid[k] && other.valid[k])) {
                for plane in self.rgb.iter_mut().chain(&mut other.rgb) {
                    plane[k] = 0.0;
                }
            }
        }
        count
    }
}

/// A BRDF at the cells of [`Grid::TITOPO`].
pub(super) trait Cells: Send + Sync {
    /// The block at theta_i = `i` degrees, theta_o = `o` degrees.
    fn read(&self, i: usize, o: usize, block: &mut Block) -> Result<(), MetricError>;

    /// Whether every block is its own mirror image, azimuth k the same as 360 - k.
    fn is_mirror_symmetric(&self) -> bool;
}

fn range(i: usize, o: usize) -> std::ops::Range<usize> {
    let start = (i * POLAR + o) * AZIMUTHS;
    start..start + AZIMUTHS
}

impl<C: Cells> Cells for &C {
    fn read(&self, i: usize, o: usize, block: &mut Block) -> Result<(), MetricError> {
        (**self).read(i, o, block)
    }

    fn is_mirror_symmetric(&self) -> bool {
        (**self).is_mirror_symmetric()
    }
}

impl Cells for TabulatedBrdf {
    fn read(&self, i: usize, o: usize, block: &mut Block) -> Result<(), MetricError> {
        block.set(&self.values()[range(i, o)], &self.valid()[range(i, o)]);
        Ok(())
    }

    fn is_mirror_symmetric(&self) -> bool {
        false
    }
}

/// Any other BRDF, evaluated where it is needed and in f64: a table of f32 would cost a relative error of 6e-8 a
/// value, which differences of nearly equal BRDFs magnify.
struct Evaluated<'a> {
    brdf: &'a dyn Brdf,
    side: &'static str,
    directions: GridDirections,
}

impl Evaluated<'_> {
    /// The values at one block; `None` where the BRDF has no measurement.
    fn evaluate(&self, i: usize, o: usize) -> Result<Vec<Option<Rgb>>, MetricError> {
        // Where the two halves of a circle are the same, the first is enough.
        let half = AZIMUTHS / 2;
        let evaluated = if self.brdf.is_mirror_symmetric() { half + 1 } else { AZIMUTHS };
        let (wi, wo): (Vec<_>, Vec<_>) = range(i, o).take(evaluated).map(|cell| self.directions.get(cell)).unzip();
        let mut values = vec![None; evaluated];
        self.brdf.eval_batch(&wi, &wo, &mut values);
        values.extend((evaluated..AZIMUTHS).map(|k| values[AZIMUTHS - k]).collect::<Vec<_>>());
        let bad = |value: &Option<Rgb>| value.is_some_and(|v| v.iter().any(|c| !c.is_finite() || *c < 0.0));
        match values.iter().position(bad) {
            None => Ok(values),
            Some(k) => Err(MetricError::Unusable {
                side: self.side,
                reason: format!(
                    "at theta_i {i}, theta_o {o}, phi_d {k} degrees the value is {:?}; it must be finite and not negative",
                    values[k].unwrap_or_default()
                ),
            }),
        }
    }
}

impl Cells for Evaluated<'_> {
    fn read(&self, i: usize, o: usize, block: &mut Block) -> Result<(), MetricError> {
        for (k, value) in self.evaluate(i, o)?.into_iter().enumerate() {
            block.valid[k] = value.is_some();
            let value = value.unwrap_or_default();
            (0..3).for_each(|channel| block.rgb[channel][k] = value[channel]);
        }
        Ok(())
    }

    fn is_mirror_symmetric(&self) -> bool {
        self.brdf.is_mirror_symmetric()
    }
}

/// A BRDF that has been evaluated once, to be compared many times.
struct Samples {
    values: Vec<Rgb>,
    valid: Vec<bool>,
    mirror_symmetric: bool,
}

impl Samples {
    fn of(brdf: &Evaluated) -> Result<Self, MetricError> {
        let row = |i| (0..POLAR).map(|o| brdf.evaluate(i, o)).collect::<Result<Vec<_>, _>>();
        let rows = (0..POLAR).into_par_iter().map(row).collect::<Result<Vec<_>, _>>()?;
        let cells = || rows.iter().flatten().flatten();
        Ok(Self {
            values: cells().map(|value| value.unwrap_or_default()).collect(),
            valid: cells().map(Option::is_some).collect(),
            mirror_symmetric: brdf.brdf.is_mirror_symmetric(),
        })
    }
}

impl Cells for Samples {
    fn read(&self, i: usize, o: usize, block: &mut Block) -> Result<(), MetricError> {
        block.set(&self.values[range(i, o)], &self.valid[range(i, o)]);
        Ok(())
    }

    fn is_mirror_symmetric(&self) -> bool {
        self.mirror_symmetric
    }
}

/// The cells of a BRDF that is read once. A table on another grid is looked up at the cells of [`Grid::TITOPO`].
pub(super) fn cells<'a>(brdf: &'a dyn Brdf, side: &'static str) -> Result<Box<dyn Cells + 'a>, MetricError> {
    match brdf.as_table() {
        Some(table) if table.grid() == Grid::TITOPO => Ok(Box::new(table)),
        Some(table) => Ok(Box::new(resampled(table, side)?)),
        None => Ok(Box::new(Evaluated { brdf, side, directions: Grid::TITOPO.all_directions() })),
    }
}

/// The cells of a BRDF that is read many times and outlives its source.
pub(super) fn owned_cells(brdf: &dyn Brdf, side: &'static str) -> Result<Box<dyn Cells>, MetricError> {
    match brdf.as_table() {
        Some(table) if table.grid() == Grid::TITOPO => Ok(Box::new(table.clone())),
        Some(table) => Ok(Box::new(resampled(table, side)?)),
        None => Ok(Box::new(Samples::of(&Evaluated { brdf, side, directions: Grid::TITOPO.all_directions() })?)),
    }
}

fn resampled(table: &TabulatedBrdf, side: &'static str) -> Result<TabulatedBrdf, MetricError> {
    let unusable = |error: TableError| MetricError::Unusable { side, reason: error.to_string() };
    table.resampled(Grid::TITOPO).map_err(unusable)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_masked_on_one_side_is_blackened_on_both() {
        let filled = |hole: usize| {
            let mut block = Block::new();
            let valid: Vec<_> = (0..AZIMUTHS).map(|k| k != hole).collect();
            block.set(&[[1.0f32, 2.0, 3.0]; AZIMUTHS], &valid);
            block
        };
        let (mut a, mut b) = (filled(7), filled(100));
        assert_eq!(a.mask(&mut b), AZIMUTHS as u64 - 2);
        for hole in [7, 100] {
            assert_eq!((a.rgb[2][hole], b.rgb[0][hole]), (0.0, 0.0));
        }
        assert_eq!(a.rgb[1][8], 2.0);
    }
}
