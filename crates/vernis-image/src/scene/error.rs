//! Everything that can be wrong with a scene.

use std::path::PathBuf;
use thiserror::Error;
use vernis_metric::brdf::BrdfError;
use vernis_metric::io::shown;
use vernis_metric::light::LightError;

/// Why there is no scene. Each message is one line that names place, finding and remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum SceneError {
    /// The operating system refused.
    #[error("{}: {cause}", path.display())]
    Io { path: PathBuf, cause: std::io::Error },
    /// Not JSON, or a key given twice.
    #[error("{}: not a scene in JSON: {}", path.display(), shown(reason, 400))]
    Json { path: PathBuf, reason: String },
    /// A key whose value is absent or wrong. `place` is the file, or what else the scene comes from.
    #[error("{place}: {} is {}; it must be {allowed}", shown(field, 100), shown(found, 200))]
    Field { place: String, field: String, found: String, allowed: String },
    /// A key that scenes do not have.
    #[error("{place}: there is no key {} here; the keys are {allowed}", shown(found, 100))]
    UnknownKey { place: String, found: String, allowed: String },
    /// A mesh that cannot be rendered.
    #[error("{}: mesh: {}", path.display(), shown(reason, 400))]
    Mesh { path: PathBuf, reason: String },
    /// A light that cannot be rendered.
    #[error("{}: light probe: {reason}", path.display())]
    Probe { path: PathBuf, reason: String },
    /// A light probe that cannot be read.
    #[error(transparent)]
    Light(#[from] LightError),
    /// A BRDF that cannot be read.
    #[error(transparent)]
    Brdf(#[from] BrdfError),
}
