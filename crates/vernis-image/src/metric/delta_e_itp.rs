//! Delta E ITP: the colour difference of each pixel for wide gamuts and high dynamic range, averaged over the picture.
//!
//!   dE_ITP = 720 sqrt(dI^2 + dT^2 + dP^2),  T = CT / 2,  P = CP
//!
//! (I, CT, CP): ICtCp of BT.2100-2, table 7, with the curve PQ at 10,000 cd/m2: linear RGB of BT.709 -> BT.2020 (negative values to
//! 0) -> LMS -> PQ -> ICtCp. A value of 1 is about a just noticeable difference.
//!
//! Source: ITU-R BT.2124-0 (2019), annex 1. No crate has ICtCp, so the two matrices and the curve stand here.
//!
//! Display: codes are shown at 100 cd/m2 for white and no black level; light is what the file says, in cd/m2. Blind to: space, as
//! every metric of single pixels; the eye's adaptation to the rest of the picture.

use super::cielab::{Mean, pooled};
use super::colour::{light, times};
use super::contract::{Conditions, ImageMetric, PreparedResult, Properties, by_features};
use crate::picture::{EncodedPicture, Encoding};
use vernis_metric::math::parallel;

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// Luminance of the white of codes, cd/m2.
const CODE_WHITE: f64 = 100.0;

/// Linear RGB of BT.709 to that of BT.2020 (ITU-R BT.2087-0, with the digits of the primaries' definition).
const REC2020_FROM_REC709: [[f64; 3]; 3] = [
    [0.6274038959346989, 0.3292830383778837, 0.0433130656874173],
    [0.0690972893582321, 0.9195403950754585, 0.011362315566309171],
    [0.016391438875150228, 0.08801330787722575, 0.8955952532476239],
];

/// RGB of BT.2020 to LMS (BT.2100-2, table 7), times 4096.
const LMS_FROM_REC2020: [[f64; 3]; 3] = [[1688.0, 2146.0, 262.0], [683.0, 2951.0, 462.0], [99.0, 309.0, 3688.0]];

/// LMS after PQ to ICtCp (BT.2100-2, table 7), times 4096.
const ICTCP_FROM_LMS: [[f64; 3]; 3] = [[2048.0, 2048.0, 0.0], [6610.0, -13613.0, 7003.0], [17933.0, -17390.0, -543.0]];

/// The inverse EOTF PQ of light in cd/m2 (BT.2100-2, table 4).
fn pq(light: f64) -> f64 {
    const M1: f64 = 2610.0 / 16384.0;
    const M2: f64 = 2523.0 / 4096.0 * 128.0;
    const C1: f64 = 3424.0 / 4096.0;
    const C2: f64 = 2413.0 / 4096.0 * 32.0;
    const C3: f64 = 2392.0 / 4096.0 * 32.0;
    let y = (light / 10_000.0).powf(M1);
    ((C1 + C2 * y) / (1.0 + C3 * y)).powf(M2)
}

/// (I, T, P) of linear light of BT.709 in cd/m2.
fn itp(rgb: [f64; 3]) -> [f64; 3] {
    let wide = times(&REC2020_FROM_REC709, rgb).map(|v| v.max(0.0));
    let lms = times(&LMS_FROM_REC2020, wide).map(|v| pq(v / 4096.0));
    let [i, ct, cp] = times(&ICTCP_FROM_LMS, lms).map(|v| v / 4096.0);
    [i, 0.5 * ct, cp]
}

/// Mean Delta E ITP.
#[derive(Clone, Copy, Debug)]
pub struct DeltaEItp;

impl ImageMetric for DeltaEItp {
    fn name(&self) -> &'static str {
        "delta-e-itp"
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        Properties {
            encodings: &[Encoding::Srgb, Encoding::Linear],
            ..Properties::new("mean colour difference dE ITP", "just noticeable differences", "ITU-R BT.2124-0")
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, _: &Conditions) -> PreparedResult {
        let difference = |a: &[f64; 3], b: &[f64; 3]| {
            720.0 * ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2) + (a[2] - b[2]).powi(2)).sqrt()
        };
        let width = reference.width();
        by_features(reference, all_itp, move |a, b, with_map| {
            pooled(a, b, width, difference, Mean::Arithmetic, with_map)
        })
    }
}

fn all_itp(picture: &EncodedPicture) -> Vec<[f64; 3]> {
    let encoding = picture.encoding();
    let white = if encoding == Encoding::Srgb { CODE_WHITE } else { 1.0 };
    parallel::map_items(picture.pixels(), |pixel| itp(light(*pixel, encoding).map(|v| white * v)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey has no chroma; PQ of 100 cd/m2 is 0.5081 and of 10,000 cd/m2 is 1 (BT.2100-2, note to table 4).
    #[test]
    fn grey_is_on_the_curve() {
        for (light, expected) in [(100.0, 0.5081), (10_000.0, 1.0)] {
            let [i, t, p] = itp([light; 3]);
            assert!((i - expected).abs() < 1e-4 && t.abs() < 1e-4 && p.abs() < 1e-4, "{i} {t} {p}");
        }
    }
}
