//! Norms of the difference of two pictures, rounded off at 0 or plain.
//!
//! With d = B - A, A the reference, B the candidate, e = |(dL, dc1, dc2)|, w the weight of a pixel and soft(x) that of
//! [`super::smooth`] with a width D (0.5, in the unit of L; 0 for the plain norm):
//!
//!   dE = sum w soft(e);  dE4 = (sum w e^4 + D^4)^(1/4) - D;  adL = sum w soft(dL);  dC = sum w soft(|(dc1, dc2)|);
//!   mC = soft(|(sum w dc1, sum w dc2)|);  rms0 = soft(deviation of dL);
//!   localmean3 = mean over windows of soft(difference of the window means at scale 3);
//!   w1 = 6 sum_t soft(F_B(t) - F_A(t)), F the soft distribution function of L, width 0.02.
//!
//! Each plain norm is a pseudo-metric on BRDFs: a norm of a difference of things that depend on one BRDF each. Its slope is taken
//! as 0 where it or the difference in it is 0.

use super::frame::Frame;
use super::picture::{Picture, PictureSlopes, STEP};
use super::smooth::{mean, soft, soft_fourth_root, soft_fourth_root_slope, soft_slope, weighted_mean};

/// Width of the rounding in units of L and chroma.
pub(super) const WIDTH: f64 = 0.5;
/// Width of the rounding of a difference of distribution functions.
pub(super) const DISTRIBUTION_WIDTH: f64 = 0.02;

/// dE, dE4, adL, dC, mC, rms0, localmean3.
pub(super) type Norms = [f64; 7];

fn lightness<'a>(a: &'a Picture, b: &'a Picture) -> impl Iterator<Item = f64> + 'a {
    a.lightness.iter().zip(&b.lightness).map(|(a, b)| b - a)
}

fn chroma<'a>(a: &'a Picture, b: &'a Picture) -> impl Iterator<Item = [f64; 2]> + 'a {
    a.chroma.iter().zip(&b.chroma).map(|(a, b)| [b[0] - a[0], b[1] - a[1]])
}

fn square(c: [f64; 2]) -> f64 {
    c[0] * c[0] + c[1] * c[1]
}

/// Mean over the shape of dL and of (dc1, dc2), and variance of dL.
fn moments(frame: &Frame, a: &Picture, b: &Picture) -> (f64, [f64; 2], f64) {
    let w = frame.weights();
    let shift = weighted_mean(w, lightness(a, b));
    let colour = [0, 1].map(|k| weighted_mean(w, chroma(a, b).map(|c| c[k])));
    (shift, colour, weighted_mean(w, lightness(a, b).map(|l| (l - shift) * (l - shift))))
}

/// The norms of candidate `b` minus reference `a`, rounded off over `width`.
pub(super) fn norms(frame: &Frame, a: &Picture, b: &Picture, width: f64) -> Norms {
    let w = frame.weights();
    let (_, colour, variance) = moments(frame, a, b);
    let mut sums = [0.0; 4];
    for ((w, l), c) in w.iter().zip(lightness(a, b)).zip(chroma(a, b)) {
        let e2 = l * l + square(c);
        let terms = [soft(e2, width), e2 * e2, soft(l * l, width), soft(square(c), width)];
        sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += w * term);
    }
    let windows = a.coarsest.iter().zip(&b.coarsest).map(|(a, b)| soft((b - a) * (b - a), width));
    [
        sums[0],
        soft_fourth_root(sums[1], width),
        sums[2],
        sums[3],
        soft(square(colour), width),
        soft(variance, width),
        mean(windows),
    ]
}

/// Adds to the slopes by candidate `b` those that come through [`norms`].
pub(super) fn add_norm_slopes(frame: &Frame, a: &Picture, b: &Picture, width: f64, by: &Norms, to: &mut PictureSlopes) {
    if by.iter().all(|by| *by == 0.0) {
        return;
    }
    let [by_e, by_e4, by_l, by_c, by_colour, by_variance, by_windows] = *by;
    let w = frame.weights();
    let (shift, colour, variance) = moments(frame, a, b);
    let fourth = weighted_mean(w, lightness(a, b).zip(chroma(a, b)).map(|(l, c)| (l * l + square(c)).powi(2)));
    let by_fourth = 4.0 * by_e4 * soft_fourth_root_slope(fourth, width);
    let by_colour = colour.map(|c| by_colour * c * soft_slope(square(colour), width));
    let by_variance = by_variance * soft_slope(variance, width);
    let pixels = w.iter().zip(lightness(a, b)).zip(chroma(a, b));
    for (i, ((w, l), c)) in pixels.enumerate() {
        let e2 = l * l + square(c);
        let of_vector = by_e * soft_slope(e2, width) + by_fourth * e2;
        to.lightness[i] += w * (l * (of_vector + by_l * soft_slope(l * l, width)) + (l - shift) * by_variance);
        let of_chroma = of_vector + by_c * soft_slope(square(c), width);
        (0..2).for_each(|k| to.chroma[i][k] += w * (c[k] * of_chroma + by_colour[k]));
    }
    let share = by_windows / b.coarsest.len().max(1) as f64;
    for ((to, a), b) in to.coarsest.iter_mut().zip(&a.coarsest).zip(&b.coarsest) {
        *to += share * (b - a) * soft_slope((b - a) * (b - a), width);
    }
}

/// Distance of the soft distribution functions, rounded off over `width`.
pub(super) fn distribution_distance(a: &Picture, b: &Picture, width: f64) -> f64 {
    let levels = a.distribution.iter().zip(&b.distribution);
    STEP * levels.map(|(a, b)| soft((b - a) * (b - a), width)).sum::<f64>()
}

/// Adds to the slopes by candidate `b` those that come through [`distribution_distance`].
pub(super) fn add_distribution_distance_slopes(a: &Picture, b: &Picture, width: f64, by: f64, to: &mut PictureSlopes) {
    for ((to, a), b) in to.distribution.iter_mut().zip(&a.distribution).zip(&b.distribution) {
        *to += by * STEP * (b - a) * soft_slope((b - a) * (b - a), width);
    }
}
