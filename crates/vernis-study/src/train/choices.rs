//! Votes on which of two pairs looks more alike, in a least-squares problem: a few Newton steps.
//!
//!   minimise over c:  c^T N c / 2 - b.c + mu sum_t [a_t l(-x_t) + b_t l(x_t)],   x_t = 3 (o_t + f_t.c),   l(x) = ln(1 + exp(x))
//!
//! with a_t and b_t the votes for the first and the second pair of triplet t. Convex, for N is positive definite. Cost: t r^2 a step for t
//! triplets and r coefficients.

use ndarray::Array2;
use vernis_metric::math::cholesky::{dot, solve};

/// Slope of the choice between two materials, per grade.
const SLOPE: f64 = 3.0;
/// Newton steps at most, and the change of the coefficients that is small enough.
const STEPS: usize = 6;
const CONVERGED: f64 = 1e-6;

/// The log losses of votes as a function of the coefficients.
pub(super) struct Choices {
    /// Difference of the factor's rows of (r, a) and (r, b), triplets x columns.
    pub steps: Array2<f64>,
    /// Difference of what is predicted without the kernel model.
    pub offsets: Vec<f64>,
    /// For a and for b.
    pub votes: Vec<[f64; 2]>,
    /// Weight of a vote's log loss.
    pub mu: f64,
}

impl Choices {
    /// c^T N c / 2 - b.c + mu sum of log losses.
    fn value(&self, normal: &Array2<f64>, right: &[f64], c: &[f64]) -> f64 {
        let quadratic: f64 = normal.outer_iter().zip(c).map(|(row, c_i)| c_i * dot(&row.to_vec(), c)).sum();
        let lost: f64 =
            self.logits(c).zip(&self.votes).map(|(logit, [a, b])| a * log1p_exp(-logit) + b * log1p_exp(logit)).sum();
        0.5 * quadratic - dot(right, c) + self.mu * lost
    }

    fn logits<'a>(&'a self, c: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let chosen = move |(row, offset): (ndarray::ArrayView1<'_, f64>, &f64)| {
            SLOPE * (offset + row.iter().zip(c).map(|(f, c)| f * c).sum::<f64>())
        };
        self.steps.outer_iter().zip(&self.offsets).map(chosen)
    }

    /// Newton steps from `c`, each halved until it lowers the value.
    pub(super) fn minimise(&self, normal: &Array2<f64>, right: &[f64], mut c: Vec<f64>) -> Option<Vec<f64>> {
        let mut value = self.value(normal, right, &c);
        for _ in 0..STEPS {
            let (mut slope, mut curvature) = (vec![0.0; c.len()], self.steps.clone());
            let logits: Vec<f64> = self.logits(&c).collect();
            for ((logit, [a, b]), mut row) in logits.iter().zip(&self.votes).zip(curvature.outer_iter_mut()) {
                let p = 1.0 / (1.0 + (-logit).exp());
                let pull = self.mu * SLOPE * ((a + b) * p - a);
                row.iter().zip(&mut slope).for_each(|(f, s)| *s += pull * f);
                row *= (self.mu * (a + b) * p * (1.0 - p)).sqrt() * SLOPE;
            }
            for (i, row) in normal.outer_iter().enumerate() {
                slope[i] += dot(&row.to_vec(), &c) - right[i];
            }
            let hessian = normal + &curvature.t().dot(&curvature);
            let step = solve(hessian.view(), 0.0, &slope)?;
            let mut share = 1.0;
            let next = loop {
                let next: Vec<f64> = c.iter().zip(&step).map(|(c, s)| c - share * s).collect();
                let found = self.value(normal, right, &next);
                if found <= value || share < 1e-3 {
                    value = found.min(value);
                    break next;
                }
                share *= 0.5;
            };
            let moved = step.iter().fold(0.0f64, |most, s| most.max(s.abs()));
            c = next;
            if moved < CONVERGED {
                break;
            }
        }
        Some(c)
    }
}

/// ln(1 + exp(x)) without overflow.
fn log1p_exp(x: f64) -> f64 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn the_minimum_has_no_slope() {
        let choices = Choices {
            steps: array![[1.0, 0.0], [0.5, -1.0], [-0.3, 0.8]],
            offsets: vec![0.1, -0.2, 0.0],
            votes: vec![[3.0, 1.0], [0.0, 5.0], [2.0, 2.0]],
            mu: 0.3,
        };
        let (normal, right) = (array![[2.0, 0.3], [0.3, 1.5]], vec![0.4, -0.2]);
        let c = choices.minimise(&normal, &right, vec![0.0, 0.0]).unwrap();
        for i in 0..2 {
            let moved = |by: f64| {
                let mut c = c.clone();
                c[i] += by;
                choices.value(&normal, &right, &c)
            };
            assert!((moved(1e-5) - moved(-1e-5)).abs() / 2e-5 < 1e-6);
        }
    }

    #[test]
    fn large_logits_do_not_overflow() {
        assert_eq!(log1p_exp(1000.0), 1000.0);
        assert_eq!(log1p_exp(-1000.0), 0.0);
        assert!((log1p_exp(0.0) - 2f64.ln()).abs() < 1e-15);
    }
}
