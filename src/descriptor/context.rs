//! What kind of material the reference is: the same difference is seen differently on a mirror and on chalk.
//!
//! * `cx.0n cx.2n cx.5n cx.7n`: mean ln(Y + .001) over the regions of [`super::angular`];
//! * `cxalb cxalb60`: ln(luminance albedo + .001) seen from 0 and 60 deg;
//! * `cxwid.2 .10 .100`: ln(theta_h + .3), theta_h in degrees, where the profile has fallen to 1/2, 1/10, 1/100 of its value
//!   at theta_h = 0; ln 90 where it never does. The profile is the mean of Y over the nodes with theta_d < 30 deg;
//! * `cxexc`: ln(energy above the diffuse floor + .001).
//!
//! Cost: a pass over the table.

use super::angular::{self, AngularProfile};
use super::node_table::{NODES, NodeTable, PHI_D, THETA_D, THETA_H, theta_d, theta_h};
use crate::math::color::luminance;

/// The ten numbers, in the order of [`NAMES`].
pub type Context = [f64; 10];

/// Names without their family.
pub const NAMES: [&str; 10] =
    ["cx.0n", "cx.2n", "cx.5n", "cx.7n", "cxalb", "cxalb60", "cxwid.2", "cxwid.10", "cxwid.100", "cxexc"];

const REGIONS: [&str; 4] = ["0n", "2n", "5n", "7n"];
const FALLS: [f64; 3] = [2.0, 10.0, 100.0];
const PROFILE_LIMIT: f64 = 30.0;
const FLOOR: f64 = 1e-3;

/// Mean of Y over theta_d < 30 deg and phi_d at each theta_h, over sampled nodes; `None` where there is none.
fn profile(table: &NodeTable) -> Vec<Option<f64>> {
    (0..THETA_H)
        .map(|i| {
            let near = (0..THETA_D).filter(|&j| theta_d(j) < PROFILE_LIMIT);
            let nodes = near.flat_map(|j| (0..PHI_D).map(move |k| (i * THETA_D + j) * PHI_D + k));
            let values: Vec<f64> =
                nodes.filter(|&n| table.sampled()[n]).map(|n| luminance(table.values()[n].map(f64::from))).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        })
        .collect()
}

/// ln(theta_h + .3) where the profile crosses `1 / fall` of its start, linear in theta_h between nodes.
fn width(profile: &[(f64, f64)], fall: f64) -> f64 {
    let level = profile.first().map_or(0.0, |p| p.1) / fall;
    let crossing = profile.windows(2).find(|p| p[1].1 < level);
    crossing.map_or(90f64.ln(), |p| {
        let t = (p[0].1 - level) / (p[0].1 - p[1].1);
        (p[0].0 + t * (p[1].0 - p[0].0) + 0.3).ln()
    })
}

/// The context of a reference; `albedo` is its luminance albedo from 0 and 60 deg.
pub fn context(table: &NodeTable, logs: &AngularProfile, albedo: [f64; 2]) -> Context {
    let mut out = [0.0; 10];
    for (value, name) in out.iter_mut().zip(REGIONS) {
        let region = angular::region(name);
        *value = region.and_then(|r| angular::mean_log_luminance(table, logs, r)).unwrap_or(FLOOR.ln());
    }
    let profile: Vec<(f64, f64)> =
        profile(table).into_iter().enumerate().filter_map(|(i, y)| y.map(|y| (theta_h(i), y))).collect();
    (0..2).for_each(|k| out[4 + k] = (albedo[k] + FLOOR).ln());
    (0..3).for_each(|k| out[6 + k] = width(&profile, FALLS[k]));
    out[9] = excess(table);
    out
}

/// ln(energy above the diffuse floor + .001).
fn excess(table: &NodeTable) -> f64 {
    let measure = angular::Measure::get();
    let mut y: Vec<f64> = table.values().iter().map(|f| luminance(f.map(f64::from))).collect();
    let energy = |floor: f64| -> f64 {
        (0..NODES)
            .filter(|&n| table.sampled()[n])
            .map(|n| measure.weight[n] * (y[n] - floor).max(0.0) / PHI_D as f64)
            .sum()
    };
    let floor = {
        let mut sorted: Vec<f64> = (0..NODES).filter(|&n| table.sampled()[n]).map(|n| y[n]).collect();
        sorted.sort_by(f64::total_cmp);
        sorted[sorted.len() / 2]
    };
    let out = (energy(floor) + FLOOR).ln();
    y.clear();
    out
}
