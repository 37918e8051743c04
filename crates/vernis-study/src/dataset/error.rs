//! What can be wrong with a study.

use std::path::{Path, PathBuf};
use thiserror::Error;
use vernis_metric::brdf::BrdfError;
use vernis_metric::io::{counted, did_you_mean, shown};

/// Errors of this room: each names what is wrong, where, what was found and what is allowed, in one line.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum DatasetError {
    #[error(
        "unknown study `{name}`; {}; the studies are {known}; or give the path of a .csv file",
        did_you_mean(nearest)
    )]
    UnknownStudy { name: String, known: String, nearest: Vec<String> },
    #[error("study {study} needs a data folder that holds {needs}, but none was given")]
    NoDataFolder { study: String, needs: String },
    #[error("study {study}: {} is missing; get it from {from}", path.display())]
    MissingFile { study: String, path: PathBuf, from: String },
    #[error("{}: {}", path.display(), shown(reason, 400))]
    Unreadable { path: PathBuf, reason: String },
    /// `found` begins with a verb, `allowed` is a clause: "x.parquet is shard 1/2, but the whole study is needed".
    #[error("{place} {found}, but {allowed}")]
    Content { place: String, found: String, allowed: String },
    #[error("{address}: {reason}")]
    Fetch { address: String, reason: String },
    #[error("{}: cannot be written: {cause}", path.display())]
    Write { path: PathBuf, cause: std::io::Error },
    #[error("{}, line {line}: {field} is {}; it must be {}", path.display(), shown(found, 200), shown(allowed, 1000))]
    Field { path: PathBuf, line: u64, field: String, found: String, allowed: String },
    #[error("{}, line {line}: {column}: {cause}", path.display())]
    Source { path: PathBuf, line: u64, column: &'static str, cause: Box<BrdfError> },
    #[error("manifest of {study}: {reason}")]
    Manifest { study: String, reason: String },
    #[error("study {study} has no usable pair: {reason}")]
    NoPairs { study: String, reason: String },
    #[error("study {study} has one material ({material}); learning across materials needs at least 2")]
    OneMaterial { study: String, material: String },
    #[error("study {study} has {} of materials; {folds} folds need at least {folds}", counted(*groups, "group"))]
    TooFewGroups { study: String, groups: usize, folds: usize },
    #[error("study {study}: all {pairs} ratings are {mos}; there is nothing to learn from equal ratings")]
    EqualRatings { study: String, pairs: usize, mos: f64 },
    #[error("study {study}: material {material} belongs to the groups {first} and {second}; it must belong to one")]
    TwoGroups { study: String, material: String, first: String, second: String },
    #[error("study {study} declares its own scale, {scale}; --scale is for ratings of your own")]
    ScaleDeclared { study: String, scale: String },
    #[error("study synthetic: {reason}")]
    Synthetic { reason: String },
}

/// A wrong `field` of a line of a file of ratings.
pub(super) fn field(path: &Path, line: u64, field: &str, found: String, allowed: String) -> DatasetError {
    DatasetError::Field { path: path.into(), line, field: field.into(), found, allowed }
}
