//! How much of a list of numbers a set of columns explains, and by which coefficients: orthogonal projection.
//!
//!   A = Q R,   x = R^-1 Q^T y,   rss = |y - Q Q^T y|^2,   rank = number of columns of Q
//!
//! Columns join one by one (Gram-Schmidt, each orthogonalised twice, which keeps Q orthonormal to rounding: Giraud,
//! Langou & Rozloznik 2005, doi:10.1016/j.camwa.2005.08.009). One that lies in the span of the earlier ones, to a given part
//! of its length, adds nothing, so that redundant columns are welcome. Cost: 4 n rank flops a column.

use super::dot;

/// A column whose remainder is shorter than this part of the column depends on the earlier ones.
const DEPENDENT: f64 = 1e-9;

/// The span of the columns that were added.
#[derive(Debug, Clone)]
pub struct Span {
    dependent: f64,
    /// Number of columns that were added, dependent ones included.
    columns: usize,
    basis: Vec<Direction>,
}

/// What an independent column added: a column of Q and of R.
#[derive(Debug, Clone)]
struct Direction {
    /// Which column it was.
    column: usize,
    unit: Vec<f64>,
    /// Of the earlier directions, and then of this one, in the column.
    shares: Vec<f64>,
}

impl Default for Span {
    fn default() -> Self {
        Self::new(DEPENDENT)
    }
}

impl Span {
    /// Of no column. One whose remainder is shorter than the part `dependent` of it will add nothing.
    pub fn new(dependent: f64) -> Self {
        Self { dependent, columns: 0, basis: Vec::new() }
    }

    /// Adds a column, which is as long as every other one, and says whether the span grew.
    pub fn add(&mut self, column: &[f64]) -> bool {
        let mut rest = column.to_vec();
        let mut shares = vec![0.0; self.basis.len()];
        for _ in 0..2 {
            for (direction, total) in self.basis.iter().zip(&mut shares) {
                *total += direction.take_from(&mut rest);
            }
        }
        let left = norm(&rest);
        // Written so that a column that is not finite is not taken for a direction.
        let independent = left > self.dependent * norm(column) && left.is_finite();
        if independent {
            shares.push(left);
            let unit = rest.iter().map(|r| r / left).collect();
            self.basis.push(Direction { column: self.columns, unit, shares });
        }
        self.columns += 1;
        independent
    }

    /// Dimension.
    pub fn rank(&self) -> usize {
        self.basis.len()
    }

    /// What of `y` the columns leave unexplained.
    pub fn residual(&self, y: &[f64]) -> Vec<f64> {
        let mut rest = y.to_vec();
        for direction in &self.basis {
            direction.take_from(&mut rest);
        }
        rest
    }

    /// Residual sum of squares of the least-squares fit of `y`.
    pub fn residual_sum_of_squares(&self, y: &[f64]) -> f64 {
        self.residual(y).iter().map(|r| r * r).sum()
    }

    /// The coefficients of the least-squares fit of `y`, one a column; 0 for those that depend on earlier ones.
    pub fn coefficients(&self, y: &[f64]) -> Vec<f64> {
        let mut x = vec![0.0; self.columns];
        for (i, direction) in self.basis.iter().enumerate().rev() {
            let known: f64 = self.basis[i + 1..].iter().map(|later| later.shares[i] * x[later.column]).sum();
            x[direction.column] = (dot(&direction.unit, y) - known) / direction.shares[i];
        }
        x
    }
}

impl Direction {
    /// Takes the share of this direction out of `rest`, and gives it.
    fn take_from(&self, rest: &mut [f64]) -> f64 {
        let share = dot(&self.unit, rest);
        rest.iter_mut().zip(&self.unit).for_each(|(r, q)| *r -= share * q);
        share
    }
}

fn norm(v: &[f64]) -> f64 {
    dot(v, v).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn residuals_agree_with_numpy() {
        // numpy.linalg.lstsq([[1,0],[1,1],[1,2],[1,4]], [1,3,2,7]): residual sum of squares 3.6
        let mut span = Span::default();
        assert!(span.add(&[1.0; 4]));
        assert!(span.add(&[0.0, 1.0, 2.0, 4.0]));
        let y = [1.0, 3.0, 2.0, 7.0];
        assert!((span.residual_sum_of_squares(&y) - 3.6).abs() < 1e-13);
        assert_eq!(span.rank(), 2);
    }

    #[test]
    fn coefficients_solve_the_normal_equations() {
        // The same by hand: [4 7; 7 21] x = (13, 35) gives (0.8, 1.4). The repeated column gets nothing.
        let mut span = Span::default();
        for column in [[1.0; 4], [2.0; 4], [0.0, 1.0, 2.0, 4.0]] {
            span.add(&column);
        }
        let x = span.coefficients(&[1.0, 3.0, 2.0, 7.0]);
        assert_eq!(x[1], 0.0);
        assert!((x[0] - 0.8).abs() < 1e-14 && (x[2] - 1.4).abs() < 1e-14, "{x:?}");
    }

    #[test]
    fn dependent_columns_change_nothing() {
        let mut span = Span::default();
        assert!(span.add(&[1.0, 1.0, 0.0, 0.0]) && span.add(&[0.0, 0.0, 1e9, 1e9]));
        let before = span.residual_sum_of_squares(&[1.0, 2.0, 3.0, 5.0]);
        assert!(!span.add(&[1.0, 1.0, 1.0, 1.0]));
        assert!(!span.add(&[0.0; 4]) && !span.add(&[f64::NAN; 4]));
        assert_eq!(span.residual_sum_of_squares(&[1.0, 2.0, 3.0, 5.0]), before);
        assert!((before - 2.5).abs() < 1e-14);
    }

    #[test]
    fn nearly_parallel_columns_stay_orthogonal() {
        // Columns of a Hilbert matrix: condition 1.6e13 at 10, where Gram-Schmidt done once loses every digit.
        let column = |j: usize| (0..10).map(|i| 1.0 / (i + j + 1) as f64).collect::<Vec<f64>>();
        let mut span = Span::default();
        for j in 0..6 {
            assert!(span.add(&column(j)));
        }
        for (a, q) in span.basis.iter().enumerate() {
            for (b, r) in span.basis.iter().enumerate() {
                let product = dot(&q.unit, &r.unit);
                assert!((product - f64::from(u8::from(a == b))).abs() < 1e-12, "{a} {b}: {product}");
            }
        }
    }
}
