//! What a viewer of a display compares: pictures clipped to the range of a screen, their overall and peak brightness.
//!
//! With x the linear RGB radiance of a pixel, v = clip(x, 0, 1)^(1/2.2) for each channel, L = 100 (0.2126, 0.7152, 0.0722) . v,
//! A the reference, B the candidate, w the weight of a pixel, s and cov the weighted deviations and covariance of L:
//!
//! * `lin`: ln((mean Y_B + 0.01) / (mean Y_A + 0.01)), Y the luminance of x;
//! * `max`: the same for the mean of the brightest hundredth of the shape;
//! * `rms`: root of the mean of (100 (v_B - v_A))^2 over pixels and channels; `mean`: the mean of 100 (v_B - v_A);
//! * `corr`: 1 - (cov + 9) / (s_A s_B + 9); `std`: ln((s_B + 1) / (s_A + 1)).
//!
//! The log space of [`super::picture`] weighs a tenfold highlight as much as a tenfold shadow; a screen shows neither
//! beyond its range, and people rated what screens showed. Source: the power law of IEC 61966-2-1 in its simple form; the
//! stabilised correlation of Wang et al. 2004, doi:10.1109/TIP.2003.819861. Cost: a pass over the pixels.

use crate::descriptor::frame::Frame;
use crate::math::Rgb;
use crate::math::color::{LUMINANCE_REC709, luminance};

const FLOOR: f64 = 0.01;
const GAMMA: f64 = 2.2;
/// Of the shape: the share that counts as its brightest.
const BRIGHTEST: f64 = 0.01;
const STABILISER: f64 = 9.0;

/// A picture as a screen shows it.
#[derive(Debug, Clone)]
pub(super) struct Displayed {
    /// 100 v of each pixel.
    shown: Vec<Rgb>,
    lightness: Vec<f64>,
    mean: f64,
    variance: f64,
    /// ln(mean Y + 0.01) over the shape, and over its brightest part.
    brightness: [f64; 2],
}

impl Displayed {
    /// From the linear RGB radiance of the pixels of the frame.
    pub(super) fn new(frame: &Frame, radiance: &[Rgb]) -> Self {
        let w = frame.weights();
        let shown: Vec<Rgb> = radiance.iter().map(|c| c.map(|x| 100.0 * x.clamp(0.0, 1.0).powf(1.0 / GAMMA))).collect();
        let lightness: Vec<f64> =
            shown.iter().map(|v| v.iter().zip(LUMINANCE_REC709).map(|(v, l)| v * l).sum()).collect();
        let weighted = |f: &dyn Fn(usize) -> f64| -> f64 { w.iter().enumerate().map(|(i, w)| w * f(i)).sum() };
        let mean = weighted(&|i| lightness[i]);
        let variance = weighted(&|i| (lightness[i] - mean).powi(2));
        let light: Vec<f64> = radiance.iter().map(|c| luminance(*c)).collect();
        let brightness = [weighted(&|i| light[i]), brightest(w, &light)].map(|y| (y + FLOOR).ln());
        Self { shown, lightness, mean, variance, brightness }
    }

    /// The descriptors of candidate `b` against reference `a`, in the order of [`crate::descriptor::names::DISPLAY`]; 0 for equal pictures.
    pub(super) fn difference(frame: &Frame, a: &Self, b: &Self) -> [f64; 6] {
        let (mut squares, mut signed, mut covariance) = (0.0, 0.0, 0.0);
        for (i, w) in frame.weights().iter().enumerate() {
            let d: Rgb = std::array::from_fn(|c| b.shown[i][c] - a.shown[i][c]);
            squares += w * d.iter().map(|d| d * d).sum::<f64>() / 3.0;
            signed += w * d.iter().sum::<f64>() / 3.0;
            // Multiplied in the order of the variance: exactly equal to it for equal pictures.
            covariance += w * ((a.lightness[i] - a.mean) * (b.lightness[i] - b.mean));
        }
        // The root of a product of variances, not the product of roots: exact where they are equal.
        let product = (a.variance * b.variance).sqrt();
        [
            b.brightness[0] - a.brightness[0],
            b.brightness[1] - a.brightness[1],
            squares.sqrt(),
            signed,
            (product - covariance) / (product + STABILISER),
            ((b.variance.sqrt() + 1.0) / (a.variance.sqrt() + 1.0)).ln(),
        ]
    }
}

/// Mean of the largest values that make up the brightest share of the weight.
fn brightest(weights: &[f64], values: &[f64]) -> f64 {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    let (mut sum, mut left) = (0.0, BRIGHTEST);
    for i in order {
        let share = weights[i].min(left);
        sum += share * values[i];
        left -= share;
        if left <= 0.0 {
            break;
        }
    }
    sum / BRIGHTEST
}
