//! A manifold through reference BRDFs, and approximations of a reference that lie on it.
//!
//! Tables x = ln(f + 0.001) of n references become points z of a space of few dimensions, and every z a table
//! mean + sum_j w_j(z) (x_j - mean): a linear combination of the references, exponentiated and not below 0. [`Kind`] says how:
//! `latent.rs` the study's way, `linear.rs` by principal components. The approximations of the reference at c lie at
//!
//!   c_i = c + d (i/N)^5 r,   i = 1..N, N = 6,
//!
//! d a random unit vector, r the diameter of the references' points: the largest distance between two.
//!
//! Source: Lavoué et al. 2021, section 3.3, doi:10.1111/cgf.142636, on the manifold of Soler, Subr & Nowrouzezahrai 2018,
//! doi:10.1111/cgf.13348. Cost: n^2 products of tables; 8 bytes a cell, channel and reference.

mod latent;
mod linear;

use super::optimizer::StopReason;
use crate::brdf::{Brdf, Grid, TableError, TabulatedBrdf};
use crate::math::seed;
use latent::Latent;
use linear::Linear;
use ndarray::{Array1, Array2, Axis};
use rand::Rng;
use std::f64::consts::PI;
use thiserror::Error;

/// Approximations of one reference.
pub const SAMPLES: usize = 6;
/// Keeps logarithms away from zero, 1/sr.
const EPSILON: f64 = 1e-3;

/// What is wrong with the references of a manifold.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum ManifoldError {
    #[error("the manifold has {found} references; it must have at least 2 that differ")]
    TooFew { found: usize },
    #[error("reference {index}: {cause}")]
    Reference { index: usize, cause: TableError },
    #[error("there is no reference {found}; it must be 0 to {last}")]
    NoReference { found: usize, last: usize },
    #[error("there is no sample {found}; it must be 0 (the reference itself) to {SAMPLES}")]
    NoSample { found: usize },
    #[error("the sample is not a table: {0}")]
    Sample(TableError),
    #[error("no points were found for the references: {reason}")]
    Search { reason: String },
}

/// How references become points and points tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// Gaussian process latent variables, the study's.
    Latent,
    /// Principal components.
    Linear,
}

/// A manifold through tables on one grid.
#[derive(Debug, Clone)]
pub struct Manifold {
    grid: Grid,
    /// Cells that every reference has.
    valid: Vec<bool>,
    mean: Array1<f64>,
    /// References x (valid cells x channels), without the mean.
    rows: Array2<f64>,
    space: Space,
    diameter: f64,
}

/// The points of the references, and the way from a point to the weights of the references.
#[derive(Debug, Clone)]
enum Space {
    Latent(Latent),
    Linear(Linear),
}

impl Space {
    /// References x dimensions.
    fn coordinates(&self) -> &Array2<f64> {
        match self {
            Self::Latent(latent) => latent.coordinates(),
            Self::Linear(linear) => linear.coordinates(),
        }
    }

    /// The weight of every reference at a point.
    fn weights(&self, point: &[f64]) -> Array1<f64> {
        match self {
            Self::Latent(latent) => latent.weights(point),
            Self::Linear(linear) => linear.weights(point),
        }
    }
}

impl Manifold {
    /// Through `references`, tabulated on `grid`. `dimension`, at most n - 1: of latent variables, by default 4; or the number of
    /// principal components, by default all, so that the manifold passes through every reference. Latent ones always do.
    ///
    /// # Errors
    /// Fewer than two different references, one without a valid cell, a search for latent variables that fails.
    pub fn new(
        kind: Kind,
        references: &[&dyn Brdf],
        grid: Grid,
        dimension: Option<usize>,
    ) -> Result<Self, ManifoldError> {
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
        let products = rows.dot(&rows.t());
        let linear = Linear::new(products.view(), dimension.filter(|_| kind == Kind::Linear))?;
        let space = match kind {
            Kind::Linear => Space::Linear(linear),
            Kind::Latent => Space::Latent(Latent::new(products.view(), &linear, dimension)?),
        };
        let diameter = diameter(space.coordinates());
        Ok(Self { grid, valid, mean, rows, space, diameter })
    }

    /// Number of coordinates.
    pub fn dimension(&self) -> usize {
        self.space.coordinates().ncols()
    }

    /// Why the search for latent variables ended; principal components are found directly.
    pub fn stop(&self) -> StopReason {
        match &self.space {
            Space::Latent(latent) => latent.stop(),
            Space::Linear(_) => StopReason::Direct,
        }
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
        let coordinates = self.space.coordinates();
        let last = coordinates.nrows() - 1;
        if reference > last {
            return Err(ManifoldError::NoReference { found: reference, last });
        }
        Ok(coordinates.row(reference).to_vec())
    }

    /// The BRDF at coordinates, as many as [`Manifold::dimension`] says.
    ///
    /// # Errors
    /// [`ManifoldError::Sample`] where it is too large for a table.
    pub fn at(&self, coordinates: &[f64]) -> Result<TabulatedBrdf, ManifoldError> {
        let logs = &self.mean + &self.space.weights(coordinates).dot(&self.rows);
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

    fn manifold(kind: Kind, dimension: Option<usize>) -> Manifold {
        let references = references();
        let borrowed: Vec<&dyn Brdf> = references.iter().map(AsRef::as_ref).collect();
        Manifold::new(kind, &borrowed, GRID, dimension).unwrap()
    }

    #[test]
    fn manifolds_pass_through_their_references() {
        for (manifold, tolerance) in [(manifold(Kind::Linear, None), 1e-5), (manifold(Kind::Latent, Some(2)), 1e-2)] {
            for (index, reference) in references().iter().enumerate() {
                let table = TabulatedBrdf::tabulate(reference.as_ref(), GRID).unwrap();
                let found = manifold.sample(index, 0, 1).unwrap();
                for (cell, (a, b)) in table.values().iter().zip(found.values()).enumerate() {
                    let near = (0..3).all(|c| (a[c] - b[c]).abs() <= tolerance * (a[c] + 1e-3));
                    assert!(near || !found.valid()[cell], "{index} {cell}: {a:?} {b:?}");
                }
            }
        }
        let dimensions = [(Kind::Linear, None), (Kind::Linear, Some(2)), (Kind::Latent, None), (Kind::Latent, Some(9))];
        assert_eq!(dimensions.map(|(kind, dimension)| manifold(kind, dimension).dimension()), [4, 2, 4, 4]);
    }

    #[test]
    fn distances_grow_with_the_number_of_the_sample() {
        let registry = Registry::standard().unwrap();
        for (kind, reference) in [(Kind::Linear, 0), (Kind::Linear, 3), (Kind::Latent, 0), (Kind::Latent, 3)] {
            let manifold = manifold(kind, None);
            let centre = manifold.sample(reference, 0, 1).unwrap();
            for name in ["D9.Cl", "D4.Cl.CR"] {
                let metric = registry.get(name).unwrap();
                let distance = |i| metric.distance(&centre, &manifold.sample(reference, i, 1).unwrap()).unwrap();
                let distances: Vec<f64> = (1..=SAMPLES).map(distance).collect();
                // A diameter away there may be no other reference: a Gaussian process returns to the mean there, which may be
                // nearer than what lies on the way.
                let rising = if kind == Kind::Linear { SAMPLES } else { SAMPLES - 1 };
                let grow = distances[..rising].windows(2).all(|w| w[0] < w[1]) && distances[0] > 0.0;
                let grow = grow && distances[SAMPLES - 1] > distances[SAMPLES - 3];
                assert!(grow, "{kind:?} {reference} {name}: {distances:?}");
            }
        }
        // The last sample is a diameter away, the same direction every time.
        let manifold = manifold(Kind::Latent, None);
        assert_eq!(manifold.sample(0, 6, 1).unwrap().values(), manifold.sample(0, 6, 1).unwrap().values());
        assert_ne!(manifold.sample(0, 6, 1).unwrap().values(), manifold.sample(0, 6, 2).unwrap().values());
    }

    #[test]
    fn what_does_not_exist_is_refused() {
        let manifold = manifold(Kind::Latent, None);
        assert_eq!(manifold.sample(5, 1, 1).unwrap_err(), ManifoldError::NoReference { found: 5, last: 4 });
        assert_eq!(manifold.sample(0, 7, 1).unwrap_err(), ManifoldError::NoSample { found: 7 });
        let one = Ggx::new([0.3; 3], [0.04; 3], 0.3).unwrap();
        for kind in [Kind::Latent, Kind::Linear] {
            let error = Manifold::new(kind, &[&one, &one], GRID, None).unwrap_err();
            assert_eq!(error, ManifoldError::TooFew { found: 2 });
        }
    }
}
