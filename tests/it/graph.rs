//! The metrics on graphs through the registry: contract, gradients, notation, bad input, and the sweep.

use rand::Rng;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use vernis::brdf::models::{BlinnPhong, Ggx, Lambert};
use vernis::brdf::{Anchor, Brdf, Grid, TabulatedBrdf};
use vernis::dataset::{Study, synthetic};
use vernis::evaluation::EvaluationError;
use vernis::evaluation::sweep::{
    Combination, CombinationRecord, Family, Outcome, PairOutcome, Setting, StudyTables, SweepProtocol, compute, groups,
    judge,
};
use vernis::math::{Rgb, Vec3, seed};
use vernis::metric::registry::{Registry, distances};
use vernis::metric::{Metric, PreparedMetric};

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
    let differentiable = prepared.as_differentiable().unwrap();
    let at = |kd: f64, alpha: f64| prepared.distance(&model(kd, alpha)).unwrap();
    let gradient = differentiable.gradient(&model(0.25, 0.4)).unwrap();
    assert!((gradient.value / at(0.25, 0.4) - 1.0).abs() < 1e-9);
    let step = 1e-5;
    let change = |low: Ggx, high: Ggx| {
        move |wi: Vec3, wo: Vec3| -> Rgb {
            let (a, b) = (low.eval(wi, wo).unwrap(), high.eval(wi, wo).unwrap());
            [0, 1, 2].map(|c| (b[c] - a[c]) / (2.0 * step))
        }
    };
    let kd = gradient.along(change(model(0.25 - step, 0.4), model(0.25 + step, 0.4)));
    let difference = (at(0.25 + step, 0.4) - at(0.25 - step, 0.4)) / (2.0 * step);
    assert!((kd / difference - 1.0).abs() < 2e-3, "{}, kd: {kd} {difference}", metric.name());
    let alpha = gradient.along(change(model(0.25, 0.4 - step), model(0.25, 0.4 + step)));
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
    let gradient = prepared.as_differentiable().unwrap().gradient(&ggx(0.3)).unwrap();
    assert_eq!(gradient.value, 0.0);
    assert!(gradient.derivatives.iter().flatten().all(|d| *d == 0.0));
}

#[test]
fn wrong_options_are_named_with_what_is_allowed() {
    let registry = Registry::standard().unwrap();
    for (name, expected) in [
        ("ot[blur=0]", "blur: found 0, allowed: a number above 0"),
        ("ot[blur=-1]", "found -1"),
        ("ot[alpha=0]", "alpha: found 0, allowed: a number above 0"),
        ("ot[scaling=0]", "scaling: found 0, allowed: above 0, below 1"),
        ("ot[scaling=1]", "found 1, allowed: above 0, below 1"),
        ("ot[p=3]", "p: found 3, allowed: 1 or 2"),
        ("ot[phi=log:eta=0]", "eta: found 0, allowed: a number above 0"),
        ("energy[phi=log]", "log without eta"),
        ("energy[alpha=nan]", "alpha: found nan, allowed: 0.001 to 100"),
        ("energy[blur=.1]", "the option `blur`"),
        ("mmd-gaussian[blur=0]", "blur: found 0, allowed: 0.001 to 1000"),
        ("energy[gama=.1]", "similar: gamma"),
        ("ot[grid=4x4]", "grid: found 4x4, allowed: THETA_IxTHETA_OxPHI_D"),
        ("D9.Cl[alpha=1]", "D9.Cl is one metric"),
        ("enrgy", "similar: energy"),
    ] {
        let message = registry.get(name).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(message.contains(expected), "{name}: {message}");
        assert!(!message.contains('\n'));
    }
    let error = metric("ot[p=1]").distance(&ggx(0.3), &ggx(0.4)).unwrap_err().to_string();
    assert!(error.contains("13500") && error.contains("364500"), "{error}");
}

#[test]
fn tables_of_different_grids_are_refused() {
    let fine = TabulatedBrdf::tabulate(&ggx(0.3), Grid::TITOPO_HALF).unwrap();
    let coarse = table(|_| Some(0.2));
    let error = metric(&format!("ot[grid={GRID}]")).distance(&fine, &coarse).unwrap_err().to_string();
    assert!(error.contains("different grids") && error.contains("45x45x180") && error.contains("10x12x32"), "{error}");
}

#[test]
fn a_sweep_records_what_it_found_and_takes_it_up_again() {
    let study = Study { pairs: synthetic_pairs(), ..Study::load(synthetic::NAME, None).unwrap() };
    let grid = "3x3x8".parse().unwrap();
    let tables = StudyTables::of(&study, grid, None, usize::MAX, &|_, _| {}).unwrap();
    let without_memory = StudyTables::of(&study, grid, None, 0, &|_, _| {}).unwrap();
    let registry = Registry::standard().unwrap();
    let setting = Setting::new("3x3x8", "standard", &study);
    let all = Combination::of_study();
    let pick = |name: &str| *all.iter().find(|c| c.to_string() == name).unwrap();
    let combinations = [
        pick("ot[p=2,alpha=0.1,blur=0.05,scaling=0.8,phi=t^1/4]"),
        pick("ot[p=1,alpha=0.1,blur=0.1,scaling=0.8,phi=t^1/4]"),
        pick("energy[alpha=0.1,phi=t^1/3]"),
        pick("energy[alpha=1,phi=log:eta=0.01]"),
    ];
    let mut outcomes = Vec::new();
    for combination in combinations {
        let outcome_on = |tables: &StudyTables| {
            let found = compute(&[combination], &setting, &registry, tables, &BTreeMap::new(), &forget);
            found.unwrap().remove(0)
        };
        let outcome = outcome_on(&tables);
        assert_eq!(outcome, outcome_on(&without_memory));
        let record = CombinationRecord::new(&combination, &setting, outcome.clone());
        let bytes = serde_json::to_vec(&record).unwrap();
        let pairs = study.pairs.len();
        let read = |bytes: &[u8], of: &Combination, setting: &Setting, pairs| {
            CombinationRecord::outcome_of(bytes, of, setting, pairs)
        };
        assert_eq!(read(&bytes, &combination, &setting, pairs), Some(outcome.clone()));
        // Half a file, another study, grid, accuracy, combination, another number of pairs: computed again.
        assert_eq!(read(&bytes[..bytes.len() / 2], &combination, &setting, pairs), None);
        let whole = Study::load(synthetic::NAME, None).unwrap();
        let fewer = Study { pairs: whole.pairs[1..].to_vec(), ..whole };
        for other in [("3x3x8", "standard", &fewer), ("3x3x9", "standard", &study), ("3x3x8", "fast", &study)] {
            assert_eq!(read(&bytes, &combination, &Setting::new(other.0, other.1, other.2), pairs), None);
        }
        assert_eq!(read(&bytes, &all[77], &setting, pairs), None);
        assert_eq!(read(&bytes, &combination, &setting, pairs + 1), None);
        outcomes.push((combination, outcome));
    }
    outcomes.push((all[0], Outcome::Refused { reason: "a test".into() }));
    let rows: Vec<_> = study.pairs.iter().map(|p| p.row()).collect();
    let protocol = SweepProtocol { folds: 4, resamples: 60, seed: 1 };
    let record = judge("synthetic", &setting, &rows, &outcomes, protocol).unwrap();
    assert_eq!((record.in_sample.len(), record.nested.len(), record.refused.len()), (12, 3, 1));
    assert!(record.in_sample.is_sorted_by(|a, b| a.plcc.value >= b.plcc.value));
    // A power changes no rank; choosing out of sample cannot beat the best in sample by much.
    let srocc = |name: &str| record.in_sample.iter().find(|r| r.name == name).unwrap().srocc.value;
    let name = |gamma: f64| outcomes[0].0.with_gamma(gamma);
    assert_eq!(srocc(&name(0.25)), srocc(&name(0.5)));
    assert!(record.nested.iter().all(|row| row.plcc.value <= record.in_sample[0].plcc.value + 0.01));
    assert_eq!(all.iter().filter(|c| c.family() == Family::Energy).count(), 32);
}

/// Keeps no journal.
fn forget(_: usize, _: &PairOutcome) -> Result<(), EvaluationError> {
    Ok(())
}

#[test]
fn combinations_of_a_group_give_what_each_gives_alone() {
    let study = Study { pairs: synthetic_pairs(), ..Study::load(synthetic::NAME, None).unwrap() };
    // Fine enough for the quantised method at coarse accuracy.
    let setting = Setting::new("9x9x36", "coarse", &study);
    let tables = StudyTables::of(&study, "9x9x36".parse().unwrap(), None, usize::MAX, &|_, _| {}).unwrap();
    let registry = Registry::standard().unwrap();
    let chosen = |c: &&Combination| {
        c.to_string().starts_with("ot[p=2,alpha=0.05,blur=0.1,") && c.to_string().ends_with("phi=t]")
    };
    let group: Vec<Combination> = Combination::of_study().iter().filter(chosen).copied().collect();
    assert_eq!((groups(&group), group.len()), (vec![group.clone()], 4));
    let seen = Mutex::new(BTreeMap::new());
    let keep = |index: usize, found: &PairOutcome| -> Result<(), EvaluationError> {
        seen.lock().unwrap().insert(index, found.clone());
        Ok(())
    };
    let together = compute(&group, &setting, &registry, &tables, &BTreeMap::new(), &keep).unwrap();
    for (combination, expected) in group.iter().zip(&together) {
        let alone = compute(&[*combination], &setting, &registry, &tables, &BTreeMap::new(), &forget).unwrap();
        assert_eq!(alone[0], *expected);
    }
    // Half of the pairs known: the same, and only the others are computed.
    let mut known = seen.into_inner().unwrap();
    assert_eq!(known.len(), study.pairs.len());
    known.retain(|index, _| index % 2 == 0);
    let again = Mutex::new(0);
    let count = |index: usize, _: &PairOutcome| -> Result<(), EvaluationError> {
        assert_eq!(index % 2, 1);
        *again.lock().unwrap() += 1;
        Ok(())
    };
    assert_eq!(compute(&group, &setting, &registry, &tables, &known, &count).unwrap(), together);
    assert_eq!(*again.lock().unwrap(), study.pairs.len() / 2);
    // What the caller cannot keep ends the work.
    let full =
        |_: usize, _: &PairOutcome| Err(EvaluationError::TooFew { what: "bytes of a full disk", found: 0, least: 1 });
    assert!(compute(&group, &setting, &registry, &tables, &BTreeMap::new(), &full).is_err());
}

/// Every candidate of a dozen materials.
fn synthetic_pairs() -> Vec<vernis::dataset::RatedPair> {
    let study = Study::load(synthetic::NAME, None).unwrap();
    let mut materials: Vec<String> = study.pairs.iter().map(|p| p.material.clone()).collect();
    materials.dedup();
    materials.truncate(12);
    study.pairs.into_iter().filter(|p| materials.contains(&p.material)).collect()
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
