//! The experiment on optimisers: both methods make the same fits, and the report counts them right.

use std::sync::Arc;
use vernis::dataset::Study;
use vernis::experiment::optimizers::{Comparison, Course, OptimizerOptions, OptimizerRecord, optimizers};
use vernis::io::silent;
use vernis::metric::Metric;
use vernis::metric::registry::Registry;
use vernis::report;

#[test]
fn a_gradient_spares_evaluations() {
    let study = Study::load("synthetic", None).unwrap();
    let metrics: [Arc<dyn Metric>; 1] = [Registry::standard().unwrap().get("vernis-loss").unwrap()];
    let options = OptimizerOptions {
        metrics: &metrics,
        models: vec!["ggx".to_owned()],
        references: 2,
        max_evaluations: 200,
        seed: 1,
        data: None,
    };
    let record = optimizers(&study, &options, &silent).unwrap();
    assert_eq!(record.fits.len(), 2);
    for fit in &record.fits {
        assert!(fit.lbfgs.evaluations < fit.hooke_jeeves.evaluations, "{fit:?}");
        assert!(fit.lbfgs.value.is_finite() && fit.reached_after.is_none_or(|n| n <= fit.lbfgs.evaluations), "{fit:?}");
    }
}

#[test]
fn only_searches_with_gradients_are_compared() {
    let study = Study::load("synthetic", None).unwrap();
    let message = |metric: &str, model: &str| {
        let metrics: [Arc<dyn Metric>; 1] = [Registry::standard().unwrap().get(metric).unwrap()];
        let models = vec!["ggx".to_owned(), model.to_owned()];
        let options =
            OptimizerOptions { metrics: &metrics, models, references: 1, max_evaluations: 20, seed: 1, data: None };
        optimizers(&study, &options, &silent).unwrap_err().to_string()
    };
    for model in ["dupuy-ggx", "rational-legendre"] {
        let found = message("vernis-loss", model);
        assert!(
            found.starts_with(&format!("the model {model} is computed from a reference without a search")),
            "{found}"
        );
    }
    let found = message("vernis-1", "ward");
    assert!(found.contains("lbfgs needs gradients, and the metric vernis-1 has none"), "{found}");
}

#[test]
fn the_summary_counts_fits_by_model_and_over_all() {
    let fit = |model: &str, direct: (f64, usize), gradient: (f64, usize), reached_after| Comparison {
        metric: "m".into(),
        material: "a|b".into(),
        model: model.into(),
        hooke_jeeves: Course { value: direct.0, evaluations: direct.1 },
        lbfgs: Course { value: gradient.0, evaluations: gradient.1 },
        reached_after,
    };
    let record = OptimizerRecord {
        study: "s".into(),
        metrics: vec![["m".into(), "2.0".into()]],
        max_evaluations: 400,
        seed: 1,
        fits: vec![
            fit("ggx", (0.5, 200), (0.4, 40), Some(20)),
            fit("ggx", (0.5, 100), (0.504, 50), Some(50)),
            fit("ward", (0.5, 300), (0.6, 30), None),
        ],
    };
    let rows = report::optimizers::summary(&record).rows;
    assert_eq!(rows[0], ["m", "ggx", "2", "0.5000", "0.4520", "2", "150", "45", "0.30", "0.50", "1"]);
    assert_eq!(rows[1], ["m", "ward", "1", "0.5000", "0.6000", "0", "300", "30", "0.10", "never", "0"]);
    assert_eq!(rows[2], ["m", "all", "3", "0.5000", "0.5013", "2", "200", "40", "0.20", "0.50", "1"]);
    let text = report::optimizers::markdown(&record, "vernis experiment optimizers");
    assert!(text.contains(r"a\|b") && text.contains("| never |"), "{text}");
}
