//! The metrics on graphs through the registry: contract, gradients, notation, bad input.

use rand::Rng;
use std::sync::Arc;
use vernis_metric::brdf::models::{BlinnPhong, Ggx, Lambert};
use vernis_metric::brdf::{Anchor, Brdf, Grid, TabulatedBrdf};
use vernis_metric::math::{Rgb, Vec3, seed};
use vernis_metric::metric::registry::{Registry, distances};
use vernis_metric::metric::{Metric, PreparedMetric};

const GRID: &str = "5x6x16";

fn metric(name: &str) -> Arc<dyn Metric> {
    Registry::standard().unwrap().get(name).unwrap()
}

/// All families; the kernel distances on a grid for their direct sums and on one for their lattice.
fn metrics() -> Vec<Arc<dyn Metric>> {
    let mut all = Vec::new();
    for grid in [GRID, "12x12x40"] {
        all.extend(
            ["ot", "energy", "mmd-gaussian", "mmd-laplacian"].map(|name| metric(&format!("{name}[grid={grid}]"))),
        );
    }
    all.push(metric(&format!("ot[grid={GRID},phi=log:eta=.01,accuracy=fast]")));
    all.push(metric("energy[grid=12x12x40,phi=t,alpha=1,gamma=.5]"));
    all
}

fn value(metric: &Arc<dyn Metric>, a: &dyn Brdf, b: &dyn Brdf) -> f64 {
    let found = distances(std::slice::from_ref(metric), a, b).unwrap_or_else(|e| panic!("{}: {e}", metric.name()));
    let direct = metric.distance(a, b).unwrap();
    assert_eq!(found[0].value, direct, "{}: the shared pass agrees with the metric", metric.name());
    assert!(direct.is_finite() && found[0].channels.unwrap().iter().all(|w| w.is_finite()));
    direct
}

fn ggx(alpha: f64) -> Ggx {
    Ggx::new([0.2, 0.1, 0.05], [0.04, 0.05, 0.06], alpha).unwrap()
}

/// A table on the grid of the small metrics, a value a cell (the same in all channels), with holes where it says so.
fn table(values: impl Fn(usize) -> Option<f32>) -> TabulatedBrdf {
    let grid = Grid::Standard { theta_i: 10, theta_o: 12, phi_d: 32, anchor: Anchor::Edge };
    let cells: Vec<Option<f32>> = (0..grid.len()).map(values).collect();
    let masked = cells.iter().map(Option::is_some).collect();
    TabulatedBrdf::new(grid, cells.iter().map(|v| [v.unwrap_or(f32::NAN); 3]).collect(), masked).unwrap()
}

#[test]
fn identical_is_zero_and_order_does_not_matter() {
    let blinn = BlinnPhong::new([0.1; 3], [0.2; 3], 30.0).unwrap();
    for metric in metrics() {
        assert_eq!(value(&metric, &ggx(0.3), &ggx(0.3)), 0.0, "{}", metric.name());
        let (ab, ba) = (value(&metric, &ggx(0.3), &blinn), value(&metric, &blinn, &ggx(0.3)));
        assert!(ab > 0.0 && (ab / ba - 1.0).abs() < 1e-11, "{}: {ab} {ba}", metric.name());
        let rougher = value(&metric, &ggx(0.3), &ggx(0.35));
        assert!(rougher < value(&metric, &ggx(0.3), &ggx(0.6)), "{}", metric.name());
    }
}

#[test]
fn black_constant_and_mirror_like_tables_have_finite_distances() {
    let mut rng = seed::stream(1, "test", 0);
    let noise: Vec<f32> = (0..10 * 12 * 32).map(|_| rng.random_range(0.0..1.0)).collect();
    let tables = [
        table(|_| Some(0.0)),
        table(|_| Some(0.3)),
        table(|cell| Some(noise[cell])),
        table(|cell| Some(if cell == 1900 { 1e5 } else { 0.1 })),
        table(|cell| (cell % 7 != 0).then_some(noise[cell])),
        table(|cell| (4..6).contains(&(cell / 384)).then_some(0.2)),
    ];
    for metric in metrics().iter().filter(|m| m.name().contains(GRID)) {
        for (i, a) in tables.iter().enumerate() {
            for (j, b) in tables.iter().enumerate() {
                let found = value(metric, a, b);
                assert!(i != j || found == 0.0, "{} {i}: {found}", metric.name());
            }
        }
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| metrics().iter().map(|m| value(m, &ggx(0.3), &ggx(0.4)).to_bits()).collect::<Vec<_>>())
    };
    assert_eq!(with(1), with(2));
}

/// A model whose albedo and roughness can be varied: the chain rule's example.
fn along(metric: &Arc<dyn Metric>, reference: &dyn Brdf) {
    let model = |kd: f64, alpha: f64| Ggx::new([kd, 0.1, 0.05], [0.04, 0.05, 0.06], alpha).unwrap();
    let prepared: Box<dyn PreparedMetric + '_> = metric.prepare(reference).unwrap();
    let nodes = prepared.nodes().unwrap();
    let at = |kd: f64, alpha: f64| prepared.distance(&model(kd, alpha)).unwrap();
    let values = nodes.evaluate(&model(0.25, 0.4));
    let gradient = prepared.gradient_at(&values).unwrap();
    assert_eq!(prepared.distance_at(&values).unwrap(), at(0.25, 0.4));
    assert!((gradient.value / at(0.25, 0.4) - 1.0).abs() < 1e-9);
    let step = 1e-5;
    let change = |low: Ggx, high: Ggx| {
        move |wi: Vec3, wo: Vec3| -> Rgb {
            let (a, b) = (low.eval(wi, wo).unwrap(), high.eval(wi, wo).unwrap());
            [0, 1, 2].map(|c| (b[c] - a[c]) / (2.0 * step))
        }
    };
    let kd = gradient.along(&nodes, change(model(0.25 - step, 0.4), model(0.25 + step, 0.4)));
    let difference = (at(0.25 + step, 0.4) - at(0.25 - step, 0.4)) / (2.0 * step);
    assert!((kd / difference - 1.0).abs() < 2e-3, "{}, kd: {kd} {difference}", metric.name());
    let alpha = gradient.along(&nodes, change(model(0.25, 0.4 - step), model(0.25, 0.4 + step)));
    let difference = (at(0.25, 0.4 + step) - at(0.25, 0.4 - step)) / (2.0 * step);
    assert!((alpha / difference - 1.0).abs() < 2e-3, "{}, alpha: {alpha} {difference}", metric.name());
}

#[test]
fn gradients_follow_the_chain_rule_through_a_model() {
    for name in ["energy[grid=9x9x36]", "energy[grid=14x14x40]", "mmd-gaussian[grid=9x9x36]", "ot[grid=9x9x36]"] {
        along(&metric(name), &ggx(0.3));
    }
}

#[test]
fn at_the_reference_itself_the_gradient_is_zero() {
    let metric = metric(&format!("energy[grid={GRID}]"));
    let prepared = metric.prepare(&ggx(0.3)).unwrap();
    let gradient = prepared.gradient_at(&prepared.nodes().unwrap().evaluate(&ggx(0.3))).unwrap();
    assert_eq!(gradient.value, 0.0);
    assert!(gradient.derivatives.iter().flatten().all(|d| *d == 0.0));
}

#[test]
fn wrong_options_are_named_with_what_is_allowed() {
    let registry = Registry::standard().unwrap();
    for (name, expected) in [
        ("ot[blur=0]", "blur is 0; it must be a number greater than 0"),
        ("ot[blur=-1]", "blur is -1"),
        ("ot[alpha=0]", "alpha is 0; it must be a number greater than 0"),
        ("ot[scaling=0]", "scaling is 0; it must be greater than 0 and less than 1"),
        ("ot[scaling=1]", "scaling is 1; it must be greater than 0 and less than 1"),
        ("ot[p=3]", "p is 3; it must be 1 or 2"),
        ("ot[phi=log:eta=0]", "eta is 0; it must be a number greater than 0"),
        ("energy[phi=log]", "log without eta"),
        ("energy[alpha=nan]", "alpha is nan; it must be 0.001 to 100"),
        ("energy[blur=.1]", "an option is `blur`"),
        ("mmd-gaussian[blur=0]", "blur is 0; it must be 0.001 to 1000"),
        ("energy[gama=.1]", "did you mean gamma?"),
        ("ot[grid=4x4]", "grid is `4x4`; it must be THETA_IxTHETA_OxPHI_D"),
        ("D9.Cl[alpha=1]", "D9.Cl is one metric"),
        ("enrgy", "did you mean energy"),
    ] {
        let message = registry.get(name).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(message.contains(expected), "{name}: {message}");
        assert!(!message.contains('\n'));
    }
}

#[test]
fn squares_that_need_every_cell_are_refused_on_fine_grids() {
    let error = metric("ot[alpha=1,blur=0.01]").distance(&ggx(0.3), &ggx(0.4)).unwrap_err().to_string();
    assert!(error.contains("at most 8000 cells") && error.contains("364500"), "{error}");
}

#[test]
fn tables_of_different_grids_are_refused() {
    let fine = TabulatedBrdf::tabulate(&ggx(0.3), Grid::TITOPO_HALF).unwrap();
    let coarse = table(|_| Some(0.2));
    let error = metric(&format!("ot[grid={GRID}]")).distance(&fine, &coarse).unwrap_err().to_string();
    assert!(error.contains("different grids") && error.contains("45x45x180") && error.contains("10x12x32"), "{error}");
}

#[test]
fn a_lambertian_pair_differs_by_what_theory_says() {
    // alpha so small that the graph is its values: E = mean |x - y'| - ..., by the definition on the distribution of the
    // cosines, against the metric's own value.
    let (a, b) = (Lambert::new([0.4; 3]).unwrap(), Lambert::new([0.6; 3]).unwrap());
    let metric = metric("energy[grid=8x2x8,alpha=.001,phi=t,gamma=1]");
    let cosines: Vec<f64> = (0..8).map(|i| ((f64::from(i) + 0.5) / 8.0 * std::f64::consts::FRAC_PI_2).cos()).collect();
    let mean = |f: f64, g: f64| {
        let pairs = cosines.iter().flat_map(|x| cosines.iter().map(move |y| (f * x - g * y).abs()));
        pairs.sum::<f64>() / 64.0 / std::f64::consts::PI
    };
    let expected = 3.0 * (mean(0.4, 0.6) - 0.5 * (mean(0.4, 0.4) + mean(0.6, 0.6)));
    let found = value(&metric, &a, &b);
    assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
}
