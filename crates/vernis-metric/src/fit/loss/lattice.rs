//! A reference at some of the cells of the Lp metrics, each of which stands for a block of them.
//!
//! The cells of the metrics, 90x90x360 at whole degrees, are cut into blocks of n x n x n. A block away from the highlight is
//! represented by the cell in its middle; one that comes within [`NEAR`] of the mirror direction (measured as theta_h) is kept
//! cell by cell, for there lies what a lobe is fitted to. With n = 1 nothing is left out. Models being mirror symmetric in
//! phi_d, a model is evaluated for phi_d up to 180 degrees only and compared with the reference on both sides.
//!
//! Cost: 1.2e6 cells of 60 bytes below 80 degrees for n = 1; n = 3 keeps a twentieth of them.

use crate::brdf::{Brdf, Grid, GridDirections, TableError, TabulatedBrdf};
use crate::math::parallel;
use crate::math::{Rgb, Vec3};
use crate::metric::lp::{AZIMUTHS, POLAR};
use crate::metric::{MetricError, Side};

/// Within this angle between half vector and normal, degrees, no cell is left out.
pub const NEAR: f64 = 2.5;
/// Cells that a thread handles at a time; the sums of chunks are added up in order.
const CHUNK: usize = 2048;

/// One direction pair and what the reference is on its two sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Index in [`Grid::TITOPO`].
    pub(super) cell: u32,
    /// How many cells of the metric stand behind each side (phi_d and -phi_d); 0 where the reference has no measurement, or
    /// both sides are the same.
    pub(super) count: [f32; 2],
    /// The reference on both sides.
    pub(super) reference: [Rgb; 2],
}

/// The samples of one reference.
pub struct Lattice {
    pub(super) samples: Vec<Sample>,
    directions: GridDirections,
}

impl Lattice {
    /// `reference` at blocks of `coarsening` cells an axis, polar angles below `limit` degrees.
    ///
    /// # Errors
    /// [`MetricError::Unusable`] for a value that is negative or not finite, [`MetricError::NoValidCell`].
    pub fn new(reference: &dyn Brdf, coarsening: usize, limit: usize) -> Result<Self, MetricError> {
        let directions = Grid::TITOPO.all_directions();
        let converted;
        let source: &dyn Brdf = match reference.as_table() {
            // As the metrics read it, axis by axis. A table in other coordinates is read by direction, as its own `eval` does.
            Some(table) if table.grid() != Grid::TITOPO && matches!(table.grid(), Grid::Standard { .. }) => {
                let unusable = |e: TableError| MetricError::Unusable { side: Side::Reference, reason: e.to_string() };
                converted = table.resampled(Grid::TITOPO).map_err(unusable)?;
                &converted
            }
            _ => reference,
        };
        let rows: Vec<usize> = (0..limit.min(POLAR)).collect();
        let blocks: Vec<&[usize]> = rows.chunks(coarsening.max(1)).collect();
        let row = |k: usize| row(source, &directions, blocks[k], &blocks, coarsening.max(1));
        let rows = parallel::try_map(blocks.len(), row)?;
        let samples = rows.concat();
        if samples.iter().all(|s| s.count == [0.0; 2]) {
            return Err(MetricError::NoValidCell { side: Side::Reference });
        }
        Ok(Self { samples, directions })
    }

    /// Number of directions at which a model is evaluated.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether no direction is evaluated.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// The directions of a sample.
    pub(super) fn directions(&self, sample: &Sample) -> (Vec3, Vec3) {
        let (cell, row) = (sample.cell as usize, sample.row());
        self.directions.at([row / POLAR, row % POLAR, cell % AZIMUTHS])
    }

    /// Each sample with its directions, in order.
    pub fn iter(&self) -> impl Iterator<Item = (&Sample, Vec3, Vec3)> {
        self.samples.iter().map(|s| {
            let (wi, wo) = self.directions(s);
            (s, wi, wo)
        })
    }

    /// `sum(chunk)` over chunks of samples, in parallel, added up in order by `add`; the first failure stops it.
    pub(super) fn reduce<T: Send, E: Send>(
        &self,
        zero: T,
        sum: impl Fn(&[Sample]) -> Result<T, E> + Sync,
        mut add: impl FnMut(&mut T, T),
    ) -> Result<T, E> {
        let chunks: Vec<&[Sample]> = self.samples.chunks(CHUNK).collect();
        let parts = parallel::try_map(chunks.len(), |k| sum(chunks[k]))?;
        let mut total = zero;
        parts.into_iter().for_each(|part| add(&mut total, part));
        Ok(total)
    }
}

impl Sample {
    /// 90 theta_i + theta_o, degrees.
    pub(super) fn row(&self) -> usize {
        self.cell as usize / AZIMUTHS
    }

    /// How many cells of the metric it stands for.
    pub fn cells(&self) -> f64 {
        f64::from(self.count[0]) + f64::from(self.count[1])
    }

    /// The mean of the reference over them; `None` where it has no measurement.
    pub fn mean(&self) -> Option<Rgb> {
        let [a, b] = self.count.map(f64::from);
        let [x, y] = self.reference;
        (a + b > 0.0).then(|| std::array::from_fn(|c| (a * x[c] + b * y[c]) / (a + b)))
    }
}

/// The samples whose theta_i lies in `block`.
fn row(
    source: &dyn Brdf,
    directions: &GridDirections,
    block: &[usize],
    polar_blocks: &[&[usize]],
    n: usize,
) -> Result<Vec<Sample>, MetricError> {
    let half: Vec<usize> = (0..=AZIMUTHS / 2).collect();
    let mut kept: Vec<(usize, usize, usize, usize)> = Vec::new();
    for other in polar_blocks {
        for azimuths in half.chunks(n) {
            let middle = |b: &[usize]| b[b.len() / 2];
            let centre = (middle(block), middle(other), middle(azimuths));
            if n == 1 || theta_h(directions, centre) < NEAR + 0.5 * n as f64 {
                for &i in block {
                    kept.extend(other.iter().flat_map(|&o| azimuths.iter().map(move |&k| (i, o, k, 1))));
                }
            } else {
                let (i, o, k) = centre;
                kept.push((i, o, k, block.len() * other.len() * azimuths.len()));
            }
        }
    }
    sampled(source, directions, &kept)
}

fn cell((i, o, k): (usize, usize, usize)) -> usize {
    (i * POLAR + o) * AZIMUTHS + k % AZIMUTHS
}

/// Angle between half vector and normal, degrees.
fn theta_h(directions: &GridDirections, at: (usize, usize, usize)) -> f64 {
    let (wi, wo) = directions.get(cell(at));
    (wi + wo).normalized().z.clamp(-1.0, 1.0).acos().to_degrees()
}

/// The reference at cells (theta_i, theta_o, phi_d) that stand for a number of cells each.
fn sampled(
    source: &dyn Brdf,
    directions: &GridDirections,
    kept: &[(usize, usize, usize, usize)],
) -> Result<Vec<Sample>, MetricError> {
    // Cells at the pole share their directions; a table keeps them apart.
    let table = source.as_table().filter(|t| t.grid() == Grid::TITOPO);
    let read = |cells: &[usize]| -> Vec<Option<Rgb>> {
        let of_table = |t: &TabulatedBrdf, c: usize| t.valid()[c].then(|| t.values()[c].map(f64::from));
        if let Some(table) = table {
            return cells.iter().map(|&c| of_table(table, c)).collect();
        }
        let (wi, wo): (Vec<_>, Vec<_>) = cells.iter().map(|&c| directions.get(c)).unzip();
        let mut values = vec![None; cells.len()];
        source.eval_in_gamut(&wi, &wo, &mut values);
        values
    };
    let near: Vec<usize> = kept.iter().map(|&(i, o, k, _)| cell((i, o, k))).collect();
    let far: Vec<usize> = kept.iter().map(|&(i, o, k, _)| cell((i, o, AZIMUTHS - k))).collect();
    let first = read(&near);
    let second = if source.is_mirror_symmetric() { first.clone() } else { read(&far) };
    let mut samples = Vec::with_capacity(kept.len());
    for (index, &(_, _, _, cells)) in kept.iter().enumerate() {
        let own_mirror = near[index] == far[index];
        let mut sample = Sample { cell: near[index] as u32, count: [0.0; 2], reference: [[0.0; 3]; 2] };
        for (side, value) in [first[index], second[index]].into_iter().enumerate() {
            let Some(value) = value else { continue };
            if value.iter().any(|v| !v.is_finite() || *v < 0.0) {
                let reason = format!("a value is {value:?}; it must be finite and not negative");
                return Err(MetricError::Unusable { side: Side::Reference, reason });
            }
            sample.reference[side] = value;
            sample.count[side] = if side == 1 && own_mirror { 0.0 } else { cells as f32 };
        }
        // One comparison for both sides where they are the same.
        if sample.count[0] > 0.0 && sample.count[1] > 0.0 && sample.reference[0] == sample.reference[1] {
            sample.count = [sample.count[0] + sample.count[1], 0.0];
        }
        samples.push(sample);
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::Ggx;

    #[test]
    fn blocks_stand_for_every_cell() {
        let brdf = Ggx::new([0.2; 3], [0.04; 3], 0.1).unwrap();
        for (n, limit) in [(1, 10), (3, 80), (4, 80), (7, 90)] {
            let lattice = Lattice::new(&brdf, n, limit).unwrap();
            let cells: f64 = lattice.samples.iter().map(Sample::cells).sum();
            // A block that ends at 180 degrees is counted on both sides when its middle is not its own mirror image.
            let expected = (limit * limit * AZIMUTHS) as f64;
            assert!((cells / expected - 1.0).abs() < 0.02 && (n > 1 || cells == expected), "{n}: {cells} {expected}");
            assert!(n == 1 || lattice.len() < 130_000, "{n}: {}", lattice.len());
        }
    }
}
