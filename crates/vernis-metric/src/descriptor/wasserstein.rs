//! How far the values of two BRDFs are from each other as distributions, wherever on the hemisphere they occur.
//!
//!   W_c = integral over p of |q_B(p) - q_A(p)|,
//!
//! the 1-Wasserstein distance on the line (Villani 2003, Topics in Optimal Transportation, remark 2.19 iii), q_A and q_B
//! the quantiles of f_c^(1/4) over the sampled nodes of reference and candidate, c one of R, G, B and luminance. A node
//! weighs sin theta_h dtheta_h sin theta_d dtheta_d, the solid angles of half and difference vector. The fourth root makes
//! highlights and diffuse floors comparable. The integral is the mean over 256 levels (i + 0.5) / 256.
//!
//! Cost: four sorts of 3,840 values a BRDF, then 1,024 differences a pair.

use super::regions::spacing;
use crate::light::node_table::{NODES, NodeTable, PHI_D, THETA_D, THETA_H, theta_d, theta_h};
use crate::math::color::luminance;

const LEVELS: usize = 256;

/// Names without their family.
pub const NAMES: [&str; 4] = ["r", "g", "b", "y"];

/// Quantiles of the fourth root of R, G, B and Y.
#[derive(Debug, Clone)]
pub struct ValueQuantiles {
    channels: [Vec<f32>; 4],
}

impl ValueQuantiles {
    /// The quantiles of the sampled nodes of `table`.
    pub fn new(table: &NodeTable) -> Self {
        let weights: Vec<f64> = (0..NODES).map(solid_angle).collect();
        let channels = std::array::from_fn(|c| {
            let value = |n: usize| {
                let f = table.values()[n];
                if c < 3 { f[c] } else { luminance(f) }.sqrt().sqrt()
            };
            let samples: Vec<(f64, f64)> =
                (0..NODES).filter(|&n| table.sampled()[n]).map(|n| (value(n), weights[n])).collect();
            quantiles(samples)
        });
        Self { channels }
    }

    /// The four distances to another BRDF.
    pub fn distances(&self, other: &Self) -> [f64; 4] {
        std::array::from_fn(|c| {
            let pairs = self.channels[c].iter().zip(&other.channels[c]);
            pairs.map(|(a, b)| f64::from((b - a).abs())).sum::<f64>() / LEVELS as f64
        })
    }
}

fn solid_angle(node: usize) -> f64 {
    let (i, j) = (node / (THETA_D * PHI_D), node / PHI_D % THETA_D);
    theta_h(i).to_radians().sin()
        * spacing(theta_h, i, THETA_H)
        * theta_d(j).to_radians().sin()
        * spacing(theta_d, j, THETA_D)
}

/// Step quantiles of (value, weight) samples; zeros where there is no weight at all.
fn quantiles(mut samples: Vec<(f64, f64)>) -> Vec<f32> {
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = samples.iter().map(|s| s.1).sum();
    let mut at = 0;
    let mut below = samples.first().map_or(0.0, |s| s.1);
    (0..LEVELS)
        .map(|level| {
            let target = total * (level as f64 + 0.5) / LEVELS as f64;
            while at + 1 < samples.len() && below < target {
                at += 1;
                below += samples[at].1;
            }
            samples.get(at).map_or(0.0, |s| s.0 as f32)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::descriptor::constant::Constant;
    use crate::light::Sampling;

    #[test]
    fn two_constants_are_as_far_apart_as_their_fourth_roots() {
        let quantiles = |c| ValueQuantiles::new(&NodeTable::sample(&Constant(c), Sampling::Averages).unwrap());
        let (a, b) = (quantiles([1.0, 16.0, 0.0]), quantiles([16.0, 1.0, 0.0625]));
        let d = a.distances(&b);
        assert!((d[0] - 1.0).abs() < 1e-6 && (d[1] - 1.0).abs() < 1e-6 && (d[2] - 0.5).abs() < 1e-6);
        assert_eq!(a.distances(&a), [0.0; 4]);
    }

    #[test]
    fn quantiles_follow_the_weights() {
        let q = quantiles(vec![(2.0, 1.0), (1.0, 3.0)]);
        assert_eq!(q.iter().filter(|v| **v == 1.0).count(), 3 * LEVELS / 4);
        assert_eq!(quantiles(vec![]), vec![0.0; LEVELS]);
    }
}
