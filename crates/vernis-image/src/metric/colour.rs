//! Colour as metrics take it from a picture. Curves and colour spaces are those of the crate `palette`; matrices stay here, because
//! metrics differ in the digits of their matrices, and their published numbers with them.

use super::plane::Plane;
use crate::picture::{EncodedPicture, Encoding};
use palette::encoding::{IntoLinear, Srgb};
use std::sync::LazyLock;
use vernis_metric::math::color::LUMINANCE_REC709;

/// Weights of luma of ITU-R BT.601-7, item 2.5.1.
pub(super) const LUMA_REC601: [f64; 3] = [0.299, 0.587, 0.114];

/// Weights of luma, and of the luminance of linear light, of ITU-R BT.709-6, item 3.2.
pub(super) const LUMA_REC709: [f64; 3] = LUMINANCE_REC709;

/// Linear light of the 256 codes.
static LINEAR: LazyLock<[f64; 256]> = LazyLock::new(|| std::array::from_fn(|code| decoded(code as f64)));

/// Linear light, 0 to 1, of an sRGB code, 0 to 255 (IEC 61966-2-1:1999, equations 5 and 6).
pub(super) fn decoded(code: f64) -> f64 {
    <Srgb as IntoLinear<f64, f64>>::into_linear(code / 255.0)
}

/// [`decoded`], from a table where the code is whole.
pub(super) fn linear(code: f32) -> f64 {
    let whole = code as usize;
    if whole as f32 == code { LINEAR[whole.min(255)] } else { decoded(f64::from(code)) }
}

/// The cube root of a number from 1e-6 to 1e6, to the last few bits: three steps of Halley from an estimate of the exponent. The standard
/// library's takes most of the time of CIELAB, for it serves all numbers and is no inlined code.
#[inline]
pub(super) fn cube_root(x: f64) -> f64 {
    // A third of the exponent, and a bias that makes the estimate good to 5 %.
    let mut y = f64::from_bits(x.to_bits() / 3 + 0x2A9F_7893_782D_A1CE);
    for _ in 0..3 {
        let cube = y * y * y;
        y *= (cube + 2.0 * x) / (2.0 * cube + x);
    }
    y
}

pub(super) fn dot(weights: &[f64; 3], v: [f64; 3]) -> f64 {
    weights[0] * v[0] + weights[1] * v[1] + weights[2] * v[2]
}

pub(super) fn times(matrix: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| dot(&row, v))
}

/// The inverse of a 3 x 3 matrix, by cofactors.
pub(super) fn inverse(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let cofactor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
    std::array::from_fn(|i| std::array::from_fn(|j| cofactor(j, i) / determinant))
}

/// Luma: the weighted sum of the codes, 0 to 255, not rounded.
pub(super) fn luma(picture: &EncodedPicture, weights: &[f64; 3]) -> Plane {
    Plane::of_pixels(picture.width(), picture.pixels(), |pixel| dot(weights, pixel.map(f64::from)))
}

/// One channel as it is, 0 red to 2 blue.
pub(super) fn channel(picture: &EncodedPicture, index: usize) -> Plane {
    Plane::of_pixels(picture.width(), picture.pixels(), |pixel| f64::from(pixel[index]))
}

/// Linear light of a pixel: 0 to 1 of codes, cd/m2 of light.
pub(super) fn light(pixel: [f32; 3], encoding: Encoding) -> [f64; 3] {
    match encoding {
        Encoding::Srgb => pixel.map(linear),
        Encoding::Linear => pixel.map(f64::from),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_become_light() {
        assert_eq!(linear(0.0), 0.0);
        assert_eq!(linear(255.0), 1.0);
        // Below 0.04045 the curve is a line of slope 1/12.92.
        assert!((linear(10.0) - 10.0 / 255.0 / 12.92).abs() < 1e-17);
        let code: f64 = 128.5 / 255.0;
        assert!((linear(128.5) - ((code + 0.055) / 1.055).powf(2.4)).abs() < 1e-15);
    }

    #[test]
    fn cube_roots_are_those_of_the_standard_library() {
        for k in 0..200_000 {
            let x = 10f64.powf(-6.0 + 12.0 * f64::from(k) / 200_000.0);
            assert!((cube_root(x) / x.cbrt() - 1.0).abs() < 4.0 * f64::EPSILON, "{x}");
        }
    }

    #[test]
    fn a_matrix_times_its_inverse_is_one() {
        let m = [[2.0, -1.0, 0.5], [0.25, 3.0, 1.0], [-2.0, 0.0, 1.5]];
        for v in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.25, -3.0, 7.0]] {
            let back = times(&inverse(&m), times(&m, v));
            assert!((0..3).all(|k| (back[k] - v[k]).abs() < 1e-14), "{back:?}");
        }
    }
}
