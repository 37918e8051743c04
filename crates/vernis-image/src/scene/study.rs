//! The scene of the study of Lavoué et al. 2021 (section 3.4): the Buddha on a wooden table under a captured light, 580 x 900, seen from
//! slightly different places as reference and as test; and one like it that is made by code.
//!
//! The paper states shape, lights and size. Ours are what it does not state: the table is [`Wood`] of 6 x 6, the shape is 2 high,
//! the
//! camera is at a distance of 7.4, 14 degrees above the middle of the shape, and the reference's is turned by 4 degrees about the
//! vertical. Normals of the mesh are smooth.

use super::{Camera, Film, Light, Mesh, Normals, Panorama, Reflectance, Scene, SceneError, Shape, Table, Wood, blob};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Where the shape is in the data folder.
pub const MESH: &str = "meshes/happy_vrip_res3.ply";
/// Where the light of most stimuli is in the data folder.
pub const PROBE: &str = "envmaps/grace_probe_latlong.hdr";
/// The study's second light in the data folder.
pub const SECOND_PROBE: &str = "envmaps/uffizi_spica.hdr";
/// Columns and rows of a stimulus.
pub const SIZE: [usize; 2] = [580, 900];
/// How far the reference's camera is turned, degrees.
pub const TURN: f64 = 4.0;
/// Lamps are brighter than the probes: this brings them to about the mean luminance of Grace.
pub const LAMPS_SCALE: f64 = 0.3;
/// Half the side of the table.
const HALF_SIDE: f64 = 3.0;

/// Whose camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// Of references.
    Reference,
    /// Of candidates.
    Test,
}

impl View {
    /// The camera.
    pub fn camera(self) -> Camera {
        let (sin, cos) = 14f64.to_radians().sin_cos();
        let test = Camera { from: [0.0, 0.98 + 7.4 * sin, 7.4 * cos], to: [0.0, 0.98, 0.0], fov_deg: 20.0 };
        match self {
            Self::Test => test,
            Self::Reference => test.turned(TURN),
        }
    }
}

/// A light by name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LightChoice {
    /// Radiance 1 from everywhere.
    White,
    /// Lamps made by code.
    Lamps,
    /// A light probe.
    Probe(PathBuf),
}

/// A shape by name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ShapeChoice {
    /// A sphere of radius 0.75 on the table.
    Sphere,
    /// The folded shape by formula.
    Blob,
    /// A mesh, put on the table ([`Mesh::on_the_table`]); with the normals of its file, or smooth.
    Mesh(PathBuf),
}

impl LightChoice {
    /// Grace, where the data folder has it, else lamps.
    pub fn default_of(data: Option<&Path>) -> Self {
        let probe = data.map(|data| data.join(PROBE)).filter(|path| path.is_file());
        probe.map_or(Self::Lamps, Self::Probe)
    }

    /// The light and its scale.
    ///
    /// # Errors
    /// A probe that cannot be used.
    pub fn light(&self) -> Result<(Light, f64), SceneError> {
        Ok(match self {
            Self::White => (Light::White, 1.0),
            Self::Lamps => (Light::Panorama(Arc::new(Panorama::lamps())), LAMPS_SCALE),
            Self::Probe(path) => (Light::Panorama(Arc::new(Panorama::read(path)?)), 1.0),
        })
    }
}

impl ShapeChoice {
    /// The Buddha, where the data folder has it, else the blob.
    pub fn default_of(data: Option<&Path>) -> Self {
        let mesh = data.map(|data| data.join(MESH)).filter(|path| path.is_file());
        mesh.map_or(Self::Blob, Self::Mesh)
    }

    /// The shape, on the table.
    ///
    /// # Errors
    /// A mesh that cannot be used.
    pub fn shape(&self) -> Result<Shape, SceneError> {
        Ok(match self {
            Self::Sphere => Shape::Sphere { center: [0.0, 0.75, 0.0], radius: 0.75 },
            Self::Blob => Shape::Mesh(Arc::new(blob())),
            Self::Mesh(path) => Shape::Mesh(Arc::new(Mesh::read(path, Normals::Smooth)?.on_the_table())),
        })
    }
}

/// The study's scene with this shape of this BRDF under this light.
pub fn scene(
    reflectance: Reflectance,
    shape: Shape,
    (light, light_scale): (Light, f64),
    view: View,
    film: Film,
) -> Scene {
    Scene {
        shape,
        reflectance,
        table: Some(Table { half_side: HALF_SIDE, reflectance: Reflectance::Wood(Wood) }),
        camera: view.camera(),
        light,
        light_scale,
        background: false,
        film,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_data_everything_is_made_by_code() {
        let folder = tempfile::tempdir().unwrap();
        for data in [None, Some(folder.path())] {
            assert_eq!(LightChoice::default_of(data), LightChoice::Lamps);
            assert_eq!(ShapeChoice::default_of(data), ShapeChoice::Blob);
        }
        let (light, scale) = LightChoice::Lamps.light().unwrap();
        assert!(matches!(light, Light::Panorama(_)) && scale == LAMPS_SCALE);
        assert!(matches!(ShapeChoice::Blob.shape().unwrap(), Shape::Mesh(_)));
        assert_ne!(View::Reference.camera().from, View::Test.camera().from);
        assert_eq!(View::Reference.camera().to, View::Test.camera().to);
    }
}
