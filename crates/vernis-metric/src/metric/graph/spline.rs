//! Resampling by interpolating cubic splines, one axis after another.
//!
//! With b3 the cubic B-spline and c the coefficients for which s(x) = sum_k c_k b3(x - k) passes through the samples,
//! sample k at x = k, the value at output cell j of m is s((j + 1/2) n/m - 1/2), n the number of samples: the centre of the
//! output cell where samples stand at centres too. Samples go on beyond both ends as in a mirror that stands at the end
//! sample (d c b | a b c d | c b a).
//!
//! Source: M. Unser, "Splines: a perfect fit for signal and image processing", IEEE Signal Processing Magazine 16(6),
//! 1999, doi:10.1109/79.799930; the centres and the mirror are those of the study's program (`scipy.ndimage.map_coordinates`,
//! order 3). Nothing is blurred before a coarser grid is sampled, as there. Cost: a few operations a sample and axis.

use crate::math::Rgb;
use crate::math::parallel;
use multiversion::multiversion;

/// The pole of the cubic spline's filter, sqrt(3) - 2.
const POLE: f64 = -0.267_949_192_431_122_7;

/// Turns samples into coefficients, in place, for `width` interleaved signals: entry k of signal w at `k * width + w`.
#[inline(always)]
fn prefilter(samples: &mut [f64], width: usize) {
    let n = samples.len() / width;
    if n < 2 {
        return;
    }
    samples.iter_mut().for_each(|v| *v *= 6.0);
    // The first causal coefficient of the signal mirrored at both ends, of period 2 n - 2.
    let (mut first, mut power) = (samples[..width].to_vec(), POLE);
    let turn = POLE.powi(2 * n as i32 - 2);
    for k in 1..n {
        let mirrored = if k + 1 < n { power + POLE.powi((2 * n - 2 - k) as i32) } else { power };
        first.iter_mut().zip(&samples[k * width..]).for_each(|(f, s)| *f += mirrored * s);
        power *= POLE;
    }
    samples[..width].iter_mut().zip(first).for_each(|(s, f)| *s = f / (1.0 - turn));
    for k in 1..n {
        let (done, rest) = samples.split_at_mut(k * width);
        rest[..width].iter_mut().zip(&done[(k - 1) * width..]).for_each(|(s, before)| *s += POLE * before);
    }
    let last = (n - 1) * width;
    for w in 0..width {
        samples[last + w] = POLE / (POLE * POLE - 1.0) * (POLE * samples[last - width + w] + samples[last + w]);
    }
    for k in (0..n - 1).rev() {
        let (front, after) = samples.split_at_mut((k + 1) * width);
        front[k * width..].iter_mut().zip(&after[..width]).for_each(|(s, next)| *s = POLE * (next - *s));
    }
}

/// For each output cell the place of four coefficients and their weights; `None` where the samples stay as they are.
type Taps = Option<Vec<[(usize, f64); 4]>>;

/// For each of `m` output cells, the place of four coefficients of `n` and their weights.
fn taps(n: usize, m: usize) -> Vec<[(usize, f64); 4]> {
    let mirror = |k: i64| {
        let period = (2 * n as i64 - 2).max(1);
        let k = k.rem_euclid(period);
        k.min(period - k) as usize
    };
    (0..m)
        .map(|j| {
            let x = (j as f64 + 0.5) * n as f64 / m as f64 - 0.5;
            let (t, below) = (x - x.floor(), x.floor() as i64);
            let u = 1.0 - t;
            let weights = [
                u * u * u / 6.0,
                (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0,
                (4.0 - 6.0 * u * u + 3.0 * u * u * u) / 6.0,
                t * t * t / 6.0,
            ];
            std::array::from_fn(|k| (mirror(below - 1 + k as i64), weights[k]))
        })
        .collect()
}

/// Brings `width` interleaved signals to the output cells of `taps`. Compiled once for every x86-64 processor and once for those with
/// AVX2; nothing is multiplied and added in one instruction, so that both give the same bits.
#[multiversion(targets("x86_64+avx2"))]
fn along(mut samples: Vec<f64>, taps: &Taps, width: usize) -> Vec<f64> {
    let Some(taps) = taps else { return samples };
    prefilter(&mut samples, width);
    let mut out = vec![0.0; taps.len() * width];
    for (row, &taps) in out.chunks_exact_mut(width).zip(taps) {
        let [(a, u), (b, v), (c, w), (d, x)] = taps.map(|(k, weight)| (&samples[k * width..][..width], weight));
        for (k, out) in row.iter_mut().enumerate() {
            *out = u * a[k] + v * b[k] + w * c[k] + x * d[k];
        }
    }
    out
}

/// A matrix of rows of length `width`, its columns as rows.
fn transposed(values: &[f64], width: usize) -> Vec<f64> {
    (0..width).flat_map(|column| values[column..].iter().step_by(width).copied()).collect()
}

/// Three channels, row-major of shape `from` with `value(row, cell)` at each cell and its row of theta_i, on the cells of shape `to`.
///
/// A column of theta_o is brought to the new cells of theta_i as soon as it is read, and each row of theta_i that gives to those of the
/// other axes: both fit into a processor's cache, and nothing in f64 is as large as the source.
pub(super) fn resample(value: impl Fn(usize, usize) -> Rgb + Sync, from: [usize; 3], to: [usize; 3]) -> [Vec<f64>; 3] {
    let taps: [Taps; 3] = std::array::from_fn(|axis| (from[axis] != to[axis]).then(|| taps(from[axis], to[axis])));
    let [_, columns, width] = from;
    let column = |o: usize| -> [Vec<f64>; 3] {
        let mut planes = [(); 3].map(|()| Vec::with_capacity(from[0] * width));
        for i in 0..from[0] {
            let start = (i * columns + o) * width;
            for cell in start..start + width {
                planes.iter_mut().zip(value(i, cell)).for_each(|(plane, value)| plane.push(value));
            }
        }
        planes.map(|plane| along(plane, &taps[0], width))
    };
    let strips = parallel::map(columns, column);
    let row = |i: usize| -> [Vec<f64>; 3] {
        std::array::from_fn(|channel| {
            let block: Vec<f64> =
                strips.iter().flat_map(|strip| &strip[channel][i * width..][..width]).copied().collect();
            let block = along(block, &taps[1], width);
            match &taps[2] {
                None => block,
                some => transposed(&along(transposed(&block, width), some, to[1]), to[1]),
            }
        })
    };
    let rows = parallel::map(to[0], row);
    std::array::from_fn(|channel| rows.iter().flat_map(|row| &row[channel]).copied().collect())
}

/// Which cells of shape `to` are valid: those for which at least half of the cells of shape `from` around their centre are,
/// the nearest one or, half-way between two along an axis, both.
pub(super) fn resample_mask(valid: &[bool], from: [usize; 3], to: [usize; 3]) -> Vec<bool> {
    let around: [Vec<[usize; 2]>; 3] = std::array::from_fn(|axis| {
        let last = from[axis] - 1;
        (0..to[axis])
            .map(|j| {
                let x = ((j as f64 + 0.5) * from[axis] as f64 / to[axis] as f64 - 0.5).clamp(0.0, last as f64);
                [(x - 1e-9).round().max(0.0) as usize, ((x + 1e-9).round() as usize).min(last)]
            })
            .collect()
    });
    let mut out = Vec::with_capacity(to.iter().product());
    for a in &around[0] {
        for b in &around[1] {
            for c in &around[2] {
                let is_valid = |k: &usize| valid[(a[k >> 2] * from[1] + b[k >> 1 & 1]) * from[2] + c[k & 1]];
                out.push((0..8).filter(is_valid).count() >= 4);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_scipy() {
        // scipy 1.17.1: map_coordinates(sin(3 x^2 + y) + x y z, indices, order=3), shape 6x4x8 to 3x2x4.
        let value = |i: usize, j: usize, k: usize| {
            let (x, y, z) = (i as f64 / 3.0, j as f64 / 2.0, k as f64 / 4.0);
            (3.0 * x * x + y).sin() + x * y * z
        };
        let of_cell = |_, c: usize| [1.0, 2.0, -3.0].map(|scale| scale * value(c / 32, c / 8 % 4, c % 8));
        for (found, scale) in resample(of_cell, [6, 4, 8], [3, 2, 4]).iter().zip([1.0, 2.0, -3.0]) {
            for (found, expected) in found.iter().zip(EXPECTED) {
                assert!((found / scale - expected).abs() < 1e-12, "{found} {expected}");
            }
            assert_eq!(found.len(), EXPECTED.len());
        }
    }

    #[rustfmt::skip]
    const EXPECTED: [f64; 24] = [
        0.2419212524844214, 0.25263713770804375, 0.26272061003322283, 0.2734364952568453, 0.9768176672852259,
        1.0579522268355104, 1.1342985172975806, 1.2154330768478645, 0.6436086050756045, 0.7219169970943835,
        0.7956039102399233, 0.8739123022587023, -0.3368157486087626, 0.25609064810485244, 0.8140058476353687,
        1.406912244348984, 0.19000411852931665, 0.3359050173432524, 0.4731953713091529, 0.6190962701230892,
        0.29978073660359955, 1.4044589704805455, 2.4439430790795083, 3.5486213129564543,
    ];

    #[test]
    fn samples_that_meet_an_output_cell_come_back() {
        // Three cells of one: the centre of every output cell is a sample.
        let values: Vec<f64> = (0..9).map(|k| f64::from(k * k % 7)).collect();
        let [found, ..] = resample(|_, cell| [values[cell]; 3], [1, 1, 9], [1, 1, 3]);
        for (found, expected) in found.iter().zip([values[1], values[4], values[7]]) {
            assert!((found - expected).abs() < 1e-13);
        }
    }

    #[test]
    fn a_cell_is_masked_with_most_of_what_it_stands_on() {
        let mut valid = vec![true; 2 * 2 * 6];
        // Cell (row, k) of the four rows: four of the eight around the second output cell, then five.
        for (row, k) in [(0, 3), (0, 2), (1, 2), (2, 3)] {
            valid[6 * row + k] = false;
        }
        assert_eq!(resample_mask(&valid, [2, 2, 6], [1, 1, 3]), [true, true, true]);
        valid[6 * 3 + 3] = false;
        assert_eq!(resample_mask(&valid, [2, 2, 6], [1, 1, 3]), [true, false, true]);
        let third = resample_mask(&valid, [2, 2, 6], [2, 2, 2]);
        assert_eq!(third.iter().filter(|v| !**v).count(), 0);
        assert_eq!(resample_mask(&valid, [2, 2, 6], [2, 2, 6]), valid);
    }
}
