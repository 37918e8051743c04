//! References as points by principal components: with orthonormal axes c_k by falling variance, z = c.(x - mean), and
//! mean + c^T z is the table at z.
//!
//! An axis is a combination of references, c_k = V_k^T X/sqrt(l_k), with the eigenvectors V and eigenvalues l of X X^T: tables
//! themselves are not needed. Source: Nielsen, Jensen & Ramamoorthi 2015, doi:10.1145/2816795.2818085.

use super::ManifoldError;
use crate::math::eigen;
use ndarray::{Array1, Array2, ArrayView2, s};

/// Axes of less than this share of the largest variance are rounding.
const TOLERANCE: f64 = 1e-12;

#[derive(Debug, Clone)]
pub(super) struct Linear {
    /// References x axes.
    coordinates: Array2<f64>,
    /// What each reference gives to each axis: references x axes.
    axes: Array2<f64>,
}

impl Linear {
    /// `products`: X X^T of the references' rows without their mean.
    pub fn new(products: ArrayView2<'_, f64>, dimension: Option<usize>) -> Result<Self, ManifoldError> {
        let n = products.nrows();
        let (variances, vectors) = eigen::symmetric(products);
        let all = variances.iter().take(n - 1).take_while(|v| **v > TOLERANCE * variances[0]).count();
        let kept = dimension.map_or(all, |d| d.min(all));
        if kept == 0 {
            return Err(ManifoldError::TooFew { found: n });
        }
        let mut coordinates = vectors.slice(s![.., ..kept]).to_owned();
        let mut axes = coordinates.clone();
        for (k, variance) in variances.iter().take(kept).enumerate() {
            // The largest coordinate is positive, whatever the solver says.
            let largest = coordinates.column(k).iter().fold(0.0f64, |a, &b| if b.abs() > a.abs() { b } else { a });
            coordinates.column_mut(k).mapv_inplace(|x| x * variance.sqrt() * largest.signum());
            axes.column_mut(k).mapv_inplace(|x| x / variance.sqrt() * largest.signum());
        }
        Ok(Self { coordinates, axes })
    }

    pub fn coordinates(&self) -> &Array2<f64> {
        &self.coordinates
    }

    pub fn weights(&self, point: &[f64]) -> Array1<f64> {
        self.axes.dot(&Array1::from(point.to_vec()))
    }
}
