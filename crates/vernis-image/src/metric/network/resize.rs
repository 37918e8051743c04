//! The picture as MatSim takes it: its shorter side made 256 pixels, then the middle 224 x 224.
//!
//! Codes of 8 bits are resized as Pillow does it (`Image.resize` with `BILINEAR`): a triangle filter that grows with the reduction,
//! rows first, weights rounded to 22 binary digits and results to whole codes after each of the two passes. Crates that resize
//! pictures round elsewhere; a code that is off by one moves the metric by more than its tolerance.
//!
//! Only what the middle needs is computed, so that memory does not depend on the shape of the picture.

use crate::picture::EncodedPicture;

/// Pixels of the shorter side.
const SHORTER: usize = 256;
/// Side of the middle, in pixels.
pub(super) const SIDE: usize = 224;
/// Binary digits of a weight.
const DIGITS: u32 = 22;

/// Weights of one place of a resized line: of `from` and those that follow.
struct Window {
    from: usize,
    weights: Vec<i64>,
}

/// The windows of the middle [`SIDE`] of `to` places, made of `count`.
fn windows(count: usize, to: usize) -> Vec<Window> {
    let scale = count as f64 / to as f64;
    let support = scale.max(1.0);
    let first = middle(to);
    let window = |place: usize| {
        let centre = (place as f64 + 0.5) * scale;
        let from = (centre - support + 0.5).max(0.0) as usize;
        let end = ((centre + support + 0.5) as usize).min(count);
        let weight = |i: usize| (1.0 - ((i as f64 - centre + 0.5) / support).abs()).max(0.0);
        let weights: Vec<f64> = (from..end).map(weight).collect();
        let sum: f64 = weights.iter().sum();
        let whole = |w: &f64| (0.5 + w / sum * f64::from(1u32 << DIGITS)) as i64;
        Window { from, weights: weights.iter().map(whole).collect() }
    };
    (first..first + SIDE).map(window).collect()
}

/// Where the middle begins: half of the rest, rounded to the even neighbour as Python does.
fn middle(side: usize) -> usize {
    ((side - SIDE) as f64 / 2.0).round_ties_even() as usize
}

impl Window {
    /// The code here; `value` gives those of the line.
    fn code(&self, value: impl Fn(usize) -> u8) -> u8 {
        let sum: i64 = self.weights.iter().enumerate().map(|(k, w)| w * i64::from(value(self.from + k))).sum();
        ((sum + (1 << (DIGITS - 1))) >> DIGITS).clamp(0, 255) as u8
    }
}

/// The codes of the middle, row by row. Codes that are not whole are rounded first.
pub(super) fn resized_middle(picture: &EncodedPicture) -> Vec<[u8; 3]> {
    let (width, height) = (picture.width(), picture.height());
    let shorter = width.min(height);
    let size =
        |side: usize| if side == shorter { SHORTER } else { (SHORTER as u64 * side as u64 / shorter as u64) as usize };
    let (columns, rows) = (windows(width, size(width)), windows(height, size(height)));
    let start = rows.first().map_or(0, |window| window.from);
    let end = rows.last().map_or(0, |window| window.from + window.weights.len());
    let mut narrow = Vec::with_capacity((end - start) * SIDE);
    for row in picture.pixels()[start * width..end * width].chunks_exact(width) {
        let at = |column: &Window| std::array::from_fn(|c| column.code(|x| row[x][c].round() as u8));
        narrow.extend(columns.iter().map(at));
    }
    let at = |row: &Window, x: usize| -> [u8; 3] {
        std::array::from_fn(|c| {
            row.code(|y| {
                let pixel: &[u8; 3] = &narrow[(y - start) * SIDE + x];
                pixel[c]
            })
        })
    };
    rows.iter().flat_map(|row| (0..SIDE).map(move |x| at(row, x))).collect()
}
