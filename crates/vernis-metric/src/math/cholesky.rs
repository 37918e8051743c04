//! Cholesky factors of symmetric positive definite matrices.
//!
//!   A = L L^T,   L lower triangular
//!
//! Golub & Van Loan, *Matrix Computations* (4th ed.), 4.2.5 (row by row). Cost: n^3/3; an inverse three times as much. Sums run in
//! a fixed order: the same input gives the same bytes.

use ndarray::{Array2, ArrayView2};

/// Sum of products, in eight fixed lanes so that it can be vectorised.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = a8.remainder().iter().zip(b8.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a8.zip(b8) {
        for i in 0..8 {
            lanes[i] += a[i] * b[i];
        }
    }
    lanes.iter().sum::<f64>() + tail
}

/// Solves (A + ridge I) x = b; `None` where the matrix is not positive definite. Only the lower triangle is read.
pub fn solve(a: ArrayView2<'_, f64>, ridge: f64, b: &[f64]) -> Option<Vec<f64>> {
    Cholesky::new(a, ridge).map(|factor| factor.solve(b))
}

/// Solves L^T x = b in place, L row-major n x n.
pub fn solve_transposed(l: &[f64], n: usize, x: &mut [f64]) {
    for i in (0..n).rev() {
        x[i] /= l[i * n + i];
        let xi = x[i];
        for (x, l) in x[..i].iter_mut().zip(&l[i * n..i * n + i]) {
            *x -= l * xi;
        }
    }
}

/// The factor L of a matrix.
#[derive(Debug, Clone)]
pub struct Cholesky {
    n: usize,
    /// Row-major, n x n.
    l: Vec<f64>,
}

impl Cholesky {
    /// Of A + ridge I; `None` where that is not positive definite. Only the lower triangle is read.
    pub fn new(a: ArrayView2<'_, f64>, ridge: f64) -> Option<Self> {
        let n = a.nrows();
        let mut l = vec![0.0; n * n];
        for i in 0..n {
            let (above, row) = l.split_at_mut(i * n);
            for j in 0..i {
                let other = &above[j * n..j * n + n];
                row[j] = (a[[i, j]] - dot(&row[..j], &other[..j])) / other[j];
            }
            let pivot = a[[i, i]] + ridge - dot(&row[..i], &row[..i]);
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            row[i] = pivot.sqrt();
        }
        Some(Self { n, l })
    }

    /// x with A x = b.
    pub fn solve(&self, b: &[f64]) -> Vec<f64> {
        let (n, l) = (self.n, &self.l);
        let mut x = b.to_vec();
        for i in 0..n {
            x[i] = (x[i] - dot(&l[i * n..i * n + i], &x[..i])) / l[i * n + i];
        }
        solve_transposed(l, n, &mut x);
        x
    }

    /// A^-1, symmetric to the last bit.
    pub fn inverse(&self) -> Array2<f64> {
        let mut inverse = Array2::zeros((self.n, self.n));
        for column in 0..self.n {
            let mut unit = vec![0.0; self.n];
            unit[column] = 1.0;
            for (row, x) in self.solve(&unit).into_iter().enumerate().skip(column) {
                inverse[[row, column]] = x;
                inverse[[column, row]] = x;
            }
        }
        inverse
    }

    /// ln |A|.
    pub fn log_determinant(&self) -> f64 {
        (0..self.n).map(|i| 2.0 * self.l[i * self.n + i].ln()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn a_matrix_times_its_inverse_is_one() {
        let a = array![[4.0, 1.0, 0.5], [1.0, 3.0, -1.0], [0.5, -1.0, 2.0]];
        let factor = Cholesky::new(a.view(), 0.0).unwrap();
        let product = a.dot(&factor.inverse());
        assert!((&product - &Array2::<f64>::eye(3)).iter().all(|x| x.abs() < 1e-15), "{product}");
        // 4 (6 - 1) - (2 + 0.5) + 0.5 (-1 - 1.5), by expansion.
        assert!((factor.log_determinant() - 16.25f64.ln()).abs() < 1e-14);
        let x = factor.solve(&[1.0, 2.0, 3.0]);
        assert!(a.dot(&ndarray::Array1::from(x)).iter().zip([1.0, 2.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-14));
        assert!(Cholesky::new(array![[1.0, 2.0], [2.0, 1.0]].view(), 0.0).is_none());
        assert!(Cholesky::new(array![[1.0, 2.0], [2.0, 1.0]].view(), 1.5).is_some());
    }
}
