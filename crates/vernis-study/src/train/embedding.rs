//! Principal components of a matrix whose rows are log-mapped BRDF tables.
//!
//!   x ~ mean + sum_k s_k c_k,   s_k = c_k.(x - mean),   c_k orthonormal
//!
//! Source: Nielsen, Jensen & Ramamoorthi (2015), doi:10.1145/2816795.2818085, 3, use it for BRDFs; solved by
//! `linfa-linalg`'s symmetric eigensolver on the matrix of the rows' inner products, which is small where there are few
//! rows of many numbers. (`linfa-reduction` iterates from a random block; with tens of components of a hundred rows it
//! stops far from the eigenvectors, or returns fewer.) The explained variance is a share of all variance, not of that
//! of the kept components. Signs are fixed so that the largest weight of each component is positive. Cost: n^2 D + 10
//! n^3 for n rows of D numbers.

use super::TrainError;
use linfa_linalg::eigh::{EigSort, Eigh};
use ndarray::{Array1, Array2, ArrayView2, Axis, s};

const NAME: &str = "principal-components";

/// Of the largest variance: directions along which the rows vary less are rounding.
const TOLERANCE: f64 = 1e-11;

/// Mean, components and what they explain.
#[derive(Debug, Clone, PartialEq)]
pub struct PrincipalComponents {
    /// Mean row.
    pub mean: Array1<f64>,
    /// Components x columns, orthonormal, by falling variance.
    pub components: Array2<f64>,
    /// Share of the rows' total variance along each component.
    pub explained: Vec<f64>,
}

impl PrincipalComponents {
    /// The first `count` components of rows x columns, or as many as the rows span.
    pub fn fit(rows: ArrayView2<'_, f64>, count: usize) -> Result<Self, TrainError> {
        let option = |what, value, allowed| Err(TrainError::Option { trainer: NAME.into(), what, value, allowed });
        if rows.nrows() < 3 {
            return Err(TrainError::TooFewRows { trainer: NAME.into(), found: rows.nrows(), needed: 3 });
        }
        if count == 0 || count > rows.ncols().min(rows.nrows() - 1) {
            return option("the number of components", count as f64, "1 to the smaller of columns and rows - 1");
        }
        if let Some(&value) = rows.iter().find(|v| !v.is_finite()) {
            return option("a cell of the matrix", value, "finite");
        }
        let mean = rows.sum_axis(Axis(0)) / rows.nrows() as f64;
        let total: f64 = rows.outer_iter().map(|r| (&r - &mean).mapv(|v| v * v).sum()).sum();
        if total <= 0.0 {
            return Err(TrainError::NoDifference { trainer: NAME.into() });
        }
        let centred = &rows - &mean;
        let (variances, vectors) = centred
            .dot(&centred.t())
            .eigh()
            .map_err(|e| TrainError::Solver { trainer: NAME.into(), reason: e.to_string() })?
            .sort_eig_desc();
        let kept = variances.iter().take(count).take_while(|v| **v > TOLERANCE * variances[0]).count();
        let mut components = vectors.slice(s![.., ..kept]).t().dot(&centred);
        for mut component in components.outer_iter_mut() {
            let length = component.dot(&component).sqrt();
            let largest = component.iter().fold(0.0f64, |a, &b| if b.abs() > a.abs() { b } else { a });
            component /= length * largest.signum();
        }
        let explained = variances.iter().take(kept).map(|v| v / total).collect();
        Ok(Self { mean, components, explained })
    }

    /// Coordinates of one row along the components.
    pub fn scores(&self, row: &[f64]) -> Vec<f64> {
        let centred: Array1<f64> = row.iter().zip(&self.mean).map(|(x, m)| x - m).collect();
        self.components.dot(&centred).to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;
    use vernis_metric::math::seed::stream;

    /// n x d with singular values falling by `ratio`.
    fn matrix(n: usize, d: usize, ratio: f64) -> Array2<f64> {
        let mut rng = stream(3, "embedding-test", 0);
        let mut draw = |r, c| Array2::from_shape_fn((r, c), |_| rng.random::<f64>() - 0.5);
        let (u, v) = (draw(n, n), draw(n, d));
        let scale = Array1::from_iter((0..n).map(|i| ratio.powi(i as i32)));
        (&u * &scale).dot(&v)
    }

    #[test]
    fn components_are_orthonormal_eigenvectors() {
        let x = matrix(60, 300, 0.9);
        let pca = PrincipalComponents::fit(x.view(), 32).unwrap();
        let gram = pca.components.dot(&pca.components.t());
        assert!((&gram - &Array2::<f64>::eye(32)).iter().all(|e| e.abs() < 1e-6));
        let centred = &x - &pca.mean;
        let total: f64 = centred.iter().map(|v| v * v).sum();
        for (c, share) in pca.components.outer_iter().zip(&pca.explained) {
            let image = centred.t().dot(&centred.dot(&c));
            let residual = (&image - &(&c * (share * total))).mapv(|v| v * v).sum().sqrt();
            assert!(residual < 1e-4 * total, "residual {residual}, share {share}");
        }
    }

    #[test]
    fn explained_variance_is_a_share_of_everything() {
        let x = matrix(40, 100, 0.8);
        let few = PrincipalComponents::fit(x.view(), 3).unwrap();
        let shared: f64 = few.explained.iter().sum();
        let centred = &x - &few.mean;
        let total: f64 = centred.iter().map(|v| v * v).sum();
        let kept: f64 = centred.dot(&few.components.t()).iter().map(|v| v * v).sum();
        assert!(shared < 0.99 && (shared - kept / total).abs() < 1e-6, "{shared} {}", kept / total);
    }

    #[test]
    fn refuses_what_has_no_components() {
        let x = Array2::<f64>::zeros((5, 4));
        assert!(matches!(PrincipalComponents::fit(x.view(), 2), Err(TrainError::NoDifference { .. })));
        assert!(matches!(PrincipalComponents::fit(x.view(), 5), Err(TrainError::Option { .. })));
        let mut nan = Array2::from_shape_fn((5, 4), |(i, j)| (i * j) as f64);
        nan[[1, 1]] = f64::NAN;
        assert!(matches!(PrincipalComponents::fit(nan.view(), 2), Err(TrainError::Option { .. })));
    }
}
