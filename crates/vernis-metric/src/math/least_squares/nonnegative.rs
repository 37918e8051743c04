//! Least squares under signs (NNLS): min |sum u_j e_j - y|^2 over u >= 0.
//!
//! A set of active columns grows by the one that promises most, and the unconstrained solution of the set is taken; where
//! that would turn some negative, the step ends at the first zero and that column leaves. Source: Lawson & Hanson, *Solving
//! Least Squares Problems*, 1974, algorithm NNLS (23.10), doi:10.1137/1.9781611971217. Cost: O(m n) a step for m columns of
//! n numbers, and O(n^3). Columns are scaled to one length first; one of zeros shortens nothing and never becomes active.

use super::{Span, dot};

/// Steps are few times the number of rows; more means that rounding drives the set in circles.
const STEPS: usize = 20;
/// Active columns are independent but for rounding; what is closer than this counts as dependent.
const DEPENDENT: f64 = 1e-13;
/// A gain below this, in units of the target, is rounding.
const NO_GAIN: f64 = 1e-12;

/// The residual sum u_j e_j - target of the solution; `None` if the active set does not settle, or a number is not finite.
pub fn nonnegative_residual(columns: &[Vec<f64>], target: &[f64]) -> Option<Vec<f64>> {
    if !columns.iter().flatten().chain(target).all(|x| x.is_finite()) {
        return None;
    }
    let columns: Vec<Vec<f64>> = columns.iter().filter_map(|column| unit(column)).collect();
    let mut active: Vec<usize> = Vec::new();
    let mut u: Vec<f64> = Vec::new();
    for _ in 0..STEPS * target.len() {
        let mut rest = target.to_vec();
        for (&j, u) in active.iter().zip(&u) {
            rest.iter_mut().zip(&columns[j]).for_each(|(r, c)| *r -= u * c);
        }
        let open = (0..columns.len()).filter(|j| !active.contains(j));
        let best = open.map(|j| (dot(&columns[j], &rest), j)).max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, entering)) = best.filter(|(gain, _)| *gain > NO_GAIN) else {
            return Some(rest.into_iter().map(|r| -r).collect());
        };
        active.push(entering);
        u.push(0.0);
        settle(&columns, target, &mut active, &mut u);
        // A column that cannot enter for rounding would be tried for ever.
        if !active.contains(&entering) {
            return Some(rest.into_iter().map(|r| -r).collect());
        }
    }
    None
}

/// The column at length 1; `None` for one of zeros. The largest entry comes out first, so that squares neither vanish nor overflow.
fn unit(column: &[f64]) -> Option<Vec<f64>> {
    let largest = column.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let scaled: Vec<f64> = column.iter().map(|x| x / largest).collect();
    let length = dot(&scaled, &scaled).sqrt();
    (largest > 0.0).then(|| scaled.iter().map(|x| x / length).collect())
}

/// Solves for the active columns and drops those that would turn negative, until none does.
fn settle(columns: &[Vec<f64>], target: &[f64], active: &mut Vec<usize>, u: &mut Vec<f64>) {
    while !active.is_empty() {
        let mut span = Span::new(DEPENDENT);
        active.iter().for_each(|&j| {
            span.add(&columns[j]);
        });
        let z = span.coefficients(target);
        let step = u.iter().zip(&z).filter(|(_, z)| **z <= 0.0).map(|(u, z)| u / (u - z)).fold(f64::INFINITY, f64::min);
        if step == f64::INFINITY {
            *u = z;
            return;
        }
        let step = if step.is_nan() { 0.0 } else { step };
        u.iter_mut().zip(&z).for_each(|(u, z)| *u += step * (z - *u));
        let negative = |k: &usize| z[*k] <= 0.0 && u[*k] <= 1e-14 * (1.0 + z[*k].abs());
        let mut dropped: Vec<usize> = (0..u.len()).filter(negative).collect();
        if dropped.is_empty() {
            // Rounding: the one that stopped the step goes.
            dropped = (0..u.len()).filter(|k| z[*k] <= 0.0).take(1).collect();
        }
        for k in dropped.into_iter().rev() {
            active.remove(k);
            u.remove(k);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::seed::stream;
    use rand::Rng;

    #[test]
    fn small_problems_are_solved() {
        // By hand: u = (1.5, 1) leaves (-0.5, 0.5, 0). Without the sign u_2 would be -1; with it, u = (0.5, 0) leaves
        // (-0.5, 0.5, 1).
        let norm = |columns: &[Vec<f64>], y: &[f64]| {
            let r = nonnegative_residual(columns, y).unwrap();
            dot(&r, &r).sqrt()
        };
        let found = norm(&[vec![1.0, 1.0, 0.0], vec![0.0, 0.0, 1.0]], &[2.0, 1.0, 1.0]);
        assert!((found - 0.5f64.sqrt()).abs() < 1e-14, "{found}");
        let found = norm(&[vec![1.0, 1.0, 0.0], vec![-1.0, -1.0, 1.0]], &[1.0, 0.0, -1.0]);
        assert!((found - 1.5f64.sqrt()).abs() < 1e-14, "{found}");
    }

    /// A column of zeros, wherever it stands, changes nothing; nor does one whose squares vanish or overflow in f64.
    #[test]
    fn columns_of_zeros_change_nothing() {
        let columns = [vec![1.0, 1.0, 0.0], vec![0.0, 0.0, 1.0]];
        let y = [2.0, 1.0, 1.0];
        let expected = nonnegative_residual(&columns, &y).unwrap();
        for place in 0..3 {
            let mut with = columns.to_vec();
            with.insert(place, vec![0.0; 3]);
            assert_eq!(nonnegative_residual(&with, &y).unwrap(), expected, "{place}");
        }
        assert_eq!(nonnegative_residual(&[vec![0.0; 3]], &y).unwrap(), y.map(|y| -y));
        for scale in [1e-200, 1e200] {
            let scaled: Vec<Vec<f64>> = columns.iter().map(|c| c.iter().map(|x| scale * x).collect()).collect();
            let found = nonnegative_residual(&scaled, &y).unwrap();
            assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12), "{scale}: {found:?}");
        }
        assert_eq!(nonnegative_residual(&[vec![f64::NAN, 1.0, 0.0]], &y), None);
        assert_eq!(nonnegative_residual(&[vec![1.0, f64::INFINITY, 0.0]], &y), None);
    }

    /// Karush, Kuhn and Tucker: no column can shorten the residual r any more, e_j . r >= 0, and r is orthogonal to its own
    /// combination of columns, r . (r + y) = 0.
    #[test]
    fn random_problems_meet_the_conditions_of_a_minimum() {
        let mut rng = stream(6, "nonnegative least squares", 0);
        for _ in 0..200 {
            let (rows, count) = (rng.random_range(2..9), rng.random_range(1..30));
            let columns: Vec<Vec<f64>> =
                (0..count).map(|_| (0..rows).map(|_| rng.random_range(-1.0..1.0)).collect()).collect();
            let y: Vec<f64> = (0..rows).map(|_| rng.random_range(-1.0..1.0)).collect();
            let r = nonnegative_residual(&columns, &y).unwrap();
            assert!(columns.iter().all(|e| dot(e, &r) > -1e-10), "{r:?}");
            assert!((dot(&r, &r) + dot(&r, &y)).abs() < 1e-10, "{r:?}");
        }
    }
}
