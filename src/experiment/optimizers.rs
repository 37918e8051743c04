//! What does a gradient spare? The same fits by Hooke-Jeeves and by L-BFGS, under metrics that have a gradient.
//!
//! Every fit begins at the staged start, under the metric itself, so that both methods count evaluations of the same function. An
//! evaluation of L-BFGS is a value with its gradient. Two counts are told: those that the method spent, and those after which L-BFGS
//! was as low as the result of Hooke-Jeeves. Cost: references x models x metrics x two fits of some seconds each.

use super::ExperimentError;
use super::losses::run::materials;
use crate::dataset::Study;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;
use vernis_metric::brdf::BrdfSource;
use vernis_metric::fit::direct::is_direct;
use vernis_metric::fit::optimizer::Method;
use vernis_metric::fit::{Fitted, Fitting, Start};
use vernis_metric::io::{Count, Observer};
use vernis_metric::metric::Metric;

/// A result of L-BFGS that is above that of Hooke-Jeeves by less than this counts as the same, in the unit of the metric (for learned
/// metrics points of mean opinion score: far below what anybody sees).
pub const SAME: f64 = 0.005;

/// What is compared.
pub struct OptimizerOptions<'a> {
    /// The losses; each has a gradient.
    pub metrics: &'a [Arc<dyn Metric>],
    /// Identifiers of the models.
    pub models: Vec<String>,
    /// References of the study, one of each group of sisters.
    pub references: usize,
    /// Of each search.
    pub max_evaluations: usize,
    /// Of the order of the references.
    pub seed: u64,
    /// Folder that relative sources are looked up in.
    pub data: Option<&'a Path>,
}

/// How one method fared.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Course {
    /// What was minimised, at the end.
    pub value: f64,
    /// Evaluations of the search.
    pub evaluations: usize,
}

/// One fit by both methods.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Name of the metric.
    pub metric: String,
    /// Name of the reference's material.
    pub material: String,
    /// Identifier of the model.
    pub model: String,
    /// By Hooke-Jeeves.
    pub hooke_jeeves: Course,
    /// By L-BFGS.
    pub lbfgs: Course,
    /// Evaluations after which L-BFGS was as low as Hooke-Jeeves at its end, but for [`SAME`]; `None` where it never was.
    pub reached_after: Option<usize>,
}

/// All comparisons.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OptimizerRecord {
    /// The study.
    pub study: String,
    /// Name and version of each metric.
    pub metrics: Vec<[String; 2]>,
    /// Evaluations of a search at most.
    pub max_evaluations: usize,
    /// Of the order of the references.
    pub seed: u64,
    /// Metric by metric, reference by reference, model by model.
    pub fits: Vec<Comparison>,
}

/// Makes every fit twice.
///
/// # Errors
/// A model without a search; a metric or a model without a gradient; a reference that cannot be opened; a fit that fails.
pub fn optimizers(
    study: &Study,
    options: &OptimizerOptions<'_>,
    progress: Observer<'_>,
) -> Result<OptimizerRecord, ExperimentError> {
    if let Some(model) = options.models.iter().find(|model| is_direct(model)) {
        return Err(ExperimentError::NoSearch { model: model.clone() });
    }
    let references = materials(study, options.references, options.seed);
    let mut jobs = Vec::new();
    for metric in options.metrics {
        for reference in &references {
            jobs.extend(options.models.iter().map(|model| (metric, reference, model.as_str())));
        }
    }
    let done = Count::of(jobs.len());
    let compared = |&(metric, (material, source), model): &(&Arc<dyn Metric>, &(String, BrdfSource), &str)| {
        let brdf = source.open_unhashed(options.data)?;
        let run = |method| {
            let start = Some(Start::Staged);
            let max_evaluations = Some(options.max_evaluations);
            let fitting = Fitting { start, method, max_evaluations, ..Fitting::new(model, &**metric) };
            fitting.run(&*brdf, &|_, _| ()).map_err(|source| ExperimentError::Fit {
                material: material.clone(),
                model: model.to_owned(),
                loss: "a metric with a gradient",
                source: Box::new(source),
            })
        };
        // First the shorter one, which may be refused for want of a gradient.
        let gradient = run(Method::Lbfgs)?;
        let direct = run(Method::HookeJeeves)?;
        let course = |fitted: &Fitted| Course { value: fitted.loss, evaluations: fitted.search_evaluations };
        let reached = gradient.history.iter().find(|step| step.value <= direct.loss + SAME);
        done.one(|found| progress("fits", found));
        Ok(Comparison {
            metric: metric.name().to_owned(),
            material: material.clone(),
            model: model.to_owned(),
            hooke_jeeves: course(&direct),
            lbfgs: course(&gradient),
            reached_after: reached.map(|step| step.evaluations),
        })
    };
    let fits = jobs.par_iter().map(compared).collect::<Result<_, ExperimentError>>()?;
    Ok(OptimizerRecord {
        study: study.name.clone(),
        metrics: options.metrics.iter().map(|m| [m.name().to_owned(), m.version().to_owned()]).collect(),
        max_evaluations: options.max_evaluations,
        seed: options.seed,
        fits,
    })
}
