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

use std::f64::consts::FRAC_2_SQRT_PI;

/// Step of the trapezium rule in u = ln s.
const STEP: f64 = 1.25;
/// The step over 2 sqrt(pi).
const NORMAL: f64 = 0.25 * STEP * FRAC_2_SQRT_PI;
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

/// s of the m-th term.
fn scale(narrowest: f64, m: usize) -> f64 {
    0.5 / (narrowest * narrowest) * (-STEP * m as f64).exp()
}

/// The m-th term. The first stands for all narrower ones as well: of near-identical graphs, surfaces in four dimensions that lie close
/// together, each term sees exp(-STEP) of what the next wider one sees. (Of the single pair that a cell forms with itself, the
/// remainder takes back what is too much.)
fn term(kernel: Kernel, narrowest: f64, m: usize) -> Term {
    let s = scale(narrowest, m);
    let narrower = if m == 0 { 1.0 / (1.0 - (-STEP).exp()) } else { 1.0 };
    match kernel {
        Kernel::Gaussian { blur } => Term { c: 1.0, s: 0.5 / (blur * blur) },
        Kernel::Laplacian { blur } => {
            let v = s * blur * blur;
            Term { c: narrower * NORMAL / v.sqrt() * (-0.25 / v).exp(), s }
        }
        Kernel::Energy => Term { c: narrower * NORMAL / s.sqrt(), s },
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
    /// `count` terms, the first of standard deviation `narrowest`; the Gaussian kernel has one of its own.
    pub fn new(kernel: Kernel, narrowest: f64, count: usize) -> Self {
        let terms = (0..count).map(|m| term(kernel, narrowest, m)).collect();
        let tail = match kernel {
            // All that follow, a geometric series of c s.
            Kernel::Energy => NORMAL * scale(narrowest, count).sqrt() / (1.0 - (-0.5 * STEP).exp()),
            Kernel::Gaussian { .. } | Kernel::Laplacian { .. } => 0.0,
        };
        Self { kernel, terms, tail }
    }

    /// How many terms points within `diameter` take.
    pub fn count(kernel: Kernel, narrowest: f64, diameter: f64) -> usize {
        let terms = (0..).map(|m| term(kernel, narrowest, m));
        match kernel {
            Kernel::Gaussian { .. } => 1,
            // The weights rise to a maximum at s blur^2 = 1/2, then fall as exp(-1/(4 s blur^2)).
            Kernel::Laplacian { blur } => {
                terms.take_while(|t| t.c > SMALLEST || t.s * blur * blur > 0.5).count().max(1)
            }
            Kernel::Energy => {
                let widest = NEGLIGIBLE / (diameter * diameter);
                terms.take_while(|t| t.s > widest).count().max(1)
            }
        }
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
            let mixture = Mixture::new(kernel, 0.005, Mixture::count(kernel, 0.005, diameter));
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
