//! What kind of material the reference is: the same difference is seen differently on a mirror and on chalk.
//!
//! * `cx.0n cx.2n cx.5n cx.7n`: mean ln(Y + 0.001) over the regions of [`crate::descriptor::regions`];
//! * `cxalb cxalb60`: ln(luminance albedo + 0.001) seen from 0 and 60 deg;
//! * `cxwid.2 .10 .100`: ln(theta_h + 0.3), theta_h in degrees, where the profile has fallen to 1/2, 1/10, 1/100 of its value
//!   at theta_h = 0; ln 90 where it never does. The profile is the mean of Y over the nodes with theta_d < 30 deg;
//! * `cxexc`: ln(pi sum dtheta_h sin theta_h cos theta_h (P - F)^+ + 0.0001), the energy of the highlight above the diffuse
//!   floor. P is the profile with weight dtheta_d (sin theta_d cos theta_d + 0.0001), F its 30th percentile over the
//!   nodes of theta_h.
//!
//! Y is the luminance of the BRDF, 1/sr. Only sampled nodes count. Cost: a pass over the table.

use super::angular::{AngularProfile, mean_log_luminance};
use crate::descriptor::regions::{RETRO_FLOOR, region, spacing};
use crate::light::node_table::{NodeTable, PHI_D, THETA_D, THETA_H, theta_d, theta_h};
use crate::math::color::luminance;
use std::f64::consts::PI;

/// The ten numbers, in the order of [`crate::descriptor::names::CONTEXT`].
pub type Context = [f64; 10];

const REGIONS: [&str; 4] = ["0n", "2n", "5n", "7n"];
const FALLS: [f64; 3] = [2.0, 10.0, 100.0];
const PROFILE_LIMIT: f64 = 30.0;
const FLOOR: f64 = 1e-3;
const DIFFUSE_PERCENTILE: f64 = 0.3;
const ENERGY_FLOOR: f64 = 1e-4;

/// Mean of Y over theta_d < 30 deg, weighted by `weight(j)`, at every theta_h (degrees) with a sampled node.
fn profile(table: &NodeTable, weight: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
    let mut profile = Vec::new();
    for i in 0..THETA_H {
        let (mut sum, mut total) = (0.0, 0.0);
        for j in (0..THETA_D).filter(|&j| theta_d(j) < PROFILE_LIMIT) {
            for node in (0..PHI_D).map(|k| (i * THETA_D + j) * PHI_D + k).filter(|&n| table.sampled()[n]) {
                sum += weight(j) * luminance(table.values()[node]);
                total += weight(j);
            }
        }
        if total > 0.0 {
            profile.push((theta_h(i), sum / total));
        }
    }
    profile
}

/// ln(theta_h + 0.3) where the profile crosses `1 / fall` of its start, linear in theta_h between nodes.
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
        *value = region(name).and_then(|r| mean_log_luminance(table, logs, r)).unwrap_or(FLOOR.ln());
    }
    let by_node = profile(table, |_| 1.0);
    let by_measure = profile(table, |j| {
        let (sin_d, cos_d) = theta_d(j).to_radians().sin_cos();
        spacing(theta_d, j, THETA_D) * (sin_d * cos_d + RETRO_FLOOR)
    });
    (0..2).for_each(|k| out[4 + k] = (albedo[k] + FLOOR).ln());
    (0..3).for_each(|k| out[6 + k] = width(&by_node, FALLS[k]));
    out[9] = excess(&by_measure);
    out
}

/// ln of the energy of the highlight above the diffuse floor.
fn excess(profile: &[(f64, f64)]) -> f64 {
    let mut sorted: Vec<f64> = profile.iter().map(|p| p.1).collect();
    sorted.sort_by(f64::total_cmp);
    let rank = (DIFFUSE_PERCENTILE * sorted.len().saturating_sub(1) as f64) as usize;
    let floor = sorted.get(rank).copied().unwrap_or(0.0);
    let last = profile.len().saturating_sub(1);
    let energy: f64 = (0..profile.len())
        .map(|i| {
            let (low, high) = (i.saturating_sub(1), (i + 1).min(last));
            let width = (profile[high].0 - profile[low].0).to_radians() / (high - low).max(1) as f64;
            let (sin_h, cos_h) = profile[i].0.to_radians().sin_cos();
            width * sin_h * cos_h * (profile[i].1 - floor).max(0.0)
        })
        .sum();
    (PI * energy + ENERGY_FLOOR).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Brdf;
    use crate::light::Sampling;
    use crate::math::{Rgb, Vec3};

    /// A diffuse floor of 0.1 and a lobe 10 exp(-theta_h / 5 deg).
    struct Lobe;

    impl Brdf for Lobe {
        fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
            let h = (wi + wo).normalized();
            Some([0.1 + 10.0 * (-h.x.hypot(h.y).atan2(h.z).to_degrees() / 5.0).exp(); 3])
        }
    }

    #[test]
    fn widths_and_energy_of_an_exponential_lobe() {
        let table = NodeTable::sample(&Lobe, Sampling::Points).unwrap();
        let context = context(&table, &AngularProfile::new(&table), [0.5, 0.25]);
        // 10.1 / 2 and 10.1 / 10 are reached where the lobe is 4.95 and 0.91; 10.1 / 100 just above the floor.
        for (k, lobe) in [(6, 4.95f64), (7, 0.91), (8, 0.001)] {
            let theta = -5.0 * (lobe / 10.0).ln();
            assert!((context[k].exp() - 0.3 - theta).abs() < 0.03 * theta, "{k}: {} {theta}", context[k].exp() - 0.3);
        }
        // The integral of exp(-t / a) sin t cos t = 2 a^2 / (1 + 4 a^2) / 2 up to the end of the range.
        let a = 5f64.to_radians();
        let energy = PI * 10.0 * a * a / (1.0 + 4.0 * a * a);
        assert!((context[9].exp() - ENERGY_FLOOR - energy).abs() < 0.03 * energy, "{} {energy}", context[9].exp());
        assert!((context[4] - 0.501f64.ln()).abs() < 1e-12 && (context[5] - 0.251f64.ln()).abs() < 1e-12);
    }

    #[test]
    fn a_diffuse_material_has_no_highlight() {
        struct Flat;
        impl Brdf for Flat {
            fn eval(&self, _: Vec3, _: Vec3) -> Option<Rgb> {
                Some([0.2; 3])
            }
        }
        let table = NodeTable::sample(&Flat, Sampling::Points).unwrap();
        let context = context(&table, &AngularProfile::new(&table), [0.6; 2]);
        assert!(context[6..9].iter().all(|w| *w == 90f64.ln()));
        assert!((context[9] - ENERGY_FLOOR.ln()).abs() < 1e-12);
    }
}
