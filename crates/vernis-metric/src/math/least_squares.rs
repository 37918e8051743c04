//! How much of a list of numbers a set of columns explains: linear least squares by orthogonal projection.
//!
//!   rss = |y - Q Q^T y|^2,   Q an orthonormal basis of the span of the columns, rank = number of its vectors
//!
//! Columns join one by one (Gram-Schmidt, each orthogonalised twice, which keeps Q orthonormal to rounding: Giraud,
//! Langou & Rozloznik 2005, doi:10.1016/j.camwa.2005.08.009). One that lies in the span of the earlier ones, to
//! `DEPENDENT` of its length, adds nothing, so that redundant columns are welcome. Cost: 4 n rank flops a column.

/// A column whose remainder is shorter than this part of the column depends on the earlier ones.
const DEPENDENT: f64 = 1e-9;

/// The span of the columns that were added.
#[derive(Debug, Clone, Default)]
pub struct Span {
    basis: Vec<Vec<f64>>,
}

impl Span {
    /// Adds a column, which is as long as every other one, and says whether the span grew.
    pub fn add(&mut self, column: &[f64]) -> bool {
        let length = norm(column);
        let rest = self.residual(&self.residual(column));
        let left = norm(&rest);
        // Written so that a column that is not finite is not taken for a direction.
        let independent = left > DEPENDENT * length && left.is_finite();
        if independent {
            self.basis.push(rest.iter().map(|r| r / left).collect());
        }
        independent
    }

    /// Dimension.
    pub fn rank(&self) -> usize {
        self.basis.len()
    }

    /// What of `y` the columns leave unexplained.
    pub fn residual(&self, y: &[f64]) -> Vec<f64> {
        let mut rest = y.to_vec();
        for q in &self.basis {
            let share: f64 = q.iter().zip(&rest).map(|(q, r)| q * r).sum();
            rest.iter_mut().zip(q).for_each(|(r, q)| *r -= share * q);
        }
        rest
    }

    /// Residual sum of squares of the least-squares fit of `y`.
    pub fn residual_sum_of_squares(&self, y: &[f64]) -> f64 {
        self.residual(y).iter().map(|r| r * r).sum()
    }
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
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
                let product: f64 = q.iter().zip(r).map(|(q, r)| q * r).sum();
                assert!((product - f64::from(u8::from(a == b))).abs() < 1e-12, "{a} {b}: {product}");
            }
        }
    }
}
