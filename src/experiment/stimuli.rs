//! The stimuli of a study: what people would see of every reference and candidate, as files.
//!
//! `MATERIAL/reference` is the reference in its own camera, `MATERIAL/hidden-reference` the reference in the camera of the candidates, and
//! `MATERIAL/METHOD` a candidate. Each is an `.exr` of linear radiance, a `.png` as a screen shows it, and a `.json` that says what they
//! were made of, with the SHA-256 of both. A picture whose `.json` says the same and whose files are as it says is kept. What is there
//! already is found by [`found`](fn@found).

mod found;

pub use found::{Found, FoundError, FoundStimuli, found};

use crate::dataset::Study;
use crate::samples::shard::Shard;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;
use vernis_image::display::tone::Tone;
use vernis_image::picture::write::{self, WriteError};
use vernis_image::scene::study::View;
use vernis_image::scene::{Reflectance, Scene};
use vernis_image::trace::{self, TraceError, Tracer};
use vernis_metric::brdf::{BrdfError, BrdfSource, ContentHash};
use vernis_metric::io::{Observer, Progress, read_at_most, silent};

/// The layout of the `.json` beside a picture. The first had no tone.
pub const FORMAT: u32 = 2;
/// More than any picture within the limits of a film takes.
const MOST_BYTES: u64 = 1 << 30;

/// Why stimuli could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum StimuliError {
    #[error(transparent)]
    Brdf(#[from] BrdfError),
    #[error("{notation}: {cause}")]
    Trace { notation: String, cause: TraceError },
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("{}: {cause}", path.display())]
    Folder { path: PathBuf, cause: std::io::Error },
}

/// How stimuli are made.
pub struct StimuliOptions {
    /// Where BRDFs are.
    pub data: Option<PathBuf>,
    /// Where pictures go.
    pub folder: PathBuf,
    /// Which part of the study.
    pub shard: Shard,
    /// The scene; BRDF and camera are replaced.
    pub scene: Scene,
    /// The tone curve of the PNG, and its exposure in stops.
    pub tone: (Tone, f64),
}

/// What a picture is to its study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// A reference, in its own camera.
    Reference,
    /// A reference in the camera of the candidates.
    HiddenReference,
    /// A candidate.
    Candidate,
}

/// A picture of a study.
#[derive(Debug, Clone)]
pub struct Stimulus {
    /// Path in the folder, without ending: `MATERIAL/METHOD`.
    pub name: String,
    /// What it is.
    pub role: Role,
    /// The place in the study of its pair; of a reference, of its first pair.
    pub pair: usize,
    /// What is seen.
    pub source: BrdfSource,
    /// By which camera.
    pub view: View,
}

/// What the `.json` beside a picture says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sidecar {
    /// [`FORMAT`].
    pub format: u32,
    /// SHA-256 of all that decides the pictures.
    pub identity: String,
    /// The BRDF in the source notation, and the SHA-256 of what defines it.
    pub brdf: String,
    /// See `brdf`.
    pub content: String,
    /// `reference` or `test`.
    pub camera: String,
    /// Columns and rows.
    pub size: [usize; 2],
    /// Samples a pixel.
    pub samples: usize,
    /// Surface interactions at most.
    pub bounces: usize,
    /// Seed.
    pub seed: u64,
    /// Tone curve of the PNG file: `exrdisplay`, `srgb` or `none`; `None` in files of the first layout.
    #[serde(default)]
    pub tone: Option<String>,
    /// The power of the curve `exrdisplay`.
    #[serde(default)]
    pub gamma: Option<f64>,
    /// Exposure of the PNG file, f-stops.
    #[serde(default)]
    pub exposure: Option<f64>,
    /// Mean error of the luminance where the BRDF was tabulated, as a share.
    pub tabulation_error: Option<f64>,
    /// SHA-256 of the files.
    pub exr: String,
    /// See `exr`.
    pub png: String,
}

/// The name of a view in a [`Sidecar`].
fn camera(view: View) -> &'static str {
    if view == View::Reference { "reference" } else { "test" }
}

/// What was done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Made {
    /// Pictures made.
    pub made: usize,
    /// Pictures that were there.
    pub kept: usize,
}

/// A name that is a name of a file everywhere.
fn plain(name: &str) -> String {
    let kept = |c: char| if c.is_ascii_alphanumeric() || "._+-".contains(c) { c } else { '_' };
    let plain: String = name.chars().map(kept).take(100).collect();
    if plain.is_empty() || plain.starts_with('.') { format!("_{plain}") } else { plain }
}

/// The stimuli of a shard of a study, those of a reference together. Names are unique in the whole study.
pub fn stimuli(study: &Study, shard: Shard) -> Vec<Stimulus> {
    let places = shard.places(study);
    let mut taken: BTreeMap<String, usize> = BTreeMap::new();
    let mut unique = |name: String| {
        let count = taken.entry(name.to_lowercase()).or_default();
        *count += 1;
        if *count == 1 { name } else { format!("{name}-{count}") }
    };
    let mut found = Vec::new();
    for pairs in study.by_reference() {
        let Some(&first) = pairs.first() else { continue };
        let of_shard = places.binary_search(&first).is_ok();
        let mut add = |name: String, role: Role, pair: usize, source: &BrdfSource| {
            let name = unique(name);
            if of_shard {
                let view = if role == Role::Reference { View::Reference } else { View::Test };
                found.push(Stimulus { name, role, pair, source: source.clone(), view });
            }
        };
        let material = plain(&study.pairs[first].material);
        let reference = &study.pairs[first].reference;
        add(format!("{material}/reference"), Role::Reference, first, reference);
        add(format!("{material}/hidden-reference"), Role::HiddenReference, first, reference);
        for place in pairs {
            let pair = &study.pairs[place];
            let name = format!("{}/{}", plain(&pair.material), plain(&pair.method));
            add(name, Role::Candidate, place, &pair.candidate);
        }
    }
    found
}

/// Makes what is not there yet. `observer` is told of pictures that are done.
///
/// # Errors
/// A BRDF that cannot be read or traced, a folder or a file that cannot be written. What was finished stays.
pub fn render(study: &Study, options: &StimuliOptions, observer: Observer) -> Result<Made, StimuliError> {
    let stimuli = stimuli(study, options.shard);
    let mut made = Made::default();
    // The tree of the mesh and the tables of the light are the same for all.
    let mut stage = None;
    for (done, stimulus) in stimuli.iter().enumerate() {
        observer("stimuli", Progress { done, total: stimuli.len() });
        if one(stimulus, options, &mut stage)? { made.made += 1 } else { made.kept += 1 }
    }
    Ok(made)
}

/// Makes one, unless it is there, with the tracer of another where there is one.
fn one(stimulus: &Stimulus, options: &StimuliOptions, stage: &mut Option<Tracer>) -> Result<bool, StimuliError> {
    let brdf = stimulus.source.identify(options.data.as_deref())?;
    let mut scene = options.scene.clone();
    scene.camera = stimulus.view.camera();
    // The identity needs the content alone; decoding waits.
    scene.reflectance =
        Reflectance::Brdf(Arc::new(vernis_metric::brdf::models::Lambert { kd: [0.0; 3] }), brdf.content);
    let (tone, exposure) = options.tone;
    let settings = format!("{} {} {tone:?} {exposure:?}", scene.identity(), trace::VERSION);
    let identity = ContentHash::of(settings.as_bytes()).to_string();
    let at = |ending: &str| options.folder.join(format!("{}.{ending}", stimulus.name));
    if is_there(&identity, &at) {
        return Ok(false);
    }
    let open = stimulus.source.open(options.data.as_deref())?;
    scene.reflectance = Reflectance::Brdf(open.brdf, open.content);
    let failed = |cause| StimuliError::Trace { notation: open.notation.clone(), cause };
    let tracer = match stage {
        Some(stage) => stage.seen_anew(scene.reflectance, scene.camera),
        None => Tracer::new(&scene),
    };
    let tracer = &*stage.insert(tracer.map_err(failed)?);
    let picture = tracer.render(&silent).map_err(failed)?;
    let exr = picture.to_exr()?;
    let png = write::to_png(picture.width(), picture.height(), &tone.apply(&picture, exposure))?;
    let film = scene.film;
    let sidecar = Sidecar {
        format: FORMAT,
        identity,
        brdf: open.notation.clone(),
        content: open.content.to_string(),
        camera: camera(stimulus.view).to_owned(),
        size: [film.width, film.height],
        samples: film.samples,
        bounces: film.bounces,
        seed: film.seed,
        tone: Some(name_of(tone).to_owned()),
        gamma: if let Tone::ExrDisplay { gamma } = tone { Some(gamma) } else { None },
        exposure: Some(exposure),
        tabulation_error: tracer.tabulation().map(|t| t.mean_error),
        exr: ContentHash::of(&exr).to_string(),
        png: ContentHash::of(&png).to_string(),
    };
    let folder = at("json").parent().map(Path::to_owned).unwrap_or_default();
    std::fs::create_dir_all(&folder).map_err(|cause| StimuliError::Folder { path: folder.clone(), cause })?;
    // What says that the others are whole comes last.
    write::write(&at("exr"), &exr)?;
    write::write(&at("png"), &png)?;
    let json = serde_json::to_vec_pretty(&sidecar).unwrap_or_default();
    write::write(&at("json"), &json)?;
    Ok(true)
}

/// The name of a tone curve in a [`Sidecar`], as `vernis render --tone` takes it.
fn name_of(tone: Tone) -> &'static str {
    match tone {
        Tone::ExrDisplay { .. } => "exrdisplay",
        Tone::Srgb => "srgb",
        Tone::Linear => "none",
    }
}

fn is_there(identity: &str, at: &impl Fn(&str) -> PathBuf) -> bool {
    let read = |ending: &str| read_at_most(&at(ending), MOST_BYTES).ok();
    let Some(sidecar) = read("json").and_then(|json| serde_json::from_slice::<Sidecar>(&json).ok()) else {
        return false;
    };
    let same = |ending: &str, said: &str| read(ending).is_some_and(|bytes| ContentHash::of(&bytes).to_string() == said);
    sidecar.format <= FORMAT && sidecar.identity == identity && same("exr", &sidecar.exr) && same("png", &sidecar.png)
}
