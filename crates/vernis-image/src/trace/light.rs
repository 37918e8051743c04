//! The light as it is sampled: texels by an alias table (Walker 1977, doi:10.1145/355744.355749), uniformly in solid angle inside.

use super::sampler::unit;
use crate::scene::{Light, Panorama};
use glam::Vec3A;
use std::f32::consts::{PI, TAU};

/// A light at infinity.
pub enum Lighting {
    /// The same radiance from everywhere: it has no direction to be looked for.
    White(Vec3A),
    /// Constant texels.
    Texels(Texels),
}

/// The texels of a panorama.
pub struct Texels {
    width: usize,
    height: usize,
    /// Radiance, and the density of [`Texels::sample`], 1/sr.
    cells: Vec<[f32; 4]>,
    /// Of each cell: the share of its slot that is its own, of 2^32, and the cell that has the rest.
    alias: Vec<(u32, u32)>,
    /// cos T at the upper edge of each row, and at the lower edge of the last.
    edges: Vec<f32>,
}

/// A direction towards the light.
pub struct LightSample {
    /// Unit vector.
    pub direction: Vec3A,
    /// Radiance from there.
    pub radiance: Vec3A,
    /// Density of the choice, 1/sr.
    pub density: f32,
}

impl Lighting {
    /// The light, scaled.
    pub fn new(light: &Light, scale: f64) -> Self {
        match light {
            Light::White => Self::White(Vec3A::splat(scale as f32)),
            Light::Panorama(panorama) => Self::Texels(Texels::new(panorama, scale)),
        }
    }

    /// Radiance from a direction, and the density with which [`Texels::sample`] chooses it: 0 for white light.
    #[inline]
    pub fn towards(&self, direction: Vec3A) -> (Vec3A, f32) {
        match self {
            Self::White(radiance) => (*radiance, 0.0),
            Self::Texels(texels) => {
                let [r, g, b, density] = texels.cells[texels.cell(direction)];
                (Vec3A::new(r, g, b), density)
            }
        }
    }
}

impl Texels {
    fn new(panorama: &Panorama, scale: f64) -> Self {
        let (width, height) = (panorama.width(), panorama.height());
        let cos = |row: usize| (row as f64 * std::f64::consts::PI / height as f64).cos();
        let solid_angle = |row: usize| (cos(row) - cos(row + 1)) * 2.0 * std::f64::consts::PI / width as f64;
        let power: Vec<f64> = panorama
            .texels()
            .iter()
            .enumerate()
            .map(|(k, texel)| texel.iter().map(|v| f64::from(*v)).sum::<f64>() * solid_angle(k / width))
            .collect();
        let total: f64 = power.iter().sum();
        let cells = panorama.texels().iter().zip(&power).enumerate().map(|(k, (texel, power))| {
            let [r, g, b] = texel.map(|v| (scale * f64::from(v)) as f32);
            [r, g, b, (power / total / solid_angle(k / width)) as f32]
        });
        Self {
            width,
            height,
            cells: cells.collect(),
            alias: alias(&power, total),
            edges: (0..=height).map(|row| cos(row) as f32).collect(),
        }
    }

    /// The cell of a direction.
    #[inline]
    fn cell(&self, d: Vec3A) -> usize {
        let row = (d.y.clamp(-1.0, 1.0).acos() * (self.height as f32 / PI)) as usize;
        let turn = d.x.atan2(-d.z) * (1.0 / TAU);
        let column = ((turn - turn.floor()) * self.width as f32) as usize;
        row.min(self.height - 1) * self.width + column.min(self.width - 1)
    }

    /// A direction chosen by radiance: 64 bits choose the texel, two numbers the place in it.
    #[inline]
    pub fn sample(&self, choice: u64, place: [u32; 2]) -> LightSample {
        let wide = u128::from(choice) * self.alias.len() as u128;
        let (slot, rest) = ((wide >> 64) as usize, (wide >> 32) as u32);
        let (own, other) = self.alias[slot];
        let cell = if rest < own { slot } else { other as usize };
        let (row, column) = (cell / self.width, cell % self.width);
        let cos = self.edges[row] + unit(place[0]) * (self.edges[row + 1] - self.edges[row]);
        let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
        let (sin_p, cos_p) = ((column as f32 + unit(place[1])) * (TAU / self.width as f32)).sin_cos();
        let [r, g, b, density] = self.cells[cell];
        LightSample { direction: Vec3A::new(sin * sin_p, cos, -sin * cos_p), radiance: Vec3A::new(r, g, b), density }
    }
}

/// Slots of equal mass, each of one cell or two.
pub(super) fn alias(mass: &[f64], total: f64) -> Vec<(u32, u32)> {
    let count = mass.len();
    let mut left: Vec<f64> = mass.iter().map(|m| m / total * count as f64).collect();
    let mut slots: Vec<(u32, u32)> = (0..count).map(|k| (u32::MAX, k as u32)).collect();
    let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..count).partition(|&k| left[k] < 1.0);
    while let (Some(&poor), Some(&rich)) = (small.last(), large.last()) {
        small.pop();
        slots[poor] = ((left[poor] * (1u64 << 32) as f64) as u32, rich as u32);
        left[rich] -= 1.0 - left[poor];
        if left[rich] < 1.0 {
            large.pop();
            small.push(rich);
        }
    }
    slots
}

#[cfg(test)]
mod tests {
    use super::super::sampler::Sampler;
    use super::*;

    fn texels() -> Texels {
        let pixels = (0..8 * 16).map(|k| [(k % 7) as f32, if k == 40 { 90.0 } else { 0.5 }, (k % 3) as f32]).collect();
        Texels::new(&Panorama::new(16, 8, pixels).unwrap(), 2.0)
    }

    /// A choice lands in the texel whose radiance and density it states, and texels come as often as their densities say.
    #[test]
    fn samples_follow_their_density() {
        let texels = texels();
        let mut counts = vec![0usize; texels.cells.len()];
        let n = 200_000;
        for k in 0..n {
            let mut sampler = Sampler::new(Sampler::pixel(3, 0), k);
            let sample = texels.sample(sampler.next(), sampler.two());
            assert!((sample.direction.length() - 1.0).abs() < 1e-5);
            let cell = texels.cell(sample.direction);
            counts[cell] += usize::from(texels.cells[cell][3] == sample.density);
        }
        let solid_angle =
            |row: usize| f64::from(texels.edges[row] - texels.edges[row + 1]) * std::f64::consts::TAU / 16.0;
        let expected = |k: usize| f64::from(texels.cells[k][3]) * solid_angle(k / 16) * f64::from(n);
        assert!((0..128).map(expected).sum::<f64>() / f64::from(n) - 1.0 < 1e-5);
        // Chi square with 127 degrees of freedom: mean 127, standard deviation 16.
        let chi2: f64 = (0..128)
            .filter(|k| expected(*k) > 0.0)
            .map(|k| (counts[k] as f64 - expected(k)).powi(2) / expected(k))
            .sum();
        assert!(chi2 < 127.0 + 5.0 * 16.0, "{chi2}");
    }

    #[test]
    fn directions_are_in_the_frame_of_the_descriptors() {
        let texels = texels();
        for (direction, row, column) in [
            (Vec3A::new(0.05, 0.99, -0.05), 0, 2),
            (Vec3A::new(0.01, -0.1, -1.0), 4, 0),
            (Vec3A::new(1.0, 0.1, -0.01), 3, 3),
            (Vec3A::new(-0.01, 0.1, -1.0), 3, 15),
            (Vec3A::new(-0.01, -0.1, 1.0), 4, 8),
        ] {
            assert_eq!(texels.cell(direction.normalize()), row * 16 + column, "{direction}");
        }
        assert_eq!(texels.cell(Vec3A::Y) / 16, 0);
        assert_eq!(texels.cell(Vec3A::NEG_Y) / 16, 7);
    }
}
