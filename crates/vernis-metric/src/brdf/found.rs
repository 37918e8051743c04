//! What a notation leads to: a BRDF and its content, or what is still to be decoded.

use super::formats::{merl, titopo};
use super::models::Dupuy;
use super::notation::Kind;
use super::source::ContentHash;
use super::{Brdf, BrdfError};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The bytes of a file, or of a member of an archive, whose size and header are those of a table.
pub(super) struct TableFile {
    kind: Kind,
    /// For messages.
    path: PathBuf,
    bytes: Vec<u8>,
}

impl TableFile {
    pub fn open(kind: Kind, path: &Path) -> Result<Self, BrdfError> {
        let bytes = if kind == Kind::Merl { merl::bytes(path) } else { titopo::bytes(path) }?;
        Ok(Self { kind, path: path.to_owned(), bytes })
    }

    /// Of bytes that were unpacked already.
    pub fn new(kind: Kind, path: PathBuf, bytes: Vec<u8>) -> Result<Self, BrdfError> {
        let size = bytes.len() as u64;
        if kind == Kind::Merl { merl::grid(&path, &bytes, size) } else { titopo::grid(&path, size) }?;
        Ok(Self { kind, path, bytes })
    }

    fn content(&self) -> ContentHash {
        ContentHash::of(&self.bytes)
    }

    fn decode(&self) -> Result<Arc<dyn Brdf>, BrdfError> {
        let decode = if self.kind == Kind::Merl { merl::decode } else { titopo::decode };
        Ok(Arc::new(decode(&self.path, &self.bytes)?))
    }
}

/// What a notation leads to: a BRDF and its content, or what is still to be decoded.
pub(super) enum Found {
    Open(ContentHash, Arc<dyn Brdf>),
    Table(TableFile),
    Extraction(Extraction),
}

impl Found {
    pub fn content(&self) -> ContentHash {
        match self {
            Self::Open(content, _) => *content,
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
    fn content(&self) -> ContentHash {
        let (version, reference) = (Dupuy::EXTRACTION_VERSION, self.reference.content());
        ContentHash::of(format!("extraction {version} of {} from {reference}", self.model).as_bytes())
    }

    fn decode(&self) -> Result<Arc<dyn Brdf>, BrdfError> {
        let found = Dupuy::extracted(self.model, &*self.reference.decode()?);
        Ok(Arc::new(found.map_err(|cause| BrdfError::Model { place: self.notation.clone(), cause })?))
    }
}
