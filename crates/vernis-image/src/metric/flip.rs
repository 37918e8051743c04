//! FLIP: the difference that a person sees who alternates between two pictures, from colour and from edges and points.
//!
//!   FLIP(x) = dc^(1 - df), averaged over the picture
//!
//! dc: HyAB distance of the colours after filters of contrast sensitivity and Hunt's adjustment, to the power qc = 0.7, mapped to 0..1
//! (up to pc = 0.4 of the largest distance onto 0..pt = 0.95, the rest above); df = (max(edge, point difference)/sqrt 2)^0.5, from the
//! first and second derivatives of a Gaussian of sigma = 0.041 degrees. YCxCz is linear CIELAB; the filters are Gaussians in it, for
//! Cz a sum of two; the border pixel is repeated.
//!
//! Symbols: `ppd`, pixels a degree of visual angle; 67.0206 for 3840 pixels on 0.7 m seen from 0.7 m.
//!
//! Source: Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom and Fairchild 2020 (doi:10.1145/3406183), with the separated filters
//! of the authors' program (version 1.7), with which it agrees within 1e-3; that one computes in single precision. Own code: the
//! crate `nv-flip` builds the authors' C++ and has no HDR-FLIP.
//!
//! Display: sRGB, of any size and distance, through `ppd`. Blind to: how large an area a difference covers beyond the mean (pool the
//! map to see it).

use super::colour::{inverse, light, times};
use super::contract::{
    Comparison, Conditions, DifferenceMap, ImageMetric, Need, PreparedResult, Properties, by_features,
};
use super::plane::{Edge, Plane};
use crate::picture::{EncodedPicture, MOST_PIXELS};
use palette::convert::FromColorUnclamped;
use palette::white_point::{Any, WhitePoint};
use palette::{Lab, Xyz};
use std::f64::consts::{FRAC_1_SQRT_2, PI};
use vernis_metric::math::parallel;

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// Pixels a degree where none are given: 3840 pixels on 0.7 m, seen from 0.7 m.
pub(super) const PPD: f64 = 3840.0 * PI / 180.0;

/// Exponent of colour differences.
const QC: f64 = 0.7;
/// Part of the largest colour difference that is mapped below [`PT`].
const PC: f64 = 0.4;
/// Where it is mapped to.
const PT: f64 = 0.95;
/// Width of the edge detector, degrees.
const W: f64 = 0.082;
/// Exponent of feature differences.
const QF: f64 = 0.5;
/// Contrast sensitivity of Y, Cx and Cz: (amplitude, scale in degrees^2) of each Gaussian. The amplitude of a filter that is one
/// Gaussian falls out when it is normalised.
const SENSITIVITY_Y: (f64, f64) = (1.0, 0.0047);
const SENSITIVITY_CX: (f64, f64) = (1.0, 0.0053);
const SENSITIVITY_CZ: [(f64, f64); 2] = [(34.1, 0.04), (13.5, 0.025)];

/// Linear sRGB to XYZ: the exact fractions that follow from the primaries and the white (0.3127, 0.3290).
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// White: XYZ of RGB = (1, 1, 1).
struct White;

impl WhitePoint<f64> for White {
    fn get_xyz() -> Xyz<Any, f64> {
        let [x, y, z] = white();
        Xyz::new(x, y, z)
    }
}

fn white() -> [f64; 3] {
    times(&XYZ_FROM_RGB, [1.0; 3])
}

/// FLIP of pictures of a low dynamic range.
#[derive(Clone, Copy, Debug)]
pub struct Flip;

impl ImageMetric for Flip {
    fn name(&self) -> &'static str {
        "flip"
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        Properties {
            most_pixels: MOST_PIXELS / 4,
            needs: vec![Need::Ppd(PPD)],
            ..Properties::new("mean FLIP error", "1, 0 to 1", "Andersson et al. 2020, doi:10.1145/3406183")
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, conditions: &Conditions) -> PreparedResult {
        let filters = Filters::new(conditions.ppd.unwrap_or(PPD));
        let seen = move |picture: &EncodedPicture| Seen::new(&all_light(picture), picture.width(), &filters);
        by_features(reference, seen, |a, b, with_map| {
            let map = a.difference(b);
            let quality = map.mean();
            Comparison { distance: quality, quality, details: vec![], map: with_map.then(|| map_of(&map)) }
        })
    }
}

/// Linear light of every pixel, as [`light`] gives it.
pub(super) fn all_light(picture: &EncodedPicture) -> Vec<[f64; 3]> {
    parallel::map_items(picture.pixels(), |pixel| light(*pixel, picture.encoding()))
}

/// A plane of errors as a map.
pub(super) fn map_of(plane: &Plane) -> DifferenceMap {
    let values = plane.values.iter().map(|v| *v as f32).collect();
    DifferenceMap { width: plane.width, height: plane.height, values, white: 1.0 }
}

/// The filters for a number of pixels a degree.
pub(super) struct Filters {
    y: Vec<f64>,
    cx: Vec<f64>,
    cz: [Vec<f64>; 2],
    /// A Gaussian and its first and second derivatives.
    features: [Vec<f64>; 3],
}

impl Filters {
    pub fn new(ppd: f64) -> Self {
        let broadest = SENSITIVITY_CZ[0].1;
        let radius = (3.0 * (broadest / (2.0 * PI * PI)).sqrt() * ppd).ceil() as i64;
        // In one dimension of two, the root of the amplitude a sqrt(pi/b).
        let gaussian = |(a, b): (f64, f64)| -> Vec<f64> {
            let at = |x: i64| (a * (PI / b).sqrt()).sqrt() * (-PI * PI * (x as f64 / ppd).powi(2) / b).exp();
            (-radius..=radius).map(at).collect()
        };
        let scaled = |kernel: Vec<f64>, norm: f64| kernel.iter().map(|v| v / norm).collect::<Vec<f64>>();
        let single = |parameters| {
            let kernel = gaussian(parameters);
            let sum = kernel.iter().sum();
            scaled(kernel, sum)
        };
        let cz = SENSITIVITY_CZ.map(gaussian);
        let norm = cz.iter().map(|kernel| kernel.iter().sum::<f64>().powi(2)).sum::<f64>().sqrt();
        Self {
            y: single(SENSITIVITY_Y),
            cx: single(SENSITIVITY_CX),
            cz: cz.map(|kernel| scaled(kernel, norm)),
            features: features(ppd),
        }
    }
}

/// A Gaussian with sum 1 and its derivatives, whose positive values sum to 1 and whose negative ones to -1.
fn features(ppd: f64) -> [Vec<f64>; 3] {
    let sigma = 0.5 * W * ppd;
    let radius = (3.0 * sigma).ceil() as i64;
    let sample = |f: &dyn Fn(f64) -> f64| -> Vec<f64> { (-radius..=radius).map(|x| f(x as f64)).collect() };
    let gaussian = |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
    let raw =
        [sample(&gaussian), sample(&|x| -x * gaussian(x)), sample(&|x| (x * x / (sigma * sigma) - 1.0) * gaussian(x))];
    raw.map(|kernel| {
        let above: f64 = kernel.iter().filter(|v| **v > 0.0).sum();
        let below: f64 = -kernel.iter().filter(|v| **v < 0.0).sum::<f64>();
        kernel
            .iter()
            .map(|v| {
                if *v > 0.0 {
                    v / above
                } else if *v < 0.0 {
                    v / below
                } else {
                    0.0
                }
            })
            .collect()
    })
}

/// A picture as it is seen: its filtered colours, and how strong edges and points are.
pub(super) struct Seen {
    /// Lightness, and a* and b* after Hunt's adjustment.
    colours: Vec<[f64; 3]>,
    edges: Plane,
    points: Plane,
}

impl Seen {
    /// Of linear light, white at 1.
    pub fn new(light: &[[f64; 3]], width: usize, filters: &Filters) -> Self {
        let white = white();
        // XYZ over that of white: Y, then Cx = 500 (X - Y) and Cz = 200 (Y - Z) up to factors that filters leave alone.
        let opponent = |c: &[f64; 3]| -> [f64; 3] {
            let xyz = times(&XYZ_FROM_RGB, *c);
            let [x, y, z] = [xyz[0] / white[0], xyz[1] / white[1], xyz[2] / white[2]];
            [y, x - y, y - z]
        };
        let opponents = parallel::map_items(light, opponent);
        let [y, cx, cz] = [0, 1, 2].map(|k| Plane::of_pixels(width, &opponents, |c| c[k]));
        let [g, dg, ddg] = &filters.features;
        let length = |a: f64, b: f64| (a * a + b * b).sqrt();
        let derivatives = |kernel: &[f64]| {
            let (across, down) = (y.correlate(kernel, g, Edge::Replicate), y.correlate(g, kernel, Edge::Replicate));
            Plane::of_two(&across, &down, length)
        };
        let (edges, points) = (derivatives(dg), derivatives(ddg));
        let y = y.correlate(&filters.y, &filters.y, Edge::Replicate);
        let cx = cx.correlate(&filters.cx, &filters.cx, Edge::Replicate);
        let [cz1, cz2] = [0, 1].map(|k| cz.correlate(&filters.cz[k], &filters.cz[k], Edge::Replicate));
        let rgb_from_xyz = inverse(&XYZ_FROM_RGB);
        let colour = |i: usize| {
            let (y, cx, cz) = (y.values[i], cx.values[i], cz1.values[i] + cz2.values[i]);
            let xyz = [(y + cx) * white[0], y * white[1], (y - cz) * white[2]];
            adjusted(times(&rgb_from_xyz, xyz).map(|v| v.clamp(0.0, 1.0)))
        };
        Self { colours: parallel::map(light.len(), colour), edges, points }
    }

    /// The FLIP error of every pixel.
    pub fn difference(&self, test: &Self) -> Plane {
        let farthest = hyab(adjusted([0.0, 1.0, 0.0]), adjusted([0.0, 0.0, 1.0])).powf(QC);
        let knee = PC * farthest;
        let width = self.edges.width;
        Plane::by_rows(width, self.edges.height, |row, out| {
            for (x, out) in out.iter_mut().enumerate() {
                let i = row * width + x;
                let colour = hyab(self.colours[i], test.colours[i]).powf(QC);
                let colour = if colour < knee {
                    colour * PT / knee
                } else {
                    PT + (colour - knee) / (farthest - knee) * (1.0 - PT)
                };
                let edge = (self.edges.values[i] - test.edges.values[i]).abs();
                let point = (self.points.values[i] - test.points.values[i]).abs();
                let feature = (FRAC_1_SQRT_2 * edge.max(point)).powf(QF);
                *out = colour.powf(1.0 - feature);
            }
        })
    }
}

/// CIELAB of linear light with Hunt's adjustment: chroma counts by lightness.
fn adjusted(rgb: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = times(&XYZ_FROM_RGB, rgb);
    let lab = Lab::from_color_unclamped(Xyz::<White, f64>::new(x, y, z));
    [lab.l, 0.01 * lab.l * lab.a, 0.01 * lab.l * lab.b]
}

/// The distance HyAB: city block between lightness and chroma, Euclidean in chroma.
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + ((a[1] - b[1]).powi(2) + (a[2] - b[2]).powi(2)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Black and white differ in lightness by 100 and in nothing else; green and blue, the farthest colours, have an error of 1.
    #[test]
    fn even_pictures_have_the_error_of_their_colours() {
        let filters = Filters::new(PPD);
        let even = |c: [f64; 3]| Seen::new(&[c; 30], 6, &filters);
        let error = |a, b| even(a).difference(&even(b)).values[7];
        assert!((error([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]) - 1.0).abs() < 1e-9);
        let farthest = hyab(adjusted([0.0, 1.0, 0.0]), adjusted([0.0, 0.0, 1.0])).powf(QC);
        let grey = 100f64.powf(QC);
        let expected = PT + (grey - PC * farthest) / ((1.0 - PC) * farthest) * (1.0 - PT);
        assert!((error([0.0; 3], [1.0; 3]) - expected).abs() < 1e-9);
        assert_eq!(error([0.2, 0.3, 0.4], [0.2, 0.3, 0.4]), 0.0);
    }

    #[test]
    fn filters_keep_what_is_even() {
        for ppd in [20.0, PPD] {
            let filters = Filters::new(ppd);
            let sum = |kernel: &[f64]| kernel.iter().sum::<f64>();
            assert!((sum(&filters.y) - 1.0).abs() < 1e-12 && (sum(&filters.cx) - 1.0).abs() < 1e-12);
            assert!((sum(&filters.cz[0]).powi(2) + sum(&filters.cz[1]).powi(2) - 1.0).abs() < 1e-12);
            let [g, dg, ddg] = &filters.features;
            assert!((sum(g) - 1.0).abs() < 1e-12 && sum(dg).abs() < 1e-12 && sum(ddg).abs() < 1e-12);
        }
    }
}
