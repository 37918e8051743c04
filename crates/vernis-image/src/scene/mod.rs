//! What is rendered: a shape on a table, a light, a camera; read from a file, or the study's.
//!
//! Right-handed, y up; lengths are in the scene's own unit. The light is at infinity. Nothing in this room knows how a picture is made.

mod blob;
mod camera;
mod error;
pub mod file;
mod light;
mod mesh;
mod mesh_file;
pub mod study;
mod wood;

pub use blob::blob;
pub use camera::Camera;
pub use error::SceneError;
pub use light::{Light, Panorama};
pub use mesh::{Flaws, MOST_FACES, Mesh, Normals};
pub use wood::Wood;

use std::sync::Arc;
use vernis_metric::brdf::{Brdf, ContentHash};

/// Longest side of a film, pixels.
pub const MOST_PIXELS_A_SIDE: usize = 16_384;
/// Most pixels of a film: its sums take 12 bytes each.
pub const MOST_PIXELS: usize = 1 << 25;
/// Most samples a pixel.
pub const MOST_SAMPLES: usize = 1 << 24;
/// Most surface interactions on a path.
pub const MOST_BOUNCES: usize = 1000;

/// The shape in the middle.
#[derive(Debug, Clone)]
pub enum Shape {
    /// A sphere with its true normals.
    Sphere {
        /// Its centre.
        center: [f64; 3],
        /// Its radius, greater than 0.
        radius: f64,
    },
    /// A mesh of triangles.
    Mesh(Arc<Mesh>),
}

/// How a surface reflects. Both sides of every surface reflect alike: the normal is turned towards the viewer.
#[derive(Clone)]
pub enum Reflectance {
    /// Any BRDF, and the SHA-256 of what defines it.
    Brdf(Arc<dyn Brdf>, ContentHash),
    /// Wood by formula.
    Wood(Wood),
}

impl std::fmt::Debug for Reflectance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Brdf(_, content) => write!(f, "Brdf({content})"),
            Self::Wood(wood) => wood.fmt(f),
        }
    }
}

/// The square `-half_side..half_side` in x and z at y = 0.
#[derive(Debug, Clone)]
pub struct Table {
    /// Half the length of a side.
    pub half_side: f64,
    /// What it is made of.
    pub reflectance: Reflectance,
}

/// A picture of it in pixels, and how well it is sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Film {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Paths a pixel.
    pub samples: usize,
    /// Surface interactions on a path at most: 1 is direct light.
    pub bounces: usize,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Everything that a picture is made of.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The shape in the middle.
    pub shape: Shape,
    /// What the shape is made of.
    pub reflectance: Reflectance,
    /// What it stands on, if anything.
    pub table: Option<Table>,
    /// Where it is seen from.
    pub camera: Camera,
    /// What it is seen by.
    pub light: Light,
    /// Factor of the light's radiance.
    pub light_scale: f64,
    /// Whether the light itself is seen where nothing is in front of it.
    pub background: bool,
    /// The pixels.
    pub film: Film,
}

impl Scene {
    /// SHA-256 of everything that its picture depends on, but for how it is traced ([`crate::trace`] has a version).
    pub fn identity(&self) -> ContentHash {
        let mut bytes = Vec::new();
        let text = |bytes: &mut Vec<u8>, text: String| {
            bytes.extend(text.len().to_le_bytes());
            bytes.extend(text.bytes());
        };
        text(&mut bytes, format!("{:?} {:?} {:?}", self.reflectance, self.table, self.camera));
        text(&mut bytes, format!("{:?} {} {:?}", self.light_scale, self.background, self.film));
        match &self.light {
            Light::White => text(&mut bytes, "white".to_owned()),
            Light::Panorama(panorama) => {
                text(&mut bytes, format!("panorama {} {}", panorama.width(), panorama.height()));
                bytes.extend(panorama.texels().iter().flatten().flat_map(|v| v.to_le_bytes()));
            }
        }
        match &self.shape {
            Shape::Sphere { center, radius } => text(&mut bytes, format!("sphere {center:?} {radius:?}")),
            Shape::Mesh(mesh) => {
                text(&mut bytes, format!("mesh {} {} {}", mesh.positions.len(), mesh.faces.len(), mesh.normals.len()));
                bytes.extend(mesh.positions.iter().chain(&mesh.normals).flatten().flat_map(|v| v.to_le_bytes()));
                bytes.extend(mesh.faces.iter().chain(&mesh.normal_faces).flatten().flat_map(|v| v.to_le_bytes()));
            }
        }
        ContentHash::of(&bytes)
    }
}
