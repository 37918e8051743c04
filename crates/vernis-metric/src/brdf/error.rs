//! Everything that can be wrong with a reflectance source.

use super::models::{self, ModelError};
use super::tabulated::TableError;
use crate::io::{did_you_mean, number, shown};
use std::path::PathBuf;
use thiserror::Error;

/// The notation of sources in short.
const NOTATIONS: &str = "PATH.binary, PATH.titopo, PATH.titopoh, PATH.bsdf, PATH.h5, ARCHIVE.zip:MATERIAL, \
     FILE.fit:MATERIAL[?KEY=VALUE&...], npf.bin:MATERIAL, MODEL.json[?KEY=VALUE&...]; SOURCE?fit=dupuy[-ggx|-beckmann] is read off any of them";

/// Why a BRDF could not be read, written or made. Each message is one line that names place, finding and remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum BrdfError {
    /// The operating system refused.
    #[error("{}: {cause}", path.display())]
    Io { path: PathBuf, cause: std::io::Error },
    /// Another program writes it.
    #[error("{}: the file was changed while it was being read; run the command again when nothing writes to it", path.display())]
    Changed { path: PathBuf },
    /// No such file, neither as given nor in the data folder.
    #[error("{path}: no such file; looked for {}", tried.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", "))]
    NotFound { path: String, tried: Vec<PathBuf> },
    /// Truncated or oversized.
    #[error("{}: the file has {found} {}; {format} needs {allowed}", path.display(), if *found == 1 { "byte" } else { "bytes" })]
    Size { path: PathBuf, format: &'static str, found: u64, allowed: String },
    /// The header contradicts the format.
    #[error(
        "{}: the header says {}x{}x{}; MERL needs 90x90x180 or 90x90x360",
        path.display(), found[0], found[1], found[2]
    )]
    Header { path: PathBuf, found: [i32; 3] },
    /// A number that is no reflectance and no mark of a missing one.
    #[error("{}: {place} holds {}; it must hold {allowed}", path.display(), number(*found))]
    Value { path: PathBuf, place: String, found: f64, allowed: &'static str },
    /// The values read do not make a table.
    #[error("{}: {cause}", path.display())]
    Table { path: PathBuf, cause: TableError },
    /// The file format cannot hold the grid.
    #[error("{}: {format} cannot hold {found}; resample to {allowed} first", path.display())]
    Grid { path: PathBuf, format: &'static str, found: String, allowed: &'static str },
    /// Malformed text at a line.
    #[error("{}:{line}: {}", path.display(), shown(reason, 400))]
    Line { path: PathBuf, line: usize, reason: String },
    /// A file that is not what its name says.
    #[error("{}: not a valid {format}: {}", path.display(), shown(reason, 400))]
    Malformed { path: PathBuf, format: &'static str, reason: String },
    /// The file holds other materials.
    #[error("{}: no material `{}`; {}", path.display(), shown(found, 100), did_you_mean(nearest))]
    UnknownMaterial { path: PathBuf, found: String, nearest: Vec<String> },
    /// A field or key that the model lacks.
    #[error("{place}: {model} has no parameter `{}`; {}; its parameters are {}", shown(found, 100), models::foreign::parameter(found, allowed).unwrap_or_else(|| did_you_mean(nearest)), allowed.join(", "))]
    UnknownField { place: String, model: String, found: String, nearest: Vec<String>, allowed: Vec<String> },
    /// A model that does not exist.
    #[error("{place}: unknown model `{}`; {}; the models are {}", shown(found, 100), models::foreign::model(found).unwrap_or_else(|| did_you_mean(nearest)), allowed.join(", "))]
    UnknownModel { place: String, found: String, nearest: Vec<String>, allowed: Vec<String> },
    /// A field that is absent or of the wrong shape.
    #[error("{place}: {field} is {}; it must be {allowed}", if found.is_empty() { "empty".to_owned() } else { shown(found, 200) })]
    Field { place: String, field: String, found: String, allowed: String },
    /// Parameters out of bounds.
    #[error("{place}: {cause}")]
    Model { place: String, cause: ModelError },
    /// The text is not in the notation of sources.
    #[error("`{}` is not a BRDF source: {}; write it as {}", shown(notation, 200), shown(reason, 300), NOTATIONS)]
    Notation { notation: String, reason: String },
}
