//! HDR-FLIP: FLIP at every exposure at which a person may look at the pictures, the largest error of each pixel counting.
//!
//!   HDR-FLIP(x) = max over i = 0..n-1 of FLIP(t(2^e_i reference), t(2^e_i test))(x),  e_i = start + i (stop - start)/(n - 1)
//!
//! t: the ACES curve (0.9036 x^2 + 0.018 x)/(0.8748 x^2 + 0.354 x + 0.14), held to 0..1. With x* where t(x*) = 0.85:
//! start = log2(x*/largest luminance), stop = log2(x*/median luminance) of the reference, n = max(2, ceil(stop - start)).
//!
//! Source: Andersson, Nilsson, Shirley and Akenine-Moller 2021 (doi:10.2312/sr.20211308), with the choices of the authors' program
//! (version 1.7): light in units of 100 cd/m2, luminance of BT.709, the value in the middle of the sorted ones as the median.
//!
//! Display: any, of a low dynamic range, on which the picture is looked at at several exposures. Blind to: whether anyone would see a
//! highlight and a shadow at once. Undefined where half of the reference is black.

use super::colour::{LUMA_REC709, dot};
use super::contract::{
    Comparison, Conditions, ImageMetric, ImageMetricError, Need, PreparedReference, PreparedResult, Properties,
};
use super::flip::{Filters, PPD, Seen, all_light, map_of};
use super::plane::Plane;
use crate::picture::{EncodedPicture, Encoding, MOST_PIXELS};

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// Light of 1, cd/m2.
const UNIT: f64 = 100.0;

/// The curve of ACES: coefficients of x^2, x and 1 above and below the line. 0.6 takes back the exposure of its author.
const ABOVE: [f64; 3] = [0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0];
const BELOW: [f64; 3] = [0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14];

/// Value of the curve that the largest and the median luminance are brought to.
const ANCHOR: f64 = 0.85;

fn tone(x: f64) -> f64 {
    let at = |c: &[f64; 3]| (c[0] * x + c[1]) * x + c[2];
    (at(&ABOVE) / at(&BELOW)).clamp(0.0, 1.0)
}

/// The light that [`tone`] brings to [`ANCHOR`]: the larger root.
fn anchor() -> f64 {
    let [a, b, c]: [f64; 3] = std::array::from_fn(|k| ABOVE[k] - ANCHOR * BELOW[k]);
    let half = -0.5 * b / a;
    half + (half * half - c / a).sqrt()
}

/// HDR-FLIP.
#[derive(Clone, Copy, Debug)]
pub struct HdrFlip;

impl ImageMetric for HdrFlip {
    fn name(&self) -> &'static str {
        "hdr-flip"
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        Properties {
            encodings: &[Encoding::Linear],
            most_pixels: MOST_PIXELS / 4,
            needs: vec![Need::Ppd(PPD)],
            ..Properties::new("mean HDR-FLIP error", "1, 0 to 1", "Andersson et al. 2021, doi:10.2312/sr.20211308")
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, conditions: &Conditions) -> PreparedResult {
        let light = all_light(reference);
        let exposures = Exposures::of(&light)
            .map_err(|reason| ImageMetricError::Undefined { metric: self.name(), reason: reason.to_owned() })?;
        let filters = Filters::new(conditions.ppd.unwrap_or(PPD));
        Ok(Box::new(Reference { filters, light, exposures }))
    }
}

/// The exposures, in stops.
#[derive(Clone, Copy, Debug)]
struct Exposures {
    start: f64,
    stop: f64,
    count: usize,
}

impl Exposures {
    /// Those of a reference.
    fn of(light: &[[f64; 3]]) -> Result<Self, &'static str> {
        let mut luminance: Vec<f64> = light.iter().map(|c| dot(&LUMA_REC709, *c) / UNIT).collect();
        let largest = luminance.iter().copied().fold(0.0, f64::max);
        let middle = luminance.len() / 2;
        let median = *luminance.select_nth_unstable_by(middle, f64::total_cmp).1;
        if median <= 0.0 {
            return Err("half of the reference's pixels or more are black, and their median sets the longest exposure");
        }
        let (start, stop) = ((anchor() / largest).log2(), (anchor() / median).log2());
        Ok(Self { start, stop, count: (stop - start).ceil().max(2.0) as usize })
    }

    fn at(self, i: usize) -> f64 {
        (self.start + i as f64 * (self.stop - self.start) / (self.count - 1) as f64).exp2()
    }
}

struct Reference {
    filters: Filters,
    light: Vec<[f64; 3]>,
    exposures: Exposures,
}

impl PreparedReference for Reference {
    fn compare(&self, test: &EncodedPicture, with_map: bool) -> Result<Comparison, ImageMetricError> {
        let test_light = all_light(test);
        let seen = |light: &[[f64; 3]], exposure: f64| {
            let toned: Vec<[f64; 3]> = light.iter().map(|c| c.map(|v| tone(exposure * v / UNIT))).collect();
            Seen::new(&toned, test.width(), &self.filters)
        };
        let error = |i: usize| {
            let exposure = self.exposures.at(i);
            seen(&self.light, exposure).difference(&seen(&test_light, exposure))
        };
        let mut worst = error(0);
        for i in 1..self.exposures.count {
            worst = Plane::of_two(&worst, &error(i), f64::max);
        }
        let quality = worst.mean();
        let Exposures { start, stop, count } = self.exposures;
        let details = vec![("start_exposure", start), ("stop_exposure", stop), ("exposures", count as f64)];
        Ok(Comparison { distance: quality, quality, details, map: with_map.then(|| map_of(&worst)) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_anchor_is_on_the_curve() {
        assert!((tone(anchor()) - ANCHOR).abs() < 1e-12);
    }

    /// A median four stops below the largest value: the exposures span four stops.
    #[test]
    fn exposures_span_from_the_largest_to_the_median() {
        let mut light = vec![[100.0; 3]; 5];
        light[3] = [1600.0; 3];
        let found = Exposures::of(&light).expect("lit");
        assert!((found.stop - found.start - 4.0).abs() < 1e-12, "{found:?}");
        assert_eq!(found.count, 4);
        assert!(Exposures::of(&[[0.0; 3], [0.0; 3], [1.0; 3]]).is_err());
        assert_eq!(Exposures::of(&[[3.0; 3]]).expect("lit").count, 2);
    }
}
