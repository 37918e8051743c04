//! RGL `.bsdf`: measured materials of the RGL database, stored along the warp that their own highlight defines.
//!
//! f = c(x, y) D(m) / (4 sigma(v)) / cos theta_l,   (x, y) = W_v(m),   m = (l + v) / |l + v|
//!
//! l, v: towards the light and the viewer; c: linear RGB (dimensionless), D: distribution of facets (1/sr), sigma: projected area
//! of the facets seen from v; W_v: the warp that flattens the density of the facets that v sees (`warp.rs`). All of them are
//! tables over the unit square of (u, w): theta = u^2 pi/2, phi = (2 w - 1) pi, that of W_v with phi of m counted from that of
//! v; c and W_v are linear in theta_v between the measured ones. Not reciprocal: measured as they are. The division by the
//! cosine makes a BRDF of the product that the files hold.
//!
//! The measured direction of a file, `theta_i`, is taken for the viewer, as Mitsuba renders these files. Components may be
//! **negative**: colours outside the gamut of the primaries. They are handed out as they are ([`Brdf::is_signed`]); tables and
//! metrics count them as 0. Where the database had no measurement its authors filled in values; the array `valid` that would
//! tell is not used: a set bit means a measurement in some files and the lack of one in others. A facet that no measured
//! direction sees has no value.
//!
//! Isotropic files with RGB values are read. Refused by name: anisotropic ones (more than two `phi_i`), spectra.
//! Source: Dupuy & Jakob 2018, doi:10.1145/3272127.3275059. Container: `tensor.rs`. Cost: about 40 look-ups.

mod tensor;
mod warp;

use super::io_error;
use crate::brdf::{Brdf, BrdfError};
use crate::io::open_regular;
use crate::math::{Rgb, Vec3};
use std::f64::consts::{FRAC_PI_2, PI};

use std::io::Read;
use std::path::Path;
use tensor::{Allowed, Directory};
use warp::{Bilinear, Density, flattened};

/// The published isotropic files with RGB values have 0.7 MB.
pub(super) const MOST_BYTES: u64 = 16 << 20;
/// What holds the directory of any file.
const HEAD: u64 = 1 << 16;
/// Files with more azimuths of the viewer are anisotropic.
const ISOTROPIC: usize = 2;

/// A measured material.
#[derive(Debug, Clone)]
pub struct Rgl {
    description: String,
    /// Of the viewer, radians, increasing.
    theta: Vec<f64>,
    facets: Bilinear,
    area: Bilinear,
    /// Of the facets that are seen, for each theta.
    visible: Vec<Density>,
    /// R, G and B, for each theta.
    colour: Vec<[Bilinear; 3]>,
    /// Whether colours are to be multiplied by D / (4 sigma).
    scaled: bool,
}

/// The bytes of a file that is isotropic and has RGB values, by its directory.
///
/// # Errors
/// As [`decode`]; a file of more bytes than such files have is refused before they are read.
pub(in crate::brdf) fn bytes(path: &Path) -> Result<Vec<u8>, BrdfError> {
    let mut file = open_regular(path).map_err(io_error(path))?;
    let size = file.metadata().map_err(io_error(path))?.len();
    let mut bytes = Vec::new();
    file.by_ref().take(HEAD).read_to_end(&mut bytes).map_err(io_error(path))?;
    let directory = Directory::read(&bytes, size).map_err(malformed(path))?;
    Shape::of(&directory).map_err(malformed(path))?;
    if size > MOST_BYTES {
        let allowed = format!("at most {MOST_BYTES}");
        return Err(BrdfError::Size { path: path.to_owned(), format: "an isotropic RGL file", found: size, allowed });
    }
    file.take(size.saturating_sub(HEAD)).read_to_end(&mut bytes).map_err(io_error(path))?;
    Ok(bytes)
}

/// The material in the bytes of a file; `path` is for messages.
///
/// # Errors
/// Another kind of file, an anisotropic or spectral one, arrays that are missing, of the wrong shape or hold numbers that are
/// none.
pub fn decode(path: &Path, bytes: &[u8]) -> Result<Rgl, BrdfError> {
    Directory::read(bytes, bytes.len() as u64)
        .and_then(|directory| Rgl::from_arrays(&directory, bytes))
        .map_err(malformed(path))
}

fn malformed(path: &Path) -> impl Fn(String) -> BrdfError {
    move |reason| BrdfError::Malformed { path: path.to_owned(), format: "BRDF of RGL", reason }
}

/// The lengths of the axes, which agree.
struct Shape {
    phi: usize,
    theta: usize,
    /// Rows and columns of the warp.
    warp: [usize; 2],
    colour: [usize; 2],
    facets: [usize; 2],
    area: [usize; 2],
}

impl Shape {
    fn of(directory: &Directory) -> Result<Self, String> {
        let [phi] = directory.shape("phi_i")?;
        if phi > ISOTROPIC {
            return Err(format!(
                "it is anisotropic (`phi_i` has {phi} azimuths); vernis reads the isotropic ones, whose value does not \
                 change when the surface is turned"
            ));
        }
        if directory.has("spectra") || directory.has("wavelengths") {
            let count = directory
                .shape::<1>("wavelengths")
                .map_or_else(|_| String::new(), |[n]| format!(" at {n} wavelengths"));
            return Err(format!(
                "it holds spectra{count}; vernis needs RGB values: the database has a second file of each material with them, \
                 NAME_rgb.bsdf"
            ));
        }
        let [theta] = directory.shape("theta_i")?;
        if phi == 0 || theta < 2 {
            return Err(format!("it has {phi} `phi_i` and {theta} `theta_i`; it must have 1 or 2 and at least 2"));
        }
        let [vndf_phi, vndf_theta, warp @ ..]: [usize; 4] = directory.shape("vndf")?;
        let [rgb_phi, rgb_theta, channels, colour @ ..]: [usize; 5] = directory.shape("rgb")?;
        for (name, found) in [("vndf", [vndf_phi, vndf_theta]), ("rgb", [rgb_phi, rgb_theta])] {
            if found != [phi, theta] {
                let [a, b] = found;
                return Err(format!("`{name}` is for {a} phi_i and {b} theta_i; there are {phi} and {theta}"));
            }
        }
        if channels != 3 {
            return Err(format!("`rgb` has {channels} channels; it must have 3"));
        }
        let (facets, area): ([usize; 2], [usize; 2]) = (directory.shape("ndf")?, directory.shape("sigma")?);
        for (name, [rows, columns]) in [("vndf", warp), ("rgb", colour), ("ndf", facets), ("sigma", area)] {
            if rows < 2 || columns < 2 {
                return Err(format!("`{name}` has {rows} x {columns} nodes; it must have at least 2 x 2"));
            }
        }
        Ok(Self { phi, theta, warp, colour, facets, area })
    }
}

impl Rgl {
    fn from_arrays(directory: &Directory, bytes: &[u8]) -> Result<Self, String> {
        let Shape { phi, theta: directions, warp, colour, facets, area } = Shape::of(directory)?;
        let floats = |name: &str, allowed| directory.floats(bytes, name, allowed);
        let axis = |name: &str, low: f64, high: f64| -> Result<Vec<f64>, String> {
            let angles = floats(name, Allowed::Any)?;
            // Numbers of f32: the last digit of a right angle may be beyond it.
            let inside = angles.iter().all(|angle| (low - 1e-5..=high + 1e-5).contains(angle));
            if inside && angles.windows(2).all(|pair| pair[0] < pair[1]) {
                return Ok(angles);
            }
            Err(format!("`{name}` must increase from {low:.4} or more to {high:.4} or less; it does not"))
        };
        let theta = axis("theta_i", 0.0, FRAC_PI_2)?;
        let azimuths = axis("phi_i", -2.0 * PI, 2.0 * PI)?;
        // Of two azimuths of an isotropic surface, what is between them at 0.
        let weight = if phi == 2 { (-azimuths[0] / (azimuths[1] - azimuths[0])).clamp(0.0, 1.0) } else { 0.0 };
        let grid = |[rows, columns]: [usize; 2], values: &[f64]| Bilinear::new(columns, rows, values.to_vec());
        let slices = |all: &[f64], nodes: [usize; 2]| -> Vec<Bilinear> {
            all.chunks(nodes[0] * nodes[1]).map(|values| grid(nodes, values)).collect()
        };
        let densities = slices(&floats("vndf", Allowed::NotNegative)?, warp)
            .into_iter()
            .enumerate()
            .map(|(k, slice)| {
                Density::new(slice).ok_or_else(|| format!("slice {k} of `vndf` has no finite, positive sum"))
            })
            .collect::<Result<Vec<_>, _>>()?;
        let colours = slices(&floats("rgb", Allowed::Any)?, colour);
        let last = (phi - 1) * directions;
        let visible = (0..directions).map(|k| densities[k].mean(weight, &densities[last + k])).collect();
        let colour_of = |k: usize| [0, 1, 2].map(|c| colours[3 * k + c].mean(weight, &colours[3 * (last + k) + c]));
        Ok(Self {
            description: match directory.has("description") {
                true => String::from_utf8_lossy(directory.bytes(bytes, "description")?).trim().to_owned(),
                false => String::new(),
            },
            theta,
            facets: grid(facets, &floats("ndf", Allowed::NotNegative)?),
            area: grid(area, &floats("sigma", Allowed::NotNegative)?),
            visible,
            colour: (0..directions).map(colour_of).collect(),
            scaled: match directory.bytes(bytes, "jacobian")? {
                [flag] => *flag != 0,
                other => return Err(format!("`jacobian` has {} numbers; it must have 1", other.len())),
            },
        })
    }
}

/// Polar angle and azimuth; the pole has the azimuth 0.
fn polar(w: Vec3) -> (f64, f64) {
    let sin = (w.x * w.x + w.y * w.y).sqrt();
    (sin.atan2(w.z), if sin > 0.0 { w.y.atan2(w.x) } else { 0.0 })
}

/// Where a direction lies in the unit square.
fn unit(theta: f64, phi: f64) -> [f64; 2] {
    [(theta / FRAC_PI_2).sqrt(), (phi + PI) / (2.0 * PI)]
}

impl Brdf for Rgl {
    fn eval(&self, light: Vec3, viewer: Vec3) -> Option<Rgb> {
        if light.z <= 0.0 || viewer.z <= 0.0 {
            return Some([0.0; 3]);
        }
        let (theta_v, phi_v) = polar(viewer);
        let (theta_m, phi_m) = polar(light + viewer);
        let [u, w] = unit(theta_m, phi_m - phi_v);
        let w = w.rem_euclid(1.0);
        let k = self.theta.partition_point(|theta| *theta < theta_v).clamp(1, self.theta.len() - 1) - 1;
        let (low, high) = (self.theta[k], self.theta[k + 1]);
        let weight = ((theta_v - low) / (high - low)).clamp(0.0, 1.0);
        let [x, y] = flattened(weight, &self.visible[k], &self.visible[k + 1], u, w)?;
        let mut factor = 1.0 / light.z;
        if self.scaled {
            // An isotropic surface looks the same from every azimuth.
            let [u_v, w_v] = unit(theta_v, 0.0);
            let area = self.area.at(u_v, w_v);
            if area <= 0.0 {
                return None;
            }
            factor *= self.facets.at(u, w) / (4.0 * area);
        }
        let (near, far) = (&self.colour[k], &self.colour[k + 1]);
        Some([0, 1, 2].map(|c| factor * ((1.0 - weight) * near[c].at(x, y) + weight * far[c].at(x, y))))
    }

    fn is_signed(&self) -> bool {
        true
    }

    fn description(&self) -> Option<String> {
        Some(format!("measurement of the RGL database, {} elevations: {}", self.theta.len(), self.description))
    }
}
