//! Learned metrics that have not seen a material: for each fold of a study three to fit with and one to judge with.
//!
//! Folds are by group, so that a material and its sisters are held out together. The judge learns from the same rows as the metric
//! `vernis` with another seed: what one of them merely happens to like, the other need not. What both got wrong in the
//! same way remains, because rows and descriptors are the same.
//!
//! Cost: four trainings a fold. Metrics are files in a folder, so that a second run trains nothing.

use crate::dataset::Study;
use crate::evaluation::EvaluationError;
use crate::experiment::ExperimentError;
use crate::samples::Samples;
use crate::samples::split::{Fold, grouped_folds};
use crate::train::export::{self, Export};
use crate::train::{TrainError, Trainer};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use vernis_metric::descriptor::{DescriptorSet, Setup};
use vernis_metric::io::{Count, Observer};
use vernis_metric::math::rating_scale::RatingScale;
use vernis_metric::metric::learned::LearnedMetric;
use vernis_metric::metric::learned::exported::{Descriptors, Interval, Provenance};

/// Of the numbers of these metrics.
const METRIC_VERSION: &str = "3";
/// The seed of the judges is that of the losses and this.
const JUDGE_SEED: u64 = 1_000_003;

/// What a learned metric is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Judges the fits: the recipe of `vernis` with another seed.
    Judge,
    /// The recipe of version 1, which learned from descriptors and rows of its own.
    First,
    /// The recipe of `vernis`.
    Metric,
    /// The recipe of `vernis-loss`.
    Distance,
}

impl Role {
    /// As files call it.
    fn name(self) -> &'static str {
        match self {
            Self::Judge => "judge",
            Self::First => "vernis-1",
            Self::Metric => "vernis",
            Self::Distance => "vernis-loss",
        }
    }
}

/// What a role learns from, and how.
pub struct Lesson<'a> {
    /// What the metric is for.
    pub role: Role,
    /// The rows.
    pub samples: Samples,
    /// Lights and shape of the descriptors.
    pub setup: Arc<Setup>,
    /// The descriptors, the columns of `samples`.
    pub set: DescriptorSet,
    /// What learns from the ratings.
    pub trainer: &'a dyn Trainer,
}

/// Metrics of one role.
struct OfRole {
    fold_of: BTreeMap<String, usize>,
    folds: Vec<LearnedMetric>,
}

/// For every material of a study, metrics that have not seen it.
pub struct UnseenMetrics {
    roles: BTreeMap<Role, OfRole>,
}

impl UnseenMetrics {
    /// The metric of a role for a material of the study; `None` for any other, and for a role that was not asked for.
    pub fn of(&self, role: Role, material: &str) -> Option<&LearnedMetric> {
        let of_role = self.roles.get(&role)?;
        of_role.folds.get(*of_role.fold_of.get(material)?)
    }
}

/// One metric that is asked for.
struct Asked {
    name: String,
    seed: u64,
    provenance: Provenance,
    descriptors: Descriptors,
}

impl Asked {
    fn file(&self) -> String {
        format!("{}.vernis.json", self.name)
    }
}

/// The files of a metric's study, as one text.
fn data(provenance: &Provenance) -> String {
    let texts: Vec<String> = provenance.data.iter().map(|d| format!("{} {}", d.name, d.sha256)).collect();
    texts.join(" ")
}

/// How to train them.
pub struct UnseenTraining<'a> {
    /// The study whose ratings are learned from.
    pub study: &'a Study,
    /// One a role.
    pub lessons: &'a [Lesson<'a>],
    /// Number of folds by material group.
    pub folds: usize,
    /// Seed of folds and training.
    pub seed: u64,
    /// Where metrics of earlier runs lie.
    pub folder: &'a Path,
    /// Keeps the text of a file under its name in that folder.
    pub write: &'a (dyn Fn(&str, &str) -> Result<(), ExperimentError> + Sync),
    /// Told how far training is.
    pub progress: Observer<'a>,
}

impl UnseenTraining<'_> {
    /// Trains what the folder does not hold; the same bytes whatever the number of threads.
    ///
    /// # Errors
    /// A metric in the folder that belongs to another study, seed or fold ([`ExperimentError::Kept`]), found before the first
    /// training; folds that cannot be made, a training that fails, a file that cannot be written.
    pub fn run(&self) -> Result<UnseenMetrics, ExperimentError> {
        let folds = |lesson: &Lesson<'_>| grouped_folds(&lesson.samples, self.folds, self.seed);
        let folds = self.lessons.iter().map(folds).collect::<Result<Vec<_>, _>>()?;
        let mut jobs = Vec::new();
        for (lesson, folds) in self.lessons.iter().zip(&folds) {
            for (index, fold) in folds.iter().enumerate() {
                let asked = self.asked(lesson, index, fold);
                jobs.push((lesson, index, fold, self.kept(&asked)?, asked));
            }
        }
        let done = Count::of(jobs.len());
        let metric = |(lesson, index, fold, kept, asked): (&Lesson<'_>, usize, &Fold, Option<LearnedMetric>, Asked)| {
            let metric = match kept {
                Some(kept) => kept,
                None => self.metric(lesson, index, fold, asked)?,
            };
            done.one(|progress| (self.progress)("training", progress));
            Ok(metric)
        };
        let mut trained = jobs.into_par_iter().map(metric).collect::<Result<Vec<_>, ExperimentError>>()?.into_iter();
        let mut roles = BTreeMap::new();
        for (lesson, folds) in self.lessons.iter().zip(&folds) {
            let held_out = |(index, fold): (usize, &Fold)| {
                fold.held_out.rows().iter().map(|row| (row.material.clone(), index)).collect::<Vec<_>>()
            };
            let fold_of = folds.iter().enumerate().flat_map(held_out).collect();
            roles.insert(lesson.role, OfRole { fold_of, folds: trained.by_ref().take(folds.len()).collect() });
        }
        Ok(UnseenMetrics { roles })
    }

    fn asked(&self, lesson: &Lesson<'_>, index: usize, fold: &Fold) -> Asked {
        let name = format!("{}-fold{index}", lesson.role.name());
        let seed = if lesson.role == Role::Judge { self.seed.wrapping_add(JUDGE_SEED) } else { self.seed };
        let provenance = self.provenance(fold, seed);
        let descriptors = Descriptors { setup: lesson.setup.id().to_owned(), set: lesson.set.clone() };
        Asked { name, seed, provenance, descriptors }
    }

    /// What an earlier run has left. A file that cannot be read, or of another version of the recipe, of the descriptors or of the
    /// program, is made again.
    fn kept(&self, asked: &Asked) -> Result<Option<LearnedMetric>, ExperimentError> {
        let path = self.folder.join(asked.file());
        let Ok(kept) = LearnedMetric::load(&path) else { return Ok(None) };
        let (found, wanted) = (&kept.exported().provenance, &asked.provenance);
        let parts = [
            ("name", kept.exported().name.clone(), asked.name.clone()),
            ("study", found.study.clone(), wanted.study.clone()),
            ("seed", found.seed.to_string(), wanted.seed.to_string()),
            ("rows", found.rows.to_string(), wanted.rows.to_string()),
            ("materials", found.materials.to_string(), wanted.materials.to_string()),
            ("trained", found.command.clone(), wanted.command.clone()),
            ("data", data(found), data(wanted)),
        ];
        let differing = parts.into_iter().filter(|(_, found, asked)| found != asked);
        let texts: Vec<_> =
            differing.map(|(what, found, asked)| format!("{what} is {found} there and {asked} here")).collect();
        if !texts.is_empty() {
            return Err(ExperimentError::Kept { path, differences: texts.join(", ") });
        }
        let exported = kept.exported();
        let same = exported.metric_version == METRIC_VERSION
            && exported.descriptors == asked.descriptors
            && exported.provenance == asked.provenance;
        Ok(same.then_some(kept))
    }

    fn metric(
        &self,
        lesson: &Lesson<'_>,
        index: usize,
        fold: &Fold,
        asked: Asked,
    ) -> Result<LearnedMetric, ExperimentError> {
        let (file, Asked { name, seed, provenance, descriptors }) = (asked.file(), asked);
        let failed = |source: TrainError| {
            let training_rows = fold.training.rows().len();
            EvaluationError::Training { metric: name.clone(), fold: index, training_rows, source: Box::new(source) }
        };
        let model = lesson.trainer.train(&fold.training, seed).map_err(failed)?;
        let export = Export {
            name: &name,
            metric_version: METRIC_VERSION,
            // Judges are compared in grades, whatever the study's scale.
            scale: RatingScale::GRADES,
            descriptors,
            // Only the prediction itself is used, never its interval.
            interval: Interval { level: 0.95, factor: 0.0, offset: 0.0 },
            provenance,
        };
        let exported = export.of(lesson.trainer.name(), &*model, &[])?;
        (self.write)(&file, &exported.to_json()?)?;
        LearnedMetric::new(exported, lesson.setup.clone())
            .map_err(|e| ExperimentError::MetricNamed { name, source: Box::new(e) })
    }

    /// Says which materials the metric has not seen, so that a file tells whether it is the one that is asked for.
    fn provenance(&self, fold: &Fold, seed: u64) -> Provenance {
        let rows = fold.training.rows();
        let held_out: BTreeSet<&str> = fold.held_out.rows().iter().map(|r| r.group.as_str()).collect();
        let materials: BTreeSet<&str> = rows.iter().map(|r| r.material.as_str()).collect();
        let command = format!("without {}", held_out.into_iter().collect::<Vec<_>>().join(", "));
        export::provenance(self.study, rows.len(), materials.len(), seed, command, Vec::new())
    }
}
