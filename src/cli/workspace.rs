//! What subcommands share: opening BRDFs, the cache folder, and metrics by name or file.

use super::output::Inputs;
use super::view::View;
use super::{Shared, check_weights_folder, user_error, warning};
#[cfg(feature = "train")]
use crate::experiment::ExperimentError;
use anyhow::Result;
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use vernis_image::metric::Conditions;
use vernis_image::stimulus;
use vernis_metric::brdf::{Brdf, BrdfSource, OpenBrdf};
use vernis_metric::descriptor::{Cache, DescriptorOptions};
use vernis_metric::metric::learned::{self, LearnedMetric};
use vernis_metric::metric::registry::Registry;
use vernis_metric::metric::{Metric, Score};

/// The metric that is used where none is named.
pub const DEFAULT_METRIC: &str = "vernis";

/// Opens a BRDF given in the source notation.
pub fn open(notation: &str, data: Option<&Path>) -> Result<OpenBrdf> {
    BrdfSource::parse(notation).and_then(|source| source.open(data)).map_err(user_error)
}

/// The same where nobody asks for its content hash.
pub fn open_unhashed(notation: &str, data: Option<&Path>) -> Result<Arc<dyn Brdf>> {
    BrdfSource::parse(notation).and_then(|source| source.open_unhashed(data)).map_err(user_error)
}

/// Which metrics, on which cells, under which lights.
#[derive(Args)]
pub struct MetricChoice {
    /// A metric by name, `all-lp`, or the path of an exported metric; may be given several times [default: vernis]. A file whose
    /// metric has the name of a built-in one is called NAME@FILE.
    #[arg(long = "metric", short = 'm', value_name = "NAME|FILE")]
    names: Vec<String>,
    /// Grid of the metrics on graphs, THETA_IxTHETA_OxPHI_D [default: 45x45x180].
    #[arg(long, value_name = "GRID")]
    grid: Option<String>,
    #[command(flatten)]
    view: View,
}

impl MetricChoice {
    /// The files that are read for the metrics.
    pub fn inputs(&self) -> Inputs {
        Inputs::default().files(&self.names).view(&self.view)
    }

    /// The metrics, those on graphs on the grid that is named unless their own name says another.
    pub fn metrics(&self, shared: &Shared) -> Result<Vec<Arc<dyn Metric>>> {
        let metrics = metrics(shared, &self.names, &self.view.options())?;
        let Some(grid) = &self.grid else { return Ok(metrics) };
        let grid = grid.parse().map_err(|e| user_error(format!("--grid: {e}")))?;
        let on_grid: Vec<_> = metrics.iter().map(|metric| metric.on_grid(grid)).collect();
        if on_grid.iter().all(Option::is_none) {
            let names = metrics.iter().map(|m| m.name()).collect::<Vec<_>>().join(", ");
            return Err(user_error(format!(
                "--grid needs a metric with a grid, and none of {names} has one; ot, energy and mmd-* do"
            )));
        }
        Ok(metrics.into_iter().zip(on_grid).map(|(metric, on_grid)| on_grid.unwrap_or(metric)).collect())
    }
}

/// Every metric, those on stimuli among them.
pub fn registry(shared: &Shared) -> Result<Registry> {
    Ok(stimulus::registry(shared.data.as_deref(), conditions(shared)?)?)
}

/// What the folder of weights holds.
pub fn conditions(shared: &Shared) -> Result<Conditions> {
    let Some(folder) = &shared.weights else { return Ok(Conditions::default()) };
    check_weights_folder(folder)?;
    Conditions::of_folder(folder).map_err(user_error)
}

/// The metrics called `names`; a name that ends in `.json` is the path of an exported metric, which may need the probe or the mesh
/// of `options`, and which is called `NAME@FILE` where a built-in metric has its name. No name means the shipped one.
pub fn metrics(shared: &Shared, names: &[String], options: &DescriptorOptions) -> Result<Vec<Arc<dyn Metric>>> {
    let registry = registry(shared)?;
    let default = [DEFAULT_METRIC.to_owned()];
    let names = if names.is_empty() { &default[..] } else { names };
    let mut found: Vec<Arc<dyn Metric>> = Vec::new();
    for name in names {
        let new = if name.ends_with(".json") {
            let learned = LearnedMetric::load_with(Path::new(name), options).map_err(user_error)?;
            vec![Arc::new(registry.beside(learned, Path::new(name))) as Arc<dyn Metric>]
        } else {
            registry.resolve(name).map_err(user_error)?
        };
        for metric in new {
            let twice = found.iter().any(|m| m.name() == metric.name());
            if twice && name.ends_with(".json") {
                return Err(user_error(format!(
                    "{name}: its metric is called `{}`, and so is another one that was asked for; ask for only one of them",
                    metric.name()
                )));
            }
            if !twice {
                found.push(metric);
            }
        }
    }
    Ok(found)
}

/// The one metric called `name`.
pub fn one_metric(shared: &Shared, name: &str, options: &DescriptorOptions) -> Result<Arc<dyn Metric>> {
    let mut found = metrics(shared, &[name.to_owned()], options)?;
    match (found.pop(), found.is_empty()) {
        (Some(metric), true) => Ok(metric),
        _ => Err(user_error(format!("--metric is {name}, which is several metrics; it must be one"))),
    }
}

/// The folder for what was computed before.
pub fn cache_folder(shared: &Shared) -> PathBuf {
    shared.cache.clone().unwrap_or_else(Cache::user_folder)
}

/// Opens the cache. A folder that cannot be used costs time, not results: a warning, unless the user named it.
pub fn cache(shared: &Shared) -> Result<Option<Cache>> {
    match Cache::open(&cache_folder(shared)) {
        Ok(cache) => Ok(Some(cache)),
        Err(error) if shared.cache.is_some() => Err(user_error(error)),
        Err(error) => {
            warning(format_args!("{error}; going on without a cache"));
            Ok(None)
        }
    }
}

/// Fetches or builds what comparisons of these metrics need, whatever the BRDFs.
pub fn warm_up(shared: &Shared, metrics: &[Arc<dyn Metric>]) -> Result<()> {
    // Only learned metrics and those on stimuli need anything: others leave the cache alone.
    let uses = [learned::FAMILY, stimulus::FAMILY];
    if metrics.iter().any(|m| uses.contains(&m.properties().family))
        && let Some(cache) = cache(shared)?
    {
        warn(metrics.iter().filter_map(|metric| metric.warm_up(&cache)));
    }
    Ok(())
}

/// An error of an experiment as one of the command line: what is wrong with the user's study or files is the user's to mend.
#[cfg(feature = "train")]
pub fn experiment_error(error: ExperimentError) -> anyhow::Error {
    match error {
        ExperimentError::Study(_) | ExperimentError::Extraction(_) | ExperimentError::Open(_) => user_error(error),
        ExperimentError::Unsupported { .. } | ExperimentError::Setting { .. } => user_error(error),
        ExperimentError::Descriptor(_) | ExperimentError::Metric { .. } | ExperimentError::Table { .. } => {
            user_error(error)
        }
        other => anyhow::Error::new(other),
    }
}

/// On which scales the scores of metrics are that are not on 1 to 5, a line each.
pub fn scales<'a>(scores: impl Iterator<Item = (&'a str, Option<Score>)>) -> String {
    let scored = scores.filter_map(|(metric, score)| Some((metric, score?.scale)));
    let others = scored.filter(|(_, scale)| !scale.is_grades());
    others.map(|(metric, scale)| format!("scores of {metric} are on {scale}\n")).collect()
}

/// Says what could not be kept.
pub fn warn(warnings: impl IntoIterator<Item = impl std::fmt::Display>) {
    warnings.into_iter().for_each(warning);
}
