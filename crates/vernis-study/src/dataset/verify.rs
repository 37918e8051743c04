//! Whether a file in a data folder is the published one: its size and SHA-256 against the manifest's.

use super::DatasetError;
use super::manifest::PinnedFile;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fmt;
use std::io::{self, Read};
use std::path::Path;
use vernis_metric::brdf::ContentHash;
use vernis_metric::io::open_regular;

/// Bytes that are read at a time.
const PIECE: usize = 1 << 16;

/// State of a pinned file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FileState {
    /// There is no such file.
    Missing,
    /// Size and SHA-256 are what the manifest pins.
    AsPublished,
    /// Not the published content, but a part of it is of use: the number of pairs says how much it is.
    Extract,
    /// Not the published content: results will not be comparable with other people's.
    Different,
    /// The file is there but cannot be read, for the reason given.
    Unreadable(String),
}

/// Size and SHA-256 of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Measured {
    /// Size in bytes.
    pub bytes: u64,
    /// SHA-256 of the content.
    pub sha256: ContentHash,
}

impl Measured {
    /// Reads the file at `path` in pieces, and tells `progress` the size of each.
    ///
    /// # Errors
    /// What the operating system says, or that `path` is no regular file.
    pub fn of(path: &Path, progress: &mut dyn FnMut(u64)) -> io::Result<Self> {
        let mut file = open_regular(path)?;
        let mut hash = Sha256::new();
        let mut piece = [0; PIECE];
        let mut bytes = 0;
        loop {
            let n = match file.read(&mut piece) {
                Ok(0) => return Ok(Self { bytes, sha256: ContentHash(hash.finalize().into()) }),
                Ok(n) => n,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
                Err(e) => return Err(e),
            };
            hash.update(&piece[..n]);
            bytes += n as u64;
            progress(n as u64);
        }
    }

    /// Whether this is the published content of `file`.
    pub fn is_published(&self, file: &PinnedFile) -> bool {
        file.bytes.is_none_or(|b| b == self.bytes) && self.sha256.to_string() == file.sha256
    }

    /// That `place` holds this where `file` should be.
    pub fn unlike(&self, place: impl fmt::Display, file: &PinnedFile) -> DatasetError {
        let size = file.bytes.map_or_else(String::new, |b| format!("{b} bytes, "));
        DatasetError::Content {
            place: place.to_string(),
            found: format!("has {self}"),
            allowed: format!("it must have {size}SHA-256 {}", file.sha256),
        }
    }
}

impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes, SHA-256 {}", self.bytes, self.sha256)
    }
}

/// A pinned file as it is in a data folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Checked {
    /// Whether the file is there, and as published.
    pub state: FileState,
    /// Of the file that is there.
    pub found: Option<Measured>,
}

impl Checked {
    /// Reads `file` in the folder `data`, and tells `progress` the size of each piece.
    pub fn of(file: &PinnedFile, data: &Path, progress: &mut dyn FnMut(u64)) -> Self {
        let (state, found) = match Measured::of(&data.join(&file.path), progress) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => (FileState::Missing, None),
            Err(e) => (FileState::Unreadable(e.to_string()), None),
            Ok(found) if found.is_published(file) => (FileState::AsPublished, Some(found)),
            Ok(found) if file.extract_allowed => (FileState::Extract, Some(found)),
            Ok(found) => (FileState::Different, Some(found)),
        };
        Self { state, found }
    }

    /// What is wrong with the file, if it is there and something is.
    pub fn problem(&self, file: &PinnedFile, data: &Path) -> Option<DatasetError> {
        let path = data.join(&file.path);
        match (&self.state, &self.found) {
            (FileState::Unreadable(reason), _) => Some(DatasetError::Unreadable { path, reason: reason.clone() }),
            (FileState::Different, Some(found)) => Some(found.unlike(path.display(), file)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn size_and_hash_are_those_of_the_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("abc");
        // More than a piece; the hash of "abc" itself is the example of FIPS 180-4.
        std::fs::write(&path, "abc").unwrap();
        let short = Measured::of(&path, &mut |_| ()).unwrap();
        assert_eq!(short.bytes, 3);
        assert!(
            short.sha256.to_string().starts_with("ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad")
        );
        let long = vec![7; 3 * PIECE + 5];
        std::fs::write(&path, &long).unwrap();
        let mut told = 0;
        let measured = Measured::of(&path, &mut |n| told += n).unwrap();
        assert_eq!((told, measured.bytes), (long.len() as u64, long.len() as u64));
        assert_eq!(measured.sha256, ContentHash::of(&long));
        assert!(Measured::of(folder.path(), &mut |_| ()).unwrap_err().to_string().contains("it is a folder"));
    }
}
