//! Pictures of a study's references and candidates, for its page.

use super::gallery::Gallery;
use super::page::materials::{Candidate, Material};
use crate::dataset::Study;
use crate::evaluation::records::BenchmarkRecord;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;
use thiserror::Error;
use vernis_metric::brdf::{BrdfError, BrdfSource};
use vernis_metric::light::LightError;
use vernis_metric::light::source::Light;
use vernis_metric::light::sphere::Sphere;

/// Pixels a side.
const SIDE: usize = 48;

/// Why a material has no picture.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum PictureError {
    #[error(transparent)]
    Source(#[from] Box<BrdfError>),
    #[error("{notation}: {source}")]
    Render { notation: String, source: Box<LightError> },
}

/// The lamps of [`of_benchmark`] and of pages where there is no probe, in words.
pub const LAMPS_IN_WORDS: &str = "lamps that are defined by code";
/// Their layout.
const LAMPS: usize = 1;
/// Materials of [`of_benchmark`].
const MOST_OF_BENCHMARK: usize = 10;

/// The lamps of [`LAMPS_IN_WORDS`].
pub fn lamps() -> Light {
    Light::lamps(LAMPS)
}

/// The materials of the report on a benchmark: those on which its metric is furthest off, under [`lamps`].
///
/// # Errors
/// Those of [`of_study`].
pub fn of_benchmark(
    study: &Study,
    base: Option<&Path>,
    benchmark: &BenchmarkRecord,
) -> Result<Vec<Material>, PictureError> {
    of_study(study, base, Some(benchmark), &lamps(), MOST_OF_BENCHMARK, None)
}

/// The materials of `study`, those first on which the first metric of `benchmark` is furthest off, at most `most`; with the
/// stimuli that `gallery` has of them.
///
/// # Errors
/// A source that cannot be read, or that has no measured values.
pub fn of_study(
    study: &Study,
    base: Option<&Path>,
    benchmark: Option<&BenchmarkRecord>,
    light: &Light,
    most: usize,
    gallery: Option<&Gallery>,
) -> Result<Vec<Material>, PictureError> {
    let errors: BTreeMap<&str, f64> =
        benchmark.iter().flat_map(|b| &b.residuals).map(|r| (r.material.as_str(), r.rms)).collect();
    let mut pairs: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (index, pair) in study.pairs.iter().enumerate() {
        pairs.entry(pair.material.as_str()).or_default().push(index);
    }
    let error = |name: &str| errors.get(name).copied();
    let mut names: Vec<&str> = pairs.keys().copied().collect();
    let rank = |name: &str| error(name).unwrap_or(f64::NEG_INFINITY);
    names.sort_by(|a, b| rank(b).total_cmp(&rank(a)).then_with(|| a.cmp(b)));
    names.truncate(most);
    let sphere = Sphere::new(SIDE, light);
    let shown = |source: &BrdfSource| -> Result<Vec<u8>, PictureError> {
        let open = source.open(base).map_err(Box::new)?;
        sphere.png(&*open.brdf).map_err(|e| PictureError::Render { notation: open.notation, source: Box::new(e) })
    };
    let material = |name: &&str| -> Result<Material, PictureError> {
        let candidate = |&index: &usize| -> Result<Candidate, PictureError> {
            let pair = &study.pairs[index];
            let prediction = benchmark.and_then(|b| {
                let subject = b.headline.first()?;
                let row = b.predictions.iter().find(|p| p.material == pair.material && p.method == pair.method)?;
                // Both are told on the scale of the study.
                let score = row.predicted.get(subject).copied()?;
                Some(b.restated(score, study.scale))
            });
            let (method, picture) = (pair.method.clone(), shown(&pair.candidate)?);
            let stimulus = gallery.and_then(|gallery| gallery.candidate(index)).cloned();
            Ok(Candidate { method, picture, stimulus, mos: study.scale.stated(pair.mos), predicted: prediction })
        };
        let of_material = &pairs[*name];
        Ok(Material {
            name: (*name).to_owned(),
            reference: shown(&study.pairs[of_material[0]].reference)?,
            stimuli: gallery.map_or([None; 2], |gallery| gallery.reference(of_material[0])).map(Option::<&_>::cloned),
            candidates: of_material.iter().map(candidate).collect::<Result<_, _>>()?,
            error: error(name),
        })
    };
    names.par_iter().map(material).collect()
}
