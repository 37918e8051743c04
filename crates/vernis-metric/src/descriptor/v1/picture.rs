//! What a viewer would compare in two pictures of a shape: differences in an opponent log space.
//!
//!   Y = 0.2126 R + 0.7152 G + 0.0722 B; L = 20 ln(Y + 0.01); c1 = 20 ln((R + 0.01) / (G + 0.01)); c2 = 20 ln((B + 0.01) / (G + 0.01)).
//!
//! A is the reference, B the candidate, d = B - A, w the weight of a pixel (the share of the shape with that normal),
//! e = |(dL, dc1, dc2)|, sA, sB and cov the weighted deviations and covariance of L; q the quantiles (i + 0.5) / 64 of L.
//! Local moments are over 7 x 7 windows around each pixel of the disc, on a pyramid of 2 x 2 means; pixels off the disc
//! take no part. The structure and contrast terms are those of SSIM (Wang et al. 2004, doi:10.1109/TIP.2003.819861,
//! eqs. 9 and 10) with the constant 9.
//!
//! Cost: about 20 microseconds a pair and light once each picture has been prepared.

use crate::descriptor::frame::Frame;
use crate::light::shape::SIDE;
use crate::math::Rgb;
use crate::math::color::luminance;

const GAIN: f64 = 20.0;
const FLOOR: f64 = 0.01;
const QUANTILES: usize = 64;
const STABILISER: f64 = 9.0;

/// Quantile groups that have a name.
pub const QUANTILE_GROUPS: [(usize, usize); 4] = [(0, 15), (16, 47), (48, 59), (60, 63)];

/// Mean and variance of L over every window of a level.
#[derive(Debug, Clone, Default)]
struct Local {
    mean: Vec<f64>,
    variance: Vec<f64>,
}

/// A picture with everything that comparing it needs.
#[derive(Debug, Clone)]
pub struct Picture {
    lightness: Vec<f64>,
    chroma: Vec<[f64; 2]>,
    /// L on the whole 32 x 32 grid, 0 off the disc.
    image: Vec<f64>,
    mean: f64,
    variance: f64,
    quantiles: [f64; QUANTILES],
    local: Vec<Local>,
}

fn weighted_mean(weights: &[f64], values: impl Iterator<Item = f64>) -> f64 {
    weights.iter().zip(values).map(|(w, v)| w * v).sum()
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len() as f64;
    values.sum::<f64>() / n
}

impl Picture {
    /// From the linear RGB radiance of the pixels of the frame.
    pub fn new(frame: &Frame, radiance: &[Rgb]) -> Self {
        let lightness: Vec<f64> = radiance.iter().map(|c| GAIN * (luminance(*c) + FLOOR).ln()).collect();
        let ratio = |a: f64, b: f64| GAIN * ((a + FLOOR) / (b + FLOOR)).ln();
        let chroma = radiance.iter().map(|c| [ratio(c[0], c[1]), ratio(c[2], c[1])]).collect();
        let mut image = vec![0.0; SIDE * SIDE];
        frame.levels[0].cells.iter().zip(&lightness).for_each(|(&c, l)| image[c] = *l);
        let w = frame.weights();
        let mean = weighted_mean(w, lightness.iter().copied());
        let variance = weighted_mean(w, lightness.iter().map(|l| (l - mean) * (l - mean)));
        let quantiles = quantiles(w, &lightness);
        let mut local = Vec::new();
        let mut level_image = image.clone();
        for (scale, level) in frame.levels.iter().enumerate() {
            if scale > 0 {
                level_image = frame.reduce(scale, &level_image);
            }
            let mean = level.window_means(&level.cover(level_image.iter().copied()));
            let squares = level.window_means(&level.cover(level_image.iter().map(|l| l * l)));
            let variance = squares.iter().zip(&mean).map(|(s, m)| (s - m * m).max(0.0)).collect();
            local.push(Local { mean, variance });
        }
        Self { lightness, chroma, image, mean, variance, quantiles, local }
    }
}

/// Quantiles (i + 0.5) / 64 of `values` under `weights`, linear between the middles of the steps.
fn quantiles(weights: &[f64], values: &[f64]) -> [f64; QUANTILES] {
    let mut order: Vec<usize> = (0..values.len()).filter(|&i| weights[i] > 0.0).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut below = 0.0;
    let middles: Vec<(f64, f64)> = order
        .iter()
        .map(|&i| {
            let middle = below + 0.5 * weights[i];
            below += weights[i];
            (middle, values[i])
        })
        .collect();
    let mut at = 0;
    std::array::from_fn(|q| {
        let p = (q as f64 + 0.5) / QUANTILES as f64;
        while at + 1 < middles.len() && middles[at + 1].0 < p {
            at += 1;
        }
        let (p0, v0) = middles[at];
        let (p1, v1) = middles[(at + 1).min(middles.len() - 1)];
        if p1 > p0 { v0 + (v1 - v0) * ((p - p0) / (p1 - p0)).clamp(0.0, 1.0) } else { v0 }
    })
}

/// Differences of two pictures of the same shape and light, all exactly 0 for equal pictures.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PictureDifference {
    /// Mean of e.
    pub mean: f64,
    /// (sum w e^4)^(1/4).
    pub fourth_power_mean: f64,
    /// Mean of |dL|.
    pub absolute_lightness: f64,
    /// Mean of |(dc1, dc2)|.
    pub chroma: f64,
    /// Mean of dL.
    pub signed_lightness: f64,
    /// |(mean dc1, mean dc2)|.
    pub chroma_shift: f64,
    /// ln((sB + 1) / (sA + 1)).
    pub deviation: f64,
    /// 1 - (cov + 1) / (sA sB + 1).
    pub decorrelation: f64,
    /// sqrt(sA^2 + sB^2 - 2 cov): the deviation of dL.
    pub centred_rms: f64,
    /// Mean difference of the quantiles of each of [`QUANTILE_GROUPS`].
    pub quantiles: [f64; 4],
    /// Mean absolute difference of all 64 quantiles.
    pub quantile_distance: f64,
    /// 1 - mean((cov + 9) / (sA sB + 9)) over windows.
    pub structure: f64,
    /// 1 - mean((2 sA sB + 9) / (sA^2 + sB^2 + 9)) over windows.
    pub contrast: f64,
    /// ln((mean sB + 0.5) / (mean sA + 0.5)) over windows at scales 0 and 2.
    pub local_deviation: [f64; 2],
    /// Mean |difference of the window means| at scale 3.
    pub local_mean: f64,
}

impl PictureDifference {
    /// Candidate `b` against reference `a`.
    pub fn new(frame: &Frame, a: &Picture, b: &Picture) -> Self {
        let w = frame.weights();
        let lightness = || a.lightness.iter().zip(&b.lightness).map(|(a, b)| b - a);
        let chroma = || a.chroma.iter().zip(&b.chroma).map(|(a, b)| [b[0] - a[0], b[1] - a[1]]);
        let total = || lightness().zip(chroma()).map(|(l, c)| (l * l + c[0] * c[0] + c[1] * c[1]).sqrt());
        let shift = |k: usize| weighted_mean(w, chroma().map(|c| c[k]));
        let pairs = a.lightness.iter().zip(&b.lightness);
        let covariance = weighted_mean(w, pairs.map(|(x, y)| (x - a.mean) * (y - b.mean)));
        // The root of a product of variances, not the product of roots: exact where they are equal.
        let product = (a.variance * b.variance).sqrt();
        let (structure, contrast) = Self::structure_and_contrast(frame, a, b);
        let local = |scale: usize, p: &Picture| mean(p.local[scale].variance.iter().map(|v| v.sqrt()));
        let local_deviation = [0, 2].map(|s| ((local(s, b) + 0.5) / (local(s, a) + 0.5)).ln());
        Self {
            mean: weighted_mean(w, total()),
            fourth_power_mean: weighted_mean(w, total().map(|e| e.powi(4))).sqrt().sqrt(),
            absolute_lightness: weighted_mean(w, lightness().map(f64::abs)),
            chroma: weighted_mean(w, chroma().map(|c| c[0].hypot(c[1]))),
            signed_lightness: weighted_mean(w, lightness()),
            chroma_shift: shift(0).hypot(shift(1)),
            deviation: ((b.variance.sqrt() + 1.0) / (a.variance.sqrt() + 1.0)).ln(),
            decorrelation: (product - covariance) / (product + 1.0),
            centred_rms: (a.variance + b.variance - 2.0 * covariance).max(0.0).sqrt(),
            quantiles: QUANTILE_GROUPS
                .map(|(first, last)| mean((first..last + 1).map(|q| b.quantiles[q] - a.quantiles[q]))),
            quantile_distance: mean(a.quantiles.iter().zip(&b.quantiles).map(|(a, b)| (b - a).abs())),
            structure,
            contrast,
            local_deviation,
            local_mean: mean(a.local[3].mean.iter().zip(&b.local[3].mean).map(|(a, b)| (b - a).abs())),
        }
    }

    fn structure_and_contrast(frame: &Frame, a: &Picture, b: &Picture) -> (f64, f64) {
        let level = &frame.levels[0];
        let products = level.window_means(&level.cover(a.image.iter().zip(&b.image).map(|(a, b)| a * b)));
        let (la, lb) = (&a.local[0], &b.local[0]);
        let (mut structure, mut contrast) = (0.0, 0.0);
        for (i, product) in products.iter().enumerate() {
            let (va, vb) = (la.variance[i], lb.variance[i]);
            let deviations = (va * vb).sqrt();
            // Rounding may break the Cauchy-Schwarz inequality in flat windows.
            let covariance = (product - la.mean[i] * lb.mean[i]).clamp(-deviations, deviations);
            structure += (deviations - covariance) / (deviations + STABILISER);
            contrast += (va + vb - 2.0 * deviations) / (va + vb + STABILISER);
        }
        (structure / products.len() as f64, contrast / products.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::shape::Shape;

    fn frame() -> (Shape, Frame) {
        let shape = Shape::sphere();
        let frame = Frame::new(&shape);
        (shape, frame)
    }

    /// A bright picture with detail at every scale.
    fn scene(shape: &Shape) -> Vec<Rgb> {
        let level = |c: usize| 50.0 + 40.0 * ((c % SIDE) as f64 * 0.9).sin() * ((c / SIDE) as f64 * 0.4).cos();
        shape.cells().iter().map(|&c| [level(c), 0.8 * level(c), 0.5 * level(c)]).collect()
    }

    #[test]
    fn twice_as_bright_is_a_shift_of_lightness_alone() {
        let (shape, frame) = frame();
        let radiance = scene(&shape);
        let brighter: Vec<Rgb> = radiance.iter().map(|c| c.map(|v| 2.0 * v)).collect();
        let (a, b) = (Picture::new(&frame, &radiance), Picture::new(&frame, &brighter));
        let d = PictureDifference::new(&frame, &a, &b);
        // The floor of 0.01 is a thousandth of the darkest pixel.
        let shift = 20.0 * 2f64.ln();
        let near = |v: f64| (v - shift).abs() < 0.02;
        assert!(near(d.mean) && near(d.fourth_power_mean) && near(d.absolute_lightness) && near(d.signed_lightness));
        assert!(near(d.local_mean) && d.quantiles.iter().all(|q| near(*q)), "{d:?}");
        let rest = [d.chroma, d.chroma_shift, d.deviation, d.decorrelation, d.centred_rms, d.structure, d.contrast];
        assert!(rest.iter().chain(&d.local_deviation).all(|v| v.abs() < 0.02), "{d:?}");
    }

    #[test]
    fn moments_of_two_halves() {
        let (shape, frame) = frame();
        let grey = |l: f64| [(l / 20.0).exp() - 0.01; 3];
        let picture = |left: f64, right: f64| {
            let side = |c: &usize| grey(if c % SIDE < SIDE / 2 { left } else { right });
            Picture::new(&frame, &shape.cells().iter().map(side).collect::<Vec<_>>())
        };
        // L is -10 and 10 in the reference, -30 and 20 in the candidate, on halves of equal size.
        let d = PictureDifference::new(&frame, &picture(-10.0, 10.0), &picture(-30.0, 20.0));
        let near = |v: f64, expected: f64| assert!((v - expected).abs() < 1e-9, "{v} {expected}");
        near(d.absolute_lightness, 15.0);
        near(d.signed_lightness, -5.0);
        near(d.fourth_power_mean, ((20f64.powi(4) + 10f64.powi(4)) / 2.0).powf(0.25));
        near(d.deviation, (26.0f64 / 11.0).ln());
        near(d.decorrelation, 0.0);
        near(d.centred_rms, 15.0);
        near(d.quantiles[0], -20.0);
        near(d.quantiles[3], 10.0);
    }

    #[test]
    fn quantiles_of_a_ramp() {
        let values: Vec<f64> = (0..1000).map(f64::from).collect();
        let q = quantiles(&vec![1e-3; 1000], &values);
        // The value at level p of 0, 1, ..., 999 with steps centred on the values is 1000 p - 0.5.
        for (k, v) in q.iter().enumerate() {
            assert!((v - (1000.0 * (k as f64 + 0.5) / 64.0 - 0.5)).abs() < 1e-9);
        }
    }

    #[test]
    fn windows_off_the_disc_see_the_disc_only() {
        let (shape, frame) = frame();
        let flat = Picture::new(&frame, &vec![[0.3; 3]; shape.len()]);
        let l = 20.0 * 0.31f64.ln();
        for local in &flat.local {
            assert!(local.mean.iter().all(|m| (m - l).abs() < 1e-9) && local.variance.iter().all(|v| *v < 1e-9));
        }
    }
}
