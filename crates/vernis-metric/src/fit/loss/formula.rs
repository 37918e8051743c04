//! The terms of the Lp formulas as functions of one cell.

use crate::metric::lp::{Formula, LpVariant};

/// Keeps logarithms and the cosine weight away from zero, as in the metrics.
const EPSILON: f64 = 1e-3;

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

/// One variant, cell by cell: distance = root(sum w t(g(a) - g(r)) / cells).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CellFormula {
    formula: Formula,
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
        Some(Self { formula: variant.formula, cube_root: variant.cube_root, curve, power })
    }

    /// Weight of the cells at (theta_i, theta_o), degrees.
    pub fn weight(&self, i: usize, o: usize) -> f64 {
        let (sin_o, cos_o) = (o as f64).to_radians().sin_cos();
        let cos_i = (i as f64).to_radians().cos();
        match self.formula {
            Formula::D2 => cos_i * cos_i,
            Formula::D3 => (cos_i * cos_i).cbrt(),
            Formula::D4 => cos_o * sin_o,
            Formula::D7 => cosine(i, o).powi(2).cbrt(),
            _ => 1.0,
        }
    }

    /// g(f), c being the cosine of [`cosine`].
    pub fn curve(&self, f: f64, c: f64) -> f64 {
        let f = if self.cube_root { f.cbrt() } else { f };
        match self.curve {
            Curve::Identity => f,
            Curve::Log => (f * c + EPSILON).ln(),
        }
    }

    /// dg/df, given g(f) = `g`; infinite slopes count as zero.
    pub fn curve_slope(&self, f: f64, g: f64, c: f64) -> f64 {
        let root = if self.cube_root { f.cbrt() } else { f };
        let inner = if !self.cube_root {
            1.0
        } else if root > 0.0 {
            1.0 / (3.0 * root * root)
        } else {
            0.0
        };
        match self.curve {
            Curve::Identity => inner,
            Curve::Log => inner * c * (-g).exp(),
        }
    }

    /// t(d).
    pub fn term(&self, d: f64) -> f64 {
        match self.power {
            Power::Square => d * d,
            Power::Absolute => d.abs(),
            Power::Root => (d * d).cbrt(),
        }
    }

    /// dt/dd; 0 where it is infinite or jumps.
    pub fn term_slope(&self, d: f64) -> f64 {
        match self.power {
            Power::Square => 2.0 * d,
            Power::Absolute if d == 0.0 => 0.0,
            Power::Absolute => d.signum(),
            Power::Root if d == 0.0 => 0.0,
            Power::Root => 2.0 / (3.0 * d.cbrt()),
        }
    }

    /// Whether the slopes are of use to a gradient method: those of cube roots of differences grow without bound towards
    /// agreement.
    pub fn is_differentiable(&self) -> bool {
        self.power != Power::Root
    }

    /// From the mean of the terms to the distance.
    pub fn of_mean(&self, mean: f64) -> f64 {
        if self.is_rooted() { mean.sqrt() } else { mean }
    }

    pub fn is_rooted(&self) -> bool {
        !matches!(self.formula, Formula::D5 | Formula::D7 | Formula::D8)
    }
}

/// max(cos theta_i cos theta_o, epsilon) at whole degrees.
pub(super) fn cosine(i: usize, o: usize) -> f64 {
    ((i as f64).to_radians().cos() * (o as f64).to_radians().cos()).max(EPSILON)
}
