//! What hides a difference: the noise of limited sensitivity, and contrast that is there anyway.
//!
//! Source: Mantiuk et al. 2011, section 4.4, equations 13 to 15 (doi:10.1145/2010324.1964935).

use super::eye::{self, neural_sensitivity};
use super::frequency_of;
use super::pyramid::Pyramid;
use super::resize::resized;
use crate::metric::plane::Plane;

/// Exponents of excitation and of masking, and weights of masking: 10 to the power of the fitted parameters.
pub(super) const LOG_P: f64 = 0.544068;
const LOG_Q: f64 = 0.49576;
const LOG_K_SELF: f64 = 0.189065;
const LOG_K_ORIENTATIONS: f64 = 0.449199;
const LOG_K_NEIGHBOURS: f64 = 1.52512;
/// |x|^exponent with the sign of x.
pub(super) fn signed_power(x: f64, exponent: f64) -> f64 {
    x.signum() * x.abs().powf(exponent)
}

/// What the noise of a level is, 1/nCSF by the luminance of each place.
pub(super) struct Noise(Option<Plane>);

impl Noise {
    /// Luminances between which sensitivity is interpolated.
    const SAMPLES: usize = 256;

    pub fn new(level: usize, count: usize, ppd: f64, adaptation: &Plane) -> Self {
        if level + 1 == count {
            return Self(None);
        }
        let rho = frequency_of(level, ppd);
        let (from, to) = eye::LOG_RANGE;
        let step = (to - from) / (Self::SAMPLES - 1) as f64;
        let table: Vec<f64> =
            (0..Self::SAMPLES).map(|i| neural_sensitivity(rho, 10f64.powf(from + i as f64 * step))).collect();
        Self(Some(adaptation.map(|log| {
            let place = (log.clamp(from, to) - from) / step;
            let i = (place as usize).min(Self::SAMPLES - 2);
            1.0 / (table[i] + (place - i as f64) * (table[i + 1] - table[i]))
        })))
    }

    fn at(&self, i: usize) -> f64 {
        self.0.as_ref().map_or(1.0, |plane| plane.values[i])
    }
}

/// How much is masked in a level.
pub(super) struct Masking {
    /// n.
    pub norm: f64,
    /// m of each orientation.
    own: Vec<Plane>,
    /// The sum of m over orientations.
    all: Plane,
    /// m_xn of each orientation.
    neighbours: Vec<Plane>,
}

impl Masking {
    pub fn new(test: &Pyramid, reference: &Pyramid, level: usize) -> Self {
        let count = test.levels.len();
        let mutual = |level: usize, orientation: usize| {
            let planes = [test, reference].map(|p| &p.levels[level][orientation.min(p.levels[level].len() - 1)]);
            mean_of_nine(&Plane::of_two(planes[0], planes[1], |a, b| a.abs().min(b.abs())))
        };
        let norm = 2f64.powi(level as i32);
        let own: Vec<Plane> = (0..test.levels[level].len()).map(|o| mutual(level, o)).collect();
        let (width, height) = (own[0].width, own[0].height);
        let all = own.iter().skip(1).fold(own[0].clone(), |sum, m| Plane::of_two(&sum, m, |a, b| a + b));
        let neighbours = (0..own.len())
            .map(|orientation| {
                let mut sum = Plane { width, height, values: vec![0.0; width * height] };
                let mut add = |level: usize, norm: f64| {
                    let there = resized(&mutual(level, orientation), width, height);
                    sum = Plane::of_two(&sum, &there, |sum, m| sum + m.max(0.0) / norm);
                };
                if level > 0 {
                    add(level - 1, norm / 2.0);
                }
                // Not from the lowest band, whose values are of another kind.
                if level + 2 < count {
                    add(level + 1, norm * 2.0);
                }
                sum
            })
            .collect();
        Self { norm, own, all, neighbours }
    }

    /// D of an orientation.
    pub fn difference(&self, reference: &Plane, test: &Plane, orientation: usize, noise: &Noise) -> Plane {
        let [p, q] = [LOG_P, LOG_Q].map(|log| 10f64.powf(log));
        let [k_self, k_orientations, k_neighbours] =
            [LOG_K_SELF, LOG_K_ORIENTATIONS, LOG_K_NEIGHBOURS].map(|log| 10f64.powf(log));
        let n = self.norm;
        let width = reference.width;
        Plane::by_rows(width, reference.height, |y, row| {
            for (x, d) in row.iter_mut().enumerate() {
                let i = y * width + x;
                let excitation = signed_power((test.values[i] - reference.values[i]) / n, p) * n;
                let noise = noise.at(i);
                let own = self.own[orientation].values[i];
                let others = (self.all.values[i] - own).max(0.0);
                let mask = n
                    * (k_self * (own / noise / n).powf(q)
                        + k_orientations * (others / noise / n).powf(q)
                        + k_neighbours * (self.neighbours[orientation].values[i] / noise).powf(q));
                *d = excitation / (noise.powf(2.0 * p) + mask * mask).sqrt();
            }
        })
    }
}

/// The mean over 3 x 3 pixels, those beyond the border counting as 0.
fn mean_of_nine(plane: &Plane) -> Plane {
    let (width, height) = (plane.width, plane.height);
    Plane::by_rows(width, height, |y, out| {
        for row in y.saturating_sub(1)..(y + 2).min(height) {
            let row = plane.row(row);
            for (x, v) in out.iter_mut().enumerate() {
                *v += row[x.saturating_sub(1)..(x + 2).min(width)].iter().sum::<f64>();
            }
        }
        out.iter_mut().for_each(|v| *v /= 9.0);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_of_nine_take_nothing_from_beyond() {
        let plane = Plane { width: 3, height: 2, values: vec![9.0; 6] };
        assert_eq!(mean_of_nine(&plane).values, [4.0, 6.0, 4.0, 4.0, 6.0, 4.0]);
    }
}
