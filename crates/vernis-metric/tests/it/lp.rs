//! The Lp metrics against the study's program, closed forms and the formulas written down naively; and what every
//! metric of the registry promises.

use crate::{lp_golden, naive_lp};
use proptest::prelude::*;
use rand::Rng;
use std::f64::consts::PI;
use std::sync::{Arc, LazyLock};
use vernis_metric::brdf::{Brdf, Grid, TabulatedBrdf};
use vernis_metric::math::{Rgb, Vec3, seed};
use vernis_metric::metric::lp::{Formula, LpDistances, LpMetric, LpVariant};
use vernis_metric::metric::registry::{Registry, distances};
use vernis_metric::metric::{Metric, MetricError};

/// The models of the golden values, written for this test alone.
enum Model {
    Lambert { kd: Rgb },
    Ward { kd: Rgb, ks: f64, alpha: f64 },
    BlinnPhong { kd: Rgb, ks: Rgb, n: f64 },
    Ggx { kd: Rgb, f0: f64, alpha: f64 },
}

impl Brdf for Model {
    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return Some([0.0; 3]);
        }
        let h = (wi + wo).normalized();
        let tan2 = |v: Vec3| (v.x * v.x + v.y * v.y) / (v.z * v.z);
        let (kd, specular): (&Rgb, Rgb) = match self {
            Self::Lambert { kd } => (kd, [0.0; 3]),
            Self::Ward { kd, ks, alpha } => {
                let a2 = alpha * alpha;
                (kd, [ks * (-tan2(h) / a2).exp() / (4.0 * PI * a2 * (wi.z * wo.z).sqrt()); 3])
            }
            Self::BlinnPhong { kd, ks, n } => (kd, ks.map(|ks| ks * (n + 2.0) / (2.0 * PI) * h.z.powf(*n))),
            Self::Ggx { kd, f0, alpha } => {
                let a2 = alpha * alpha;
                let d = a2 / (PI * h.z.powi(4) * (a2 + tan2(h)).powi(2));
                let f = f0 + (1.0 - f0) * (1.0 - wi.dot(h)).powi(5);
                let g = |v: Vec3| 2.0 / (1.0 + (1.0 + a2 * tan2(v)).sqrt());
                (kd, [d * f * g(wi) * g(wo) / (4.0 * wi.z * wo.z); 3])
            }
        };
        Some([0, 1, 2].map(|k| kd[k] / PI + specular[k]))
    }
}

/// Reference, candidate and the distances of the study's program.
type GoldenPair = (Model, Model, [(&'static str, f64); 36]);

fn golden_pairs() -> [GoldenPair; 3] {
    let kd = [0.1, 0.2, 0.3];
    [
        (Model::Lambert { kd: [0.5, 0.4, 0.3] }, Model::Lambert { kd: [0.45, 0.4, 0.33] }, lp_golden::LAMBERT_DARKER),
        (Model::Ggx { kd, f0: 0.04, alpha: 0.1 }, Model::Ward { kd, ks: 0.05, alpha: 0.12 }, lp_golden::GGX_VS_WARD),
        (
            Model::BlinnPhong { kd: [0.3, 0.02, 0.02], ks: [0.05, 0.05, 0.05], n: 300.0 },
            Model::BlinnPhong { kd: [0.28, 0.03, 0.02], ks: [0.06, 0.04, 0.05], n: 250.0 },
            lp_golden::BLINN_COLOUR,
        ),
    ]
}

fn tabulated(brdf: &dyn Brdf) -> TabulatedBrdf {
    TabulatedBrdf::tabulate(brdf, Grid::TITOPO).expect("the models of these tests have valid values")
}

/// Two glossy tables that are mostly holes, in different cells, with black cells and a peak of 1e5.
fn holed_tables() -> &'static (TabulatedBrdf, TabulatedBrdf) {
    static TABLES: LazyLock<(TabulatedBrdf, TabulatedBrdf)> = LazyLock::new(|| {
        const PEAK: usize = 100 * 360 + 17;
        let table = |label: &str, alpha: f64| {
            let mut rng = seed::stream(7, label, 0);
            let full = tabulated(&Model::Ggx { kd: [0.3, 0.1, 0.02], f0: 0.5, alpha });
            let mut values = full.values().to_vec();
            for value in &mut values {
                let noise: f32 = rng.random_range(0.5..2.0);
                *value = if rng.random_bool(0.01) { [0.0; 3] } else { value.map(|x| x * noise) };
            }
            values[PEAK] = [1e5, 3e4, 0.0];
            let valid = (0..values.len()).map(|cell| cell == PEAK || rng.random_bool(0.3)).collect();
            TabulatedBrdf::new(Grid::TITOPO, values, valid).expect("valid values")
        };
        (table("reference", 0.1), table("candidate", 0.15))
    });
    &TABLES
}

fn relative_error(found: f64, expected: f64) -> f64 {
    (found / expected - 1.0).abs()
}

#[test]
fn golden_values_of_the_studys_program() {
    for (reference, candidate, expected) in golden_pairs() {
        let exact = LpDistances::between(&reference, &candidate).unwrap();
        let stored = LpDistances::between(&tabulated(&reference), &tabulated(&candidate)).unwrap();
        for (name, expected) in expected {
            // f64 throughout on both sides; the largest deviation is that of opposite roundings under a cube root.
            assert!(relative_error(exact.by_name(name).unwrap(), expected) < 1e-11, "{name}");
            assert!(relative_error(stored.by_name(name).unwrap(), expected) < 1e-6, "{name}, f32 tables");
        }
        assert_eq!(exact.of_study().count(), expected.len());
    }
}

#[test]
fn masked_tables_agree_with_the_naive_formulas() {
    let (reference, candidate) = holed_tables();
    let distances = LpDistances::between(reference, candidate).unwrap();
    for variant in LpVariant::every() {
        let expected = naive_lp::distance(variant, reference, candidate);
        assert!(relative_error(distances.get(variant), expected) < 1e-12, "{variant}");
    }
    let both = |cell: usize| reference.valid()[cell] && candidate.valid()[cell];
    let cells = (0..Grid::TITOPO.len()).filter(|&cell| both(cell)).count() as u64;
    assert_eq!(distances.cells(LpVariant::new(Formula::D1, false, false)), cells);
}

#[test]
fn a_single_metric_gives_the_bits_of_the_fused_pass() {
    let (reference, candidate) = holed_tables();
    let fused = LpDistances::between(reference, candidate).unwrap();
    // Each formula in both forms; every second one is clamped.
    for (k, variant) in LpVariant::every().filter(|v| !v.clamped).enumerate() {
        let variant = LpVariant { clamped: k % 2 == 1, ..variant };
        let metric = LpMetric::new(variant);
        assert_eq!(metric.distance(reference, candidate).unwrap(), fused.get(variant), "{variant}");
    }
}

/// What a metric is prepared for is read from memory instead of evaluated; nothing else differs between metrics.
#[test]
fn a_prepared_metric_gives_the_bits_of_the_metric() {
    let (table, other) = holed_tables();
    let [_, (model, approximation, _), _] = golden_pairs();
    let pairs: [(&dyn Brdf, &dyn Brdf); 2] = [(table, other), (&model, &approximation)];
    for (reference, candidate) in pairs {
        for name in ["D9.Cl", "lab.CR"] {
            let metric = LpMetric::new(name.parse().unwrap());
            let prepared = metric.prepare(reference).unwrap();
            assert_eq!(prepared.distance(candidate).unwrap(), metric.distance(reference, candidate).unwrap(), "{name}");
        }
    }
}

#[test]
fn a_table_on_another_grid_is_looked_up() {
    let lambert = |kd: f64| Model::Lambert { kd: [kd; 3] };
    let merl = TabulatedBrdf::tabulate(&lambert(0.5), Grid::MERL).unwrap();
    let half = TabulatedBrdf::tabulate(&lambert(0.2), Grid::TITOPO_HALF).unwrap();
    let d5 = LpVariant::new(Formula::D5, false, false);
    let found = LpDistances::between(&merl, &half).unwrap().get(d5);
    // Cells of the MERL grid below the horizon are masked, the rest are constants stored as f32.
    assert!(relative_error(found, 0.9 / PI) < 1e-6);
    assert_eq!(LpMetric::new(d5).prepare(&merl).unwrap().distance(&half).unwrap(), found);
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let (reference, candidate) = holed_tables();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| LpDistances::between(reference, candidate).unwrap())
    };
    assert_eq!(with(1), with(2));
    assert_eq!(with(1), with(3));
}

#[test]
fn values_of_masked_cells_do_not_matter() {
    let (reference, candidate) = holed_tables();
    let poisoned = |table: &TabulatedBrdf| {
        let poison = |(value, valid): (&[f32; 3], &bool)| if *valid { *value } else { [f32::NAN, -1.0, f32::INFINITY] };
        let values = table.values().iter().zip(table.valid()).map(poison).collect();
        TabulatedBrdf::new(Grid::TITOPO, values, table.valid().to_vec()).unwrap()
    };
    let expected = LpDistances::between(reference, candidate).unwrap();
    assert_eq!(LpDistances::between(&poisoned(reference), &poisoned(candidate)).unwrap(), expected);
}

#[test]
fn tables_without_a_common_cell_are_refused() {
    let first = Grid::TITOPO.len() / 2;
    let half = |keep: fn(usize, usize) -> bool| {
        let valid = (0..Grid::TITOPO.len()).map(|cell| keep(cell, first)).collect();
        TabulatedBrdf::new(Grid::TITOPO, vec![[0.1; 3]; Grid::TITOPO.len()], valid).unwrap()
    };
    let (low, high) = (half(|cell, first| cell < first), half(|cell, first| cell >= first));
    let metric = LpMetric::new(LpVariant::new(Formula::D1, false, false));
    let error = MetricError::NoCommonCell { metric: "D1".to_owned() };
    assert_eq!(metric.distance(&low, &high), Err(error));
}

/// A BRDF with one bad value, at normal incidence.
struct Broken(f64);

impl Brdf for Broken {
    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        Some(if wi.z == 1.0 && wo.z == 1.0 { [0.2, self.0, 0.2] } else { [0.2; 3] })
    }
}

#[test]
fn values_that_are_no_reflectance_are_refused() {
    let good = Model::Lambert { kd: [0.5; 3] };
    for bad in [f64::NAN, f64::INFINITY, -1e-3] {
        let message = LpDistances::between(&good, &Broken(bad)).unwrap_err().to_string();
        assert!(message.starts_with("candidate: at theta_i 0, theta_o 0, phi_d 0 degrees"), "{message}");
        assert!(LpMetric::new(LpVariant::new(Formula::D1, false, false)).prepare(&Broken(bad)).is_err());
    }
}

/// Gaps in a BRDF that is not a table are masked cells.
struct Gappy;

impl Brdf for Gappy {
    fn eval(&self, wi: Vec3, _: Vec3) -> Option<Rgb> {
        (wi.z > 0.5f64.sqrt()).then_some([0.1, 0.2, 0.3])
    }
}

#[test]
fn gaps_of_an_evaluated_brdf_are_left_out() {
    let distances = LpDistances::between(&Gappy, &Model::Lambert { kd: [0.0; 3] }).unwrap();
    let d1 = LpVariant::new(Formula::D1, false, false);
    // theta_i = 0 to 44 degrees; 45 is on the edge, where the rounded cosine decides.
    let rows = distances.cells(d1) / (90 * 360);
    assert!(rows == 45 || rows == 46);
    assert!(relative_error(distances.get(d1), 0.14f64.sqrt()) < 1e-14);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4))]

    /// Between constants the sums are sums over the grid of the weights alone.
    #[test]
    fn closed_forms_between_lambertian_brdfs(a in 0.01..1.0f64, b in 0.01..1.0f64, third in 0.01..1.0f64) {
        let (kd_r, kd_a) = ([a, b, third], [third, a, b]);
        let pair = (Model::Lambert { kd: kd_r }, Model::Lambert { kd: kd_a });
        let distances = LpDistances::between(&pair.0, &pair.1).unwrap();
        let d = [0, 1, 2].map(|k| (kd_a[k] - kd_r[k]) / PI);
        let square: f64 = d.iter().map(|d| d * d).sum();
        for clamped in [false, true] {
            let get = |formula| distances.get(LpVariant::new(formula, clamped, false));
            let n = if clamped { 80 } else { 90 };
            let mean = |weight: fn(f64) -> f64| (0..n).map(|i| weight(f64::from(i).to_radians())).sum::<f64>() / f64::from(n);
            let expected = [
                (Formula::D1, square.sqrt()),
                (Formula::D2, (square * mean(|t| t.cos().powi(2))).sqrt()),
                (Formula::D3, (d.iter().map(|d| (d * d).cbrt()).sum::<f64>() * mean(|t| t.cos().powi(2).cbrt())).sqrt()),
                (Formula::D4, (square * mean(|t| t.cos() * t.sin())).sqrt()),
                (Formula::D5, d.iter().map(|d| d.abs()).sum()),
            ];
            for (formula, expected) in expected {
                prop_assert!((get(formula) - expected).abs() <= 1e-12 * expected, "{:?}", formula);
            }
        }
        let d1 = LpVariant::new(Formula::D1, false, false);
        for (found, d) in distances.channels(d1).unwrap().iter().zip(d) {
            prop_assert!((found - d.abs()).abs() <= 1e-12 * d.abs());
        }
        prop_assert!(distances.channels(LpVariant::new(Formula::D6, false, false)).is_none());
    }
}

#[test]
fn white_and_black_diffusers_are_a_hundred_lightness_steps_apart() {
    let (white, black) = (Model::Lambert { kd: [1.0; 3] }, Model::Lambert { kd: [0.0; 3] });
    let distances = LpDistances::between(&white, &black).unwrap();
    let mean_cosine = (0..90).map(|i| f64::from(i).to_radians().cos()).sum::<f64>() / 90.0;
    for name in ["lab", "lab.CR"] {
        assert!(relative_error(distances.by_name(name).unwrap(), 100.0 * mean_cosine) < 1e-12, "{name}");
    }
}

/// What every metric promises, on pairs that are hard for one or another. That a metric alone gives these numbers too is
/// tested above.
#[test]
fn contract_of_every_registered_metric() {
    let registry = Registry::standard().unwrap();
    let metrics: Vec<Arc<dyn Metric>> = registry.iter().cloned().collect();
    let values = |a: &TabulatedBrdf, b: &TabulatedBrdf| -> Vec<f64> {
        distances(&metrics, a, b).unwrap().into_iter().map(|d| d.value).collect()
    };
    let (holed, other) = holed_tables();
    let black = tabulated(&Model::Lambert { kd: [0.0; 3] });
    let mirror = tabulated(&Model::Ggx { kd: [0.0; 3], f0: 0.9, alpha: 0.001 });
    assert!(mirror.values()[0][0] > 1e4);
    for (a, b) in [(holed, other), (&black, &mirror)] {
        let (there, back, same) = (values(a, b), values(b, a), values(a, a));
        for (k, metric) in metrics.iter().enumerate() {
            let (name, properties) = (metric.name(), metric.properties());
            assert!(!properties.unit.is_empty() && !properties.summary.is_empty() && !properties.source.is_empty());
            assert!(there[k].is_finite() && there[k] >= 0.0, "{name}: {}", there[k]);
            assert_eq!(same[k], 0.0, "{name}: identity");
            assert!(!properties.symmetric || back[k] == there[k], "{name}: symmetry");
        }
    }
}

#[test]
fn many_metrics_at_once_give_the_values_of_each() {
    let registry = Registry::standard().unwrap();
    let (reference, candidate) = holed_tables();
    let mut metrics = registry.resolve("all-lp").unwrap();
    assert_eq!(metrics.len(), 36);
    metrics.insert(3, registry.get("lab.Cl").unwrap());
    metrics.insert(0, Arc::new(MeanRed));
    let found = distances(&metrics, reference, candidate).unwrap();
    for (metric, found) in metrics.iter().zip(&found).step_by(5) {
        assert_eq!(found.metric, metric.name());
        assert_eq!(found.value, metric.distance(reference, candidate).unwrap());
    }
    assert_eq!(found[0].channels, None);
    let channels = found[1].channels.unwrap();
    assert_eq!(found[1].metric, "D1");
    assert!(relative_error(channels.iter().map(|d| d * d).sum::<f64>().sqrt(), found[1].value) < 1e-14);
}

/// A metric that no library knows.
struct MeanRed;

impl Metric for MeanRed {
    fn name(&self) -> &str {
        "mean-red"
    }

    fn properties(&self) -> vernis_metric::metric::Properties {
        unreachable!("not asked for")
    }

    fn prepare<'a>(
        &'a self,
        reference: &dyn Brdf,
    ) -> Result<Box<dyn vernis_metric::metric::PreparedMetric + 'a>, MetricError> {
        Ok(Box::new(PreparedMeanRed(red(reference))))
    }
}

struct PreparedMeanRed(f64);

impl vernis_metric::metric::PreparedMetric for PreparedMeanRed {
    fn distance(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        Ok((red(candidate) - self.0).abs())
    }
}

fn red(brdf: &dyn Brdf) -> f64 {
    let up = Vec3::new(0.0, 0.0, 1.0);
    brdf.eval(up, up).map_or(0.0, |rgb| rgb[0])
}

#[test]
fn names_are_unique_and_unknown_ones_get_suggestions() {
    let mut registry = Registry::standard().unwrap();
    let names: Vec<_> = registry.names().map(str::to_owned).collect();
    let mut unique = names.clone();
    unique.sort();
    unique.dedup();
    assert_eq!(unique.len(), names.len());
    let message = registry.resolve("d9.cl").err().unwrap().to_string();
    assert!(message.contains("`d9.cl`") && message.contains("did you mean D9.Cl"), "{message}");
    assert!(registry.resolve("all_lp").err().unwrap().to_string().contains("all-lp"));
    assert!(registry.resolve("something else").err().unwrap().to_string().contains("no name is similar"));

    registry.add(Arc::new(MeanRed)).unwrap();
    assert_eq!(registry.resolve("mean-red").unwrap().len(), 1);
    assert_eq!(registry.add(Arc::new(MeanRed)), Err(MetricError::NameTaken { name: "mean-red".to_owned() }));
}
