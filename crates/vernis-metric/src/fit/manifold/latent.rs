//! References as points of a Gaussian process latent variable model.
//!
//! Cells are independent Gaussian processes over the space of z with the covariance s^2 k(z, z'), k = exp(-|z - z'|^2/2), so the most
//! likely table at z, given the references X at z_1..z_n without their mean, is their linear combination
//!
//!   sum_j w_j(z) x_j,   w(z) = K^-1 (k(z, z_1), .., k(z, z_n)),   K_ij = k(z_i, z_j),
//!
//! which passes through every reference, and far from all is the mean. The points are the most likely ones under a standard
//! normal prior: with S = X X^T and s^2 = tr(K^-1 S)/(n D) put in, they minimise
//!
//!   (n - 1) (ln |K| + n ln tr(K^-1 S))/2 + sum_i |z_i|^2/2.
//!
//! The likelihood of D cells is counted as if they were n - 1: neighbouring cells, and channels, are anything but independent, and
//! n references span n - 1 dimensions. The search starts at principal components of variance one and is L-BFGS with the gradient
//! dL/dz_i = sum_j 2 (dL/dK_ij) K_ij (z_j - z_i), so the points are a local optimum. The diagonal of K has 1e-6 added, for the
//! sake of its inverse.
//!
//! Source: N. D. Lawrence 2005, "Probabilistic non-linear principal component analysis with Gaussian process latent variable
//! models", JMLR 6; for BRDFs Soler, Subr & Nowrouzezahrai 2018, doi:10.1111/cgf.13348. Differences from the latter: the colour
//! channels of a material are one point, and the prior as above.

use super::super::FitError;
use super::super::optimizer::{Limits, Method, Objective, StopReason, minimise, unwatched};
use super::ManifoldError;
use super::linear::Linear;
use crate::math::cholesky::Cholesky;
use ndarray::{Array1, Array2, ArrayView2};

/// Latent variables where nobody says how many.
const DIMENSION: usize = 4;
/// Added to the diagonal of K.
const JITTER: f64 = 1e-6;
/// Points stay within this box.
const BOUND: f64 = 10.0;
const LIMITS: Limits = Limits { max_evaluations: 1000, step: 0.1, tolerance: 1e-6, gain: 1e-10, patience: None };

#[derive(Debug, Clone)]
pub(super) struct Latent {
    /// References x latent variables.
    coordinates: Array2<f64>,
    /// K^-1.
    inverse: Array2<f64>,
    stop: StopReason,
}

impl Latent {
    /// `products`: S. `linear`: all principal components.
    pub fn new(
        products: ArrayView2<'_, f64>,
        linear: &Linear,
        dimension: Option<usize>,
    ) -> Result<Self, ManifoldError> {
        let n = products.nrows();
        let components = linear.coordinates();
        let dimension = dimension.unwrap_or(DIMENSION).min(components.ncols());
        if dimension == 0 {
            return Err(ManifoldError::TooFew { found: n });
        }
        let scale = |k: usize| (components.column(k).mapv(|x| x * x).sum() / n as f64).sqrt();
        let start: Vec<f64> =
            (0..n * dimension).map(|at| components[[at / dimension, at % dimension]] / scale(at % dimension)).collect();
        let likelihood = Likelihood { products, dimension, bounds: vec![(-BOUND, BOUND); n * dimension] };
        let failed = |reason: String| ManifoldError::Search { reason };
        let found =
            minimise(Method::Lbfgs, &likelihood, &start, LIMITS, &unwatched).map_err(|e| failed(e.to_string()))?;
        let coordinates = Array2::from_shape_fn((n, dimension), |(i, k)| found.x[i * dimension + k]);
        let factor = Cholesky::new(covariance(&found.x, dimension).view(), JITTER)
            .ok_or_else(|| failed("two references have the same point".to_owned()))?;
        Ok(Self { coordinates, inverse: factor.inverse(), stop: found.stop })
    }

    pub fn coordinates(&self) -> &Array2<f64> {
        &self.coordinates
    }

    pub fn stop(&self) -> StopReason {
        self.stop
    }

    pub fn weights(&self, point: &[f64]) -> Array1<f64> {
        let near = |z: ndarray::ArrayView1<'_, f64>| kernel(z.iter().copied(), point);
        self.inverse.dot(&self.coordinates.outer_iter().map(near).collect::<Array1<f64>>())
    }
}

fn kernel(a: impl Iterator<Item = f64>, b: &[f64]) -> f64 {
    (-0.5 * a.zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>()).exp()
}

/// K without what is added to its diagonal.
fn covariance(z: &[f64], dimension: usize) -> Array2<f64> {
    let point = |i: usize| &z[i * dimension..(i + 1) * dimension];
    let n = z.len() / dimension;
    Array2::from_shape_fn((n, n), |(i, j)| kernel(point(i).iter().copied(), point(j)))
}

/// What the points minimise.
struct Likelihood<'a> {
    products: ArrayView2<'a, f64>,
    dimension: usize,
    bounds: Vec<(f64, f64)>,
}

impl Objective for Likelihood<'_> {
    fn bounds(&self) -> &[(f64, f64)] {
        &self.bounds
    }

    fn value(&self, z: &[f64]) -> Result<f64, FitError> {
        Ok(self.gradient(z)?.0)
    }

    fn gradient(&self, z: &[f64]) -> Result<(f64, Vec<f64>), FitError> {
        let (d, n) = (self.dimension, self.products.nrows());
        let covariance = covariance(z, d);
        let Some(factor) = Cholesky::new(covariance.view(), JITTER) else {
            return Ok((f64::INFINITY, vec![0.0; z.len()]));
        };
        let inverse = factor.inverse();
        let weighted = inverse.dot(&self.products);
        let trace = weighted.diag().sum();
        let (half, n_f) = (0.5 * (n - 1) as f64, n as f64);
        let value = half * (factor.log_determinant() + n_f * trace.ln()) + 0.5 * z.iter().map(|x| x * x).sum::<f64>();
        // dL/dK.
        let slope = (&inverse - &(weighted.dot(&inverse) * (n_f / trace))) * half;
        let mut gradient = z.to_vec();
        for i in 0..n {
            for j in 0..n {
                let factor = 2.0 * slope[[i, j]] * covariance[[i, j]];
                (0..d).for_each(|k| gradient[i * d + k] += factor * (z[j * d + k] - z[i * d + k]));
            }
        }
        Ok((value, gradient))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    /// Rows along an arc of 120 degrees, (cos t, sin t) without their mean.
    fn rows() -> Array2<f64> {
        let mut rows = Array2::from_shape_fn((9, 2), |(i, k)| {
            let t = 0.26 * i as f64;
            [t.cos(), t.sin()][k]
        });
        rows -= &rows.sum_axis(ndarray::Axis(0)).mapv(|x| x / 9.0);
        rows
    }

    #[test]
    fn the_gradient_is_that_of_the_value() {
        let products = rows().dot(&rows().t());
        let likelihood = Likelihood { products: products.view(), dimension: 2, bounds: vec![(-9.0, 9.0); 18] };
        let z: Vec<f64> = (0..18).map(|i| (1.7 * f64::from(i)).sin() * 1.5).collect();
        let (_, gradient) = likelihood.gradient(&z).unwrap();
        for at in 0..18 {
            let moved = |step: f64| {
                let mut z = z.clone();
                z[at] += step;
                likelihood.value(&z).unwrap()
            };
            let difference = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            assert!((gradient[at] / difference - 1.0).abs() < 1e-5, "{at}: {} {difference}", gradient[at]);
        }
    }

    #[test]
    fn one_latent_variable_follows_an_arc() {
        let rows = rows();
        let products = rows.dot(&rows.t());
        let linear = Linear::new(products.view(), Some(1)).unwrap();
        let latent = Latent::new(products.view(), &linear, Some(1)).unwrap();
        let z = latent.coordinates().column(0).to_vec();
        let rising = z.windows(2).filter(|w| w[1] > w[0]).count();
        assert!(rising == 0 || rising == 8, "{z:?}");
        let error = |weights: &dyn Fn(&[f64]) -> Array1<f64>, z: f64, t: f64| {
            let found = weights(&[z]).dot(&rows);
            let mean = [0, 1].map(|k| {
                (0..9).map(|i| [(0.26 * f64::from(i)).cos(), (0.26 * f64::from(i)).sin()][k]).sum::<f64>() / 9.0
            });
            (found[0] + mean[0] - t.cos()).hypot(found[1] + mean[1] - t.sin())
        };
        for i in 0..8 {
            // At the references themselves, and half-way between two, where one principal component is a chord's depth off.
            assert!(error(&|z| latent.weights(z), z[i], 0.26 * i as f64) < 1e-3);
            assert!(error(&|z| latent.weights(z), 0.5 * (z[i] + z[i + 1]), 0.26 * (i as f64 + 0.5)) < 0.02);
        }
        assert!(error(&|z| linear.weights(z), linear.coordinates()[[4, 0]], 1.04) > 0.1);
        // Far from all, there is the mean.
        assert!(latent.weights(&[1e3]).iter().all(|w| *w == 0.0));
    }

    #[test]
    fn two_references_lie_apart() {
        let products = array![[1.0, -1.0], [-1.0, 1.0]];
        let linear = Linear::new(products.view(), None).unwrap();
        let latent = Latent::new(products.view(), &linear, None).unwrap();
        assert_eq!(latent.coordinates().ncols(), 1);
        assert!((latent.coordinates()[[0, 0]] - latent.coordinates()[[1, 0]]).abs() > 0.5);
    }
}
