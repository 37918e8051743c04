//! A BRDF on 40 x 16 x 6 half/difference nodes, dense where highlights and grazing reflection are.
//!
//!   theta_h(i) = 90 (i / 39)^2 deg, i = 0..39 (the last node at 89);
//!   theta_d(j) = 90 (1 - (1 - v)^1.4) deg, v = 0.985 j / 15, j = 0..15;
//!   phi_d(k)   = 18 k deg, k = 0..5, the mean over the four quadrants phi, 180 - phi, 180 + phi, 360 - phi.
//!
//! Coordinates: Rusinkiewicz 1998, doi:10.1007/978-3-7091-6453-2_2. The square-root spacing of theta_h is that of the
//! MERL files (Matusik et al. 2003, doi:10.1145/882262.882343). The quadrants are equal for a reciprocal BRDF with a
//! mirror plane; fitted networks are neither exactly, and their mean is what a picture of an isotropic surface sees.
//!
//! What a node holds depends on the version of the descriptors ([`Sites`]): the BRDF at the node, or its mean about the node.
//!
//! Where a measurement is missing everywhere about a node, the value is copied from the nearest node that has one (breadth
//! first over the six neighbours in the order theta_h -, +, theta_d -, +, phi_d -, +; ties go to the node that comes
//! first in the table), and the node is not [`NodeTable::sampled`]. Negative values, which some published models give at
//! grazing angles, count as 0.

use super::LightError;
use super::sites::{Sampling, Sites};
use crate::brdf::Brdf;
use crate::math::Rgb;
use crate::math::parallel;
use std::collections::VecDeque;
use std::f64::consts::FRAC_PI_2;

/// Nodes along theta_h.
pub const THETA_H: usize = 40;
/// Nodes along theta_d.
pub const THETA_D: usize = 16;
/// Nodes along phi_d.
pub const PHI_D: usize = 6;
/// Nodes of the table; node (i, j, k) is stored at `(i * THETA_D + j) * PHI_D + k`.
pub const NODES: usize = THETA_H * THETA_D * PHI_D;

/// Share of the axis of theta_d that the nodes cover, and the exponent of their spacing.
const THETA_D_COVER: f64 = 0.985;
const THETA_D_POWER: f64 = 1.4;
/// Evaluations in one parallel task.
const CHUNK: usize = 1280;

/// theta_h of node `i`, degrees.
pub fn theta_h(i: usize) -> f64 {
    if i + 1 == THETA_H { 89.0 } else { theta_h_at(i as f64) }
}

/// theta_h at a node coordinate, degrees.
pub(super) fn theta_h_at(coordinate: f64) -> f64 {
    90.0 * (coordinate / (THETA_H - 1) as f64).powi(2)
}

/// theta_d of node `j`, degrees.
pub fn theta_d(j: usize) -> f64 {
    let v = THETA_D_COVER * j as f64 / (THETA_D - 1) as f64;
    90.0 * (1.0 - (1.0 - v).powf(THETA_D_POWER))
}

/// phi_d of node `k`, degrees.
pub fn phi_d(k: usize) -> f64 {
    90.0 * k as f64 / (PHI_D - 1) as f64
}

/// Continuous node coordinate of theta_h (radians), 0 to 39.
pub fn theta_h_coordinate(theta_h: f64) -> f64 {
    (THETA_H - 1) as f64 * (theta_h / FRAC_PI_2).max(0.0).sqrt()
}

/// Continuous node coordinate of theta_d (radians), 0 to 15.
pub fn theta_d_coordinate(theta_d: f64) -> f64 {
    let v = 1.0 - (1.0 - theta_d / FRAC_PI_2).max(0.0).powf(1.0 / THETA_D_POWER);
    ((THETA_D - 1) as f64 * v / THETA_D_COVER).min((THETA_D - 1) as f64)
}

/// A BRDF at the nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeTable {
    values: Vec<Rgb>,
    sampled: Vec<bool>,
}

impl NodeTable {
    /// Evaluates `brdf` about every node.
    ///
    /// Errors: a value that is not finite; no measurement at any node.
    pub fn sample(brdf: &dyn Brdf, sampling: Sampling) -> Result<Self, LightError> {
        let sites = Sites::of(sampling);
        let mut found = vec![None; sites.len()];
        parallel::for_each_chunk(&mut found, CHUNK, |c, found| {
            let at = c * CHUNK..c * CHUNK + found.len();
            brdf.eval_batch(&sites.wi[at.clone()], &sites.wo[at], found);
        });
        let mut table = Self::gather(sites, |site| found[site])?;
        if sampling == Sampling::Points {
            // What descriptors of version 1 were made from.
            table.values.iter_mut().flatten().for_each(|v| *v = f64::from(*v as f32));
            table.check_all()?;
        }
        Ok(table)
    }

    /// The table of a BRDF that is given by its value (linear RGB, 1/sr) at every direction of `sites`.
    ///
    /// Errors: a value that is not finite.
    ///
    /// # Panics
    /// If there are not as many values as directions.
    pub fn of_values(sites: &Sites, values: &[Rgb]) -> Result<Self, LightError> {
        assert_eq!(values.len(), sites.len(), "values and directions");
        Self::gather(sites, |site| Some(values[site]))
    }

    fn gather(sites: &Sites, value: impl Fn(usize) -> Option<Rgb>) -> Result<Self, LightError> {
        let mut values = vec![[0.0; 3]; NODES];
        let mut measured = vec![false; NODES];
        for n in 0..NODES {
            let mut sum = [0.0; 3];
            let mut total = 0.0;
            for &(site, weight) in sites.entries(n) {
                let Some(value) = value(site as usize) else { continue };
                check(n, value)?;
                (0..3).for_each(|c| sum[c] += weight * value[c].max(0.0));
                total += weight;
            }
            if total > 0.0 {
                values[n] = sum.map(|s| s / total);
                measured[n] = true;
            }
        }
        let mut table = Self { values, sampled: vec![] };
        table.check_all()?;
        fill(&mut table.values, &measured)?;
        table.sampled = measured.iter().zip(&sites.in_place).map(|(m, p)| *m && *p).collect();
        Ok(table)
    }

    fn check_all(&self) -> Result<(), LightError> {
        self.values.iter().enumerate().try_for_each(|(n, value)| check(n, *value))
    }

    /// A table read back from a cache; `None` unless there is one value and one mask entry a node and all are finite.
    pub(crate) fn from_parts(values: Vec<Rgb>, sampled: Vec<bool>) -> Option<Self> {
        let finite = values.iter().flatten().all(|v| v.is_finite() && *v >= 0.0);
        (values.len() == NODES && sampled.len() == NODES && finite).then_some(Self { values, sampled })
    }

    /// Linear RGB, 1/sr, cosine not included; one entry a node.
    pub fn values(&self) -> &[Rgb] {
        &self.values
    }

    /// Whether the value was measured where the node stands, rather than moved in or copied.
    pub fn sampled(&self) -> &[bool] {
        &self.sampled
    }
}

fn check(node: usize, value: Rgb) -> Result<(), LightError> {
    if value.iter().all(|v| v.is_finite()) {
        return Ok(());
    }
    let (i, j, k) = (node / (THETA_D * PHI_D), node / PHI_D % THETA_D, node % PHI_D);
    Err(LightError::NotFinite { theta_h: theta_h(i), theta_d: theta_d(j), phi_d: phi_d(k), value })
}

/// Copies to every node without a measurement the value of the nearest that has one.
fn fill(values: &mut [Rgb], measured: &[bool]) -> Result<(), LightError> {
    let mut reached = measured.to_vec();
    let mut queue: VecDeque<usize> = (0..NODES).filter(|&n| measured[n]).collect();
    if queue.is_empty() {
        return Err(LightError::NoMeasurement { nodes: NODES });
    }
    while let Some(n) = queue.pop_front() {
        let (i, j, k) = (n / (THETA_D * PHI_D), n / PHI_D % THETA_D, n % PHI_D);
        let neighbours = [
            (i > 0).then(|| n - THETA_D * PHI_D),
            (i + 1 < THETA_H).then(|| n + THETA_D * PHI_D),
            (j > 0).then(|| n - PHI_D),
            (j + 1 < THETA_D).then(|| n + PHI_D),
            (k > 0).then(|| n - 1),
            (k + 1 < PHI_D).then(|| n + 1),
        ];
        for m in neighbours.into_iter().flatten() {
            if !reached[m] {
                reached[m] = true;
                values[m] = values[n];
                queue.push_back(m);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    /// 1 / pi, but unmeasured where `missing` says so.
    struct Holed(fn(f64, f64) -> bool);

    impl Brdf for Holed {
        fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
            (!(self.0)(wi.z, wo.z)).then_some([wi.z * wo.z, wi.z + wo.z, 1.0])
        }
    }

    #[test]
    fn node_coordinates_invert_the_node_angles() {
        for i in 0..THETA_H - 1 {
            assert!((theta_h_coordinate(theta_h(i).to_radians()) - i as f64).abs() < 1e-9);
        }
        for j in 0..THETA_D {
            assert!((theta_d_coordinate(theta_d(j).to_radians()) - j as f64).abs() < 1e-9);
        }
    }

    #[test]
    fn missing_nodes_are_masked_and_take_the_value_of_a_neighbour() {
        for sampling in [Sampling::Points, Sampling::Averages] {
            let whole = NodeTable::sample(&Holed(|_, _| false), sampling).unwrap();
            let holed = NodeTable::sample(&Holed(|a, b| a.min(b) < 0.3), sampling).unwrap();
            let mut filled = 0;
            for n in 0..NODES {
                if sampling == Sampling::Points && holed.sampled[n] {
                    assert_eq!(holed.values[n], whole.values[n]);
                } else if whole.sampled[n] && !holed.sampled[n] {
                    filled += 1;
                    assert!(holed.values[n][0] >= 0.08, "a copy of a measured value, not black");
                }
            }
            assert!(filled > 100);
        }
    }

    #[test]
    fn nothing_measured_and_not_finite_are_errors() {
        struct Bad;
        impl Brdf for Bad {
            fn eval(&self, wi: Vec3, _: Vec3) -> Option<Rgb> {
                Some([if wi.z > 0.9999 { f64::NAN } else { 1.0 }, 1.0, 1.0])
            }
        }
        assert!(matches!(
            NodeTable::sample(&Holed(|_, _| true), Sampling::Averages),
            Err(LightError::NoMeasurement { .. })
        ));
        assert!(matches!(NodeTable::sample(&Bad, Sampling::Averages), Err(LightError::NotFinite { .. })));
    }
}
