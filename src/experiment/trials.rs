//! Fits of methods that the open study does not rebuild, made again as far as the paper says how.
//!
//! Lavoué et al. 2021, section 3.2, doi:10.1111/cgf.142636, names the search (Hooke-Jeeves) and the loss (D4.Cl) of the methods
//! whose names end in `OURS`, and the library of the rational functions (ALTA). It says nothing of starts, bounds, steps, or which
//! form of Ward. A [`Trial`] is one choice of what it leaves open; [`make`] fits it to every reference, and
//! [`rebuilt`](super::rebuilt::rebuilt) asks a judge whether people saw such candidates.
//!
//! One file a fit, in a folder a trial, so that an interrupted run goes on. Cost: a second or two a fit with a coarsening of 5.

use super::ExperimentError;
use super::rebuilt::Way;
use super::refit::{RefitOptions, refit};
use crate::dataset::manifest::Candidate;
use crate::dataset::{RatedPair, Study};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use vernis_metric::io::{Observer, did_you_mean, nearest};
use vernis_metric::metric::Metric;

/// One choice of what the paper leaves open about the fits of a method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Trial {
    /// The method as the ratings name it.
    pub method: &'static str,
    /// The identifier of the model that is fitted.
    pub model: &'static str,
    /// Whether every search begins at the model's own start instead of at one that the reference suggests.
    pub plain_start: bool,
    /// The choice, in a few words.
    pub assumes: &'static str,
}

const fn trial(method: &'static str, model: &'static str, plain_start: bool, assumes: &'static str) -> Trial {
    Trial { method, model, plain_start, assumes }
}

/// Every choice that is tried, by method.
pub const TRIALS: [Trial; 9] = [
    trial("WARD-OURS", "ward", false, "Ward's form, starts by the reference"),
    trial("WARD-OURS", "ward", true, "Ward's form, one start for all"),
    trial("WARD-OURS", "ward-duer", false, "Duer's form, starts by the reference"),
    trial("BLINN-PHONG-OURS", "blinn-phong", false, "starts by the reference"),
    trial("BLINN-PHONG-OURS", "blinn-phong", true, "one start for all"),
    trial("LAFORTUNE-OURS", "lafortune", false, "starts by the reference"),
    trial("ABC-OURS", "abc-study", false, "index of refraction 2.5, starts by the reference"),
    trial("CHEBYCHEV", "rational-chebyshev", false, "quadratic programming, where it has a solution"),
    trial("LEGENDRE", "rational-legendre", false, "quadratic programming, where it has a solution"),
];

impl Trial {
    /// Name of its folder.
    pub fn name(&self) -> String {
        format!("{}-{}{}", self.method, self.model, if self.plain_start { "-plain-start" } else { "" })
    }
}

/// The trials of the methods called `names`, upper or lower case.
///
/// # Errors
/// A method without a trial.
pub fn trials_of(names: &[String]) -> Result<Vec<Trial>, ExperimentError> {
    let known: BTreeSet<&str> = TRIALS.iter().map(|trial| trial.method).collect();
    if let Some(name) = names.iter().find(|name| !known.iter().any(|known| known.eq_ignore_ascii_case(name))) {
        let known: Vec<&str> = known.into_iter().collect();
        let reason = format!("{}; the methods are {}", did_you_mean(&nearest(name, &known)), known.join(", "));
        return Err(ExperimentError::NoTrial { method: name.clone(), reason });
    }
    let asked = |trial: &&Trial| names.iter().any(|name| name.eq_ignore_ascii_case(trial.method));
    Ok(TRIALS.iter().filter(asked).copied().collect())
}

/// How fits are made.
#[derive(Clone)]
pub struct TrialOptions {
    /// Folder that relative sources are looked up in.
    pub data: Option<PathBuf>,
    /// Where the fits of each trial have a folder.
    pub folder: PathBuf,
    /// The loss, the study's being D4.Cl.
    pub metric: Arc<dyn Metric>,
    /// Cells of the metric to a cell of the search, along each axis.
    pub coarsening: usize,
}

/// What came of a trial.
pub struct Tried {
    /// The rated pairs of the method whose reference has a fit.
    pub way: Way,
    /// Kept files that were made again, and why.
    pub warnings: Vec<String>,
}

/// Makes the fits of `trial` for every reference of `study`, a published one that is rebuilt; fits that are there are kept.
///
/// # Errors
/// Those of [`refit`]; a study that is not rebuilt; a folder that cannot be made.
pub fn make(
    study: &Study,
    trial: &Trial,
    options: &TrialOptions,
    progress: Observer<'_>,
) -> Result<Tried, ExperimentError> {
    let folder = options.folder.join(trial.name());
    let failed = |e: std::io::Error| ExperimentError::Write { reason: format!("{}: {e}", folder.display()) };
    std::fs::create_dir_all(&folder).map_err(failed)?;
    let source = folder.join(format!("{{material}}.{}.json", trial.method)).to_string_lossy().into_owned();
    let candidate = Candidate { method: trial.method.to_owned(), family: None, source };
    let rated = Study::load_rebuilt(&study.name, vec![candidate], options.data.as_deref())?;
    let refits = RefitOptions {
        data: options.data.clone(),
        folder,
        metric: options.metric.clone(),
        methods: vec![(trial.method, trial.model)],
        coarsening: options.coarsening,
        plain_start: trial.plain_start,
    };
    let of_trial = |_: &str, done| progress(&format!("fits of {}", trial.name()), done);
    let all = refit(&rated, &refits, &of_trial).map_err(|source| ExperimentError::Fit {
        material: study.name.clone(),
        model: trial.model.to_owned(),
        loss: "D4.Cl",
        source: Box::new(source),
    })?;
    let fitted: BTreeSet<&str> =
        all.iter().filter(|one| one.outcome.file().is_some()).map(|one| one.material.as_str()).collect();
    let pairs: Vec<RatedPair> =
        rated.pairs.into_iter().filter(|pair| fitted.contains(pair.material.as_str())).collect();
    let (method, assumes) = (trial.method.to_owned(), trial.assumes.to_owned());
    let warnings = all.iter().filter_map(|one| one.warning.clone()).collect();
    Ok(Tried { way: Way { method, assumes, used: false, pairs }, warnings })
}

#[cfg(test)]
mod tests {
    use super::*;
    use vernis_metric::brdf::models::schema;

    #[test]
    fn trials_have_models_and_folders_of_their_own_and_methods_that_nothing_rebuilds() {
        let names: BTreeSet<String> = TRIALS.iter().map(Trial::name).collect();
        assert_eq!(names.len(), TRIALS.len());
        let manifest = crate::dataset::manifest::Manifest::embedded(crate::dataset::manifest::OPEN).expect("embedded");
        let candidates = manifest.rebuilt.expect("the open study is rebuilt").candidates;
        for trial in TRIALS {
            assert!(schema(trial.model).is_ok() && manifest.rated.method(trial.method).is_some(), "{trial:?}");
            assert!(candidates.iter().all(|candidate| candidate.method != trial.method), "{trial:?}");
        }
        assert_eq!(trials_of(&["ward-ours".to_owned()]).expect("known").len(), 3);
        let message = trials_of(&["WARD".to_owned()]).expect_err("rebuilt already").to_string();
        assert!(
            message.contains("WARD") && message.contains("the methods are ABC-OURS, BLINN-PHONG-OURS"),
            "{message}"
        );
    }
}
