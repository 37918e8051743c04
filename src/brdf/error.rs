//! Everything that can be wrong with a reflectance source.

use super::models::ModelError;
use super::tabulated::TableError;
use std::path::PathBuf;
use thiserror::Error;

/// Why a BRDF could not be read, written or made. Each message is one line that names place, finding and remedy.
#[derive(Debug, Error)]
pub enum BrdfError {
    /// The operating system refused.
    #[error("{}: {cause}", path.display())]
    Io { path: PathBuf, cause: std::io::Error },
    /// No such file, neither as given nor in the data folder.
    #[error("{path}: no such file; looked for {}", tried.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", "))]
    NotFound { path: String, tried: Vec<PathBuf> },
    /// Truncated or oversized.
    #[error("{}: the file has {found} bytes, {format} needs {allowed}", path.display())]
    Size { path: PathBuf, format: &'static str, found: u64, allowed: String },
    /// The header contradicts the format.
    #[error(
        "{}: header says {}x{}x{}, MERL needs 90x90x180 or 90x90x360",
        path.display(), found[0], found[1], found[2]
    )]
    Header { path: PathBuf, found: [i32; 3] },
    /// A number that is no reflectance and no mark of a missing one.
    #[error("{}: {place} holds {found}, allowed is {allowed}", path.display())]
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
    #[error("{place}: {model} has no parameter `{}`; {}; allowed: {}", shown(found, 100), did_you_mean(nearest), allowed.join(", "))]
    UnknownField { place: String, model: String, found: String, nearest: Vec<String>, allowed: Vec<String> },
    /// A model that does not exist.
    #[error("{place}: unknown model `{}`; {}; allowed: {}", shown(found, 100), did_you_mean(nearest), allowed.join(", "))]
    UnknownModel { place: String, found: String, nearest: Vec<String>, allowed: Vec<String> },
    /// A field that is absent or of the wrong shape.
    #[error("{place}: {field}: found {}, allowed is {allowed}", shown(found, 200))]
    Field { place: String, field: String, found: String, allowed: String },
    /// Parameters out of bounds.
    #[error("{place}: {cause}")]
    Model { place: String, cause: ModelError },
    /// The text is not in the notation of sources.
    #[error(
        "`{}` is not a BRDF source: {}; allowed: {}",
        shown(notation, 200),
        shown(reason, 300),
        super::source::NOTATIONS
    )]
    Notation { notation: String, reason: String },
}

/// Text of a file or of a user as a message may show it: one line of at most `most` characters, and how many there are
/// where that is less than all.
pub(crate) fn shown(text: &str, most: usize) -> String {
    let mut line = String::new();
    for (k, c) in text.chars().enumerate() {
        if k == most {
            return format!("{line}... ({} characters)", text.chars().count());
        }
        if c.is_control() { line.extend(c.escape_debug()) } else { line.push(c) }
    }
    line
}

fn did_you_mean(nearest: &[String]) -> String {
    match nearest {
        [] => "nothing similar is known".to_owned(),
        names => format!("did you mean {}?", names.join(", ")),
    }
}

/// The entries of `known` closest to `found`, best first: at most three, none that shares nothing with it.
pub(super) fn nearest<S: AsRef<str>>(found: &str, known: impl IntoIterator<Item = S>) -> Vec<String> {
    let found = found.to_lowercase();
    let mut ranked: Vec<(f64, String)> = known
        .into_iter()
        .map(|k| (strsim::jaro_winkler(&found, &k.as_ref().to_lowercase()), k.as_ref().to_owned()))
        .filter(|(similarity, _)| *similarity > 0.6)
        .collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
    ranked.into_iter().take(3).map(|(_, name)| name).collect()
}
