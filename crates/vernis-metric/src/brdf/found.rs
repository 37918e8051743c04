//! What a notation leads to: a BRDF and its content, or what is still to be decoded.

use super::formats::{content, merl, titopo};
use super::models::Dupuy;
use super::notation::Kind;
use super::source::ContentHash;
use super::{Brdf, BrdfError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

/// A table that is still to be decoded.
pub(super) struct TableFile {
    kind: Kind,
    /// For messages.
    path: PathBuf,
    place: Place,
}

/// Where the bytes of a table are.
enum Place {
    /// In the file, read as often as they are needed: memory for them would cost more than the second reading.
    File { modified: Option<SystemTime> },
    /// Unpacked already.
    Memory(Vec<u8>),
}

impl TableFile {
    /// Of a file; what is no table by its size and header is refused when it is read.
    pub fn open(kind: Kind, path: &Path) -> Self {
        Self { kind, path: path.to_owned(), place: Place::File { modified: modified(path) } }
    }

    /// Of bytes that were unpacked already.
    pub fn new(kind: Kind, path: PathBuf, bytes: Vec<u8>) -> Result<Self, BrdfError> {
        check(kind, &path, &bytes, bytes.len() as u64)?;
        Ok(Self { kind, path, place: Place::Memory(bytes) })
    }

    fn content(&self) -> Result<ContentHash, BrdfError> {
        match &self.place {
            Place::File { .. } => {
                let found = content(&self.path, |head, size| check(self.kind, &self.path, head, size))?;
                self.unchanged(found)
            }
            Place::Memory(bytes) => Ok(ContentHash::of(bytes)),
        }
    }

    fn decode(&self) -> Result<Arc<dyn Brdf>, BrdfError> {
        let table = match (&self.place, self.kind) {
            (Place::File { .. }, Kind::Merl) => self.unchanged(merl::read(&self.path)?),
            (Place::File { .. }, _) => self.unchanged(titopo::read(&self.path)?),
            (Place::Memory(bytes), Kind::Merl) => merl::decode(&self.path, bytes),
            (Place::Memory(bytes), _) => titopo::decode(&self.path, bytes),
        };
        Ok(Arc::new(table?))
    }

    /// `found`, unless the file has been written to since it was opened: the content would be that of another table.
    fn unchanged<T>(&self, found: T) -> Result<T, BrdfError> {
        match self.place {
            Place::File { modified: before } if before != modified(&self.path) => {
                Err(BrdfError::Changed { path: self.path.clone() })
            }
            _ => Ok(found),
        }
    }
}

/// Where a file system keeps no such times there is none.
fn modified(path: &Path) -> Option<SystemTime> {
    path.metadata().and_then(|metadata| metadata.modified()).ok()
}

/// Refuses what is no table by its first bytes and its size.
fn check(kind: Kind, path: &Path, head: &[u8], size: u64) -> Result<(), BrdfError> {
    if kind == Kind::Merl { merl::grid(path, head, size) } else { titopo::grid(path, size) }.map(drop)
}

/// What a notation leads to: a BRDF and its content, or what is still to be decoded.
pub(super) enum Found {
    Open(ContentHash, Arc<dyn Brdf>),
    Table(TableFile),
    Extraction(Extraction),
}

impl Found {
    pub fn content(&self) -> Result<ContentHash, BrdfError> {
        match self {
            Self::Open(content, _) => Ok(*content),
            Self::Table(file) => file.content(),
            Self::Extraction(extraction) => extraction.content(),
        }
    }

    pub fn decode(&self) -> Result<Arc<dyn Brdf>, BrdfError> {
        match self {
            Self::Open(_, brdf) => Ok(brdf.clone()),
            Self::Table(file) => file.decode(),
            Self::Extraction(extraction) => extraction.decode(),
        }
    }
}

/// A model that is read off another BRDF.
pub(super) struct Extraction {
    /// For messages.
    pub notation: String,
    /// One of [`Dupuy::MODELS`].
    pub model: &'static str,
    pub reference: Box<Found>,
}

impl Extraction {
    fn content(&self) -> Result<ContentHash, BrdfError> {
        let (version, reference) = (Dupuy::EXTRACTION_VERSION, self.reference.content()?);
        Ok(ContentHash::of(format!("extraction {version} of {} from {reference}", self.model).as_bytes()))
    }

    fn decode(&self) -> Result<Arc<dyn Brdf>, BrdfError> {
        let found = Dupuy::extracted(self.model, &*self.reference.decode()?);
        Ok(Arc::new(found.map_err(|cause| BrdfError::Model { place: self.notation.clone(), cause })?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::Lambert;
    use crate::brdf::{Grid, TabulatedBrdf};
    use std::time::Duration;

    #[test]
    fn a_file_that_changes_between_two_readings_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.titopoh");
        let table = TabulatedBrdf::tabulate(&Lambert { kd: [0.5; 3] }, Grid::TITOPO_HALF).expect("finite");
        titopo::write(&path, &table).expect("writable");
        let file = TableFile::open(Kind::Titopo, &path);
        let content = file.content().expect("a table");
        assert_eq!(content, ContentHash::of(&std::fs::read(&path).expect("bytes")));
        assert_eq!(file.decode().expect("a table").as_table().expect("a table").values(), table.values());
        let later = SystemTime::now() + Duration::from_secs(10);
        std::fs::File::options().append(true).open(&path).and_then(|f| f.set_modified(later)).expect("a time");
        for error in [file.content().err(), file.decode().err()] {
            assert!(matches!(error, Some(BrdfError::Changed { .. })), "{error:?}");
        }
        assert_eq!(TableFile::open(Kind::Titopo, &path).content().expect("a table"), content);
    }
}
