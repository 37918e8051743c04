//! The stimuli of a study that are rendered already, for pages that show them.

use super::{FORMAT, MOST_BYTES, Sidecar, Stimulus, camera, stimuli};
use crate::dataset::Study;
use crate::samples::shard::Shard;
use rayon::prelude::*;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use thiserror::Error;
use vernis_image::scene::file::is_film;
use vernis_metric::brdf::{BrdfError, ContentHash};
use vernis_metric::io::{Count, Observer, counted, read_at_most};

/// More than a file beside a picture takes.
const MOST_OF_SIDECAR: u64 = 1 << 20;

/// Why a folder cannot be used as the stimuli of a study.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum FoundError {
    #[error(transparent)]
    Brdf(#[from] BrdfError),
    #[error("{}: no such folder; it must be one that `vernis render --study {study}` wrote", folder.display())]
    NoFolder { folder: PathBuf, study: String },
    #[error(
        "{} holds none of the {} of {study}; it must be the folder that `vernis render --study {study}` wrote: the first \
         file that is looked for is {first}",
        folder.display(),
        counted(*looked_for, "stimulus")
    )]
    Nothing { folder: PathBuf, study: String, looked_for: usize, first: String },
    #[error("{}: {reason}; it must be as `vernis render` writes it beside a picture", path.display())]
    Sidecar { path: PathBuf, reason: String },
    #[error(
        "{} says that the picture shows {found}, but in {study} it is {expected}; \
         name the folder with the stimuli of this study, or render them anew",
        path.display()
    )]
    AnotherStudy { path: PathBuf, found: String, study: String, expected: String },
    #[error("{}: {reason}; `vernis render` makes a damaged picture anew", path.display())]
    Broken { path: PathBuf, reason: String },
}

/// A stimulus that is there.
#[derive(Debug, Clone)]
pub struct Found {
    /// What it shows.
    pub stimulus: Stimulus,
    /// How it was made.
    pub sidecar: Sidecar,
    /// Its PNG file, whose content is as the sidecar says.
    pub png: PathBuf,
}

/// The stimuli of a study in a folder.
#[derive(Debug, Clone)]
pub struct FoundStimuli {
    /// The folder.
    pub folder: PathBuf,
    /// How many pictures the whole study has.
    pub looked_for: usize,
    /// Those that are there, in the order of [`stimuli`]; at least one.
    pub found: Vec<Found>,
}

/// The stimuli of `study` that `folder` holds; BRDFs are looked for below `data`. Each is of a BRDF with the content that the study's
/// has, and its PNG file is whole. `observer` is told of pictures that were looked at.
///
/// # Errors
/// No folder, or one without a stimulus of the study; a stimulus of another BRDF; a file that is not as it was written.
pub fn found(
    study: &Study,
    folder: &Path,
    data: Option<&Path>,
    observer: Observer,
) -> Result<FoundStimuli, FoundError> {
    if !folder.is_dir() {
        return Err(FoundError::NoFolder { folder: folder.to_owned(), study: study.name.clone() });
    }
    let all = stimuli(study, Shard::WHOLE);
    let total = all.len();
    let done = Count::of(total);
    let look = |stimulus: &Stimulus| {
        let found = one(study, stimulus, folder, data);
        done.one(|progress| observer("stimuli", progress));
        found
    };
    // The first error in the order of the study, whatever thread meets one first.
    let looked: Vec<Result<Option<Found>, FoundError>> = all.par_iter().map(look).collect();
    let found: Vec<Found> = looked.into_iter().filter_map(Result::transpose).collect::<Result<_, _>>()?;
    if found.is_empty() {
        let first = all.first().map_or_else(String::new, |stimulus| format!("{}.json", stimulus.name));
        let (folder, study) = (folder.to_owned(), study.name.clone());
        return Err(FoundError::Nothing { folder, study, looked_for: total, first });
    }
    Ok(FoundStimuli { folder: folder.to_owned(), looked_for: total, found })
}

/// `None` if it is not rendered yet: the sidecar is written last.
fn one(study: &Study, stimulus: &Stimulus, folder: &Path, data: Option<&Path>) -> Result<Option<Found>, FoundError> {
    let path = folder.join(format!("{}.json", stimulus.name));
    let wrong = |reason: String| FoundError::Sidecar { path: path.clone(), reason };
    let json = match read_at_most(&path, MOST_OF_SIDECAR) {
        Ok(json) => json,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(wrong(error.to_string())),
    };
    let sidecar: Sidecar = serde_json::from_slice(&json).map_err(|error| wrong(error.to_string()))?;
    if !(1..=FORMAT).contains(&sidecar.format) {
        return Err(wrong(format!("its format is {}, and this version of vernis reads 1 to {FORMAT}", sidecar.format)));
    }
    let brdf = stimulus.source.identify(data)?;
    if sidecar.content != brdf.content.to_string() {
        let words = |notation: &str, content: &str| {
            format!("{notation} (SHA-256 {})", content.chars().take(12).collect::<String>())
        };
        return Err(FoundError::AnotherStudy {
            path,
            found: words(&sidecar.brdf, &sidecar.content),
            study: study.name.clone(),
            expected: words(&brdf.notation, &brdf.content.to_string()),
        });
    }
    let expected = camera(stimulus.view);
    if sidecar.camera != expected {
        return Err(wrong(format!("camera is `{}`, and of this picture it is `{expected}`", sidecar.camera)));
    }
    if !is_film(sidecar.size) {
        let [width, height] = sidecar.size;
        return Err(wrong(format!("size is {width}x{height}, and no film is that large")));
    }
    let png = folder.join(format!("{}.png", stimulus.name));
    let broken = |reason: String| FoundError::Broken { path: png.clone(), reason };
    let bytes = read_at_most(&png, MOST_BYTES).map_err(|error| broken(error.to_string()))?;
    if ContentHash::of(&bytes).to_string() != sidecar.png {
        return Err(broken(format!("its content is not that which {} states", path.display())));
    }
    Ok(Some(Found { stimulus: stimulus.clone(), sidecar, png }))
}
