//! Wood by formula: planks cut from trunks, with rings and fibres, filtered to what a pixel can show.
//!
//! Planks of width 0.5 lie along z. With n a smooth noise of mean 0 and range about +-1, k the number of the plank, u the distance from its
//! middle and h_k, g_k numbers of the plank from -1 to 1,
//!
//!   r      = sqrt((u + 0.2 h_k)^2 + (0.1 + 0.05 z g_k + 0.05 n(2 u, 0.7 z))^2), the distance from the heart of the trunk
//!   rings  = cos(2 pi (14 r + 0.5 n(3 u, 0.5 z)))
//!   fibres = n(110 x, 3 z)
//!   share  = 0.5 + 0.16 rings + 0.18 fibres + 0.2 g_k
//!   albedo = dark + share (light - dark), times 0.35 in a seam of width 0.006 between planks
//!
//! Each term fades with the footprint w of the pixel as a Gaussian filter of standard deviation w / 2 makes it: by
//! exp(-(pi f w)^2 / 2) for f periods a length; a seam by the share of the footprint that it fills. Nothing is left that could alias.

use std::f64::consts::PI;

const DARK: [f64; 3] = [0.24, 0.115, 0.045];
const LIGHT: [f64; 3] = [0.60, 0.365, 0.175];
/// Width of a plank.
const PLANK: f64 = 0.5;
/// Rings a length, away from the heart.
const RINGS: f64 = 14.0;
/// Fibres a length, across the planks.
const FIBRES: f64 = 110.0;
/// Width of the seam between two planks, and what it leaves of the light.
const SEAM: (f64, f64) = (0.006, 0.35);

/// The wood of the study's table: a Lambert reflector whose albedo follows the formula.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Wood;

/// A number from -1 to 1 for a lattice point.
fn hashed(x: i64, y: i64) -> f64 {
    let mut h = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    h = (h ^ (h >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    h = (h ^ (h >> 32)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((h ^ (h >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// Smooth noise: hashed lattice points, joined by smoothstep.
fn noise(x: f64, y: f64) -> f64 {
    let (x0, y0) = (x.floor(), y.floor());
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (u, v) = (smooth(x - x0), smooth(y - y0));
    let at = |dx: i64, dy: i64| hashed(x0 as i64 + dx, y0 as i64 + dy);
    let row = |dy: i64| at(0, dy) + u * (at(1, dy) - at(0, dy));
    row(0) + v * (row(1) - row(0))
}

/// What a Gaussian of standard deviation w / 2 leaves of f periods a length.
fn left(f: f64, w: f64) -> f64 {
    (-0.5 * (PI * f * w).powi(2)).exp()
}

impl Wood {
    /// Albedo at (x, z) as a pixel sees it that covers about `footprint` of the table.
    pub fn albedo(self, x: f64, z: f64, footprint: f64) -> [f64; 3] {
        let plank = (x / PLANK).floor();
        let u = x - PLANK * (plank + 0.5);
        let [h, g] = [1, 2].map(|k| hashed(plank as i64, k));
        let fibres = left(0.5 * FIBRES, footprint);
        let rings = left(RINGS, footprint);
        let mut share = 0.5 + 0.2 * g * left(0.5 / PLANK, footprint);
        if rings > 1e-3 {
            let off = 31.0 * plank;
            let depth = 0.1 + 0.05 * z * g + 0.05 * noise(2.0 * u + off, 0.7 * z);
            let r = (u + 0.2 * h).hypot(depth);
            share += 0.16 * rings * (2.0 * PI * (RINGS * r + 0.5 * noise(3.0 * u + off, 0.5 * z + 7.0))).cos();
        }
        if fibres > 1e-3 {
            share += 0.18 * fibres * noise(FIBRES * x, 3.0 * z + 57.0 * plank);
        }
        let share = share.clamp(0.0, 1.0);
        let (width, dark) = SEAM;
        let seam = (0.5 * (width + footprint) - (0.5 * PLANK - u.abs())).clamp(0.0, width.min(footprint.max(1e-6)));
        let light = 1.0 - (1.0 - dark) * (seam / footprint.max(1e-6)).min(1.0);
        [0, 1, 2].map(|c| light * (DARK[c] + share * (LIGHT[c] - DARK[c])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_pixel_sees_is_about_the_mean_of_what_it_covers() {
        // Far away, nothing is left but the mean; near, the grain.
        let far: Vec<f64> = (0..50).map(|k| Wood.albedo(0.1 * k as f64, 0.037 * k as f64, 5.0)[1]).collect();
        let near: Vec<f64> = (0..50).map(|k| Wood.albedo(0.1 * k as f64, 0.037 * k as f64, 0.0)[1]).collect();
        let spread = |v: &[f64]| v.iter().fold(f64::MIN, |a, b| a.max(*b)) - v.iter().fold(f64::MAX, |a, b| a.min(*b));
        assert!(spread(&far) < 0.01 && spread(&near) > 0.1, "{} {}", spread(&far), spread(&near));
        // A footprint of 0.1 hides fibres: neighbours a fibre apart look alike.
        let apart = |w: f64| {
            (0..200)
                .map(|k| {
                    let x = 0.0013 * k as f64;
                    (Wood.albedo(x, 0.3, w)[0] - Wood.albedo(x + 1.0 / FIBRES, 0.3, w)[0]).abs()
                })
                .fold(0.0, f64::max)
        };
        assert!(apart(0.12) < 0.5 * apart(0.0));
    }

    #[test]
    fn albedos_are_those_of_a_material() {
        for k in 0..1000 {
            let a = Wood.albedo(0.37 * k as f64 - 100.0, 0.11 * k as f64 - 40.0, 0.001 * (k % 7) as f64);
            assert!(a.iter().all(|v| (0.0..1.0).contains(v)));
        }
    }
}
