//! HDR-VDP 2.2.0: whether a person sees a difference, and how much it harms, at any luminance.
//!
//!   Q = sum over bands b and orientations o of w(f_b)/n log(|D_bo| + 1e-12),  |D| = sqrt(sum of D^2)/pixels
//!   P_det = max over pixels of 1 - 0.5^S,  S = (sum of s / max s) s,  s = |picture of the bands D'|
//!
//! Light -> scatter in the eye -> receptors -> response in just noticeable differences -> steerable pyramid of cones plus rods;
//! per band, the difference of test and reference over the noise of sensitivity (N = 1/nCSF) and masking:
//!
//!   D = sign(d) |d/n|^p n / sqrt(N^2p + M^2),  n = 2^(b-1),
//!   M = n (k_self (m/(N n))^q + k_xo (m_xo/(N n))^q + k_xn (m_xn/N)^q),  m = min(|test|, |reference|), 3 x 3 mean
//!
//! m_xo: m of the other orientations; m_xn: of the neighbouring bands over their n. In the lowest band N = 1, because its values were
//! filtered by the sensitivity. D' = sign(D) |D/n|^(s/p) n with s = 3.5, the slope of the psychometric function. w: the weights of the
//! calibration on LDR and HDR pictures that Narwaria et al. 2015 published (doi:10.1117/1.JEI.24.1.010501).
//!
//! `quality` is Q. In this version a higher Q is WORSE, and identical pictures have the least that there is, the sum of w/n log(1e-12);
//! the distance is Q minus that. `details`: Q_MOS = 100/(1 + exp(3.455 (Q + 0.8886))), P_det, the mean of the map of P.
//!
//! | name | channels |
//! | --- | --- |
//! | `hdr-vdp` | RGB of an LCD with a CCFL backlight; codes are shown at 99 x + 1 cd/m2 |
//! | `hdr-vdp-luminance` | luminance alone with the spectrum of D65; light only |
//!
//! Source: Mantiuk, Kim, Rempel and Heidrich 2011 (doi:10.1145/2010324.1964935), as version 2.2.0 of the authors' program computes it
//! (surround 1e-5 cd/m2). Written anew from its equations and parameters; the program is Copyright (c) 2011, Rafal Mantiuk
//! <mantiuk@gmail.com>: Permission to use, copy, modify, and/or distribute this software for any purpose with or without fee is hereby
//! granted, provided that the above copyright notice and this permission notice appear in all copies. THE SOFTWARE IS PROVIDED "AS IS"
//! AND THE AUTHOR DISCLAIMS ALL WARRANTIES WITH REGARD TO THIS SOFTWARE INCLUDING ALL IMPLIED WARRANTIES OF MERCHANTABILITY AND
//! FITNESS. IN NO EVENT SHALL THE AUTHOR BE LIABLE FOR ANY SPECIAL, DIRECT, INDIRECT, OR CONSEQUENTIAL DAMAGES OR ANY DAMAGES
//! WHATSOEVER RESULTING FROM LOSS OF USE, DATA OR PROFITS, WHETHER IN AN ACTION OF CONTRACT, NEGLIGENCE OR OTHER TORTIOUS ACTION,
//! ARISING OUT OF OR IN CONNECTION WITH THE USE OR PERFORMANCE OF THIS SOFTWARE.
//!
//! Display: as above; light is what the file says. Blind to: colour (receptors are summed), and the mean response, which is taken out:
//! a brighter picture of the same contrast changes little.

mod eye;
mod masking;
mod pyramid;
mod resize;

use super::colour::{LUMA_REC709, dot, light, times};
use super::contract::{
    Comparison, Conditions, DifferenceMap, ImageMetric, ImageMetricError, Need, PreparedReference, PreparedResult,
    Properties,
};
use super::frequency;
use super::plane::{Plane, sum_of_rows};
use crate::display::standard_luminance;
use crate::picture::{EncodedPicture, Encoding, MOST_PIXELS};
use eye::{CONE, RECEPTORS_FROM_LUMINANCE, RECEPTORS_FROM_RGB, ROD, neural_sensitivity, scatter};
use masking::{LOG_P, Masking, Noise, signed_power};
use pyramid::Pyramid;
use resize::resized;
use std::f64::consts::SQRT_2;

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// Pixels a degree where none are given: a screen of the time seen from half a metre.
const PPD: f64 = 30.0;
/// Luminance around the picture, cd/m2.
const SURROUND: f64 = 1e-5;
/// What passes the optics is held to this range, cd/m2.
const LIGHT: (f64, f64) = (1e-5, 1e10);

/// Slope of the psychometric function.
const SLOPE: f64 = 3.5;

/// Cycles a degree, and the weights of their bands in Q.
const QUALITY: [(f64, f64); 7] = [
    (15.0, 0.2832),
    (7.5, 0.2142),
    (3.75, 0.2690),
    (1.875, 0.0398),
    (0.9375, 0.0003),
    (0.4688, 0.0003),
    (0.2344, 0.0002),
];
/// Keeps the logarithm of no difference finite.
const EPSILON: f64 = 1e-12;
/// The logistic curve from Q to a mean opinion score of 100.
const LOGISTIC: (f64, f64) = (3.455, 0.8886);

/// What the receptors are given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Receptors {
    /// Three channels, each with the spectrum of its primary.
    Rgb,
    /// Luminance alone.
    Luminance,
}

/// HDR-VDP 2.2.0.
#[derive(Clone, Copy, Debug)]
pub struct HdrVdp(pub Receptors);

impl ImageMetric for HdrVdp {
    fn name(&self) -> &'static str {
        match self.0 {
            Receptors::Rgb => "hdr-vdp",
            Receptors::Luminance => "hdr-vdp-luminance",
        }
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        let (unit, source) = ("1, larger is worse", "Mantiuk et al. 2011, doi:10.1145/2010324.1964935");
        Properties {
            distance: "Q minus that of identical pictures",
            encodings: match self.0 {
                Receptors::Rgb => &[Encoding::Srgb, Encoding::Linear],
                Receptors::Luminance => &[Encoding::Linear],
            },
            smallest: pyramid::SMALLEST,
            most_pixels: MOST_PIXELS / 4,
            needs: vec![Need::Ppd(PPD)],
            ..Properties::new("Q of HDR-VDP 2.2.0; P_det is a detail", unit, source)
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, conditions: &Conditions) -> PreparedResult {
        let ppd = conditions.ppd.unwrap_or(PPD);
        let channels = self.channels(reference);
        let seen = self.seen(&channels, ppd, None);
        Ok(Box::new(Reference { metric: *self, ppd, channels, seen }))
    }
}

/// What becomes of a picture in the eye.
struct Seen {
    bands: Pyramid,
    /// Luminance that the eye adapts to, cd/m2.
    adaptation: Plane,
    /// Mean of the lowest band before its filter, with which it is continued beyond its border.
    beyond: f64,
}

struct Reference {
    metric: HdrVdp,
    ppd: f64,
    channels: Vec<Plane>,
    seen: Seen,
}

impl HdrVdp {
    /// Light of the channels, cd/m2.
    fn channels(self, picture: &EncodedPicture) -> Vec<Plane> {
        let encoding = picture.encoding();
        let plane = |value: &(dyn Fn([f64; 3]) -> f64 + Sync)| {
            Plane::of_pixels(picture.width(), picture.pixels(), |pixel| {
                standard_luminance(value(light(*pixel, encoding)), encoding)
            })
        };
        match self.0 {
            Receptors::Rgb => (0..3).map(|k| plane(&|c| c[k])).collect(),
            Receptors::Luminance => vec![plane(&|c| dot(&LUMA_REC709, c))],
        }
    }

    fn seen(self, channels: &[Plane], ppd: f64, beyond: Option<f64>) -> Seen {
        let retina: Vec<Plane> = channels
            .iter()
            .map(|channel| continued(channel, SURROUND, ppd, scatter).map(|l| l.clamp(LIGHT.0, LIGHT.1)))
            .collect();
        let (width, height) = (channels[0].width, channels[0].height);
        let receptors = |i: usize| match self.0 {
            Receptors::Rgb => times(&RECEPTORS_FROM_RGB, [0, 1, 2].map(|k: usize| retina[k].values[i])),
            Receptors::Luminance => RECEPTORS_FROM_LUMINANCE.map(|w| w * retina[0].values[i]),
        };
        let plane = |value: &(dyn Fn([f64; 3]) -> f64 + Sync)| {
            Plane::by_rows(width, height, |y, row| {
                row.iter_mut().enumerate().for_each(|(x, v)| *v = value(receptors(y * width + x)));
            })
        };
        let adaptation = plane(&|[l, m, _]| l + m);
        let response = plane(&|[l, m, rod]| CONE.at(l) + CONE.at(m) + ROD.at(rod));
        let mean = response.mean();
        let mut bands = Pyramid::of(&response.map(|v| v - mean));
        let levels = bands.levels.len();
        let lowest = &mut bands.levels[levels - 1][0];
        let beyond = beyond.unwrap_or_else(|| lowest.mean());
        let luminance = adaptation.mean();
        // The root of 2 is the authors': "I wish to know why sqrt(2) works better, as it should be 2".
        let lowest_ppd = 2.0 * SQRT_2 * frequency_of(levels - 1, ppd);
        *lowest = continued(lowest, beyond, lowest_ppd, |rho| neural_sensitivity(rho, luminance));
        Seen { bands, adaptation, beyond }
    }
}

/// Cycles a degree of a level, 0 the finest.
fn frequency_of(level: usize, ppd: f64) -> f64 {
    0.5 * ppd * 0.5f64.powi(level as i32)
}

/// The plane, continued to twice its size by `beyond`, after a filter of the cycles a degree.
fn continued(plane: &Plane, beyond: f64, ppd: f64, gain: impl Fn(f64) -> f64 + Sync) -> Plane {
    let (width, height) = (plane.width, plane.height);
    let large = Plane::by_rows(2 * width, 2 * height, |y, row| {
        row.fill(beyond);
        if y < height {
            row[..width].copy_from_slice(plane.row(y));
        }
    });
    let (sx, sy) = (0.5 * ppd / width as f64, 0.5 * ppd / height as f64);
    let found = frequency::filtered(&large, |kx, ky| gain((sx * kx as f64).hypot(sy * ky as f64)));
    Plane::by_rows(width, height, |y, row| row.copy_from_slice(&found.row(y)[..width]))
}

impl PreparedReference for Reference {
    fn compare(&self, test: &EncodedPicture, with_map: bool) -> Result<Comparison, ImageMetricError> {
        let channels = self.metric.channels(test);
        let seen = self.metric.seen(&channels, self.ppd, Some(self.seen.beyond));
        let adaptation = Plane::of_two(&self.seen.adaptation, &seen.adaptation, |a, b| {
            (0.5 * (a + b)).clamp(10f64.powf(eye::LOG_RANGE.0), 10f64.powf(eye::LOG_RANGE.1)).log10()
        });
        let changed = self.changed(&channels);
        let mut visible = seen.bands.clone();
        let count = visible.levels.len();
        let planes = visible.levels.iter().map(Vec::len).sum::<usize>() as f64;
        let (mut quality, mut floor) = (0.0, 0.0);
        for level in 0..count {
            let (width, height) = (visible.levels[level][0].width, visible.levels[level][0].height);
            let noise = Noise::new(level, count, self.ppd, &resized(&adaptation, width, height));
            let mask = Masking::new(&seen.bands, &self.seen.bands, level);
            let changed = resized(&changed, width, height);
            let weight = quality_weight(frequency_of(level, self.ppd)) / planes;
            for orientation in 0..visible.levels[level].len() {
                let (reference, test) =
                    (&self.seen.bands.levels[level][orientation], &seen.bands.levels[level][orientation]);
                let difference = mask.difference(reference, test, orientation, &noise);
                let squares =
                    |y: usize| difference.row(y).iter().zip(changed.row(y)).map(|(d, c)| (d * c).powi(2)).sum::<f64>();
                let size = sum_of_rows(height, squares).sqrt() / (width * height) as f64;
                quality += weight * (size + EPSILON).ln();
                floor += weight * EPSILON.ln();
                let n = mask.norm;
                let exponent = SLOPE / 10f64.powf(LOG_P);
                visible.levels[level][orientation] = difference.map(|d| signed_power(d / n, exponent) * n);
            }
        }
        let map = probability(&visible.picture());
        let detected = map.values.iter().copied().fold(0.0, f64::max);
        let details = vec![
            ("Q_MOS", 100.0 / (1.0 + (LOGISTIC.0 * (quality + LOGISTIC.1)).exp())),
            ("P_det", detected),
            ("P_map_mean", map.mean()),
            ("ppd", self.ppd),
        ];
        let map = with_map.then(|| DifferenceMap {
            width: map.width,
            height: map.height,
            values: map.values.iter().map(|p| *p as f32).collect(),
            white: 1.0,
        });
        Ok(Comparison { distance: (quality - floor).max(0.0), quality, details, map })
    }
}

impl Reference {
    /// 1 where any channel differs by more than a thousandth of the reference, 0 elsewhere.
    fn changed(&self, test: &[Plane]) -> Plane {
        let (width, height) = (self.channels[0].width, self.channels[0].height);
        Plane::by_rows(width, height, |y, row| {
            for (x, changed) in row.iter_mut().enumerate() {
                let i = y * width + x;
                let differs = |(a, b): (&Plane, &Plane)| (b.values[i] - a.values[i]).abs() / a.values[i] > 0.001;
                *changed = f64::from(u8::from(self.channels.iter().zip(test).any(differs)));
            }
        })
    }
}

/// The probability that a difference is seen, of the picture of the visible bands.
fn probability(picture: &Plane) -> Plane {
    let size = picture.map(f64::abs);
    let sum = sum_of_rows(size.height, |y| size.row(y).iter().sum());
    let largest = size.values.iter().copied().fold(0.0, f64::max);
    let pooled = sum / (largest + EPSILON);
    size.map(|s| 1.0 - (0.5f64.ln() * pooled * s).exp())
}

/// The weight of a band in Q; between the calibrated frequencies, linear.
fn quality_weight(frequency: f64) -> f64 {
    let frequency = frequency.clamp(QUALITY[6].0, QUALITY[0].0);
    let i = QUALITY.iter().skip(1).position(|(f, _)| frequency >= *f).unwrap_or(5);
    let ((high, a), (low, b)) = (QUALITY[i], QUALITY[i + 1]);
    b + (frequency - low) / (high - low) * (a - b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_linear_between_bands() {
        assert_eq!(quality_weight(60.0), 0.2832);
        assert!((quality_weight(11.25) - 0.2487).abs() < 1e-12);
        assert!((quality_weight(1.875) - 0.0398).abs() < 1e-12);
        assert!((quality_weight(0.1) - 0.0002).abs() < 1e-12);
    }
}
