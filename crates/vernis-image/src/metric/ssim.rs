//! SSIM: how much of the structure of the reference is left, on luma or on the codes of each channel.
//!
//!   SSIM(x, y) = (2 mx my + C1) (2 sxy + C2) / ((mx^2 + my^2 + C1) (sx^2 + sy^2 + C2))
//!
//! mx, my: means over a window, weighted by a Gaussian; sx^2, sy^2, sxy: variances and covariance with the same weights (sums of
//! weights 1: not the estimate of a sample); C1 = (0.01 L)^2, C2 = (0.03 L)^2 with L = 255, the range of the codes. The window has
//! 11 x 11 pixels and sigma 1.5 pixels. The number is the mean over all places where the whole window fits.
//!
//! | name | values |
//! | --- | --- |
//! | `ssim` | luma of BT.601, 0.299 R + 0.587 G + 0.114 B, of the codes, not rounded |
//! | `ssim-y709` | luma of BT.709, 0.2126 R + 0.7152 G + 0.0722 B |
//! | `ssim-rgb` | the mean of the SSIM of R, G and B |
//!
//! Source: Wang, Bovik, Sheikh and Simoncelli 2004, equations 12 to 15 (doi:10.1109/TIP.2003.819861). The authors' program shrinks
//! large pictures first; like most libraries, this one does not. Agrees with scikit-image's `structural_similarity`
//! (gaussian_weights, sigma 1.5, use_sample_covariance False, data_range 255) within 1e-6.
//!
//! Display: none; the codes stand for what is seen, so contrast at low and at high luminance counts by code. Blind to: colour
//! (`ssim-rgb` sees it by channel), viewing distance, where differences are large but structure is kept (a shift of brightness).
//!
//! Cost: 44 multiplications a pixel down and along, no memory beyond two planes.

use super::colour::{LUMA_REC601, LUMA_REC709, channel, luma};
use super::contract::{Comparison, Conditions, DifferenceMap, ImageMetric, PreparedResult, Properties, by_features};
use super::plane::{Plane, ROWS, correlate_row, gaussian};
use crate::picture::EncodedPicture;
use multiversion::multiversion;
use vernis_metric::math::parallel;

/// Raised when a value changes by more than rounding.
pub const VERSION: u32 = 1;

/// Side of the window, in pixels.
pub(super) const WINDOW: usize = 11;
/// Standard deviation of the window's weights, in pixels.
pub(super) const SIGMA: f64 = 1.5;
/// K1 and K2 of the paper.
const K: [f64; 2] = [0.01, 0.03];

/// Which values of a picture are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// Luma of BT.601.
    LumaRec601,
    /// Luma of BT.709.
    LumaRec709,
    /// Each channel alone.
    Channels,
}

/// SSIM of some values of the pictures.
#[derive(Clone, Copy, Debug)]
pub struct Ssim(pub Values);

impl Ssim {
    fn planes(self, picture: &EncodedPicture) -> Vec<Plane> {
        match self.0 {
            Values::LumaRec601 => vec![luma(picture, &LUMA_REC601)],
            Values::LumaRec709 => vec![luma(picture, &LUMA_REC709)],
            Values::Channels => (0..3).map(|c| channel(picture, c)).collect(),
        }
    }
}

impl ImageMetric for Ssim {
    fn name(&self) -> &'static str {
        match self.0 {
            Values::LumaRec601 => "ssim",
            Values::LumaRec709 => "ssim-y709",
            Values::Channels => "ssim-rgb",
        }
    }

    fn version(&self) -> u32 {
        VERSION
    }

    fn properties(&self) -> Properties {
        let source = "Wang et al. 2004, doi:10.1109/TIP.2003.819861";
        Properties {
            larger_is_better: true,
            distance: "1 - SSIM",
            smallest: WINDOW,
            ..Properties::new("mean structural similarity", "1, -1 to 1", source)
        }
    }

    fn prepare_checked(&self, reference: &EncodedPicture, _: &Conditions) -> PreparedResult {
        let metric = *self;
        by_features(
            reference,
            move |picture| metric.planes(picture),
            |a, b, with_map| of_similarity(a.iter().zip(b).map(|(a, b)| similarity(a, b, 255.0, with_map)).collect()),
        )
    }
}

/// The mean over planes, with the map where every plane has one.
pub(super) fn of_similarity(planes: Vec<Similarity>) -> Comparison {
    let quality = planes.iter().map(|s| s.ssim).sum::<f64>() / planes.len() as f64;
    let map = map_of(planes.into_iter().filter_map(|s| s.map).collect());
    Comparison { distance: 1.0 - quality, quality, details: vec![], map }
}

/// 1 - SSIM at every place of the window, the mean over planes; `None` where there are none.
pub(super) fn map_of(planes: Vec<Plane>) -> Option<DifferenceMap> {
    let (width, height) = planes.first().map(|p| (p.width, p.height))?;
    let mean = |i: usize| planes.iter().map(|p| p.values[i]).sum::<f64>() / planes.len() as f64;
    let values = (0..width * height).map(|i| (1.0 - mean(i)) as f32).collect();
    Some(DifferenceMap { width, height, values, white: 1.0 })
}

/// What SSIM says of two planes.
pub(super) struct Similarity {
    /// The mean SSIM.
    pub ssim: f64,
    /// The mean of its second factor alone, (2 sxy + C2)/(sx^2 + sy^2 + C2): contrast and structure.
    pub contrast_structure: f64,
    /// SSIM at every place of the window, if asked for.
    pub map: Option<Plane>,
}

/// SSIM of two planes whose values range over `range`.
pub(super) fn similarity(a: &Plane, b: &Plane, range: f64, with_map: bool) -> Similarity {
    let kernel = gaussian(WINDOW, SIGMA);
    let [c1, c2] = K.map(|k| (k * range).powi(2));
    let (width, height) = (a.width + 1 - WINDOW, a.height + 1 - WINDOW);
    let row = |buffers: &mut Buffers, y: usize| {
        let rows = |plane: &'_ Plane, j: usize| -> std::ops::Range<usize> {
            let start = (y + j) * plane.width;
            start..start + plane.width
        };
        let window: [_; WINDOW] = std::array::from_fn(|j| (&a.values[rows(a, j)], &b.values[rows(b, j)]));
        moments_down(&window, &kernel, &mut buffers.down);
        for (down, along) in buffers.down.iter().zip(&mut buffers.along) {
            correlate_row(down, &kernel, along);
        }
        let [ma, mb, square, product] = &buffers.along;
        let mut sums = [0.0; 2];
        let mut map = Vec::with_capacity(if with_map { width } else { 0 });
        for x in 0..width {
            let (ma, mb) = (ma[x], mb[x]);
            let (means, product_of_means) = (ma * ma + mb * mb, ma * mb);
            let contrast_structure = (2.0 * (product[x] - product_of_means) + c2) / (square[x] - means + c2);
            let ssim = (2.0 * product_of_means + c1) / (means + c1) * contrast_structure;
            sums[0] += ssim;
            sums[1] += contrast_structure;
            if with_map {
                map.push(ssim);
            }
        }
        (sums, map)
    };
    let rows = parallel::map(height.div_ceil(ROWS), |k| -> Vec<_> {
        let mut buffers = Buffers::new(a.width, width);
        (k * ROWS..height.min((k + 1) * ROWS)).map(|y| row(&mut buffers, y)).collect()
    });
    let (sums, map): (Vec<[f64; 2]>, Vec<Vec<f64>>) = rows.into_iter().flatten().unzip();
    let count = (width * height) as f64;
    let [ssim, contrast_structure] = [0, 1].map(|k| sums.iter().map(|s| s[k]).sum::<f64>() / count);
    Similarity { ssim, contrast_structure, map: with_map.then(|| Plane { width, height, values: map.concat() }) }
}

/// Room for a row: weighted sums of a, b, a^2 + b^2 and ab.
struct Buffers {
    down: [Vec<f64>; 4],
    along: [Vec<f64>; 4],
}

impl Buffers {
    fn new(width: usize, out: usize) -> Self {
        Self { down: std::array::from_fn(|_| vec![0.0; width]), along: std::array::from_fn(|_| vec![0.0; out]) }
    }
}

/// Pixels that are summed side by side.
const LANES: usize = 4;

/// The weighted sums of the rows of a window. SSIM needs both variances only in their sum.
#[multiversion(targets("x86_64+avx2"))]
fn moments_down(window: &[(&[f64], &[f64]); WINDOW], kernel: &[f64], sums: &mut [Vec<f64>; 4]) {
    let width = sums[0].len();
    let whole = width - width % LANES;
    let [to_a, to_b, to_square, to_product] = sums;
    for x in (0..whole).step_by(LANES) {
        let (mut sa, mut sb, mut square, mut product) = ([0.0; LANES], [0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for ((a, b), w) in window.iter().zip(kernel) {
            let (a, b) = (&a[x..x + LANES], &b[x..x + LANES]);
            for i in 0..LANES {
                let (wa, wb) = (w * a[i], w * b[i]);
                sa[i] += wa;
                sb[i] += wb;
                square[i] += wa * a[i] + wb * b[i];
                product[i] += wa * b[i];
            }
        }
        to_a[x..x + LANES].copy_from_slice(&sa);
        to_b[x..x + LANES].copy_from_slice(&sb);
        to_square[x..x + LANES].copy_from_slice(&square);
        to_product[x..x + LANES].copy_from_slice(&product);
    }
    for x in whole..width {
        let terms = || window.iter().zip(kernel).map(|((a, b), w)| (a[x], b[x], w));
        to_a[x] = terms().map(|(a, _, w)| w * a).sum();
        to_b[x] = terms().map(|(_, b, w)| w * b).sum();
        to_square[x] = terms().map(|(a, b, w)| w * (a * a + b * b)).sum();
        to_product[x] = terms().map(|(a, b, w)| w * a * b).sum();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where both pictures are even, variances vanish and SSIM is (2 a b + C1)/(a^2 + b^2 + C1).
    #[test]
    fn even_pictures_have_the_closed_form() {
        let even = |v: f64| Plane { width: 13, height: 12, values: vec![v; 13 * 12] };
        let found = similarity(&even(100.0), &even(150.0), 255.0, true);
        let c1 = (0.01f64 * 255.0).powi(2);
        let expected = (2.0 * 100.0 * 150.0 + c1) / (100.0f64.powi(2) + 150.0f64.powi(2) + c1);
        assert!((found.ssim - expected).abs() < 1e-12, "{} {expected}", found.ssim);
        assert!((found.contrast_structure - 1.0).abs() < 1e-9);
        let map = found.map.expect("asked for");
        assert_eq!((map.width, map.height), (3, 2));
        assert!(map.values.iter().all(|v| (v - expected).abs() < 1e-12));
    }
}
