//! The whole experiment on losses: metrics that have not seen the references, fits, judges, and what follows.

use super::Loss;
use super::record::LossesRecord;
use super::run::{Experiment, Probe, Settings, materials};
use super::unseen::{Lesson, Role, UnseenTraining};
use crate::dataset::Study;
use crate::experiment::{ExperimentError, versions};
use crate::train::{Trainer, recipe};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use vernis_image::metric::{Conditions, ImageRegistry};
use vernis_image::picture::Encoding;
use vernis_image::scene::study::{PROBE, SECOND_PROBE};
use vernis_image::stimulus;
use vernis_metric::descriptor::{Cache, DescriptorOptions, DescriptorSet, Lights, Setup, ShapeChoice};
use vernis_metric::io::{FolderLock, Observer, Progress, write_atomically};
use vernis_metric::metric::graph::GraphGrid;

/// The study's light probes.
const PROBES: [(&str, &str); 2] = [("grace", PROBE), ("uffizi", SECOND_PROBE)];
/// The models that are fitted.
const MODELS: [&str; 4] = ["ggx", "ward-duer", "blinn-phong", "principled"];
/// Metrics on pictures that judge, where they have what they need; one in the place of another that has not.
const IMAGES: [&str; 6] = ["ssim", "icid", "icid-cielab", "hdr-vdp", "st-lpips-alex", "cielab"];
/// Samples a pixel and surfaces of a path of the pictures that judge.
const PICTURES: &str = "samples=32,bounces=4";

/// What is asked, and how.
#[derive(Debug, Clone)]
pub struct LossesOptions {
    /// Folder that relative sources are looked up in, and that holds the study's two light probes.
    pub data: Option<PathBuf>,
    /// Without a cache everything is computed.
    pub cache: Option<Cache>,
    /// Where metrics and fits are kept as files; an experiment that was interrupted goes on from there.
    pub folder: PathBuf,
    /// How many references, one of each group of sisters.
    pub materials: usize,
    /// Cells of an Lp metric to a cell of its search, along each axis.
    pub coarsening: usize,
    /// Cells that transport and the energy distance compare.
    pub graph_grid: GraphGrid,
    /// Evaluations of a search under a learned metric, and of one under transport.
    pub max_evaluations: usize,
    /// Folds by material for the learned metrics.
    pub folds: usize,
    /// Bootstrap resamples of materials.
    pub resamples: usize,
    /// Of the order of materials, folds, training and resamples.
    pub seed: u64,
    /// What metrics on pictures need that is not in the program.
    pub conditions: Conditions,
    /// Without it, only the materials that are finished already are judged.
    pub compute: bool,
}

impl LossesOptions {
    fn settings(&self) -> Settings {
        let grid = self.graph_grid;
        Settings {
            models: MODELS.map(str::to_owned).to_vec(),
            losses: Loss::ALL.to_vec(),
            coarsening: self.coarsening,
            max_evaluations: self.max_evaluations,
            transport: format!("ot[grid={grid},kappa=4]"),
            energy: format!("energy[grid={grid}]"),
            seed: self.seed,
            folds: self.folds,
            images: self.images(),
        }
    }

    /// The metrics on pictures, under each of the probes.
    fn images(&self) -> BTreeMap<String, String> {
        let applicable = ImageRegistry::standard().applicable(Encoding::Srgb, &self.conditions);
        let named = |name: &&str| applicable.iter().any(|metric| metric.name() == *name);
        let judges = |name: &'static str| {
            PROBES.map(|(probe, _)| (format!("{probe}.{name}"), format!("stimulus[{name},light={probe},{PICTURES}]")))
        };
        IMAGES.into_iter().filter(named).flat_map(judges).collect()
    }
}

/// The experiment's findings.
#[derive(Debug, Clone)]
pub struct Found {
    /// The findings as plain data.
    pub record: LossesRecord,
    /// Kept fits that were damaged or changed and were made again, and what could not be kept.
    pub warnings: Vec<String>,
}

/// Fits GGX, Ward, Blinn-Phong and `principled` to references of `study` under every [`Loss`], and judges the fits by metrics that were not the
/// loss.
///
/// # Errors
/// A study that is too small for the folds, probes that are missing, BRDFs that cannot be read, a fit or a training that fails,
/// files that cannot be written, a folder into which another process writes.
pub fn losses(study: &Study, options: &LossesOptions, progress: Observer<'_>) -> Result<Found, ExperimentError> {
    study.validate(options.folds)?;
    let (settings, probes) = (options.settings(), probes(options.data.as_deref())?);
    let [fits, metrics] = ["fits", "metrics"].map(|name| options.folder.join(name));
    for folder in [&fits, &metrics] {
        fs::create_dir_all(folder).map_err(|e| unwritable(folder, &e))?;
    }
    // A report of what is there disturbs nobody.
    let _lock = options.compute.then(|| FolderLock::acquire(&options.folder)).transpose()?;
    let keep = |folder: &Path, name: &str, text: &str| {
        let path = folder.join(name);
        write_atomically(&path, text.as_bytes()).map_err(|e| unwritable(&path, &e))
    };
    progress("picture operators", Progress::BEGUN);
    let cache = options.cache.as_ref();
    let unkept = cache.iter().flat_map(|c| probes.iter().filter_map(|p| c.prepare(&p.setup)));
    let warnings = Mutex::new(unkept.map(|warning| warning.to_string()).collect::<Vec<_>>());
    let data = options.data.as_deref();
    let (of_first, first_setup) = versions::of_first(study, data, cache, progress)?;
    let (rows, setup, _) = versions::of_second(study, data, cache, progress)?;
    let (first, distance) = (recipe::first(), recipe::distance());
    let metric = recipe::metric(&distance);
    let lesson = |role, trainer| Lesson {
        role,
        samples: rows.clone(),
        setup: setup.clone(),
        set: recipe::descriptors(),
        trainer,
    };
    let lessons = [
        lesson(Role::Judge, &metric as &dyn Trainer),
        lesson(Role::Metric, &metric),
        lesson(Role::Distance, &distance),
        Lesson {
            role: Role::First,
            samples: of_first,
            setup: first_setup,
            set: DescriptorSet::extended(),
            trainer: &first,
        },
    ];
    let unseen = UnseenTraining {
        study,
        lessons: &lessons,
        folds: options.folds,
        seed: options.seed,
        folder: &metrics,
        write: &|name, text| keep(&metrics, name, text),
        progress,
    }
    .run()?;
    let registry = stimulus::registry(data, options.conditions.clone());
    let registry = registry
        .map_err(|source| ExperimentError::MetricNamed { name: "the registry".to_owned(), source: Box::new(source) })?;
    let experiment = Experiment {
        registry: &registry,
        study,
        settings: &settings,
        unseen: &unseen,
        probes: &probes,
        base: options.data.as_deref(),
        folder: &fits,
        write: &|name, text| keep(&fits, name, text),
        progress: &|p| progress("fits", p),
        warn: &|warning| {
            if let Ok(mut warnings) = warnings.lock() {
                warnings.push(warning.to_owned());
            }
        },
    };
    let records = experiment.run(&materials(study, options.materials, options.seed), !options.compute)?;
    let record = LossesRecord::new(study, &settings, &records, options.resamples)?;
    Ok(Found { record, warnings: warnings.into_inner().unwrap_or_default() })
}

/// The two light probes, which belong to the data folder.
fn probes(data: Option<&Path>) -> Result<Vec<Probe>, ExperimentError> {
    let probe = |(name, path): (&str, &str)| {
        let path = data.map_or_else(|| PathBuf::from(path), |data| data.join(path));
        let options = DescriptorOptions { lights: Lights::Probe(path), shape: ShapeChoice::Sphere };
        Ok(Probe { name: name.to_owned(), setup: Setup::new(&options)? })
    };
    PROBES.into_iter().map(probe).collect()
}

fn unwritable(path: &Path, cause: &std::io::Error) -> ExperimentError {
    ExperimentError::Write { reason: format!("{}: {cause}", path.display()) }
}
