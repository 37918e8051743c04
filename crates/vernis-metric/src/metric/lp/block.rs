//! The samples of both BRDFs for one pair of polar angles, and where they come from.

use super::{AZIMUTHS, POLAR};
use crate::brdf::{Brdf, Grid, GridDirections, TableError, TabulatedBrdf};
use crate::math::Rgb;
use crate::math::parallel;
use crate::metric::{MetricError, Side};
use std::borrow::Borrow;

/// One channel of a block.
pub(super) type Plane = [f64; AZIMUTHS];

/// Which azimuth each place of a plane holds. Both numbers are multiples of the kernel's groups.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Extent {
    /// Places at the front whose terms count twice.
    pub doubled: usize,
    /// Places in use.
    pub cells: usize,
}

impl Extent {
    /// Every azimuth in its place.
    pub const WHOLE: Self = Self { doubled: 0, cells: AZIMUTHS };
    /// 1 to 179 degrees, which stand for two each, a gap, then 0 and 180 degrees and two gaps. Gaps are black in both
    /// blocks: equal values add exactly zero.
    pub const FOLDED: Self = Self { doubled: AZIMUTHS / 2, cells: AZIMUTHS / 2 + 4 };

    fn azimuth(self, place: usize) -> Option<usize> {
        let gap = self.doubled.wrapping_sub(1);
        match place {
            _ if self.doubled == 0 => Some(place),
            _ if place < gap => Some(place + 1),
            _ if place == self.doubled => Some(0),
            _ if place == self.doubled + 1 => Some(AZIMUTHS / 2),
            _ => None,
        }
    }
}

/// The values of a BRDF at one (theta_i, theta_o), one plane a channel.
#[derive(Clone)]
pub(super) struct Block {
    pub rgb: [Plane; 3],
    pub valid: [bool; AZIMUTHS],
}

impl Block {
    pub fn new() -> Self {
        Self { rgb: [[0.0; AZIMUTHS]; 3], valid: [false; AZIMUTHS] }
    }

    /// Fills the planes from the samples of a whole circle.
    fn set<T: Copy + Into<f64>>(&mut self, values: &[[T; 3]], valid: &[bool]) {
        let [red, green, blue] = &mut self.rgb;
        for (k, value) in values.iter().enumerate().take(AZIMUTHS) {
            (red[k], green[k], blue[k]) = (value[0].into(), value[1].into(), value[2].into());
        }
        self.valid.copy_from_slice(valid);
    }

    /// Fills the places of `extent` from the samples of a whole circle or of its first half.
    pub fn place(&mut self, values: &[Option<Rgb>], extent: Extent) {
        self.place_each(extent, |k| values[if k < values.len() { k } else { AZIMUTHS - k }]);
    }

    /// Fills the places of `extent` with the samples at their azimuths.
    fn place_each(&mut self, extent: Extent, sample: impl Fn(usize) -> Option<Rgb>) {
        let [red, green, blue] = &mut self.rgb;
        for place in 0..extent.cells {
            let sample = extent.azimuth(place).and_then(&sample);
            self.valid[place] = sample.is_some();
            [red[place], green[place], blue[place]] = sample.unwrap_or_default();
        }
    }

    /// Blackens the cells that are invalid in either block, in both, and counts the others. Equal values add
    /// exactly zero to every sum, so that nothing after this needs the masks.
    pub fn mask(&mut self, other: &mut Self, extent: Extent) -> u64 {
        let mut count = 0;
        for k in 0..extent.cells {
            if self.valid[k] && other.valid[k] {
                count += if k < extent.doubled { 2 } else { 1 };
            } else {
                for plane in self.rgb.iter_mut().chain(&mut other.rgb) {
                    plane[k] = 0.0;
                }
            }
        }
        count
    }

    /// Blackens the cells that are not valid.
    pub fn blacken(&mut self, extent: Extent) {
        for k in (0..extent.cells).filter(|&k| !self.valid[k]) {
            self.rgb.iter_mut().for_each(|plane| plane[k] = 0.0);
        }
    }

    /// As [`Block::mask`] with a reference that is black where it is not valid, which stays as it is; `None`, and nothing of use in this
    /// block, where the reference has a cell that is invalid here.
    pub fn mask_within(&mut self, reference: &Self, extent: Extent) -> Option<u64> {
        let mut count = 0;
        for k in 0..extent.cells {
            match (reference.valid[k], self.valid[k]) {
                (true, true) => count += if k < extent.doubled { 2 } else { 1 },
                (true, false) => return None,
                (false, _) => self.rgb.iter_mut().for_each(|plane| plane[k] = 0.0),
            }
        }
        Some(count)
    }
}

/// A BRDF at the cells of [`Grid::TITOPO`].
pub(super) trait Cells: Send + Sync {
    /// The block at theta_i = `i` degrees, theta_o = `o` degrees.
    fn read(&self, i: usize, o: usize, extent: Extent, block: &mut Block) -> Result<(), MetricError>;

    /// Whether every block is its own mirror image, azimuth k the same as 360 - k: it may be read folded.
    fn is_mirror_symmetric(&self) -> bool;

    /// Whether every block is its own mirror image, and those at (i, o) and (o, i) are the same, to the last bit.
    fn is_exchangeable(&self) -> bool {
        false
    }
}

/// The same of the blocks that [`GridDirections::evaluate_circle`] gives: exchanging the directions turns phi_d into -phi_d.
fn exchangeable(brdf: &dyn Brdf) -> bool {
    brdf.is_mirror_symmetric() && brdf.is_reciprocal()
}

fn range(i: usize, o: usize) -> std::ops::Range<usize> {
    let start = (i * POLAR + o) * AZIMUTHS;
    start..start + AZIMUTHS
}

/// A table on [`Grid::TITOPO`], borrowed or owned.
struct Table<T> {
    table: T,
    mirror_symmetric: bool,
}

impl<T: Borrow<TabulatedBrdf>> Table<T> {
    fn new(table: T) -> Self {
        let (values, valid) = (table.borrow().values(), table.borrow().valid());
        let is_own_image = |circle: usize| {
            let cells = circle * AZIMUTHS..(circle + 1) * AZIMUTHS;
            let (values, valid) = (&values[cells.clone()], &valid[cells]);
            let same = |a: usize, b: usize| valid[a] == valid[b] && (!valid[a] || values[a] == values[b]);
            (1..AZIMUTHS / 2).all(|k| same(k, AZIMUTHS - k))
        };
        let mirror_symmetric = parallel::all(values.len() / AZIMUTHS, is_own_image);
        Self { table, mirror_symmetric }
    }
}

impl<T: Borrow<TabulatedBrdf> + Send + Sync> Cells for Table<T> {
    fn read(&self, i: usize, o: usize, extent: Extent, block: &mut Block) -> Result<(), MetricError> {
        let table = self.table.borrow();
        let (values, valid) = (&table.values()[range(i, o)], &table.valid()[range(i, o)]);
        match extent == Extent::WHOLE {
            true => block.set(values, valid),
            false => block.place_each(extent, |k| valid[k].then(|| values[k].map(f64::from))),
        }
        Ok(())
    }

    fn is_mirror_symmetric(&self) -> bool {
        self.mirror_symmetric
    }
}

/// Any other BRDF, evaluated where it is needed and in f64: a table of f32 would cost a relative error of 6e-8 a
/// value, which differences of nearly equal BRDFs magnify.
struct Evaluated<'a> {
    brdf: &'a dyn Brdf,
    side: Side,
    directions: GridDirections,
}

impl Evaluated<'_> {
    /// The values at one block; `None` where the BRDF has no measurement. Where the two halves of the circle are the
    /// same, the first.
    fn evaluate(&self, i: usize, o: usize) -> Result<Vec<Option<Rgb>>, MetricError> {
        let values = self.directions.evaluate_circle(self.brdf, i * POLAR + o);
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
    fn read(&self, i: usize, o: usize, extent: Extent, block: &mut Block) -> Result<(), MetricError> {
        block.place(&self.evaluate(i, o)?, extent);
        Ok(())
    }

    fn is_mirror_symmetric(&self) -> bool {
        self.brdf.is_mirror_symmetric()
    }

    fn is_exchangeable(&self) -> bool {
        exchangeable(self.brdf)
    }
}

/// A BRDF that has been evaluated once, to be compared many times.
struct Samples {
    /// By theta_i, theta_o: what [`Evaluated::evaluate`] gave. Empty where theta_o < theta_i, if it is exchangeable.
    blocks: Vec<Vec<Option<Rgb>>>,
    mirror_symmetric: bool,
    exchangeable: bool,
}

impl Samples {
    fn of(brdf: &Evaluated) -> Result<Self, MetricError> {
        let exchangeable = exchangeable(brdf.brdf);
        let block = |k: usize| match (k / POLAR, k % POLAR) {
            (i, o) if exchangeable && o < i => Ok(vec![]),
            (i, o) => brdf.evaluate(i, o),
        };
        let blocks = parallel::try_map(POLAR * POLAR, block)?;
        Ok(Self { blocks, mirror_symmetric: brdf.brdf.is_mirror_symmetric(), exchangeable })
    }
}

impl Cells for Samples {
    fn read(&self, i: usize, o: usize, extent: Extent, block: &mut Block) -> Result<(), MetricError> {
        let (i, o) = if self.exchangeable { (i.min(o), i.max(o)) } else { (i, o) };
        block.place(&self.blocks[i * POLAR + o], extent);
        Ok(())
    }

    fn is_mirror_symmetric(&self) -> bool {
        self.mirror_symmetric
    }

    fn is_exchangeable(&self) -> bool {
        self.exchangeable
    }
}

/// Values on the nodes of an Lp metric.
pub(super) struct NodeValues<'a> {
    values: &'a [Rgb],
    /// Polar angles that the nodes have along each axis.
    polar: usize,
    mirror_symmetric: bool,
    exchangeable: bool,
}

impl<'a> NodeValues<'a> {
    /// `values`: one a node, `polar` angles along both axes and [`AZIMUTHS`]; finite and not negative.
    pub fn new(values: &'a [Rgb], polar: usize) -> Self {
        let is_own_image = |circle: &[Rgb]| (1..AZIMUTHS / 2).all(|k| circle[k] == circle[AZIMUTHS - k]);
        let circle = |i: usize, o: usize| &values[(i * polar + o) * AZIMUTHS..][..AZIMUTHS];
        let mirror_symmetric = parallel::all(polar, |i| (0..polar).all(|o| is_own_image(circle(i, o))));
        let exchangeable =
            mirror_symmetric && parallel::all(polar, |i| (i + 1..polar).all(|o| circle(i, o) == circle(o, i)));
        Self { values, polar, mirror_symmetric, exchangeable }
    }
}

impl Cells for NodeValues<'_> {
    fn read(&self, i: usize, o: usize, extent: Extent, block: &mut Block) -> Result<(), MetricError> {
        let start = (i * self.polar + o) * AZIMUTHS;
        block.place_each(extent, |k| Some(self.values[start + k]));
        Ok(())
    }

    fn is_mirror_symmetric(&self) -> bool {
        self.mirror_symmetric
    }

    fn is_exchangeable(&self) -> bool {
        self.exchangeable
    }
}

/// The values of a table at the cells with polar angles below `polar` degrees, as [`cells`] has them.
pub(super) fn table_on_nodes(table: &TabulatedBrdf, polar: usize) -> Result<Vec<Rgb>, MetricError> {
    let converted;
    let table = if table.grid() == Grid::TITOPO {
        table
    } else {
        converted = resampled(table, Side::Candidate)?;
        &converted
    };
    let value = |cell: usize| if table.valid()[cell] { table.values()[cell].map(f64::from) } else { [f64::NAN; 3] };
    Ok((0..polar * polar).flat_map(|row| range(row / polar, row % polar)).map(value).collect())
}

/// The cells of a BRDF that is read once. A table on another grid is looked up at the cells of [`Grid::TITOPO`].
pub(super) fn cells<'a>(brdf: &'a dyn Brdf, side: Side) -> Result<Box<dyn Cells + 'a>, MetricError> {
    match brdf.as_table() {
        Some(table) if table.grid() == Grid::TITOPO => Ok(Box::new(Table::new(table))),
        Some(table) => Ok(Box::new(Table::new(resampled(table, side)?))),
        None => Ok(Box::new(Evaluated { brdf, side, directions: Grid::TITOPO.all_directions() })),
    }
}

/// The cells of a BRDF that is read many times and outlives its source.
pub(super) fn owned_cells(brdf: &dyn Brdf, side: Side) -> Result<Box<dyn Cells>, MetricError> {
    match brdf.as_table() {
        Some(table) if table.grid() == Grid::TITOPO => Ok(Box::new(Table::new(table.clone()))),
        Some(table) => Ok(Box::new(Table::new(resampled(table, side)?))),
        None => Ok(Box::new(Samples::of(&Evaluated { brdf, side, directions: Grid::TITOPO.all_directions() })?)),
    }
}

fn resampled(table: &TabulatedBrdf, side: Side) -> Result<TabulatedBrdf, MetricError> {
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
        assert_eq!(a.mask(&mut b, Extent::WHOLE), AZIMUTHS as u64 - 2);
        for hole in [7, 100] {
            assert_eq!((a.rgb[2][hole], b.rgb[0][hole]), (0.0, 0.0));
        }
        assert_eq!(a.rgb[1][8], 2.0);
    }

    #[test]
    fn a_folded_circle_has_every_azimuth_once_for_each_side() {
        let mut counted = [0; AZIMUTHS];
        for place in 0..Extent::FOLDED.cells {
            let Some(k) = Extent::FOLDED.azimuth(place) else { continue };
            counted[k] += 1;
            if place < Extent::FOLDED.doubled {
                counted[AZIMUTHS - k] += 1;
            }
        }
        assert_eq!(counted, [1; AZIMUTHS]);
        let mut block = Block::new();
        block.place(&[Some([1.0; 3]); AZIMUTHS / 2 + 1], Extent::FOLDED);
        assert_eq!(block.clone().mask(&mut block, Extent::FOLDED), AZIMUTHS as u64);
    }
}
