//! What a viewer of a display compares: pictures within the range of a screen, their overall and peak brightness.
//!
//! With x the linear RGB radiance of a pixel and Y its luminance,
//!
//!   s = x / (1 + x^6)^(1/6),   v = 100 ((s + 0.003)^(1/2.2) - 0.003^(1/2.2)) for each channel,
//!
//! a screen that saturates without a corner; L = (0.2126, 0.7152, 0.0722) . v; A the reference, B the candidate, w the weight of a
//! pixel, p = sqrt(variance of L_A + 1), q the same of B:
//!
//! * `lin`: ln((mean Y_B + 0.01) / (mean Y_A + 0.01));
//! * `max`: ln of the ratio of (mean (Y + 0.01)^6)^(1/6), a mean that the brightest pixels rule;
//! * `rms`: sqrt(mean of (v_B - v_A)^2 over pixels and channels + 0.5^2) - 0.5, the plain norm without the two 0.5;
//! * `mean`: the mean of v_B - v_A;
//! * `corr`: disagreement of L ([`super::smooth`]) with the constant 9; `std`: ln(q / p).
//!
//! The log space of [`super::picture`] weighs a tenfold highlight as much as a tenfold shadow; a screen shows neither beyond its
//! range, and people rated what screens showed. Source: the power law of IEC 61966-2-1 in its simple form. Cost: 2,364 powers a picture.

use super::frame::Frame;
use super::smooth::{disagreement, disagreement_slopes, soft, soft_slope, spread, weighted_mean};
use crate::math::Rgb;
use crate::math::color::{LUMINANCE_REC709, luminance};

const FLOOR: f64 = 0.01;
const GAMMA: f64 = 2.2;
/// Added under the power law, whose slope at 0 is infinite.
const TOE: f64 = 0.003;
const STABILISER: f64 = 9.0;
/// Width of the rounding of the root mean square, percent of the screen.
const WIDTH: f64 = 0.5;

/// Numbers a pair: those of [`super::names::DISPLAY`], then the plain root mean square.
pub(super) const DISPLAYED: usize = 7;

/// A picture as a screen shows it.
#[derive(Debug, Clone)]
pub(super) struct Displayed {
    /// v of each pixel, percent.
    shown: Vec<Rgb>,
    lightness: Vec<f64>,
    mean: f64,
    /// sqrt(variance + 1) of the lightness.
    spread: f64,
    /// Mean of Y + 0.01, and its mean of sixth powers.
    brightness: [f64; 2],
}

fn sixth_power(x: f64) -> f64 {
    let square = x * x;
    square * (square * square)
}

/// (1 + x^6)^(-1/6), and s.
fn saturated(x: f64) -> (f64, f64) {
    if x <= 1.0 {
        let factor = 1.0 / (1.0 + sixth_power(x)).sqrt().cbrt();
        (factor, x * factor)
    } else {
        // The same, without powers of large numbers.
        let s = 1.0 / (1.0 + sixth_power(x.recip())).sqrt().cbrt();
        (s / x, s)
    }
}

/// v of a radiance.
fn shown(x: f64) -> f64 {
    100.0 * ((saturated(x).1 + TOE).powf(1.0 / GAMMA) - TOE.powf(1.0 / GAMMA))
}

/// Derivative of [`shown`], from x and v.
fn shown_slope(x: f64, v: f64) -> f64 {
    let (factor, s) = saturated(x);
    let power = v / 100.0 + TOE.powf(1.0 / GAMMA);
    100.0 / GAMMA * power / (s + TOE) * factor.powi(7)
}

/// (sum w y^6)^(1/6) of positive numbers, free of overflow.
fn sixth_power_mean(weights: &[f64], values: impl Iterator<Item = f64> + Clone) -> f64 {
    let top = values.clone().fold(0.0, f64::max);
    top * weighted_mean(weights, values.map(|y| sixth_power(y / top))).sqrt().cbrt()
}

impl Displayed {
    /// From the linear RGB radiance of the pixels of the frame.
    pub fn new(frame: &Frame, radiance: &[Rgb]) -> Self {
        let w = frame.weights();
        let shown: Vec<Rgb> = radiance.iter().map(|c| c.map(shown)).collect();
        let lightness: Vec<f64> = shown.iter().map(|v| luminance(*v)).collect();
        let mean = weighted_mean(w, lightness.iter().copied());
        let variance = weighted_mean(w, lightness.iter().map(|l| (l - mean) * (l - mean)));
        let light = radiance.iter().map(|c| luminance(*c) + FLOOR);
        let brightness = [weighted_mean(w, light.clone()), sixth_power_mean(w, light)];
        Self { shown, lightness, mean, spread: spread(variance), brightness }
    }
}

/// Mean square over pixels and channels of v_B - v_A; mean and variance of the difference of L.
fn moments(frame: &Frame, a: &Displayed, b: &Displayed) -> (f64, f64, f64) {
    let w = frame.weights();
    let squares = a.shown.iter().zip(&b.shown).map(|(a, b)| (0..3).map(|c| (b[c] - a[c]) * (b[c] - a[c])).sum::<f64>());
    let d = || a.lightness.iter().zip(&b.lightness).map(|(a, b)| b - a);
    let shift = weighted_mean(w, d());
    (weighted_mean(w, squares) / 3.0, shift, weighted_mean(w, d().map(|d| (d - shift) * (d - shift))))
}

/// The descriptors of candidate `b` against reference `a`, in the order of [`super::names::DISPLAY`], then the plain root mean square;
/// all exactly 0 for equal pictures.
pub(super) fn compare(frame: &Frame, a: &Displayed, b: &Displayed) -> [f64; DISPLAYED] {
    let (square, _, variance) = moments(frame, a, b);
    let signed = a.shown.iter().zip(&b.shown).map(|(a, b)| (0..3).map(|c| b[c] - a[c]).sum::<f64>());
    [
        (b.brightness[0] / a.brightness[0]).ln(),
        (b.brightness[1] / a.brightness[1]).ln(),
        soft(square, WIDTH),
        weighted_mean(frame.weights(), signed) / 3.0,
        disagreement(a.spread, b.spread, variance, STABILISER),
        (b.spread / a.spread).ln(),
        soft(square, 0.0),
    ]
}

/// Adds to the slopes by the candidate's radiance those that come through [`compare`].
pub(super) fn add_slopes(
    frame: &Frame,
    a: &Displayed,
    (b, radiance): (&Displayed, &[Rgb]),
    by: &[f64; DISPLAYED],
    to: &mut [Rgb],
) {
    if by.iter().all(|by| *by == 0.0) {
        return;
    }
    let [by_mean_light, by_peak, by_rms, by_mean, by_corr, by_std, by_plain] = *by;
    let (square, shift, variance) = moments(frame, a, b);
    let by_square = (by_rms * soft_slope(square, WIDTH) + by_plain * soft_slope(square, 0.0)) / 3.0;
    let [by_b, by_difference] = disagreement_slopes(a.spread, b.spread, variance, STABILISER);
    let by_variance = by_corr * by_b + 0.5 * by_std / (b.spread * b.spread);
    let by_mean_light = by_mean_light / b.brightness[0];
    for (i, w) in frame.weights().iter().enumerate() {
        let x = radiance[i];
        let l = b.lightness[i];
        let by_l = 2.0 * (by_variance * (l - b.mean) + by_corr * by_difference * (l - a.lightness[i] - shift));
        let relative = (luminance(x) + FLOOR) / b.brightness[1];
        let by_y = by_mean_light + by_peak * relative.powi(5) / b.brightness[1];
        for c in 0..3 {
            let d = b.shown[i][c] - a.shown[i][c];
            let by_v = by_square * d + by_mean / 3.0 + by_l * LUMINANCE_REC709[c];
            to[i][c] += w * (by_v * shown_slope(x[c], b.shown[i][c]) + by_y * LUMINANCE_REC709[c]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_screen_shows_what_it_can_and_its_slope_is_exact() {
        // Far below saturation the power law, with its toe; far above, white.
        assert_eq!(shown(0.0), 0.0);
        assert!((shown(0.2) - 100.0 * (0.203f64.powf(1.0 / 2.2) - TOE.powf(1.0 / 2.2))).abs() < 1e-2);
        assert!((shown(1e300) - shown(1e4)).abs() < 1e-9 && (shown(1e4) - 93.0).abs() < 1.0);
        for x in [1e-4, 0.3, 0.999, 1.001, 4.0] {
            let h = 1e-6 * x;
            let expected = (shown(x + h) - shown(x - h)) / (2.0 * h);
            assert!((shown_slope(x, shown(x)) / expected - 1.0).abs() < 1e-6, "{x}");
        }
        assert!(shown_slope(0.0, 0.0).is_finite() && shown_slope(1e300, shown(1e300)) == 0.0);
    }

    #[test]
    fn the_brightest_rule_a_mean_of_sixth_powers() {
        let mean = |values: [f64; 2]| sixth_power_mean(&[0.99, 0.01], values.into_iter());
        assert!((mean([0.3, 0.3]) - 0.3).abs() < 1e-12);
        assert!((mean([0.01, 100.0]) - 100.0 * 0.01f64.powf(1.0 / 6.0)).abs() < 1e-9);
        assert!(mean([1e300, 1e300]).is_finite());
    }
}
