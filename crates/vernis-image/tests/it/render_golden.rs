//! Radiance of eight small scenes against Mitsuba 3.9.1 (variant llvm_ad_rgb, integrator path, emitter and BSDF sampling with MIS,
//! independent sampler, no Russian roulette, 16 seeds).
//!
//! `render_golden.json` quotes its means over blocks of 8 x 8 pixels with their standard errors (block means of 4 x 4 pixels were
//! computed, four of them are averaged here), and the mean of the film. `VERNIS_RENDER_GOLDEN` may name a file with blocks of
//! any other size in the same form.
//!
//! The samples here are few, so that the tests take seconds. With `VERNIS_RENDER_MORE=3` our standard errors are at most Mitsuba's.
//!
//! z = (ours - theirs) / sqrt(our standard error^2 + theirs^2), ours from independent seeds. With standard errors from 16 seeds, z
//! is distributed as Student's t with some 15 degrees of freedom: its mean square is 15/13.

use crate::data_folder;
use serde_json::Value;
use std::sync::Arc;
use vernis_image::scene::{Camera, Film, Light, Mesh, Normals, Panorama, Reflectance, Scene, Shape, Table};
use vernis_image::trace::Tracer;
use vernis_metric::brdf::models::build;
use vernis_metric::brdf::{Brdf, BrdfSource, ContentHash};
use vernis_metric::io::silent;
use vernis_metric::math::{Rgb, Vec3};

/// Independent renderings that our standard errors come from.
const SEEDS: u64 = 16;

/// (.9, .7, .3) D G / (4 cos_i cos_o), alpha 0.15: a lobe without a Fresnel term.
struct GgxWithoutFresnel;

impl Brdf for GgxWithoutFresnel {
    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        let a2 = 0.15f64 * 0.15;
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return Some([0.0; 3]);
        }
        let h = (wi + wo).normalized();
        let cos2 = h.z * h.z;
        let d = a2 / (std::f64::consts::PI * (cos2 * a2 + 1.0 - cos2).powi(2));
        let g1 = |c: f64| 2.0 / (1.0 + (1.0 + a2 * (1.0 - c * c) / (c * c)).sqrt());
        let f = d * g1(wi.z) * g1(wo.z) / (4.0 * wi.z * wo.z);
        Some([0.9 * f, 0.7 * f, 0.3 * f])
    }

    fn is_mirror_symmetric(&self) -> bool {
        true
    }
}

fn model(name: &str, parameters: &[f64]) -> Reflectance {
    let brdf = build(name, parameters).expect("valid");
    Reflectance::Brdf(brdf, ContentHash([0; 32]))
}

fn brdf(name: &str) -> Reflectance {
    match name {
        "lambert" => model("lambert", &[0.2, 0.5, 0.8]),
        "lambert08" => model("lambert", &[0.8; 3]),
        "ggx_f1" => Reflectance::Brdf(Arc::new(GgxWithoutFresnel), ContentHash([0; 32])),
        "ggx_schlick" => model("ggx", &[0.10, 0.15, 0.20, 0.5, 0.4, 0.2, 0.3]),
        _ => {
            let material = name.strip_prefix("nbrdf:").expect("a network");
            let notation = format!("merl_nbrdf.zip:{material}");
            let open = BrdfSource::parse(&notation).and_then(|s| s.open(Some(&data_folder()))).expect("the network");
            Reflectance::Brdf(open.brdf, open.content)
        }
    }
}

fn light(name: &str) -> Light {
    let file = match name {
        "white" => return Light::White,
        "grace" => "grace_probe_latlong.hdr",
        _ => "uffizi_spica.hdr",
    };
    Light::Panorama(Arc::new(Panorama::read(&data_folder().join("envmaps").join(file)).expect("the probe")))
}

fn scene(text: &Value) -> Scene {
    let word = |key: &str| text[key].as_str().expect("a word");
    let geometry = word("geometry");
    let sphere = geometry == "sphere";
    let shape = if sphere {
        Shape::Sphere { center: [0.0; 3], radius: 1.0 }
    } else {
        let path = data_folder().join("meshes/happy_vrip_res4.ply");
        let mesh = Mesh::read(&path, Normals::Face).expect("the mesh");
        Shape::Mesh(Arc::new(mesh.placed([0.00547385, -0.0500539, 0.00673655], 10.1255005)))
    };
    Scene {
        shape,
        reflectance: brdf(word("brdf")),
        table: geometry
            .ends_with("table")
            .then(|| Table { half_side: 3.0, reflectance: model("lambert", &[0.42, 0.24, 0.11]) }),
        camera: if sphere {
            Camera { from: [0.0, 0.0, 5.0], to: [0.0; 3], fov_deg: 30.0 }
        } else {
            Camera { from: [0.0, 1.0, 6.0], to: [0.0, 1.0, 0.0], fov_deg: 24.0 }
        },
        light: light(word("light")),
        light_scale: 1.0,
        background: false,
        film: Film {
            width: 64,
            height: if sphere { 64 } else { 96 },
            samples: 0,
            bounces: text["bounces"].as_u64().expect("a number") as usize,
            seed: 0,
        },
    }
}

fn rgb(value: &Value) -> Rgb {
    [0, 1, 2].map(|c| value[c].as_f64().expect("a number"))
}

/// Mean and its standard error, of each block in turn and of the whole film at last.
fn ours(scene: &Scene, samples: usize, blocks: [usize; 2]) -> Vec<[(f64, f64); 3]> {
    let Film { width, height, .. } = scene.film;
    let (bw, bh) = (width / blocks[0], height / blocks[1]);
    let mut of_seeds = Vec::new();
    let mut traced = scene.clone();
    for seed in 0..SEEDS {
        traced.film = Film { samples, seed, ..scene.film };
        let picture = Tracer::new(&traced).expect("traceable").render(&silent).expect("finite");
        let mut means = vec![[0.0; 3]; blocks[0] * blocks[1] + 1];
        let whole = blocks[0] * blocks[1];
        for (k, pixel) in picture.pixels().iter().enumerate() {
            let block = k / width / bh * blocks[0] + k % width / bw;
            for c in 0..3 {
                means[block][c] += f64::from(pixel[c]) / (bw * bh) as f64;
                means[whole][c] += f64::from(pixel[c]) / (width * height) as f64;
            }
        }
        of_seeds.push(means);
    }
    let n = SEEDS as f64;
    (0..of_seeds[0].len())
        .map(|block| {
            [0, 1, 2].map(|c| {
                let mean = of_seeds.iter().map(|m| m[block][c]).sum::<f64>() / n;
                let variance = of_seeds.iter().map(|m| (m[block][c] - mean).powi(2)).sum::<f64>() / (n - 1.0);
                (mean, (variance / n).sqrt())
            })
        })
        .collect()
}

fn check(name: &str, samples: usize) {
    // For a sharper look than a test has time for.
    let more = std::env::var("VERNIS_RENDER_MORE").map_or(1, |n| n.parse().expect("VERNIS_RENDER_MORE is a number"));
    let samples = samples * more;
    let file = std::env::var_os("VERNIS_RENDER_GOLDEN");
    let text = match file {
        Some(path) => std::fs::read_to_string(path).expect("the file that VERNIS_RENDER_GOLDEN names"),
        None => include_str!("render_golden.json").to_owned(),
    };
    let golden: Value = serde_json::from_str(&text).expect("JSON");
    let golden = &golden["scenes"][name];
    let rows = golden["mean"].as_array().expect("rows");
    let blocks = [rows[0].as_array().expect("blocks").len(), rows.len()];
    let started = std::time::Instant::now();
    let ours = ours(&scene(golden), samples, blocks);
    let seconds = started.elapsed().as_secs_f64();
    let (mut squares, mut compared, mut worst) = (0.0, 0.0, 0.0f64);
    let (mut variance, mut their_variance) = (0.0, 0.0);
    for block in 0..blocks[0] * blocks[1] {
        let at = |key: &str| rgb(&golden[key][block / blocks[0]][block % blocks[0]]);
        let (mean, se) = (at("mean"), at("se"));
        for c in 0..3 {
            let (own, own_se) = ours[block][c];
            if se[c] == 0.0 && own_se == 0.0 {
                assert!(
                    (own - mean[c]).abs() < 1e-6 * mean[c].max(1.0),
                    "{name}, block {block}: {own} and {}",
                    mean[c]
                );
                continue;
            }
            let z = (own - mean[c]) / own_se.hypot(se[c]);
            squares += z * z;
            compared += 1.0;
            worst = worst.max(z.abs());
            variance += own_se * own_se;
            their_variance += se[c] * se[c];
        }
    }
    let (total, total_se) = (rgb(&golden["total"]), rgb(&golden["total_se"]));
    let whole = ours[ours.len() - 1];
    let of_total = [0, 1, 2].map(|c| (whole[c].0 - total[c]) / whole[c].1.hypot(total_se[c]));
    let mean_square = squares / compared;
    println!(
        "{name}: {samples} samples x {SEEDS}, {seconds:.1} s; {compared} means, worst z {worst:.2}, mean z^2 {mean_square:.2}, \
         totals {of_total:.2?}, standard error {:.2} of Mitsuba's",
        (variance / their_variance).sqrt()
    );
    assert!(worst < 4.5, "{name}: z {worst}");
    // Channels and neighbours vary together: of some 130 means a third are independent, and the mean square of t with 15 degrees of
    // freedom over 44 of them has a standard deviation of 0.3.
    let allowed = if compared > 400.0 { 0.7..1.4 } else { 0.3..2.1 };
    assert!(allowed.contains(&mean_square), "{name}: mean square of z is {mean_square}");
    assert!(of_total.iter().all(|z| z.abs() < 3.0), "{name}: {of_total:?}");
}

macro_rules! scenes {
    ($($name:ident: $samples:literal),* $(,)?) => {
        $(#[test_with::env(VERNIS_DATA)]
        #[test]
        fn $name() {
            check(stringify!($name), $samples);
        })*
    };
}

scenes! {
    sphere_lambert_grace: 64,
    sphere_ggxF1_grace: 128,
    sphere_ggxschlick_uffizi: 64,
    buddha_lambert_white_direct: 64,
    buddha_ggxschlick_grace_direct: 64,
    buddha_lambert08_grace_bounces: 64,
    buddha_nbrdf_goldmetallicpaint_grace_direct: 64,
    buddha_ggxschlick_grace_table_bounces: 64,
}
