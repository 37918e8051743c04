//! The Lp formulas, cell by cell.
//!
//!   distance = root(sum w t(g(a) - g(r)) / cells),   the sum over cells and channels
//!
//! w: the weight, of the polar angles alone; g: the curve that both values go through; t: the power of their difference;
//! root: a square root or nothing. The formulas themselves stand in the documentation of [`crate::metric::lp`]. The fused
//! pass ([`super::pass`]) takes weights and roots from here and computes g and t in a form of its own, for all variants at once;
//! gradients ([`super::gradient`]) and losses ([`crate::fit::loss`]), which need slopes, take everything.
//!
//! Slopes where there is none: of |d| and cbrt(d^2) at d = 0, of cbrt(f) at f = 0 and of the root at 0 they count as 0.

use super::block::Plane;
use super::elementary::{abs_ln_ratio, cbrt, cbrt_of_square, inverse_cbrt};
use super::variant::{Formula, LpVariant};
use super::{EPSILON, POLAR};
use multiversion::multiversion;

/// What the weights of the cells at one (theta_i, theta_o) are made of.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Weights {
    cos_i: f64,
    cos_o: f64,
    sin_o: f64,
    /// c(theta_i, theta_o) of D7, D8 and D9: max(cos theta_i cos theta_o, epsilon).
    pub cosine: f64,
}

impl Weights {
    /// Of the polar angles number `i` and `o`.
    pub fn at(i: usize, o: usize) -> Self {
        let degrees = |index: usize| index as f64 * (90.0 / POLAR as f64);
        let (sin_o, cos_o) = degrees(o).to_radians().sin_cos();
        let cos_i = degrees(i).to_radians().cos();
        Self { cos_i, cos_o, sin_o, cosine: (cos_i * cos_o).max(EPSILON) }
    }

    /// w of a formula.
    pub fn of(&self, formula: Formula) -> f64 {
        let cbrt_of_square = |x: f64| (x * x).cbrt();
        match formula {
            Formula::D1 | Formula::D5 | Formula::D8 | Formula::D9 => 1.0,
            Formula::D2 => self.cos_i * self.cos_i,
            Formula::D3 => cbrt_of_square(self.cos_i),
            Formula::D4 => self.cos_o * self.sin_o,
            Formula::D7 => cbrt_of_square(self.cosine),
            Formula::D6 | Formula::Lab => self.cos_o * self.cos_i,
        }
    }
}

impl Formula {
    /// Whether a distance is the square root of its mean.
    pub(crate) fn is_rooted(self) -> bool {
        !matches!(self, Self::D5 | Self::D7 | Self::D8)
    }

    /// From the mean of the weighted terms to the distance.
    pub(crate) fn of_mean(self, mean: f64) -> f64 {
        if self.is_rooted() { mean.sqrt() } else { mean }
    }

    /// The slope of [`Formula::of_mean`] where it gives `distance`.
    pub(crate) fn root_slope(self, distance: f64) -> f64 {
        match self.is_rooted() {
            false => 1.0,
            true if distance > 0.0 => 0.5 / distance,
            true => 0.0,
        }
    }

    /// The power of the distance that is smooth where both sides agree.
    pub(crate) fn smooth_power(self) -> f64 {
        if self.is_rooted() { 2.0 } else { 1.0 }
    }
}

/// What is done to both values before they are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Curve {
    Identity,
    /// ln(f c + epsilon).
    Log,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Power {
    Square,
    Absolute,
    /// cbrt(d^2).
    Root,
}

/// Curve and power of one variant, with their slopes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CellFormula {
    cube_root: bool,
    curve: Curve,
    power: Power,
}

impl CellFormula {
    /// `None` for colour differences, which mix the channels.
    pub fn of(variant: LpVariant) -> Option<Self> {
        let (curve, power) = match variant.formula {
            Formula::D1 | Formula::D2 | Formula::D4 => (Curve::Identity, Power::Square),
            Formula::D5 => (Curve::Identity, Power::Absolute),
            Formula::D3 | Formula::D7 => (Curve::Identity, Power::Root),
            Formula::D8 => (Curve::Log, Power::Absolute),
            Formula::D9 => (Curve::Log, Power::Square),
            Formula::D6 | Formula::Lab => return None,
        };
        Some(Self { cube_root: variant.cube_root, curve, power })
    }

    /// The first half of g: f or its cube root. What a loss keeps of its reference.
    #[inline(always)]
    pub fn root(&self, f: f64) -> f64 {
        if self.cube_root { cbrt(f) } else { f }
    }

    /// d = g(a) - g(r), given r and a after [`CellFormula::root`], c being [`Weights::cosine`].
    #[inline(always)]
    pub fn difference(&self, r: f64, a: f64, c: f64) -> f64 {
        match self.curve {
            Curve::Identity => a - r,
            Curve::Log => abs_ln_ratio(a * c + EPSILON, r * c + EPSILON).copysign(a - r),
        }
    }

    /// dg/df at the value that [`CellFormula::root`] made `a` of; infinite slopes count as zero.
    #[inline(always)]
    pub fn curve_slope(&self, a: f64, c: f64) -> f64 {
        let inner = match self.cube_root {
            false => 1.0,
            true if a > 0.0 => 1.0 / (3.0 * a * a),
            true => 0.0,
        };
        match self.curve {
            Curve::Identity => inner,
            Curve::Log => inner * c / (a * c + EPSILON),
        }
    }

    /// t(d).
    #[inline(always)]
    pub fn term(&self, d: f64) -> f64 {
        match self.power {
            Power::Square => d * d,
            Power::Absolute => d.abs(),
            Power::Root => cbrt_of_square(d.abs()),
        }
    }

    /// dt/dd; 0 where it is infinite or jumps.
    #[inline(always)]
    pub fn term_slope(&self, d: f64) -> f64 {
        match self.power {
            Power::Square => 2.0 * d,
            Power::Absolute if d == 0.0 => 0.0,
            Power::Absolute => 1f64.copysign(d),
            Power::Root if d == 0.0 => 0.0,
            Power::Root => (2.0 / 3.0 * inverse_cbrt(d.abs())).copysign(d),
        }
    }

    /// Whether slopes are bounded, as a search for a minimum needs them: those of cube roots of differences grow without bound
    /// towards agreement.
    pub fn has_bounded_slopes(&self) -> bool {
        self.power != Power::Root
    }

    /// `slopes` = d t(g(a) - g(r))/da at every cell of a plane.
    pub(super) fn slopes(self, r: &Plane, a: &Plane, c: f64, slopes: &mut Plane) {
        plane_slopes(self, r, a, c, slopes);
    }
}

/// A formula of constants for each kind, so that no loop below has a branch.
#[multiversion(targets("x86_64+avx2"))]
fn plane_slopes(formula: CellFormula, r: &Plane, a: &Plane, c: f64, slopes: &mut Plane) {
    macro_rules! by_kind {
        ($($curve:ident $power:ident),*) => {
            match formula {
                $(
                    CellFormula { cube_root: false, curve: Curve::$curve, power: Power::$power } => {
                        slopes_of(CellFormula { cube_root: false, curve: Curve::$curve, power: Power::$power }, r, a, c, slopes)
                    }
                    CellFormula { cube_root: true, curve: Curve::$curve, power: Power::$power } => {
                        slopes_of(CellFormula { cube_root: true, curve: Curve::$curve, power: Power::$power }, r, a, c, slopes)
                    }
                )*
            }
        };
    }
    by_kind!(Identity Square, Identity Absolute, Identity Root, Log Square, Log Absolute, Log Root);
}

#[inline(always)]
fn slopes_of(formula: CellFormula, r: &Plane, a: &Plane, c: f64, slopes: &mut Plane) {
    for ((slope, &r), &a) in slopes.iter_mut().zip(r).zip(a) {
        let (r, a) = (formula.root(r), formula.root(a));
        *slope = formula.term_slope(formula.difference(r, a, c)) * formula.curve_slope(a, c);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_limits_of_differences() {
        for variant in LpVariant::every() {
            let Some(formula) = CellFormula::of(variant) else { continue };
            for (f, d) in [(0.3, 0.2), (2.0, -0.7), (0.01, 1.5)] {
                let (c, h) = (0.4, 1e-6 * f);
                let slope = formula.curve_slope(formula.root(f), c);
                let difference = formula.difference(formula.root(f - h), formula.root(f + h), c);
                let expected = difference / (2.0 * h);
                assert!((slope / expected - 1.0).abs() < 1e-7, "{variant} {f}: {slope} {expected}");
                let expected = (formula.term(d + 1e-6) - formula.term(d - 1e-6)) / 2e-6;
                assert!((formula.term_slope(d) / expected - 1.0).abs() < 1e-7, "{variant} {d}");
            }
            assert_eq!((formula.term(0.0), formula.term_slope(0.0)), (0.0, 0.0), "{variant}");
        }
    }
}
