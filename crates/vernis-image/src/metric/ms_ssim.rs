//! MS-SSIM: contrast and structure at five resolutions, luminance at the coarsest.
//!
//!   MS-SSIM = SSIM_5^w5 * product over scales s = 1..4 of cs_s^ws
//!
//! cs_s: mean over the window's places of the second factor of SSIM ([`super::ssim`]) at scale s; SSIM_5: the mean SSIM at scale 5;
//! w = 0.0448, 0.2856, 0.3001, 0.2363, 0.1333 (their sum is 1.0001, as in the paper). From a scale to the next, the picture is
//! averaged over 2 x 2 pixels, mirrored at its border, and every second pixel is kept. A mean below 0, which has no real power,
//! counts as 0. On luma of BT.601, as the authors' program.
//!
//! Source: Wang, Simoncelli and Bovik 2003, equation 7 and section 3.2 (doi:10.1109/ACSSC.2003.1292216); reduction by 2 as in the
//! authors' MATLAB. `piq` 0.8 gives the same on pictures of even sides; on odd ones it repeats a row at the top instead.
//!
//! Display: none, but the weights were found at 32 pixels a degree. Blind to: colour; brightness but at the coarsest scale.

use super::colour::{LUMA_REC601, luma};
use super::contract::{Comparison, Conditions, ImageMetric, PreparedResult, Properties, by_features};
use super::plane::{Plane, shrink};
use super::ssim::{Similarity, WINDOW, similarity};
use crate::picture::EncodedPicture;

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// Exponents from the finest scale to the coarsest.
const WEIGHTS: [f64; 5] = [0.0448, 0.2856, 0.3001, 0.2363, 0.1333];

/// Smallest side: at the coarsest scale, a sixteenth of it rounded up, the window must fit.
const SMALLEST: usize = (WINDOW - 1) * 16 + 1;

/// MS-SSIM on luma of BT.601.
#[derive(Clone, Copy, Debug)]
pub struct MsSsim;

impl ImageMetric for MsSsim {
    fn name(&self) -> &'static str {
        "ms-ssim"
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        let source = "Wang, Simoncelli and Bovik 2003, doi:10.1109/ACSSC.2003.1292216";
        Properties {
            larger_is_better: true,
            distance: "1 - MS-SSIM",
            smallest: SMALLEST,
            has_map: false,
            ..Properties::new("multi-scale structural similarity", "1, 0 to 1", source)
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, _: &Conditions) -> PreparedResult {
        by_features(reference, scales, |a, b, _| {
            let mut quality = 1.0;
            for (s, (a, b)) in a.iter().zip(b).enumerate() {
                let Similarity { ssim, contrast_structure, .. } = similarity(a, b, 255.0, false);
                let factor = if s + 1 == WEIGHTS.len() { ssim } else { contrast_structure };
                quality *= factor.max(0.0).powf(WEIGHTS[s]);
            }
            Comparison { distance: 1.0 - quality, quality, details: vec![], map: None }
        })
    }
}

/// Luma at the five scales.
fn scales(picture: &EncodedPicture) -> Vec<Plane> {
    let mut scales = vec![luma(picture, &LUMA_REC601)];
    for s in 1..WEIGHTS.len() {
        scales.push(shrink(&scales[s - 1], 2));
    }
    scales
}
