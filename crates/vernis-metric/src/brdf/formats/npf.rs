//! NPF: the non-parametric factor microfacet model, factors tabulated per material (`npf.bin`).
//!
//! f = (rho_d + rho_s D(theta_h) F(theta_d) G1(theta_i) G1(theta_o) / (cos theta_i cos theta_o)) / pi
//!
//! One row of 512 little-endian f32 RGB triples a material: `[rho_d][rho_s][D 90][G1 90][F 90]`, the rest unused; 256
//! rows, the first 100 in use. D: bin floor(90 sqrt(theta_h / 90 deg)); F: bin floor(theta_d in degrees); G1:
//! interpolated linearly between the centres of bins of one degree. Dimensionless. Reciprocal.
//! Source: Bagher et al. 2016, doi:10.1145/2907941; the layout is that of the published file and of the evaluator that comes
//! with it (`demo-merl/shaders/npf.glsl`). The division by pi is not spelled out there, but only with it the values agree
//! with the measured materials.
//!
//! **Two bins hold no factor, and take the value of the next bin** (version 2 of this reader; version 1 read them as black).
//! The first bin of G1 (column 92) is 0 for all materials: it was never filled, and the published evaluator skips it. The
//! first bin of F (column 182) continues G1 to its end at 90 degrees: it is near 0 for all materials, while the bin after
//! it is not. Other layouts explain the file no better. On the published slice of the measured materials (phi_d = 89.5
//! degrees, all 100, pixels from 0.004 to 0.95) the mean |ln ratio| is 0.200 for this layout, 0.203 with F one column later, and
//! 0.199 to 0.207 with G1 at whole degrees, half a degree lower, or both.
//! Cost: four arc tangents or cosines and five table look-ups.

use super::io_error;
use crate::brdf::{Brdf, BrdfError, ContentHash};
use crate::io::{nearest, open_regular};
use crate::math::{Rgb, Vec3};
use std::f64::consts::{FRAC_1_PI, FRAC_PI_2};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

const ROWS: usize = 256;
const COLUMNS: usize = 512;
const BINS: usize = 90;
const ROW_BYTES: usize = COLUMNS * 12;
/// The first bins of G1 and F, which hold no factor.
const UNFILLED: [usize; 2] = [2 + BINS, 2 + 2 * BINS];
/// Of the values that a row gives; part of a material's content hash.
const VERSION: &str = "npf 2";
/// Files of the UTIA database, which have the same extension: 288 x 288 directions of RGB in f64 or f32.
const UTIA_BYTES: [u64; 2] = [3 * 8 * 288 * 288, 3 * 4 * 288 * 288];

/// The 100 materials of the MERL database, sorted.
#[rustfmt::skip]
pub const MERL_MATERIALS: [&str; 100] = [
    "alum-bronze", "alumina-oxide", "aluminium", "aventurnine", "beige-fabric", "black-fabric", "black-obsidian",
    "black-oxidized-steel", "black-phenolic", "black-soft-plastic", "blue-acrylic", "blue-fabric",
    "blue-metallic-paint", "blue-metallic-paint2", "blue-rubber", "brass", "cherry-235", "chrome", "chrome-steel",
    "colonial-maple-223", "color-changing-paint1", "color-changing-paint2", "color-changing-paint3",
    "dark-blue-paint", "dark-red-paint", "dark-specular-fabric", "delrin", "fruitwood-241", "gold-metallic-paint",
    "gold-metallic-paint2", "gold-metallic-paint3", "gold-paint", "gray-plastic", "grease-covered-steel",
    "green-acrylic", "green-fabric", "green-latex", "green-metallic-paint", "green-metallic-paint2", "green-plastic",
    "hematite", "ipswich-pine-221", "light-brown-fabric", "light-red-paint", "maroon-plastic", "natural-209",
    "neoprene-rubber", "nickel", "nylon", "orange-paint", "pearl-paint", "pickled-oak-260", "pink-fabric",
    "pink-fabric2", "pink-felt", "pink-jasper", "pink-plastic", "polyethylene", "polyurethane-foam", "pure-rubber",
    "purple-paint", "pvc", "red-fabric", "red-fabric2", "red-metallic-paint", "red-phenolic", "red-plastic",
    "red-specular-plastic", "silicon-nitrade", "silver-metallic-paint", "silver-metallic-paint2", "silver-paint",
    "special-walnut-224", "specular-black-phenolic", "specular-blue-phenolic", "specular-green-phenolic",
    "specular-maroon-phenolic", "specular-orange-phenolic", "specular-red-phenolic", "specular-violet-phenolic",
    "specular-white-phenolic", "specular-yellow-phenolic", "ss440", "steel", "teflon", "tungsten-carbide",
    "two-layer-gold", "two-layer-silver", "violet-acrylic", "violet-rubber", "white-acrylic", "white-diffuse-bball",
    "white-fabric", "white-fabric2", "white-marble", "white-paint", "yellow-matte-plastic", "yellow-paint",
    "yellow-phenolic", "yellow-plastic",
];

/// The factors of one material.
#[derive(Debug, Clone)]
pub struct Npf {
    diffuse: Rgb,
    specular: Rgb,
    distribution: Vec<Rgb>,
    masking: Vec<Rgb>,
    fresnel: Vec<Rgb>,
}

impl Npf {
    fn from_columns(columns: &[Rgb]) -> Self {
        let mut columns = columns.to_vec();
        for bin in UNFILLED {
            columns[bin] = columns[bin + 1];
        }
        let bins = |factor: usize| columns[2 + factor * BINS..2 + (factor + 1) * BINS].to_vec();
        Self { diffuse: columns[0], specular: columns[1], distribution: bins(0), masking: bins(1), fresnel: bins(2) }
    }

    /// G1 at a direction of the given cosine.
    fn masking(&self, cos: f64) -> Rgb {
        let position = (cos.min(1.0).acos().to_degrees() - 0.5).clamp(0.0, (BINS - 1) as f64);
        let low = (position as usize).min(BINS - 2);
        let t = position - low as f64;
        std::array::from_fn(|c| (1.0 - t) * self.masking[low][c] + t * self.masking[low + 1][c])
    }
}

impl Brdf for Npf {
    fn is_mirror_symmetric(&self) -> bool {
        true
    }

    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return Some([0.0; 3]);
        }
        let sum = wi + wo;
        let theta_h = (sum.x * sum.x + sum.y * sum.y).sqrt().atan2(sum.z);
        let theta_d = (0.5 * sum.length()).min(1.0).acos();
        let bin = |x: f64| (x as usize).min(BINS - 1);
        let d = self.distribution[bin((theta_h / FRAC_PI_2).sqrt() * BINS as f64)];
        let f = self.fresnel[bin(theta_d.to_degrees())];
        let (gi, go) = (self.masking(wi.z), self.masking(wo.z));
        let cosines = wi.z * wo.z;
        Some(std::array::from_fn(|c| {
            let lobe = self.specular[c] * d[c] * f[c] * gi[c] * go[c] / cosines;
            FRAC_1_PI * (self.diffuse[c] + lobe)
        }))
    }
}

/// The materials in the order of the rows: file names sorted with punctuation ignored.
fn row_order() -> Vec<&'static str> {
    let mut names = MERL_MATERIALS.to_vec();
    names.sort_by_key(|n| format!("{n}binary").replace('-', ""));
    names
}

/// The materials of the file at `path`, after a look at its size.
pub fn materials(path: &Path) -> Result<Vec<String>, BrdfError> {
    open(path)?;
    Ok(MERL_MATERIALS.map(str::to_owned).to_vec())
}

/// Opens a file of the right size.
fn open(path: &Path) -> Result<File, BrdfError> {
    let file = open_regular(path).map_err(io_error(path))?;
    let (found, allowed) = (file.metadata().map_err(io_error(path))?.len(), (ROWS * ROW_BYTES) as u64);
    if found == allowed {
        return Ok(file);
    }
    if UTIA_BYTES.contains(&found) {
        return Err(BrdfError::Malformed {
            path: path.to_owned(),
            format: "file of factors (NPF)",
            reason: format!("its {found} bytes are those of an anisotropic BRDF of UTIA, which vernis does not read"),
        });
    }
    Err(BrdfError::Size { path: path.to_owned(), format: "NPF", found, allowed: format!("exactly {allowed}") })
}

/// The bytes of a material's row in the file at `path`.
///
/// # Errors
/// A file of the wrong size, an unknown material.
pub fn row(path: &Path, material: &str) -> Result<Vec<u8>, BrdfError> {
    let mut file = open(path)?;
    let Some(row) = row_order().iter().position(|m| *m == material) else {
        return Err(BrdfError::UnknownMaterial {
            path: path.to_owned(),
            found: material.to_owned(),
            nearest: nearest(material, MERL_MATERIALS),
        });
    };
    let mut bytes = vec![0; ROW_BYTES];
    let start = SeekFrom::Start((row * ROW_BYTES) as u64);
    file.seek(start).and_then(|_| file.read_exact(&mut bytes)).map_err(io_error(path))?;
    Ok(bytes)
}

/// What tells a row's values apart from all others: its bytes, and how they are read.
pub fn content(row: &[u8]) -> ContentHash {
    ContentHash::of(&[VERSION.as_bytes(), row].concat())
}

/// The factors of `material` in the file at `path`.
pub fn read(path: &Path, material: &str) -> Result<Npf, BrdfError> {
    decode(path, material, &row(path, material)?)
}

/// The factors in the bytes of a row; `path` and `material` are for messages.
pub fn decode(path: &Path, material: &str, row: &[u8]) -> Result<Npf, BrdfError> {
    let used = 2 + 3 * BINS;
    let numbers: Vec<f64> =
        row.as_chunks::<4>().0.iter().take(3 * used).map(|b| f64::from(f32::from_le_bytes(*b))).collect();
    if let Some(k) = numbers.iter().position(|v| !v.is_finite() || *v < 0.0) {
        return Err(BrdfError::Value {
            path: path.to_owned(),
            place: format!("{material}, column {}, channel {}", k / 3, k % 3),
            found: numbers[k],
            allowed: "a finite number that is not negative",
        });
    }
    Ok(Npf::from_columns(numbers.as_chunks::<3>().0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row whose two unfilled bins hold what no reader may see.
    #[test]
    fn bins_that_hold_no_factor_take_their_neighbours_value() {
        let mut columns = vec![[1.0; 3]; 2 + 3 * BINS];
        columns[0] = [0.0; 3];
        (columns[92], columns[93], columns[182], columns[183]) = ([0.0; 3], [0.5; 3], [1e-9; 3], [0.25; 3]);
        let factors = Npf::from_columns(&columns);
        // D = 1, G1 = 0.5 twice, F = 0.25.
        let normal = Vec3::new(0.0, 0.0, 1.0);
        let found = factors.eval(normal, normal).expect("above the surface");
        assert!(found.iter().all(|v| (v - FRAC_1_PI * 0.0625).abs() < 1e-15), "{found:?}");
        assert_eq!(factors.masking(1.5_f64.to_radians().cos()).map(|v| (1e9 * v).round()), [5e8; 3]);
    }

    #[test]
    fn punctuation_does_not_count_in_the_order_of_the_rows() {
        let order = row_order();
        assert_eq!(&order[12..14], ["blue-metallic-paint2", "blue-metallic-paint"]);
        assert_eq!(&order[17..19], ["chrome", "chrome-steel"]);
        assert!(MERL_MATERIALS.is_sorted());
    }
}
