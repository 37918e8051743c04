//! Cube root and logarithm without branches or library calls, so that the compiler turns loops over them into
//! vector code.
//!
//!   cbrt(x) = x y^2,   |x|^(2/3) = |x| y   with y = x^(-1/3);       |ln(a/b)| = k ln 2 + 2 atanh((a' - b)/(a' + b)).
//!
//! Only additions, multiplications, one division and integer operations on the bits are used and none is fused, so
//! every instruction set gives the same bits. Relative errors stay below 1e-14 (tested against the standard library).
//! Cost: 22 floating-point operations for a root, 25 and a division for a logarithm.

/// x^(-1/3) for x >= 0; a large finite number at 0.
///
/// A third of the exponent and mantissa bits, read as one fixed-point logarithm, gives y with |1 - x y^3| <= 0.103;
/// the Taylor series of (1 - h)^(-1/3) about h = 1 - x y^3 = 0 corrects it, to degree 4 (error 1.5e-6) and then to
/// degree 2 (error 1e-16). The magic constant makes the largest |h| over an octave triple smallest.
#[inline(always)]
pub(super) fn inverse_cbrt(x: f64) -> f64 {
    const START: u64 = 0x553e_ead3_bab4_f000;
    const ONE_THIRD: u64 = 0x5555_5555; // of 2^32
    let y = f64::from_bits(START - (x.to_bits() >> 32) * ONE_THIRD);
    let residual = |y: f64| 1.0 - (x * y) * (y * y);
    let h = residual(y);
    let y = y + y * (h * ((1.0 / 3.0 + h * (2.0 / 9.0)) + (h * h) * (14.0 / 81.0 + h * (35.0 / 243.0))));
    let h = residual(y);
    y + y * (h * (1.0 / 3.0 + h * (2.0 / 9.0)))
}

/// Cube root of x >= 0; exactly 0 at 0.
#[inline(always)]
pub(super) fn cbrt(x: f64) -> f64 {
    let y = inverse_cbrt(x);
    x * y * y
}

/// cbrt(x^2) for x >= 0, without forming the square, which may underflow; exactly 0 at 0.
#[inline(always)]
pub(super) fn cbrt_of_square(x: f64) -> f64 {
    x * inverse_cbrt(x)
}

/// |ln(a/b)| for positive normal a and b; exactly 0 for a = b and exactly symmetric.
///
/// The larger is divided by the power of two, 2^k, that brings the ratio into about [0.66, 1.5]; the rest is
/// 2 atanh(s) = 2 s (1 + s^2/3 + s^4/5 + ...), |s| <= 0.2005, whose first omitted term is below 6e-16.
#[inline(always)]
pub(super) fn abs_ln_ratio(a: f64, b: f64) -> f64 {
    const HALF: u64 = 1 << 51;
    const TWO_POW_52: f64 = 4_503_599_627_370_496.0;
    let large = if a > b { a } else { b };
    let small = if a > b { b } else { a };
    let k = (large.to_bits() - small.to_bits() + HALF) >> 52;
    let scaled = f64::from_bits(large.to_bits() - (k << 52));
    // An integer below 2^52 in the mantissa of 2^52: the conversion that every vector unit has.
    let k = f64::from_bits(TWO_POW_52.to_bits() | k) - TWO_POW_52;
    let s = (scaled - small) / (scaled + small);
    let z = s * s;
    let w = z * z;
    let even = 1.0 / 3.0 + w * (1.0 / 7.0 + w * (1.0 / 11.0 + w * (1.0 / 15.0 + w * (1.0 / 19.0))));
    let odd = 1.0 / 5.0 + w * (1.0 / 9.0 + w * (1.0 / 13.0 + w * (1.0 / 17.0)));
    let series = z * (even + z * odd);
    k * std::f64::consts::LN_2 + 2.0 * (s + s * series)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every octave from 1e-12 (far below any BRDF) to 1e12, with uneven mantissas.
    fn samples() -> impl Iterator<Item = f64> {
        (0..200_000).map(|i| 1e-12 * (i as f64 * (24.0 * std::f64::consts::LN_10 / 200_000.0)).exp())
    }

    #[test]
    fn roots_agree_with_the_standard_library() {
        for x in samples().chain([f64::MIN_POSITIVE, 1e-300, 1e-38, 1.0, 8.0, 1e38, 1e300]) {
            assert!((cbrt(x) / x.cbrt() - 1.0).abs() < 1e-14, "{x}");
            let square = x.cbrt() * x.cbrt();
            assert!((cbrt_of_square(x) / square - 1.0).abs() < 1e-14, "{x}");
        }
        assert_eq!(cbrt(0.0), 0.0);
        assert_eq!(cbrt_of_square(0.0), 0.0);
    }

    #[test]
    fn logarithm_agrees_with_the_standard_library() {
        for x in samples() {
            for b in [1e-3, 0.7, 1.0, 1.5, 3e4] {
                let expected = (x / b).ln().abs();
                // Near 1 the rounding of the quotient alone moves the expected value by 1e-16.
                assert!((abs_ln_ratio(x, b) - expected).abs() <= 1e-14 * expected + 1.2e-16, "{x} {b}");
                assert_eq!(abs_ln_ratio(x, b), abs_ln_ratio(b, x));
            }
            assert_eq!(abs_ln_ratio(x, x), 0.0);
        }
    }

    #[test]
    fn logarithm_near_one_keeps_relative_accuracy() {
        for e in 1..50 {
            let d = 0.5f64.powi(e);
            let expected = d.ln_1p();
            assert!((abs_ln_ratio(1.0 + d, 1.0) / expected - 1.0).abs() < 1e-14, "2^-{e}");
        }
    }
}
