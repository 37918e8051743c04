//! CIELAB: the distance of each pixel's colour in CIELAB, pooled over the picture.
//!
//!   dE = sqrt(dL*^2 + da*^2 + db*^2);  `cielab`: mean dE;  `cielab-rms`: sqrt(mean dE^2)
//!
//! sRGB codes -> linear RGB -> XYZ by the matrix below -> CIELAB with the D65 white of the 2 degree observer (0.95047, 1, 1.08883).
//! The matrix has the six digits that scikit-image uses, so that the numbers agree with its `rgb2lab`. The curve of sRGB is
//! `palette`'s; CIELAB is written out, with a cube root of our own, because the conversion takes nearly all of the time.
//!
//! Source: CIE 15:2018, section 8.2.1; sRGB: IEC 61966-2-1:1999. The root of the mean square is the "CIELAB" of Lavoue, Bonneel,
//! Farrugia and Soler 2021 (doi:10.1111/cgf.142636), section 6.
//!
//! Display: a perfect sRGB display, white as bright as the eye is adapted to. Blind to: space altogether (every pixel is a patch of
//! its own), so noise that the eye averages counts in full; viewing distance.

use super::colour::{cube_root, light, times};
use super::contract::{Comparison, Conditions, DifferenceMap, ImageMetric, PreparedResult, Properties, by_features};
use super::plane::{Plane, sum_of_rows};
use crate::picture::EncodedPicture;
use palette::Lab;
use palette::white_point::D65;
use vernis_metric::math::parallel;

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// Linear sRGB to XYZ, as scikit-image has it.
const XYZ_FROM_RGB: [[f64; 3]; 3] =
    [[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]];

/// White of D65 and the 2 degree observer, as scikit-image has it.
const WHITE_POINT: [f64; 3] = [0.95047, 1.0, 1.08883];

/// A difference of lightness from black to white, which a map shows as white.
pub(super) const WHITE: f32 = 100.0;

/// How distances of pixels become one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mean {
    /// Their mean.
    Arithmetic,
    /// The root of their mean square.
    Quadratic,
}

/// Distance in CIELAB.
#[derive(Clone, Copy, Debug)]
pub struct Cielab(pub Mean);

/// f of CIE 15:2018, equation 8.6: the cube root, and a line below (6/29)^3.
fn f(t: f64) -> f64 {
    const KNEE: f64 = 216.0 / 24389.0;
    if t > KNEE { cube_root(t) } else { (24389.0 / 27.0 * t + 16.0) / 116.0 }
}

/// CIELAB of every pixel.
pub(super) fn lab(picture: &EncodedPicture) -> Vec<Lab<D65, f64>> {
    let of_pixel = |pixel: &[f32; 3]| {
        let xyz = times(&XYZ_FROM_RGB, light(*pixel, picture.encoding()));
        let [x, y, z] = std::array::from_fn(|c| f(xyz[c] / WHITE_POINT[c]));
        Lab::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
    };
    parallel::map_items(picture.pixels(), of_pixel)
}

impl ImageMetric for Cielab {
    fn name(&self) -> &'static str {
        match self.0 {
            Mean::Arithmetic => "cielab",
            Mean::Quadratic => "cielab-rms",
        }
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        let quality = match self.0 {
            Mean::Arithmetic => "mean colour difference of CIELAB",
            Mean::Quadratic => "root-mean-square colour difference of CIELAB",
        };
        Properties::new(quality, "dE*ab", "CIE 15:2018; Lavoue et al. 2021, doi:10.1111/cgf.142636")
    }

    fn prepare_checked(&self, reference: &EncodedPicture, _: &Conditions) -> PreparedResult {
        let difference = |a: &Lab<D65, f64>, b: &Lab<D65, f64>| {
            ((a.l - b.l).powi(2) + (a.a - b.a).powi(2) + (a.b - b.b).powi(2)).sqrt()
        };
        let (mean, width) = (self.0, reference.width());
        by_features(reference, lab, move |a, b, with_map| pooled(a, b, width, difference, mean, with_map))
    }
}

/// The pooled difference of the pixels of two pictures of `width` columns.
pub(super) fn pooled<T: Sync>(
    a: &[T],
    b: &[T],
    width: usize,
    difference: impl Fn(&T, &T) -> f64 + Sync,
    mean: Mean,
    with_map: bool,
) -> Comparison {
    let height = a.len() / width;
    let plane = Plane::by_rows(width, height, |y, row| {
        for (x, to) in row.iter_mut().enumerate() {
            *to = difference(&a[y * width + x], &b[y * width + x]);
        }
    });
    let quality = match mean {
        Mean::Arithmetic => plane.mean(),
        Mean::Quadratic => {
            let squares = sum_of_rows(height, |y| plane.row(y).iter().map(|d| d * d).sum());
            (squares / plane.values.len() as f64).sqrt()
        }
    };
    let map = with_map.then(|| DifferenceMap {
        width,
        height,
        values: plane.values.iter().map(|d| *d as f32).collect(),
        white: WHITE,
    });
    Comparison { distance: quality, quality, details: vec![], map }
}
