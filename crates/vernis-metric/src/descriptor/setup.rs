//! Under which lights and on which shape BRDFs are looked at: fixed once, part of every descriptor's identity.

use super::DescriptorError;
use super::frame::Frame;
use super::setup_id::{DIGITS, SetupId};
use crate::io::read_at_most;
use crate::light::operator::Operator;
use crate::light::shape::{self, Shape};
use crate::light::source::{self, Light};
use crate::light::{LightError, Sampling};
use crate::math::Vec3;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// Version of the descriptors. It changes whenever a number changes, so that caches and exported metrics never mix.
pub const VERSION: u32 = 2;

/// Layouts of the lamps, averaged.
const LAMPS: [usize; 3] = [1, 101, 201];
/// Turns of a probe about the vertical, degrees, averaged.
const PROBE_TURNS: [f64; 5] = [0.0, 45.0, 90.0, 180.0, 225.0];
/// Angles to the normal from which the albedo is taken, degrees.
const ALBEDO_ANGLES: [f64; 2] = [0.0, 60.0];

/// The lights that carry detail.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Lights {
    /// Three layouts of lamps, defined by code.
    #[default]
    Lamps,
    /// A latitude/longitude Radiance picture (`.hdr`), in five turns.
    Probe(PathBuf),
}

/// The shape whose normals weight the pictures.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum ShapeChoice {
    /// The unit sphere, defined by code.
    #[default]
    Sphere,
    /// An ASCII PLY mesh.
    Mesh(PathBuf),
}

/// What the descriptors depend on besides the two BRDFs.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct DescriptorOptions {
    /// The lights that carry detail.
    pub lights: Lights,
    /// The shape in the pictures.
    pub shape: ShapeChoice,
}

/// Lights, shape and the operators built from them.
#[derive(Debug)]
pub struct Setup {
    id: String,
    version: u32,
    shape: Shape,
    frame: Frame,
    /// In place of the lamps.
    probe: Option<Light>,
    operators: OnceLock<Operators>,
}

#[derive(Debug)]
pub(super) struct Operators {
    pub pictures: Operator,
    pub albedo: Operator,
}

fn file_id(path: &Path, most: u64, error: impl Fn(String) -> LightError) -> Result<String, LightError> {
    let bytes = read_at_most(path, most).map_err(|e| error(e.to_string()))?;
    let hash = crate::brdf::ContentHash::of(&bytes).to_string();
    Ok(hash[..DIGITS].to_owned())
}

impl Setup {
    /// The setup of the newest version that is defined by code alone, shared by the process.
    pub fn standard() -> Arc<Self> {
        Self::by_code(VERSION)
    }

    /// The setup of `version` that is defined by code alone, shared by the process.
    fn by_code(version: u32) -> Arc<Self> {
        static FIRST: OnceLock<Arc<Setup>> = OnceLock::new();
        static NEWEST: OnceLock<Arc<Setup>> = OnceLock::new();
        let make = || Arc::new(Self::assemble(&SetupId { version, probe: None, mesh: None }, None, Shape::sphere()));
        (if version == 1 { &FIRST } else { &NEWEST }).get_or_init(make).clone()
    }

    /// A setup of the newest version with options. Errors: a probe or mesh that cannot be read.
    pub fn new(options: &DescriptorOptions) -> Result<Arc<Self>, DescriptorError> {
        Self::of_version(VERSION, options)
    }

    /// A setup of one of the versions that this program computes.
    pub(super) fn of_version(version: u32, options: &DescriptorOptions) -> Result<Arc<Self>, DescriptorError> {
        if *options == DescriptorOptions::default() {
            return Ok(Self::by_code(version));
        }
        let (probe_hash, probe) = match &options.lights {
            Lights::Lamps => (None, None),
            Lights::Probe(path) => {
                let id = file_id(path, source::MOST_BYTES, |reason| LightError::Probe { path: path.clone(), reason })?;
                (Some(id), Some(Light::probe(path)?))
            }
        };
        let (mesh, shape) = match &options.shape {
            ShapeChoice::Sphere => (None, Shape::sphere()),
            ShapeChoice::Mesh(path) => {
                let id = file_id(path, shape::MOST_BYTES, |reason| LightError::Mesh { path: path.clone(), reason })?;
                (Some(id), Shape::mesh(path)?)
            }
        };
        let id = SetupId { version, probe: probe_hash, mesh };
        Ok(Arc::new(Self::assemble(&id, probe, shape)))
    }

    fn assemble(id: &SetupId, probe: Option<Light>, shape: Shape) -> Self {
        let frame = Frame::new(&shape);
        Self { id: id.to_string(), version: id.version, frame, shape, probe, operators: OnceLock::new() }
    }

    /// Version and options, safe as part of a file name.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Version of the descriptors, see [`VERSION`].
    pub fn version(&self) -> u32 {
        self.version
    }

    /// What the nodes of a table hold.
    pub fn sampling(&self) -> Sampling {
        if self.version == 1 { Sampling::Points } else { Sampling::Averages }
    }

    /// Number of lights; the slot is the last.
    pub fn lights(&self) -> usize {
        1 + if self.probe.is_some() { PROBE_TURNS.len() } else { LAMPS.len() }
    }

    /// Pixels of a picture.
    pub fn pixels(&self) -> usize {
        self.shape.len()
    }

    pub(super) fn frame(&self) -> &Frame {
        &self.frame
    }

    /// Only building the operators needs the lights themselves.
    fn build_lights(&self) -> Vec<Light> {
        let mut lights: Vec<Light> = match &self.probe {
            Some(probe) => PROBE_TURNS.iter().map(|&turn| probe.rotated(turn)).collect(),
            None => LAMPS.map(Light::lamps).to_vec(),
        };
        lights.push(Light::slot());
        lights
    }

    pub(super) fn has_operators(&self) -> bool {
        self.operators.get().is_some()
    }

    /// Takes operators from a cache; without effect where there are some already.
    pub(super) fn set_operators(&self, operators: Operators) {
        let _ = self.operators.set(operators);
    }

    pub(super) fn operators(&self) -> &Operators {
        self.operators_or_build().0
    }

    /// The operators, and whether this call built them.
    pub(super) fn operators_or_build(&self) -> (&Operators, bool) {
        let mut built = false;
        let operators = self.operators.get_or_init(|| {
            built = true;
            let pixels: Vec<Vec<Vec3>> = (0..self.shape.len()).map(|p| self.shape.normals(p).to_vec()).collect();
            let tilted: Vec<Vec<Vec3>> =
                ALBEDO_ANGLES.iter().map(|a| vec![Vec3::from_spherical(a.to_radians(), 0.0)]).collect();
            Operators {
                pictures: Operator::build(&pixels, &self.build_lights(), self.sampling()),
                albedo: Operator::build(&tilted, &[Light::constant(1.0)], self.sampling()),
            }
        });
        (operators, built)
    }
}
