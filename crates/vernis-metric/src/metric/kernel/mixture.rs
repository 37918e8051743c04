//! Radial kernels as sums of Gaussians.
//!
//! With s = e^u sampled at steps of du, r the distance of two points:
//!
//!   energy     r            = sum_m c_m (1 - exp(-s_m r^2)) + tail r^2,   c = du e^(-u/2) / (2 sqrt(pi))
//!   laplacian  exp(-r/blur) = sum_m c_m exp(-s_m r^2),                    c = du e^(-v/2) exp(-e^(-v)/4) / (2 sqrt(pi)), v = u + 2 ln blur
//!   gaussian   exp(-r^2/(2 blur^2)): one term
//!
//! The first follows from Gamma(-1/2) = -2 sqrt(pi), the second is Bernstein's representation of exp(-sqrt(x)); the trapezium
//! rule in u errs by less than a thousandth at du = 1.25 (tested). Terms wider than the set of points act as r^2: they are
//! summed up in `tail`.
//!
//! Source: S. N. Bernstein, Acta Math. 52, 1929, doi:10.1007/BF02592679; G. Beylkin, L. Monzón, "Approximation by exponential
//! sums revisited", Appl. Comput. Harmon. Anal. 28(2), 2010, doi:10.1016/j.acha.2009.08.011.

use std::f64::consts::PI;

/// Step of the trapezium rule in u = ln s.
const STEP: f64 = 1.25;
/// Where s r^2 is smaller for every pair, 1 - exp(-s r^2) is taken for s r^2.
const NEGLIGIBLE: f64 = 0.01;
/// Weights below this fraction of the kernel's value are dropped.
const SMALLEST: f64 = 1e-12;

/// A kernel of the distance r between two points.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Kernel {
    /// -r, conditionally positive: the energy distance.
    Energy,
    /// exp(-r^2/(2 blur^2)).
    Gaussian {
        /// Standard deviation, in the unit of r.
        blur: f64,
    },
    /// exp(-r/blur).
    Laplacian {
        /// The distance at which the kernel has fallen to 1/e, in the unit of r.
        blur: f64,
    },
}

impl Kernel {
    /// k(0) - k(r): r itself for the energy.
    pub fn fall(self, r: f64) -> f64 {
        match self {
            Self::Energy => r,
            Self::Gaussian { blur } => -(-r * r / (2.0 * blur * blur)).exp_m1(),
            Self::Laplacian { blur } => -(-r / blur).exp_m1(),
        }
    }

    /// The derivative of [`Kernel::fall`].
    pub fn slope(self, r: f64) -> f64 {
        match self {
            Self::Energy => 1.0,
            Self::Gaussian { blur } => r / (blur * blur) * (-r * r / (2.0 * blur * blur)).exp(),
            Self::Laplacian { blur } => (-r / blur).exp() / blur,
        }
    }
}

/// c exp(-s r^2)
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Term {
    pub c: f64,
    pub s: f64,
}

/// A kernel on points that lie less than a diameter apart: the terms that a lattice resolves, and what they leave over.
#[derive(Debug, Clone)]
pub(super) struct Mixture {
    kernel: Kernel,
    /// No narrower than asked for.
    pub terms: Vec<Term>,
    /// Weight of -r^2.
    pub tail: f64,
}

impl Mixture {
    /// The terms exp(-s r^2) of standard deviation `narrowest` and wider, for points within `diameter`.
    pub fn new(kernel: Kernel, narrowest: f64, diameter: f64) -> Self {
        let normal = STEP / (2.0 * PI.sqrt());
        let finest = (0.5 / (narrowest * narrowest)).ln();
        // Scales are multiples of the step, so that nothing depends smoothly on the diameter by way of them.
        let last = (finest / STEP).floor() as i64;
        let scale = |m: i64| (STEP * m as f64).exp();
        let mut terms = Vec::new();
        let mut tail = 0.0;
        match kernel {
            Kernel::Gaussian { blur } => terms.push(Term { c: 1.0, s: 0.5 / (blur * blur) }),
            Kernel::Laplacian { blur } => {
                let weight = |s: f64| {
                    let v = s * blur * blur;
                    normal / v.sqrt() * (-0.25 / v).exp()
                };
                let all = (0..).map(|k| last - k).map(|m| Term { c: weight(scale(m)), s: scale(m) });
                // The weights rise to a maximum at s blur^2 = 1/2, then fall as exp(-1/(4 s blur^2)).
                terms.extend(all.take_while(|t| t.c > SMALLEST || t.s * blur * blur > 0.5));
            }
            Kernel::Energy => {
                let widest = NEGLIGIBLE / (diameter * diameter);
                let all = (0..).map(|k| last - k).map(|m| Term { c: normal / scale(m).sqrt(), s: scale(m) });
                terms.extend(all.take_while(|t| t.s > widest));
                // All that follow, a geometric series of c s.
                let next = scale(last - terms.len() as i64);
                tail = normal * next.sqrt() / (1.0 - (-0.5 * STEP).exp());
            }
        }
        Self { kernel, terms, tail }
    }

    /// What `terms` and the tail leave of k(0) - k(r), and its derivative.
    pub fn remainder(&self, terms: &[Term], r: f64) -> (f64, f64) {
        let mut value = self.kernel.fall(r) - self.tail * r * r;
        let mut slope = self.kernel.slope(r) - 2.0 * self.tail * r;
        for t in terms {
            let x = t.s * r * r;
            value += t.c * (-x).exp_m1();
            slope -= 2.0 * t.c * t.s * r * (-x).exp();
        }
        (value, slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_terms_and_the_remainder_are_the_kernel() {
        let diameter = 3.0;
        for kernel in [Kernel::Energy, Kernel::Laplacian { blur: 0.05 }, Kernel::Gaussian { blur: 0.05 }] {
            let mixture = Mixture::new(kernel, 0.005, diameter);
            let far = mixture.remainder(&mixture.terms, 0.05).0;
            for r in [0.05, 0.1, 0.7, 2.9] {
                // Beyond the narrowest term only a constant is left.
                let left = mixture.remainder(&mixture.terms, r).0;
                let scale = kernel.fall(r);
                assert!((left - far).abs() < 1e-3 * scale, "{kernel:?} at {r}: {left} {far}");
            }
            assert_eq!(mixture.remainder(&mixture.terms, 0.0).0, 0.0);
            for r in [1e-4, 0.003, 0.01] {
                let h = 1e-6 * r;
                let difference = (mixture.remainder(&mixture.terms, r + h).0
                    - mixture.remainder(&mixture.terms, r - h).0)
                    / (2.0 * h);
                assert!(
                    (mixture.remainder(&mixture.terms, r).1 - difference).abs() < 1e-6 * (1.0 + difference.abs()),
                    "{kernel:?}"
                );
            }
        }
    }
}
