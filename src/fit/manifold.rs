//! A linear manifold through reference BRDFs, and approximations of a reference that lie on it.
//!
//! Tables x = ln(f + 0.001) of n references span a space of n - 1 dimensions around their mean; with orthonormal axes c_k by
//! falling variance, z = c.(x - mean) are the coordinates of a table, and exp(mean + c^T z) - 0.001, not below 0, is the BRDF
//! at coordinates z. With all axes the manifold passes through every reference exactly. The approximations of the reference
//! at c lie at
//!
//!   c_i = c + d (i/N)^5 r,   i = 1..N, N = 6,
//!
//! d a random unit vector of the space of coordinates, r its diameter: the largest distance between two references.
//!
//! Source: Lavoué et al. 2021, section 3.3, doi:10.1111/cgf.142636, on the manifold of Soler et al. 2018,
//! doi:10.1111/cgf.13348. Difference: theirs is a Gaussian process latent variable model; this is the linear case, principal
//! components as in Nielsen et al. 2015, doi:10.1145/2816795.2818085. Cost: n^2 products of tables; 8 bytes a cell, channel
//! and reference.

use crate::brdf::{Brdf, Grid, TableError, TabulatedBrdf};
use crate::math::{eigen, seed};
use ndarray::{Array1, Array2, Axis, s};
use rand::Rng;
use std::f64::consts::PI;
use thiserror::Error;

/// Approximations of one reference.
pub const SAMPLES: usize = 6;
/// Keeps logarithms away from zero, 1/sr.
const EPSILON: f64 = 1e-3;
/// Axes of less than this share of the largest variance are rounding.
const TOLERANCE: f64 = 1e-12;

/// What is wrong with the references of a manifold.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ManifoldError {
    #[error("{found} references; a manifold needs at least 2 that differ")]
    TooFew { found: usize },
    #[error("reference {index}: {cause}")]
    Reference { index: usize, cause: TableError },
    #[error("no reference number {found}; allowed: 0 to {last}")]
    NoReference { found: usize, last: usize },
    #[error("sample {found}; allowed: 0 (the reference itself) to {SAMPLES}")]
    NoSample { found: usize },
    #[error("the sample is no table: {0}")]
    Sample(TableError),
}

/// A linear manifold through tables on one grid.
#[derive(Debug, Clone)]
pub struct Manifold {
    grid: Grid,
    /// Cells that every reference has.
    valid: Vec<bool>,
    mean: Array1<f64>,
    /// Axes x (valid cells x channels), orthonormal.
    axes: Array2<f64>,
    /// References x axes.
    coordinates: Array2<f64>,
    diameter: f64,
}

impl Manifold {
    /// Through `references`, tabulated on `grid`, along the `dimension` axes of the largest variance; `None`: along all, so
    /// that it passes through each.
    ///
    /// # Errors
    /// Fewer than two different references, one without a valid cell.
    pub fn new(references: &[&dyn Brdf], grid: Grid, dimension: Option<usize>) -> Result<Self, ManifoldError> {
        let n = references.len();
        let table = |(index, brdf): (usize, &&dyn Brdf)| {
            TabulatedBrdf::tabulate(*brdf, grid).map_err(|cause| ManifoldError::Reference { index, cause })
        };
        let tables = references.iter().enumerate().map(table).collect::<Result<Vec<_>, _>>()?;
        let valid: Vec<bool> = (0..grid.len()).map(|c| tables.iter().all(|t| t.valid()[c])).collect();
        let width = 3 * valid.iter().filter(|v| **v).count();
        if n < 2 || width == 0 {
            return Err(ManifoldError::TooFew { found: n });
        }
        let mut rows = Array2::zeros((n, width));
        for (mut row, table) in rows.outer_iter_mut().zip(&tables) {
            let cells = table.values().iter().zip(&valid).filter(|(_, valid)| **valid);
            let logs = cells.flat_map(|(v, _)| v.map(|f| (f64::from(f) + EPSILON).ln()));
            row.iter_mut().zip(logs).for_each(|(x, log)| *x = log);
        }
        drop(tables);
        let mean = rows.sum_axis(Axis(0)) / n as f64;
        rows -= &mean;
        let (variances, vectors) = eigen::symmetric(rows.dot(&rows.t()).view());
        let all = variances.iter().take(n - 1).take_while(|v| **v > TOLERANCE * variances[0]).count();
        let kept = dimension.map_or(all, |d| d.min(all));
        if kept == 0 {
            return Err(ManifoldError::TooFew { found: n });
        }
        let mut axes = vectors.slice(s![.., ..kept]).t().dot(&rows);
        for mut axis in axes.outer_iter_mut() {
            let length = axis.dot(&axis).sqrt();
            // The largest weight is positive, whatever the solver says.
            let largest = axis.iter().fold(0.0f64, |a, &b| if b.abs() > a.abs() { b } else { a });
            axis /= length * largest.signum();
        }
        let coordinates = rows.dot(&axes.t());
        let diameter = diameter(&coordinates);
        Ok(Self { grid, valid, mean, axes, coordinates, diameter })
    }

    /// Number of axes.
    pub fn dimension(&self) -> usize {
        self.axes.nrows()
    }

    /// r: the largest distance between two references.
    pub fn diameter(&self) -> f64 {
        self.diameter
    }

    /// Coordinates of a reference.
    ///
    /// # Errors
    /// [`ManifoldError::NoReference`].
    pub fn coordinates(&self, reference: usize) -> Result<Vec<f64>, ManifoldError> {
        let last = self.coordinates.nrows() - 1;
        if reference > last {
            return Err(ManifoldError::NoReference { found: reference, last });
        }
        Ok(self.coordinates.row(reference).to_vec())
    }

    /// The BRDF at coordinates, one an axis.
    ///
    /// # Errors
    /// [`ManifoldError::Sample`] where it is too large for a table.
    pub fn at(&self, coordinates: &[f64]) -> Result<TabulatedBrdf, ManifoldError> {
        let logs = &self.mean + &self.axes.t().dot(&Array1::from(coordinates.to_vec()));
        let mut numbers = logs.iter().map(|log| (log.exp() - EPSILON).max(0.0) as f32);
        let mut next = || numbers.next().unwrap_or_default();
        let values = self.valid.iter().map(|valid| if *valid { [next(), next(), next()] } else { [0.0; 3] }).collect();
        TabulatedBrdf::new(self.grid, values, self.valid.clone()).map_err(ManifoldError::Sample)
    }

    /// Approximation `i` (0, the reference itself, to 6) of reference number `reference`; the direction depends on the seed
    /// and the reference alone.
    ///
    /// # Errors
    /// [`ManifoldError::NoReference`], [`ManifoldError::NoSample`], those of [`Manifold::at`].
    pub fn sample(&self, reference: usize, i: usize, seed: u64) -> Result<TabulatedBrdf, ManifoldError> {
        if i > SAMPLES {
            return Err(ManifoldError::NoSample { found: i });
        }
        let centre = self.coordinates(reference)?;
        let length = (i as f64 / SAMPLES as f64).powi(5) * self.diameter;
        let direction = direction(self.dimension(), seed, reference);
        let moved: Vec<f64> = centre.iter().zip(direction).map(|(c, d)| c + length * d).collect();
        self.at(&moved)
    }
}

fn diameter(coordinates: &Array2<f64>) -> f64 {
    let mut largest = 0.0f64;
    for a in coordinates.outer_iter() {
        for b in coordinates.outer_iter() {
            largest = largest.max((&a - &b).mapv(|x| x * x).sum());
        }
    }
    largest.sqrt()
}

/// A unit vector without preference for any direction: normal deviates (Box & Muller 1958), scaled.
fn direction(dimension: usize, seed: u64, reference: usize) -> Vec<f64> {
    let mut rng = seed::stream(seed, "manifold direction", reference as u64);
    let normal = |_| {
        let (u, v): (f64, f64) = (rng.random(), rng.random());
        (-2.0 * (1.0 - u).ln()).sqrt() * (2.0 * PI * v).cos()
    };
    let vector: Vec<f64> = (0..dimension).map(normal).collect();
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    vector.into_iter().map(|x| x / length).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::{BlinnPhong, Ggx, Ward, WardForm};
    use crate::metric::registry::Registry;

    const GRID: Grid = Grid::HalfDifference { theta_h: 20, theta_d: 10, phi_d: 20 };

    fn references() -> Vec<Box<dyn Brdf>> {
        vec![
            Box::new(Ggx::new([0.3, 0.1, 0.1], [0.04; 3], 0.3).unwrap()),
            Box::new(Ggx::new([0.02; 3], [0.8, 0.6, 0.3], 0.15).unwrap()),
            Box::new(BlinnPhong::new([0.1, 0.2, 0.5], [0.1; 3], 60.0).unwrap()),
            Box::new(Ward::new([0.05; 3], [0.2; 3], 0.2, WardForm::Duer).unwrap()),
            Box::new(Ggx::new([0.6, 0.6, 0.5], [0.02; 3], 0.6).unwrap()),
        ]
    }

    fn manifold(dimension: Option<usize>) -> Manifold {
        let references = references();
        let borrowed: Vec<&dyn Brdf> = references.iter().map(AsRef::as_ref).collect();
        Manifold::new(&borrowed, GRID, dimension).unwrap()
    }

    #[test]
    fn the_whole_manifold_passes_through_its_references() {
        let manifold = manifold(None);
        assert_eq!(manifold.dimension(), 4);
        for (index, reference) in references().iter().enumerate() {
            let table = TabulatedBrdf::tabulate(reference.as_ref(), GRID).unwrap();
            let found = manifold.sample(index, 0, 1).unwrap();
            for (cell, (a, b)) in table.values().iter().zip(found.values()).enumerate() {
                if found.valid()[cell] {
                    assert!((0..3).all(|c| (a[c] - b[c]).abs() <= 1e-5 * (a[c] + 1e-3)), "{index} {cell}: {a:?} {b:?}");
                }
            }
        }
        assert_eq!(self::manifold(Some(2)).dimension(), 2);
    }

    #[test]
    fn distances_grow_with_the_number_of_the_sample() {
        let manifold = manifold(None);
        let registry = Registry::standard().unwrap();
        for reference in [0, 3] {
            let centre = manifold.sample(reference, 0, 1).unwrap();
            for name in ["D9.Cl", "D4.Cl.CR"] {
                let metric = registry.get(name).unwrap();
                let distance = |i| metric.distance(&centre, &manifold.sample(reference, i, 1).unwrap()).unwrap();
                let distances: Vec<f64> = (1..=SAMPLES).map(distance).collect();
                assert!(distances.windows(2).all(|w| w[0] < w[1]) && distances[0] > 0.0, "{name}: {distances:?}");
            }
        }
        // The last sample is a diameter away, the same direction every time.
        assert_eq!(manifold.sample(0, 6, 1).unwrap().values(), manifold.sample(0, 6, 1).unwrap().values());
        assert_ne!(manifold.sample(0, 6, 1).unwrap().values(), manifold.sample(0, 6, 2).unwrap().values());
    }

    #[test]
    fn what_does_not_exist_is_refused() {
        let manifold = manifold(None);
        assert_eq!(manifold.sample(5, 1, 1).unwrap_err(), ManifoldError::NoReference { found: 5, last: 4 });
        assert_eq!(manifold.sample(0, 7, 1).unwrap_err(), ManifoldError::NoSample { found: 7 });
        let one = Ggx::new([0.3; 3], [0.04; 3], 0.3).unwrap();
        let error = Manifold::new(&[&one, &one], GRID, None).unwrap_err();
        assert_eq!(error, ManifoldError::TooFew { found: 2 });
    }
}
