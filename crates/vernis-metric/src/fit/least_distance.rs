//! The shortest vector that satisfies linear inequalities, or the news that there is none.
//!
//!   min |x|^2  subject to  G x >= h
//!
//! By duality it is a least-squares problem under signs: with E the rows G^T and h^T, u >= 0 minimises |E u - e_last|^2; its
//! residual r gives x = -r/r_last, and r = 0 says that the inequalities contradict each other.
//! Source: Lawson & Hanson, *Solving Least Squares Problems*, 1974, algorithm LDP (23.27), doi:10.1137/1.9781611971217. It is
//! the quadratic programme of a rational fit as it stands; a general solver of cones would add thirty crates to do the same.
//! Cost: that of [`nonnegative_residual`] for m columns of n + 1 numbers, m inequalities in n unknowns.

use crate::math::least_squares::nonnegative_residual;

/// Inequalities that have no common point, or only points farther away than this.
const FARTHEST: f64 = 1e6;

/// The solution, or `None` where there is none within reach. `rows` are those of G, one of `h` each.
pub(super) fn solve(rows: &[Vec<f64>], h: &[f64]) -> Option<Vec<f64>> {
    let n = rows.first()?.len();
    let column = |j: usize| -> Vec<f64> { rows[j].iter().copied().chain([h[j]]).collect() };
    let columns: Vec<Vec<f64>> = (0..rows.len()).map(column).collect();
    let mut target = vec![0.0; n + 1];
    target[n] = 1.0;
    let residual = nonnegative_residual(&columns, &target)?;
    // |x|^2 = 1/|r|^2 - 1.
    let length = residual.iter().map(|r| r * r).sum::<f64>().sqrt();
    if length * FARTHEST < 1.0 {
        return None;
    }
    let last = residual[n];
    Some(residual[..n].iter().map(|r| -r / last).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of Lawson and Hanson's section 23.5: the shortest point of a half plane and of a corner.
    #[test]
    fn the_shortest_vector_is_found() {
        // x + y >= 2: (1, 1). With x >= 1.5 as well: (1.5, 0.5).
        let x = solve(&[vec![1.0, 1.0]], &[2.0]).unwrap();
        assert!((x[0] - 1.0).abs() < 1e-12 && (x[1] - 1.0).abs() < 1e-12, "{x:?}");
        let x = solve(&[vec![1.0, 1.0], vec![1.0, 0.0], vec![0.0, -1.0]], &[2.0, 1.5, -3.0]).unwrap();
        assert!((x[0] - 1.5).abs() < 1e-12 && (x[1] - 0.5).abs() < 1e-12, "{x:?}");
    }

    /// 0 x >= 0 holds wherever x is, and 0 x >= 1 nowhere.
    #[test]
    fn rows_of_zeros_hold_always_or_never() {
        let rows = [vec![1.0, 1.0], vec![1.0, 0.0], vec![0.0, -1.0]];
        let expected = solve(&rows, &[2.0, 1.5, -3.0]).unwrap();
        for place in 0..4 {
            let (mut with, mut h) = (rows.to_vec(), vec![2.0, 1.5, -3.0]);
            with.insert(place, vec![0.0; 2]);
            h.insert(place, 0.0);
            assert_eq!(solve(&with, &h).unwrap(), expected, "{place}");
            h[place] = -1.0;
            let x = solve(&with, &h).unwrap();
            assert!(x.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9), "{place}: {x:?}");
            h[place] = 1.0;
            assert_eq!(solve(&with, &h), None, "{place}");
        }
    }

    #[test]
    fn contradictions_are_told() {
        assert_eq!(solve(&[vec![1.0, 0.0], vec![-1.0, 0.0]], &[1.0, 1.0]), None);
        assert_eq!(solve(&[], &[]), None);
    }
}
