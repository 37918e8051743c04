//! Dual numbers: a value and its derivatives with respect to N variables, carried through a formula (forward mode).
//!
//!   (a, a') + (b, b') = (a + b, a' + b'),  (a, a') (b, b') = (a b, a' b + a b'),  g((a, a')) = (g(a), g'(a) a')
//!
//! [`Scalar`] is what a formula may do with its numbers; written over it, one formula serves plain `f64` (with the same
//! operations in the same order) and [`Dual`]. At a kink (`abs`, `max`, `min`) the derivative is that of the branch that
//! gives the value, and at the end of a domain (the powers and the root of zero) the one-sided one. Where a derivative is infinite
//! (the root, the logarithm and the reciprocal of zero) it counts as zero: it says nothing of the way to go, and times the zero
//! of another variable it would be NaN.
//! Source: Griewank & Walther 2008, *Evaluating Derivatives*, chapter 3, doi:10.1137/1.9780898717761.
//! Cost: of a formula with N variables, about 1 + N times that of the value, in arrays that vectorise.

use super::erf::erf;
use std::f64::consts::FRAC_2_SQRT_PI;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A real number as formulas need it.
pub trait Scalar:
    Copy
    + From<f64>
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
{
    /// The number without its derivatives.
    fn value(self) -> f64;
    /// e to the power `self`.
    fn exp(self) -> Self;
    /// The natural logarithm.
    fn ln(self) -> Self;
    /// The square root; `self` is not negative.
    fn sqrt(self) -> Self;
    /// The error function.
    fn erf(self) -> Self;
    /// `self` to an integer power.
    fn powi(self, exponent: i32) -> Self;
    /// `self` to the power `exponent`; `self` is not negative.
    fn powf(self, exponent: Self) -> Self;

    /// The absolute value.
    fn abs(self) -> Self {
        if self.value() < 0.0 { -self } else { self }
    }

    /// The larger of two numbers; `self` where they are equal.
    fn max(self, other: Self) -> Self {
        if self.value() >= other.value() { self } else { other }
    }

    /// The smaller of two numbers; `self` where they are equal.
    fn min(self, other: Self) -> Self {
        if self.value() <= other.value() { self } else { other }
    }
}

impl Scalar for f64 {
    fn value(self) -> f64 {
        self
    }

    fn exp(self) -> Self {
        f64::exp(self)
    }

    fn ln(self) -> Self {
        f64::ln(self)
    }

    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }

    fn erf(self) -> Self {
        erf(self)
    }

    fn powi(self, exponent: i32) -> Self {
        f64::powi(self, exponent)
    }

    fn powf(self, exponent: Self) -> Self {
        f64::powf(self, exponent)
    }
}

/// A value and its derivatives with respect to N variables.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dual<const N: usize> {
    /// The number without its derivatives.
    pub value: f64,
    /// One derivative a variable, in units of the value per unit of the variable.
    pub derivatives: [f64; N],
}

impl<const N: usize> Dual<N> {
    /// Variable number `slot`, at `value`.
    pub fn variable(value: f64, slot: usize) -> Self {
        Self { value, derivatives: std::array::from_fn(|k| if k == slot { 1.0 } else { 0.0 }) }
    }

    /// g(self), given g and its slope at the value.
    fn chain(self, value: f64, slope: f64) -> Self {
        Self { value, derivatives: self.derivatives.map(|d| slope * d) }
    }

    /// The same for a slope that may be infinite.
    fn chain_at_edge(self, value: f64, slope: f64) -> Self {
        self.chain(value, zero_if_infinite(slope))
    }

    /// The value together with `a` times the derivatives of `self` plus `b` times those of `other`.
    fn combine(self, other: Self, value: f64, a: f64, b: f64) -> Self {
        let derivatives = std::array::from_fn(|k| a * self.derivatives[k] + b * other.derivatives[k]);
        Self { value, derivatives }
    }
}

fn zero_if_infinite(slope: f64) -> f64 {
    if slope.is_infinite() { 0.0 } else { slope }
}

impl<const N: usize> Scalar for Dual<N> {
    fn value(self) -> f64 {
        self.value
    }

    fn exp(self) -> Self {
        let e = self.value.exp();
        self.chain_at_edge(e, e)
    }

    fn ln(self) -> Self {
        self.chain_at_edge(self.value.ln(), 1.0 / self.value)
    }

    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain_at_edge(root, 0.5 / root)
    }

    fn erf(self) -> Self {
        self.chain(erf(self.value), FRAC_2_SQRT_PI * (-self.value * self.value).exp())
    }

    fn powi(self, exponent: i32) -> Self {
        // The power of exponent 0 is 1 everywhere: 0 x^-1 would be NaN at zero.
        let slope = if exponent == 0 { 0.0 } else { f64::from(exponent) * self.value.powi(exponent - 1) };
        self.chain_at_edge(self.value.powi(exponent), slope)
    }

    fn powf(self, exponent: Self) -> Self {
        let power = self.value.powf(exponent.value);
        let (a, b) = if self.value > 0.0 {
            (exponent.value * power / self.value, power * self.value.ln())
        } else {
            // d/dx x^e at zero: 1 for e = 1, 0 for larger e and for e = 0, infinite elsewhere. d/de: 0 for e > 0, else infinite.
            (if exponent.value == 1.0 { 1.0 } else { 0.0 }, 0.0)
        };
        self.combine(exponent, power, zero_if_infinite(a), zero_if_infinite(b))
    }
}

impl<const N: usize> From<f64> for Dual<N> {
    fn from(value: f64) -> Self {
        Self { value, derivatives: [0.0; N] }
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.combine(other, self.value + other.value, 1.0, 1.0)
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.combine(other, self.value - other.value, 1.0, -1.0)
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.combine(other, self.value * other.value, other.value, self.value)
    }
}

impl<const N: usize> Div for Dual<N> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let quotient = self.value / other.value;
        self.combine(other, quotient, zero_if_infinite(1.0 / other.value), zero_if_infinite(-quotient / other.value))
    }
}

impl<const N: usize> Add<f64> for Dual<N> {
    type Output = Self;
    fn add(self, other: f64) -> Self {
        Self { value: self.value + other, ..self }
    }
}

impl<const N: usize> Sub<f64> for Dual<N> {
    type Output = Self;
    fn sub(self, other: f64) -> Self {
        Self { value: self.value - other, ..self }
    }
}

impl<const N: usize> Mul<f64> for Dual<N> {
    type Output = Self;
    fn mul(self, other: f64) -> Self {
        self.chain(self.value * other, other)
    }
}

impl<const N: usize> Div<f64> for Dual<N> {
    type Output = Self;
    fn div(self, other: f64) -> Self {
        self.chain(self.value / other, 1.0 / other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every operation once, in two variables.
    fn formula<S: Scalar>(x: S, y: S) -> S {
        let a = (x * y + 0.3).exp() / (y.sqrt() - 4.0) * 2.0;
        let b = (x / 3.0).powf(y) + y.ln() - (-x).powi(3) + (x - y).erf();
        (a - b).abs() + x.max(y) * x.min(S::from(0.9))
    }

    #[test]
    fn derivatives_are_the_limits_of_differences() {
        for (x, y) in [(0.7, 1.3), (1.9, 0.4), (0.05, 2.5)] {
            let dual = formula(Dual::<2>::variable(x, 0), Dual::variable(y, 1));
            assert_eq!(dual.value, formula(x, y));
            let h = 1e-6;
            let dx = (formula(x + h, y) - formula(x - h, y)) / (2.0 * h);
            let dy = (formula(x, y + h) - formula(x, y - h)) / (2.0 * h);
            for (found, expected) in dual.derivatives.into_iter().zip([dx, dy]) {
                // Third derivatives of order 100 times h^2, and 1e-16/h from rounding.
                assert!((found - expected).abs() < 1e-8 * (1.0 + expected.abs()), "{found} {expected}");
            }
        }
    }

    /// One-sided derivatives at the ends of domains and at kinks, by hand; a second variable that takes no part stays at zero.
    #[test]
    fn derivatives_at_edges_are_the_one_sided_ones() {
        type Function = fn(Dual<2>) -> Dual<2>;
        let inf = f64::INFINITY;
        let cases: [(&str, Function, f64, f64, f64); 34] = [
            ("x^0 at 0", |x| x.powi(0), 0.0, 1.0, 0.0),
            ("x^0 at -2", |x| x.powi(0), -2.0, 1.0, 0.0),
            ("x^1 at 0", |x| x.powi(1), 0.0, 0.0, 1.0),
            ("x^2 at 0", |x| x.powi(2), 0.0, 0.0, 0.0),
            ("x^3 at -2", |x| x.powi(3), -2.0, -8.0, 12.0),
            ("x^-1 at 0", |x| x.powi(-1), 0.0, inf, 0.0),
            ("x^-2 at 0", |x| x.powi(-2), 0.0, inf, 0.0),
            ("x^-1 at -2", |x| x.powi(-1), -2.0, -0.5, -0.25),
            ("x^0. at 0", |x| x.powf(0.0.into()), 0.0, 1.0, 0.0),
            ("x^.5 at 0", |x| x.powf(0.5.into()), 0.0, 0.0, 0.0),
            ("x^1. at 0", |x| x.powf(1.0.into()), 0.0, 0.0, 1.0),
            ("x^1.5 at 0", |x| x.powf(1.5.into()), 0.0, 0.0, 0.0),
            ("x^-.5 at 0", |x| x.powf((-0.5).into()), 0.0, inf, 0.0),
            ("x^0. at 2", |x| x.powf(0.0.into()), 2.0, 1.0, 0.0),
            ("x^1. at 2", |x| x.powf(1.0.into()), 2.0, 2.0, 1.0),
            ("0^x at 2", |x| Dual::from(0.0).powf(x), 2.0, 0.0, 0.0),
            ("0^x at 1", |x| Dual::from(0.0).powf(x), 1.0, 0.0, 0.0),
            ("0^x at 0", |x| Dual::from(0.0).powf(x), 0.0, 1.0, 0.0),
            ("1^x at 0", |x| Dual::from(1.0).powf(x), 0.0, 1.0, 0.0),
            ("root at 0", |x| x.sqrt(), 0.0, 0.0, 0.0),
            ("ln at 0", |x| x.ln(), 0.0, -inf, 0.0),
            ("ln at 1", |x| x.ln(), 1.0, 0.0, 1.0),
            ("exp at 0", |x| x.exp(), 0.0, 1.0, 1.0),
            ("exp at -800", |x| x.exp(), -800.0, 0.0, 0.0),
            ("exp at 800", |x| x.exp(), 800.0, inf, 0.0),
            ("erf at 0", |x| x.erf(), 0.0, 0.0, FRAC_2_SQRT_PI),
            ("erf at 40", |x| x.erf(), 40.0, 1.0, 0.0),
            ("1/x at 0", |x| Dual::from(1.0) / x, 0.0, inf, 0.0),
            ("0/x at 2", |x| Dual::from(0.0) / x, 2.0, 0.0, 0.0),
            // At a kink, the branch that gives the value: here `self`.
            ("|x| at 0", |x| x.abs(), 0.0, 0.0, 1.0),
            ("max(x, 0) at 0", |x| x.max(0.0.into()), 0.0, 0.0, 1.0),
            ("max(0, x) at 0", |x| Dual::from(0.0).max(x), 0.0, 0.0, 0.0),
            ("min(x, 0) at 0", |x| x.min(0.0.into()), 0.0, 0.0, 1.0),
            ("min(0, x) at 0", |x| Dual::from(0.0).min(x), 0.0, 0.0, 0.0),
        ];
        for (what, function, x, value, slope) in cases {
            let found = function(Dual::variable(x, 0));
            // Our error function is right to 1e-14.
            assert!(found.value == value || (found.value - value).abs() < 1e-14, "{what}: {}", found.value);
            assert_eq!(found.derivatives, [slope, 0.0], "{what}");
        }
        // Base and exponent at once: a lobe (1 - cos)^n at its edge, with n = 1.
        let both = Dual::<2>::variable(0.0, 0).powf(Dual::variable(1.0, 1));
        assert_eq!((both.value, both.derivatives), (0.0, [1.0, 0.0]));
    }

    /// Where a one-sided derivative is finite, it is the limit of one-sided differences.
    #[test]
    fn one_sided_derivatives_are_limits_of_differences() {
        type Of<S> = fn(S) -> S;
        let functions: [(Of<f64>, Of<Dual<1>>, f64); 6] = [
            (|x| Scalar::powi(x, 0), |x| x.powi(0), 0.0),
            (|x| Scalar::powi(x, 1), |x| x.powi(1), 0.0),
            (|x| Scalar::powi(x, 2), |x| x.powi(2), 0.0),
            (|x| Scalar::powf(x, 1.0), |x| x.powf(1.0.into()), 0.0),
            (|x| Scalar::powf(x, 2.5), |x| x.powf(2.5.into()), 0.0),
            (|x| Scalar::max(x, 0.0), |x| x.max(0.0.into()), 0.0),
        ];
        for (k, (plain, dual, x)) in functions.into_iter().enumerate() {
            let h = 1e-7;
            let expected = (plain(x + h) - plain(x)) / h;
            let found = dual(Dual::variable(x, 0)).derivatives[0];
            assert!((found - expected).abs() < 1e-6, "{k}: {found} {expected}");
        }
    }
}
