//! CIEDE2000: the colour difference of each pixel, corrected for what CIELAB gets wrong, averaged over the picture.
//!
//!   dE00 = sqrt((dL'/SL)^2 + (dC'/SC)^2 + (dH'/SH)^2 + RT (dC'/SC) (dH'/SH)), kL = kC = kH = 1
//!
//! dL', dC', dH': differences of lightness, chroma and hue with a* stretched near grey; SL, SC, SH: weights by the mean colour; RT: a
//! rotation in the blue. CIELAB as in [`super::cielab`]; the formula is `palette`'s.
//!
//! Source: Luo, Cui and Rigg 2001 (doi:10.1002/col.1049); the form and the 34 test pairs of Sharma, Wu and Dalal 2005
//! (doi:10.1002/col.20070), table 1, which the tests hold it to.
//!
//! Display and what it is blind to: as [`super::cielab`]. The formula was fitted to differences of less than 5 units.

use super::cielab::{Mean, lab, pooled};
use super::contract::{Conditions, ImageMetric, PreparedResult, Properties, by_features};
use crate::picture::EncodedPicture;
use palette::Lab;
use palette::color_difference::Ciede2000 as _;
use palette::white_point::D65;

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// Mean CIEDE2000.
#[derive(Clone, Copy, Debug)]
pub struct Ciede2000;

/// The colour difference CIEDE2000 of two colours (L*, a*, b*), with kL = kC = kH = 1.
pub fn ciede2000(a: [f64; 3], b: [f64; 3]) -> f64 {
    let lab = |c: [f64; 3]| Lab::<D65, f64>::new(c[0], c[1], c[2]);
    lab(a).difference(lab(b))
}

impl ImageMetric for Ciede2000 {
    fn name(&self) -> &'static str {
        "ciede2000"
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        Properties::new("mean colour difference CIEDE2000", "dE00", "Sharma, Wu and Dalal 2005, doi:10.1002/col.20070")
    }

    fn prepare_checked(&self, reference: &EncodedPicture, _: &Conditions) -> PreparedResult {
        let difference = |a: &Lab<D65, f64>, b: &Lab<D65, f64>| a.difference(*b);
        let width = reference.width();
        by_features(reference, lab, move |a, b, with_map| pooled(a, b, width, difference, Mean::Arithmetic, with_map))
    }
}
