//! Linear least squares: min |A x - y|^2.
//!
//! | problem | by | where |
//! | --- | --- | --- |
//! | x free, A column by column | orthogonal projection | [`Span`] |
//! | x >= 0 | an active set of columns, each set by projection | [`nonnegative_residual`] |
//! | low <= x <= high, A^T A and A^T y at hand | coordinate descent | [`within_bounds`] |
//!
//! The last two stay apart: signs decide there whether inequalities can be met at all, which takes the exact active set;
//! bounds on a few unknowns of thousands of rows need only the normal equations and no set. One straight line through points
//! (the logistic curve, the spread of opinions) has a formula of its own and needs none of this; ridge regression goes by
//! [`super::cholesky`].

mod bounded;
mod nonnegative;
mod span;

pub use bounded::within_bounds;
pub use nonnegative::nonnegative_residual;
pub use span::Span;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
