//! The shortest vector that satisfies linear inequalities, or the news that there is none.
//!
//!   min |x|^2  subject to  G x >= h
//!
//! By duality it is a least-squares problem under signs: with E the rows G^T and h^T, u >= 0 minimises |E u - e_last|^2; its
//! residual r gives x = -r/r_last, and r = 0 says that the inequalities contradict each other.
//! Source: Lawson & Hanson, *Solving Least Squares Problems*, 1974, algorithms NNLS (23.10) and LDP (23.27),
//! doi:10.1137/1.9781611971217. It is the quadratic programme of a rational fit as it stands; a general solver of cones would
//! add thirty crates to do the same. Cost: an active set of at most n + 1 columns changes by one a step; each step takes
//! O(m n) for m inequalities in n unknowns, and O(n^3).

/// Inequalities that have no common point, or only points farther away than this.
const FARTHEST: f64 = 1e6;
/// Steps are few times the number of unknowns; more means that rounding drives the set in circles.
const STEPS: usize = 20;

/// The solution, or `None` where there is none within reach. `rows` are those of G, one of `h` each.
pub(super) fn solve(rows: &[Vec<f64>], h: &[f64]) -> Option<Vec<f64>> {
    let n = rows.first()?.len();
    let column = |j: usize| -> Vec<f64> { rows[j].iter().copied().chain([h[j]]).collect() };
    let columns: Vec<Vec<f64>> = (0..rows.len()).map(column).collect();
    let mut target = vec![0.0; n + 1];
    target[n] = 1.0;
    let residual = residual(&columns, &target)?;
    // |x|^2 = 1/|r|^2 - 1.
    let length = dot(&residual, &residual).sqrt();
    if length * FARTHEST < 1.0 {
        return None;
    }
    let last = residual[n];
    Some(residual[..n].iter().map(|r| -r / last).collect())
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// E u - target for the u >= 0 that makes it shortest (NNLS); `None` if the active set does not settle.
fn residual(columns: &[Vec<f64>], target: &[f64]) -> Option<Vec<f64>> {
    let mut active: Vec<usize> = Vec::new();
    let mut u: Vec<f64> = Vec::new();
    for _ in 0..STEPS * target.len() {
        let mut rest = target.to_vec();
        for (&j, u) in active.iter().zip(&u) {
            rest.iter_mut().zip(&columns[j]).for_each(|(r, c)| *r -= u * c);
        }
        let gain = |j: usize| dot(&columns[j], &rest) / dot(&columns[j], &columns[j]).sqrt();
        let open = (0..columns.len()).filter(|j| !active.contains(j));
        let best = open.map(|j| (gain(j), j)).max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((gain, entering)) = best.filter(|(gain, _)| *gain > 1e-12) else {
            return Some(rest.into_iter().map(|r| -r).collect());
        };
        debug_assert!(gain.is_finite());
        active.push(entering);
        u.push(0.0);
        settle(columns, target, &mut active, &mut u);
        // A column that cannot enter for rounding would be tried for ever.
        if !active.contains(&entering) {
            return Some(rest.into_iter().map(|r| -r).collect());
        }
    }
    None
}

/// Solves for the active columns and drops those that would turn negative, until none does.
fn settle(columns: &[Vec<f64>], target: &[f64], active: &mut Vec<usize>, u: &mut Vec<f64>) {
    while !active.is_empty() {
        let chosen: Vec<&[f64]> = active.iter().map(|&j| &columns[j][..]).collect();
        let z = least_squares(&chosen, target);
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

/// The least-squares solution for independent columns, by Gram-Schmidt, done twice over; dependent columns get zero.
fn least_squares(columns: &[&[f64]], target: &[f64]) -> Vec<f64> {
    let n = columns.len();
    let mut q: Vec<Vec<f64>> = Vec::with_capacity(n);
    let mut r = vec![0.0; n * n];
    for (j, column) in columns.iter().enumerate() {
        let mut v = column.to_vec();
        for _ in 0..2 {
            for (i, q) in q.iter().enumerate() {
                let share = dot(q, &v);
                r[i * n + j] += share;
                v.iter_mut().zip(q).for_each(|(v, q)| *v -= share * q);
            }
        }
        let length = dot(&v, &v).sqrt();
        let independent = length > 1e-13 * dot(column, column).sqrt();
        r[j * n + j] = if independent { length } else { 0.0 };
        q.push(v.iter().map(|v| if independent { v / length } else { 0.0 }).collect());
    }
    let mut x = vec![0.0; n];
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| r[i * n + j] * x[j]).sum();
        if r[i * n + i] > 0.0 {
            x[i] = (dot(&q[i], target) - known) / r[i * n + i];
        }
    }
    x
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

    #[test]
    fn contradictions_are_told() {
        assert_eq!(solve(&[vec![1.0, 0.0], vec![-1.0, 0.0]], &[1.0, 1.0]), None);
        assert_eq!(solve(&[], &[]), None);
    }
}
