//! Gradients on nodes against central differences of the distance itself, and what every metric with nodes promises.

use crate::data_folder;
use rand::Rng;
use rayon::prelude::*;
use std::sync::Arc;
use vernis_metric::brdf::models::{BlinnPhong, Ggx, Lambert, Ward, WardForm};
use vernis_metric::brdf::{Brdf, BrdfSource, Grid, TabulatedBrdf};
use vernis_metric::math::{Rgb, Vec3, seed};
use vernis_metric::metric::registry::Registry;
use vernis_metric::metric::{Metric, MetricError, Nodes, PreparedMetric};

fn metric(name: &str) -> Arc<dyn Metric> {
    Registry::standard().unwrap().get(name).unwrap()
}

/// A change of a BRDF that varies slowly over the directions: in each channel a sum of waves in the coordinates of both directions.
struct Waves([[(f64, Vec3, Vec3, f64); 2]; 3]);

impl Waves {
    fn new(seed: u64) -> Self {
        let mut rng = seed::stream(seed, "waves", 0);
        let mut wave = || {
            let mut number = |limit: f64| rng.random_range(-limit..limit);
            let mut vector = || Vec3::new(number(4.0), number(4.0), number(4.0));
            let (i, o) = (vector(), vector());
            (number(1.0), i, o, number(3.0))
        };
        Self([(); 3].map(|()| [(); 2].map(|()| wave())))
    }

    fn at(&self, wi: Vec3, wo: Vec3) -> Rgb {
        self.0
            .each_ref()
            .map(|waves| waves.iter().map(|(a, i, o, phase)| a * (i.dot(wi) + o.dot(wo) + phase).sin()).sum())
    }

    /// The relative change of every value.
    fn on(&self, nodes: &Nodes, values: &[Rgb]) -> Vec<Rgb> {
        let change = |(node, value): (usize, &Rgb)| {
            let (wi, wo) = nodes.directions(node);
            let waves = self.at(wi, wo);
            [0, 1, 2].map(|c| value[c] * waves[c])
        };
        values.par_iter().enumerate().map(change).collect()
    }
}

fn moved(values: &[Rgb], change: &[Rgb], step: f64) -> Vec<Rgb> {
    values.iter().zip(change).map(|(v, d)| [0, 1, 2].map(|c| v[c] + step * d[c])).collect()
}

/// The derivatives along `count` smooth changes: (by the gradient, by central differences).
fn derivatives(prepared: &dyn PreparedMetric, values: &[Rgb], count: u64, step: f64) -> Vec<(f64, f64)> {
    let nodes = prepared.nodes().unwrap();
    let gradient = prepared.gradient_at(values).unwrap();
    assert_eq!(gradient.value, prepared.distance_at(values).unwrap());
    let along = |seed: u64| {
        let change = Waves::new(seed).on(&nodes, values);
        let at = |step: f64| prepared.distance_at(&moved(values, &change, step)).unwrap();
        let terms = gradient.derivatives.iter().zip(&change);
        let found = terms.map(|(d, change)| (0..3).map(|c| d[c] * change[c]).sum::<f64>()).sum();
        (found, (at(step) - at(-step)) / (2.0 * step))
    };
    (0..count).map(along).collect()
}

/// The largest error, relative to the root mean square of the derivatives.
fn worst(derivatives: &[(f64, f64)]) -> f64 {
    let scale = (derivatives.iter().map(|(_, d)| d * d).sum::<f64>() / derivatives.len() as f64).sqrt();
    derivatives.iter().map(|(found, expected)| (found - expected).abs() / scale).fold(0.0, f64::max)
}

/// Close and far, rough and glossy.
fn pairs() -> Vec<(Box<dyn Brdf>, Box<dyn Brdf>)> {
    let ggx = |kd: Rgb, f0: f64, alpha: f64| Box::new(Ggx::new(kd, [f0, 1.1 * f0, 0.9 * f0], alpha).unwrap());
    let ward = Ward::new([0.1, 0.2, 0.05], [0.05, 0.04, 0.03], 0.12, WardForm::Duer).unwrap();
    let blinn = BlinnPhong::new([0.1, 0.12, 0.08], [0.2, 0.1, 0.15], 30.0).unwrap();
    vec![
        (Box::new(ward), ggx([0.12, 0.18, 0.06], 0.05, 0.15)),
        (ggx([0.2, 0.1, 0.05], 0.04, 0.3), ggx([0.25, 0.1, 0.05], 0.04, 0.4)),
        (ggx([0.0; 3], 0.8, 0.1), ggx([0.02; 3], 0.7, 0.2)),
        (ggx([0.2, 0.1, 0.05], 0.04, 0.3), Box::new(blinn)),
    ]
}

/// Along smooth changes the gradient is that of the number itself, whichever side reaches further out. Value nodes of a quantised graph are
/// passed by few cells at this step.
fn assert_follows(
    prepared: &dyn PreparedMetric,
    candidate: &dyn Brdf,
    (count, step, tolerance): (u64, f64, f64),
    what: &str,
) {
    let values = prepared.nodes().unwrap().evaluate(candidate);
    let worst = worst(&derivatives(prepared, &values, count, step));
    println!("{what}: {worst:.1e}");
    assert!(worst < tolerance, "{what}: {worst:e}");
}

#[test]
fn metrics_on_graphs_follow_differences() {
    // As they are, and exchanged: each side reaches further out than the other in some of them.
    let all = pairs();
    let full: &[usize] = &[0, 3];
    let small: &[usize] = &[0, 1, 2, 3];
    for (name, chosen) in [
        ("ot", full),
        ("energy", full),
        ("ot[grid=9x9x36]", small),
        ("ot[grid=5x5x16,p=1]", small),
        ("mmd-gaussian[grid=18x18x40]", small),
        ("mmd-laplacian[grid=18x18x40]", small),
    ] {
        let metric = metric(name);
        for &k in chosen {
            let (a, b) = &all[k];
            for (a, b, order) in [(a, b, "there"), (b, a, "back")] {
                let prepared = metric.prepare(&**a).unwrap();
                assert_follows(&*prepared, &**b, (4, 1e-5, 1e-3), &format!("{name} {k} {order}"));
            }
        }
    }
}

/// No cell is equal on both sides, where the formulas of roots have no slope.
#[test]
fn lp_metrics_follow_differences() {
    let reference = Ggx::new([0.2, 0.1, 0.05], [0.04, 0.05, 0.06], 0.3).unwrap();
    let brighter = Ggx::new([0.25, 0.12, 0.06], [0.05, 0.06, 0.08], 0.3).unwrap();
    for name in ["D1", "D2.Cl", "D3.Cl", "D4.Cl.CR", "D5.Cl.CR", "D7.Cl.CR", "D8.Cl", "D9.CR"] {
        let prepared = metric(name).prepare(&reference).unwrap();
        assert_follows(&*prepared, &brighter, (2, 1e-6, 1e-4), name);
    }
    let (ward, candidate) = pairs().swap_remove(0);
    let prepared = metric("D9.Cl").prepare(&*ward).unwrap();
    assert_follows(&*prepared, &*candidate, (20, 1e-5, 1e-4), "D9.Cl, crossing");
}

/// References are neural fits of measured materials, candidates the published fits of models to them.
#[test_with::env(VERNIS_DATA)]
#[test]
fn gradients_of_published_fits_follow_differences() {
    let data = data_folder();
    let open = |notation: &str| BrdfSource::parse(notation).expect("valid").open(Some(&data)).expect("present").brdf;
    for (file, material) in [
        ("ngan_wardduer.fit", "teflon"),
        ("ngan_blinnphong.fit", "blue-acrylic"),
        ("low_cooktorrance_E1.fit", "chrome"),
        ("low_lowmicrofacet_E2.fit", "red-fabric"),
    ] {
        let (reference, candidate) = (open(&format!("merl_nbrdf.zip:{material}")), open(&format!("{file}:{material}")));
        for (name, count, tolerance) in [("ot", 8, 1e-3), ("energy", 2, 1e-3), ("D4.Cl.CR", 2, 1e-4)] {
            let prepared = metric(name).prepare(&*reference).unwrap();
            assert_follows(&*prepared, &*candidate, (count, 1e-5, tolerance), &format!("{name} {file} {material}"));
        }
    }
}

/// To the last bit for models; a table comes back from the metrics on graphs with a cosine divided out and multiplied in again.
#[test]
fn values_on_nodes_give_the_distance_of_the_brdf() {
    let (reference, candidate) = pairs().swap_remove(0);
    let tables = [&reference, &candidate].map(|brdf| TabulatedBrdf::tabulate(&**brdf, Grid::TITOPO).unwrap());
    for name in ["D1", "D9.Cl", "D6.Cl", "lab", "ot", "energy"] {
        let metric = metric(name);
        let nodes_of = |prepared: &dyn PreparedMetric| prepared.nodes().unwrap();
        let prepared = metric.prepare(&*reference).unwrap();
        let values = nodes_of(&*prepared).evaluate(&*candidate);
        let expected = prepared.distance(&*candidate).unwrap();
        assert_eq!(prepared.distance_at(&values).unwrap(), expected, "{name}");
        assert_eq!(metric.properties().differentiable, prepared.gradient_at(&values).is_ok(), "{name}");
        let prepared = metric.prepare(&tables[0]).unwrap();
        let (found, expected) =
            (prepared.distance_at(&nodes_of(&*prepared).evaluate(&tables[1])), prepared.distance(&tables[1]).unwrap());
        let tolerance = if metric.properties().family == "lp" { 0.0 } else { 1e-9 };
        assert!((found.unwrap() / expected - 1.0).abs() <= tolerance, "{name}");
    }
    let error = metric("D6").prepare(&*reference).unwrap();
    let values = error.nodes().unwrap().evaluate(&*candidate);
    assert_eq!(error.gradient_at(&values), Err(MetricError::NoGradient { metric: "D6".to_owned() }));
}

#[test]
fn where_nothing_differs_the_distance_and_the_gradient_are_zero() {
    let (_, candidate) = pairs().swap_remove(1);
    for name in ["D1", "D3.CR", "D5.Cl", "D7", "D8", "D9.CR", "ot", "energy", "mmd-laplacian"] {
        let prepared = metric(name).prepare(&*candidate).unwrap();
        let found = prepared.gradient_at(&prepared.nodes().unwrap().evaluate(&*candidate)).unwrap();
        assert_eq!(found.value, 0.0, "{name}");
        assert!(found.derivatives.iter().flatten().all(|d| *d == 0.0), "{name}");
    }
}

/// Black candidates and black references: the slopes of roots are infinite there and count as 0.
#[test]
fn gradients_of_black_are_finite() {
    let (black, white) = (Lambert::new([0.0; 3]).unwrap(), Lambert::new([0.0, 0.5, 1.0]).unwrap());
    for name in ["D1.CR", "D3.CR", "D7.Cl.CR", "D8.CR", "D9.CR", "ot[grid=9x9x36]", "ot[grid=6x6x24]", "energy"] {
        for (a, b) in [(&black, &white), (&white, &black), (&black, &black)] {
            let prepared = metric(name).prepare(a).unwrap();
            let found = prepared.gradient_at(&prepared.nodes().unwrap().evaluate(b)).unwrap();
            assert!(found.derivatives.iter().flatten().all(|d| d.is_finite()), "{name}");
        }
    }
}

/// What the reference lacks takes no part; what the candidate lacks is an error.
#[test]
fn missing_cells_of_the_reference_have_no_slope() {
    let grid = Grid::TITOPO;
    let full = TabulatedBrdf::tabulate(&*pairs()[0].0, grid).unwrap();
    let lacks = |cell: usize| cell / 360 % 90 / 8 == 3 && cell % 360 < 300;
    let valid = (0..grid.len()).map(|cell| !lacks(cell)).collect();
    let holed = TabulatedBrdf::new(grid, full.values().to_vec(), valid).unwrap();
    let candidate = &pairs()[0].1;
    for name in ["D1", "D9.CR", "ot", "energy"] {
        let prepared = metric(name).prepare(&holed).unwrap();
        let nodes = prepared.nodes().unwrap();
        let values = nodes.evaluate(&**candidate);
        let found = prepared.gradient_at(&values).unwrap();
        assert_eq!(found.value, prepared.distance(&**candidate).unwrap(), "{name}");
        if name.starts_with('D') {
            assert!((0..nodes.len()).all(|node| (found.derivatives[node] == [0.0; 3]) == lacks(node)), "{name}");
        } else {
            let still = found.derivatives.iter().filter(|d| **d == [0.0; 3]).count();
            assert!(still > 0 && still < nodes.len() / 4, "{name}: {still}");
        }
        let holed_values = nodes.evaluate(&holed);
        assert!(
            matches!(prepared.distance_at(&holed_values), Err(MetricError::NodeValue { value, .. }) if value.is_nan())
        );
    }
}

#[test]
fn wrong_values_are_errors_of_their_own_kind() {
    let (reference, candidate) = pairs().swap_remove(1);
    for name in ["D4.Cl", "ot[grid=6x6x24]", "energy[grid=6x6x24]"] {
        let prepared = metric(name).prepare(&*reference).unwrap();
        let nodes = prepared.nodes().unwrap();
        let mut values = nodes.evaluate(&*candidate);
        let both = |values: &[Rgb]| {
            let error = prepared.distance_at(values).unwrap_err();
            // An error with a NaN is not equal to itself.
            assert_eq!(prepared.gradient_at(values).unwrap_err().to_string(), error.to_string());
            error
        };
        let (found, expected) = (nodes.len() - 1, nodes.len());
        let short = MetricError::ValueCount { metric: name.to_owned(), nodes: nodes.id().to_owned(), found, expected };
        assert_eq!(both(&values[1..]), short);
        for wrong in [f64::NAN, f64::INFINITY, -0.5] {
            values[77][2] = wrong;
            let error = both(&values);
            let message = error.to_string();
            assert!(matches!(error, MetricError::NodeValue { node: 77, channel: 2, .. }), "{message}");
            assert!(message.contains("node 77 of") && message.contains(&format!("blue is {wrong}")), "{message}");
        }
    }
}

#[test]
fn no_bit_of_a_gradient_depends_on_the_number_of_threads() {
    let (reference, candidate) = pairs().swap_remove(0);
    for name in ["D9.Cl", "ot[grid=9x9x36]", "energy[grid=18x18x40]"] {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let prepared = metric(name).prepare(&*reference).unwrap();
                prepared.gradient_at(&prepared.nodes().unwrap().evaluate(&*candidate)).unwrap()
            })
        };
        assert!(with(1) == with(2), "{name}");
    }
}
