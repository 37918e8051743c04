//! Everything that the experiment found, for reports.

use super::Loss;
use super::compare::{Comparison, Judged};
use super::run::{FitRecord, Settings};
use crate::dataset::Study;
use crate::experiment::ExperimentError;
use std::collections::BTreeMap;
use vernis_metric::math::rating_scale::RatingScale;

/// Losses that others are compared with: the study's, the simplest that knows of relative differences, and the one that did best with
/// version 1 of the metric.
const BASELINES: [Loss; 3] = [Loss::Square, Loss::Logarithm, Loss::CubeRoot];

/// How the searches under a loss ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Searches {
    /// The loss that was minimised.
    pub loss: Loss,
    /// Number of fits under the loss.
    pub fits: usize,
    /// Those that did not converge.
    pub unfinished: usize,
    /// The median of evaluations, starts included.
    pub evaluations: usize,
}

/// A loss that is let in by degrees against the same from the first step on.
#[derive(Debug, Clone, PartialEq)]
pub struct Blending {
    /// The loss that is let in by degrees.
    pub loss: Loss,
    /// `all models`, then each model by its name.
    pub parts: Vec<(String, Vec<Comparison>)>,
}

/// The experiment's findings.
#[derive(Debug, Clone, PartialEq)]
pub struct LossesRecord {
    /// Name of the study.
    pub study: String,
    /// Ratings come from simulated observers.
    pub synthetic: bool,
    /// The scale of the ratings; scores here are grades, 1 to 5.
    pub scale: RatingScale,
    /// SHA-256 of the study's files by name.
    pub data: BTreeMap<String, String>,
    /// What decides the numbers, besides the data.
    pub settings: Settings,
    /// Names of the materials whose references were fitted.
    pub materials: Vec<String>,
    /// Names of the judges.
    pub judges: Vec<String>,
    /// Bootstrap resamples of materials.
    pub resamples: usize,
    /// Over all models, against each baseline.
    pub pooled: Vec<(Loss, Vec<Comparison>)>,
    /// Model by model, against the first baseline.
    pub by_model: Vec<(String, Vec<Comparison>)>,
    /// A loss that is let in by degrees against the same from the first step on: all models, then each.
    pub blending: Vec<Blending>,
    /// One entry a loss.
    pub searches: Vec<Searches>,
}

impl LossesRecord {
    /// # Errors
    /// Those of [`Judged::new`] and [`Judged::against`].
    pub fn new(
        study: &Study,
        settings: &Settings,
        records: &[Vec<FitRecord>],
        resamples: usize,
    ) -> Result<Self, ExperimentError> {
        let judged = Judged::new(records)?;
        let models = judged.models().to_vec();
        let against = |baseline: Loss, losses: &[Loss], models: &[String]| {
            judged.against(baseline, losses, models, resamples, settings.seed)
        };
        let losses = judged.losses();
        let baselines = BASELINES.into_iter().filter(|loss| losses.contains(loss));
        let pooled = baselines
            .map(|baseline| Ok((baseline, against(baseline, losses, &models)?)))
            .collect::<Result<Vec<_>, ExperimentError>>()?;
        let each = |losses: &[Loss], baseline: Loss| {
            let of_model =
                |model: &String| Ok((model.clone(), against(baseline, losses, std::slice::from_ref(model))?));
            models.iter().map(of_model).collect::<Result<Vec<_>, ExperimentError>>()
        };
        let by_model = if losses.contains(&BASELINES[0]) { each(losses, BASELINES[0])? } else { Vec::new() };
        let mut blending = Vec::new();
        for (blended, plain) in Loss::BLENDS {
            if [blended, plain].iter().all(|loss| losses.contains(loss)) {
                let mut parts = vec![("all models".to_owned(), against(plain, &[blended], &models)?)];
                parts.extend(each(&[blended], plain)?);
                blending.push(Blending { loss: blended, parts });
            }
        }
        Ok(Self {
            study: study.name.clone(),
            synthetic: study.synthetic,
            scale: study.scale,
            data: study.files.iter().map(|f| (f.name.clone(), f.content.to_string())).collect(),
            settings: settings.clone(),
            materials: judged.materials().to_vec(),
            judges: judged.judges().to_vec(),
            resamples,
            pooled,
            by_model,
            blending,
            searches: losses.iter().map(|&loss| searches(loss, records)).collect(),
        })
    }
}

fn searches(loss: Loss, records: &[Vec<FitRecord>]) -> Searches {
    let fits = || records.iter().flatten().filter(|r| r.loss == loss).map(|r| &r.fit);
    let mut evaluations: Vec<usize> = fits().map(|f| f.evaluations + f.polish_evaluations).collect();
    evaluations.sort_unstable();
    Searches {
        loss,
        fits: evaluations.len(),
        unfinished: fits().filter(|f| !f.stop.is_success()).count(),
        evaluations: evaluations.get(evaluations.len() / 2).copied().unwrap_or(0),
    }
}
