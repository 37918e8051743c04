//! The geometry of the local windows of a picture: the same for every picture of a shape.
//!
//! Local moments are over 7 x 7 windows around each pixel of the disc, on a pyramid of 2 x 2 means; pixels off the disc
//! take no part.

use crate::light::shape::{SIDE, Shape};

const WINDOW_RADIUS: usize = 3;
const SCALES: usize = 4;

/// The pixels of a picture at one level of the pyramid.
#[derive(Debug, Clone)]
pub(super) struct Level {
    pub side: usize,
    /// Share of each pixel that lies on the disc, 0 to 1.
    pub coverage: Vec<f64>,
    /// Positions of the pixels with any share.
    pub cells: Vec<usize>,
    /// Covered area in the window of each entry of `cells`, pixels.
    pub window: Vec<f64>,
}

/// The geometry of the windows, the same for every picture of a shape.
#[derive(Debug, Clone)]
pub struct Frame {
    weights: Vec<f64>,
    pub(super) levels: Vec<Level>,
}

impl Level {
    fn new(side: usize, coverage: Vec<f64>) -> Self {
        let cells: Vec<usize> = (0..side * side).filter(|&c| coverage[c] > 0.0).collect();
        let areas = window_sums(side, &coverage);
        let window = cells.iter().map(|&c| areas[c]).collect();
        Self { side, coverage, cells, window }
    }

    /// Mean over the window of each pixel of an image that has been multiplied by the coverage.
    pub fn window_means(&self, covered: &[f64]) -> Vec<f64> {
        let sums = window_sums(self.side, covered);
        self.cells.iter().zip(&self.window).map(|(&c, area)| sums[c] / area).collect()
    }

    /// Adds to the slopes by an image those that come through its window means, `by_mean` (one entry a cell): the transpose of
    /// covering and [`Level::window_means`].
    pub fn add_transposed(&self, by_mean: impl Iterator<Item = f64>, by_image: &mut [f64]) {
        let mut scattered = vec![0.0; self.side * self.side];
        self.cells.iter().zip(&self.window).zip(by_mean).for_each(|((&c, area), slope)| scattered[c] = slope / area);
        let sums = window_sums(self.side, &scattered);
        by_image.iter_mut().zip(&self.coverage).zip(sums).for_each(|((to, share), sum)| *to += share * sum);
    }

    /// `image` times coverage.
    pub fn cover(&self, image: impl Iterator<Item = f64>) -> Vec<f64> {
        self.coverage.iter().zip(image).map(|(share, v)| share * v).collect()
    }
}

/// Sums over 7 x 7 windows, clipped at the border.
pub(super) fn window_sums(side: usize, image: &[f64]) -> Vec<f64> {
    let span = |at: usize| at.saturating_sub(WINDOW_RADIUS)..(at + WINDOW_RADIUS + 1).min(side);
    let mut horizontal = vec![0.0; side * side];
    for row in 0..side {
        for column in 0..side {
            horizontal[row * side + column] = image[row * side..][span(column)].iter().sum();
        }
    }
    let mut sums = vec![0.0; side * side];
    for row in 0..side {
        for r in span(row) {
            for column in 0..side {
                sums[row * side + column] += horizontal[r * side + column];
            }
        }
    }
    sums
}

/// Means of 2 x 2 blocks.
fn block_means(side: usize, image: &[f64]) -> Vec<f64> {
    let half = side / 2;
    (0..half * half)
        .map(|c| {
            let at = 2 * (c / half) * side + 2 * (c % half);
            0.25 * (image[at] + image[at + 1] + image[at + side] + image[at + side + 1])
        })
        .collect()
}

impl Frame {
    /// Prepares the windows for pictures of `shape`.
    pub fn new(shape: &Shape) -> Self {
        let mut coverage = vec![0.0; SIDE * SIDE];
        shape.cells().iter().for_each(|&c| coverage[c] = 1.0);
        let mut levels = vec![Level::new(SIDE, coverage)];
        for scale in 1..SCALES {
            let finer = &levels[scale - 1];
            levels.push(Level::new(finer.side / 2, block_means(finer.side, &finer.coverage)));
        }
        Self { weights: shape.weights().to_vec(), levels }
    }

    /// Share of the shape that each pixel shows.
    pub(super) fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Means over the covered part of each 2 x 2 block of a picture on level `scale - 1`.
    pub(super) fn reduce(&self, scale: usize, image: &[f64]) -> Vec<f64> {
        let finer = &self.levels[scale - 1];
        let covered = block_means(finer.side, &finer.cover(image.iter().copied()));
        let share = |(v, c): (f64, &f64)| if *c > 0.0 { v / c } else { 0.0 };
        covered.into_iter().zip(&self.levels[scale].coverage).map(share).collect()
    }

    /// Slopes by a picture on level `scale - 1` from those by its reduction: the transpose of [`Frame::reduce`].
    pub(super) fn reduce_transposed(&self, scale: usize, by_reduced: &[f64]) -> Vec<f64> {
        let (finer, coarser) = (&self.levels[scale - 1], &self.levels[scale]);
        let of_cell = |c: usize| {
            let block = c / finer.side / 2 * coarser.side + c % finer.side / 2;
            let share = coarser.coverage[block];
            if share > 0.0 { 0.25 * finer.coverage[c] / share * by_reduced[block] } else { 0.0 }
        };
        (0..finer.side * finer.side).map(of_cell).collect()
    }
}
