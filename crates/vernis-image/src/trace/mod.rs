//! The path tracer: a scene becomes a picture.
//!
//! Unbiased, with a box filter over pixels. Row 0 is the top; pixel (column, row) covers [column, column + 1) / width of the picture.
//! Every number of a path depends on seed, pixel and sample alone: the same bytes on any number of threads.
//! Cost: `experiments/peers/render.py` measures it beside Mitsuba.

mod brdf_table;
mod geometry;
mod integrator;
mod light;
mod lobe;
mod reflectance;
mod sampler;
mod tree;

pub use reflectance::Tabulation;

use crate::picture::Picture;
use crate::scene::{Camera, Film, Reflectance, Scene, Shape};
use geometry::Geometry;
use glam::Vec3A;
use integrator::{Stage, World};
use light::Lighting;
use reflectance::Surface;
use sampler::{Sampler, unit};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use thiserror::Error;
use vernis_metric::brdf::{Brdf, ContentHash};
use vernis_metric::io::{Count, Observer};
use vernis_metric::math::Rgb;
use vernis_metric::math::parallel;

/// Raise it when a picture of the same scene changes by more than rounding. 2: a tenth of the directions are uniform.
pub const VERSION: u32 = 2;

/// Why a scene cannot be traced.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum TraceError {
    #[error("the camera is at {from:?}, inside the shape; it must be outside")]
    CameraInside { from: [f64; 3] },
    #[error("the BRDF is {value:?} for some directions; it must be finite")]
    NotFinite { value: Rgb },
    #[error("the BRDF has no measurement for any direction; it must have at least one")]
    NoMeasurement,
    #[error("pixel {column}, {row} is {value:?}: the BRDF has values that are not finite")]
    Pixel { column: usize, row: usize, value: [f32; 3] },
    #[error("a film of {width}x{height} pixels cannot be made; each side must have at least 1 pixel")]
    Film { width: usize, height: usize },
}

/// A scene that is ready to be traced.
pub struct Tracer {
    world: World,
    /// Its shape and light are not copied: they are behind [`Arc`].
    scene: Scene,
    from: Vec3A,
    /// To the middle of the picture, and to the right and upper edges.
    axes: [Vec3A; 3],
    tabulation: Option<Tabulation>,
    rays: AtomicU64,
}

impl Tracer {
    /// Builds what is needed to trace: the tree of the mesh, the tables of BRDFs and of the light.
    ///
    /// # Errors
    /// A camera inside the shape, a BRDF that has a value that is not finite or none at all.
    pub fn new(scene: &Scene) -> Result<Self, TraceError> {
        let table = scene.table.as_ref().map(|table| Surface::new(&table.reflectance)).transpose()?;
        let stage = Stage {
            geometry: Geometry::new(scene),
            table: table.map(|(surface, _)| surface),
            light: Lighting::new(&scene.light, scene.light_scale),
        };
        Self::on(Arc::new(stage), scene, Surface::new(&scene.reflectance)?)
    }

    /// The same scene with another BRDF, seen from elsewhere: the trees and tables of the rest are shared.
    ///
    /// # Errors
    /// Those of [`Tracer::new`].
    pub fn seen_anew(&self, reflectance: Reflectance, camera: Camera) -> Result<Self, TraceError> {
        let surface = Surface::new(&reflectance)?;
        Self::on(self.world.stage.clone(), &Scene { reflectance, camera, ..self.scene.clone() }, surface)
    }

    /// The same for a BRDF that is borrowed. Models of `vernis-metric` are traced as they are; all others are tabulated
    /// ([`Tracer::tabulation`]).
    ///
    /// # Errors
    /// Those of [`Tracer::new`].
    pub fn of_brdf(&self, brdf: &dyn Brdf, camera: Camera) -> Result<Self, TraceError> {
        Self::on(self.world.stage.clone(), &Scene { camera, ..self.scene.clone() }, Surface::of(brdf)?)
    }

    /// The same BRDF seen from elsewhere.
    ///
    /// # Errors
    /// A camera inside the shape.
    pub fn seen_by(self, camera: Camera) -> Result<Self, TraceError> {
        let Self { world, scene, tabulation, .. } = self;
        Self::on(world.stage, &Scene { camera, ..scene }, (world.shape, tabulation))
    }

    fn on(
        stage: Arc<Stage>,
        scene: &Scene,
        (shape, tabulation): (Surface, Option<Tabulation>),
    ) -> Result<Self, TraceError> {
        let from = scene.camera.from;
        let inside = match &scene.shape {
            Shape::Sphere { center, radius } => {
                (0..3).map(|k| (from[k] - center[k]).powi(2)).sum::<f64>() <= radius * radius
            }
            Shape::Mesh(mesh) => mesh.contains(from),
        };
        if inside {
            return Err(TraceError::CameraInside { from });
        }
        let film = scene.film;
        let vector = |p: [f64; 3]| Vec3A::new(p[0] as f32, p[1] as f32, p[2] as f32);
        let axes = scene.camera.axes();
        let half = (0.5 * scene.camera.fov_deg.to_radians()).tan() as f32;
        let aspect = film.width as f32 / film.height.max(1) as f32;
        let pixel = 2.0 * half / film.height.max(1) as f32;
        Ok(Self {
            world: World { stage, shape, bounces: film.bounces, background: scene.background, pixel },
            from: vector(from),
            axes: [vector(axes.forward), half * aspect * vector(axes.right), half * vector(axes.up)],
            tabulation,
            rays: AtomicU64::new(0),
            scene: scene.clone(),
        })
    }

    /// From where it is seen.
    pub fn camera(&self) -> Camera {
        self.scene.camera
    }

    /// SHA-256 of all that a picture depends on of the BRDF of the shape: of a model its parameters, of a table its values.
    pub fn surface_content(&self) -> ContentHash {
        self.world.shape.content()
    }

    /// How well the BRDF of the shape was tabulated, if it was.
    pub fn tabulation(&self) -> Option<Tabulation> {
        self.tabulation
    }

    /// How many rays were followed so far.
    pub fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    /// The picture: linear RGB radiance. `observer` is told of rows that are done.
    ///
    /// # Errors
    /// A pixel that is not finite.
    pub fn render(&self, observer: Observer) -> Result<Picture, TraceError> {
        let Film { width, height, .. } = self.scene.film;
        let mut pixels = vec![[0.0f32; 3]; width.saturating_mul(height)];
        let done = Count::of(height);
        parallel::for_each_chunk(&mut pixels, width.max(1), |row, pixels| {
            let mut rays = 0;
            for (column, pixel) in pixels.iter_mut().enumerate() {
                *pixel = self.pixel(column, row, &mut rays);
            }
            self.rays.fetch_add(rays, Ordering::Relaxed);
            done.one(|progress| observer("rendering", progress));
        });
        if let Some(k) = pixels.iter().position(|p| !p.iter().all(|v| v.is_finite())) {
            return Err(TraceError::Pixel { column: k % width, row: k / width, value: pixels[k] });
        }
        Picture::new(width, height, pixels).ok_or(TraceError::Film { width, height })
    }

    fn pixel(&self, column: usize, row: usize, rays: &mut u64) -> [f32; 3] {
        let Film { width, height, samples, seed, .. } = self.scene.film;
        let numbers = Sampler::pixel(seed, (row * width + column) as u64);
        let [forward, right, up] = self.axes;
        let mut sum = [0.0f64; 3];
        for sample in 0..samples {
            let mut sampler = Sampler::new(numbers, sample as u32);
            let [a, b] = sampler.pair(0);
            let x = 2.0 * (column as f32 + unit(a)) / width as f32 - 1.0;
            let y = 1.0 - 2.0 * (row as f32 + unit(b)) / height as f32;
            let direction = (forward + x * right + y * up).normalize();
            let found = self.world.radiance(self.from, direction, &mut sampler).to_array();
            (0..3).for_each(|c| sum[c] += f64::from(found[c]));
            *rays += u64::from(sampler.rays);
        }
        sum.map(|s| (s / samples.max(1) as f64) as f32)
    }
}
