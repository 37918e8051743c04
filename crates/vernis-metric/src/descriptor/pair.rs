//! What a viewer would compare in two pictures of a shape.
//!
//! A is the reference, B the candidate, d = B - A; pictures and their parts as in [`super::picture`], s the weighted deviation of L,
//! p = sqrt(s_A^2 + 1), q = sqrt(s_B^2 + 1):
//!
//! * the norms of [`super::norms`];
//! * `sL`: sum w dL; `sStd`: ln(q / p);
//! * `corr`: disagreement of L over the shape with the constant 1, `struct0` and `contrast0`: means over the windows of scale 0 of
//!   disagreement and contrast with the constant 9, all three as in [`super::smooth`];
//! * `q0-15 q16-47 q48-59 q60-63`: differences of the soft quantiles;
//! * `localstd0 localstd2`: difference of ln(mean over windows of sqrt(s^2 + 0.25)) at scales 0 and 2.
//!
//! All are exactly 0 for equal pictures and have a derivative by the candidate everywhere. Cost: about 40 microseconds a pair and light.

use super::frame::Frame;
use super::names::LIGHTS;
use super::norms::{
    DISTRIBUTION_WIDTH, Norms, WIDTH, add_distribution_distance_slopes, add_norm_slopes, distribution_distance, norms,
};
use super::picture::{Picture, PictureSlopes};
use super::smooth::{contrast, contrast_slope, disagreement, disagreement_slopes, spread, weighted_mean};

/// Constants of the agreement over the shape, and over a window.
const WHOLE: f64 = 1.0;
const WINDOW: f64 = 9.0;

/// Numbers a pair: those of [`LIGHTS`], then `w1`.
pub(super) const PAIR: usize = LIGHTS.len() + 1;
/// Plain norms a pair: [`Norms`], then `w1`.
pub(super) const PLAIN: usize = 8;
/// Names of the plain norms.
pub(super) const PLAIN_NAMES: [&str; PLAIN] = ["dE", "dE4", "adL", "dC", "mC", "rms0", "localmean3", "w1"];

/// Variance of dL over the shape.
fn difference_variance(frame: &Frame, a: &Picture, b: &Picture) -> (f64, f64) {
    let w = frame.weights();
    let d = || a.lightness.iter().zip(&b.lightness).map(|(a, b)| b - a);
    let shift = weighted_mean(w, d());
    (shift, weighted_mean(w, d().map(|d| (d - shift) * (d - shift))))
}

/// Variance of dL in every window of scale 0.
fn window_variances(frame: &Frame, a: &Picture, b: &Picture) -> Vec<f64> {
    let level = &frame.levels[0];
    let squares = a.fine.image.iter().zip(&b.fine.image).map(|(a, b)| (b - a) * (b - a));
    let mut out = level.window_means(&level.cover(squares));
    for ((out, a), b) in out.iter_mut().zip(&a.fine.mean).zip(&b.fine.mean) {
        *out -= (b - a) * (b - a);
    }
    out
}

/// The descriptors of candidate `b` against reference `a`: those of [`LIGHTS`] in order, then `w1`.
pub(super) fn compare(frame: &Frame, a: &Picture, b: &Picture) -> [f64; PAIR] {
    let [e, e4, absolute, chroma, colour, rms, local_mean] = norms(frame, a, b, WIDTH);
    let (shift, variance) = difference_variance(frame, a, b);
    let (mut structure, mut contrasts) = (0.0, 0.0);
    let of_difference = window_variances(frame, a, b);
    for ((va, vb), v) in a.fine.variance.iter().zip(&b.fine.variance).zip(&of_difference) {
        let (p, q) = (spread(*va), spread(*vb));
        structure += disagreement(p, q, *v, WINDOW);
        contrasts += contrast(p, q, WINDOW);
    }
    let windows = of_difference.len().max(1) as f64;
    let quantile = |k: usize| b.quantiles[k] - a.quantiles[k];
    [
        e,
        e4,
        absolute,
        chroma,
        shift,
        colour,
        (b.spread / a.spread).ln(),
        disagreement(a.spread, b.spread, variance, WHOLE),
        rms,
        quantile(0),
        quantile(1),
        quantile(2),
        quantile(3),
        structure / windows,
        contrasts / windows,
        b.log_deviation[0] - a.log_deviation[0],
        b.log_deviation[1] - a.log_deviation[1],
        local_mean,
        distribution_distance(a, b, DISTRIBUTION_WIDTH),
    ]
}

/// The plain norms, in the order of [`PLAIN_NAMES`].
pub(super) fn compare_plainly(frame: &Frame, a: &Picture, b: &Picture) -> [f64; PLAIN] {
    let [e, e4, absolute, chroma, colour, rms, local_mean] = norms(frame, a, b, 0.0);
    [e, e4, absolute, chroma, colour, rms, local_mean, distribution_distance(a, b, 0.0)]
}

/// The slopes by the candidate's picture, from those by [`compare`] and by [`compare_plainly`].
pub(super) fn transpose(
    frame: &Frame,
    a: &Picture,
    b: &Picture,
    by: &[f64; PAIR],
    by_plain: &[f64; PLAIN],
) -> PictureSlopes {
    let mut to = PictureSlopes::zero(b);
    let [e, e4, absolute, chroma, shift, colour, deviation, decorrelation, rms, q0, q1, q2, q3, rest @ ..] = *by;
    let [structure, contrasts, local0, local2, local_mean, w1] = rest;
    let soft: Norms = [e, e4, absolute, chroma, colour, rms, local_mean];
    add_norm_slopes(frame, a, b, WIDTH, &soft, &mut to);
    add_distribution_distance_slopes(a, b, DISTRIBUTION_WIDTH, w1, &mut to);
    let [plain @ .., plain_w1] = *by_plain;
    add_norm_slopes(frame, a, b, 0.0, &plain, &mut to);
    add_distribution_distance_slopes(a, b, 0.0, plain_w1, &mut to);
    to.quantiles = [q0, q1, q2, q3];
    to.log_deviation = [local0, local2];

    // Over the shape: through the mean of dL, the variance of L, and the variance of dL.
    let (mean_shift, variance) = difference_variance(frame, a, b);
    let [by_b, by_difference] = disagreement_slopes(a.spread, b.spread, variance, WHOLE);
    let by_variance = decorrelation * by_b + 0.5 * deviation / (b.spread * b.spread);
    for (i, w) in frame.weights().iter().enumerate() {
        let l = b.lightness[i];
        let centred = l - a.lightness[i] - mean_shift;
        to.lightness[i] +=
            w * (shift + 2.0 * by_variance * (l - b.mean) + 2.0 * decorrelation * by_difference * centred);
    }
    if structure != 0.0 || contrasts != 0.0 {
        add_window_slopes(frame, a, b, [structure, contrasts], &mut to);
    }
    to
}

fn add_window_slopes(frame: &Frame, a: &Picture, b: &Picture, by: [f64; 2], to: &mut PictureSlopes) {
    let of_difference = window_variances(frame, a, b);
    let [structure, contrasts] = by.map(|by| by / of_difference.len().max(1) as f64);
    let mut by_difference = vec![0.0; of_difference.len()];
    for (i, v) in of_difference.iter().enumerate() {
        let (p, q) = (spread(a.fine.variance[i]), spread(b.fine.variance[i]));
        let [by_b, by_v] = disagreement_slopes(p, q, *v, WINDOW);
        to.fine_variance[i] += structure * by_b + contrasts * contrast_slope(p, q, WINDOW);
        by_difference[i] = structure * by_v;
    }
    let level = &frame.levels[0];
    let mut through = vec![0.0; b.fine.image.len()];
    level.add_transposed(by_difference.iter().copied(), &mut through);
    for ((to, by), (a, b)) in to.fine.iter_mut().zip(through).zip(a.fine.image.iter().zip(&b.fine.image)) {
        *to += 2.0 * (b - a) * by;
    }
    let means = a.fine.mean.iter().zip(&b.fine.mean);
    let by_mean = by_difference.iter().zip(means).map(|(by, (a, b))| -2.0 * (b - a) * by);
    level.add_transposed(by_mean, &mut to.fine);
}
