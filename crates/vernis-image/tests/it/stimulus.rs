//! Metrics on BRDFs by what they look like.

use std::sync::Arc;
use vernis_image::display::tone::Tone;
use vernis_image::metric::{Conditions, ImageRegistry};
use vernis_image::picture::{EncodedPicture, Encoding};
use vernis_image::scene::study::{self, LightChoice, ShapeChoice, View};
use vernis_image::scene::{Film, Reflectance};
use vernis_image::stimulus::{Cameras, plain, registry};
use vernis_image::trace::Tracer;
use vernis_metric::brdf::models::Ggx;
use vernis_metric::brdf::{Brdf, ContentHash, Grid, on_grid};
use vernis_metric::descriptor::Cache;
use vernis_metric::io::silent;
use vernis_metric::metric::registry::Registry;
use vernis_metric::metric::{Metric, PreparedMetrics};

const SMALL: &str = "light=lamps,shape=sphere,size=32x48,samples=4,bounces=2";

fn all() -> Registry {
    registry(None, Conditions::default()).expect("a registry")
}

fn small(metric: &str) -> Arc<dyn Metric> {
    all().get(&format!("stimulus[{metric},{SMALL}]")).expect("a metric")
}

fn ggx(alpha: f64) -> Ggx {
    Ggx::new([0.2, 0.1, 0.05], [0.3; 3], alpha).expect("valid")
}

fn distance(metric: &str, a: &dyn Brdf, b: &dyn Brdf) -> f64 {
    small(metric).distance(a, b).expect("comparable")
}

#[test]
fn the_distance_is_that_of_the_pictures() {
    let film = Film { width: 32, height: 48, samples: 4, bounces: 2, seed: 0 };
    let shown = |alpha: f64, view: View| {
        let brdf = Reflectance::Brdf(Arc::new(ggx(alpha)), ContentHash([0; 32]));
        let (shape, light) = (ShapeChoice::Sphere.shape().expect("code"), LightChoice::Lamps.light().expect("code"));
        let scene = study::scene(brdf, shape, light, view, film);
        let picture = Tracer::new(&scene).expect("a scene").render(&silent).expect("a picture");
        let codes = Tone::ExrDisplay { gamma: 1.0 / 2.2 }.apply(&picture, 0.0);
        let pixels = codes.as_chunks::<3>().0.iter().map(|code| code.map(f32::from)).collect();
        EncodedPicture::new(32, 48, pixels, Encoding::Srgb).expect("codes")
    };
    for name in ["ssim", "cielab", "flip"] {
        let metric = ImageRegistry::standard().get(name).expect("a metric");
        let by_hand = |view: View, alpha: f64| {
            let prepared = metric.prepare(&shown(0.1, view), &Conditions::default()).expect("a picture");
            prepared.distance(&shown(alpha, View::Test)).expect("a picture")
        };
        let (same, offset, hidden) =
            (by_hand(View::Test, 0.3), by_hand(View::Reference, 0.3), by_hand(View::Reference, 0.1));
        assert!(same > 0.0 && hidden > 0.0);
        let found = |camera: &str| distance(&format!("{name},camera={camera}"), &ggx(0.1), &ggx(0.3));
        assert_eq!(found("same"), same, "{name}");
        assert_eq!(found("offset"), offset, "{name}");
        assert_eq!(found("offset-minus-hidden"), offset - hidden, "{name}");
    }
}

#[test]
fn what_looks_more_different_is_further_and_the_same_is_zero() {
    for name in ["ssim", "ssim-rgb", "cielab", "ciede2000", "flip", "hdr-vdp", "cvvdp", "icid-cielab", "hdr-flip"] {
        let to = |alpha: f64| distance(name, &ggx(0.1), &ggx(alpha));
        assert_eq!(to(0.1), 0.0, "{name}");
        assert!(to(0.12) > 0.0 && to(0.12) < to(0.5), "{name}: {} {}", to(0.12), to(0.5));
    }
    let hidden = "ssim,camera=offset-minus-hidden";
    assert_eq!(distance(hidden, &ggx(0.1), &ggx(0.1)), 0.0);
    assert!(distance("ssim,camera=offset", &ggx(0.1), &ggx(0.1)) > 0.0);
}

#[test]
fn metrics_of_one_setting_share_their_pictures_and_say_the_same() {
    let metrics = ["ssim", "cielab", "ssim,camera=offset", "hdr-flip", "ssim,camera=offset-minus-hidden"].map(small);
    let prepared = PreparedMetrics::new(&metrics, &ggx(0.1)).expect("a reference");
    let together = prepared.measure(&ggx(0.3)).expect("comparable");
    for (metric, found) in metrics.iter().zip(&together) {
        assert_eq!(found.value, metric.distance(&ggx(0.1), &ggx(0.3)).expect("comparable"), "{}", metric.name());
    }
    let groups = vernis_metric::metric::groups(&metrics);
    assert_eq!(groups.len(), 1);
    let other = all().get("stimulus[ssim,light=white,shape=sphere,size=32x48]").expect("a metric");
    assert_eq!(vernis_metric::metric::groups(&[metrics[0].clone(), other]).len(), 2);
}

#[test]
fn pictures_are_kept_by_what_the_surface_reflects() {
    let folder = tempfile::tempdir().expect("a folder");
    let cache = Cache::open(folder.path()).expect("a cache");
    let files = || std::fs::read_dir(folder.path()).expect("a folder").count();
    let found = |metric: &str, alpha: f64| {
        let metric = small(metric);
        assert!(metric.warm_up(&cache).is_none());
        metric.distance(&ggx(0.1), &ggx(alpha)).expect("comparable")
    };
    let first = found("ssim", 0.3);
    assert_eq!(files(), 2);
    // From the cache, by other metrics as well.
    assert_eq!(found("ssim", 0.3), first);
    assert_eq!(first, distance("ssim", &ggx(0.1), &ggx(0.3)));
    assert_eq!(found("cielab", 0.3), distance("cielab", &ggx(0.1), &ggx(0.3)));
    assert_eq!(files(), 2);
    assert_ne!(found("ssim", 0.31), first);
    assert_eq!(files(), 3);
    found("ssim,seed=1", 0.3);
    found("ssim,camera=offset", 0.3);
    assert_eq!(files(), 6);
}

#[test]
fn a_borrowed_table_is_compared_as_an_owned_one() {
    let grid = Grid::HalfDifference { theta_h: 90, theta_d: 90, phi_d: 180 };
    let table = on_grid(&ggx(0.3), grid).expect("a table");
    let (of_table, of_model) = (distance("cielab", &ggx(0.3), &table), distance("cielab", &ggx(0.3), &ggx(0.5)));
    assert!(of_table > 0.0 && of_table < 0.1 * of_model, "{of_table} {of_model}");
    assert_eq!(distance("cielab", &table, &table), 0.0);
}

#[test]
fn the_same_bytes_on_any_number_of_threads() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| ["ssim", "hdr-vdp", "cielab"].map(|name| distance(name, &ggx(0.1), &ggx(0.2)).to_bits()))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn names_say_what_is_wrong() {
    let refused =
        |name: &str| all().get(name).err().map(|e| e.to_string()).unwrap_or_else(|| panic!("{name} is a metric"));
    for (name, words) in [
        ("stimulus[]", "the first entry is nothing; it must be a metric on pictures"),
        (
            "stimulus[sim]",
            "the metric on pictures is sim; it must be one that `vernis metrics` lists; did you mean ssim",
        ),
        ("stimulus[ssim", "without its closing bracket"),
        ("stimulus[ssim,camera=left]", "camera is left; it must be same, offset, offset-minus-hidden"),
        ("stimulus[ssim,light=grace]", "light is grace; it must be a light that is there"),
        ("stimulus[ssim,light=none.hdr]", "none.hdr"),
        ("stimulus[ssim,shape=none.ply]", "none.ply"),
        ("stimulus[ssim,size=0x4]", "size is 0x4; it must be WxH"),
        ("stimulus[ssim,samples=0]", "samples is 0; it must be a whole number from 1 to"),
        ("stimulus[ssim,bounces=many]", "bounces is many"),
        ("stimulus[ssim,seed=-1]", "seed is -1"),
        ("stimulus[ssim,tone=srgb,gamma=0.5]", "gamma is 0.5; it must be left out"),
        ("stimulus[ssim,tone=dark]", "tone is dark; it must be exrdisplay, srgb or none"),
        ("stimulus[ssim,exposure=inf]", "exposure is inf"),
        ("stimulus[ssim,ppd=0]", "ppd is 0"),
        ("stimulus[cvvdp,display=crt]", "display is crt; it must be"),
        ("stimulus[ssim,depth=3]", "an option is `depth`; it must be one of metric, camera, light"),
        ("stimulus[ssim,camera=same,camera=same]", "given twice"),
    ] {
        assert!(refused(name).contains(words), "{name}: {}", refused(name));
    }
    // What a metric cannot compare is said when it is asked.
    let tiny = all().get("stimulus[ms-ssim,light=white,shape=sphere,size=32x48,samples=1]").expect("a metric");
    let error = tiny.distance(&ggx(0.1), &ggx(0.2)).unwrap_err().to_string();
    assert!(error.contains("32 x 48") || error.contains("161"), "{error}");
}

#[test]
fn groups_stand_for_all_metrics_on_codes() {
    let all = all();
    for (group, suffix) in [("all-stimulus", "]"), ("all-stimulus-offset", ",camera=offset]")] {
        let names: Vec<String> = all.resolve(group).expect("a group").iter().map(|m| m.name().to_owned()).collect();
        assert!(names.contains(&format!("stimulus[ssim{suffix}")) && names.len() >= 16, "{names:?}");
        // Without the table its stand-in.
        assert!(
            names.contains(&format!("stimulus[cid-cielab{suffix}"))
                && !names.contains(&format!("stimulus[cid{suffix}"))
        );
        for name in &names {
            assert_eq!(all.get(name).expect("a metric").name(), name);
            assert!(plain(name).is_some_and(|(_, cameras)| (cameras == Cameras::Same) == (suffix == "]")), "{name}");
        }
    }
    assert_eq!(plain("stimulus[ssim,light=white]"), None);
    assert_eq!(plain("D9.Cl"), None);
    assert_eq!(
        all.get("stimulus").expect("a metric").properties().unit,
        all.get("stimulus[ssim]").expect("a metric").properties().unit
    );
}
