//! What can be wrong with a picture or its file.

use super::encoded::MOST_PIXELS;
use std::path::PathBuf;
use thiserror::Error;
use vernis_metric::io::{counted, number};

/// What is wrong with a picture.
#[derive(Debug, Error)]
pub enum PictureError {
    /// The file cannot be read, is no regular file, or is too large.
    #[error("{0}")]
    File(#[from] std::io::Error),
    /// The content is of no format that is read.
    #[error("it begins with {found}; it must be a PNG, JPEG, OpenEXR, Radiance HDR or PFM picture")]
    Format {
        /// The first bytes, as they may be shown.
        found: String,
    },
    /// The content is damaged, or uses what no reader knows.
    #[error("it cannot be read as {format}: {reason}")]
    Content {
        /// The format that its first bytes name.
        format: &'static str,
        /// What the reader says.
        reason: String,
    },
    /// Too many pixels, or none.
    #[error(
        "it has {width} x {height} pixels; each side must be at least 1, and there may be at most {MOST_PIXELS} pixels"
    )]
    Size {
        /// Number of columns.
        width: usize,
        /// Number of rows.
        height: usize,
    },
    /// Another number of pixels than its size says.
    #[error("{} was given for {width} x {height}", counted(*found, "pixel"))]
    Count {
        /// Number of columns.
        width: usize,
        /// Number of rows.
        height: usize,
        /// Number of pixels.
        found: usize,
    },
    /// A value that no metric can use.
    #[error("pixel ({x}, {y}) has {channel} {}; it must be from 0 to {}{unit}", number(f64::from(*value)), large(*most))]
    Value {
        /// Column, from 0.
        x: usize,
        /// Row, from 0 at the top.
        y: usize,
        /// `red`, `green` or `blue`.
        channel: &'static str,
        /// What was found.
        value: f32,
        /// The largest that is allowed.
        most: f32,
        /// The unit, with a space before it where there is one.
        unit: &'static str,
    },
    /// Something shines through.
    #[error(
        "pixel ({x}, {y}) has alpha {}; metrics compare opaque pictures: alpha must be 1 everywhere, so flatten the picture first",
        number(f64::from(*alpha))
    )]
    Alpha {
        /// Column, from 0.
        x: usize,
        /// Row, from 0 at the top.
        y: usize,
        /// Its alpha, 0 to 1.
        alpha: f32,
    },
}

fn large(x: f32) -> String {
    if x >= 1e6 { format!("{x:e}") } else { number(f64::from(x)) }
}

/// [`PictureError`] of a file.
#[derive(Debug, Error)]
#[error("{}: {why}", path.display())]
pub struct ReadError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    #[source]
    pub why: PictureError,
}
