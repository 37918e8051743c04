//! What must hold whatever the numbers: closed forms, conservation of energy, variance, and bytes that no thread can change.

use std::sync::Arc;
use vernis_image::picture::Picture;
use vernis_image::scene::{Camera, Film, Light, Mesh, Panorama, Reflectance, Scene, Shape, Table, blob};
use vernis_image::trace::{TraceError, Tracer};
use vernis_metric::brdf::models::build;
use vernis_metric::brdf::{Brdf, ContentHash};
use vernis_metric::io::silent;
use vernis_metric::math::{Rgb, Vec3};

fn model(name: &str, parameters: &[f64]) -> Reflectance {
    Reflectance::Brdf(build(name, parameters).expect("valid"), ContentHash([0; 32]))
}

fn sphere(reflectance: Reflectance, light: Light) -> Scene {
    Scene {
        shape: Shape::Sphere { center: [0.0; 3], radius: 1.0 },
        reflectance,
        table: None,
        camera: Camera { from: [0.0, 0.0, 5.0], to: [0.0; 3], fov_deg: 30.0 },
        light,
        light_scale: 1.0,
        background: false,
        film: Film { width: 32, height: 32, samples: 16, bounces: 1, seed: 1 },
    }
}

fn on_a_table(reflectance: Reflectance, light: Light) -> Scene {
    Scene {
        shape: Shape::Mesh(Arc::new(blob())),
        table: Some(Table { half_side: 3.0, reflectance: model("lambert", &[0.42, 0.24, 0.11]) }),
        camera: Camera { from: [0.0, 2.0, 6.0], to: [0.0, 1.0, 0.0], fov_deg: 24.0 },
        film: Film { width: 24, height: 36, samples: 16, bounces: 8, seed: 1 },
        ..sphere(reflectance, light)
    }
}

fn lamps() -> Light {
    Light::Panorama(Arc::new(Panorama::lamps()))
}

fn render(scene: &Scene) -> Picture {
    Tracer::new(scene).expect("traceable").render(&silent).expect("finite")
}

fn with(scene: &Scene, change: impl Fn(&mut Film)) -> Scene {
    let mut scene = scene.clone();
    change(&mut scene.film);
    scene
}

fn mean(picture: &Picture) -> Rgb {
    let n = picture.pixels().len() as f64;
    [0, 1, 2].map(|c| picture.pixels().iter().map(|p| f64::from(p[c])).sum::<f64>() / n)
}

/// Pixels that the sphere covers wholly: within 0.9 of its apparent radius.
fn inside(picture: &Picture) -> Vec<[f32; 3]> {
    let (w, h) = (picture.width(), picture.height());
    let angle = (1.0f64 / 5.0).asin().tan() / 15f64.to_radians().tan();
    let within = |k: &usize| {
        let [x, y] = [k % w, k / w].map(|i| (2.0 * (i as f64 + 0.5)) / w as f64 - 1.0);
        x.hypot(y) < 0.9 * angle
    };
    (0..w * h).filter(within).map(|k| picture.pixels()[k]).collect()
}

/// The light is the same from everywhere, and so is what a Lambert sphere sends back: its albedo. The density of the choice is the
/// value itself, so that no sample differs.
#[test]
fn a_lambert_sphere_under_white_light_has_its_albedo() {
    let picture = render(&sphere(model("lambert", &[0.2, 0.5, 0.8]), Light::White));
    let inside = inside(&picture);
    assert!(inside.len() > 200);
    for pixel in inside {
        for (found, albedo) in pixel.iter().zip([0.2, 0.5, 0.8]) {
            assert!((found - albedo).abs() < 1e-5, "{found} {albedo}");
        }
    }
    assert_eq!(picture.pixels()[0], [0.0; 3]);
}

/// The same by texels, where it is a mean over samples.
#[test]
fn white_texels_are_white_light() {
    let white = Light::Panorama(Arc::new(Panorama::new(8, 4, vec![[1.0; 3]; 32]).expect("a light")));
    let scene = with(&sphere(model("lambert", &[0.2, 0.5, 0.8]), white), |film| film.samples = 256);
    let pixels = inside(&render(&scene));
    for (c, albedo) in [0.2, 0.5, 0.8].into_iter().enumerate() {
        let found = pixels.iter().map(|p| f64::from(p[c])).sum::<f64>() / pixels.len() as f64;
        assert!((found / albedo - 1.0).abs() < 0.005, "{found} {albedo}");
    }
}

/// A lossless surface in a white surrounding cannot be told from it, whatever its folds: every bounce gives back all.
#[test]
fn a_lossless_shape_cannot_be_seen_in_a_furnace() {
    let mut scene = on_a_table(model("lambert", &[1.0; 3]), Light::White);
    scene.table = Some(Table { half_side: 3.0, reflectance: model("lambert", &[1.0; 3]) });
    // Facets: normals that differ from the surface's lose what they send into it.
    scene.shape = Shape::Mesh(Arc::new(blob().flat()));
    scene.background = true;
    scene.film = Film { width: 16, height: 24, samples: 32, bounces: 400, seed: 3 };
    let picture = render(&scene);
    for value in picture.pixels().iter().flatten() {
        assert!((value - 1.0).abs() < 2e-3, "{value}");
    }
}

/// Each added bounce adds light, never more than the largest albedo of what the one before added.
#[test]
fn a_bounce_adds_at_most_the_albedo_of_the_one_before() {
    let scene = on_a_table(model("lambert", &[0.6; 3]), Light::White);
    let energy: Vec<f64> =
        (1..=5).map(|n| mean(&render(&with(&scene, |f| (f.bounces, f.samples) = (n, 64))))[1]).collect();
    let added: Vec<f64> = energy.windows(2).map(|e| e[1] - e[0]).collect();
    assert!(added[0] > 0.01, "{energy:?}");
    for pair in added.windows(2) {
        assert!(pair[1] > 0.0 && pair[1] < 0.6 * pair[0], "{energy:?}");
    }
}

/// Variance of the mean of the picture and of single pixels over independent seeds.
fn variance(scene: &Scene, seeds: u64) -> f64 {
    let pictures: Vec<Picture> = (0..seeds).map(|seed| render(&with(scene, |film| film.seed = seed))).collect();
    let n = pictures.len() as f64;
    let pixels = pictures[0].pixels().len();
    let of_pixel = |k: usize| {
        let values: Vec<f64> = pictures.iter().map(|p| f64::from(p.pixels()[k][1])).collect();
        let mean = values.iter().sum::<f64>() / n;
        values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)
    };
    (0..pixels).map(of_pixel).sum::<f64>() / pixels as f64
}

/// At least as fast as 1 / N; stratified samples do better.
#[test]
fn the_variance_falls_with_the_number_of_samples() {
    let scene = on_a_table(model("ggx", &[0.1, 0.15, 0.2, 0.5, 0.4, 0.2, 0.3]), lamps());
    let [few, many] = [4, 64].map(|samples| variance(&with(&scene, |film| film.samples = samples), 12));
    let gain = few / many;
    assert!(gain > 0.7 * 16.0, "{few} {many}: {gain}");
}

/// Pictures of different seeds have the same mean: their difference is noise, whose size the seeds tell.
#[test]
fn two_halves_of_the_samples_agree() {
    let scene = on_a_table(model("ggx", &[0.1, 0.15, 0.2, 0.5, 0.4, 0.2, 0.3]), lamps());
    let means: Vec<f64> = (0..32).map(|seed| mean(&render(&with(&scene, |film| film.seed = seed)))[1]).collect();
    let of = |half: &[f64]| {
        let mean = half.iter().sum::<f64>() / half.len() as f64;
        let variance = half.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (half.len() - 1) as f64;
        (mean, variance / half.len() as f64)
    };
    let ((a, va), (b, vb)) = (of(&means[..16]), of(&means[16..]));
    assert!((a - b).abs() < 4.0 * (va + vb).sqrt(), "{a} {b} {}", (va + vb).sqrt());
    assert!((va + vb).sqrt() < 0.01 * a);
}

/// How a direction is chosen changes the noise and not the mean: with texels, by the BRDF alone and by both.
#[test]
fn a_shiny_surface_has_the_energy_that_quadrature_finds() {
    let alpha = 0.2;
    let parameters = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, alpha];
    let brdf = build("ggx", &parameters).expect("valid");
    // What the middle of the sphere sends back under white light: the albedo for light from the normal, by quadrature.
    let (steps, mut albedo) = (2000, 0.0);
    for k in 0..steps {
        let theta = (k as f64 + 0.5) / steps as f64 * std::f64::consts::FRAC_PI_2;
        let wi = Vec3::from_spherical(theta, 0.0);
        let value = brdf.eval(wi, Vec3::new(0.0, 0.0, 1.0)).expect("a formula")[0];
        albedo +=
            value * theta.cos() * theta.sin() * std::f64::consts::TAU * std::f64::consts::FRAC_PI_2 / steps as f64;
    }
    let mut scene = sphere(model("ggx", &parameters), Light::White);
    scene.camera.fov_deg = 0.5;
    scene.film.samples = 64;
    let by_brdf = mean(&render(&scene))[0];
    scene.light = Light::Panorama(Arc::new(Panorama::new(16, 8, vec![[1.0; 3]; 128]).expect("a light")));
    scene.film.samples = 256;
    let by_both = mean(&render(&scene))[0];
    for found in [by_brdf, by_both] {
        assert!((found / albedo - 1.0).abs() < 0.01, "{found} {albedo}");
    }
}

#[test]
fn threads_do_not_change_a_byte() {
    let scene = on_a_table(model("ggx", &[0.1, 0.15, 0.2, 0.5, 0.4, 0.2, 0.3]), lamps());
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| render(&scene)).to_exr().expect("encoded")
    };
    let one = on(1);
    assert_eq!(one, on(2));
    assert_eq!(one, on(5));
    assert_ne!(one, render(&with(&scene, |film| film.seed = 2)).to_exr().expect("encoded"));
}

/// A measurement with holes.
struct Holes;

impl Brdf for Holes {
    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return Some([0.0; 3]);
        }
        // Nothing was measured where either direction is grazing.
        (wi.z.min(wo.z) > 0.35).then_some([0.25 / std::f64::consts::PI; 3])
    }
}

#[test]
fn what_was_not_measured_is_not_black() {
    let reflectance = Reflectance::Brdf(Arc::new(Holes), ContentHash([0; 32]));
    let picture = render(&sphere(reflectance, Light::White));
    for pixel in inside(&picture) {
        assert!((pixel[0] - 0.25).abs() < 1e-3, "{pixel:?}");
    }
}

/// A BRDF that is nowhere measured, or not a number.
struct Constant(Option<Rgb>);

impl Brdf for Constant {
    fn eval(&self, _wi: Vec3, _wo: Vec3) -> Option<Rgb> {
        self.0
    }
}

#[test]
fn what_cannot_be_traced_is_refused() {
    let refused = |scene: &Scene| Tracer::new(scene).err().map(|e| e.to_string()).unwrap_or_default();
    let of = |value| sphere(Reflectance::Brdf(Arc::new(Constant(value)), ContentHash([0; 32])), Light::White);
    assert!(refused(&of(None)).contains("no measurement"));
    assert!(refused(&of(Some([0.1, f64::NAN, 0.1]))).contains("must be finite"));
    assert!(refused(&of(Some([0.1, f64::INFINITY, 0.1]))).contains("must be finite"));
    let mut scene = sphere(model("lambert", &[0.5; 3]), Light::White);
    scene.camera.from = [0.0, 0.0, 0.5];
    assert!(refused(&scene).contains("inside the shape; it must be outside"));
    let mut scene = on_a_table(model("lambert", &[0.5; 3]), Light::White);
    scene.camera.from = [0.0, 1.0, 0.0];
    assert!(matches!(Tracer::new(&scene), Err(TraceError::CameraInside { .. })));
}

/// Two sheets, one in front: both sides of each reflect, a light behind a sheet does not shine through, and a sheet without thickness
/// does not shadow itself.
#[test]
fn both_sides_of_a_sheet_reflect_and_none_lets_light_through() {
    let corners = vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    for faces in [vec![[0, 1, 2], [0, 2, 3]], vec![[0, 2, 1], [0, 3, 2]]] {
        let mesh = Mesh::new(corners.clone(), faces).expect("a mesh");
        for mesh in [mesh.clone(), mesh.smooth()] {
            // Light from +z alone, or from -z alone: columns 8 of 16 lie about +z.
            let lit = |columns: std::ops::Range<usize>| {
                let texels = (0..128).map(|k| if columns.contains(&(k % 16)) { [1.0; 3] } else { [0.0; 3] }).collect();
                let mut scene = sphere(
                    model("lambert", &[0.5; 3]),
                    Light::Panorama(Arc::new(Panorama::new(16, 8, texels).expect("a light"))),
                );
                scene.shape = Shape::Mesh(Arc::new(mesh.clone()));
                scene.camera.fov_deg = 10.0;
                scene.film = Film { width: 8, height: 8, samples: 256, bounces: 3, seed: 1 };
                mean(&render(&scene))[1]
            };
            let (front, behind) = (lit(4..12), lit(0..4));
            assert!((front - 0.5).abs() < 0.01 && behind == 0.0, "{front} {behind}");
        }
    }
}
