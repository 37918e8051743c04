//! The candidates of a study, made anew from its references.
//!
//! | method | model | how |
//! | --- | --- | --- |
//! | ABC, WARD, BLINN-PHONG, LAFORTUNE, BECKMAN-HJ | see [`METHODS`] | Hooke-Jeeves on D4.Cl |
//! | GGX, BECKMAN, DUPUY | the microfacet surface of the same light straight back | power iteration |
//! | CHEBYCHEV, LEGENDRE | rational functions | quadratic programming, where it has a solution |
//!
//! As in Lavoué et al. 2021, section 3.2, doi:10.1111/cgf.142636, with their names. **Ratings belong to the fits that people
//! saw; a candidate made here carries none.** ABC has the one refractive index that the study's stimuli behave as if they
//! had, and Ward is Duer's form, for the same reason.
//!
//! One file a fit, so that an interrupted run goes on where it stopped. A file of another reference or of other settings is
//! somebody's result: it is refused, never replaced. One of another version is computed again, with a warning.

use crate::dataset::Study;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use vernis_metric::brdf::models::schema;
use vernis_metric::brdf::{BrdfError, BrdfSource};
use vernis_metric::fit::direct::is_direct;
use vernis_metric::fit::optimizer::StopReason;
use vernis_metric::fit::{Difference, FitError, FitFile, Fitting, KeptFit, Start};
use vernis_metric::io::{Count, Observer, write_atomically};
use vernis_metric::metric::Metric;

/// The study's name of a method, and the model that is fitted for it.
pub const METHODS: [(&str, &str); 10] = [
    ("ABC", "abc-study"),
    ("WARD", "ward-duer"),
    ("BLINN-PHONG", "blinn-phong"),
    ("LAFORTUNE", "lafortune"),
    ("BECKMAN-HJ", "beckmann"),
    ("GGX", "dupuy-ggx"),
    ("BECKMAN", "dupuy-beckmann"),
    ("DUPUY", "dupuy"),
    ("CHEBYCHEV", "rational-chebyshev"),
    ("LEGENDRE", "rational-legendre"),
];

/// One fit of the list.
#[derive(Debug, Clone, PartialEq)]
pub struct Refit {
    /// Name of the reference's material.
    pub material: String,
    /// Of [`METHODS`].
    pub method: &'static str,
    /// Identifier of the model that is fitted.
    pub model: &'static str,
    /// Name of its file.
    pub file: String,
    /// What became of the fit.
    pub outcome: Outcome,
    /// Why a file that was there was not taken for the fit that is asked for, where it is damaged.
    pub warning: Option<String>,
}

/// What became of it.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// Fitted now.
    Fitted(Box<FitFile>),
    /// The file of an earlier run with the same settings.
    Kept(Box<FitFile>),
    /// There is no such fit, for the reason given: a rational function without a solution, a reference without retro-reflection.
    None(String),
}

impl Outcome {
    /// The fit, if there is one.
    pub fn file(&self) -> Option<&FitFile> {
        match self {
            Self::Fitted(file) | Self::Kept(file) => Some(file),
            Self::None(_) => None,
        }
    }
}

/// How to make them.
#[derive(Clone)]
pub struct RefitOptions {
    /// Folder that relative sources are looked up in.
    pub data: Option<PathBuf>,
    /// Where the files lie; fits that are there and have the same settings are not made again.
    pub folder: PathBuf,
    /// The loss, the study's being D4.Cl.
    pub metric: Arc<dyn Metric>,
    /// Of [`METHODS`].
    pub methods: Vec<(&'static str, &'static str)>,
    /// Cells of the metric to a cell of the search, along each axis.
    pub coarsening: usize,
    /// A search begins at the model's own start, the same for every reference, instead of at one that the reference suggests.
    pub plain_start: bool,
}

/// All methods for every reference of `study`, sorted by material, then method; the same whatever the number of threads.
///
/// # Errors
/// A kept file that belongs to another run ([`FitError::Kept`]), found before the first fit but for its reference's content; a
/// reference that cannot be opened, a file that cannot be written, a loss that fails. Fits that do not exist are no error.
pub fn refit(study: &Study, options: &RefitOptions, progress: Observer<'_>) -> Result<Vec<Refit>, FitError> {
    let references: BTreeMap<&str, &BrdfSource> =
        study.pairs.iter().map(|p| (p.material.as_str(), &p.reference)).collect();
    for material in references.keys() {
        for &(method, model) in &options.methods {
            options.kept(material, method, model, None)?;
        }
    }
    let done = Count::of(references.len() * options.methods.len());
    let of_material = |(material, source): (&&str, &&BrdfSource)| {
        let mut all = Vec::with_capacity(options.methods.len());
        for &(method, model) in &options.methods {
            all.push(options.one(material, source, method, model)?);
            done.one(|found| progress("fits", found));
        }
        Ok(all)
    };
    let all = references.par_iter().map(of_material).collect::<Result<Vec<Vec<Refit>>, FitError>>()?;
    Ok(all.into_iter().flatten().collect())
}

impl RefitOptions {
    fn fitting(&self, model: &'static str) -> Result<Fitting<'_>, FitError> {
        let plain = || -> Result<Start, FitError> {
            let schema = schema(model).map_err(FitError::Model)?;
            Ok(Start::Parameters(schema.iter().map(|parameter| parameter.start).collect()))
        };
        let start = if self.plain_start && !is_direct(model) { Some(plain()?) } else { None };
        Ok(Fitting { coarsening: self.coarsening, start, ..Fitting::new(model, &*self.metric) })
    }

    /// What an earlier run has left, and why a file that is there is not taken. `sha256` is that of the reference, where it is known.
    fn kept(
        &self,
        material: &str,
        method: &str,
        model: &'static str,
        sha256: Option<&str>,
    ) -> Result<(Option<Box<FitFile>>, Option<String>), FitError> {
        let path = self.folder.join(file_of(material, method));
        let again = |reason: String| Ok((None, Some(format!("{}: {reason}; the fit is made again", path.display()))));
        let kept = match FitFile::read(&path) {
            KeptFit::Whole(kept) => kept,
            KeptFit::Absent => return Ok((None, None)),
            KeptFit::Refused(reason) => return again(reason),
        };
        let differences = kept.differences(&self.fitting(model)?, sha256.unwrap_or(&kept.reference.sha256));
        let (versions, others): (Vec<_>, Vec<_>) = differences.into_iter().partition(Difference::is_version);
        if !others.is_empty() {
            return Err(FitError::Kept { path: path.display().to_string(), differences: others });
        }
        match versions.first() {
            Some(version) => again(version.to_string()),
            None if kept.stop == StopReason::Interrupted => Ok((None, None)),
            None => Ok((Some(kept), None)),
        }
    }

    fn one(
        &self,
        material: &str,
        source: &BrdfSource,
        method: &'static str,
        model: &'static str,
    ) -> Result<Refit, FitError> {
        let (fitting, file) = (self.fitting(model)?, file_of(material, method));
        let opened = |e: BrdfError| FitError::Reference { material: material.to_owned(), cause: Box::new(e) };
        let reference = source.open(self.data.as_deref()).map_err(opened)?;
        let sha256 = reference.content.to_string();
        let path = self.folder.join(&file);
        let (kept, warning) = self.kept(material, method, model, Some(&sha256))?;
        let outcome = match kept {
            Some(kept) => Outcome::Kept(kept),
            None => match fitting.run(&*reference.brdf, &|_, _| ()) {
                Ok(fitted) => {
                    let result = FitFile::new(&fitting, &fitted, &reference.notation, &sha256);
                    let written = write_atomically(&path, result.to_json()?.as_bytes());
                    written.map_err(|e| FitError::Write { reason: format!("{}: {e}", path.display()) })?;
                    Outcome::Fitted(Box::new(result))
                }
                Err(error @ (FitError::Infeasible { .. } | FitError::Model(_))) => Outcome::None(error.to_string()),
                Err(error) => return Err(error),
            },
        };
        Ok(Refit { material: material.to_owned(), method, model, file, outcome, warning })
    }
}

/// Name of the file of a fit.
fn file_of(material: &str, method: &str) -> String {
    format!("{}.{method}.json", file_name(material))
}

/// A name for files that no two materials share: all but letters, digits, `-`, `_` and `.` as their code points.
pub fn file_name(material: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_.".contains(c);
    material.chars().map(|c| if plain(c) { c.to_string() } else { format!("%{:X}", u32::from(c)) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn a_plain_start_is_the_models_own() {
        let metric = vernis_metric::metric::registry::Registry::standard().unwrap().get("D4.Cl").unwrap();
        let (folder, methods) = (PathBuf::new(), Vec::new());
        let mut options = RefitOptions { data: None, folder, metric, methods, coarsening: 5, plain_start: true };
        let own = schema("ward").unwrap().iter().map(|parameter| parameter.start).collect();
        assert_eq!(options.fitting("ward").unwrap().start, Some(Start::Parameters(own)));
        assert_eq!(options.fitting("dupuy").unwrap().start, None);
        assert!(matches!(options.fitting("wart"), Err(FitError::Model(_))));
        options.plain_start = false;
        assert_eq!(options.fitting("ward").unwrap().start, None);
    }

    #[test]
    fn every_method_has_a_model_and_materials_have_file_names() {
        assert!(METHODS.iter().all(|(_, model)| schema(model).is_ok()));
        assert_eq!(file_name("merl/blue-acrylic.binary"), "merl%2Fblue-acrylic.binary");
    }
}
