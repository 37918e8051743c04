//! The steerable pyramid: a picture as bands of spatial frequency, each in four orientations, and back.
//!
//! picture = high-pass residue + low0; low0 -> four oriented bands and a low-pass of half the size; that again, while both sides have
//! the 17 pixels of the low-pass filter; then a low-pass residue. Beyond the border the picture is mirrored about its outermost pixels
//! (`reflect1`). The same filters, turned by half a turn, take the bands back.
//!
//! Source: Simoncelli and Freeman 1995 (doi:10.1109/ICIP.1995.537667); taps: `sp3_filters.txt`. Own code: no crate has it.

use crate::metric::plane::Plane;
use multiversion::multiversion;
use std::sync::LazyLock;
use vernis_metric::math::parallel;

/// Orientations.
const ORIENTATIONS: usize = 4;

/// Taps of a square filter, row by row.
#[derive(Clone, Debug)]
struct Filter {
    side: usize,
    taps: Vec<f64>,
}

impl Filter {
    /// Turned by half a turn.
    fn turned(&self) -> Self {
        Self { side: self.side, taps: self.taps.iter().rev().copied().collect() }
    }
}

struct Filters {
    high: Filter,
    low_first: Filter,
    low: Filter,
    bands: [Filter; ORIENTATIONS],
}

/// The taps are compiled in, so that reading them cannot fail where the tests pass.
static FILTERS: LazyLock<Filters> = LazyLock::new(|| {
    let text = include_str!("sp3_filters.txt");
    let block = |name: &str| {
        let mut lines = text.lines().skip_while(|line| line.split(' ').next() != Some(name));
        let side = lines.next().and_then(|line| line.split(' ').nth(1)?.parse().ok()).unwrap_or(0);
        let taps = lines.take(side).flat_map(|line| line.split(' ').filter_map(|tap| tap.parse().ok())).collect();
        Filter { side, taps }
    };
    Filters {
        high: block("high"),
        low_first: block("low-first"),
        low: block("low"),
        bands: ["band-0", "band-1", "band-2", "band-3"].map(block),
    }
});

/// The smallest picture that has a level.
pub(super) const SMALLEST: usize = 17;

/// A picture's bands.
#[derive(Clone, Debug)]
pub(super) struct Pyramid {
    /// From fine to coarse: the high-pass residue (one plane), levels (four each), the low-pass residue (one).
    pub levels: Vec<Vec<Plane>>,
}

impl Pyramid {
    /// The pyramid of a picture.
    pub fn of(picture: &Plane) -> Self {
        let filters = &*FILTERS;
        let mut levels = vec![vec![correlate(picture, &filters.high)]];
        let mut low = correlate(picture, &filters.low_first);
        while low.width.min(low.height) >= SMALLEST {
            levels.push(filters.bands.iter().map(|band| correlate(&low, band)).collect());
            low = halved(&correlate(&low, &filters.low));
        }
        levels.push(vec![low]);
        Self { levels }
    }

    /// The picture of these bands.
    pub fn picture(&self) -> Plane {
        let filters = &*FILTERS;
        let last = self.levels.len() - 1;
        let mut low = self.levels[last][0].clone();
        for level in self.levels[1..last].iter().rev() {
            let size = &level[0];
            let mut sum = correlate(&doubled(&low, size.width, size.height), &filters.low.turned());
            for (band, filter) in level.iter().zip(&filters.bands) {
                sum = add(&sum, &correlate(band, &filter.turned()));
            }
            low = sum;
        }
        add(&correlate(&low, &filters.low_first.turned()), &correlate(&self.levels[0][0], &filters.high.turned()))
    }
}

fn add(a: &Plane, b: &Plane) -> Plane {
    Plane::of_two(a, b, |a, b| a + b)
}

/// Every second pixel of every second row.
fn halved(plane: &Plane) -> Plane {
    Plane::by_rows(plane.width.div_ceil(2), plane.height.div_ceil(2), |y, out| {
        let row = plane.row(2 * y);
        out.iter_mut().enumerate().for_each(|(x, v)| *v = row[2 * x]);
    })
}

/// The pixels at even places of a plane of this size, and 0 between them.
fn doubled(plane: &Plane, width: usize, height: usize) -> Plane {
    Plane::by_rows(width, height, |y, out| {
        if y % 2 == 0 {
            let row = plane.row(y / 2);
            out.iter_mut().step_by(2).zip(row).for_each(|(to, from)| *to = *from);
        }
    })
}

/// Correlation with a filter.
fn correlate(plane: &Plane, filter: &Filter) -> Plane {
    let (width, height, reach) = (plane.width, plane.height, filter.side / 2);
    let mirror = |i: usize, n: usize| {
        // i counts from `reach` before the first pixel, which is at most one side away.
        let from = i.abs_diff(reach);
        if from < n { from } else { 2 * (n - 1) - from }
    };
    let padded = Plane::by_rows(width + 2 * reach, height + 2 * reach, |y, out| {
        let row = plane.row(mirror(y, height));
        out[reach..reach + width].copy_from_slice(row);
        for x in (0..reach).chain(reach + width..width + 2 * reach) {
            out[x] = row[mirror(x, width)];
        }
    });
    let mut values = vec![0.0; width * height];
    parallel::for_each_chunk(&mut values, width, |y, out| {
        let stride = padded.width;
        correlate_rows(&padded.values[y * stride..(y + filter.side) * stride], stride, filter.side, &filter.taps, out);
    });
    Plane { width, height, values }
}

/// Pixels that are summed side by side: four registers of AVX2.
const LANES: usize = 16;

/// A row of a correlation: of `side` rows of `stride` values each.
#[multiversion(targets("x86_64+avx2"))]
fn correlate_rows(rows: &[f64], stride: usize, side: usize, taps: &[f64], out: &mut [f64]) {
    let width = out.len();
    let whole = width - width % LANES;
    for x in (0..whole).step_by(LANES) {
        let mut sums = [0.0; LANES];
        for (row, taps) in rows.chunks_exact(stride).zip(taps.chunks_exact(side)) {
            for (i, tap) in taps.iter().enumerate() {
                for (sum, value) in sums.iter_mut().zip(&row[x + i..x + i + LANES]) {
                    *sum += tap * value;
                }
            }
        }
        out[x..x + LANES].copy_from_slice(&sums);
    }
    for x in whole..width {
        let row_sum = |(row, taps): (&[f64], &[f64])| taps.iter().zip(&row[x..]).map(|(t, v)| t * v).sum::<f64>();
        out[x] = rows.chunks_exact(stride).zip(taps.chunks_exact(side)).map(row_sum).sum();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_filter_was_read_whole() {
        let filters = &*FILTERS;
        assert_eq!([filters.high.side, filters.low_first.side, filters.low.side], [15, 9, 17]);
        let all = [&filters.high, &filters.low_first, &filters.low].into_iter().chain(&filters.bands);
        assert!(all.clone().all(|f| f.taps.len() == f.side * f.side && f.side > 0));
        // What is even has no detail, and passes the low-pass filters whole.
        let sums: Vec<f64> = all.map(|f| f.taps.iter().sum()).collect();
        assert!(sums[0].abs() < 0.01 && (sums[1] - 1.0).abs() < 0.01 && (sums[2] - 2.0).abs() < 0.02, "{sums:?}");
        assert!(sums[3..].iter().all(|s| s.abs() < 0.01), "{sums:?}");
    }

    /// The filters rebuild a picture but for some percent of it. Not at its border, where odd bands are mirrored as even ones.
    #[test]
    fn a_picture_comes_back() {
        for (width, height) in [(64, 48), (51, 37)] {
            let value = |x: usize, y: usize| ((x as f64 * 0.37).sin() + (y as f64 * 0.23).cos()) * 10.0;
            let picture = Plane::by_rows(width, height, |y, row| {
                row.iter_mut().enumerate().for_each(|(x, v)| *v = value(x, y));
            });
            let pyramid = Pyramid::of(&picture);
            let sizes: Vec<usize> = pyramid.levels.iter().map(Vec::len).collect();
            assert_eq!(sizes, [1, 4, 4, 1]);
            let back = pyramid.picture();
            for y in 16..height - 16 {
                for x in 16..width - 16 {
                    let error = (picture.row(y)[x] - back.row(y)[x]).abs();
                    assert!(error < 0.8, "{width} {height}, {x} {y}: {error}");
                }
            }
        }
    }
}
