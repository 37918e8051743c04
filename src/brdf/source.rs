//! One notation for a BRDF, used by every subcommand and every study.

use super::Brdf;
use sha2::{Digest, Sha256};
use std::fmt;
use std::sync::Arc;

/// SHA-256 of what defines a BRDF (file bytes, or the canonical form of a model's parameters): the cache key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ContentHash(pub [u8; 32]);

impl ContentHash {
    pub fn of(bytes: &[u8]) -> Self {
        Self(Sha256::digest(bytes).into())
    }
}

impl fmt::Display for ContentHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|b| write!(f, "{b:02x}"))
    }
}

/// An opened BRDF.
#[derive(Clone)]
pub struct OpenBrdf {
    /// The notation it was opened from.
    pub notation: String,
    pub content: ContentHash,
    pub brdf: Arc<dyn Brdf>,
}

/// Where a BRDF comes from; nothing is read until it is opened.
#[derive(Clone)]
pub enum BrdfSource {
    /// The source notation, such as `merl_nbrdf.zip:teflon` or `low_lowmicrofacet_E2.fit:teflon?eta=2.5`.
    Notation(String),
    /// Made by code, as in the embedded study.
    Generated(OpenBrdf),
}
