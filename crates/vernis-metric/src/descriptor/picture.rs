//! A picture of a shape in an opponent log space, with everything that comparing it needs, and the way back to its radiance.
//!
//!   Y = 0.2126 R + 0.7152 G + 0.0722 B; L = 20 ln(Y + 0.01); c1 = 20 ln((R + 0.01) / (G + 0.01)); c2 = 20 ln((B + 0.01) / (G + 0.01)).
//!
//! With w the weight of a pixel (the share of the shape with that normal):
//!
//! * soft quantiles (1/beta) ln sum w exp(beta L) for beta = -0.08, -0.025, 0.03, 0.12: means of L that lean towards the dark or the
//!   bright pixels, in place of the darkest quarter, the middle half, the bright fifth and the brightest sixteenth;
//! * the soft distribution function F(t) = sum w / (1 + exp((L - t) / 3)) at 26 levels t from -92 to 58;
//! * local moments of L over the windows of [`super::frame`], at scales 0, 2 and 3; ln of the mean of sqrt(s^2 + 0.25) over windows.
//!
//! Cost: about 150 microseconds a picture, as much again for the way back.

use super::frame::{Frame, Level};
use super::smooth::{mean, spread, weighted_mean};
use crate::light::shape::SIDE;
use crate::math::Rgb;
use crate::math::color::{LUMINANCE_REC709, luminance};

const GAIN: f64 = 20.0;
const FLOOR: f64 = 0.01;
/// beta of the soft quantiles, from the darkest to the brightest.
const LEANINGS: [f64; 4] = [-0.08, -0.025, 0.03, 0.12];
/// Levels of the soft distribution function.
pub(super) const LEVELS: usize = 26;
/// The lowest level, and the distance of two.
const LOWEST: f64 = -92.0;
pub(super) const STEP: f64 = 6.0;
/// How far a level is blurred.
const BLUR: f64 = STEP / 2.0;
/// Added to a local variance, so that its root has a slope in flat windows.
const LOCAL_FLOOR: f64 = 0.25;
/// Scale whose windows give the coarse local deviation, and the one that gives the local means.
const COARSE: usize = 2;
const COARSEST: usize = 3;

/// A scale of the pyramid: L, 0 off the disc, with mean and variance in each window.
#[derive(Debug, Clone)]
pub(super) struct Local {
    pub image: Vec<f64>,
    pub mean: Vec<f64>,
    pub variance: Vec<f64>,
}

impl Local {
    fn new(level: &Level, image: Vec<f64>) -> Self {
        let mean = level.window_means(&level.cover(image.iter().copied()));
        let squares = level.window_means(&level.cover(image.iter().map(|l| l * l)));
        let variance = squares.iter().zip(&mean).map(|(s, m)| s - m * m).collect();
        Self { image, mean, variance }
    }

    /// ln of the mean local deviation.
    fn log_deviation(&self) -> f64 {
        mean(self.variance.iter().map(|v| (v + LOCAL_FLOOR).sqrt())).ln()
    }

    /// Adds to the slopes by the image those that come through the variances.
    pub fn add_variances_transposed(&self, level: &Level, by_variance: &[f64], by_image: &mut [f64]) {
        let mut through = vec![0.0; self.image.len()];
        level.add_transposed(by_variance.iter().copied(), &mut through);
        by_image.iter_mut().zip(through).zip(&self.image).for_each(|((to, by), l)| *to += 2.0 * l * by);
        level.add_transposed(by_variance.iter().zip(&self.mean).map(|(by, m)| -2.0 * m * by), by_image);
    }

    /// The slopes by the variances that come through [`Local::log_deviation`].
    fn log_deviation_slopes(&self, by: f64) -> impl Iterator<Item = f64> {
        let sum: f64 = self.variance.iter().map(|v| (v + LOCAL_FLOOR).sqrt()).sum();
        self.variance.iter().map(move |v| by * 0.5 / ((v + LOCAL_FLOOR).sqrt() * sum))
    }
}

/// A picture with everything that comparing it needs.
#[derive(Debug, Clone)]
pub(super) struct Picture {
    pub lightness: Vec<f64>,
    /// c1, c2.
    pub chroma: Vec<[f64; 2]>,
    pub mean: f64,
    /// sqrt(variance + 1) of L.
    pub spread: f64,
    pub quantiles: [f64; 4],
    pub distribution: [f64; LEVELS],
    /// Scales 0 and 2.
    pub fine: Local,
    pub coarse: Local,
    /// ln of the mean local deviation at scales 0 and 2.
    pub log_deviation: [f64; 2],
    /// Window means at scale 3.
    pub coarsest: Vec<f64>,
}

/// The derivative of a number by the parts of a [`Picture`], collected before it is taken back to the radiance.
pub(super) struct PictureSlopes {
    pub lightness: Vec<f64>,
    pub chroma: Vec<[f64; 2]>,
    pub quantiles: [f64; 4],
    pub distribution: [f64; LEVELS],
    /// By L on the grid of scale 0.
    pub fine: Vec<f64>,
    /// By the variance of each window at scale 0.
    pub fine_variance: Vec<f64>,
    pub log_deviation: [f64; 2],
    pub coarsest: Vec<f64>,
}

impl PictureSlopes {
    /// All zero, for a picture like `picture`.
    pub fn zero(picture: &Picture) -> Self {
        Self {
            lightness: vec![0.0; picture.lightness.len()],
            chroma: vec![[0.0; 2]; picture.chroma.len()],
            quantiles: [0.0; 4],
            distribution: [0.0; LEVELS],
            fine: vec![0.0; SIDE * SIDE],
            fine_variance: vec![0.0; picture.fine.variance.len()],
            log_deviation: [0.0; 2],
            coarsest: vec![0.0; picture.coarsest.len()],
        }
    }
}

impl Picture {
    /// From the linear RGB radiance of the pixels of the frame.
    pub fn new(frame: &Frame, radiance: &[Rgb]) -> Self {
        let w = frame.weights();
        let lightness: Vec<f64> = radiance.iter().map(|c| GAIN * (luminance(*c) + FLOOR).ln()).collect();
        let of_pixel = |c: &Rgb| {
            let [r, g, b] = c.map(|v| (v + FLOOR).ln());
            [GAIN * (r - g), GAIN * (b - g)]
        };
        let chroma = radiance.iter().map(of_pixel).collect();
        let mean = weighted_mean(w, lightness.iter().copied());
        let variance = weighted_mean(w, lightness.iter().map(|l| (l - mean) * (l - mean)));
        let mut image = vec![0.0; SIDE * SIDE];
        frame.levels[0].cells.iter().zip(&lightness).for_each(|(&c, l)| image[c] = *l);
        let halved = frame.reduce(1, &image);
        let coarse = Local::new(&frame.levels[COARSE], frame.reduce(COARSE, &halved));
        let coarsest = &frame.levels[COARSEST];
        let fine = Local::new(&frame.levels[0], image);
        Self {
            mean,
            spread: spread(variance),
            quantiles: LEANINGS.map(|beta| soft_quantile(w, &lightness, beta)),
            distribution: distribution(w, &lightness),
            log_deviation: [fine.log_deviation(), coarse.log_deviation()],
            coarsest: coarsest.window_means(&coarsest.cover(frame.reduce(COARSEST, &coarse.image).into_iter())),
            lightness,
            chroma,
            fine,
            coarse,
        }
    }

    /// The slopes by the radiance of every pixel, from those by the parts of this picture.
    pub fn transpose(&self, frame: &Frame, radiance: &[Rgb], mut by: PictureSlopes) -> Vec<Rgb> {
        let w = frame.weights();
        let [fine, coarse, coarsest] = [0, COARSE, COARSEST].map(|scale| &frame.levels[scale]);
        let mut by_coarsest = vec![0.0; coarsest.side * coarsest.side];
        coarsest.add_transposed(by.coarsest.iter().copied(), &mut by_coarsest);
        let mut by_coarse = frame.reduce_transposed(COARSEST, &by_coarsest);
        let by_variance: Vec<f64> = self.coarse.log_deviation_slopes(by.log_deviation[1]).collect();
        self.coarse.add_variances_transposed(coarse, &by_variance, &mut by_coarse);
        let by_image = frame.reduce_transposed(1, &frame.reduce_transposed(COARSE, &by_coarse));
        by.fine.iter_mut().zip(by_image).for_each(|(to, by)| *to += by);
        let of_deviation = self.fine.log_deviation_slopes(by.log_deviation[0]);
        by.fine_variance.iter_mut().zip(of_deviation).for_each(|(to, by)| *to += by);
        self.fine.add_variances_transposed(fine, &by.fine_variance, &mut by.fine);

        fine.cells.iter().zip(&mut by.lightness).for_each(|(&c, to)| *to += by.fine[c]);
        for (beta, slope) in LEANINGS.into_iter().zip(by.quantiles).filter(|(_, slope)| *slope != 0.0) {
            add_soft_quantile_slopes(w, &self.lightness, beta, slope, &mut by.lightness);
        }
        if by.distribution.iter().any(|slope| *slope != 0.0) {
            add_distribution_slopes(w, &self.lightness, &by.distribution, &mut by.lightness);
        }
        let of_pixel = |((c, by_l), by_c): ((&Rgb, &f64), &[f64; 2])| {
            let of_y = GAIN * by_l / (luminance(*c) + FLOOR);
            let of_channel = [by_c[0], -by_c[0] - by_c[1], by_c[1]];
            std::array::from_fn(|k| of_y * LUMINANCE_REC709[k] + GAIN * of_channel[k] / (c[k] + FLOOR))
        };
        radiance.iter().zip(&by.lightness).zip(&by.chroma).map(of_pixel).collect()
    }
}

/// The largest of beta L where a pixel has weight, so that no exponential is too large.
fn largest(weights: &[f64], lightness: &[f64], beta: f64) -> f64 {
    let weighted = weights.iter().zip(lightness).filter(|(w, _)| **w > 0.0);
    weighted.map(|(_, l)| beta * l).fold(f64::NEG_INFINITY, f64::max)
}

/// w exp(beta L - top); a pixel without weight may lie above the top.
fn leaning(weight: f64, exponent: f64) -> f64 {
    if weight > 0.0 { weight * exponent.exp() } else { 0.0 }
}

/// (1/beta) ln sum w exp(beta L).
fn soft_quantile(weights: &[f64], lightness: &[f64], beta: f64) -> f64 {
    let top = largest(weights, lightness, beta);
    let sum: f64 = weights.iter().zip(lightness).map(|(w, l)| leaning(*w, beta * l - top)).sum();
    (top + sum.ln()) / beta
}

fn add_soft_quantile_slopes(weights: &[f64], lightness: &[f64], beta: f64, by: f64, by_lightness: &mut [f64]) {
    let top = largest(weights, lightness, beta);
    let part = |(w, l): (&f64, &f64)| leaning(*w, beta * l - top);
    let sum: f64 = weights.iter().zip(lightness).map(part).sum();
    by_lightness.iter_mut().zip(weights.iter().zip(lightness)).for_each(|(to, at)| *to += by * part(at) / sum);
}

/// exp((L - t) / BLUR) at the lowest level, and the factor to the next.
fn at_lowest(lightness: f64) -> f64 {
    ((lightness - LOWEST) / BLUR).exp()
}

fn distribution(weights: &[f64], lightness: &[f64]) -> [f64; LEVELS] {
    let factor = (-STEP / BLUR).exp();
    let mut sums = [0.0; LEVELS];
    for (w, l) in weights.iter().zip(lightness) {
        let mut z = at_lowest(*l);
        for sum in &mut sums {
            *sum += w / (1.0 + z);
            z *= factor;
        }
    }
    sums
}

fn add_distribution_slopes(weights: &[f64], lightness: &[f64], by: &[f64; LEVELS], by_lightness: &mut [f64]) {
    let factor = (-STEP / BLUR).exp();
    for ((w, l), to) in weights.iter().zip(lightness).zip(by_lightness) {
        let mut z = at_lowest(*l);
        let mut sum = 0.0;
        for by in by {
            let share = 1.0 / (1.0 + z);
            sum += by * share * (1.0 - share);
            z *= factor;
        }
        *to -= w * sum / BLUR;
    }
}
