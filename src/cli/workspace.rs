//! What subcommands share: opening BRDFs, the cache folder, and metrics by name or file.

use super::{Shared, user_error};
use anyhow::Result;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use vernis::evaluation::bootstrap::MIN_RESAMPLES;
use vernis::report::OutputFolder;
use vernis_metric::brdf::{BrdfSource, OpenBrdf};
use vernis_metric::descriptor::{Cache, Setup};
use vernis_metric::metric::Metric;
use vernis_metric::metric::learned::LearnedMetric;
use vernis_metric::metric::registry::Registry;

/// The metric that is used where none is named.
pub const DEFAULT_METRIC: &str = "vernis";

/// Opens a BRDF given in the source notation.
pub fn open(notation: &str, data: Option<&Path>) -> Result<OpenBrdf> {
    BrdfSource::parse(notation).and_then(|source| source.open(data)).map_err(user_error)
}

/// The metrics called `names`; a name that ends in `.json` is the path of an exported metric. No name means the shipped one.
pub fn metrics(names: &[String]) -> Result<Vec<Arc<dyn Metric>>> {
    let registry = Registry::standard()?;
    let default = [DEFAULT_METRIC.to_owned()];
    let names = if names.is_empty() { &default[..] } else { names };
    let mut found: Vec<Arc<dyn Metric>> = Vec::new();
    for name in names {
        let new = if name.ends_with(".json") {
            vec![Arc::new(LearnedMetric::load(Path::new(name)).map_err(user_error)?) as Arc<dyn Metric>]
        } else {
            registry.resolve(name).map_err(user_error)?
        };
        for metric in new {
            let twice = found.iter().any(|m| m.name() == metric.name());
            if twice && name.ends_with(".json") {
                return Err(user_error(format!(
                    "{name}: its metric is called `{}`, as another one that was asked for; ask for one of them",
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

/// The metrics called `names` as [`metrics`], those on graphs on `grid` where one is given and their name names none.
pub fn metrics_on(names: &[String], grid: Option<&str>) -> Result<Vec<Arc<dyn Metric>>> {
    let metrics = metrics(names)?;
    let Some(grid) = grid else { return Ok(metrics) };
    let grid = grid.parse().map_err(|e| user_error(format!("--grid: {e}")))?;
    if metrics.iter().all(|m| m.as_graph().is_none()) {
        let names = metrics.iter().map(|m| m.name()).collect::<Vec<_>>().join(", ");
        return Err(user_error(format!(
            "--grid: found no metric with a grid among {names}; allowed with ot, energy, mmd-*"
        )));
    }
    let on_grid = |m: &Arc<dyn Metric>| m.as_graph().map_or_else(|| m.clone(), |g| g.with_default_grid(grid));
    Ok(metrics.iter().map(on_grid).collect())
}

/// The folder for what was computed before.
pub fn cache_folder(shared: &Shared) -> PathBuf {
    let variable = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let base = || variable("XDG_CACHE_HOME").or_else(|| variable("HOME").map(|home| home.join(".cache")));
    match (&shared.cache, base()) {
        (Some(folder), _) => folder.clone(),
        (None, Some(base)) => base.join("vernis"),
        (None, None) => PathBuf::from(".vernis-cache"),
    }
}

/// Opens the cache. A folder that cannot be used costs time, not results: a warning, unless the user named it.
pub fn cache(shared: &Shared) -> Result<Option<Cache>> {
    match Cache::open(&cache_folder(shared)) {
        Ok(cache) => Ok(Some(cache)),
        Err(error) if shared.cache.is_some() => Err(user_error(error)),
        Err(error) => {
            eprintln!("vernis: warning: {error}; going on without a cache");
            Ok(None)
        }
    }
}

/// Fetches or builds the picture operators, where a learned metric will need them.
pub fn prepare(metrics: &[Arc<dyn Metric>], cache: Option<&Cache>) {
    for setup in metrics.iter().filter_map(|m| m.as_learned()).map(LearnedMetric::setup) {
        warn(cache.and_then(|c| c.prepare(setup)));
    }
}

/// The folder and name of a file to write, given with --out: found unwritable before the work.
pub fn output_file(path: &Path) -> Result<(OutputFolder, String)> {
    let name = path.file_name().and_then(|n| n.to_str()).filter(|_| !path.is_dir());
    let name = name.ok_or_else(|| {
        user_error(format!("--out {}: found a folder or no name, allowed: the name of a file", path.display()))
    })?;
    let parent = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Ok((OutputFolder::create(parent).map_err(user_error)?, name.to_owned()))
}

/// Reads a number of bootstrap resamples.
pub fn resamples(text: &str) -> Result<usize, String> {
    let allowed = format!("allowed: an integer of at least {MIN_RESAMPLES}");
    text.parse().ok().filter(|n| *n >= MIN_RESAMPLES).ok_or(allowed)
}

/// Says what could not be kept.
pub fn warn(warnings: impl IntoIterator<Item = impl std::fmt::Display>) {
    for warning in warnings {
        eprintln!("vernis: warning: {warning}");
    }
}

/// The descriptors' setup of commands that take no options for it.
pub fn setup() -> Arc<Setup> {
    Setup::standard()
}
