//! The fits and what the judges say of them, one file a fit.

use super::Loss;
use super::judges::{Judges, Panel};
use super::unseen::{Role, UnseenMetrics};
use crate::dataset::Study;
use crate::evaluation::EvaluationError;
use crate::experiment::ExperimentError;
use crate::experiment::refit::file_name;
use rand::seq::SliceRandom;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use vernis_metric::brdf::formats::model_json;
use vernis_metric::brdf::{Brdf, BrdfSource, ContentHash, OpenBrdf};
use vernis_metric::descriptor::Setup;
use vernis_metric::fit::{FIT_VERSION, FitFile, Fitting, LogFits};
use vernis_metric::io::{Count, Progress, read_at_most, seal, unseal};
use vernis_metric::math::seed;
use vernis_metric::metric::learned::LearnedMetric;
use vernis_metric::metric::lp;
use vernis_metric::metric::registry::Registry;
use vernis_metric::metric::{Metric, MetricError};

/// Of the files of fits; metrics and fits have versions of their own, which the fingerprint of the settings holds.
const VERSION: u32 = 5;
/// Far more than a fit takes.
const MOST_BYTES: u64 = 64 << 20;
/// What decides the numbers, besides the data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Identifiers of the models that are fitted.
    pub models: Vec<String>,
    /// The losses that are compared.
    pub losses: Vec<Loss>,
    /// Cells of an Lp metric to a cell of its search, along each axis.
    pub coarsening: usize,
    /// Of a search under a learned metric, and of one under transport.
    pub max_evaluations: usize,
    /// Transport and energy distance, with their grids, as the registry names them.
    pub transport: String,
    /// The energy distance with its grid, as the registry names it.
    pub energy: String,
    /// Of the order of the materials, the folds and the training.
    pub seed: u64,
    /// Folds by material for the learned metrics.
    pub folds: usize,
    /// Metrics on stimuli that judge, as the registry names them, by the names that they have as judges.
    #[serde(default)]
    pub images: BTreeMap<String, String>,
}

/// A light probe that judges.
pub struct Probe {
    /// Such as `grace`.
    pub name: String,
    /// The setup of the descriptors, with the probe as its light.
    pub setup: Arc<Setup>,
}

/// The file of one fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FitRecord {
    /// Version of the file; others are computed again.
    pub version: u32,
    /// A hash of the settings, the study and the probes.
    pub settings: String,
    /// What the hash is of, by name: it tells in what a file of another run differs. Empty in files of versions 1 and 2.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub origin: BTreeMap<String, String>,
    /// Name of the reference's material.
    pub material: String,
    /// The loss that was minimised.
    pub loss: Loss,
    /// Model, parameters and course of the fit.
    pub fit: FitFile,
    /// By judge.
    pub judged: BTreeMap<String, f64>,
    /// Name and version of the metrics on stimuli among the judges, by what they are called there. A kept fit is judged again where
    /// others are asked for.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub images: BTreeMap<String, String>,
}

/// The experiment.
pub struct Experiment<'a> {
    /// The study whose references are fitted.
    pub study: &'a Study,
    /// What decides the numbers, besides the data.
    pub settings: &'a Settings,
    /// Learned metrics that have not seen the material.
    pub unseen: &'a UnseenMetrics,
    /// Light probes under which pictures are compared.
    pub probes: &'a [Probe],
    /// Every metric that the settings name.
    pub registry: &'a Registry,
    /// Where relative sources are looked up.
    pub base: Option<&'a Path>,
    /// Where files of earlier runs lie.
    pub folder: &'a Path,
    /// Keeps the text of a file under its name in that folder.
    pub write: &'a (dyn Fn(&str, &str) -> Result<(), ExperimentError> + Sync),
    /// Told how many fits are done.
    pub progress: &'a (dyn Fn(Progress) + Sync),
    /// Told of files that are there and cannot be used.
    pub warn: &'a (dyn Fn(&str) + Sync),
}

/// One material a group, in an order that the seed decides: the first `n` of a study.
///
/// Sisters are nearly one material: two of them would count twice in an interval over materials.
pub fn materials(study: &Study, n: usize, seed: u64) -> Vec<(String, BrdfSource)> {
    let mut of_group: BTreeMap<&str, (&str, &BrdfSource)> = BTreeMap::new();
    for pair in &study.pairs {
        let first = of_group.entry(&pair.group).or_insert((&pair.material, &pair.reference));
        if pair.material.as_str() < first.0 {
            *first = (&pair.material, &pair.reference);
        }
    }
    let mut all: Vec<(&str, &BrdfSource)> = of_group.into_values().collect();
    all.shuffle(&mut seed::stream(seed, "loss experiment materials", 0));
    all.into_iter().take(n).map(|(material, source)| (material.to_owned(), source.clone())).collect()
}

impl Experiment<'_> {
    /// All fits of `materials`, in order. With `only_kept`, those that an earlier run has left, of materials that it finished.
    ///
    /// # Errors
    /// A file of another study or of other settings ([`ExperimentError::Kept`]), found before the first fit; a reference that cannot
    /// be opened, a fit or a judge that fails, a file that cannot be written.
    pub fn run(
        &self,
        materials: &[(String, BrdfSource)],
        only_kept: bool,
    ) -> Result<Vec<Vec<FitRecord>>, ExperimentError> {
        let named = |name: &String| self.registry.get(name).map_err(|source| self.metric_error(name, source));
        let graphs = [named(&self.settings.transport)?, named(&self.settings.energy)?];
        let images = self.settings.images.values().map(named).collect::<Result<Vec<_>, _>>()?;
        let told = |(judge, metric): (&String, &Arc<dyn Metric>)| {
            (judge.clone(), format!("{} version {}", metric.name(), metric.version()))
        };
        let image_versions = self.settings.images.keys().zip(&images).map(told).collect();
        let origin = self.origin(&graphs);
        let fingerprint = fingerprint(&origin)?;
        let total = materials.len() * self.settings.models.len() * self.settings.losses.len();
        let done = Count::of(total);
        let count = || done.one(self.progress);
        let any = Job {
            experiment: self,
            graphs: &graphs,
            images: &images,
            image_versions: &image_versions,
            origin: &origin,
            fingerprint: &fingerprint,
            material: "",
        };
        let kept =
            materials.iter().map(|(material, _)| Job { material, ..any }.kept()).collect::<Result<Vec<_>, _>>()?;
        let of_material = |((material, source), kept): (&(String, BrdfSource), Vec<Option<FitRecord>>)| {
            let job = Job { material, ..any };
            let is_whole = |kept: &Option<FitRecord>| kept.as_ref().is_some_and(|fit| fit.images == image_versions);
            match (kept.iter().all(is_whole), only_kept) {
                (true, _) => Ok(kept.into_iter().collect()),
                (false, true) => Ok(None),
                (false, false) => job.run(source, kept, &count).map(Some),
            }
        };
        let all = materials
            .par_iter()
            .zip(kept)
            .map(of_material)
            .collect::<Result<Vec<Option<Vec<_>>>, ExperimentError>>()?;
        Ok(all.into_iter().flatten().collect())
    }

    fn metric_error(&self, name: &str, source: MetricError) -> ExperimentError {
        ExperimentError::MetricNamed { name: name.to_owned(), source: Box::new(source) }
    }

    /// What the fits belong to: what is asked for, and, as `version of ...`, what computes it.
    fn origin(&self, metrics: &[Arc<dyn Metric>]) -> BTreeMap<String, String> {
        let Settings { models, losses, coarsening, max_evaluations, transport, energy, seed, folds, .. } =
            self.settings;
        let probes: Vec<String> = self.probes.iter().map(|p| format!("{} {}", p.name, p.setup.id())).collect();
        let parts = [
            ("study", crate::experiment::sweep::fingerprint(self.study)),
            ("models", models.join(" ")),
            ("losses", losses.iter().map(|loss| loss.name()).collect::<Vec<_>>().join(" ")),
            ("coarsening", coarsening.to_string()),
            ("max-evaluations", max_evaluations.to_string()),
            ("transport", transport.clone()),
            ("energy", energy.clone()),
            ("seed", seed.to_string()),
            ("folds", folds.to_string()),
            ("light probes", probes.join(" ")),
        ];
        let versions = metrics.iter().map(|metric| (metric.name(), metric.version()));
        let versions = versions.chain([("the Lp distances", lp::VERSION), ("fits", FIT_VERSION)]);
        let versions = versions.map(|(name, version)| (format!("{VERSION_OF}{name}"), version.to_owned()));
        parts.into_iter().map(|(what, value)| (what.to_owned(), value)).chain(versions).collect()
    }
}

/// How the names of versions begin.
const VERSION_OF: &str = "version of ";

fn fingerprint(origin: &BTreeMap<String, String>) -> Result<String, ExperimentError> {
    let text = serde_json::to_string(origin).map_err(|e| ExperimentError::Write { reason: e.to_string() })?;
    Ok(ContentHash::of(text.as_bytes()).to_string())
}

/// The fits of one material.
#[derive(Clone, Copy)]
struct Job<'a> {
    experiment: &'a Experiment<'a>,
    /// Transport, energy.
    graphs: &'a [Arc<dyn Metric>; 2],
    /// In the order of the settings.
    images: &'a [Arc<dyn Metric>],
    /// As [`FitRecord::images`] has them.
    image_versions: &'a BTreeMap<String, String>,
    origin: &'a BTreeMap<String, String>,
    /// Of `origin`.
    fingerprint: &'a str,
    material: &'a str,
}

impl<'a> Job<'a> {
    fn items(&self) -> impl Iterator<Item = (&str, Loss)> {
        let Settings { models, losses, .. } = self.experiment.settings;
        models.iter().flat_map(|model| losses.iter().map(|loss| (model.as_str(), *loss)))
    }

    fn file(&self, model: &str, loss: Loss) -> String {
        format!("{}.{model}.{}.json", file_name(self.material), loss.name())
    }

    fn kept(&self) -> Result<Vec<Option<FitRecord>>, ExperimentError> {
        self.items().map(|(model, loss)| self.kept_fit(model, loss)).collect()
    }

    fn kept_fit(&self, model: &str, loss: Loss) -> Result<Option<FitRecord>, ExperimentError> {
        let path = self.experiment.folder.join(self.file(model, loss));
        let Ok(bytes) = read_at_most(&path, MOST_BYTES) else { return Ok(None) };
        let again = |reason: &dyn std::fmt::Display| {
            (self.experiment.warn)(&format!("{}: {reason}; the fit is made again", path.display()));
            Ok(None)
        };
        let record: FitRecord = match unseal(&bytes) {
            Ok(record) => record,
            Err(e) => return again(&e),
        };
        let named = (record.material.as_str(), record.fit.model.as_str(), record.loss) == (self.material, model, loss);
        if record.version < VERSION {
            return again(&format!("version of the experiment is {} there and {VERSION} here", record.version));
        }
        let differs = |(what, asked): (&String, &String)| {
            let found = record.origin.get(what).map_or("missing", String::as_str);
            (found != asked)
                .then(|| (what.starts_with(VERSION_OF), format!("{what} is {found} there and {asked} here")))
        };
        let (versions, mut others): (Vec<_>, Vec<_>) =
            self.origin.iter().filter_map(differs).partition(|(is_version, _)| *is_version);
        if !named {
            others.push((false, format!("it is a fit of {} to {}", record.fit.model, record.material)));
        }
        if !others.is_empty() {
            let differences = others.into_iter().map(|(_, text)| text).collect::<Vec<_>>().join(", ");
            return Err(ExperimentError::Kept { path, differences });
        }
        match versions.first() {
            Some((_, text)) => again(text),
            None if record.settings != self.fingerprint => again(&"its settings do not match their hash"),
            None => Ok(Some(record)),
        }
    }

    fn run(
        &self,
        source: &BrdfSource,
        kept: Vec<Option<FitRecord>>,
        count: &dyn Fn(),
    ) -> Result<Vec<FitRecord>, ExperimentError> {
        let reference = source.open(self.experiment.base)?;
        let panel = Panel {
            graphs: self.graphs,
            opinion: self.unseen(Role::Judge)?,
            images: (self.images, self.experiment.settings.images.keys().map(String::as_str).collect()),
            probes: self.experiment.probes,
        };
        let judges = Judges::new(&*reference.brdf, panel);
        let judges = judges.map_err(|source| self.failed(source))?;
        // The fits under D9.Cl that several losses of one model begin from.
        let mut log_fits: Option<LogFits> = None;
        let record = |((model, loss), kept): ((&str, Loss), Option<FitRecord>)| {
            let record = match kept {
                Some(kept) if kept.images == *self.image_versions => kept,
                Some(kept) => self.judged_again(kept, &judges)?,
                None => self.fit(&reference, model, loss, &judges, &mut log_fits)?,
            };
            count();
            Ok(record)
        };
        self.items().zip(kept).map(record).collect()
    }

    fn fit(
        &self,
        reference: &OpenBrdf,
        model: &str,
        loss: Loss,
        judges: &Judges<'_>,
        log_fits: &mut Option<LogFits>,
    ) -> Result<FitRecord, ExperimentError> {
        let settings = self.experiment.settings;
        let metric: Arc<dyn Metric> = match (loss.role(), loss) {
            (Some(role), _) => Arc::new(self.unseen(role)?.clone()),
            (None, Loss::Transport) => self.graphs[0].clone(),
            (None, Loss::Energy) => self.graphs[1].clone(),
            (None, lp) => self.experiment.registry.get(lp.name()).map_err(|source| self.failed(source))?,
        };
        let default = Fitting::new(model, &*metric);
        let fitting = Fitting {
            start: loss.start(),
            coarsening: settings.coarsening,
            method: loss.method(default.method),
            max_evaluations: loss.is_dear().then_some(settings.max_evaluations),
            seed: settings.seed,
            ..default
        };
        let failed = |source| ExperimentError::Fit {
            material: self.material.to_owned(),
            model: model.to_owned(),
            loss: loss.name(),
            source: Box::new(source),
        };
        let log_fits = match log_fits {
            _ if !fitting.needs_log_fits().map_err(failed)? => None,
            Some(kept) if kept.model() == model => Some(&*kept),
            _ => Some(&*log_fits.insert(fitting.log_fits(&*reference.brdf).map_err(failed)?)),
        };
        let fitting = Fitting { log_fits, ..fitting };
        let fitted = fitting.run(&*reference.brdf, &|_, _| ()).map_err(failed)?;
        let record = FitRecord {
            version: VERSION,
            settings: self.fingerprint.to_owned(),
            origin: self.origin.clone(),
            material: self.material.to_owned(),
            loss,
            fit: FitFile::new(&fitting, &fitted, &reference.notation, &reference.content.to_string()),
            judged: judges.judge(&*fitted.model as &dyn Brdf).map_err(|source| self.failed(source))?,
            images: self.image_versions.clone(),
        };
        self.keep(record)
    }

    /// A kept fit, which other metrics on stimuli judged or none, by those that are asked for.
    fn judged_again(&self, mut record: FitRecord, judges: &Judges<'_>) -> Result<FitRecord, ExperimentError> {
        let fit = &record.fit;
        let file = self.file(&fit.model, record.loss);
        let mut model = fit.parameters.clone();
        model.insert("model".to_owned(), fit.model.clone().into());
        let open = model_json::from_value(&file, &model.into())?;
        let found = judges.images(&*open.brdf).map_err(|source| self.failed(source))?;
        record.judged.retain(|judge, _| !record.images.contains_key(judge));
        record.judged.extend(found);
        record.images = self.image_versions.clone();
        self.keep(record)
    }

    fn keep(&self, record: FitRecord) -> Result<FitRecord, ExperimentError> {
        let text = seal(&record).map_err(|e| ExperimentError::Write { reason: e.to_string() })?;
        (self.experiment.write)(&self.file(&record.fit.model, record.loss), &text)?;
        Ok(record)
    }

    /// The learned metric of a role that has not seen the material.
    fn unseen(&self, role: Role) -> Result<&'a LearnedMetric, ExperimentError> {
        let found = self.experiment.unseen.of(role, self.material);
        found.ok_or_else(|| {
            EvaluationError::UnknownMetric {
                name: format!("without {}", self.material),
                judged: "metrics without a material of the study".to_owned(),
            }
            .into()
        })
    }

    fn failed(&self, source: MetricError) -> ExperimentError {
        let (reference, candidate) = (self.material.to_owned(), "a fit of it".to_owned());
        ExperimentError::Metric { reference, candidate, source: Box::new(source) }
    }
}
