//! The values of a graph before alpha and phi: f cos theta_i at every cell.

use super::GraphGrid;
use super::spline::{resample, resample_mask};
use crate::brdf::{Anchor, Brdf, Grid, GridDirections, TableError, TabulatedBrdf};
use crate::math::Rgb;
use crate::math::parallel;
use crate::metric::{MetricError, Side};
use std::f64::consts::FRAC_PI_2;

/// f cos theta_i (1/sr) of one BRDF at the cells of a grid, one plane a channel (R, G, B), and which cells are measured.
///
/// Anything that can be evaluated is evaluated at the centres of the cells. A table is brought to its standard grid (a table
/// in half/difference coordinates to [`Grid::TITOPO`], as the study's program does), multiplied by the cosine of theta_i
/// where its values belong, and resampled by cubic splines from cell centre to cell centre, in index space: where the
/// table's values stand at lower cell edges, as in Titopo files, the result therefore belongs half a source cell below the
/// centre. That is how the study's program reads them. It reads a missing value as black; here a cell is masked where more
/// than half of the source cells around its centre are, and splines bridge gaps with the nearest value. Splines overshoot: a
/// value may be slightly negative, which phi cuts.
#[derive(Debug, Clone, PartialEq)]
pub struct CosineTable {
    grid: GraphGrid,
    values: [Vec<f64>; 3],
    valid: Vec<bool>,
    /// The grid of the table that this was resampled from, if its values do not stand at cell centres.
    sampling: Option<Grid>,
}

/// A [`CosineTable`] in half the memory, for many of them: values rounded to f32, a mask only where a cell is masked.
#[derive(Debug, Clone)]
pub struct CompactTable {
    grid: GraphGrid,
    values: [Vec<f32>; 3],
    masked: Option<Vec<bool>>,
    sampling: Option<Grid>,
}

impl CompactTable {
    /// Rounds the values of `table`, by less than one part in ten million.
    pub fn new(table: &CosineTable) -> Self {
        let CosineTable { grid, values, valid, sampling } = table;
        let values = [0, 1, 2].map(|c: usize| values[c].iter().map(|v| *v as f32).collect());
        let masked = (!valid.iter().all(|v| *v)).then(|| valid.clone());
        Self { grid: *grid, values, masked, sampling: *sampling }
    }

    /// The table in f64, with the rounded values.
    pub fn expand(&self) -> CosineTable {
        let values = [0, 1, 2].map(|c: usize| self.values[c].iter().map(|v| f64::from(*v)).collect());
        let valid = self.masked.clone().unwrap_or_else(|| vec![true; self.grid.len()]);
        CosineTable { grid: self.grid, values, valid, sampling: self.sampling }
    }

    /// Bytes that a table without masked cells takes.
    pub fn bytes(grid: GraphGrid) -> usize {
        3 * size_of::<f32>() * grid.len()
    }
}

/// The cells that are measured on both sides of a comparison.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CommonCells {
    /// One entry a cell; `None` where all cells take part.
    mask: Option<Vec<bool>>,
    count: usize,
}

impl CommonCells {
    /// How many they are, N: every point of a graph has the mass 1/N.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Whether the cell takes part.
    pub fn contains(&self, cell: usize) -> bool {
        self.mask.as_ref().is_none_or(|mask| mask[cell])
    }

    /// One entry a cell; `None` where all cells take part.
    pub fn mask(&self) -> Option<&[bool]> {
        self.mask.as_deref()
    }
}

impl CosineTable {
    /// `brdf` on `grid`; `side` is what errors name.
    ///
    /// # Errors
    /// [`MetricError::Unusable`] for a value that is negative or not finite, [`MetricError::NoValidCell`] for a BRDF without
    /// any measurement on the grid.
    pub fn of(brdf: &dyn Brdf, grid: GraphGrid, side: Side) -> Result<Self, MetricError> {
        let table = match brdf.as_table() {
            Some(table) => Self::resampled(table, grid, side)?,
            None => Self::evaluated(brdf, grid, side)?,
        };
        if table.valid.contains(&true) { Ok(table) } else { Err(MetricError::NoValidCell { side }) }
    }

    /// The cells that the values belong to.
    pub fn grid(&self) -> GraphGrid {
        self.grid
    }

    /// f cos theta_i of `channel` (0 to 2), one value a cell, row-major in (theta_i, theta_o, phi_d). The values of masked
    /// cells are unspecified but finite.
    pub fn channel(&self, channel: usize) -> &[f64] {
        &self.values[channel]
    }

    /// Which cells hold a measurement.
    pub fn valid(&self) -> &[bool] {
        &self.valid
    }

    /// The cells that both sides have.
    ///
    /// # Errors
    /// [`MetricError::DifferentGrids`] for tables on different grids, or sampled from tables whose grids differ, which would
    /// compare values that stand at different angles; [`MetricError::NoCommonCell`].
    pub fn common_cells(&self, candidate: &Self, metric: &str) -> Result<CommonCells, MetricError> {
        let different = |reference: String, candidate: String| {
            Err(MetricError::DifferentGrids { metric: metric.to_owned(), reference, candidate })
        };
        if self.grid != candidate.grid {
            return different(self.grid.to_string(), candidate.grid.to_string());
        }
        if let (Some(a), Some(b)) = (self.sampling, candidate.sampling)
            && a != b
        {
            return different(table_shape(a), table_shape(b));
        }
        let both = || self.valid.iter().zip(&candidate.valid).map(|(a, b)| *a && *b);
        let count = both().filter(|both| *both).count();
        if count == 0 {
            return Err(MetricError::NoCommonCell { metric: metric.to_owned() });
        }
        Ok(CommonCells { mask: (count < self.grid.len()).then(|| both().collect()), count })
    }

    /// The table of values f (linear RGB, 1/sr, finite and not negative) at the centres of all cells of `grid`.
    pub(super) fn of_values(values: &[Rgb], grid: GraphGrid) -> Self {
        let mut table = Self::empty(grid);
        table.push(values.iter().copied().map(Some));
        table
    }

    /// The values f on `grid` that [`CosineTable::of_values`] makes the table of `table` out of, but for rounding and for what
    /// overshoots below black, which counts as black; NaN at masked cells.
    ///
    /// # Errors
    /// Those of [`CosineTable::of`].
    pub(super) fn values_of_table(table: &TabulatedBrdf, grid: GraphGrid) -> Result<Vec<Rgb>, MetricError> {
        let table = Self::resampled(table, grid, Side::Candidate)?;
        let cosines = table.cosines();
        let value = |cell: usize| {
            let value = [0, 1, 2].map(|c| table.values[c][cell].max(0.0) / cosines[table.row(cell)]);
            if table.valid[cell] { value } else { [f64::NAN; 3] }
        };
        Ok((0..grid.len()).map(value).collect())
    }

    fn empty(grid: GraphGrid) -> Self {
        let values = [(); 3].map(|()| Vec::with_capacity(grid.len()));
        Self { grid, values, valid: Vec::with_capacity(grid.len()), sampling: None }
    }

    /// cos theta_i of every index along theta_i.
    fn cosines(&self) -> Vec<f64> {
        (0..self.grid.shape()[0]).map(|i| self.grid.angle(0, i).cos()).collect()
    }

    /// The index of a cell along theta_i.
    fn row(&self, cell: usize) -> usize {
        let [_, polar, azimuths] = self.grid.shape();
        cell / (polar * azimuths)
    }

    /// The values f of the next cells.
    fn push(&mut self, values: impl Iterator<Item = Option<Rgb>>) {
        let cosines = self.cosines();
        for value in values {
            let cosine = cosines[self.row(self.valid.len())];
            self.valid.push(value.is_some());
            let value = value.unwrap_or_default();
            self.values.iter_mut().zip(value).for_each(|(plane, v)| plane.push(v * cosine));
        }
    }

    fn evaluated(brdf: &dyn Brdf, grid: GraphGrid, side: Side) -> Result<Self, MetricError> {
        let [rows, _, _] = grid.shape();
        let directions = grid.cells().all_directions();
        let row = |i| evaluate_row(brdf, grid, &directions, i, side);
        let rows = parallel::try_map(rows, row)?;
        let mut table = Self::empty(grid);
        table.push(rows.into_iter().flatten());
        Ok(table)
    }

    fn resampled(table: &TabulatedBrdf, grid: GraphGrid, side: Side) -> Result<Self, MetricError> {
        let unusable = |error: TableError| MetricError::Unusable { side, reason: error.to_string() };
        let converted;
        let table = match table.grid() {
            Grid::Standard { .. } => table,
            Grid::HalfDifference { .. } => {
                converted = table.resampled(Grid::TITOPO).map_err(unusable)?;
                &converted
            }
        };
        let source = table.grid();
        let (from, to) = (source.shape(), grid.shape());
        let offset = match source {
            Grid::Standard { anchor: Anchor::Edge, .. } => 0.0,
            _ => 0.5,
        };
        let cosine: Vec<f64> = (0..from[0]).map(|i| ((i as f64 + offset) / from[0] as f64 * FRAC_PI_2).cos()).collect();
        let filler = (!table.valid().iter().all(|v| *v)).then(|| nearest_valid(table.valid(), from));
        let width = from[1] * from[2];
        let value = |row: usize, cell: usize| match &filler {
            None => table.values()[cell].map(|v| f64::from(v) * cosine[row]),
            // A gap takes value and cosine of its neighbour.
            Some(filler) => {
                let cell = filler[cell] as usize;
                table.values()[cell].map(|v| f64::from(v) * cosine[cell / width])
            }
        };
        let values = resample(value, from, to);
        let valid = match filler {
            None => vec![true; grid.len()],
            Some(_) => resample_mask(table.valid(), from, to),
        };
        Ok(Self { grid, values, valid, sampling: (offset == 0.0).then_some(source) })
    }
}

fn table_shape(grid: Grid) -> String {
    let [a, b, c] = grid.shape();
    format!("a table of {a}x{b}x{c}")
}

/// The BRDF at the cells with theta_i index `i`; `None` where it has no measurement.
fn evaluate_row(
    brdf: &dyn Brdf,
    grid: GraphGrid,
    directions: &GridDirections,
    i: usize,
    side: Side,
) -> Result<Vec<Option<[f64; 3]>>, MetricError> {
    let [_, polar, azimuths] = grid.shape();
    let mut row = Vec::with_capacity(polar * azimuths);
    for o in 0..polar {
        let values = directions.evaluate_circle(brdf, i * polar + o);
        let bad = |value: &Option<[f64; 3]>| value.is_some_and(|v| v.iter().any(|c| !c.is_finite() || *c < 0.0));
        if let Some(k) = values.iter().position(bad) {
            let degrees = |axis, k| grid.angle(axis, k).to_degrees();
            return Err(MetricError::Unusable {
                side,
                reason: format!(
                    "at theta_i {:.1}, theta_o {:.1}, phi_d {:.1} degrees the value is {:?}; it must be finite and not negative",
                    degrees(0, i),
                    degrees(1, o),
                    degrees(2, k),
                    values[k].unwrap_or_default()
                ),
            });
        }
        row.extend((0..azimuths).map(|k| values[directions.on_circle(k, values.len())]));
    }
    Ok(row)
}

/// For every cell the nearest valid one: along phi_d, where its row has none along theta_o, then along theta_i.
fn nearest_valid(valid: &[bool], shape: [usize; 3]) -> Vec<u32> {
    const NONE: u32 = u32::MAX;
    let mut source: Vec<u32> = (0..).zip(valid).map(|(cell, valid)| if *valid { cell } else { NONE }).collect();
    for axis in [2, 1, 0] {
        let stride: usize = shape[axis + 1..].iter().product();
        let n = shape[axis];
        let mut line = vec![NONE; n];
        for start in (0..valid.len()).filter(|cell| (cell / stride).is_multiple_of(n)) {
            (0..n).for_each(|k| line[k] = source[start + k * stride]);
            let known: Vec<usize> = (0..n).filter(|k| line[*k] != NONE).collect();
            for k in (0..n).filter(|k| line[*k] == NONE) {
                if let Some(nearest) = known.iter().min_by_key(|other| other.abs_diff(k)) {
                    source[start + k * stride] = line[*nearest];
                }
            }
        }
    }
    source
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::{Ggx, Lambert};

    fn grid(text: &str) -> GraphGrid {
        text.parse().unwrap()
    }

    /// A smooth table with `holes` masked.
    fn table(source: Grid, holes: &[usize]) -> TabulatedBrdf {
        let brdf = Ggx::new([0.2, 0.1, 0.05], [0.04; 3], 0.4).unwrap();
        let full = TabulatedBrdf::tabulate(&brdf, source).unwrap();
        let mut valid = full.valid().to_vec();
        let mut values = full.values().to_vec();
        for &hole in holes {
            (valid[hole], values[hole]) = (false, [f32::NAN; 3]);
        }
        TabulatedBrdf::new(source, values, valid).unwrap()
    }

    #[test]
    fn a_formula_is_evaluated_at_the_centres() {
        let brdf = Ggx::new([0.2, 0.1, 0.05], [0.04; 3], 0.3).unwrap();
        for grid in [grid("6x5x24"), grid("5x6x7")] {
            let table = CosineTable::of(&brdf, grid, Side::Reference).unwrap();
            let directions = grid.cells().all_directions();
            for cell in 0..grid.len() {
                let (wi, wo) = directions.get(cell);
                let expected = brdf.eval(wi, wo).unwrap();
                for (c, expected) in expected.iter().enumerate() {
                    assert!((table.channel(c)[cell] / (expected * wi.z) - 1.0).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn a_table_on_the_same_grid_is_taken_as_it_is() {
        let source = table(Grid::Standard { theta_i: 6, theta_o: 5, phi_d: 24, anchor: Anchor::Edge }, &[]);
        let found = CosineTable::of(&source, grid("6x5x24"), Side::Reference).unwrap();
        for cell in 0..source.values().len() {
            let cosine = (cell / (5 * 24)) as f64 * 15.0;
            let expected = f64::from(source.values()[cell][1]) * cosine.to_radians().cos();
            assert!((found.channel(1)[cell] - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn a_fine_table_stands_half_a_source_cell_below_the_centres() {
        let fine = table(Grid::TITOPO, &[]);
        let found = CosineTable::of(&fine, GraphGrid::STUDY, Side::Reference).unwrap();
        let brdf = Ggx::new([0.2, 0.1, 0.05], [0.04; 3], 0.4).unwrap();
        // theta_i index 10 of 45 reads 20.5 of the 90 rows, the values at 20.5 degrees; its centre is at 21.
        for (i, o, k) in [(10usize, 12usize, 90usize), (4, 30, 20), (30, 5, 100)] {
            let radians = |index: usize| (2.0 * index as f64 + 0.5).to_radians();
            let (wi, wo) = crate::math::coordinates::standard_directions(radians(i), radians(o), radians(k));
            let expected = brdf.eval(wi, wo).unwrap()[0] * wi.z;
            let value = found.channel(0)[(i * 45 + o) * 180 + k];
            assert!((value / expected - 1.0).abs() < 1e-5, "{value} {expected}");
        }
    }

    #[test]
    fn a_hole_stays_a_hole_and_leaves_the_rest_alone() {
        let source = Grid::Standard { theta_i: 12, theta_o: 12, phi_d: 48, anchor: Anchor::Edge };
        // A quarter of the cells around one centre, and all of those around another.
        let around = |[i, o, k]: [usize; 3]| {
            [0, 1, 2, 3, 4, 5, 6, 7].map(|c| ((i + (c >> 2)) * 12 + o + (c >> 1 & 1)) * 48 + k + (c & 1))
        };
        let holes = [&around([2, 2, 30])[..2], &around([4, 6, 20])].concat();
        let (whole, holed) = (table(source, &[]), table(source, &holes));
        let of = |table: &TabulatedBrdf| CosineTable::of(table, grid("6x6x24"), Side::Reference).unwrap();
        let (whole, holed) = (of(&whole), of(&holed));
        let cell = (2 * 6 + 3) * 24 + 10;
        assert_eq!(holed.valid().iter().filter(|v| !**v).count(), 1);
        assert!(!holed.valid()[cell]);
        for (k, (a, b)) in whole.channel(0).iter().zip(holed.channel(0)).enumerate() {
            assert!(b.is_finite() && (k == cell || (a / b - 1.0).abs() < 0.05), "{k}: {a} {b}");
        }
        let common = whole.common_cells(&holed, "ot").unwrap();
        assert_eq!((common.count(), common.contains(cell)), (6 * 6 * 24 - 1, false));
        assert_eq!(whole.common_cells(&whole, "ot").unwrap().mask(), None);
    }

    #[test]
    fn gaps_are_bridged_from_the_nearest_cell() {
        let shape = [2, 3, 4];
        let mut valid = vec![false; 24];
        valid[4 + 1] = true;
        let filler = nearest_valid(&valid, shape);
        assert!(filler.iter().all(|f| *f == 5));
        valid[4 + 3] = true;
        valid[12 + 2] = true;
        let filler = nearest_valid(&valid, shape);
        assert_eq!(filler[4..8], [5, 5, 5, 7]);
        assert_eq!((filler[3], filler[13]), (7, 14));
    }

    #[test]
    fn what_cannot_be_compared_is_refused() {
        let lambert = Lambert::new([0.5; 3]).unwrap();
        let on = |g| CosineTable::of(&lambert, grid(g), Side::Reference).unwrap();
        let error = on("6x6x24").common_cells(&on("9x9x36"), "ot").unwrap_err().to_string();
        assert_eq!(
            error,
            "ot: reference and candidate have different grids, 6x6x24 and 9x9x36; they must have the same grid"
        );
        let half = table(Grid::TITOPO_HALF, &[]);
        let full = table(Grid::TITOPO, &[]);
        let of = |t: &TabulatedBrdf| CosineTable::of(t, GraphGrid::STUDY, Side::Reference).unwrap();
        let error = of(&half).common_cells(&of(&full), "ot").unwrap_err().to_string();
        assert!(error.contains("a table of 45x45x180 and a table of 90x90x360"), "{error}");
        assert!(of(&full).common_cells(&on("45x45x180"), "ot").is_ok());
        // One measured cell, at an end that a coarse grid does not reach.
        let source = Grid::Standard { theta_i: 12, theta_o: 12, phi_d: 48, anchor: Anchor::Edge };
        let mut valid = vec![false; source.len()];
        valid[0] = true;
        let lone = TabulatedBrdf::new(source, vec![[1.0; 3]; source.len()], valid).unwrap();
        let error = CosineTable::of(&lone, grid("4x4x16"), Side::Candidate).unwrap_err();
        assert_eq!(error, MetricError::NoValidCell { side: Side::Candidate });
    }
}
