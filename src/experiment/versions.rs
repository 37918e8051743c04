//! Is version 2 of the metric better than version 1? Both recipes on the rows that version 1 knew, out of fold, paired.
//!
//! Version 1 is trained and judged as it was: its descriptors, the rows of the methods that the study had then (the first named set of
//! rows), the mean of a landmark kernel and of networks. Version 2 is trained on all rows and triplets that the split allows, and
//! judged on the same rows. Differences are on the same resamples of groups of materials. The distance of version 2, `vernis-loss`, is
//! compared in the same way. Cost: the trainings of two benchmarks; descriptors are cached.

use super::ExperimentError;
use super::contenders::taken;
use super::train::{extract, triplet_samples};
use crate::dataset::Study;
use crate::dataset::triplets::StudyTriplets;
use crate::evaluation::agreement::{Figure, Predictions, Ratings};
use crate::evaluation::bootstrap::{self, Bootstrapped, Difference, Interval};
use crate::evaluation::cross_validation::cross_validate;
use crate::evaluation::records::Split;
use crate::samples::Samples;
use crate::samples::split::{Fold, grouped_folds, method_and_group_folds};
use crate::train::{Trainer, recipe};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use vernis_metric::descriptor::{Cache, DescriptorOptions, Setup};
use vernis_metric::io::{Observer, Progress};

/// The setup of version 1.
const FIRST_SETUP: &str = "v1-lamps-sphere";
/// Splits that are compared.
const SPLITS: [Split; 2] = [Split::UnseenMaterial, Split::UnseenMaterialAndMethod];

/// How the versions are compared.
#[derive(Debug, Clone)]
pub struct VersionsOptions {
    /// Folder that relative sources are looked up in.
    pub data: Option<PathBuf>,
    /// Without a cache every descriptor is computed.
    pub cache: Option<Cache>,
    /// Folds by material.
    pub folds: usize,
    /// Bootstrap resamples of materials.
    pub resamples: usize,
    /// Of folds, training and resamples.
    pub seed: u64,
}

/// One recipe under one split.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VersionAgreement {
    /// Such as `vernis 2.0`.
    pub recipe: String,
    /// What it had seen.
    pub split: Split,
    /// Pearson's r after the clip to the scale, with its 95 % interval.
    pub plcc: (f64, Interval),
    /// Spearman's rho.
    pub srocc: (f64, Interval),
    /// This minus version 1, PLCC and SROCC; `None` for version 1 itself.
    pub differences: Option<[Difference; 2]>,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VersionsRecord {
    /// The study.
    pub study: String,
    /// Name of the rows that are judged.
    pub rows_are: String,
    /// Their number.
    pub rows: usize,
    /// Rows that version 2 may learn from.
    pub all_rows: usize,
    /// Why version 2 learned from no judged triplets; `None` where it learned from some.
    pub no_triplets: Option<String>,
    /// Folds by material.
    pub folds: usize,
    /// Bootstrap resamples of materials.
    pub resamples: usize,
    /// Of folds, training and resamples.
    pub seed: u64,
    /// Split by split, version 1 first.
    pub agreement: Vec<VersionAgreement>,
}

/// Compares the recipes.
///
/// # Errors
/// A study with fewer groups than folds or one family of methods; BRDFs that cannot be read; training that fails.
pub fn versions(
    study: &Study,
    options: &VersionsOptions,
    progress: Observer<'_>,
) -> Result<VersionsRecord, ExperimentError> {
    let (data, cache) = (options.data.as_deref(), options.cache.as_ref());
    let known = study.row_sets()?.into_iter().next();
    let is_known = |method: &str| known.as_ref().is_none_or(|set| set.methods.iter().any(|name| name == method));
    let (first, _) = of_first(study, data, cache, progress)?;
    let (second, _, no_triplets) = of_second(study, data, cache, progress)?;
    // Both sets of rows stand in the order of the study, so these are the rows of version 1, one by one.
    let judged: Vec<usize> = (0..second.len()).filter(|&row| is_known(&second.rows()[row].method)).collect();

    let ratings = Ratings::of(first.rows());
    let resamples = bootstrap::draw(&ratings, options.resamples, options.seed)?;
    let (first_recipe, distance) = (recipe::first(), recipe::distance());
    let second_recipe = recipe::metric(&distance);
    let mut agreement = Vec::new();
    for split in SPLITS {
        let folds = |samples: &Samples| -> Result<Vec<Fold>, ExperimentError> {
            Ok(match split {
                Split::UnseenMaterial => grouped_folds(samples, options.folds, options.seed)?,
                _ => method_and_group_folds(samples, options.folds, options.seed)?,
            })
        };
        let out_of_fold = |name: &str, samples: &Samples, trainer: &dyn Trainer| {
            progress(&format!("{name}, {}", split.label()), Progress::BEGUN);
            Ok::<_, ExperimentError>(cross_validate(samples, &folds(samples)?, trainer, options.seed)?.predictions)
        };
        let on_judged = |found: Predictions| {
            let of = |values: &[f64]| judged.iter().map(|&row| values[row]).collect::<Vec<f64>>();
            Predictions::new(of(&found.score), of(&found.mos))
        };
        let bootstrapped = |name: &str, found: &Predictions| Bootstrapped::of(name, &ratings, found, &resamples);
        let names = ["vernis 1", "vernis", "vernis-loss"];
        let base = bootstrapped(names[0], &out_of_fold(names[0], &first, &first_recipe)?)?;
        agreement.push(told(names[0].to_owned(), split, &base, None)?);
        for (name, trainer) in [(names[1], &second_recipe as &dyn Trainer), (names[2], &distance)] {
            let found = bootstrapped(name, &on_judged(out_of_fold(name, &second, trainer)?))?;
            agreement.push(told(format!("{name} {}", recipe::METRIC_VERSION), split, &found, Some(&base))?);
        }
    }
    Ok(VersionsRecord {
        study: study.name.clone(),
        rows_are: known.map_or_else(|| "all rows".to_owned(), |set| set.name),
        rows: judged.len(),
        all_rows: second.len(),
        no_triplets,
        folds: options.folds,
        resamples: options.resamples,
        seed: options.seed,
        agreement,
    })
}

/// What version 1 learned from: the rows that it knew, with descriptors of its own, and their setup.
pub(super) fn of_first(
    study: &Study,
    data: Option<&Path>,
    cache: Option<&Cache>,
    progress: Observer<'_>,
) -> Result<(Samples, Arc<Setup>), ExperimentError> {
    let known = study.row_sets()?.into_iter().next();
    let is_known = |method: &str| known.as_ref().is_none_or(|set| set.methods.iter().any(|name| name == method));
    let pairs = study.pairs.iter().filter(|pair| is_known(&pair.method)).cloned().collect();
    let setup = Setup::find(FIRST_SETUP, &DescriptorOptions::default())?;
    let extraction = extract(&Study { pairs, ..study.clone() }, &setup, data, cache, progress)?;
    Ok((extraction.samples.select_columns(recipe::uses), setup))
}

/// What the metric learns from: every row, and the judged triplets where the study has some; why it has none.
pub(super) fn of_second(
    study: &Study,
    data: Option<&Path>,
    cache: Option<&Cache>,
    progress: Observer<'_>,
) -> Result<(Samples, Arc<Setup>, Option<String>), ExperimentError> {
    let setup = Setup::standard();
    let all = extract(study, &setup, data, cache, progress)?.samples;
    let (triplets, none) = match StudyTriplets::of_study(&study.name, data)? {
        Ok(found) => (Some(triplet_samples(&found, &setup, data, cache, progress)?.0), None),
        Err(reason) => (None, Some(reason)),
    };
    Ok((taken(&all, triplets.as_ref())?, setup, none))
}

fn told(
    recipe: String,
    split: Split,
    found: &Bootstrapped,
    base: Option<&Bootstrapped>,
) -> Result<VersionAgreement, ExperimentError> {
    let undefined = || ExperimentError::Write { reason: format!("{recipe}: the paired differences are not defined") };
    let differences = match base {
        None => None,
        Some(base) => {
            let of = |figure| found.difference(base, figure).ok_or_else(undefined);
            Some([of(Figure::Plcc)?, of(Figure::Srocc)?])
        }
    };
    let (value, interval) = (&found.agreement, &found.intervals);
    let (plcc, srocc) = ((value.plcc, interval.plcc), (value.srocc, interval.srocc));
    Ok(VersionAgreement { recipe, split, plcc, srocc, differences })
}
