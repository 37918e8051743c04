//! The filters of S-CIELAB: what is too fine for the eye, by opponent channel, is blurred before colours are compared.
//!
//! XYZ -> opponent channels (light/dark, red/green, blue/yellow) -> sums of Gaussians of the half widths below, in degrees -> XYZ. The
//! filters are 1 degree wide. They are sampled at 240 samples a degree (the least multiple of the picture's 40 that is at least 224),
//! then summed with the triangle that linear interpolation between pixels is, and every sixth is kept: 39 taps.
//!
//! Source: Zhang and Wandell 1997 (doi:10.1889/1.1985127); channels and widths of Poirson and Wandell 1993 in the form of Wandell's
//! programs of 1996, with their quirk that a sum of Gaussians with a negative weight carries its sign along rows alone.

use super::colour::{inverse, times};
use super::plane::Plane;
use vernis_metric::math::parallel;

/// Samples a degree: twice 20 cycles.
pub(super) const SAMPLES_PER_DEGREE: usize = 40;
/// The filters are made at this many samples a degree or more.
const FINE: usize = 224;

/// XYZ to opponent channels.
const OPPONENT_FROM_XYZ: [[f64; 3]; 3] =
    [[0.2787336, 0.7218031, -0.1065520], [-0.4487736, 0.2898056, 0.0771569], [0.0859513, -0.5899859, 0.5011089]];

/// (Half width in degrees, weight) of the Gaussians of each channel; the weights of a channel sum to 1.
const GAUSSIANS: [&[(f64, f64)]; 3] = [
    &[(0.05, 1.00327), (0.225, 0.114416), (7.0, -0.117686)],
    &[(0.0685, 0.616725), (0.826, 0.383275)],
    &[(0.0920, 0.567885), (0.6451, 0.432115)],
];

/// XYZ of every pixel after the filters.
pub(super) fn filtered(xyz: &[[f64; 3]], width: usize) -> Vec<[f64; 3]> {
    let opponents = parallel::map_items(xyz, |c| times(&OPPONENT_FROM_XYZ, *c));
    let channels: Vec<Plane> = (0..3)
        .map(|k| {
            let plane = Plane::of_pixels(width, &opponents, |c| c[k]);
            let parts = GAUSSIANS[k].iter().map(|part| blurred(&plane, &kernel(*part)));
            parts.reduce(|sum, part| Plane::of_two(&sum, &part, |a, b| a + b)).unwrap_or(plane.clone())
        })
        .collect();
    let back = inverse(&OPPONENT_FROM_XYZ);
    let pixel = |i: usize| times(&back, [0, 1, 2].map(|k: usize| channels[k].values[i]));
    parallel::map(xyz.len(), pixel)
}

/// The taps of a Gaussian, for rows: times the root of its weight, with its sign.
fn kernel((half_width, weight): (f64, f64)) -> Vec<f64> {
    let finer = FINE.div_ceil(SAMPLES_PER_DEGREE);
    let samples = SAMPLES_PER_DEGREE * finer;
    let width = samples.div_ceil(2) * 2 - 1;
    let middle = (width / 2) as i64;
    let alpha = 2.0 * 2f64.ln().sqrt() / (half_width * samples as f64 - 1.0);
    let raw: Vec<f64> = (-middle..=middle).map(|x| (-(alpha * x as f64).powi(2)).exp()).collect();
    let sum: f64 = raw.iter().sum();
    let scale = weight.abs().sqrt() * weight.signum() / sum;
    let finer = finer as i64;
    let triangle = |distance: i64| (finer - distance.abs()).max(0) as f64 / finer as f64;
    let tap = |at: i64| -> f64 {
        let near = (at - finer + 1).max(-middle)..=(at + finer - 1).min(middle);
        near.map(|x| raw[(x + middle) as usize] * scale * triangle(at - x)).sum()
    };
    let taps = middle / finer;
    (-taps..=taps).map(|i| tap(i * finer)).collect()
}

/// The plane after a kernel along rows and its absolute values along columns. Beyond the border the plane is mirrored, the pixel at
/// the border included, but no farther than half of its side where the kernel is as long as it; beyond that it is 0.
fn blurred(plane: &Plane, kernel: &[f64]) -> Plane {
    let along = |plane: &Plane, kernel: &[f64]| {
        let n = plane.width;
        let reach = kernel.len() / 2;
        let mirrored = if kernel.len() >= n { n / 2 } else { reach };
        Plane::by_rows(n, plane.height, |y, out| {
            let row = plane.row(y);
            let mut padded = vec![0.0; n + 2 * reach];
            padded[reach..reach + n].copy_from_slice(row);
            for i in 0..mirrored {
                padded[reach - 1 - i] = row[i];
                padded[reach + n + i] = row[n - 1 - i];
            }
            super::plane::correlate_row(&padded, kernel, out);
        })
    };
    let absolute: Vec<f64> = kernel.iter().map(|v| v.abs()).collect();
    transposed(&along(&transposed(&along(plane, kernel)), &absolute))
}

fn transposed(plane: &Plane) -> Plane {
    Plane::by_rows(plane.height, plane.width, |x, column| {
        for (y, v) in column.iter_mut().enumerate() {
            *v = plane.values[y * plane.width + x];
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_have_39_taps_and_keep_what_is_even() {
        for gaussians in GAUSSIANS {
            let kernels: Vec<Vec<f64>> = gaussians.iter().map(|g| kernel(*g)).collect();
            assert!(kernels.iter().all(|k| k.len() == 39 && (0..19).all(|i| (k[i] - k[38 - i]).abs() < 1e-15)));
            let sum: f64 = kernels.iter().map(|k| k.iter().sum::<f64>() * k.iter().map(|v| v.abs()).sum::<f64>()).sum();
            // Not exactly 1: the reduction leaves out what lies beyond the last tap.
            assert!((sum - 1.0).abs() < 0.03, "{sum}");
        }
    }

    #[test]
    fn a_picture_smaller_than_the_filter_is_mirrored_once() {
        let plane = Plane { width: 3, height: 1, values: vec![1.0, 2.0, 4.0] };
        let mut impulse = vec![0.0; 39];
        impulse[18] = 1.0;
        // One pixel to the left, mirrored by half of the width, rounded down; down a column of one pixel nothing is mirrored.
        assert_eq!(blurred(&plane, &impulse).values, [0.0; 3]);
        impulse[19] = 1.0;
        assert_eq!(blurred(&plane, &impulse).values, [2.0, 3.0, 6.0]);
    }
}
