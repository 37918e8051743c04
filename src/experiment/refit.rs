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
//! One file a fit, so that an interrupted run goes on where it stopped.

use crate::dataset::Study;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use vernis_metric::brdf::{BrdfError, BrdfSource};
use vernis_metric::descriptor::Progress;
use vernis_metric::fit::{FitError, FitFile, Fitting};
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
    pub material: String,
    /// Of [`METHODS`].
    pub method: &'static str,
    pub model: &'static str,
    /// Name of its file.
    pub file: String,
    pub outcome: Outcome,
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
pub struct Refitting<'a> {
    /// The loss, the study's being D4.Cl.
    pub metric: &'a dyn Metric,
    /// Of [`METHODS`].
    pub methods: Vec<(&'static str, &'static str)>,
    pub coarsening: usize,
    /// Where relative sources are looked up.
    pub base: Option<&'a Path>,
    /// Where the files lie.
    pub folder: &'a Path,
    /// Keeps the text of a file under its name.
    pub write: &'a (dyn Fn(&str, &str) -> Result<(), FitError> + Sync),
    pub progress: &'a (dyn Fn(Progress) + Sync),
}

impl Refitting<'_> {
    /// All methods for every reference of `study`, sorted by material, then method; the same whatever the number of threads.
    ///
    /// # Errors
    /// A reference that cannot be opened, a file that cannot be written, a loss that fails. Fits that do not exist are no error.
    pub fn run(&self, study: &Study) -> Result<Vec<Refit>, FitError> {
        let references: BTreeMap<&str, &BrdfSource> =
            study.pairs.iter().map(|p| (p.material.as_str(), &p.reference)).collect();
        let (done, total) = (AtomicUsize::new(0), references.len() * self.methods.len());
        let of_material = |(material, source): (&&str, &&BrdfSource)| {
            let mut all = Vec::with_capacity(self.methods.len());
            for &(method, model) in &self.methods {
                all.push(self.one(material, source, method, model)?);
                (self.progress)(Progress { done: done.fetch_add(1, Ordering::Relaxed) + 1, total });
            }
            Ok(all)
        };
        let all = references.par_iter().map(of_material).collect::<Result<Vec<Vec<Refit>>, FitError>>()?;
        Ok(all.into_iter().flatten().collect())
    }

    fn one(
        &self,
        material: &str,
        source: &BrdfSource,
        method: &'static str,
        model: &'static str,
    ) -> Result<Refit, FitError> {
        let fitting = Fitting { coarsening: self.coarsening, ..Fitting::new(model, self.metric) };
        let file = format!("{}.{method}.json", file_name(material));
        let opened = |e: BrdfError| FitError::Reference { material: material.to_owned(), cause: Box::new(e) };
        let reference = source.open(self.base).map_err(opened)?;
        let sha256 = reference.content.to_string();
        let kept = FitFile::read(&self.folder.join(&file)).filter(|f| f.is_result_of(&fitting, &sha256));
        let outcome = match kept {
            Some(kept) => Outcome::Kept(Box::new(kept)),
            None => match fitting.run(&*reference.brdf, &|_, _| ()) {
                Ok(fitted) => {
                    let result = FitFile::new(&fitting, &fitted, &reference.notation, &sha256);
                    (self.write)(&file, &result.to_json()?)?;
                    Outcome::Fitted(Box::new(result))
                }
                Err(error @ (FitError::Infeasible { .. } | FitError::Model(_))) => Outcome::None(error.to_string()),
                Err(error) => return Err(error),
            },
        };
        Ok(Refit { material: material.to_owned(), method, model, file, outcome })
    }
}

/// A name for files that no two materials share: all but letters, digits, `-`, `_` and `.` as their code points.
pub fn file_name(material: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_.".contains(c);
    material.chars().map(|c| if plain(c) { c.to_string() } else { format!("%{:X}", u32::from(c)) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use vernis_metric::brdf::models::schema;

    #[test]
    fn every_method_has_a_model_and_materials_have_file_names() {
        assert!(METHODS.iter().all(|(_, model)| schema(model).is_ok()));
        assert_eq!(file_name("merl/blue-acrylic.binary"), "merl%2Fblue-acrylic.binary");
    }
}
