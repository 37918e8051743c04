//! The colour spaces in which CID and iCID work: LAB2000HL with a table of the user's, or CIELAB.
//!
//! LAB2000HL is CIELAB bent so that CIEDE2000 is nearly the Euclidean distance and lines of hue are straight. Its L axis has a closed
//! form,
//!
//!   L(L*) = integral from 0 to L* of dl / S_L(l),  S_L(l) = 1 + 0.015 (l - 50)^2/sqrt(20 + (l - 50)^2),
//!
//! with L(100) = 75.153; its a and b are known only as the authors' table over a* and b*. The table has no licence, so it is never
//! shipped; the user names the file.
//!
//! Source: Lissner and Urban 2012 (doi:10.1109/TIP.2011.2163522).

use super::colour::{inverse, light, times};
use crate::picture::EncodedPicture;
use palette::convert::FromColorUnclamped;
use palette::white_point::{Any, WhitePoint};
use palette::{Lab, Xyz};
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};
use thiserror::Error;
use vernis_metric::io::read_at_most;
use vernis_metric::math::parallel;

/// Values of a* and of b* in the table: -128 to 128.
const SIDE: usize = 257;
/// Bytes of the table: a and b of each place, 32-bit numbers.
const BYTES: usize = SIDE * SIDE * 2 * 4;
/// No colour has a larger a or b.
const LARGEST: f32 = 200.0;

/// XYZ to linear sRGB with four digits, as the authors' program has it; its inverse is used.
const RGB_FROM_XYZ: [[f64; 3]; 3] = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];

/// The white that goes with it (0.950456, 1, 1.088754).
struct White;

impl WhitePoint<f64> for White {
    fn get_xyz() -> Xyz<Any, f64> {
        Xyz::new(0.950456, 1.0, 1.088754)
    }
}

/// The user's table of a and b of LAB2000HL.
#[derive(Clone, Debug, PartialEq)]
pub struct Lab2000HlTable {
    /// a and b for each b* (rows) and a* (columns).
    values: Vec<[f32; 2]>,
}

/// Why a table cannot be used.
#[derive(Debug, Error)]
#[error("{}: {reason}", path.display())]
pub struct TableError {
    /// The file.
    pub path: PathBuf,
    /// What was found, and what is allowed.
    pub reason: String,
}

impl Lab2000HlTable {
    /// The name of the file in the folder that a user names.
    pub const FILE: &str = "lab2000hl_ab.f32";

    /// A table of 257 x 257 x 2 little-endian 32-bit numbers: for b* = -128..128, for a* = -128..128, a and b.
    ///
    /// # Errors
    /// [`TableError`]: the file cannot be read, has another size, or values that no colour has.
    pub fn read(path: &Path) -> Result<Self, TableError> {
        let wrong = |reason: String| TableError { path: path.to_owned(), reason };
        let bytes = read_at_most(path, BYTES as u64 + 1).map_err(|e| wrong(e.to_string()))?;
        Self::decode(&bytes).map_err(wrong)
    }

    /// The same of the bytes of such a file.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn decode(bytes: &[u8]) -> Result<Self, String> {
        if bytes.len() != BYTES {
            return Err(format!(
                "it has {} bytes; the table of LAB2000HL has {SIDE} x {SIDE} x 2 numbers of 4 bytes, {BYTES}",
                bytes.len()
            ));
        }
        let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        let values: Vec<[f32; 2]> = bytes.chunks_exact(8).map(|b| [number(&b[..4]), number(&b[4..])]).collect();
        let unfit = values.iter().flatten().position(|v| !v.is_finite() || v.abs() > LARGEST);
        if let Some(at) = unfit {
            let value = values[at / 2][at % 2];
            return Err(format!("number {at} is {value}; it must be from -{LARGEST} to {LARGEST}"));
        }
        Ok(Self { values })
    }

    /// a and b at a* and b*, which are held to -128..128; bilinear.
    fn at(&self, a: f64, b: f64) -> [f64; 2] {
        let place = |v: f64| {
            let v = v.clamp(-128.0, 128.0) + 128.0;
            let cell = (v as usize).min(SIDE - 2);
            (cell, v - cell as f64)
        };
        let ((i, s), (j, t)) = (place(a), place(b));
        let value = |i: usize, j: usize| self.values[j * SIDE + i].map(f64::from);
        let [near, right, below, across] = [value(i, j), value(i + 1, j), value(i, j + 1), value(i + 1, j + 1)];
        std::array::from_fn(|k| {
            (1.0 - t) * ((1.0 - s) * near[k] + s * right[k]) + t * ((1.0 - s) * below[k] + s * across[k])
        })
    }
}

/// Intervals of L* in which the integral is tabulated.
const STEPS: usize = 2000;

/// L of LAB2000HL at L* = 0, 0.05, ... 100.
static LIGHTNESS: LazyLock<Vec<f64>> = LazyLock::new(|| {
    let step = 100.0 / STEPS as f64;
    let mut sum = 0.0;
    let mut values = vec![0.0];
    for i in 0..STEPS {
        // Simpson's rule; its error over a step is below 1e-12.
        let from = i as f64 * step;
        sum += step / 6.0 * (slope(from) + 4.0 * slope(from + 0.5 * step) + slope(from + step));
        values.push(sum);
    }
    values
});

/// dL/dL* = 1/S_L.
fn slope(l: f64) -> f64 {
    let square = (l - 50.0).powi(2);
    1.0 / (1.0 + 0.015 * square / (20.0 + square).sqrt())
}

/// L of LAB2000HL; L* is held to 0..100. Between the tabulated places, the cubic of their values and slopes.
fn lightness(l: f64) -> f64 {
    let l = l.clamp(0.0, 100.0);
    let step = 100.0 / STEPS as f64;
    let i = ((l / step) as usize).min(STEPS - 1);
    let t = l / step - i as f64;
    let (from, to) = (i as f64 * step, (i + 1) as f64 * step);
    let (a, b) = (LIGHTNESS[i], LIGHTNESS[i + 1]);
    let (da, db) = (step * slope(from), step * slope(to));
    a + t * (da + t * (3.0 * (b - a) - 2.0 * da - db + t * (2.0 * (a - b) + da + db)))
}

/// The space in which colours are compared.
#[derive(Clone, Debug)]
pub enum Space {
    /// LAB2000HL, with the user's table.
    Lab2000Hl(Arc<Lab2000HlTable>),
    /// CIELAB, where there is no table.
    Cielab,
}

impl Space {
    /// Lightness, a and b of a colour in CIELAB.
    pub(super) fn of_cielab(&self, [l, a, b]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Cielab => [l, a, b],
            Self::Lab2000Hl(table) => {
                let [a, b] = table.at(a, b);
                [lightness(l), a, b]
            }
        }
    }
}

static XYZ_FROM_RGB: LazyLock<[[f64; 3]; 3]> = LazyLock::new(|| inverse(&RGB_FROM_XYZ));

/// XYZ of linear light, 0 to 1.
pub(super) fn xyz_of_light(light: [f64; 3]) -> [f64; 3] {
    times(&XYZ_FROM_RGB, light)
}

/// CIELAB of a colour in XYZ, white at Y = 1. Filters may have made it negative.
pub(super) fn cielab([x, y, z]: [f64; 3]) -> [f64; 3] {
    let lab = Lab::from_color_unclamped(Xyz::<White, f64>::new(x, y, z));
    [lab.l, lab.a, lab.b]
}

/// Whether X, Y and Z of a colour are below the bend of CIELAB's curve.
pub(super) fn is_dark([x, y, z]: [f64; 3]) -> [bool; 3] {
    let white = White::get_xyz();
    [x / white.x, y / white.y, z / white.z].map(|t| t < 0.008856)
}

/// XYZ of every pixel.
pub(super) fn xyz(picture: &EncodedPicture) -> Vec<[f64; 3]> {
    parallel::map_items(picture.pixels(), |pixel| xyz_of_light(light(*pixel, picture.encoding())))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// L at L* = 100 as the table of the authors has it (75.1531864), and by a rule of another order in between.
    #[test]
    fn lightness_is_the_integral() {
        assert!((lightness(100.0) - 75.153_186_4).abs() < 5e-8, "{}", lightness(100.0));
        assert_eq!((lightness(0.0), lightness(-5.0), lightness(120.0)), (0.0, 0.0, lightness(100.0)));
        let midpoints = |to: f64| (0..200_000).map(|i| slope(to * (f64::from(i) + 0.5) / 2e5) * to / 2e5).sum::<f64>();
        for l in [3.21, 49.99, 50.0, 77.777] {
            assert!((lightness(l) - midpoints(l)).abs() < 1e-8, "{l}");
        }
    }

    fn table(value: impl Fn(i32, i32) -> [f32; 2]) -> Vec<u8> {
        let places = (-128..=128).flat_map(|b| (-128..=128).map(move |a| (a, b)));
        places.flat_map(|(a, b)| value(a, b)).flat_map(f32::to_le_bytes).collect()
    }

    /// A table that is bilinear gives its formula everywhere, held to the border.
    #[test]
    fn tables_are_bilinear() {
        let formula = |a: f64, b: f64| [0.5 * a + 1.0, 0.25 * b - 0.001 * a * b];
        let bytes = table(|a, b| formula(f64::from(a), f64::from(b)).map(|v| v as f32));
        let table = Lab2000HlTable::decode(&bytes).expect("a table");
        for (a, b) in [(0.0, 0.0), (12.25, -77.5), (-128.0, 128.0), (127.9, 3.4)] {
            let (found, expected) = (table.at(a, b), formula(a, b));
            assert!((0..2).all(|k| (found[k] - expected[k]).abs() < 1e-5), "{a} {b}: {found:?}");
        }
        assert_eq!(table.at(500.0, -500.0), table.at(128.0, -128.0));
    }

    #[test]
    fn unfit_tables_are_refused() {
        let good = table(|_, _| [1.0, 2.0]);
        let size = Lab2000HlTable::decode(&good[4..]).unwrap_err();
        assert_eq!(size, "it has 528388 bytes; the table of LAB2000HL has 257 x 257 x 2 numbers of 4 bytes, 528392");
        let nan = Lab2000HlTable::decode(&table(|a, b| [if (a, b) == (-126, -128) { f32::NAN } else { 0.0 }, 0.0]));
        assert_eq!(nan.unwrap_err(), "number 4 is NaN; it must be from -200 to 200");
    }
}
