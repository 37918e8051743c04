//! iCID: the improved color-image-difference metric: CID with contrast and structure of chroma, combined at every place.
//!
//!   iCID = 1 - mean of L C S^3 X H XC XS
//!
//! L, C, X, H as in [`super::cid`]; S = (c3 + |sL12|)/(c3 + sL1 sL2); XC and XS: contrast and structure of chroma, as C and S.
//! c = 0.002, 10, 10, 0.002, 0.002, 10, 10 for L, C, S, X, H, XC, XS (intent "perceptual"). The window has 11 x 11 pixels, sigma 2.
//! Pictures are first made smaller by f = max(1, round(smaller side/256)). Colours: sRGB -> XYZ -> YCC -> filters of contrast
//! sensitivity up to 20 cycles a degree, on the picture mirrored at all sides -> XYZ -> LAB2000HL ([`super::lab2000hl`]).
//!
//! `icid` needs the user's table of LAB2000HL; `icid-cielab` is the same in CIELAB, which is a different metric.
//!
//! Source: Preiss, Fernandes and Urban 2014 (doi:10.1109/TIP.2014.2302684), version 1.00 of the authors' program; the filters are
//! those of Reinhard, Khan, Akyuz and Johnson 2008 (ISBN 978-1-56881-344-8), that of luminance made a low-pass.
//!
//! MATLAB and Octave give different numbers where a filtered picture has a dark pixel ([`Icid::InOctave`]). `icid` is MATLAB's, which is
//! what the paper means; `icid-octave` is for comparison with numbers that Octave computed.
//!
//! Display: sRGB at 40 pixels a degree, fixed. Blind to: detail that the shrinking takes away.

use super::cid::{Seen, WINDOW, space};
use super::colour::{channel, decoded, inverse, times};
use super::contract::{Comparison, Conditions, ImageMetric, Need, PreparedResult, Properties, by_features};
use super::frequency;
use super::lab2000hl::{Space, cielab, is_dark, xyz, xyz_of_light};
use super::plane::{Plane, gaussian, shrink};
use crate::picture::EncodedPicture;
use vernis_metric::math::parallel;

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// Standard deviation of the window's weights, pixels.
const SIGMA: f64 = 2.0;
/// c of L, C, S, X, H, XC, XS.
const CONSTANTS: [f64; 7] = [0.002, 10.0, 10.0, 0.002, 0.002, 10.0, 10.0];
/// Exponent of the structure of lightness.
const STRUCTURE: i32 = 3;
/// Pictures are made smaller towards this smaller side.
const SIDE: f64 = 256.0;
/// Cycles a degree at half of the sampling rate.
const CYCLES_PER_DEGREE: f64 = 20.0;

/// The least a* and b* of the table.
const LEAST: f64 = -128.0;

/// XYZ to YCC.
const YCC_FROM_XYZ: [[f64; 3]; 3] = [[0.0556, 0.9981, -0.0254], [0.9510, -0.9038, 0.0], [0.0386, 1.0822, -1.0276]];

/// iCID, and numbers like it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Icid {
    /// iCID.
    Lab2000Hl,
    /// iCID as Octave runs the authors' program.
    ///
    /// The program takes its filtered picture from `ifft2`, whose rounding leaves values with imaginary parts of about 1e-17. They reach
    /// a* or b* where X, Y or Z of any pixel is below the bend of CIELAB's curve, because only the other branch takes a real part. The
    /// program then holds a* and b* to -128..128, the range of the table. MATLAB compares complex numbers by their real parts. Octave
    /// compares them by their magnitudes: |b*| is less than |-128|, so that all b* of the picture become -128 where any Z is dark, all a*
    /// where any X is, and both where any Y is.
    InOctave,
    /// The same in CIELAB, which is a different metric and needs no table.
    Cielab,
}

impl ImageMetric for Icid {
    fn name(&self) -> &'static str {
        match self {
            Self::Lab2000Hl => "icid",
            Self::InOctave => "icid-octave",
            Self::Cielab => "icid-cielab",
        }
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        let source = "Preiss, Fernandes and Urban 2014, doi:10.1109/TIP.2014.2302684";
        let quality = match self {
            Self::Lab2000Hl => "improved color-image difference",
            Self::InOctave => "what Octave makes of iCID's program",
            Self::Cielab => "improved color-image difference, in CIELAB",
        };
        Properties {
            smallest: WINDOW,
            needs: if *self == Self::Cielab { vec![] } else { vec![Need::Lab2000HlTable { fallback: "icid-cielab" }] },
            ..Properties::new(quality, "1, 0 to 1", source)
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, conditions: &Conditions) -> PreparedResult {
        let space = space(self.name(), "icid-cielab", *self == Self::Cielab, conditions)?;
        let metric = *self;
        by_features(reference, move |picture| metric.seen(picture, &space), compared)
    }
}

fn compared(a: &Seen, b: &Seen, with_map: bool) -> Comparison {
    let terms = a.terms(b, &gaussian(WINDOW, SIGMA));
    let [c1, c2, c3, c4, c5, c6, c7] = CONSTANTS;
    let contrast = |c: f64, a: f64, b: f64| (c + 2.0 * a * b) / (c + a * a + b * b);
    let structure = |c: f64, a: f64, b: f64, ab: f64| (c + ab.abs()) / (c + a * b);
    let product = terms.map(|t| {
        contrast(c2, t.sl1, t.sl2) * structure(c3, t.sl1, t.sl2, t.sl12).powi(STRUCTURE)
            / (c1 * t.lightness.powi(2) + 1.0)
            / (c4 * t.chroma.powi(2) + 1.0)
            / (c5 * t.hue.powi(2) + 1.0)
            * contrast(c6, t.sc1, t.sc2)
            * structure(c7, t.sc1, t.sc2, t.sc12)
    });
    let quality = 1.0 - product.mean();
    let map = if with_map { super::ssim::map_of(vec![product]) } else { None };
    Comparison { distance: quality, quality, details: vec![], map }
}

impl Icid {
    /// A picture made smaller and filtered.
    fn seen(self, picture: &EncodedPicture, space: &Space) -> Seen {
        let (xyz, width, height) = smaller(picture);
        let filtered = filtered(&xyz, width, height);
        let [x, y, z]: [bool; 3] =
            std::array::from_fn(|k| !parallel::all(filtered.len(), |i| !is_dark(filtered[i])[k]));
        let held = self == Self::InOctave;
        let (hold_a, hold_b) = (held && (x || y), held && (z || y));
        let colour = |c: &[f64; 3]| {
            let [l, a, b] = cielab(*c);
            space.of_cielab([l, if hold_a { LEAST } else { a }, if hold_b { LEAST } else { b }])
        };
        let colours = parallel::map_items(&filtered, colour);
        Seen::new(&colours, width, &gaussian(WINDOW, SIGMA))
    }
}

/// XYZ of a picture that was made smaller, its width and its height.
fn smaller(picture: &EncodedPicture) -> (Vec<[f64; 3]>, usize, usize) {
    let side = picture.width().min(picture.height()) as f64;
    let factor = (side / SIDE).round().max(1.0) as usize;
    if factor == 1 {
        return (xyz(picture), picture.width(), picture.height());
    }
    // The program makes codes smaller, not light.
    let channels = [0, 1, 2].map(|k| shrink(&channel(picture, k), factor));
    let (width, height) = (channels[0].width, channels[0].height);
    let codes = |i: usize| [0, 1, 2].map(|k: usize| channels[k].values[i]);
    (parallel::map(width * height, |i| xyz_of_light(codes(i).map(decoded))), width, height)
}

/// XYZ after the filters of contrast sensitivity.
fn filtered(xyz: &[[f64; 3]], width: usize, height: usize) -> Vec<[f64; 3]> {
    let channels: Vec<Plane> = (0..3)
        .map(|k| {
            let plane = Plane::of_pixels(width, xyz, |c| times(&YCC_FROM_XYZ, *c)[k]);
            // The filter of luminance is 1 at no frequency too, so the mean that the program takes out and puts back stays in.
            let tripled = mirrored(&plane);
            let (half_width, half_height) = ((tripled.width / 2) as f64, (tripled.height / 2) as f64);
            let gain = |kx: usize, ky: usize| {
                let f = CYCLES_PER_DEGREE * (kx as f64 / half_width).hypot(ky as f64 / half_height);
                sensitivity(k, f)
            };
            let found = frequency::filtered(&tripled, gain);
            Plane::by_rows(width, height, |y, row| row.copy_from_slice(&found.row(height + y)[width..2 * width]))
        })
        .collect();
    let back = inverse(&YCC_FROM_XYZ);
    let pixel = |i: usize| times(&back, [0, 1, 2].map(|k: usize| channels[k].values[i]));
    parallel::map(xyz.len(), pixel)
}

/// The plane with its mirror images at all sides.
fn mirrored(plane: &Plane) -> Plane {
    let (width, height) = (plane.width, plane.height);
    let place = |i: usize, n: usize| match i / n {
        0 => n - 1 - i,
        1 => i - n,
        _ => 3 * n - 1 - i,
    };
    Plane::by_rows(3 * width, 3 * height, |y, row| {
        let from = plane.row(place(y, height));
        row.iter_mut().enumerate().for_each(|(x, v)| *v = from[place(x, width)]);
    })
}

/// Contrast sensitivity of Y, C1 (red/green) and C2 (blue/yellow) at `f` cycles a degree, 1 at most.
fn sensitivity(channel: usize, f: f64) -> f64 {
    let two = |a1: f64, b1: f64, c1: f64, a2: f64, b2: f64, c2: f64| {
        (a1 * (-b1 * f.powf(c1)).exp() + a2 * (-b2 * f.powf(c2)).exp()) / (a1 + a2)
    };
    match channel {
        // 13.3395: where the band-pass 0.63 f^0.616 exp(-0.085 f) falls through 1 the second time.
        0 if f <= 13.3395 => 1.0,
        0 => 0.63 * f.powf(0.616) * (-0.085 * f).exp(),
        1 => two(91.228, 0.0003, 2.803, 74.907, 0.0038, 2.601),
        _ => two(5.623, 0.00001, 3.4066, 41.9363, 0.083, 1.3684),
    }
}

#[cfg(test)]
mod tests {
    use super::super::lab2000hl::Lab2000HlTable;
    use super::*;
    use crate::picture::read::read;
    use std::path::PathBuf;
    use std::sync::Arc;

    #[test]
    fn sensitivity_falls_from_one() {
        for channel in 0..3 {
            assert!((sensitivity(channel, 0.0) - 1.0).abs() < 1e-15);
            let values: Vec<f64> = (0..60).map(|i| sensitivity(channel, f64::from(i))).collect();
            assert!(values.windows(2).all(|v| v[1] <= v[0]), "{channel}");
        }
        // Continuous where it begins to fall.
        assert!((sensitivity(0, 13.3396) - 1.0).abs() < 1e-4);
    }

    /// Complex numbers come from the filter. Without it, Octave's iCID is ours, of the pair with dark pixels (`ldr02_rough`) too. Origin:
    /// `icid_no_spatial_filter` of `image_golden.json` in the reference folder beside the data folder, the authors' program in Octave 7.3.
    #[test_with::env(VERNIS_DATA)]
    #[test]
    fn octave_agrees_without_the_filter() {
        let folder = PathBuf::from(std::env::var_os("VERNIS_DATA").expect("a data folder")).join("../reference/images");
        let table = Lab2000HlTable::read(&folder.join(Lab2000HlTable::FILE)).expect("a table");
        let space = Space::Lab2000Hl(Arc::new(table));
        let seen = |name: String| {
            let (xyz, width, _) = smaller(&read(&folder.join(name)).expect("a picture"));
            let colours: Vec<[f64; 3]> = xyz.iter().map(|c| space.of_cielab(cielab(*c))).collect();
            Seen::new(&colours, width, &gaussian(WINDOW, SIGMA))
        };
        for (pair, expected) in [
            ("ldr01_noise", 0.663731695907),
            ("ldr02_rough", 0.0295818561872),
            ("ldr04_gamma", 0.0851770464638),
            ("ldr06_same", 0.0),
            ("ldr09_large", 0.0479214140645),
        ] {
            let [a, b] = ["ref", "test"].map(|which| seen(format!("{pair}_{which}.png")));
            let found = compared(&a, &b, false).quality;
            assert!((found - expected).abs() < 1e-8, "{pair}: {found}");
        }
    }

    #[test]
    fn mirrors_keep_the_border_twice() {
        let plane = Plane { width: 2, height: 1, values: vec![1.0, 2.0] };
        let found = mirrored(&plane);
        assert_eq!((found.width, found.height), (6, 3));
        assert_eq!(found.values[6..12], [2.0, 1.0, 1.0, 2.0, 2.0, 1.0]);
    }
}
