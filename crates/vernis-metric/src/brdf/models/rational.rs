//! Rational functions of two angles over orthogonal polynomials.
//!
//! f = max(P/Q, 0), P = sum over i < NP of p_i b_i(x, y), Q = 1 + sum over 1 <= j < NQ of q_j b_j(x, y)
//! x = 4 theta_h/pi - 1, y = 4 theta_d/pi - 1
//! b_i(x, y) = B_(k-r)(x) B_r(y), i = k (k+1)/2 + r, 0 <= r <= k: by total degree k, powers of x first
//!
//! B: Chebyshev's polynomials of the first kind, or Legendre's; theta_h, theta_d: half and difference angle, radians;
//! p_i (1/sr) and q_j (dimensionless) per channel. Reciprocal. Nothing bounds the energy, and Q may vanish outside the data
//! of a fit: values are clamped to 0..1e9.
//! Source: Pacanowski et al. 2012, eqs. 2 and 3, doi:10.1109/TVCG.2012.73. The study made its rational candidates with the
//! ALTA library and does not say over which angles; here they are the library's two-dimensional ones of its MERL examples
//! (`RUSIN_TH_TD`), in its order of the basis. Difference: q_0 is 1, which fixes the common factor of P and Q.
//! Cost: two arc tangents and 3 (NP + NQ) multiplications.

use super::{AnalyticBrdf, DifferentiableBrdf, ModelError, Parameter, check};
use crate::math::{Rgb, Vec3};
use std::borrow::Cow;
use std::f64::consts::FRAC_PI_4;
use std::sync::Arc;

/// Polynomials of one variable that are orthogonal on -1..1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Basis {
    /// Chebyshev's polynomials of the first kind.
    Chebyshev,
    /// Legendre's polynomials.
    Legendre,
}

/// Degrees 0 to 19 make 210 products of two variables.
const DEGREES: usize = 20;
const LARGEST_COUNT: usize = DEGREES * (DEGREES + 1) / 2;
const STANDARD_COUNTS: (usize, usize) = (10, 10);
const LARGEST_VALUE: f64 = 1e9;

impl Basis {
    fn id(self) -> &'static str {
        match self {
            Self::Chebyshev => "rational-chebyshev",
            Self::Legendre => "rational-legendre",
        }
    }

    /// The polynomials of degree 0 to 19 at `x`, by their three-term recurrences.
    fn polynomials(self, x: f64) -> [f64; DEGREES] {
        let mut b = [1.0; DEGREES];
        b[1] = x;
        for k in 2..DEGREES {
            let n = k as f64;
            b[k] = match self {
                Self::Chebyshev => 2.0 * x * b[k - 1] - b[k - 2],
                Self::Legendre => ((2.0 * n - 1.0) * x * b[k - 1] - (n - 1.0) * b[k - 2]) / n,
            };
        }
        b
    }
}

/// Basis and numbers of coefficients: what an identifier such as `rational-legendre-20-15` says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Form {
    basis: Basis,
    numerator: usize,
    denominator: usize,
}

impl Form {
    /// The size meant when none is given.
    pub(super) fn standard(basis: Basis) -> Self {
        Self { basis, numerator: STANDARD_COUNTS.0, denominator: STANDARD_COUNTS.1 }
    }

    /// The form of `BASIS-NP-NQ`, both counts 1 to 210.
    pub(super) fn parse(id: &str) -> Option<Self> {
        let parse = |basis: Basis| {
            let (np, nq) = id.strip_prefix(basis.id())?.strip_prefix('-')?.split_once('-')?;
            let count = |text: &str| text.parse().ok().filter(|n| (1..=LARGEST_COUNT).contains(n));
            Some(Self { basis, numerator: count(np)?, denominator: count(nq)? })
        };
        [Basis::Chebyshev, Basis::Legendre].into_iter().find_map(parse)
    }

    fn id(self) -> String {
        match (self.numerator, self.denominator) {
            STANDARD_COUNTS => self.basis.id().to_owned(),
            (np, nq) => format!("{}-{np}-{nq}", self.basis.id()),
        }
    }

    pub(super) fn schema(self) -> Vec<Parameter> {
        let mut all = Vec::new();
        for (letter, unit, range) in [("p", "1/sr", 0..self.numerator), ("q", "1", 1..self.denominator)] {
            for k in range {
                let start = if letter == "p" && k == 0 { 0.1 } else { 0.0 };
                all.extend(["r", "g", "b"].map(|c| Parameter {
                    name: Cow::Owned(format!("{letter}{k}.{c}")),
                    unit,
                    bounds: (-1e12, 1e12),
                    start,
                }));
            }
        }
        all
    }

    /// The checked function of a parameter vector of the schema's length.
    pub(super) fn shared(self, parameters: &[f64]) -> Result<Arc<dyn AnalyticBrdf>, ModelError> {
        let (p, q) = parameters.as_chunks::<3>().0.split_at(self.numerator);
        Ok(Arc::new(Rational::new(self.basis, p.to_vec(), q.to_vec())?))
    }
}

/// P/Q with coefficients `p` (p_0 first) and `q` (q_1 first), one colour each.
#[derive(Debug, Clone, PartialEq)]
pub struct Rational {
    id: String,
    form: Form,
    p: Vec<Rgb>,
    q: Vec<Rgb>,
}

impl Rational {
    /// At most 210 coefficients of P (at least one) and 209 of Q, all finite.
    pub fn new(basis: Basis, p: Vec<Rgb>, q: Vec<Rgb>) -> Result<Self, ModelError> {
        let form = Form { basis, numerator: p.len(), denominator: q.len() + 1 };
        let allowed = 1..=LARGEST_COUNT;
        if !allowed.contains(&form.numerator) || !allowed.contains(&form.denominator) {
            return Err(ModelError::UnknownModel { found: form.id() });
        }
        let rational = Self { id: form.id(), form, p, q };
        check(&rational.id, &rational.schema(), &rational.parameters())?;
        Ok(rational)
    }

    /// Calls `term` with each index and the value of its basis function, up to the larger number of coefficients.
    fn for_each_basis(&self, wi: Vec3, wo: Vec3, mut term: impl FnMut(usize, f64)) {
        let (sum, difference) = (wi + wo, wi - wo);
        let theta_h = sum.x.hypot(sum.y).atan2(sum.z);
        let theta_d = difference.length().atan2(sum.length());
        let [bx, by] = [theta_h, theta_d].map(|a| self.form.basis.polynomials(a / FRAC_PI_4 - 1.0));
        let count = self.form.numerator.max(self.form.denominator);
        let (mut k, mut r) = (0, 0);
        for index in 0..count {
            term(index, bx[k - r] * by[r]);
            (k, r) = if r == k { (k + 1, 0) } else { (k, r + 1) };
        }
    }

    /// P and Q.
    fn fraction(&self, wi: Vec3, wo: Vec3) -> (Rgb, Rgb) {
        let (mut p, mut q) = ([0.0; 3], [1.0; 3]);
        self.for_each_basis(wi, wo, |k, b| {
            for c in 0..3 {
                p[c] += self.p.get(k).map_or(0.0, |x| x[c] * b);
                q[c] += if k > 0 { self.q.get(k - 1).map_or(0.0, |x| x[c] * b) } else { 0.0 };
            }
        });
        (p, q)
    }
}

/// P/Q, or as the error the end of the range of values at which it is cut off.
fn quotient(p: f64, q: f64) -> Result<f64, f64> {
    let value = p / q;
    match value {
        v if (0.0..=LARGEST_VALUE).contains(&v) => Ok(v),
        v if v > LARGEST_VALUE => Err(LARGEST_VALUE),
        _ => Err(0.0),
    }
}

impl AnalyticBrdf for Rational {
    fn model(&self) -> &str {
        &self.id
    }

    fn schema(&self) -> Vec<Parameter> {
        self.form.schema()
    }

    fn parameters(&self) -> Vec<f64> {
        self.p.iter().chain(&self.q).flatten().copied().collect()
    }

    fn value(&self, wi: Vec3, wo: Vec3) -> Rgb {
        let (p, q) = self.fraction(wi, wo);
        std::array::from_fn(|c| quotient(p[c], q[c]).unwrap_or_else(|clamped| clamped))
    }

    fn as_differentiable(&self) -> Option<&dyn DifferentiableBrdf> {
        Some(self)
    }
}

impl DifferentiableBrdf for Rational {
    fn value_and_gradient(&self, wi: Vec3, wo: Vec3, d: &mut [Rgb]) -> Rgb {
        let (p, q) = self.fraction(wi, wo);
        let value: [Result<f64, f64>; 3] = std::array::from_fn(|c| quotient(p[c], q[c]));
        d.fill([0.0; 3]);
        let numerators = self.form.numerator;
        self.for_each_basis(wi, wo, |k, b| {
            for c in 0..3 {
                let Ok(value) = value[c] else { continue };
                if k < numerators {
                    d[3 * k + c][c] = b / q[c];
                }
                if (1..self.form.denominator).contains(&k) {
                    d[3 * (numerators + k - 1) + c][c] = -value * b / q[c];
                }
            }
        });
        value.map(|v| v.unwrap_or_else(|clamped| clamped))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::coordinates::{HalfDifference, half_difference_directions};

    /// T_n(cos a) = cos(n a); P_2 = (3 x^2 - 1)/2, P_3 = (5 x^3 - 3 x)/2.
    #[test]
    fn polynomials_have_their_closed_forms() {
        for x in [-0.9f64, 0.1, 0.7, 1.0] {
            let t = Basis::Chebyshev.polynomials(x);
            let p = Basis::Legendre.polynomials(x);
            for (n, t) in t.iter().enumerate() {
                assert!((t - (n as f64 * x.acos()).cos()).abs() < 1e-12);
            }
            assert!((p[2] - (1.5 * x * x - 0.5)).abs() < 1e-15 && (p[3] - (2.5 * x * x - 1.5) * x).abs() < 1e-15);
        }
    }

    /// With theta_h = 60 and theta_d = 30 degrees, x = 1/3 and y = -1/3; the order is 1, x, y, x^2...
    #[test]
    fn a_function_by_hand() {
        let angles = HalfDifference { theta_h: 60f64.to_radians(), theta_d: 30f64.to_radians(), phi_d: 1.5 };
        let (wi, wo) = half_difference_directions(angles);
        let p = vec![[2.0, 1.0, -1.0], [3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 0.0]];
        let model = Rational::new(Basis::Legendre, p, vec![[1.5, 0.0, 0.0]]).expect("finite");
        let [r, g, b] = model.value(wi, wo);
        assert!((r - 3.0 / 1.5).abs() < 1e-12 && g.abs() < 1e-12 && b == 0.0, "{r} {g} {b}");
        assert_eq!(model.model(), "rational-legendre-4-2");
        // A pole is no value.
        let pole = Rational::new(Basis::Legendre, vec![[1.0; 3]], vec![[-3.0 + 1e-13; 3]]).expect("finite");
        assert!(pole.value(wi, wo).iter().all(|v| (0.0..=LARGEST_VALUE).contains(v)));
    }

    #[test]
    fn an_identifier_says_the_size() {
        for id in ["rational-chebyshev", "rational-legendre-20-15", "rational-chebyshev-1-1"] {
            let schema = crate::brdf::models::schema(id).expect("a form");
            let p: Vec<f64> = schema.iter().map(|p| p.start).collect();
            assert_eq!(crate::brdf::models::build(id, &p).expect("valid").model(), id);
        }
        for id in ["rational-chebyshev-0-5", "rational-legendre-211-1", "rational-legendre-5"] {
            assert_eq!(Form::parse(id), None, "{id}");
        }
        assert!(Rational::new(Basis::Legendre, vec![], vec![]).is_err());
    }
}
