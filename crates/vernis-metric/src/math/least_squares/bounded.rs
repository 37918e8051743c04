//! Least squares within bounds, by coordinate descent on the normal equations.
//!
//!   x_i <- clamp((b_i - sum_(j != i) a_ij x_j)/a_ii, low_i, high_i),   one i after the other
//!
//! Source: Franc, Hlavac & Navara 2005, doi:10.1007/11556121_50. Cost: n^2 a sweep.

/// A sweep shrinks the error of two free unknowns by the square of the correlation of their columns: up to 0.95 these many
/// leave 1e-9 of it.
const SWEEPS: usize = 200;

/// The minimum of x.A x/2 - b.x within `bounds`, for a small positive semidefinite A, n x n and row-major. An unknown that
/// A says nothing of stays at its lower bound.
pub fn within_bounds(a: &[f64], b: &[f64], bounds: &[(f64, f64)]) -> Vec<f64> {
    let n = b.len();
    let mut x: Vec<f64> = bounds.iter().map(|(low, _)| *low).collect();
    for _ in 0..SWEEPS {
        for i in 0..n {
            if a[i * n + i] > 0.0 {
                let others: f64 = (0..n).filter(|j| *j != i).map(|j| a[i * n + j] * x[j]).sum();
                x[i] = ((b[i] - others) / a[i * n + i]).clamp(bounds[i].0, bounds[i].1);
            }
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::super::dot;
    use super::*;
    use crate::math::seed::stream;
    use rand::Rng;

    #[test]
    fn bounds_hold_and_the_rest_is_solved() {
        // Unbounded solution (1, -1); with x_1 >= 0 it is (0.5, 0).
        let x = within_bounds(&[2.0, 1.0, 1.0, 2.0], &[1.0, -1.0], &[(0.0, 5.0), (0.0, 5.0)]);
        assert_eq!(x, [0.5, 0.0]);
        let x = within_bounds(&[2.0, 1.0, 1.0, 2.0], &[1.0, -1.0], &[(-5.0, 5.0), (-5.0, 5.0)]);
        assert!((x[0] - 1.0).abs() < 1e-12 && (x[1] + 1.0).abs() < 1e-12);
        // Of an unknown without a column nothing is known.
        assert_eq!(within_bounds(&[0.0], &[0.0], &[(0.25, 1.0)]), [0.25]);
    }

    /// Karush, Kuhn and Tucker: the slope A x - b vanishes inside, and points outwards at a bound.
    #[test]
    fn random_problems_meet_the_conditions_of_a_minimum() {
        let mut rng = stream(5, "bounded least squares", 0);
        for _ in 0..200 {
            let n = rng.random_range(1..4);
            let columns: Vec<Vec<f64>> =
                (0..n).map(|_| (0..12).map(|_| rng.random_range(-1.0..1.0)).collect()).collect();
            let a: Vec<f64> = columns.iter().flat_map(|p| columns.iter().map(|q| dot(p, q))).collect();
            let b: Vec<f64> = (0..n).map(|_| rng.random_range(-3.0..3.0)).collect();
            let x = within_bounds(&a, &b, &vec![(0.0, 0.5); n]);
            for i in 0..n {
                let slope = dot(&a[i * n..(i + 1) * n], &x) - b[i];
                let met = match x[i] {
                    0.0 => slope > -1e-9,
                    0.5 => slope < 1e-9,
                    inside => (0.0..0.5).contains(&inside) && slope.abs() < 1e-9,
                };
                assert!(met, "{x:?} {slope}");
            }
        }
    }
}
