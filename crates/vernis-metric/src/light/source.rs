//! Lights at infinity on a 96 x 192 latitude/longitude grid, defined by code.
//!
//! Frame of the pictures: viewer towards +z, y up. Row i, column j: T = (i + 0.5) pi / 96 from +y, P = (j + 0.5) 2 pi / 192,
//! direction (sin T sin P, cos T, -sin T cos P). A cell holds the mean radiance over 4 x 4 finer cells weighted by sin T.
//!
//! *Lamps* (k0): six discs k = k0..k0+5 on a faint sky. With u_j = frac(0.5 + k G^-j), j = 1..5, G = 1.1347241384015194
//! (a Kronecker sequence whose base is the root of x^6 = x + 1, the five-dimensional golden ratio):
//!   y = -0.4 + 1.2 u1; azimuth a = 2 pi u2; centre (sqrt(1-y^2) sin a, y, -sqrt(1-y^2) cos a); radius r = 10^u3 deg;
//!   radiance L = 8^u4 (10 / r)^1.5; tau = 0.5 (2 u5 - 1); colour (e^tau, 1, e^-tau);
//!   e += L colour (1 - smoothstep(r - 0.5, r + 0.5, angle in deg));
//!   E = e / mean luminance(e) + 0.02 (0.85 + 0.15 y), scaled to a mean luminance of 3.
//! Radii over a decade give every highlight width something to answer to, as real probes do (Dror et al. 2004,
//! doi:10.1167/4.9.11, on the statistics of real-world illumination).
//!
//! *Slot*: E = 0.16 + 9.6 smoothstep(0.75, 0.90, y), white: one broad overhead source, for what the lamps leave to noise.
//!
//! A *probe* is a latitude/longitude picture of the user's, reduced to the grid by area and scaled to mean luminance 3.

use super::LightError;
use crate::io::read_at_most;
use crate::math::color::luminance;
use crate::math::{Rgb, Vec3};
use std::f64::consts::PI;
use std::path::Path;

/// Rows of the grid, from +y to -y.
pub const ROWS: usize = 96;
/// Columns of the grid.
pub const COLUMNS: usize = 192;
/// Largest file of a light probe that is read: 16,384 x 8,192 pixels take at most 512 MiB.
pub(crate) const MOST_BYTES: u64 = 768 << 20;
/// Pixels of the largest probe that is read.
const MOST_PIXELS: usize = 16_384 * 8_192;
/// A run of equal pixels in the older encoding: four bytes repeat the last pixel 255 times.
const MOST_PIXELS_PER_BYTE: usize = 64;
/// Finer cells along each axis of a cell.
const FINER: usize = 4;
/// Mean luminance over the sphere that lamps and probes are scaled to.
const MEAN_LUMINANCE: f64 = 3.0;
/// The real root of x^6 = x + 1.
const GOLDEN_5: f64 = 1.134_724_138_401_519_4;

/// Radiance from everywhere, linear RGB.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    radiance: Vec<Rgb>,
}

/// Unit direction of fractional grid position (row, column).
fn direction(row: f64, column: f64) -> Vec3 {
    let (sin_t, cos_t) = (row * PI / ROWS as f64).sin_cos();
    let (sin_p, cos_p) = (column * 2.0 * PI / COLUMNS as f64).sin_cos();
    Vec3::new(sin_t * sin_p, cos_t, -sin_t * cos_p)
}

fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// One disc of the lamps.
struct Disc {
    centre: Vec3,
    /// Degrees.
    radius: f64,
    /// Radiance at the centre.
    radiance: Rgb,
}

impl Disc {
    fn new(k: usize) -> Self {
        let u = |j: i32| (0.5 + k as f64 * GOLDEN_5.powi(-j)).fract();
        let y = -0.4 + 1.2 * u(1);
        let (sin_a, cos_a) = (2.0 * PI * u(2)).sin_cos();
        let side = (1.0 - y * y).sqrt();
        let radius = 10f64.powf(u(3));
        let level = 8f64.powf(u(4)) * (10.0 / radius).powf(1.5);
        let tau = 0.5 * (2.0 * u(5) - 1.0);
        Self {
            centre: Vec3::new(side * sin_a, y, -side * cos_a),
            radius,
            radiance: [level * tau.exp(), level, level * (-tau).exp()],
        }
    }

    fn coverage(&self, w: Vec3) -> f64 {
        // Most directions are far from the disc, and need no angle.
        if self.centre.dot(w) < (self.radius + 1.0).to_radians().cos() {
            return 0.0;
        }
        // The cross product keeps small angles exact.
        let angle = self.centre.cross(w).length().atan2(self.centre.dot(w)).to_degrees();
        1.0 - smoothstep(self.radius - 0.5, self.radius + 0.5, angle)
    }
}

impl Light {
    /// The light whose radiance towards the scene from direction `w` is `f(w)`.
    pub fn from_fn(f: impl Fn(Vec3) -> Rgb) -> Self {
        let mut radiance = Vec::with_capacity(ROWS * COLUMNS);
        for row in 0..ROWS {
            for column in 0..COLUMNS {
                let mut sum = [0.0; 3];
                let mut weight = 0.0;
                for a in 0..FINER {
                    let r = row as f64 + (a as f64 + 0.5) / FINER as f64;
                    let sin_t = (r * PI / ROWS as f64).sin();
                    for b in 0..FINER {
                        let value = f(direction(r, column as f64 + (b as f64 + 0.5) / FINER as f64));
                        (0..3).for_each(|c| sum[c] += sin_t * value[c]);
                        weight += sin_t;
                    }
                }
                radiance.push(sum.map(|s| s / weight));
            }
        }
        Self { radiance }
    }

    /// Six discs from number `k0` on, over a faint sky.
    pub fn lamps(k0: usize) -> Self {
        let discs = Self::discs(k0);
        let mean = discs.mean_luminance();
        let mut light = discs;
        for (cell, e) in light.radiance.iter_mut().enumerate() {
            let sky = 0.02 * (0.85 + 0.15 * Self::cell_direction(cell).y);
            *e = e.map(|v| v / mean + sky);
        }
        light.scaled_to(MEAN_LUMINANCE)
    }

    /// The discs of [`Light::lamps`] alone, as their formula gives them.
    fn discs(k0: usize) -> Self {
        let discs: Vec<Disc> = (k0..k0 + 6).map(Disc::new).collect();
        Self::from_fn(|w| {
            discs.iter().fold([0.0; 3], |sum: Rgb, disc| {
                let cover = disc.coverage(w);
                [0, 1, 2].map(|c| sum[c] + cover * disc.radiance[c])
            })
        })
    }

    /// One broad white source overhead.
    pub fn slot() -> Self {
        Self::from_fn(|w| [0.16 + 9.6 * smoothstep(0.75, 0.90, w.y); 3])
    }

    /// The same white radiance from everywhere.
    pub fn constant(radiance: f64) -> Self {
        Self { radiance: vec![[radiance; 3]; ROWS * COLUMNS] }
    }

    /// A latitude/longitude Radiance picture (`.hdr`), reduced to the grid by area and scaled to mean luminance 3.
    pub fn probe(path: &Path) -> Result<Self, LightError> {
        let ProbePicture { width, height, pixels } = ProbePicture::read(path)?;
        let unreadable = |reason: String| LightError::Probe { path: path.to_owned(), reason };
        let light = Self::reduced(width, height, |x, y| pixels[y * width + x]);
        let mean = light.mean_luminance();
        if !(mean.is_finite() && mean > 0.0) {
            return Err(unreadable(format!("its mean luminance is {mean}; it must be finite and greater than 0")));
        }
        Ok(light.scaled_to(MEAN_LUMINANCE))
    }

    /// Means over cells of a `width` x `height` picture, weighted by overlap and sin T.
    fn reduced(width: usize, height: usize, pixel: impl Fn(usize, usize) -> Rgb) -> Self {
        let overlap = |cell: usize, cells: usize, pixels: usize| {
            let scale = pixels as f64 / cells as f64;
            let (from, to) = (cell as f64 * scale, (cell + 1) as f64 * scale);
            (from as usize..(to.ceil() as usize).min(pixels))
                .map(move |p| (p, (to.min((p + 1) as f64) - from.max(p as f64)).max(0.0)))
        };
        let mut radiance = Vec::with_capacity(ROWS * COLUMNS);
        for row in 0..ROWS {
            for column in 0..COLUMNS {
                let mut sum = [0.0; 3];
                let mut weight = 0.0;
                for (y, wy) in overlap(row, ROWS, height) {
                    let wy = wy * ((y as f64 + 0.5) * PI / height as f64).sin();
                    for (x, wx) in overlap(column, COLUMNS, width) {
                        let value = pixel(x, y);
                        (0..3).for_each(|c| sum[c] += wx * wy * value[c]);
                        weight += wx * wy;
                    }
                }
                radiance.push(sum.map(|s| s / weight));
            }
        }
        Self { radiance }
    }

    /// Turned about the vertical by `degrees`, to the nearest column.
    pub fn rotated(&self, degrees: f64) -> Self {
        let shift = (degrees / 360.0 * COLUMNS as f64).round().rem_euclid(COLUMNS as f64) as usize;
        let radiance = (0..ROWS * COLUMNS)
            .map(|cell| self.radiance[cell / COLUMNS * COLUMNS + (cell % COLUMNS + shift) % COLUMNS])
            .collect();
        Self { radiance }
    }

    /// Radiance of every cell, row by row.
    pub fn radiance(&self) -> &[Rgb] {
        &self.radiance
    }

    /// Direction of the centre of a cell.
    pub fn cell_direction(cell: usize) -> Vec3 {
        direction((cell / COLUMNS) as f64 + 0.5, (cell % COLUMNS) as f64 + 0.5)
    }

    /// Solid angle of a cell, sr.
    pub fn cell_solid_angle(cell: usize) -> f64 {
        let edge = |row: usize| (row as f64 * PI / ROWS as f64).cos();
        let row = cell / COLUMNS;
        (edge(row) - edge(row + 1)) * 2.0 * PI / COLUMNS as f64
    }

    /// Mean luminance over the sphere.
    pub fn mean_luminance(&self) -> f64 {
        let sum: f64 =
            self.radiance.iter().enumerate().map(|(cell, e)| luminance(*e) * Self::cell_solid_angle(cell)).sum();
        sum / (4.0 * PI)
    }

    fn scaled_to(mut self, mean: f64) -> Self {
        let scale = mean / self.mean_luminance();
        self.radiance.iter_mut().flatten().for_each(|v| *v *= scale);
        self
    }
}

/// A light probe as its file has it.
pub struct ProbePicture {
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Linear RGB, row by row from +y.
    pub pixels: Vec<Rgb>,
}

impl ProbePicture {
    /// A latitude/longitude Radiance picture (`.hdr`) of at least [`COLUMNS`] x [`ROWS`] pixels.
    pub fn read(path: &Path) -> Result<Self, LightError> {
        let unreadable = |reason: String| LightError::Probe { path: path.to_owned(), reason };
        let bytes = read_at_most(path, MOST_BYTES).map_err(|e| unreadable(e.to_string()))?;
        let decoder = image::codecs::hdr::HdrDecoder::new(&bytes[..]).map_err(|e| unreadable(e.to_string()))?;
        let (width, height) = (decoder.metadata().width as usize, decoder.metadata().height as usize);
        if width < COLUMNS || height < ROWS {
            return Err(unreadable(format!("it has {width}x{height} pixels; it must have at least {COLUMNS}x{ROWS}")));
        }
        // The decoder makes room for all that the header says.
        let (said, most) = (width.saturating_mul(height), MOST_PIXELS.min(MOST_PIXELS_PER_BYTE * bytes.len()));
        if said > most {
            return Err(unreadable(format!(
                "its header says {width}x{height} pixels; in {} bytes there can be at most {most}",
                bytes.len()
            )));
        }
        let mut pixels = vec![[0.0; 3]; said];
        let linear = |pixel: image::codecs::hdr::Rgbe8Pixel| pixel.to_hdr().0.map(f64::from);
        decoder.read_image_transform(linear, &mut pixels).map_err(|e| match e {
            image::ImageError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
                unreadable(format!("it ends before the last of its {width}x{height} pixels"))
            }
            other => unreadable(other.to_string()),
        })?;
        Ok(Self { width, height, pixels })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values that the definition of the lamps states for k0 = 1.
    #[test]
    fn first_lamp_has_the_stated_values() {
        let disc = Disc::new(1);
        assert!((disc.centre.y - 0.05753).abs() < 5e-6);
        let azimuth = disc.centre.x.atan2(-disc.centre.z).to_degrees();
        assert!((azimuth - 99.590).abs() < 5e-4);
        assert!((disc.radius - 1.529).abs() < 5e-4);
        assert!(((disc.radiance[0] / disc.radiance[1]).ln() + 0.4684).abs() < 5e-5);
        let mean = Light::discs(1).mean_luminance();
        assert!((mean - 0.08873).abs() < 5e-6, "{mean}");
        // In the finished light: over the mean, with the sky's mean of 0.02 x 0.85 beside it, scaled to 3.
        let level = disc.radiance[1] / mean * 3.0 / 1.017;
        assert!((level - 689.07).abs() < 0.05, "{level}");
    }

    #[test]
    fn solid_angles_fill_the_sphere_and_directions_are_unit() {
        let total: f64 = (0..ROWS * COLUMNS).map(Light::cell_solid_angle).sum();
        assert!((total - 4.0 * PI).abs() < 1e-12);
        assert!((0..ROWS * COLUMNS).all(|c| (Light::cell_direction(c).length() - 1.0).abs() < 1e-12));
    }

    #[test]
    fn lights_have_their_mean_and_never_go_dark() {
        for k0 in [1, 101, 201] {
            let light = Light::lamps(k0);
            assert!((light.mean_luminance() - 3.0).abs() < 1e-12);
            assert!(light.radiance.iter().flatten().all(|v| *v > 0.0));
        }
        // Mean of smoothstep(0.75, 0.9, y) over the sphere: half the integral over y, (1 - 0.9 + 0.15 / 2) / 2.
        assert!((Light::slot().mean_luminance() - (0.16 + 9.6 * 0.175 / 2.0)).abs() < 1e-3);
    }

    #[test]
    fn reduction_keeps_the_mean_and_rotation_comes_round() {
        let light = Light::reduced(500, 250, |_, y| [y as f64, 1.0, 0.5]);
        let expected = luminance([124.5, 1.0, 0.5]);
        assert!((light.mean_luminance() - expected).abs() < 1e-3 * expected);
        let lamps = Light::lamps(1);
        assert_eq!(lamps.rotated(90.0).rotated(270.0), lamps);
        assert_ne!(lamps.rotated(90.0), lamps);
    }
}
