//! The main job: a study becomes a metric, with a leakage-free measurement of how well it agrees with people.
//!
//! ```text
//! study -> numbers (descriptors and distances, cached) -> nested cross-validation by material, beside every other metric
//!       -> final metric on all rows -> exported metric and benchmark record
//! ```
//!
//! [`train`] does it all. [`Measurement`] is the job cut into its stages, so that a caller can write down after each what is
//! finished: [`Measurement::of`] measures, which takes the time; [`Measurement::run`] explains what was measured, stage by stage; and
//! [`Measurement::export`] trains the final metric. [`benchmark`] measures and explains alone. What a study does not support is
//! decided before the first BRDF is read ([`Plan`]). The same study, options and seed give the same bytes, whatever the number of threads.

use super::ExperimentError;
use super::contenders::{RunInfo, StudyBenchmark, measure, taken};
use super::external::ExternalScores;
use super::further::Further;
use super::plan::Plan;
use super::provenance::{command_line, file_name, metric_versions, reached, scale_option, versions};
use crate::dataset::triplets::StudyTriplets;
use crate::dataset::{Study, manifest};
use crate::evaluation::protocol::Protocol;
use crate::evaluation::records::{BenchmarkRecord, Split};
use crate::samples::Samples;
use crate::samples::extracted::ExtractedStudy;
use crate::samples::extraction::{Extraction, Extractor};
use crate::samples::further::further;
use crate::samples::split::TrainingSet;
use crate::samples::triplets::TripletSamples;
use crate::train::embedding_folds::{Learner, TableBank, embedded_folds};
use crate::train::ensemble::bootstrap_members;
use crate::train::export::{Export, provenance};
use crate::train::{Trainer, recipe};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use vernis_metric::brdf::BrdfSource;
use vernis_metric::brdf::formats::materials;
use vernis_metric::descriptor::{Cache, CacheWarning, DescriptorOptions, DescriptorSet, Setup};
use vernis_metric::io::{Observer, Progress};
use vernis_metric::metric::Metric;
use vernis_metric::metric::learned::ExportedMetric;
use vernis_metric::metric::learned::exported::{Descriptors, Interval};
use vernis_metric::metric::lp::LpVariant;
use vernis_metric::metric::registry::Registry;

/// Archives of measured materials that nobody rated, from which embeddings may be learned.
const UNRATED: [&str; 2] = ["nbrdf/rgl-isotropic_nbrdf.zip", "nbrdf/nielsen_nbrdf.zip"];
/// Bootstrap resamples where nothing else is asked for.
pub const RESAMPLES: usize = 2000;

/// How a study is measured.
#[derive(Debug, Clone)]
pub struct BenchmarkOptions {
    /// Folder that relative sources are looked up in, and that may hold measured materials without ratings.
    pub data: Option<PathBuf>,
    /// Without a cache everything is computed.
    pub cache: Option<Cache>,
    /// Lights and shape of the descriptors.
    pub descriptors: DescriptorOptions,
    /// Folds by material; `None`: 10, or 5 for the embedded study.
    pub folds: Option<usize>,
    /// Bootstrap resamples of materials.
    pub resamples: usize,
    /// Of splits, resamples and initial weights.
    pub seed: u64,
    /// Distances that were computed elsewhere, which are judged as well.
    pub scores: Option<ExternalScores>,
    /// Metrics that are judged beside those that always are.
    pub further: Further,
    /// Whether the metric with one part changed is judged as well ([`recipe::variants`]): minutes for what each part is worth.
    pub variants: bool,
}

impl Default for BenchmarkOptions {
    fn default() -> Self {
        Self {
            data: None,
            cache: None,
            descriptors: DescriptorOptions::default(),
            folds: None,
            resamples: RESAMPLES,
            seed: 1,
            scores: None,
            further: Further::default(),
            variants: false,
        }
    }
}

/// How a metric is trained.
#[derive(Debug, Clone, Default)]
pub struct TrainOptions {
    /// Of the exported metric; `None`: `vernis` for the open study, else `vernis-STUDY`.
    pub name: Option<String>,
    /// How the study is measured.
    pub benchmark: BenchmarkOptions,
}

/// What training gives.
#[derive(Debug, Clone)]
pub struct Trained {
    /// The metric, trained on all rows.
    pub metric: ExportedMetric,
    /// The distance that it begins with, a metric of its own: the one to fit with.
    pub loss: ExportedMetric,
    /// How well the recipe agrees with people, measured on held-out rows.
    pub benchmark: BenchmarkRecord,
    /// What could not be kept for the next run.
    pub warnings: Vec<CacheWarning>,
}

/// Trains a metric on all rows of a study and measures it under nested cross-validation.
///
/// ```no_run
/// use vernis::dataset::Study;
/// use vernis::experiment::{TrainOptions, train};
/// use vernis::io::silent;
///
/// let study = Study::load("synthetic", None)?;
/// let trained = train(&study, &TrainOptions::default(), &silent)?;
/// std::fs::write("mine.vernis.json", trained.metric.to_json()?)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A study that cannot be judged with so many folds, BRDFs that cannot be read, probes and meshes that cannot; training that fails.
pub fn train(study: &Study, options: &TrainOptions, progress: Observer<'_>) -> Result<Trained, ExperimentError> {
    let mut measurement = Measurement::of(study, &options.benchmark, Purpose::Train, progress)?;
    for stage in Stage::ALL {
        measurement.run(stage, progress)?;
    }
    let metric = measurement.export(options.name.as_deref(), progress)?;
    let loss = measurement.export_loss(options.name.as_deref(), progress)?;
    Ok(Trained { metric, loss, benchmark: measurement.record().clone(), warnings: measurement.warnings })
}

/// Measures all metrics on a study under nested cross-validation, without exporting one.
///
/// # Errors
/// As [`train`].
pub fn benchmark(
    study: &Study,
    options: &BenchmarkOptions,
    progress: Observer<'_>,
) -> Result<BenchmarkRecord, ExperimentError> {
    let mut measurement = Measurement::of(study, options, Purpose::Benchmark, progress)?;
    for stage in Stage::ALL {
        measurement.run(stage, progress)?;
    }
    Ok(measurement.bench.record)
}

/// What explains a measurement, one after the other. What fails of it is left out, with a sentence in the record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// The metric retrained with other descriptors.
    Ablation,
    /// What the metric loses when descriptors are exchanged between rows.
    Importance,
    /// The metric trained on fewer materials.
    LearningCurve,
}

impl Stage {
    /// All stages, in order.
    pub const ALL: [Self; 3] = [Self::Ablation, Self::Importance, Self::LearningCurve];
}

/// What a measurement is for: the command that its record names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Purpose {
    /// `vernis train`.
    Train,
    /// `vernis benchmark`.
    Benchmark,
}

impl Purpose {
    pub(super) fn command(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Benchmark => "benchmark",
        }
    }
}

/// A study that has been measured, and what the final metric is trained on.
pub struct Measurement {
    study: Study,
    setup: String,
    /// In grades.
    bench: StudyBenchmark,
    /// The same on the scale of the study.
    record: BenchmarkRecord,
    /// What embeddings are learned from, where the BRDFs were read and the study has enough.
    bank: Option<TableBank>,
    /// The descriptors of every row, and the triplets.
    training: TrainingSet,
    seed: u64,
    /// What could not be kept for the next run.
    pub warnings: Vec<CacheWarning>,
}

/// A study as numbers.
struct Numbers<'a> {
    study: &'a Study,
    samples: Samples,
    setup: String,
    /// What embeddings are learned from, where the BRDFs were read.
    bank: Option<TableBank>,
    /// What the metric learns from beside the ratings, or why there is nothing.
    triplets: Result<TripletSamples, String>,
    /// Distances of [`BenchmarkOptions::further`].
    further: Option<Samples>,
}

/// Why studies whose numbers were extracted before have no triplets.
const NOT_EXTRACTED: &str = "they are computed from BRDFs, and these numbers were extracted before";

impl Measurement {
    /// Measures every metric on `study`.
    ///
    /// # Errors
    /// As [`train`].
    pub fn of(
        study: &Study,
        options: &BenchmarkOptions,
        purpose: Purpose,
        progress: Observer<'_>,
    ) -> Result<Self, ExperimentError> {
        Plan::of(study, options)?;
        options.further.check_beside(options.scores.as_ref(), study)?;
        let setup = Setup::new(&options.descriptors)?;
        let extraction = extract(study, &setup, options.data.as_deref(), options.cache.as_ref(), progress)?;
        let others = if study.synthetic { Vec::new() } else { unrated(options.data.as_deref())? };
        let (data, cache) = (options.data.as_deref(), options.cache.as_ref());
        let bank = TableBank::new(study, extraction.tables, &others, data, cache, &setup)?;
        let mut warnings = extraction.warnings;
        // With the files of its triplets, which decide the numbers as well.
        let mut whole = study.clone();
        let triplets = match StudyTriplets::of_study(&study.name, data)? {
            Err(reason) => Err(reason),
            Ok(found) => {
                whole.files.extend(found.files.iter().cloned());
                let (samples, unkept) = triplet_samples(&found, &setup, data, cache, progress)?;
                warnings.extend(unkept);
                Ok(samples)
            }
        };
        let metrics = options.further.metrics();
        let further = match metrics.is_empty() {
            true => None,
            false => {
                let told = |p| progress("further metrics", p);
                let (samples, unkept) = further(study, metrics, data, cache, &told)?;
                warnings.extend(unkept);
                Some(samples)
            }
        };
        let setup = setup.id().to_owned();
        let numbers =
            Numbers { study: &whole, samples: extraction.samples, setup, bank: Some(bank), triplets, further };
        let source = format!("--study {}{}", file_name(study), scale_option(study));
        Self::measure(numbers, options, purpose, &source, warnings, progress)
    }

    /// Measures every metric on a study whose numbers were extracted before. Embeddings, which are learned from BRDFs, take no
    /// part.
    ///
    /// # Errors
    /// A shard of a study, numbers of other versions than this program computes, and those of [`train`].
    pub fn of_extracted(
        extracted: &ExtractedStudy,
        options: &BenchmarkOptions,
        purpose: Purpose,
        progress: Observer<'_>,
    ) -> Result<Self, ExperimentError> {
        let study = &extracted.study;
        Plan::of(study, options)?;
        if !options.further.metrics().is_empty() {
            let reason = "further metrics are computed from BRDFs, and these numbers were extracted before".to_owned();
            return Err(ExperimentError::Unsupported { study: study.name.clone(), reason });
        }
        extracted.check_whole(&study.name)?;
        extracted.check_versions(&metrics(study)?, &study.name)?;
        let (samples, setup) = (extracted.samples.clone(), extracted.versions.setup.clone());
        let source = format!("--extracted {}.parquet", study.short_name());
        let numbers =
            Numbers { study, samples, setup, bank: None, triplets: Err(NOT_EXTRACTED.to_owned()), further: None };
        Self::measure(numbers, options, purpose, &source, Vec::new(), progress)
    }

    fn measure(
        numbers: Numbers<'_>,
        options: &BenchmarkOptions,
        purpose: Purpose,
        source: &str,
        warnings: Vec<CacheWarning>,
        progress: Observer<'_>,
    ) -> Result<Self, ExperimentError> {
        let Numbers { study, samples, setup, bank, triplets, further } = numbers;
        let compact = samples.select_columns(recipe::uses);
        let mut plan = Plan::with_numbers(study, options, &compact)?;
        if let Err(reason) = &triplets {
            plan.left_out.push(format!("The metric is trained without judged triplets: {reason}."));
        }
        let training = taken(&samples, triplets.as_ref().ok())?;
        let metrics = metrics(study)?;
        let mut versions = versions(&setup, &metrics);
        if let Ok(found) = &triplets {
            let (all, untied) = (found.triplets().len(), found.triplets().iter().filter(|t| t.is_untied()).count());
            versions.insert("triplets".into(), format!("{all} judged triplets, {untied} of them with a majority"));
        }
        if bank.is_none() {
            versions.insert("embeddings".into(), "left out, for they are learned from BRDFs".into());
        }
        let command = command_line(purpose, source, study, options, &setup);
        let external = options.scores.as_ref();
        let mut metric_versions = metric_versions(&metrics);
        metric_versions.extend(external.iter().flat_map(|scores| scores.versions()));
        let further = further.as_ref().map(|samples| (&options.further, samples));
        metric_versions.extend(options.further.metrics().iter().map(|m| (m.name().to_owned(), m.version().to_owned())));
        let info = RunInfo { command, versions, metric_versions, external, further, variants: options.variants };
        let bench =
            measure(study, samples, triplets.as_ref().ok(), &plan, &info, &|label| progress(label, Progress::BEGUN))?;
        Ok(Self {
            study: study.clone(),
            setup,
            record: bench.record.clone().on_scale(study.scale),
            bench,
            bank: bank.filter(|_| plan.embeddings),
            training: TrainingSet::whole(&training),
            seed: options.seed,
            warnings,
        })
    }

    /// Adds to the record what `stage` finds.
    ///
    /// # Errors
    /// Columns that are not those of the extraction; what a study does not support is no error.
    pub fn run(&mut self, stage: Stage, progress: Observer<'_>) -> Result<(), ExperimentError> {
        let told = |label: &str| progress(label, Progress::BEGUN);
        match stage {
            Stage::Ablation => {
                let Protocol { folds, method_folds, splits, seed, .. } = self.bench.protocol().clone();
                let method_folds = splits.contains(&Split::UnseenMaterialAndMethod).then_some(method_folds);
                let bank = self.bank.as_ref();
                let learners = if bank.is_some() { &Learner::ALL[..] } else { &[] };
                let embedded = |compact: &Samples, learner| {
                    bank.map(|bank| embedded_folds(bank, compact, learner, folds, method_folds, seed)).transpose()
                };
                self.bench.ablate(learners, &embedded, &told)?;
            }
            Stage::Importance => {
                told("importance of descriptors");
                self.bench.weigh();
            }
            Stage::LearningCurve => {
                told("learning curve");
                self.bench.learn_from_fewer();
            }
        }
        self.record = self.bench.record.clone().on_scale(self.study.scale);
        Ok(())
    }

    /// What was found.
    pub fn record(&self) -> &BenchmarkRecord {
        &self.record
    }

    /// The study that was measured.
    pub fn study(&self) -> &Study {
        &self.study
    }

    /// Trains the metric on every row, with members on resampled materials. Without a name it is `vernis` for the open study, else
    /// `vernis-STUDY`.
    ///
    /// # Errors
    /// Training that fails.
    pub fn export(&self, name: Option<&str>, progress: Observer<'_>) -> Result<ExportedMetric, ExperimentError> {
        progress("final metric", Progress::BEGUN);
        let default = metric_name(&self.study);
        self.exported(
            recipe::NAME,
            &recipe::metric(&self.bench.distance),
            name.unwrap_or(&default),
            self.bench.interval,
        )
    }

    /// Trains the distance that the metric begins with on every row, as a metric of its own: `vernis-loss` for the open study, else
    /// the name of the metric and `-loss`. Members are those of the metric.
    ///
    /// # Errors
    /// Training that fails.
    pub fn export_loss(&self, name: Option<&str>, progress: Observer<'_>) -> Result<ExportedMetric, ExperimentError> {
        progress("metric to fit with", Progress::BEGUN);
        let default = metric_name(&self.study);
        let name = loss_name(name.unwrap_or(&default));
        self.exported(recipe::LOSS_NAME, &self.bench.distance, &name, self.bench.loss_interval)
    }

    fn exported(
        &self,
        metric: &'static str,
        trainer: &dyn Trainer,
        name: &str,
        interval: Option<Interval>,
    ) -> Result<ExportedMetric, ExperimentError> {
        let interval = interval.ok_or_else(|| {
            let reasons = self.bench.record.left_out.iter().filter(|line| line.contains(" is left out: "));
            let reason = reasons.map(String::as_str).collect::<Vec<_>>().join(" ");
            ExperimentError::NotMeasured { metric, reason }
        })?;
        let model = trainer.train(&self.training, self.seed)?;
        let members =
            bootstrap_members(&recipe::member(&self.bench.distance), &self.training, recipe::MEMBERS, self.seed)?;
        let record = &self.record;
        let (command, agreement) = (record.command.clone(), reached(record, metric));
        let export = Export {
            name,
            metric_version: recipe::METRIC_VERSION,
            scale: self.study.scale,
            descriptors: Descriptors { setup: self.setup.clone(), set: recipe::descriptors() },
            interval,
            provenance: provenance(&self.study, record.rows, record.materials, self.seed, command, agreement),
        };
        Ok(export.of(trainer.name(), &*model, &members)?)
    }
}

/// The descriptors of the pairs of judged triplets, computed where the cache lacks them.
pub(super) fn triplet_samples(
    study: &StudyTriplets,
    setup: &Setup,
    base: Option<&Path>,
    cache: Option<&Cache>,
    progress: Observer<'_>,
) -> Result<(TripletSamples, Vec<CacheWarning>), ExperimentError> {
    let told = |p| progress("materials of triplets", p);
    let set = recipe::descriptors();
    let extractor = Extractor { set: &set, setup, metrics: &[], base, cache, progress: &told };
    Ok(extractor.triplets(study)?)
}

/// Descriptors and distances of every pair of a study, computed where the cache lacks them.
///
/// # Errors
/// The first BRDF that cannot be read, or compared.
pub fn extract(
    study: &Study,
    setup: &Setup,
    base: Option<&Path>,
    cache: Option<&Cache>,
    progress: Observer<'_>,
) -> Result<Extraction, ExperimentError> {
    progress("picture operators", Progress::BEGUN);
    let warning = cache.and_then(|c| c.prepare(setup));
    let (set, metrics) = (DescriptorSet::all(), metrics(study)?);
    let pairs = |p| progress("pairs", p);
    let extractor = Extractor { set: &set, setup, metrics: &metrics, base, cache, progress: &pairs };
    let mut extraction = extractor.extract(study)?;
    extraction.warnings.extend(warning);
    Ok(extraction)
}

/// The classical metrics that take part: the 36 Lp metrics, the transport and the energy distance. The embedded study is there
/// to be quick: a coarser grid.
///
/// # Errors
/// The metric that comes with this build cannot be read.
pub fn metrics(study: &Study) -> Result<Vec<Arc<dyn Metric>>, ExperimentError> {
    let named = |name: &str| {
        let name = name.to_owned();
        move |source| ExperimentError::MetricNamed { name, source: Box::new(source) }
    };
    let registry = Registry::standard().map_err(named("the registry"))?;
    let graphs = if study.synthetic { ["ot[grid=6x6x24,kappa=4]", "energy[grid=6x6x24]"] } else { ["ot", "energy"] };
    let lp = LpVariant::of_study().map(|variant| variant.to_string());
    lp.chain(graphs.map(str::to_owned)).map(|name| registry.get(&name).map_err(named(&name))).collect()
}

/// The name of the metric that is trained on `study`, where none is given.
pub fn metric_name(study: &Study) -> String {
    match study.name.as_str() {
        manifest::OPEN => recipe::NAME.to_owned(),
        _ => format!("{}-{}", recipe::NAME, study.short_name()),
    }
}

/// The name of the metric to fit with that belongs to the metric called `name`.
pub fn loss_name(name: &str) -> String {
    format!("{name}-loss")
}

/// The name of the file of the metric called `name`.
pub fn metric_file(name: &str) -> String {
    format!("{name}.vernis.json")
}

/// The embedded study is there to show the whole job on any machine, in a minute or two.
pub(super) fn default_folds(study: &Study) -> usize {
    if study.synthetic { 5 } else { 10 }
}

/// Folds by material of a measurement.
pub fn folds_of(options: &BenchmarkOptions, study: &Study) -> usize {
    options.folds.unwrap_or_else(|| default_folds(study))
}

/// Measured materials without ratings that the data folder holds.
pub(super) fn unrated(data: Option<&Path>) -> Result<Vec<BrdfSource>, ExperimentError> {
    let mut found = Vec::new();
    for archive in data.into_iter().flat_map(|data| UNRATED.map(|a| data.join(a))).filter(|path| path.is_file()) {
        for material in materials(&archive)? {
            found.push(BrdfSource::Notation(format!("{}:{material}", archive.display())));
        }
    }
    Ok(found)
}
