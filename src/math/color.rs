//! Colour: luminance and CIELAB from linear RGB with Rec. 709 / sRGB primaries.

use super::Rgb;

/// Luminance weights of linear RGB with Rec. 709 primaries (ITU-R BT.709-6, item 3.2).
pub const LUMINANCE_REC709: Rgb = [0.2126, 0.7152, 0.0722];

/// Relative luminance of a linear RGB triple.
pub fn luminance(c: Rgb) -> f64 {
    LUMINANCE_REC709[0] * c[0] + LUMINANCE_REC709[1] * c[1] + LUMINANCE_REC709[2] * c[2]
}
