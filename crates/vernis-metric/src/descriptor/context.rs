//! What kind of material the reference is: the same difference is seen differently on a mirror and on chalk.
//!
//! * `cx.0n cx.2n cx.5n cx.7n`: mean ln(Y + 0.001) over the regions of [`super::regions`];
//! * `cxalb cxalb60`: ln(luminance albedo + 0.001) seen from 0 and 60 deg;
//! * `cxwid.2 .10 .100`: ln(W + 0.3), W the width in degrees of the range of theta_h in which the profile P stands above the 2nd, 10th,
//!   100th part of its start,
//!
//!     W = sum dtheta_h (1 + tanh(3 ln r)) / 2 = sum dtheta_h / (1 + r^-6),   r = fall (P + t) / (P_0 + t),   t = 0.00001;
//!
//!   P is the mean of Y over the nodes with theta_d < 30 deg, P_0 its value at theta_h = 0;
//! * `cxexc`: ln(pi sum dtheta_h sin theta_h cos theta_h (x + sqrt(x^2 + c^2) - c) / 2 + 0.0001), x = P - F, c = 0.0001: the energy of the
//!   highlight above the diffuse floor. Here P has the weight dtheta_d (sin theta_d cos theta_d + 0.0001), and the floor F is the soft
//!   median of P along theta_h, which is P itself where P is level, and about P(45 deg) where it falls:
//!
//!     sum dtheta_h tanh((ln(F + f) - ln(P + f)) / 0.05) = 0,   f = 0.001.
//!
//! dtheta_h is the share of 0 to 90 deg that is nearest to a node. Y is the luminance of the BRDF, 1/sr. Only sampled nodes
//! count. Cost: a pass over the table.

use super::angular::{FLOOR, Logged, add_mean_log_slopes, mean_log_luminance};
use super::regions::{RETRO_FLOOR, region, spacing};
use crate::light::node_table::{NodeTable, PHI_D, THETA_D, THETA_H, theta_d, theta_h};
use crate::math::Rgb;
use crate::math::color::{LUMINANCE_REC709, luminance};
use std::f64::consts::PI;

/// The ten numbers, in the order of [`super::names::CONTEXT`].
pub(super) type Context = [f64; 10];

const REGIONS: [&str; 4] = ["0n", "2n", "5n", "7n"];
const FALLS: [f64; 3] = [2.0, 10.0, 100.0];
const PROFILE_LIMIT: f64 = 30.0;
/// t: below it, one black is like another.
const BLACK: f64 = 1e-5;
const SHARPNESS: i32 = 6;
const LEAST_WIDTH: f64 = 0.3;
/// f, and the width of the step that counts what lies below the median.
const DARK: f64 = 1e-3;
const BLUR: f64 = 0.05;
/// Halvings that find the median to the last bit.
const HALVINGS: usize = 64;
/// c.
const CORNER: f64 = 1e-4;
const ENERGY_FLOOR: f64 = 1e-4;

/// The mean of Y near theta_d = 0 along theta_h.
struct Profile {
    /// Node of theta_h, its share of 0 to 90 deg, and the mean of Y.
    rows: Vec<(usize, f64, f64)>,
    /// Weight of each node of theta_d.
    weights: [f64; THETA_D],
}

/// The sampled nodes of a row with a weight.
fn nodes(table: &NodeTable, weights: [f64; THETA_D], i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
    (0..THETA_D * PHI_D)
        .map(move |at| (i * THETA_D * PHI_D + at, weights[at / PHI_D]))
        .filter(|(node, weight)| *weight > 0.0 && table.sampled()[*node])
}

impl Profile {
    fn new(table: &NodeTable, weight: impl Fn(usize) -> f64) -> Self {
        let weights = std::array::from_fn(|j| if theta_d(j) < PROFILE_LIMIT { weight(j) } else { 0.0 });
        let mut rows = Vec::new();
        for i in 0..THETA_H {
            let (mut sum, mut total) = (0.0, 0.0);
            for (node, weight) in nodes(table, weights, i) {
                sum += weight * luminance(table.values()[node]);
                total += weight;
            }
            if total > 0.0 {
                rows.push((i, 0.0, sum / total));
            }
        }
        for k in 0..rows.len() {
            let middle = |k: usize| 0.5 * (theta_h(rows[k].0) + theta_h(rows[k + 1].0));
            let from = if k == 0 { 0.0 } else { middle(k - 1) };
            let to = if k + 1 == rows.len() { 90.0 } else { middle(k) };
            rows[k].1 = to - from;
        }
        Self { rows, weights }
    }

    /// Every node of theta_d counts the same.
    fn by_node(table: &NodeTable) -> Self {
        Self::new(table, |_| 1.0)
    }

    fn by_measure(table: &NodeTable) -> Self {
        Self::new(table, |j| {
            let (sin_d, cos_d) = theta_d(j).to_radians().sin_cos();
            spacing(theta_d, j, THETA_D) * (sin_d * cos_d + RETRO_FLOOR)
        })
    }

    /// Adds to the slopes by the table those by the rows.
    fn add_slopes(&self, table: &NodeTable, by_row: &[f64], to: &mut [Rgb]) {
        for ((i, ..), by) in self.rows.iter().zip(by_row) {
            let total: f64 = nodes(table, self.weights, *i).map(|(_, weight)| weight).sum();
            for (node, weight) in nodes(table, self.weights, *i) {
                (0..3).for_each(|c| to[node][c] += by * weight / total * LUMINANCE_REC709[c]);
            }
        }
    }

    /// r^-6 / (1 + r^-6) and 1 / (1 + r^-6) of row `k`.
    fn shares(&self, k: usize, fall: f64) -> (f64, f64) {
        let ratio = fall * (self.rows[k].2 + BLACK) / (self.rows[0].2 + BLACK);
        (1.0 / (1.0 + ratio.powi(SHARPNESS)), 1.0 / (1.0 + ratio.powi(-SHARPNESS)))
    }

    /// W in degrees.
    fn width(&self, fall: f64) -> f64 {
        if self.rows.is_empty() {
            return 90.0;
        }
        (0..self.rows.len()).map(|k| self.rows[k].1 * self.shares(k, fall).1).sum()
    }

    /// Adds to the slopes by the rows those that come through [`Profile::width`].
    fn add_width_slopes(&self, fall: f64, by: f64, by_row: &mut [f64]) {
        for k in 0..self.rows.len() {
            let (below, above) = self.shares(k, fall);
            let by_log = by * self.rows[k].1 * f64::from(SHARPNESS) * below * above;
            by_row[k] += by_log / (self.rows[k].2 + BLACK);
            by_row[0] -= by_log / (self.rows[0].2 + BLACK);
        }
    }

    /// F.
    fn floor(&self) -> f64 {
        let logs: Vec<f64> = self.rows.iter().map(|r| (r.2 + DARK).ln()).collect();
        let mut low = logs.iter().copied().fold(f64::INFINITY, f64::min);
        let mut high = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            let balance: f64 = self.rows.iter().zip(&logs).map(|(r, l)| r.1 * ((middle - l) / BLUR).tanh()).sum();
            if balance < 0.0 { low = middle } else { high = middle }
        }
        (0.5 * (low + high)).exp() - DARK
    }

    /// Adds to the slopes by the rows those that come through [`Profile::floor`], by the theorem on implicit functions.
    fn add_floor_slopes(&self, floor: f64, by: f64, by_row: &mut [f64]) {
        let share = |row: &(usize, f64, f64)| {
            let steepness = ((floor + DARK) / (row.2 + DARK)).ln() / BLUR;
            row.1 / steepness.cosh().powi(2)
        };
        let total: f64 = self.rows.iter().map(share).sum();
        if total > 0.0 {
            let by_log = by * (floor + DARK) / total;
            by_row.iter_mut().zip(&self.rows).for_each(|(to, row)| *to += by_log * share(row) / (row.2 + DARK));
        }
    }

    /// Solid-angle weight of row `k` in the energy.
    fn measure(&self, k: usize) -> f64 {
        let (i, width, _) = self.rows[k];
        let (sin_h, cos_h) = theta_h(i).to_radians().sin_cos();
        PI * width.to_radians() * sin_h * cos_h
    }

    /// Energy above the floor.
    fn excess(&self) -> f64 {
        if self.rows.is_empty() {
            return 0.0;
        }
        let floor = self.floor();
        let above = |x: f64| 0.5 * (x + x.hypot(CORNER) - CORNER);
        (0..self.rows.len()).map(|k| self.measure(k) * above(self.rows[k].2 - floor)).sum()
    }

    /// Adds to the slopes by the rows those that come through [`Profile::excess`].
    fn add_excess_slopes(&self, by: f64, by_row: &mut [f64]) {
        let floor = self.floor();
        let mut by_floor = 0.0;
        for k in 0..self.rows.len() {
            let x = self.rows[k].2 - floor;
            let slope = by * self.measure(k) * 0.5 * (1.0 + x / x.hypot(CORNER));
            by_row[k] += slope;
            by_floor -= slope;
        }
        self.add_floor_slopes(floor, by_floor, by_row);
    }
}

/// The context of a BRDF; `albedo` is its luminance albedo from 0 and 60 deg.
pub(super) fn context(of: Logged<'_>, albedo: [f64; 2]) -> Context {
    let mut out = [0.0; 10];
    for (value, name) in out.iter_mut().zip(REGIONS) {
        *value = region(name).and_then(|r| mean_log_luminance(of, r)).unwrap_or(FLOOR.ln());
    }
    let by_node = Profile::by_node(of.0);
    (0..2).for_each(|k| out[4 + k] = (albedo[k] + FLOOR).ln());
    (0..3).for_each(|k| out[6 + k] = (by_node.width(FALLS[k]) + LEAST_WIDTH).ln());
    out[9] = (Profile::by_measure(of.0).excess() + ENERGY_FLOOR).ln();
    out
}

/// Adds to the slopes by the table and by the albedos those that come through [`context`].
pub(super) fn add_slopes(table: &NodeTable, albedo: [f64; 2], by: &Context, to: &mut [Rgb], by_albedo: &mut [f64; 2]) {
    if by.iter().all(|by| *by == 0.0) {
        return;
    }
    for (by, name) in by.iter().zip(REGIONS) {
        if let Some(region) = region(name) {
            add_mean_log_slopes(table, region, *by, to);
        }
    }
    (0..2).for_each(|k| by_albedo[k] += by[4 + k] / (albedo[k] + FLOOR));
    let by_node = Profile::by_node(table);
    let mut by_row = vec![0.0; by_node.rows.len()];
    for (fall, by) in FALLS.into_iter().zip(&by[6..9]) {
        by_node.add_width_slopes(fall, by / (by_node.width(fall) + LEAST_WIDTH), &mut by_row);
    }
    by_node.add_slopes(table, &by_row, to);
    let by_measure = Profile::by_measure(table);
    let mut by_row = vec![0.0; by_measure.rows.len()];
    by_measure.add_excess_slopes(by[9] / (by_measure.excess() + ENERGY_FLOOR), &mut by_row);
    by_measure.add_slopes(table, &by_row, to);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Brdf;
    use crate::descriptor::angular::logs;
    use crate::light::Sampling;
    use crate::math::Vec3;

    /// A diffuse floor and a lobe `peak` exp(-theta_h / 5 deg).
    struct Lobe(f64, f64);

    impl Brdf for Lobe {
        fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
            let h = (wi + wo).normalized();
            Some([self.0 + self.1 * (-h.x.hypot(h.y).atan2(h.z).to_degrees() / 5.0).exp(); 3])
        }
    }

    fn of(lobe: &Lobe) -> Context {
        let table = NodeTable::sample(lobe, Sampling::Averages).unwrap();
        context((&table, &logs(&table)), [0.5, 0.25])
    }

    #[test]
    fn widths_and_energy_of_an_exponential_lobe() {
        let context = of(&Lobe(0.1, 10.0));
        // 10.1 / 2 and 10.1 / 10 are reached where the lobe is 4.95 and 0.91.
        for (k, lobe) in [(6, 4.95f64), (7, 0.91)] {
            let theta = -5.0 * (lobe / 10.0).ln();
            assert!((context[k].exp() - 0.3 - theta).abs() < 0.1 * theta, "{k}: {} {theta}", context[k].exp() - 0.3);
        }
        let a = 5f64.to_radians();
        let energy = PI * 10.0 * a * a / (1.0 + 4.0 * a * a);
        assert!((context[9].exp() - ENERGY_FLOOR - energy).abs() < 0.1 * energy, "{} {energy}", context[9].exp());
        assert!((context[4] - 0.501f64.ln()).abs() < 1e-12 && (context[5] - 0.251f64.ln()).abs() < 1e-12);
    }

    #[test]
    fn a_diffuse_material_has_no_highlight_however_dark() {
        for albedo in [0.2, 1e-3, 0.0] {
            let context = of(&Lobe(albedo, 0.0));
            // The tanh is not quite 1 where the profile is level: 1 / (1 + 2^-6).
            assert!((context[6] - 90.3f64.ln()).abs() < 0.02, "{}", context[6]);
            assert!(context[7..9].iter().all(|w| (w - 90.3f64.ln()).abs() < 1e-5), "{context:?}");
            assert!((context[9] - ENERGY_FLOOR.ln()).abs() < 1e-9, "{}", context[9]);
        }
    }
}
