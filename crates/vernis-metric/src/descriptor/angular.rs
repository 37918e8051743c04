//! Ratios of two BRDFs over regions of half/difference angles.
//!
//!   sY = mean of r,   aY = mean of sqrt(r^2 + 0.02^2) - 0.02,   r = ln((Y_B + 0.001) / (Y_A + 0.001)),
//!   sR = mean difference of ln((R + 0.001) / (G + 0.001)),   sB the same with B for R,
//!
//! A the reference, B the candidate, Y the luminance of the BRDF (1/sr). Means are over the nodes of a region that
//! both tables sampled, with the weights of [`super::regions`]. A region without a common node gives 0. The plain aY, the mean of |r|,
//! is a pseudo-metric between BRDFs that were measured at the same nodes.
//!
//! Cost: 11,520 logarithms a BRDF; one pass over 3,840 nodes a pair.

use super::regions::{Measure, REGIONS};
use super::smooth::{soft, soft_slope};
use crate::light::node_table::{NODES, NodeTable};
use crate::math::Rgb;
use crate::math::color::{LUMINANCE_REC709, luminance};

pub(super) const FLOOR: f64 = 1e-3;
/// Width of the rounding of a modulus of a logarithm.
const WIDTH: f64 = 0.02;

/// sY, aY, sR, sB, and the plain aY.
pub(super) type Ratios = [f64; 5];

/// ln(Y + 0.001), ln((R + 0.001) / (G + 0.001)), ln((B + 0.001) / (G + 0.001)) at each node.
pub(super) fn logs(table: &NodeTable) -> Vec<[f64; 3]> {
    let of_node = |f: &Rgb| {
        let [r, g, b] = f.map(|v| (v + FLOOR).ln());
        [(luminance(*f) + FLOOR).ln(), r - g, b - g]
    };
    table.values().iter().map(of_node).collect()
}

/// Adds to the slopes by a node's value those that come through its three logarithms.
fn add_log_slopes(value: Rgb, by: [f64; 3], to: &mut Rgb) {
    let by_y = by[0] / (luminance(value) + FLOOR);
    let of_channel = [by[1], -by[1] - by[2], by[2]];
    (0..3).for_each(|c| to[c] += by_y * LUMINANCE_REC709[c] + of_channel[c] / (value[c] + FLOOR));
}

/// A table and its logarithms.
pub(super) type Logged<'a> = (&'a NodeTable, &'a [[f64; 3]]);

/// The nodes of regions that both tables sampled, with region and weight.
fn common<'a>(a: &'a NodeTable, b: &'a NodeTable) -> impl Iterator<Item = (usize, usize, f64)> + 'a {
    let measure = Measure::get();
    (0..NODES)
        .filter(|&n| a.sampled()[n] && b.sampled()[n])
        .filter_map(|n| measure.region[n].map(|region| (n, region, measure.weight[n])))
}

/// The ratios over every region of candidate `b` against reference `a`.
pub(super) fn compare(a: Logged<'_>, b: Logged<'_>) -> [Ratios; REGIONS] {
    let mut sums = [[0.0; 5]; REGIONS];
    let mut weights = [0.0; REGIONS];
    for (node, region, w) in common(a.0, b.0) {
        let [y, red, blue] = std::array::from_fn(|k| b.1[node][k] - a.1[node][k]);
        let terms = [y, soft(y * y, WIDTH), red, blue, y.abs()];
        sums[region].iter_mut().zip(terms).for_each(|(sum, term)| *sum += w * term);
        weights[region] += w;
    }
    for (sum, w) in sums.iter_mut().zip(weights).filter(|(_, w)| *w > 0.0) {
        sum.iter_mut().for_each(|sum| *sum /= w);
    }
    sums
}

/// Adds to the slopes by the candidate's table those that come through [`compare`].
pub(super) fn add_slopes(a: Logged<'_>, b: Logged<'_>, by: &[Ratios; REGIONS], to: &mut [Rgb]) {
    if by.iter().flatten().all(|by| *by == 0.0) {
        return;
    }
    let mut weights = [0.0; REGIONS];
    common(a.0, b.0).for_each(|(_, region, w)| weights[region] += w);
    for (node, region, w) in common(a.0, b.0).filter(|(_, region, _)| by[*region].iter().any(|by| *by != 0.0)) {
        let y = b.1[node][0] - a.1[node][0];
        let share = w / weights[region];
        let [signed, rounded, red, blue, plain] = by[region];
        let by_y = signed + y * (rounded * soft_slope(y * y, WIDTH) + plain * soft_slope(y * y, 0.0));
        add_log_slopes(b.0.values()[node], [share * by_y, share * red, share * blue], &mut to[node]);
    }
}

fn nodes_of(table: &NodeTable, region: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
    let measure = Measure::get();
    let inside = move |&n: &usize| measure.region[n] == Some(region) && table.sampled()[n];
    (0..NODES).filter(inside).map(|n| (n, measure.weight[n]))
}

/// Mean of ln(Y + 0.001) of one BRDF over a region; `None` without a sampled node.
pub(super) fn mean_log_luminance(of: Logged<'_>, region: usize) -> Option<f64> {
    let (mut sum, mut weight) = (0.0, 0.0);
    for (node, w) in nodes_of(of.0, region) {
        sum += w * of.1[node][0];
        weight += w;
    }
    (weight > 0.0).then(|| sum / weight)
}

/// Adds to the slopes by the table those that come through [`mean_log_luminance`].
pub(super) fn add_mean_log_slopes(table: &NodeTable, region: usize, by: f64, to: &mut [Rgb]) {
    let weight: f64 = nodes_of(table, region).map(|(_, w)| w).sum();
    for (node, w) in nodes_of(table, region) {
        add_log_slopes(table.values()[node], [by * w / weight, 0.0, 0.0], &mut to[node]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::descriptor::constant::Constant;
    use crate::light::Sampling;

    #[test]
    fn a_constant_factor_gives_its_logarithm_everywhere() {
        let parts = |value: Rgb| {
            let table = NodeTable::sample(&Constant(value), Sampling::Averages).unwrap();
            let logs = logs(&table);
            (table, logs)
        };
        let (a, b) = (parts([0.2, 0.1, 0.4]), parts([0.1, 0.1, 0.8]));
        let y = |c: Rgb| luminance(c) + FLOOR;
        let r = (y([0.1, 0.1, 0.8]) / y([0.2, 0.1, 0.4])).ln();
        let expected = [r, (r * r + 4e-4f64).sqrt() - 0.02, (0.101f64 / 0.201).ln(), (0.801f64 / 0.401).ln(), r.abs()];
        for ratios in compare((&a.0, &a.1), (&b.0, &b.1)) {
            for (found, expected) in ratios.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-9, "{ratios:?}");
            }
        }
        assert_eq!(compare((&a.0, &a.1), (&a.0, &a.1)), [[0.0; 5]; REGIONS]);
    }
}
