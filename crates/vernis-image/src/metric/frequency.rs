//! Filters in the frequency domain, by the crates `realfft` and `rustfft`.

use super::plane::{Plane, ROWS};
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use rustfft::FftPlanner;
use vernis_metric::math::parallel;

/// Side of the blocks in which a matrix is transposed: two of them fit the cache.
const BLOCK: usize = 32;

/// The plane whose spectrum is that of `plane` times `gain(kx, ky)`, where `kx` and `ky` are cycles over the width and the height
/// without their signs, at most half of them. The plane repeats beyond its border.
pub(super) fn filtered(plane: &Plane, gain: impl Fn(usize, usize) -> f64 + Sync) -> Plane {
    let (width, height) = (plane.width, plane.height);
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, back) = (planner.plan_fft_forward(width), planner.plan_fft_inverse(width));
    let mut planner = FftPlanner::<f64>::new();
    let (down, up) = (planner.plan_fft_forward(height), planner.plan_fft_inverse(height));
    let half = width / 2 + 1;
    let mut spectrum = vec![Complex::default(); half * height];
    parallel::for_each_chunk(&mut spectrum, ROWS * half, |k, rows| {
        let (mut row, mut scratch) = (vec![0.0; width], forward.make_scratch_vec());
        for (j, out) in rows.chunks_mut(half).enumerate() {
            row.copy_from_slice(plane.row(k * ROWS + j));
            // Its only errors are buffers of wrong lengths, and these are of the plan's own.
            let _ = forward.process_with_scratch(&mut row, out, &mut scratch);
        }
    });
    let mut columns = transposed(&spectrum, half);
    drop(spectrum);
    let scale = 1.0 / (width * height) as f64;
    let scratch = down.get_inplace_scratch_len().max(up.get_inplace_scratch_len());
    parallel::for_each_chunk(&mut columns, ROWS * height, |k, columns| {
        let mut scratch = vec![Complex::default(); scratch];
        for (j, column) in columns.chunks_mut(height).enumerate() {
            down.process_with_scratch(column, &mut scratch);
            for (y, value) in column.iter_mut().enumerate() {
                *value *= scale * gain(k * ROWS + j, y.min(height - y));
            }
            up.process_with_scratch(column, &mut scratch);
        }
    });
    let spectrum = transposed(&columns, height);
    drop(columns);
    let mut values = vec![0.0; width * height];
    parallel::for_each_chunk(&mut values, ROWS * width, |k, rows| {
        let (mut row, mut scratch) = (vec![Complex::default(); half], back.make_scratch_vec());
        for (out, found) in rows.chunks_mut(width).zip(spectrum[k * ROWS * half..].chunks(half)) {
            row.copy_from_slice(found);
            // A real signal has real values at no frequency and at half of the rate; rounding has left a trace beside them.
            row[0].im = 0.0;
            if width % 2 == 0 {
                row[half - 1].im = 0.0;
            }
            let _ = back.process_with_scratch(&mut row, out, &mut scratch);
        }
    });
    Plane { width, height, values }
}

/// The transpose of a matrix with rows of `width`.
fn transposed(matrix: &[Complex<f64>], width: usize) -> Vec<Complex<f64>> {
    let height = matrix.len() / width;
    let mut out = vec![Complex::default(); matrix.len()];
    parallel::for_each_chunk(&mut out, height * BLOCK, |block, out| {
        let first = block * BLOCK;
        let columns = out.len() / height;
        for y0 in (0..height).step_by(BLOCK) {
            for x in 0..columns {
                for y in y0..(y0 + BLOCK).min(height) {
                    out[x * height + y] = matrix[y * width + first + x];
                }
            }
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A cosine is scaled by the gain at its frequency, on odd and on even sides.
    #[test]
    fn cosines_are_scaled_by_the_gain() {
        for (width, height) in [(12, 10), (15, 9), (70, 33), (1, 4), (5, 1)] {
            let wave = |fx: usize, fy: usize| {
                let phase = |x: usize, y: usize| (x * fx) as f64 / width as f64 + (y * fy) as f64 / height as f64;
                Plane::by_rows(width, height, |y, row| {
                    row.iter_mut().enumerate().for_each(|(x, v)| *v = (TAU * phase(x, y) + 0.3).cos());
                })
            };
            for (fx, fy) in [(0, 0), (1 % width, 2 % height), (width / 3, height - 1)] {
                let found = filtered(&wave(fx, fy), |kx, ky| 1.0 + kx as f64 + 10.0 * ky as f64);
                let gain = 1.0 + fx.min(width - fx) as f64 + 10.0 * fy.min(height - fy) as f64;
                let expected = wave(fx, fy).map(|v| gain * v);
                for (a, b) in found.values.iter().zip(&expected.values) {
                    assert!((a - b).abs() < 1e-9, "{width} {height} {fx} {fy}: {a} {b}");
                }
            }
        }
    }
}
