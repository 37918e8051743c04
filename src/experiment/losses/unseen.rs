//! Learned metrics that have not seen a material: two for each fold of a study, one to fit with and one to judge with.
//!
//! Folds are by group, so that a material and its sisters are held out together. The two metrics of a fold learn from the
//! same rows, with different seeds: what one of them merely happens to like, the other need not. What both got wrong in the
//! same way remains, because rows and descriptors are the same.
//!
//! Cost: two trainings a fold. Metrics are files in a folder, so that a second run trains nothing.

use crate::dataset::Study;
use crate::evaluation::EvaluationError;
use crate::experiment::ExperimentError;
use crate::samples::Samples;
use crate::samples::extraction::Extractor;
use crate::samples::split::{Fold, grouped_folds};
use crate::train::export::{self, Export};
use crate::train::{TrainError, Trainer};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use vernis_metric::descriptor::{Cache, DescriptorSet, Setup};
use vernis_metric::io::{Observer, Progress};
use vernis_metric::math::rating_scale::RatingScale;
use vernis_metric::metric::learned::LearnedMetric;
use vernis_metric::metric::learned::exported::{Descriptors, Interval, Provenance};

/// Of the numbers of these metrics.
const METRIC_VERSION: &str = "2";
/// The seed of the judges is that of the losses and this.
const JUDGE_SEED: u64 = 1_000_003;

/// The two metrics of a fold.
pub struct Unseen {
    /// The metric to fit with.
    pub loss: LearnedMetric,
    /// The metric to judge with, trained with another seed.
    pub judge: LearnedMetric,
}

/// For every material of a study, metrics that have not seen it.
pub struct UnseenMetrics {
    fold_of: BTreeMap<String, usize>,
    folds: Vec<Unseen>,
}

impl UnseenMetrics {
    /// The metrics for a material of the study; `None` for any other.
    pub fn of(&self, material: &str) -> Option<&Unseen> {
        self.folds.get(*self.fold_of.get(material)?)
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
    /// Where relative sources are looked up.
    pub base: Option<&'a Path>,
    /// Without a cache every descriptor is computed.
    pub cache: Option<&'a Cache>,
    /// What learns from the ratings.
    pub trainer: &'a dyn Trainer,
    /// Number of folds by material group.
    pub folds: usize,
    /// Seed of folds and training.
    pub seed: u64,
    /// Where metrics of earlier runs lie.
    pub folder: &'a Path,
    /// Keeps the text of a file under its name in that folder.
    pub write: &'a (dyn Fn(&str, &str) -> Result<(), ExperimentError> + Sync),
    /// Told how far descriptors and training are.
    pub progress: Observer<'a>,
}

impl UnseenTraining<'_> {
    /// Trains what the folder does not hold; the same bytes whatever the number of threads.
    ///
    /// # Errors
    /// A metric in the folder that belongs to another study, seed or fold ([`ExperimentError::Kept`]), found before the first
    /// training; descriptors that cannot be computed, folds that cannot be made, a training that fails, a file that cannot be written.
    pub fn run(&self) -> Result<UnseenMetrics, ExperimentError> {
        let setup = Setup::standard();
        let set = DescriptorSet::with_norms();
        let samples = self.samples(&set, &setup)?;
        let folds = grouped_folds(&samples, self.folds, self.seed)?;
        let mut fold_of = BTreeMap::new();
        for (index, fold) in folds.iter().enumerate() {
            fold_of.extend(fold.held_out.rows().iter().map(|row| (row.material.clone(), index)));
        }
        let (done, total) = (AtomicUsize::new(0), 2 * folds.len());
        let jobs: Vec<(usize, bool)> = (0..folds.len()).flat_map(|index| [(index, false), (index, true)]).collect();
        let find = |&(index, judge): &(usize, bool)| {
            let asked = self.asked(index, &folds[index], judge, &set, &setup);
            Ok((index, self.kept(&asked)?, asked))
        };
        let found = jobs.iter().map(find).collect::<Result<Vec<_>, ExperimentError>>()?;
        let metric = |(index, kept, asked): (usize, Option<LearnedMetric>, Asked)| {
            let metric = match kept {
                Some(kept) => kept,
                None => self.metric(index, &folds[index], asked, &setup)?,
            };
            (self.progress)("training", Progress { done: done.fetch_add(1, Ordering::Relaxed) + 1, total });
            Ok(metric)
        };
        let trained = found.into_par_iter().map(metric).collect::<Result<Vec<_>, ExperimentError>>()?;
        let mut trained = trained.into_iter();
        let pairs = std::iter::from_fn(|| Some(Unseen { loss: trained.next()?, judge: trained.next()? }));
        Ok(UnseenMetrics { fold_of, folds: pairs.collect() })
    }

    fn samples(&self, set: &DescriptorSet, setup: &Setup) -> Result<Samples, ExperimentError> {
        let progress = |p| (self.progress)("descriptors", p);
        let extractor = Extractor { set, setup, metrics: &[], base: self.base, cache: self.cache, progress: &progress };
        Ok(extractor.extract(self.study)?.samples)
    }

    fn asked(&self, index: usize, fold: &Fold, judge: bool, set: &DescriptorSet, setup: &Setup) -> Asked {
        let role = if judge { "judge" } else { "loss" };
        let name = format!("{}-fold{index}-{role}", self.trainer.name());
        let seed = if judge { self.seed.wrapping_add(JUDGE_SEED) } else { self.seed };
        let provenance = self.provenance(fold, seed);
        let descriptors = Descriptors { setup: setup.id().to_owned(), set: set.clone() };
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
        index: usize,
        fold: &Fold,
        asked: Asked,
        setup: &Arc<Setup>,
    ) -> Result<LearnedMetric, ExperimentError> {
        let (file, Asked { name, seed, provenance, descriptors }) = (asked.file(), asked);
        let failed = |source: TrainError| {
            let training_rows = fold.training.rows().len();
            EvaluationError::Training { metric: name.clone(), fold: index, training_rows, source: Box::new(source) }
        };
        let model = self.trainer.train(&fold.training, seed).map_err(failed)?;
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
        let exported = export.of(self.trainer.name(), &*model, &[])?;
        (self.write)(&file, &exported.to_json()?)?;
        LearnedMetric::new(exported, setup.clone())
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
