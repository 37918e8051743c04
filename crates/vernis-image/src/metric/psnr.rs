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
use super::contract::{
    Comparison, Conditions, DifferenceMap, ImageMetric, ImageMetricError, PreparedReference, Properties,
};
use super::plane::{Plane, sum_of_rows};
use crate::picture::{EncodedPicture, Encoding, MOST_PIXELS};

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
        Properties {
            quality: "peak signal-to-noise ratio of luma (BT.709)",
            unit: "dB",
            larger_is_better: true,
            distance: "10^(-PSNR/20), the root-mean-square difference over 255",
            source: "by definition; ITU-R BT.709-6",
            encodings: &[Encoding::Srgb],
            smallest: 1,
            most_pixels: MOST_PIXELS,
            needs: vec![],
            has_map: true,
            differentiable: false,
        }
    }

    fn prepare_checked(
        &self,
        reference: &EncodedPicture,
        _: &Conditions,
    ) -> Result<Box<dyn PreparedReference>, ImageMetricError> {
        Ok(Box::new(Reference(luma(reference, &LUMA_REC709))))
    }
}

struct Reference(Plane);

impl PreparedReference for Reference {
    fn compare(&self, test: &EncodedPicture, with_map: bool) -> Result<Comparison, ImageMetricError> {
        Ok(peak_ratio(&self.0, &luma(test, &LUMA_REC709), 255.0, with_map))
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
