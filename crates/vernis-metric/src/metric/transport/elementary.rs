//! Exponential and logarithm without branches or library calls, so that the compiler turns loops over them into
//! vector code.
//!
//!   exp(x) = 2^k p(x - k ln 2),   k = round(x/ln 2),  p the Taylor polynomial of degree 13 (|x - k ln 2| <= 0.347)
//!   ln(x)  = k ln 2 + 2 atanh((m - 1)/(m + 1)),   x = 2^k m,  sqrt(1/2) <= m < sqrt(2)
//!
//! `FUSED` says whether the code is compiled for a processor that multiplies and adds in one instruction: without one,
//! `f64::mul_add` is a slow library call. Relative error of `exp` and absolute error of `ln`: a few 1e-16 (tested).

/// The number of f64 that one step of the vector loops treats: one AVX-512 register, two of AVX2.
pub(super) const LANES: usize = 8;

/// [`LANES`] neighbouring value nodes.
pub(super) type Lanes = [f64; LANES];

/// Below this argument [`exp`] stays at exp(-700), about 1e-304, instead of falling to denormal numbers.
const SMALLEST_ARGUMENT: f64 = -700.0;

/// [`exp`] takes no larger argument.
pub(super) const LARGEST_ARGUMENT: f64 = 700.0;

/// a b + c.
#[inline(always)]
pub(super) fn fma<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// The larger of two numbers that are not NaN, in one instruction.
#[inline(always)]
pub(super) fn max(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// The smaller of two numbers, as [`max`].
#[inline(always)]
pub(super) fn min(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The least and the largest of the valid values (of all where `valid` is `None`), which are no NaN; infinity and minus infinity where
/// there is none.
#[multiversion::multiversion(targets("x86_64+avx2"))]
pub(super) fn range_of(values: &[f64], valid: Option<&[bool]>) -> (f64, f64) {
    let (mut least, mut most) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
    let mut take = |entry: &Lanes| {
        for lane in 0..LANES {
            least[lane] = min(entry[lane], least[lane]);
            most[lane] = max(entry[lane], most[lane]);
        }
    };
    match valid {
        None => {
            let (entries, rest) = values.as_chunks();
            entries.iter().for_each(&mut take);
            rest.iter().for_each(|&value| take(&[value; LANES]));
        }
        Some(valid) => {
            values.iter().zip(valid).filter(|&(_, &valid)| valid).for_each(|(&value, _)| take(&[value; LANES]));
        }
    }
    (least.into_iter().fold(f64::INFINITY, min), most.into_iter().fold(f64::NEG_INFINITY, max))
}

/// exp(x) for x <= 700; x below -700, infinite too, gives exp(-700).
#[inline(always)]
pub(super) fn exp<const FUSED: bool>(x: f64) -> f64 {
    /// Added to a number below 2^51, it leaves the nearest integer in the lowest bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    const LN_2_HIGH: f64 = 0.693_147_180_369_123_8;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    const EXPONENT_BIAS: u64 = 1023;
    let x = max(x, SMALLEST_ARGUMENT);
    let rounded = fma::<FUSED>(x, std::f64::consts::LOG2_E, ROUND);
    let k = rounded - ROUND;
    let r = fma::<FUSED>(k, -LN_2_LOW, fma::<FUSED>(k, -LN_2_HIGH, x));
    // Four powers at a time: one chain of thirteen multiplications would take longer than all else around it.
    let r2 = r * r;
    let r4 = r2 * r2;
    let mut p = fma::<FUSED>(TAYLOR[13], r, TAYLOR[12]);
    for quarter in [8, 4, 0] {
        let low = fma::<FUSED>(TAYLOR[quarter + 1], r, TAYLOR[quarter]);
        let high = fma::<FUSED>(TAYLOR[quarter + 3], r, TAYLOR[quarter + 2]);
        p = fma::<FUSED>(p, r4, fma::<FUSED>(high, r2, low));
    }
    p * f64::from_bits(rounded.to_bits().wrapping_add(EXPONENT_BIAS) << 52)
}

/// Whether code for this processor's best instruction set takes [`fma`] in one instruction.
#[cfg(test)]
#[multiversion::multiversion(targets("x86_64+avx2+fma"))]
pub(super) fn is_fused() -> bool {
    multiversion::target::target_cfg_f!(target_feature = "fma")
}

/// 1/0!, 1/1! ... 1/13!.
const TAYLOR: [f64; 14] = {
    let mut coefficients = [1.0; 14];
    let mut n = 1;
    while n < 14 {
        coefficients[n] = coefficients[n - 1] / n as f64;
        n += 1;
    }
    coefficients
};

/// ln(x) for positive normal x.
#[inline(always)]
pub(super) fn ln<const FUSED: bool>(x: f64) -> f64 {
    const SQRT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    const BIAS: u64 = 1023 << 52;
    const TWO_POW_52: f64 = 4_503_599_627_370_496.0;
    let bits = x.to_bits();
    let biased = (bits.wrapping_add(BIAS) - SQRT_HALF) >> 52;
    let m = f64::from_bits(bits.wrapping_add(BIAS).wrapping_sub(biased << 52));
    // An integer below 2^52 in the mantissa of 2^52: the conversion that every vector unit has.
    let k = f64::from_bits(TWO_POW_52.to_bits() | biased) - (TWO_POW_52 + 1023.0);
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let mut series = 1.0 / 21.0;
    for odd in [19.0, 17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0] {
        series = fma::<FUSED>(series, z, 1.0 / odd);
    }
    fma::<FUSED>(k, std::f64::consts::LN_2, 2.0 * fma::<FUSED>(s * z, series, s))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_agrees_with_the_standard_library() {
        for i in 0..200_000 {
            let x = -699.9 + 7e-3 * f64::from(i);
            let (fused, plain) = (exp::<true>(x), exp::<false>(x));
            assert!((fused / x.exp() - 1.0).abs() < 1e-15, "{x}");
            assert!((plain / x.exp() - 1.0).abs() < 1e-15, "{x}");
        }
        assert_eq!(exp::<true>(0.0), 1.0);
        assert_eq!(exp::<true>(f64::NEG_INFINITY), exp::<true>(-700.0));
    }

    #[test]
    fn logarithm_agrees_with_the_standard_library() {
        for i in 0..200_000 {
            let x = (-708.0 + 7e-3 * f64::from(i)).exp();
            for ours in [ln::<true>(x), ln::<false>(x)] {
                assert!((ours - x.ln()).abs() <= 4e-16 * x.ln().abs().max(1.0), "{x}");
            }
        }
        assert_eq!(ln::<true>(1.0), 0.0);
        assert!((ln::<true>(f64::MIN_POSITIVE) / f64::MIN_POSITIVE.ln() - 1.0).abs() < 1e-15);
    }
}
