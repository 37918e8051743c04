//! Wood by formula: planks with rings and fibres, filtered to what a pixel can show.
//!
//! Planks of width 0.5 lie along x. With n a smooth noise of mean 0 and range about +-1, k the number of the plank,
//!
//!   rings  = cos(2 pi (9 (z + 0.05 n(0.5 x, 1.5 z)) + 1.7 n(0.35 x, 0.8 k)))
//!   fibres = n(3 x, 90 z),   tone = n(17.3 k, 0)
//!   share  = 0.5 + 0.22 rings + 0.16 fibres + 0.18 tone
//!   albedo = dark + share (light - dark)
//!
//! Each term fades with the footprint w of the pixel as a Gaussian filter of standard deviation w / 2 makes it: by
//! exp(-2 (pi f w / 2)^2) for f periods a length. Nothing is left that could alias.

use std::f64::consts::PI;

const DARK: [f64; 3] = [0.24, 0.115, 0.045];
const LIGHT: [f64; 3] = [0.60, 0.365, 0.175];
/// Width of a plank.
const PLANK: f64 = 0.5;
/// Rings a length, across the planks.
const RINGS: f64 = 9.0;
/// Fibres a length, across the planks.
const FIBRES: f64 = 90.0;

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
        let plank = (z / PLANK).floor();
        let fibres = left(0.5 * FIBRES, footprint);
        let rings = left(RINGS, footprint);
        let mut share = 0.5 + 0.18 * noise(17.3 * plank, 0.5) * left(0.5 / PLANK, footprint);
        if rings > 1e-3 {
            let bend = 0.05 * noise(0.5 * x + 31.0 * plank, 1.5 * z);
            let shift = 1.7 * noise(0.35 * x, 0.8 * plank);
            share += 0.22 * rings * (2.0 * PI * (RINGS * (z + bend) + shift)).cos();
        }
        if fibres > 1e-3 {
            share += 0.16 * fibres * noise(3.0 * x + 57.0 * plank, FIBRES * z);
        }
        let share = share.clamp(0.0, 1.0);
        [0, 1, 2].map(|c| DARK[c] + share * (LIGHT[c] - DARK[c]))
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
                    let z = 0.013 * k as f64;
                    (Wood.albedo(0.3, z, w)[0] - Wood.albedo(0.3, z + 1.0 / FIBRES, w)[0]).abs()
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
