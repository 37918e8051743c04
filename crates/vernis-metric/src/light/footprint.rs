//! How a disc of half vectors spreads over the nodes of theta_h.
//!
//! A light cell that a pixel sees about one of its normals is not one half vector but a patch of them. It counts as a uniform disc
//! of radius 1 deg. For a disc about an angle c from the normal, the share of it within theta of the normal is
//!
//!   G(theta; c) = A(theta, 1 deg, c) / (pi (1 deg)^2),   A the overlap of two circles in the plane whose middles are c apart,
//!
//! and node i gets the integral of hat_i(u(theta)) dG, hat_i and u those of [`super::sites`]. Nodes that hold averages and half
//! vectors that are patches belong together: with both, the mean radiance of a mirror does not depend on how narrow its lobe is.
//!
//! Source of the overlap: Weisstein, "Circle-Circle Intersection", MathWorld, eq. 14.

use super::node_table::{THETA_H, theta_h_coordinate};
use std::f64::consts::PI;
use std::sync::OnceLock;

/// Radius of the disc, degrees.
const RADIUS: f64 = 1.0;
/// Discs whose middle is further from the normal lie well within the distance of two nodes, degrees.
pub(super) const LIMIT: f64 = 6.0;
/// Middles in the table, at LIMIT (k / (MIDDLES - 1))^2.
const MIDDLES: usize = 700;
/// Steps along theta in which a disc is integrated.
const STEPS: usize = 400;
/// Nodes that a disc may touch: the last is at 7 deg.
pub(super) const REACH: usize = 12;

/// Shares of the nodes of theta_h in a disc: those from `first` on, summing to 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shares {
    pub first: usize,
    pub share: [f64; REACH],
}

/// The shares of a disc about `theta_h` (degrees, at most [`LIMIT`]), those of the nearest middle in the table.
pub(super) fn shares(theta_h: f64) -> &'static Shares {
    static TABLE: OnceLock<Vec<Shares>> = OnceLock::new();
    let table =
        TABLE.get_or_init(|| (0..MIDDLES).map(|k| disc(LIMIT * (k as f64 / (MIDDLES - 1) as f64).powi(2))).collect());
    &table[(((MIDDLES - 1) as f64 * (theta_h / LIMIT).sqrt()).round() as usize).min(MIDDLES - 1)]
}

fn disc(middle: f64) -> Shares {
    let (from, to) = ((middle - RADIUS).max(0.0), middle + RADIUS);
    let first = theta_h_coordinate(from.to_radians()) as usize;
    let mut share = [0.0; REACH];
    let within = |theta: f64| overlap(theta, RADIUS, middle) / (PI * RADIUS * RADIUS);
    let at = |step: usize| from + (to - from) * step as f64 / STEPS as f64;
    let mut below = within(at(0));
    for step in 0..STEPS {
        let above = within(at(step + 1));
        let u = theta_h_coordinate((0.5 * (at(step) + at(step + 1))).to_radians());
        let node = (u as usize).min(THETA_H - 2);
        let fraction = u - node as f64;
        share[node - first] += (above - below) * (1.0 - fraction);
        share[node + 1 - first] += (above - below) * fraction;
        below = above;
    }
    let total: f64 = share.iter().sum();
    Shares { first, share: share.map(|s| s / total) }
}

/// Area common to circles of radii `r` and `s` whose middles are `distance` apart.
fn overlap(r: f64, s: f64, distance: f64) -> f64 {
    if r <= 0.0 || s <= 0.0 || distance >= r + s {
        return 0.0;
    }
    if distance <= (r - s).abs() {
        return PI * r.min(s).powi(2);
    }
    let d = distance;
    let angle = |a: f64, b: f64| ((d * d + a * a - b * b) / (2.0 * d * a)).clamp(-1.0, 1.0).acos();
    let kite = (-d + r + s) * (d + r - s) * (d - r + s) * (d + r + s);
    r * r * angle(r, s) + s * s * angle(s, r) - 0.5 * kite.max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::node_table::theta_h;

    #[test]
    fn circles_overlap_as_known() {
        assert_eq!((overlap(1.0, 2.0, 0.5), overlap(1.0, 1.0, 2.0)), (PI, 0.0));
        // Two unit circles one apart: 2 pi / 3 - sqrt(3) / 2.
        assert!((overlap(1.0, 1.0, 1.0) - (2.0 * PI / 3.0 - 3f64.sqrt() / 2.0)).abs() < 1e-12);
    }

    #[test]
    fn a_disc_is_spread_about_its_middle() {
        for middle in [0.0, 0.4, 1.0, 3.0, 6.0] {
            let shares = shares(middle);
            let of_node = |k: usize| shares.share[k] * theta_h(shares.first + k);
            let mean: f64 = (0..REACH).map(of_node).sum();
            assert!((shares.share.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            // The mean distance of a disc's points from its own middle is 2/3 of its radius, and tends to c far from it.
            let expected = if middle == 0.0 { 2.0 / 3.0 } else { middle.max(2.0 / 3.0) };
            assert!((mean - expected).abs() < 0.2, "{middle}: {mean} {expected}");
        }
    }
}
