//! Fits: known parameters are found again, published fits are not better, bad input is refused, files come back.
//!
//! Tests of published data take its folder from `VERNIS_DATA`.

use crate::data_folder;
use vernis_metric::brdf::models::build;
use vernis_metric::brdf::{Brdf, BrdfSource, Grid, TabulatedBrdf};
use vernis_metric::fit::loss::{Loss, LpLoss, MetricLoss};
use vernis_metric::fit::optimizer::{Method, StopReason};
use vernis_metric::fit::{FitError, Fitted, Fitting, Start};
use vernis_metric::math::coordinates::standard_directions;
use vernis_metric::metric::learned::LearnedMetric;
use vernis_metric::metric::registry::Registry;
use vernis_metric::metric::{Metric, MetricError, PreparedMetric, Properties, Side};

/// A model on a small table in half/difference coordinates.
fn table(model: &str, p: &[f64]) -> TabulatedBrdf {
    let brdf = build(model, p).expect("within bounds");
    let grid = Grid::HalfDifference { theta_h: 90, theta_d: 45, phi_d: 60 };
    TabulatedBrdf::tabulate(&*brdf, grid).expect("a table")
}

fn metric(name: &str) -> std::sync::Arc<dyn Metric> {
    Registry::standard().expect("a registry").get(name).expect("a metric")
}

fn fit(fitting: &Fitting<'_>, reference: &dyn Brdf) -> Fitted {
    fitting.run(reference, &|_, _| ()).expect("a fit")
}

/// The largest relative difference between parameters.
fn difference(fitted: &Fitted, expected: &[f64]) -> f64 {
    let pairs = fitted.model.parameters().into_iter().zip(expected);
    pairs.map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max)
}

const GGX: [f64; 7] = [0.25, 0.12, 0.05, 0.06, 0.08, 0.04, 0.22];
const WARD: [f64; 7] = [0.3, 0.2, 0.1, 0.05, 0.06, 0.08, 0.18];
const BLINN_PHONG: [f64; 7] = [0.1, 0.2, 0.3, 0.1, 0.12, 0.15, 60.0];

#[test]
fn what_made_a_reference_is_found_again() {
    let ggx = Method::ALL.map(|method| ("ggx", &GGX, "D9.Cl", method));
    let others =
        [("ward-duer", &WARD, "D4.Cl", Method::HookeJeeves), ("blinn-phong", &BLINN_PHONG, "D4.Cl", Method::Lbfgs)];
    for (model, expected, name, method) in ggx.into_iter().chain(others) {
        let reference = build(model, expected).expect("within bounds");
        let metric = metric(name);
        let fitted = fit(&Fitting { coarsening: 6, method, ..Fitting::new(model, &*metric) }, &*reference);
        assert!(fitted.stop.is_success(), "{model} {name} {method}: {:?}", fitted.stop);
        assert!(fitted.value < fitted.value_at_start, "{model} {name} {method}");
        let worst = difference(&fitted, expected);
        assert!(worst < 0.01, "{model} {name} {method}: {worst} {:?}", fitted.model.parameters());
    }
}

/// A table's cells are wide: what made it is found within their width.
#[test]
fn what_made_a_table_is_found_within_its_cells() {
    let reference = table("ggx", &GGX);
    let metric = metric("D9.Cl");
    let fitted = fit(&Fitting::new("ggx", &*metric), &reference);
    assert!(difference(&fitted, &GGX) < 0.05, "{:?}", fitted.model.parameters());
    // The value is the metric's own.
    let expected = metric.distance(&reference, &*fitted.model as &dyn Brdf).expect("a distance");
    assert!((fitted.value / expected - 1.0).abs() < 1e-9, "{} {expected}", fitted.value);
}

#[test]
fn transport_finds_the_parameters_with_and_without_its_gradient() {
    let reference = build("blinn-phong", &BLINN_PHONG).expect("within bounds");
    let metric = metric("ot[grid=5x5x16]");
    let near: Vec<f64> = BLINN_PHONG.iter().map(|p| 1.3 * p).collect();
    for method in [Method::Lbfgs, Method::HookeJeeves] {
        let start = Some(Start::Parameters(near.clone()));
        let fitted = fit(&Fitting { start, method, ..Fitting::new("blinn-phong", &*metric) }, &*reference);
        assert!(difference(&fitted, &BLINN_PHONG) < 0.05, "{method}: {:?}", fitted.model.parameters());
        assert!(fitted.value < 0.2 * fitted.value_at_start, "{} {}", fitted.value, fitted.value_at_start);
    }
}

#[test]
fn more_starts_are_no_worse_and_the_same_seed_gives_the_same_fit() {
    let reference = table("ward-duer", &WARD);
    let metric = metric("D4.Cl");
    let fitting = Fitting { coarsening: 6, ..Fitting::new("blinn-phong", &*metric) };
    let one = fit(&fitting, &reference);
    let many = fit(&Fitting { starts: 4, ..fitting.clone() }, &reference);
    let again = fit(&Fitting { starts: 4, ..fitting }, &reference);
    assert!(many.value <= one.value * (1.0 + 1e-3), "{} {}", many.value, one.value);
    assert_eq!(many.model.parameters(), again.model.parameters());
    assert!(many.evaluations > one.evaluations);
}

/// Along lines through the fit under the logarithm, its loss has one hollow. So has the learned one, here, at steps of 6 %;
/// elsewhere it may have more.
#[test]
fn landscapes_along_lines_through_the_fit_under_the_logarithm() {
    let learned = LearnedMetric::shipped().expect("the shipped metric");
    let reference = table("ward-duer", &WARD);
    let log = LpLoss::new(&reference, "D9.Cl".parse().expect("a name"), 6).expect("valid").expect("no colours");
    let loss = MetricLoss::new(&learned, &reference).expect("valid");
    let metric = metric("D9.Cl");
    let best = fit(&Fitting { coarsening: 6, ..Fitting::new("ggx", &*metric) }, &reference).model.parameters();
    let hollows = |loss: &dyn Loss, k: usize| {
        let at = |step: i32| {
            let mut p = best.clone();
            p[k] = (p[k] * (0.06 * f64::from(step)).exp()).clamp(1e-3, 1.0);
            loss.value(&*build("ggx", &p).expect("within bounds")).expect("a value")
        };
        let values: Vec<f64> = (-12..=12).map(at).collect();
        assert!(values.iter().all(|v| v.is_finite()));
        values.windows(3).filter(|w| w[1] < w[0] && w[1] < w[2]).count()
    };
    let along = |loss: &dyn Loss| -> Vec<usize> { [0, 3, 6].map(|k| hollows(loss, k)).to_vec() };
    let (of_log, of_learned) = (along(&log), along(&loss));
    println!("hollows along kd.r, f0.r, alpha: logarithm {of_log:?}, learned {of_learned:?}");
    assert_eq!(of_log, [1, 1, 1]);
    assert!(of_learned.iter().all(|n| (1..=3).contains(n)), "{of_learned:?}");
}

/// The metric itself is cut off at zero; the loss is not, and agrees where the metric is above. Moduli are rounded off in the loss of
/// version 2, which makes it a little lower.
#[test]
fn the_learned_loss_is_the_distance_before_it_is_cut_off() {
    let reference = table("ward-duer", &WARD);
    for (name, rounding) in [("vernis-1", 0.0), ("vernis", 0.1), ("vernis-loss", 0.1)] {
        let learned = metric(name);
        let loss = MetricLoss::new(&*learned, &reference).expect("valid");
        for alpha in [0.05, 0.12, 0.18, 0.3] {
            let candidate = build("ward-duer", &[0.3, 0.2, 0.1, 0.05, 0.06, 0.08, alpha]).expect("within bounds");
            let found = loss.value(&*candidate).expect("a value");
            let distance = learned.distance(&reference, &*candidate).expect("a distance");
            let below = distance - found.max(0.0);
            assert!((0.0..=rounding).contains(&below), "{name} {alpha}: {found} {distance}");
        }
    }
}

#[test]
fn a_fit_under_the_learned_metric_is_better_under_it_than_the_log_fit() {
    let reference = table("ward-duer", &WARD);
    let (log, learned) = (metric("D9.Cl"), metric("vernis"));
    let of_log = fit(&Fitting::new("ggx", &*log), &reference);
    let of_learned = fit(&Fitting { max_evaluations: Some(150), ..Fitting::new("ggx", &*learned) }, &reference);
    let under = |fitted: &Fitted| learned.distance(&reference, &*fitted.model as &dyn Brdf).expect("a distance");
    assert!(under(&of_learned) < under(&of_log), "{} {}", under(&of_learned), under(&of_log));
    assert_eq!(of_learned.start, "log");
}

/// Under a metric that lets itself be let in by degrees every start is searched from, and the best result is kept.
#[test]
fn all_starts_count_under_a_learned_metric() {
    let reference = table("ward-duer", &WARD);
    let learned = metric("vernis");
    let fitting = Fitting { max_evaluations: Some(40), coarsening: 6, ..Fitting::new("ggx", &*learned) };
    let one = fit(&fitting, &reference);
    let many = Fitting { starts: 4, ..fitting.clone() };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| fit(&many, &reference))
    };
    let (four, again) = (on(4), on(1));
    assert!(four.value <= one.value, "{} {}", four.value, one.value);
    assert!(four.evaluations >= one.evaluations + 3 * 20, "{} {}", four.evaluations, one.evaluations);
    assert_eq!((four.model.parameters(), four.value), (again.model.parameters(), again.value));
    // A start that is worse than the log fit is no result.
    for start in [Start::Log, Start::LogAtOnce] {
        let fitted = fit(&Fitting { start: Some(start), max_evaluations: Some(10), ..fitting.clone() }, &reference);
        assert!(fitted.value <= fitted.value_at_start, "{} {}", fitted.value, fitted.value_at_start);
    }
}

/// Fits under D9.Cl that several fits share give what each would find alone; those of another model are refused.
#[test]
fn fits_under_the_logarithm_can_be_shared() {
    let reference = table("ward-duer", &WARD);
    let learned = metric("vernis");
    let fitting = Fitting { max_evaluations: Some(30), coarsening: 9, ..Fitting::new("ggx", &*learned) };
    let log_fits = fitting.log_fits(&reference).expect("fits");
    for start in [Start::Log, Start::LogAtOnce] {
        let alone = Fitting { start: Some(start), ..fitting.clone() };
        let shared = Fitting { log_fits: Some(&log_fits), ..alone.clone() };
        let (alone, shared) = (fit(&alone, &reference), fit(&shared, &reference));
        assert_eq!(alone.model.parameters(), shared.model.parameters());
        assert_eq!((alone.value, alone.evaluations), (shared.value, shared.evaluations));
    }
    let other = Fitting { model: "ward-duer", log_fits: Some(&log_fits), ..fitting };
    let Err(error) = other.run(&reference, &|_, _| ()) else { panic!("fits of another model") };
    assert_eq!(
        error.to_string(),
        "log-fits is of ggx, coarsening 9, 1 starts; it must be of ward-duer, coarsening 9, 1 starts"
    );
}

/// With many parameters the staged start is not enough: the search begins at a log fit too, which can be shared.
#[test]
fn fits_of_many_parameters_begin_at_a_log_fit_as_well() {
    let reference = table("ward-duer", &WARD);
    let (learned, rough) = (metric("vernis-loss"), metric("vernis"));
    let needs = |model, metric| Fitting::new(model, metric).needs_log_fits().expect("a model");
    assert!(needs("principled", &*learned) && needs("ggx", &*rough));
    assert!(!needs("ggx", &*learned) && !needs("principled", &*metric("D9.Cl")));
    let fitting = Fitting { max_evaluations: Some(30), coarsening: 15, ..Fitting::new("principled", &*learned) };
    let log_fits = fitting.log_fits(&reference).expect("fits");
    let alone = fit(&fitting, &reference);
    let shared = fit(&Fitting { log_fits: Some(&log_fits), ..fitting }, &reference);
    assert_eq!(alone.model.parameters(), shared.model.parameters());
    assert_eq!((alone.loss, alone.evaluations), (shared.loss, shared.evaluations));
}

/// The distance of another metric, refused with a given error for candidates whose highlight is brighter than the reference's.
struct Refusing {
    inner: std::sync::Arc<dyn Metric>,
    error: MetricError,
}

struct RefusingPrepared {
    inner: Box<dyn PreparedMetric>,
    brightest: f64,
    error: MetricError,
}

fn highlight(brdf: &dyn Brdf) -> f64 {
    let (wi, wo) = standard_directions(0.1, 0.1, std::f64::consts::PI);
    brdf.eval(wi, wo).map_or(0.0, |f| f[0])
}

impl Metric for Refusing {
    fn name(&self) -> &str {
        "refusing"
    }

    fn version(&self) -> &str {
        "1"
    }

    fn properties(&self) -> Properties {
        Properties { usable_as_loss: true, ..Properties::default() }
    }

    fn prepare(&self, reference: &dyn Brdf) -> Result<Box<dyn PreparedMetric>, MetricError> {
        let (inner, error) = (self.inner.prepare(reference)?, self.error.clone());
        Ok(Box::new(RefusingPrepared { inner, brightest: highlight(reference), error }))
    }
}

impl PreparedMetric for RefusingPrepared {
    fn distance(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        if highlight(candidate) > self.brightest { Err(self.error.clone()) } else { self.inner.distance(candidate) }
    }
}

/// A search turns round where the metric refuses a candidate for its values, whatever the words; any other refusal ends it.
#[test]
fn a_candidate_that_the_metric_refuses_for_its_values_is_infinitely_bad() {
    let reference = table("ggx", &GGX);
    let inner = metric("energy[grid=4x4x8]");
    let text = || "no reason".to_owned();
    let about_values = [
        MetricError::Unusable { side: Side::Candidate, reason: text() },
        MetricError::Unusable { side: Side::Pair, reason: text() },
        MetricError::TooWide { metric: text(), side: Side::Candidate, reason: text() },
        MetricError::TooWide { metric: text(), side: Side::Pair, reason: text() },
        MetricError::NoValidCell { side: Side::Candidate },
        MetricError::NotFinite { metric: text(), value: f64::NAN },
    ];
    let others = [
        MetricError::Unusable { side: Side::Reference, reason: "the candidate".to_owned() },
        MetricError::TooWide { metric: text(), side: Side::Reference, reason: text() },
        MetricError::NotComputed { metric: text(), reason: "the candidate".to_owned() },
        MetricError::NoCommonCell { metric: text() },
    ];
    let run = |error: &MetricError| {
        let metric = Refusing { inner: inner.clone(), error: error.clone() };
        Fitting { max_evaluations: Some(60), coarsening: 9, ..Fitting::new("ggx", &metric) }.run(&reference, &|_, _| ())
    };
    for error in about_values {
        assert!(error.is_about_candidate_values(), "{error:?}");
        let fitted = run(&error).unwrap_or_else(|e| panic!("{error:?}: {e}"));
        assert!(fitted.value.is_finite());
    }
    for error in others {
        assert!(!error.is_about_candidate_values(), "{error:?}");
        assert_eq!(run(&error).err().expect("it ends").to_string(), error.to_string());
    }
}

/// Transport itself: a candidate whose graph spreads too far for its nodes is told from one that it cannot compare at all.
#[test]
fn a_graph_that_spreads_too_far_is_about_the_candidate() {
    // Values that are not compressed have value nodes of their own, cell by cell, in a bright lobe.
    let metric = metric("ot[alpha=0.1,blur=0.01,phi=t,accuracy=fast]");
    let reference = build("lambert", &[0.5; 3]).expect("within bounds");
    let bright = build("ggx", &[0.5, 0.5, 0.5, 1.0, 1.0, 1.0, 0.05]).expect("within bounds");
    let error = metric.distance(&*reference, &*bright).expect_err("too many nodes");
    assert!(matches!(error, MetricError::TooWide { side: Side::Candidate, .. }), "{error:?}");
    assert!(
        error.is_about_candidate_values() && error.to_string().contains("nodes; it must take at most"),
        "{error:?}"
    );
    let error = metric.distance(&*bright, &*reference).expect_err("too many nodes");
    assert!(matches!(error, MetricError::TooWide { side: Side::Reference, .. }), "{error:?}");
    assert!(!error.is_about_candidate_values(), "{error:?}");
}

/// An interrupted fit gives the best of what it has, at every stage.
#[test]
fn an_interrupted_fit_gives_its_best_so_far() {
    let reference = table("ward-duer", &WARD);
    for (name, after) in [("D4.Cl", 0), ("D4.Cl", 3), ("D4.Cl", 60), ("vernis", 0), ("vernis", 30)] {
        let metric = metric(name);
        let fitting = Fitting { coarsening: 6, starts: 2, ..Fitting::new("ggx", &*metric) };
        let count = std::sync::atomic::AtomicUsize::new(0);
        let watch = |_: &str, _| {
            if count.fetch_add(1, std::sync::atomic::Ordering::Relaxed) >= after {
                fitting.interrupt.raise();
            }
        };
        let fitted = fitting.run(&reference, &watch).expect("the best so far");
        assert_eq!(fitted.stop, StopReason::Interrupted, "{name} {after}");
        assert!(fitted.value.is_finite() && fitted.value <= fitted.value_at_start, "{name} {after}");
        assert!(count.into_inner() < after + 200, "{name} {after}");
    }
}

/// What of a reference is no reflectance leaves nothing to fit, and nothing to converge to.
#[test]
fn a_loss_that_no_parameter_changes_is_flat() {
    let good = table("ggx", &GGX);
    let mut values = good.values().to_vec();
    let middle = values.len() / 2;
    values[middle..middle + 180].fill([1e30; 3]);
    let spoilt = TabulatedBrdf::new(good.grid(), values, good.valid().to_vec()).expect("a table");
    for (method, name) in Method::ALL.into_iter().zip(["D4.Cl", "D3.Cl", "D4.Cl"]) {
        let metric = metric(name);
        let fitted = fit(&Fitting { coarsening: 9, method, ..Fitting::new("ggx", &*metric) }, &spoilt);
        assert_eq!(fitted.stop, StopReason::Flat, "{method} {name}: {} {}", fitted.value_at_start, fitted.value);
    }
    // From a minimum nothing moves, which is another matter.
    let metric = metric("D4.Cl");
    let found = fit(&Fitting { coarsening: 9, ..Fitting::new("ggx", &*metric) }, &good);
    assert_eq!(found.stop, StopReason::Converged);
}

#[test]
fn a_search_that_ends_early_keeps_its_best() {
    let reference = table("ggx", &GGX);
    let metric = metric("D9.Cl");
    let fitted = fit(&Fitting { max_evaluations: Some(20), ..Fitting::new("ward", &*metric) }, &reference);
    assert_eq!(fitted.stop, StopReason::EvaluationLimit);
    assert!(fitted.value <= fitted.value_at_start);
}

#[test]
fn what_cannot_be_fitted_says_why() {
    let reference = table("ggx", &GGX);
    let refused = |fitting: &Fitting<'_>, reference: &dyn Brdf| -> FitError {
        fitting.run(reference, &|_, _| ()).err().expect("a mistake")
    };
    let (d4, d6, first) = (metric("D4.Cl"), metric("D6"), metric("vernis-1"));
    let error = refused(&Fitting::new("ggxx", &*d4), &reference).to_string();
    assert!(error.starts_with("unknown model `ggxx`; did you mean ggx"), "{error}");
    let error = refused(&Fitting::new("ggx", &*d6), &reference).to_string();
    assert_eq!(error, "metric is D6; it must be a metric without jumps, and D6 has jumps");
    let lbfgs = |model, metric| Fitting { method: Method::Lbfgs, ..Fitting::new(model, metric) };
    let error = refused(&lbfgs("ggx", &*first), &reference).to_string();
    assert!(error.contains("the metric vernis-1 has none"), "{error}");
    let error = refused(&Fitting { starts: 0, ..Fitting::new("ggx", &*d4) }, &reference).to_string();
    assert_eq!(error, "starts is 0; it must be 1 to 1000");
    let error = refused(&Fitting { coarsening: 16, ..Fitting::new("ggx", &*d4) }, &reference).to_string();
    assert!(error.starts_with("coarsening is 16; it must be 1 to 15"), "{error}");
    let outside = Fitting { start: Some(Start::Parameters(vec![2.0; 7])), ..Fitting::new("ggx", &*d4) };
    assert!(refused(&outside, &reference).to_string().contains("ggx: kd.r is 2; it must be 0 to 1"));
    assert!("newton".parse::<Method>().unwrap_err().to_string().contains("hooke-jeeves, nelder-mead, lbfgs"));
}

/// One measured cell beyond 80 degrees, where clamped metrics do not look.
#[test]
fn a_reference_without_a_valid_cell_is_refused() {
    let mut valid = vec![false; Grid::TITOPO_HALF.len()];
    *valid.last_mut().expect("cells") = true;
    let values = vec![[1.0; 3]; valid.len()];
    let reference = TabulatedBrdf::new(Grid::TITOPO_HALF, values, valid).expect("a table");
    let error = Fitting::new("ggx", &*metric("D4.Cl")).run(&reference, &|_, _| ()).err().expect("nothing to fit");
    assert_eq!(error.to_string(), "reference: the BRDF has no valid cell on the grid of the metric");
}

/// Ngan's fits (`ngan_wardduer.fit`, `ngan_blinnphong.fit`) were made under another loss: under D4.Cl ours are at least as good.
#[test_with::env(VERNIS_DATA)]
#[test]
fn published_fits_are_not_better_under_our_loss() {
    let data = data_folder();
    let open = |notation: &str| BrdfSource::parse(notation).expect("valid").open(Some(&data)).expect("present").brdf;
    let metric = metric("D4.Cl");
    for material in ["teflon", "blue-acrylic"] {
        let reference = open(&format!("merl_nbrdf.zip:{material}"));
        for (file, model) in [("ngan_wardduer.fit", "ward-duer"), ("ngan_blinnphong.fit", "blinn-phong")] {
            let published = metric.distance(&*reference, &*open(&format!("{file}:{material}"))).expect("a distance");
            let ours = fit(&Fitting::new(model, &*metric), &*reference);
            println!("{material} {model}: published {published:.5}, ours {:.5}", ours.value);
            assert!(ours.value <= published, "{material} {model}: {} {published}", ours.value);
        }
    }
}
