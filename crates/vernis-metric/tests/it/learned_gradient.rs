//! Gradients of the learned metrics on nodes: against central differences, at identity, at masked cells, and with wrong values.

use crate::data_folder;
use rand::Rng;
use std::sync::{Arc, LazyLock};
use vernis_metric::brdf::models::build;
use vernis_metric::brdf::{Brdf, BrdfSource};
use vernis_metric::math::{Rgb, Vec3, seed};
use vernis_metric::metric::registry::Registry;
use vernis_metric::metric::{Gradient, Metric, MetricError, PreparedMetric};

/// The learned metrics that come with the library and have a gradient.
const LEARNED: [&str; 2] = ["vernis", "vernis-loss"];
/// Random directions a pair.
const DIRECTIONS: usize = 20;
/// Allowed error of a directional derivative, relative to the root of the sum of the squares of its terms.
const ALLOWED: f64 = 1e-4;

static REGISTRY: LazyLock<Registry> = LazyLock::new(|| Registry::standard().expect("the shipped metrics"));

fn metric(name: &str) -> Arc<dyn Metric> {
    REGISTRY.get(name).expect("a learned metric")
}

fn model(name: &str, parameters: &[f64]) -> Arc<dyn Brdf> {
    build(name, parameters).expect("within bounds")
}

/// A BRDF that was measured nowhere near the horizon.
struct Holed(Arc<dyn Brdf>);

impl Brdf for Holed {
    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        if wi.z.min(wo.z) < 0.2 { None } else { self.0.eval(wi, wo) }
    }
}

/// Reference and candidate.
type Pair = (Arc<dyn Brdf>, Arc<dyn Brdf>);

/// Plastics, metals, fabrics, mirrors, blacks and a table with holes, against each other.
fn models() -> Vec<Pair> {
    let plastic = model("ggx", &[0.3, 0.05, 0.04, 0.04, 0.04, 0.04, 0.1]);
    let metal = model("ggx", &[0.0, 0.0, 0.0, 0.95, 0.7, 0.3, 0.2]);
    let mirror = model("ggx", &[0.0, 0.0, 0.0, 0.95, 0.95, 0.95, 0.002]);
    let fabric = model("ward-duer", &[0.2, 0.25, 0.3, 0.02, 0.02, 0.02, 0.4]);
    let black = model("ggx", &[0.001, 0.001, 0.001, 0.01, 0.01, 0.01, 0.3]);
    let phong = model("blinn-phong", &[0.28, 0.06, 0.05, 0.05, 0.04, 0.03, 80.0]);
    let holed: Arc<dyn Brdf> = Arc::new(Holed(plastic.clone()));
    vec![
        (plastic.clone(), phong.clone()),
        (plastic.clone(), model("ggx", &[0.31, 0.05, 0.04, 0.04, 0.04, 0.04, 0.11])),
        (metal.clone(), model("ggx", &[0.0, 0.0, 0.0, 0.9, 0.75, 0.35, 0.15])),
        (metal, fabric.clone()),
        (mirror.clone(), model("ggx", &[0.0, 0.0, 0.0, 0.95, 0.95, 0.95, 0.005])),
        (fabric.clone(), plastic.clone()),
        (fabric, black.clone()),
        (black, mirror),
        (holed.clone(), phong),
        (holed, plastic),
    ]
}

/// Twenty pairs of the open study: published fits of ten materials of all kinds.
fn published() -> Vec<Pair> {
    let data = data_folder();
    let open = |notation: String| -> Arc<dyn Brdf> {
        BrdfSource::parse(&notation).expect("a notation").open(Some(&data)).expect("is there").brdf
    };
    let materials = [
        "chrome",
        "gold-metallic-paint",
        "red-plastic",
        "white-fabric",
        "blue-acrylic",
        "pearl-paint",
        "black-obsidian",
        "pink-felt",
        "nickel",
        "violet-rubber",
    ];
    let pairs = materials.iter().flat_map(|material| {
        let reference = open(format!("nbrdf/merl_nbrdf.zip:{material}"));
        ["published-fits/bagher_sgd.fit", "published-fits/low_lowmicrofacet_E2.fit"]
            .map(|file| (reference.clone(), open(format!("{file}:{material}"))))
    });
    pairs.collect()
}

/// Compares the derivatives of `value` at `values` with central differences along random directions.
fn check(what: &str, pair: usize, values: &[Rgb], found: &Gradient, value: &dyn Fn(&[Rgb]) -> f64) {
    let mut random = seed::stream(1, what, pair as u64);
    for direction in 0..DIRECTIONS {
        let direction_of: Vec<Rgb> =
            values.iter().map(|v| v.map(|v| (v + 1e-4) * random.random_range(-1.0..1.0))).collect();
        let moved = |h: f64| -> Vec<Rgb> {
            values.iter().zip(&direction_of).map(|(v, d)| std::array::from_fn(|c| (v[c] + h * d[c]).max(0.0))).collect()
        };
        let central = |h: f64| (value(&moved(h)) - value(&moved(-h))) / (2.0 * h);
        // Richardson's extrapolation: the curvature of a random direction over thousands of nodes is strong.
        let expected = (4.0 * central(1e-4) - central(2e-4)) / 3.0;
        let terms = || {
            let flat = found.derivatives.iter().flatten().zip(direction_of.iter().flatten());
            flat.map(|(g, d)| g * d)
        };
        let (sum, size) = (terms().sum::<f64>(), terms().map(|t| t * t).sum::<f64>().sqrt());
        let error = (sum - expected).abs() / size.max(sum.abs());
        assert!(error <= ALLOWED, "{what}, pair {pair}, direction {direction}: {sum} {expected} ({error:e} of {size})");
    }
}

fn check_pairs(pairs: &[Pair]) {
    for name in LEARNED {
        let metric = metric(name);
        for (k, (reference, candidate)) in pairs.iter().enumerate() {
            let prepared = metric.prepare(&**reference).expect("a reference");
            let values = prepared.nodes().expect("nodes").evaluate(&**candidate);
            let distance = prepared.distance_at(&values).expect("a distance");
            assert_eq!(distance, prepared.distance(&**candidate).expect("a distance"), "to the last bit");
            let gradient = prepared.gradient_at(&values).expect("a gradient");
            assert_eq!(gradient.value.max(0.0), distance);
            let signed = |values: &[Rgb]| prepared.gradient_at(values).expect("a gradient").value;
            check(name, k, &values, &gradient, &signed);
            let loss = |values: &[Rgb]| prepared.loss_gradient_at(values).expect("a loss").value;
            check(&format!("loss of {name}"), k, &values, &prepared.loss_gradient_at(&values).expect("a loss"), &loss);
            assert_eq!(loss(&values), prepared.loss(&**candidate).expect("a loss"));
        }
    }
}

#[test]
fn gradients_are_limits_of_differences_for_models() {
    check_pairs(&models());
}

#[test_with::env(VERNIS_DATA)]
#[test]
fn gradients_are_limits_of_differences_for_published_fits() {
    check_pairs(&published());
}

#[test]
fn at_identity_the_distance_is_zero_and_the_gradient_finite() {
    for name in LEARNED {
        for (reference, _) in models() {
            let prepared = metric(name).prepare(&*reference).expect("a reference");
            let values = prepared.nodes().expect("nodes").evaluate(&*reference);
            if values.iter().flatten().any(|v| v.is_nan()) {
                continue;
            }
            assert_eq!(prepared.distance_at(&values), Ok(0.0));
            for gradient in [prepared.gradient_at(&values), prepared.loss_gradient_at(&values)] {
                let gradient = gradient.expect("a gradient");
                assert_eq!(gradient.value, 0.0);
                assert!(gradient.derivatives.iter().flatten().all(|d| d.is_finite()));
            }
        }
    }
}

#[test]
fn wrong_values_are_typed_errors() {
    let (reference, candidate) = models().swap_remove(0);
    for name in LEARNED {
        let prepared = metric(name).prepare(&*reference).expect("a reference");
        let mut values = prepared.nodes().expect("nodes").evaluate(&*candidate);
        let short = &values[1..];
        let count =
            |e: MetricError| matches!(e, MetricError::ValueCount { found, expected, .. } if found + 1 == expected);
        assert!(count(prepared.distance_at(short).unwrap_err()) && count(prepared.gradient_at(short).unwrap_err()));
        for wrong in [f64::NAN, f64::INFINITY, -0.1] {
            values[7][1] = wrong;
            let node = |e: MetricError| matches!(e, MetricError::NodeValue { node: 7, channel: 1, .. });
            assert!(
                node(prepared.distance_at(&values).unwrap_err()) && node(prepared.gradient_at(&values).unwrap_err())
            );
        }
    }
}

/// The metric of version 1 stays, and says that it has no gradient.
#[test]
fn version_1_has_no_nodes() {
    let (reference, candidate) = models().swap_remove(0);
    let first = metric("vernis-1");
    assert!(!first.properties().differentiable && first.version().starts_with("1."));
    let prepared = first.prepare(&*reference).expect("a reference");
    assert!(prepared.nodes().is_none() && prepared.distance(&*candidate).expect("a distance") > 0.0);
    assert_eq!(prepared.gradient_at(&[]), Err(MetricError::NoNodes));
}

/// Symmetric, with the triangle inequality, and 0 for equal BRDFs.
#[test]
fn the_metric_to_fit_with_is_a_metric() {
    let metric = metric("vernis-loss");
    assert!(metric.properties().symmetric && !metric.properties().rough);
    let all: Vec<Arc<dyn Brdf>> = models().into_iter().take(8).flat_map(|(a, b)| [a, b]).collect();
    let prepared: Vec<Box<dyn PreparedMetric>> =
        all.iter().map(|a| metric.prepare(&**a).expect("a reference")).collect();
    let distances: Vec<Vec<f64>> =
        prepared.iter().map(|p| all.iter().map(|b| p.distance(&**b).expect("a distance")).collect()).collect();
    for (i, row) in distances.iter().enumerate() {
        for (j, d) in row.iter().enumerate() {
            assert!((d - distances[j][i]).abs() < 1e-9, "{d} {}", distances[j][i]);
            for (k, other) in distances.iter().enumerate() {
                assert!(*d <= row[k] + other[j] + 1e-9, "{i} {k} {j}");
            }
        }
    }
}
