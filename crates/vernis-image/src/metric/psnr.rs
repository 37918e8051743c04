//! PSNR: the logarithm of the mean square difference of luma.
//!
//!   PSNR = 10 log10(255^2 / mean (Y_reference - Y_test)^2) dB,  Y = 0.2126 R + 0.7152 G + 0.0722 B of the sRGB codes, not rounded
//!
//! Source: the definition; weights of ITU-R BT.709-6, item 3.2. The distance is the root of the mean square over 255, which is
//! 10^(-PSNR/20): 0 for identical pictures, whose PSNR is infinite.
//!
//! Display: none. Blind to: where differences are and what they look like (noise, blur and a shift of brightness of one mean square
//! are one), colour of equal luma, viewing distance.

use super::colour::{LUMA_REC709, luma};
use super::contract::{Comparison, Conditions, DifferenceMap, ImageMetric, PreparedResult, Properties, by_features};
use super::plane::{Plane, sum_of_rows};
use crate::picture::EncodedPicture;

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// PSNR of luma of BT.709.
#[derive(Clone, Copy, Debug)]
pub struct Psnr;

impl ImageMetric for Psnr {
    fn name(&self) -> &'static str {
        "psnr"
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        let quality = "peak signal-to-noise ratio of luma (BT.709)";
        Properties {
            larger_is_better: true,
            distance: "10^(-PSNR/20), the root-mean-square difference over 255",
            ..Properties::new(quality, "dB", "by definition; ITU-R BT.709-6")
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, _: &Conditions) -> PreparedResult {
        let luma = |picture: &EncodedPicture| luma(picture, &LUMA_REC709);
        by_features(reference, luma, |a, b, with_map| peak_ratio(a, b, 255.0, with_map))
    }
}

/// PSNR of two planes with the largest value `peak`.
pub(super) fn peak_ratio(a: &Plane, b: &Plane, peak: f64, with_map: bool) -> Comparison {
    let row = |y: usize| a.row(y).iter().zip(b.row(y)).map(|(a, b)| (a - b).powi(2)).sum();
    let mean = sum_of_rows(a.height, row) / a.values.len() as f64;
    let map = with_map.then(|| DifferenceMap {
        width: a.width,
        height: a.height,
        values: a.values.iter().zip(&b.values).map(|(a, b)| (a - b).abs() as f32).collect(),
        white: peak as f32,
    });
    Comparison { distance: mean.sqrt() / peak, quality: 10.0 * (peak * peak / mean).log10(), details: vec![], map }
}
