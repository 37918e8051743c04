//! Regions of half/difference angles, and the measure of their nodes.
//!
//! A node weighs
//!
//!   dtheta_h (sin theta_h cos theta_h + 0.002) dtheta_d (sin theta_d cos theta_d + 0.0001),
//!
//! dtheta the spacing of the nodes: the measure of half/difference space, with floors that keep the mirror direction and
//! retro-reflection from vanishing. A region is a bin of theta_h (deg) 0: 0-0.6, 1: 0.6-1.5, 2: 1.5-3, 3: 3-6, 4: 6-11,
//! 5: 11-18, 6: 18-28, 7: 28-42, times a band of theta_d (deg) n (near normal): 0-25, m: 25-50, h: 50-68, g (grazing): 68-84.

use crate::light::node_table::{NODES, PHI_D, THETA_D, THETA_H, theta_d, theta_h};
use std::sync::OnceLock;

/// Bins of theta_h.
pub const BINS: usize = 8;
/// Bands of theta_d, by letter.
pub const BANDS: [char; 4] = ['n', 'm', 'h', 'g'];
/// Regions; region `bin * 4 + band`.
pub const REGIONS: usize = BINS * BANDS.len();

const BIN_EDGES: [f64; BINS + 1] = [0.0, 0.6, 1.5, 3.0, 6.0, 11.0, 18.0, 28.0, 42.0];
const BAND_EDGES: [f64; BANDS.len() + 1] = [0.0, 25.0, 50.0, 68.0, 84.0];
const MIRROR_FLOOR: f64 = 0.002;
pub(super) const RETRO_FLOOR: f64 = 1e-4;

/// Name of a region, such as `3g`.
pub fn region_name(region: usize) -> String {
    format!("{}{}", region / BANDS.len(), BANDS[region % BANDS.len()])
}

/// Limits of a region in degrees: theta_h from, to, theta_d from, to.
pub fn region_limits(region: usize) -> [f64; 4] {
    let (bin, band) = (region / BANDS.len(), region % BANDS.len());
    [BIN_EDGES[bin], BIN_EDGES[bin + 1], BAND_EDGES[band], BAND_EDGES[band + 1]]
}

/// The region called `name`.
pub fn region(name: &str) -> Option<usize> {
    (0..REGIONS).find(|&r| region_name(r) == name)
}

/// Region and weight of each node.
pub(super) struct Measure {
    pub region: Vec<Option<usize>>,
    pub weight: Vec<f64>,
}

/// Distance of the midpoints on either side of a node (one-sided at the ends).
pub(super) fn spacing(angle: impl Fn(usize) -> f64, index: usize, nodes: usize) -> f64 {
    let (low, high) = (index.saturating_sub(1), (index + 1).min(nodes - 1));
    (angle(high) - angle(low)) / (high - low) as f64
}

impl Measure {
    pub fn get() -> &'static Self {
        static MEASURE: OnceLock<Measure> = OnceLock::new();
        MEASURE.get_or_init(|| {
            let place = |edges: &[f64], angle: f64| edges.windows(2).position(|e| (e[0]..e[1]).contains(&angle));
            let mut measure = Self { region: vec![], weight: vec![] };
            for node in 0..NODES {
                let (i, j) = (node / (THETA_D * PHI_D), node / PHI_D % THETA_D);
                let (h, d) = (theta_h(i), theta_d(j));
                let region = place(&BIN_EDGES, h).zip(place(&BAND_EDGES, d)).map(|(a, b)| a * BANDS.len() + b);
                let product = |angle: f64| angle.to_radians().sin() * angle.to_radians().cos();
                measure.region.push(region);
                measure.weight.push(
                    spacing(theta_h, i, THETA_H).to_radians()
                        * (product(h) + MIRROR_FLOOR)
                        * spacing(theta_d, j, THETA_D).to_radians()
                        * (product(d) + RETRO_FLOOR),
                );
            }
            measure
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_region_has_a_name() {
        for r in 0..REGIONS {
            assert_eq!(region(&region_name(r)), Some(r));
        }
        assert_eq!(region("8n"), None);
    }
}
