//! PSNR and SSIM on perceptually uniform codes of absolute luminance, PU21.
//!
//!   V = p7 (((p1 + p2 L^p4)/(1 + p3 L^p4))^p5 - p6),  L in cd/m2, held to 0.005..10,000
//!
//! `pu21-psnr`: 10 log10(256^2 / mean dV^2);  `pu21-ssim`: [`super::ssim`] with L = 256. V(100 cd/m2) is about 256, so that numbers
//! compare with those on codes. L is the luminance of BT.709; p1..p7 are those of the variant "banding + glare".
//!
//! Source: Mantiuk and Azimi 2021 (doi:10.1109/PCS50896.2021.9477471), equation 2 and table 1; as `pycvvdp.utils.PU` 0.5.7.
//!
//! Display: codes are shown as L = 99 x linear + 1 cd/m2 (100 cd/m2 white, 1 cd/m2 of reflected light); light is what the file says.
//! Blind to: colour, viewing distance, and what PSNR and SSIM are blind to.

use super::colour::{LUMA_REC709, dot, light};
use super::contract::{Conditions, ImageMetric, PreparedResult, Properties, by_features};
use super::plane::Plane;
use super::psnr::peak_ratio;
use super::ssim::{WINDOW, of_similarity, similarity};
use crate::display::standard_luminance;
use crate::picture::{EncodedPicture, Encoding};

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// p1 to p7.
const P: [f64; 7] =
    [0.353487901, 0.3734658629, 8.277049286e-05, 0.9062562627, 0.09150303166, 0.9099517204, 596.3148142];
/// The range that was fitted, cd/m2.
const RANGE: (f64, f64) = (0.005, 10_000.0);
/// The peak of PSNR and the range of SSIM.
const PEAK: f64 = 256.0;

/// The code of a luminance in cd/m2.
pub(super) fn encoded(luminance: f64) -> f64 {
    let y = luminance.clamp(RANGE.0, RANGE.1).powf(P[3]);
    P[6] * (((P[0] + P[1] * y) / (1.0 + P[2] * y)).powf(P[4]) - P[5])
}

fn plane(picture: &EncodedPicture) -> Plane {
    let encoding = picture.encoding();
    Plane::of_pixels(picture.width(), picture.pixels(), |pixel| {
        encoded(standard_luminance(dot(&LUMA_REC709, light(*pixel, encoding)), encoding))
    })
}

/// PSNR of PU21 of luminance.
#[derive(Clone, Copy, Debug)]
pub struct Pu21Psnr;

/// SSIM of PU21 of luminance.
#[derive(Clone, Copy, Debug)]
pub struct Pu21Ssim;

const SOURCE: &str = "Mantiuk and Azimi 2021, doi:10.1109/PCS50896.2021.9477471";

impl ImageMetric for Pu21Psnr {
    fn name(&self) -> &'static str {
        "pu21-psnr"
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        Properties {
            larger_is_better: true,
            distance: "10^(-PSNR/20), the root-mean-square difference over 256",
            encodings: &[Encoding::Srgb, Encoding::Linear],
            ..Properties::new("peak signal-to-noise ratio of PU21 of luminance", "dB", SOURCE)
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, _: &Conditions) -> PreparedResult {
        by_features(reference, plane, |a, b, with_map| peak_ratio(a, b, PEAK, with_map))
    }
}

impl ImageMetric for Pu21Ssim {
    fn name(&self) -> &'static str {
        "pu21-ssim"
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        Properties {
            quality: "mean structural similarity of PU21 of luminance",
            unit: "1, -1 to 1",
            larger_is_better: true,
            distance: "1 - SSIM",
            smallest: WINDOW,
            ..Pu21Psnr.properties()
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, _: &Conditions) -> PreparedResult {
        by_features(reference, plane, |a, b, with_map| of_similarity(vec![similarity(a, b, PEAK, with_map)]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of `pycvvdp.utils.PU(type="banding_glare").encode` of version 0.5.7.
    #[test]
    fn codes_agree_with_the_authors() {
        for (luminance, expected) in [
            (0.005, 5.470456654038225e-10),
            (0.01, 0.3722322097176101),
            (0.1, 5.717073839669447),
            (1.0, 36.5439111394192),
            (10.0, 123.64748355384738),
            (100.0, 256.3838973127039),
            (1000.0, 420.0969213492443),
            (10000.0, 595.393920020095),
        ] {
            assert!((encoded(luminance) - expected).abs() < 1e-9, "{luminance}: {}", encoded(luminance));
        }
        assert_eq!(encoded(0.0), encoded(0.005));
        assert_eq!(encoded(1e6), encoded(1e4));
    }
}
