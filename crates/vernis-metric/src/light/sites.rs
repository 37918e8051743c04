//! The directions at which a BRDF is evaluated to fill a node table.
//!
//! [`Sampling::Points`] (descriptors of version 1) evaluates at the nodes: 12,800 directions.
//!
//! [`Sampling::Averages`] (version 2) gives every node its mean along theta_h,
//!
//!   value(i) = sum_t w_t hat_i(u_t) f(theta_t) / sum_t w_t hat_i(u_t),   w_t = g_t sin(theta_t) dtheta/du,
//!
//! with u the node coordinate (theta_h = 90 (u / 39)^2 deg), hat_i(u) = max(0, 1 - |u - i|) and g_t the weights of Gauss's rule: four
//! points in each of the first six intervals, where lobes of mirrors lie, and one in the others. A lobe narrower than the
//! distance of two nodes keeps its energy, wherever its peak. 57 x 16 x 20 = 18,240 directions.
//!
//! A direction with a cosine below 0.017 (about 89 deg) cannot be measured: the pair is evaluated at the nearest smaller
//! theta_d, in steps of 0.5 deg, at which it can, so that interpolation towards the horizon has something to hold on to. Nodes
//! with such a direction do not stand in place and take no part in angular means.

use super::node_table::{NODES, PHI_D, THETA_D, THETA_H, phi_d, theta_d, theta_h, theta_h_at};
use crate::math::coordinates::{HalfDifference, half_difference_directions};
use crate::math::{Rgb, Vec3};
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::OnceLock;

/// Cosine below which a direction counts as unmeasurable.
pub(super) const MIN_COSINE: f64 = 0.017;
/// Step by which an unmeasurable pair moves towards theta_d = 0, degrees.
const INWARD_STEP: f64 = 0.5;
/// Intervals of theta_h with four points each; the others have one.
const FINE_INTERVALS: usize = 6;
/// Copies of phi_d: the four quadrants of six nodes, those on the axes once.
const COPIES: usize = 4 * (PHI_D - 1);
/// Gauss's rule with four points on -1..1 (Abramowitz & Stegun 1964, table 25.4): points and weights of the positive half.
const GAUSS4: [(f64, f64); 2] =
    [(0.339_981_043_584_856_3, 0.652_145_154_862_546_1), (0.861_136_311_594_052_6, 0.347_854_845_137_453_9)];

/// What a node holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampling {
    /// The BRDF at the node, as an f32.
    Points,
    /// The mean of the BRDF about the node along theta_h.
    Averages,
}

/// Where a BRDF is evaluated, and how the nodes gather what is found.
#[derive(Debug)]
pub struct Sites {
    pub(super) wi: Vec<Vec3>,
    pub(super) wo: Vec<Vec3>,
    /// The entries of node n are `start[n]..start[n + 1]`.
    start: Vec<usize>,
    /// Direction and weight of each entry.
    entry: Vec<(u32, f64)>,
    /// Whether all directions of a node are those that belong there.
    pub(super) in_place: Vec<bool>,
}

impl Sites {
    /// The directions of a way to sample, made once a process.
    pub fn of(sampling: Sampling) -> &'static Self {
        static POINTS: OnceLock<Sites> = OnceLock::new();
        static AVERAGES: OnceLock<Sites> = OnceLock::new();
        match sampling {
            Sampling::Points => POINTS.get_or_init(Self::points),
            Sampling::Averages => AVERAGES.get_or_init(Self::averages),
        }
    }

    /// Unit directions of the light, +z being the normal.
    pub fn wi(&self) -> &[Vec3] {
        &self.wi
    }

    /// Unit directions of the viewer.
    pub fn wo(&self) -> &[Vec3] {
        &self.wo
    }

    /// Number of directions.
    pub fn len(&self) -> usize {
        self.wi.len()
    }

    /// Whether there is no direction.
    pub fn is_empty(&self) -> bool {
        self.wi.is_empty()
    }

    /// Directions and weights of a node.
    pub(super) fn entries(&self, node: usize) -> &[(u32, f64)] {
        &self.entry[self.start[node]..self.start[node + 1]]
    }

    /// The derivative of a number by the values of the BRDF, from its derivative by the nodes: the transpose of the gathering. Where
    /// every direction was measured; a negative value counts as 0 and has a derivative of 0.
    pub fn transpose(&self, values: &[Rgb], by_node: &[Rgb]) -> Vec<Rgb> {
        let mut by_value = vec![[0.0; 3]; self.len()];
        for (node, slope) in by_node.iter().enumerate() {
            let total: f64 = self.entries(node).iter().map(|e| e.1).sum();
            for &(site, weight) in self.entries(node) {
                let site = site as usize;
                for c in 0..3 {
                    if values[site][c] >= 0.0 {
                        by_value[site][c] += weight / total * slope[c];
                    }
                }
            }
        }
        by_value
    }

    fn empty() -> Self {
        Self { wi: vec![], wo: vec![], start: vec![0], entry: vec![], in_place: vec![] }
    }

    /// Adds the pair at (theta_h, theta_d, phi_d), degrees, moved inwards where it cannot be measured; whether it was not moved.
    fn add(&mut self, theta_h: f64, theta_d: f64, phi: f64) -> bool {
        let inward = inward(theta_h, theta_d, phi);
        let (wi, wo) = pair(theta_h, inward, phi);
        self.wi.push(wi);
        self.wo.push(wo);
        inward == theta_d
    }

    fn points() -> Self {
        let mut sites = Self::empty();
        for n in 0..NODES {
            let (i, j, k) = (n / (THETA_D * PHI_D), n / PHI_D % THETA_D, n % PHI_D);
            let phi = phi_d(k).to_radians();
            let quadrants: &[f64] = match k {
                0 => &[0.0, PI],
                _ if k + 1 == PHI_D => &[FRAC_PI_2, 3.0 * FRAC_PI_2],
                _ => &[phi, PI - phi, PI + phi, 2.0 * PI - phi],
            };
            // The quadrants move together.
            let inward = inward(theta_h(i), theta_d(j), phi);
            sites.in_place.push(inward == theta_d(j));
            for &phi in quadrants {
                let (wi, wo) = pair(theta_h(i), inward, phi);
                sites.entry.push((sites.wi.len() as u32, 1.0));
                sites.wi.push(wi);
                sites.wo.push(wo);
            }
            sites.start.push(sites.entry.len());
        }
        sites
    }

    fn averages() -> Self {
        let mut sites = Self::empty();
        let points = theta_h_points();
        let mut in_place = Vec::new();
        for &(u, _) in &points {
            for j in 0..THETA_D {
                for copy in 0..COPIES {
                    let phi = 2.0 * PI * copy as f64 / COPIES as f64;
                    in_place.push(sites.add(theta_h_at(u), theta_d(j), phi));
                }
            }
        }
        for n in 0..NODES {
            let (i, j, k) = (n / (THETA_D * PHI_D), n / PHI_D % THETA_D, n % PHI_D);
            // Multiples of 18 deg that are k after folding into 0..90 deg.
            let half = COPIES / 2;
            let copies: Vec<usize> = (0..COPIES).filter(|c| (c % half).min(half - c % half) == k).collect();
            let mut whole = true;
            for (t, &(u, measure)) in points.iter().enumerate() {
                let hat = 1.0 - (u - i as f64).abs();
                if hat <= 0.0 {
                    continue;
                }
                for copy in &copies {
                    let site = (t * THETA_D + j) * COPIES + copy;
                    sites.entry.push((site as u32, hat * measure));
                    whole &= in_place[site];
                }
            }
            sites.in_place.push(whole);
            sites.start.push(sites.entry.len());
        }
        sites
    }
}

/// Node coordinates of theta_h, and the measure sin(theta_h) dtheta_h of each.
fn theta_h_points() -> Vec<(f64, f64)> {
    let mut points = Vec::new();
    for interval in 0..THETA_H - 1 {
        let mut point = |x: f64, weight: f64| {
            let u = interval as f64 + 0.5 + 0.5 * x;
            // dtheta / du is proportional to u.
            points.push((u, 0.5 * weight * u * theta_h_at(u).to_radians().sin()));
        };
        if interval < FINE_INTERVALS {
            GAUSS4.iter().rev().for_each(|&(x, w)| point(-x, w));
            GAUSS4.iter().for_each(|&(x, w)| point(x, w));
        } else {
            point(0.0, 2.0);
        }
    }
    points
}

/// `theta_h`, `theta_d` in degrees, `phi` in radians.
fn pair(theta_h: f64, theta_d: f64, phi: f64) -> (Vec3, Vec3) {
    let (theta_h, theta_d) = (theta_h.to_radians(), theta_d.to_radians());
    half_difference_directions(HalfDifference { theta_h, theta_d, phi_d: phi })
}

/// The nearest theta_d, from `theta_d` inwards, at which both directions can be measured.
fn inward(theta_h: f64, theta_d: f64, phi: f64) -> f64 {
    let measurable = |theta_d: f64| {
        let (wi, wo) = pair(theta_h, theta_d, phi);
        wi.z.min(wo.z) >= MIN_COSINE
    };
    let mut theta = theta_d;
    while theta > 0.0 && !measurable(theta) {
        theta = (theta - INWARD_STEP).max(0.0);
    }
    theta
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_evaluation_is_above_the_horizon() {
        for (sampling, directions) in [(Sampling::Points, 12_800), (Sampling::Averages, 18_240)] {
            let sites = Sites::of(sampling);
            assert_eq!((sites.wi.len(), sites.in_place.len()), (directions, NODES));
            assert!(sites.wi.iter().chain(&sites.wo).all(|w| w.z >= MIN_COSINE));
            let in_place = sites.in_place.iter().filter(|p| **p).count();
            assert!(in_place > NODES / 2 && in_place < NODES, "{in_place}");
        }
    }

    #[test]
    fn averages_use_every_direction_and_hold_the_measure_of_the_hemisphere() {
        let sites = Sites::of(Sampling::Averages);
        let mut used = vec![false; sites.len()];
        (0..NODES).for_each(|n| sites.entries(n).iter().for_each(|e| used[e.0 as usize] = true));
        assert!(used.iter().all(|used| *used));
        // The measure of all points along theta_h is the integral of sin over 0..90 deg, up to the factor of dtheta / du.
        let total: f64 = theta_h_points().iter().map(|p| p.1).sum();
        let expected = f64::from(39 * 39) / PI;
        assert!((total / expected - 1.0).abs() < 1e-3, "{total} {expected}");
    }

    #[test]
    fn the_transpose_is_that_of_the_gathering() {
        let sites = Sites::of(Sampling::Averages);
        let value = |s: usize| 0.3 + (s as f64 * 0.37).sin().abs();
        let values: Vec<Rgb> = (0..sites.len()).map(|s| [value(s), value(s + 1), value(s + 2)]).collect();
        let slopes: Vec<Rgb> = (0..NODES).map(|n| [(n as f64).cos(), 1.0, (n as f64 * 0.1).sin()]).collect();
        let table = super::super::NodeTable::of_values(sites, &values).unwrap();
        let dot =
            |a: &[Rgb], b: &[Rgb]| -> f64 { a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a * b).sum() };
        let (left, right) = (dot(table.values(), &slopes), dot(&values, &sites.transpose(&values, &slopes)));
        assert!((left / right - 1.0).abs() < 1e-12, "{left} {right}");
    }
}
