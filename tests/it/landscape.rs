//! How metrics follow one parameter of a material: the metrics to fit with must, and the report says where others do not.

use std::sync::{Arc, LazyLock};
use vernis::brdf::Brdf;
use vernis::experiment::ExperimentError;
use vernis::experiment::landscape::record::{Answer, LandscapeRecord};
use vernis::experiment::landscape::{
    FROM_START, LandscapeOptions, METRICS, default_metrics, landscape, surface, sweeps,
};
use vernis::io::silent;
use vernis::math::Vec3;
use vernis::math::coordinates::standard_directions;
use vernis::metric::registry::Registry;
use vernis::metric::{Metric, MetricError, PreparedMetric, Properties};
use vernis::report;

/// Metrics that a person may fit with: each must grow on the way out from the reference.
const GROW: [&str; 2] = ["vernis", "vernis-loss"];

/// The root mean square difference of logarithms at a few directions: it grows along every sweep but hue, which turns back.
struct Plain {
    /// The distance is folded back above this one.
    fold: f64,
    unit: &'static str,
    name: &'static str,
}

struct Prepared {
    fold: f64,
    reference: Vec<f64>,
}

fn logarithms(brdf: &dyn Brdf) -> Vec<f64> {
    let angles = [(0.1, 0.1, 3.1), (0.3, 0.4, 0.5), (0.8, 0.8, 3.1), (1.0, 0.2, 2.0)];
    let values = angles.iter().flat_map(|(ti, to, phi)| {
        let (wi, wo): (Vec3, Vec3) = standard_directions(*ti, *to, *phi);
        brdf.eval(wi, wo).expect("a formula has values everywhere")
    });
    values.map(|value| (value + 0.01).ln()).collect()
}

impl Metric for Plain {
    fn name(&self) -> &str {
        self.name
    }

    fn version(&self) -> &str {
        "1"
    }

    fn properties(&self) -> Properties {
        Properties { unit: self.unit, ..Properties::default() }
    }

    fn prepare(&self, reference: &dyn Brdf) -> Result<Box<dyn PreparedMetric>, MetricError> {
        Ok(Box::new(Prepared { fold: self.fold, reference: logarithms(reference) }))
    }
}

impl PreparedMetric for Prepared {
    fn distance(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        let found = logarithms(candidate);
        let sum: f64 = self.reference.iter().zip(&found).map(|(a, b)| (a - b) * (a - b)).sum();
        let distance = (sum / found.len() as f64).sqrt();
        Ok(if distance > self.fold { 2.0 * self.fold - distance } else { distance })
    }

    fn loss(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        self.distance(candidate).map(|distance| distance - 0.01)
    }
}

fn metrics() -> [Arc<dyn Metric>; 2] {
    [
        Arc::new(Plain { fold: f64::INFINITY, unit: "MOS", name: "grows" }),
        Arc::new(Plain { fold: 0.2, unit: "1", name: "folds" }),
    ]
}

/// Most of its time goes into the fits: tests share one.
static RECORD: LazyLock<LandscapeRecord> = LazyLock::new(record);

fn record() -> LandscapeRecord {
    landscape(&metrics(), &LandscapeOptions { points: 6, steps: 21 }, &silent).unwrap()
}

#[test]
fn a_metric_that_turns_back_is_found_out_and_one_that_grows_is_not() {
    let record = &*RECORD;
    assert_eq!((record.sweeps.len(), record.lines.len()), (3 * 5, 3 * 6));
    for sweep in &record.sweeps {
        assert!(sweep.values.is_sorted() && sweep.values.contains(&sweep.reference), "{sweep:?}");
        assert!(sweep.values.contains(&sweep.rated.0) && sweep.values.contains(&sweep.rated.1), "{sweep:?}");
        for swept in &sweep.of_metric {
            let at = sweep.values.iter().position(|value| *value == sweep.reference).unwrap();
            assert_eq!(swept.distances[at], 0.0);
            assert_eq!((swept.down.is_some(), swept.up.is_some()), (at > 0, at + 1 < sweep.values.len()));
        }
    }
    let of = |parameter: &'static str| record.sweeps.iter().filter(move |sweep| sweep.parameter == parameter);
    for sweep in of("albedo").chain(of("f0")) {
        assert_eq!(sweep.of_metric[0].rated_fall(), 0.0);
        // Far from black the logarithm rises without end: what folds at 0.2 falls.
        assert!(sweep.of_metric[1].rated_fall() > 0.05, "{sweep:?}");
    }
    assert!(of("hue").all(|sweep| sweep.allowed == 0.15 && sweep.unit == "deg"));
}

#[test]
fn landscapes_are_those_of_the_loss_and_are_scaled_by_their_ends() {
    let record = &*RECORD;
    for line in &record.lines {
        assert_eq!(line.values.len(), 21);
        let of_start = line.name == FROM_START;
        for course in &line.of_metric {
            // The loss is lower than the distance by 0.01: at the reference, below zero.
            assert!(of_start || course.losses[line.reference] == -0.01);
            let end = if line.reference == 20 { 0 } else { 20 };
            assert_eq!(course.end, course.losses[end]);
            // What folds back may end below zero, and has no shape then.
            assert_eq!(course.scaled().map(|scaled| scaled[end]), (course.end > 0.0).then_some(1.0));
            assert_eq!((course.hollow.is_some(), course.bend.is_some()), (course.end > 0.0, course.end > 0.0));
        }
        let grows = &line.of_metric[0];
        assert!(grows.end > 0.0);
        if !of_start {
            assert_eq!(grows.lowest_at, line.values[line.reference]);
        }
        // Every value of a BRDF changes in one direction as its parts grow.
        if ["albedo", "f0", "mixing", "second lobe"].contains(&line.name.as_str()) {
            assert!(grows.hollow.unwrap() < 1e-12, "{} {}", line.material, line.name);
        }
    }
}

#[test]
fn the_report_has_verdicts_figures_and_the_same_bytes_every_time() {
    let record = &*RECORD;
    assert_eq!(*record, self::record());
    let folder = tempfile::tempdir().unwrap();
    let out = report::OutputFolder::create(folder.path()).unwrap();
    let page = std::fs::read_to_string(report::landscape::write(&out, record, "vernis experiment landscape").unwrap());
    let page = page.unwrap();
    for words in
        ["| metal, f0 | up |", "gold and silver", "grows keeps to that on all 15 sweeps", "no unit", "have no cure"]
    {
        assert!(page.contains(words), "{words} is missing in\n{page}");
    }
    let json = std::fs::read(folder.path().join("record.json")).unwrap();
    assert_eq!(serde_json::from_slice::<LandscapeRecord>(&json).unwrap(), *record);
    if cfg!(feature = "train") {
        for name in report::landscape::FIGURES {
            assert!(page.contains(&format!("![{name}]({name}.png)")));
            assert!(
                folder.path().join(format!("{name}.svg")).is_file()
                    && folder.path().join(format!("{name}.png")).is_file()
            );
        }
        assert!(page.contains("grows in points of mean opinion score (MOS); folds scaled"));
    }
}

#[test]
fn what_a_metric_refuses_is_an_answer_of_odd_pairs() {
    /// Refuses what is black.
    struct NoBlack;
    impl Metric for NoBlack {
        fn name(&self) -> &str {
            "no black"
        }
        fn version(&self) -> &str {
            "1"
        }
        fn properties(&self) -> Properties {
            Properties::default()
        }
        fn prepare(&self, reference: &dyn Brdf) -> Result<Box<dyn PreparedMetric>, MetricError> {
            let up = Vec3::new(0.0, 0.0, 1.0);
            if reference.eval(up, up) == Some([0.0; 3]) {
                return Err(MetricError::NotComputed {
                    metric: "no black".to_owned(),
                    reason: "it is black".to_owned(),
                });
            }
            Plain { fold: 9.0, unit: "1", name: "" }.prepare(reference)
        }
    }
    let metrics: [Arc<dyn Metric>; 1] = [Arc::new(NoBlack)];
    let record = landscape(&metrics, &LandscapeOptions { points: 2, steps: 5 }, &silent).unwrap();
    let refused: Vec<&str> =
        record.pairs.iter().filter(|p| matches!(p.answers[0], Answer::Refused(_))).map(|p| p.name.as_str()).collect();
    assert_eq!(refused, ["Lambert, albedo 0 and 0.01"]);
}

#[test]
fn settings_out_of_bounds_are_refused() {
    let message = |metrics: &[Arc<dyn Metric>], points, steps| {
        let found = landscape(metrics, &LandscapeOptions { points, steps }, &silent);
        match found {
            Err(error @ ExperimentError::Setting { .. }) => error.to_string(),
            other => panic!("{other:?}"),
        }
    };
    let own = metrics();
    assert!(message(&own, 6, 20).ends_with("steps of a landscape is 20; it must be an odd number of at least 5"));
    assert!(message(&own, 1, 21).ends_with("points of a sweep is 1; it must be at least 2"));
    assert!(message(&[], 6, 21).ends_with("metrics is 0; it must be at least 1"));
}

#[test]
fn the_metrics_of_the_default_are_those_that_this_build_has() {
    let registry = Registry::standard().unwrap();
    let found: Vec<String> = default_metrics(&registry).unwrap().iter().map(|m| m.name().to_owned()).collect();
    let known: Vec<&str> = METRICS.into_iter().filter(|name| registry.get(name).is_ok()).collect();
    assert_eq!(found, known);
    assert!(found.contains(&"vernis".to_owned()) && found.contains(&"D4.Cl.CR".to_owned()));
    assert!(default_metrics(&Registry::default()).is_err());
}

/// Over the range in which people rated, the distance falls by at most 0.05 MOS on the way out from the reference; by 0.15 where the
/// hue turns.
#[test]
fn the_metrics_to_fit_with_grow_on_the_way_out() {
    let registry = Registry::standard().unwrap();
    let metrics = GROW.map(|name| registry.get(name).unwrap());
    let mut falls = Vec::new();
    for sweep in sweeps(&metrics, LandscapeOptions::default().points, &silent).unwrap() {
        for (swept, name) in sweep.of_metric.iter().zip(GROW) {
            let fall = swept.rated_fall();
            if fall > sweep.allowed {
                falls.push(format!(
                    "{name}, {} of the {}: {fall:.3} MOS, allowed {}",
                    sweep.parameter, sweep.material, sweep.allowed
                ));
            }
        }
    }
    assert!(falls.is_empty(), "{}", falls.join("\n"));
    assert_eq!(surface::MATERIALS.len(), 3);
}
