//! Planes of numbers, the filters that metrics share, and sums that do not depend on the number of threads.
//!
//! Own filters: crates for pictures filter codes of 8 bits or single precision, with borders of their own; metrics need double
//! precision and the border that their authors chose.

use multiversion::multiversion;
use vernis_metric::math::parallel;

/// Rows that share a buffer.
pub(super) const ROWS: usize = 16;

/// Values for the pixels of a picture, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plane {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f64>,
}

/// What lies beyond the border of a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Edge {
    /// Nothing: the result has only those places where the whole kernel fits.
    Valid,
    /// The pixel at the border, over and over.
    Replicate,
}

impl Plane {
    /// A plane whose rows `row(y, values)` fills.
    pub fn by_rows(width: usize, height: usize, row: impl Fn(usize, &mut [f64]) + Sync) -> Self {
        let mut values = vec![0.0; width * height];
        parallel::for_each_chunk(&mut values, width, row);
        Self { width, height, values }
    }

    /// A plane of which each value follows from the pixel there.
    pub fn of_pixels<T: Sync>(width: usize, pixels: &[T], value: impl Fn(&T) -> f64 + Sync) -> Self {
        Self::by_rows(width, pixels.len() / width, |y, row| {
            for (to, from) in row.iter_mut().zip(&pixels[y * width..]) {
                *to = value(from);
            }
        })
    }

    /// A plane of which each value follows from those of two others.
    pub fn of_two(a: &Self, b: &Self, value: impl Fn(f64, f64) -> f64 + Sync) -> Self {
        Self::by_rows(a.width, a.height, |y, row| {
            for ((to, a), b) in row.iter_mut().zip(a.row(y)).zip(b.row(y)) {
                *to = value(*a, *b);
            }
        })
    }

    /// A plane of which each value follows from that of this one.
    pub fn map(&self, value: impl Fn(f64) -> f64 + Sync) -> Self {
        Self::of_pixels(self.width, &self.values, |v| value(*v))
    }

    pub fn row(&self, y: usize) -> &[f64] {
        &self.values[y * self.width..][..self.width]
    }

    pub fn mean(&self) -> f64 {
        sum_of_rows(self.height, |y| self.row(y).iter().sum()) / self.values.len() as f64
    }

    /// Correlation with `across` along rows and `down` along columns. The middle of a kernel of odd length is its origin.
    pub fn correlate(&self, across: &[f64], down: &[f64], edge: Edge) -> Self {
        let (width, height) = match edge {
            Edge::Valid => (self.width + 1 - across.len(), self.height + 1 - down.len()),
            Edge::Replicate => (self.width, self.height),
        };
        let before = across.len() / 2;
        let mut values = vec![0.0; width * height];
        let row = |buffer: &mut [f64], y: usize, out: &mut [f64]| {
            let rows = (0..down.len()).map(|j| match edge {
                Edge::Valid => self.row(y + j),
                Edge::Replicate => self.row((y + j).saturating_sub(down.len() / 2).min(self.height - 1)),
            });
            let rows: Vec<&[f64]> = rows.collect();
            match edge {
                Edge::Valid => weigh_rows(&rows, down, &mut buffer[..self.width]),
                Edge::Replicate => {
                    weigh_rows(&rows, down, &mut buffer[before..][..self.width]);
                    let (first, last) = (buffer[before], buffer[before + self.width - 1]);
                    buffer[..before].fill(first);
                    buffer[before + self.width..].fill(last);
                }
            }
            correlate_row(buffer, across, out);
        };
        parallel::for_each_chunk(&mut values, ROWS * width, |k, rows| {
            let mut buffer = vec![0.0; self.width + across.len()];
            rows.chunks_mut(width).enumerate().for_each(|(j, out)| row(&mut buffer, k * ROWS + j, out));
        });
        Self { width, height, values }
    }
}

/// The sum over rows, from the top: the same for any number of threads.
pub(super) fn sum_of_rows(height: usize, row: impl Fn(usize) -> f64 + Sync) -> f64 {
    parallel::map(height, row).iter().sum()
}

/// Samples of a Gaussian of standard deviation `sigma` at `count` places one apart about its middle, with sum 1.
pub(super) fn gaussian(count: usize, sigma: f64) -> Vec<f64> {
    let middle = (count - 1) as f64 / 2.0;
    let raw: Vec<f64> = (0..count).map(|i| (-0.5 * ((i as f64 - middle) / sigma).powi(2)).exp()).collect();
    let sum: f64 = raw.iter().sum();
    raw.iter().map(|v| v / sum).collect()
}

/// Values that are summed side by side: two registers of AVX2.
const LANES: usize = 8;

/// `out` = the sum of `weights[j] rows[j]`.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn weigh_rows(rows: &[&[f64]], weights: &[f64], out: &mut [f64]) {
    let width = out.len();
    let whole = width - width % LANES;
    for x in (0..whole).step_by(LANES) {
        let mut sums = [0.0; LANES];
        for (row, weight) in rows.iter().zip(weights) {
            for (sum, value) in sums.iter_mut().zip(&row[x..x + LANES]) {
                *sum += weight * value;
            }
        }
        out[x..x + LANES].copy_from_slice(&sums);
    }
    for x in whole..width {
        out[x] = rows.iter().zip(weights).map(|(row, weight)| weight * row[x]).sum();
    }
}

/// `out[x]` = the sum of `kernel[i] row[x + i]`.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn correlate_row(row: &[f64], kernel: &[f64], out: &mut [f64]) {
    let width = out.len();
    let whole = width - width % LANES;
    for x in (0..whole).step_by(LANES) {
        let mut sums = [0.0; LANES];
        for (i, weight) in kernel.iter().enumerate() {
            for (sum, value) in sums.iter_mut().zip(&row[x + i..x + i + LANES]) {
                *sum += weight * value;
            }
        }
        out[x..x + LANES].copy_from_slice(&sums);
    }
    for x in whole..width {
        out[x] = kernel.iter().zip(&row[x..]).map(|(weight, value)| weight * value).sum();
    }
}

/// The plane at a `factor`-th of its resolution: means over squares of `factor` pixels about each `factor`-th pixel from 0, as
/// MATLAB's `imfilter` with a box, then `(1:f:end, 1:f:end)`. A square of even side begins (f - 1)/2 pixels, rounded down, before its
/// pixel. Beyond the border the picture is mirrored, the pixel at the border included.
pub(super) fn shrink(plane: &Plane, factor: usize) -> Plane {
    let side = |n: usize| n.div_ceil(factor);
    let mirror = |i: usize, n: usize| {
        let i = i % (2 * n);
        if i < n { i } else { 2 * n - 1 - i }
    };
    let before = (factor - 1) / 2;
    let place = |i: usize, j: usize, n: usize| mirror(i * factor + j + 2 * n - before, n);
    Plane::by_rows(side(plane.width), side(plane.height), |y, out| {
        for (x, out) in out.iter_mut().enumerate() {
            let mut sum = 0.0;
            for j in 0..factor {
                let row = plane.row(place(y, j, plane.height));
                sum += (0..factor).map(|i| row[place(x, i, plane.width)]).sum::<f64>();
            }
            *out = sum / (factor * factor) as f64;
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: usize, height: usize) -> Plane {
        let value = |i: usize| ((i * 7919 + 13) % 101) as f64 - 50.0;
        Plane { width, height, values: (0..width * height).map(value).collect() }
    }

    /// Against sums written out, on a plane whose width is no multiple of the lanes.
    #[test]
    fn correlation_is_the_sum_it_says() {
        let plane = picture(29, 17);
        let (across, down) = ([0.5, -1.0, 2.0, 0.25, 1.0], [1.0, 3.0, -0.5]);
        let valid = plane.correlate(&across, &down, Edge::Valid);
        let same = plane.correlate(&across, &down, Edge::Replicate);
        assert_eq!((valid.width, valid.height), (25, 15));
        let at = |x: i64, y: i64| plane.row(y.clamp(0, 16) as usize)[x.clamp(0, 28) as usize];
        let sum = |x: i64, y: i64| -> f64 {
            let term = |i: usize, j: usize| across[i] * down[j] * at(x + i as i64 - 2, y + j as i64 - 1);
            (0..3).flat_map(|j| (0..5).map(move |i| (i, j))).map(|(i, j)| term(i, j)).sum()
        };
        for y in 0..17 {
            for x in 0..29 {
                assert!((same.row(y)[x] - sum(x as i64, y as i64)).abs() < 1e-9, "{x} {y}");
            }
        }
        for y in 0..15 {
            for x in 0..25 {
                assert!((valid.row(y)[x] - sum(x as i64 + 2, y as i64 + 1)).abs() < 1e-9, "{x} {y}");
            }
        }
    }

    /// The pixel at the border counts twice where a box hangs over it.
    #[test]
    fn shrinking_mirrors_at_the_border() {
        let plane = Plane { width: 3, height: 2, values: vec![1.0, 3.0, 8.0, 5.0, 7.0, 2.0] };
        assert_eq!(shrink(&plane, 2), Plane { width: 2, height: 1, values: vec![4.0, 5.0] });
        let row = Plane { width: 4, height: 1, values: vec![1.0, 2.0, 6.0, 4.0] };
        // Centred: (1 + 1 + 2) / 3, then (6 + 4 + 4) / 3.
        assert_eq!(shrink(&row, 3).values, [4.0 / 3.0, 14.0 / 3.0]);
    }

    #[test]
    fn gaussians_sum_to_one_and_are_even() {
        let kernel = gaussian(11, 1.5);
        assert!((kernel.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        assert!((0..5).all(|i| kernel[i] == kernel[10 - i] && kernel[i] < kernel[i + 1]));
    }
}
