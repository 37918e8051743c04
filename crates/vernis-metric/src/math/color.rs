//! Colour: luminance, CIE XYZ and CIELAB of linear RGB with Rec. 709 / sRGB primaries and the D65 white.

use super::Rgb;

/// Luminance weights of linear RGB with Rec. 709 primaries (ITU-R BT.709-6, item 3.2).
pub const LUMINANCE_REC709: Rgb = [0.2126, 0.7152, 0.0722];

/// Linear RGB with Rec. 709 primaries to CIE XYZ (rows X, Y, Z), Y = 1 for RGB = (1, 1, 1) (IEC 61966-2-1:1999).
pub const XYZ_FROM_REC709: [[f64; 3]; 3] =
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];

/// XYZ of the D65 white: the row sums of [`XYZ_FROM_REC709`], so that grey has a* = b* = 0.
pub const WHITE_D65: [f64; 3] = [0.9505, 1.0, 1.0890];

/// Below this cube, t = (6/29)^3, the CIELAB curve is a straight line (CIE 15:2018, equation 8.6).
pub const CIELAB_LINEAR_BELOW: f64 = 216.0 / 24389.0;

/// Slope of that line, 841/108 = 1/(3 (6/29)^2).
pub const CIELAB_SLOPE: f64 = 841.0 / 108.0;

/// The sRGB code from 0 to 1 of linear light from 0 to 1 (IEC 61966-2-1:1999, equations 9 and 10).
pub fn srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Relative luminance of a linear RGB triple.
pub fn luminance(c: Rgb) -> f64 {
    LUMINANCE_REC709[0] * c[0] + LUMINANCE_REC709[1] * c[1] + LUMINANCE_REC709[2] * c[2]
}

/// CIE XYZ of a linear RGB triple.
pub fn xyz(c: Rgb) -> [f64; 3] {
    XYZ_FROM_REC709.map(|row| row[0] * c[0] + row[1] * c[1] + row[2] * c[2])
}

/// CIELAB (L*, a*, b*) of a linear RGB triple that is (1, 1, 1) for the D65 white (CIE 15:2018, section 8.2.1).
///
///   L* = 116 f(Y/Yn) - 16,  a* = 500 (f(X/Xn) - f(Y/Yn)),  b* = 200 (f(Y/Yn) - f(Z/Zn)),
///   f(t) = cbrt(t) above (6/29)^3, 841/108 t + 4/29 up to it.
///
/// Highlights brighter than the white have L* above 100.
pub fn cielab(c: Rgb) -> [f64; 3] {
    let xyz = xyz(c);
    let f = |i: usize| {
        let t = xyz[i] / WHITE_D65[i];
        if t > CIELAB_LINEAR_BELOW { t.cbrt() } else { CIELAB_SLOPE * t + 4.0 / 29.0 }
    };
    let (fx, fy, fz) = (f(0), f(1), f(2));
    [116.0 * fy - 16.0, 500.0 * (fx - fy), 200.0 * (fy - fz)]
}

/// The linear RGB triple of which [`cielab`] is `lab` (L*, a*, b*): components below 0 or above 1 where the colour lies outside the
/// gamut of the primaries.
///
///   f(Y/Yn) = (L* + 16)/116,  f(X/Xn) = f(Y/Yn) + a*/500,  f(Z/Zn) = f(Y/Yn) - b*/200; RGB by Cramer's rule.
pub fn rgb_of_cielab(lab: [f64; 3]) -> Rgb {
    let fy = (lab[0] + 16.0) / 116.0;
    let f = [fy + lab[1] / 500.0, fy, fy - lab[2] / 200.0];
    let xyz: [f64; 3] = std::array::from_fn(|i| {
        let cube = f[i].powi(3);
        WHITE_D65[i] * if cube > CIELAB_LINEAR_BELOW { cube } else { (f[i] - 4.0 / 29.0) / CIELAB_SLOPE }
    });
    let determinant = |m: [[f64; 3]; 3]| {
        let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
        m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
    };
    let whole = determinant(XYZ_FROM_REC709);
    std::array::from_fn(|column| {
        let mut replaced = XYZ_FROM_REC709;
        for (row, value) in replaced.iter_mut().zip(xyz) {
            row[column] = value;
        }
        determinant(replaced) / whole
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of colours on both branches of the curve, and of one outside the gamut.
    #[test]
    fn rgb_and_cielab_are_inverse() {
        for rgb in [[0.2, 0.5, 0.9], [0.001, 0.002, 0.0005], [1.0; 3], [0.0; 3], [-0.05, 0.4, 0.3]] {
            for (found, expected) in rgb_of_cielab(cielab(rgb)).iter().zip(rgb) {
                assert!((found - expected).abs() < 1e-13, "{found} {expected}");
            }
        }
    }

    #[test]
    fn white_and_black_are_neutral() {
        let white = cielab([1.0; 3]);
        assert!((white[0] - 100.0).abs() < 1e-12 && white[1].abs() < 1e-12 && white[2].abs() < 1e-12);
        assert!(cielab([0.0; 3]).iter().all(|x| x.abs() < 1e-12));
    }

    /// The sRGB primaries in CIELAB under D65, as colour calculators tabulate them.
    #[test]
    fn srgb_primaries() {
        let expected = [[53.2408, 80.0925, 67.2032], [87.7347, -86.1827, 83.1793], [32.2970, 79.1875, -107.8602]];
        for (i, expected) in expected.iter().enumerate() {
            let mut rgb = [0.0; 3];
            rgb[i] = 1.0;
            // The tabulated values use a matrix of more digits, which differs by up to 5e-5 an entry.
            for (found, expected) in cielab(rgb).iter().zip(expected) {
                assert!((found - expected).abs() < 0.03, "{found} {expected}");
            }
        }
    }

    #[test]
    fn the_two_branches_meet_with_one_slope() {
        let grey = |t: f64| cielab([t; 3])[0];
        let t = CIELAB_LINEAR_BELOW;
        assert!((grey(t * (1.0 + 1e-9)) - grey(t)).abs() < 1e-6);
        let (below, above) = (grey(t) - grey(t * 0.999), grey(t * 1.001) - grey(t));
        assert!((below / above - 1.0).abs() < 2e-3);
    }
}
