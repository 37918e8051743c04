//! Eigenvectors of small symmetric matrices, by Jacobi's rotations.
//!
//! Sweeps over all pairs (p, q), p < q, turn each off-diagonal element to zero by a rotation in that plane, until the
//! off-diagonal part is rounding. Source: Golub & Van Loan, *Matrix Computations* (4th ed.), 8.5.2 and 8.5.3. Cost: about ten
//! sweeps of 4 n^3 multiplications; for a hundred rows a tenth of a second.

use ndarray::{Array1, Array2, ArrayView2};

const SWEEPS: usize = 60;

/// Eigenvalues, falling, and the eigenvectors as columns in the same order. Only for symmetric matrices.
pub fn symmetric(matrix: ArrayView2<'_, f64>) -> (Array1<f64>, Array2<f64>) {
    let n = matrix.nrows();
    let mut a = matrix.to_owned();
    let mut vectors = Array2::<f64>::eye(n);
    let scale = a.iter().map(|x| x * x).sum::<f64>();
    for _ in 0..SWEEPS {
        let mut off = 0.0;
        (0..n).for_each(|p| (0..p).for_each(|q| off += a[[p, q]] * a[[p, q]]));
        if off <= 1e-30 * scale {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                rotate(&mut a, &mut vectors, p, q);
            }
        }
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|i, j| a[[*j, *j]].total_cmp(&a[[*i, *i]]));
    let values = order.iter().map(|&i| a[[i, i]]).collect();
    let sorted = Array2::from_shape_fn((n, n), |(row, k)| vectors[[row, order[k]]]);
    (values, sorted)
}

/// Turns a_pq to zero.
fn rotate(a: &mut Array2<f64>, vectors: &mut Array2<f64>, p: usize, q: usize) {
    if a[[p, q]] == 0.0 {
        return;
    }
    let tau = (a[[q, q]] - a[[p, p]]) / (2.0 * a[[p, q]]);
    // The smaller of the two angles.
    let t = tau.signum() / (tau.abs() + (1.0 + tau * tau).sqrt());
    let cos = 1.0 / (1.0 + t * t).sqrt();
    let sin = t * cos;
    let n = a.nrows();
    for k in 0..n {
        let (x, y) = (a[[k, p]], a[[k, q]]);
        (a[[k, p]], a[[k, q]]) = (cos * x - sin * y, sin * x + cos * y);
    }
    for k in 0..n {
        let (x, y) = (a[[p, k]], a[[q, k]]);
        (a[[p, k]], a[[q, k]]) = (cos * x - sin * y, sin * x + cos * y);
        let (x, y) = (vectors[[k, p]], vectors[[k, q]]);
        (vectors[[k, p]], vectors[[k, q]]) = (cos * x - sin * y, sin * x + cos * y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_are_orthonormal_and_rebuild_the_matrix() {
        let n = 9;
        let a = Array2::from_shape_fn((n, n), |(i, j)| 1.0 / (i + j + 1) as f64 + if i == j { i as f64 } else { 0.0 });
        let (values, vectors) = symmetric(a.view());
        assert!(values.windows(2).into_iter().all(|w| w[0] >= w[1]));
        let gram = vectors.t().dot(&vectors);
        assert!((&gram - &Array2::<f64>::eye(n)).iter().all(|e| e.abs() < 1e-13));
        let rebuilt = (&vectors * &values).dot(&vectors.t());
        assert!((&rebuilt - &a).iter().all(|e| e.abs() < 1e-12));
    }
}
