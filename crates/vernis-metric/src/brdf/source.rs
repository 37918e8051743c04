//! Where a BRDF comes from, and what it is once it was opened. `notation.rs` says how sources are written.

use super::found::Found;
use super::notation::{Parsed, find};
use super::{Brdf, BrdfError};
use crate::math::parallel;
use sha2::{Digest, Sha256};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// SHA-256 of what defines a BRDF (file bytes, or the canonical form of a model's parameters): the cache key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ContentHash(pub [u8; 32]);

impl ContentHash {
    /// The SHA-256 of `bytes`.
    pub fn of(bytes: &[u8]) -> Self {
        Self(Sha256::digest(bytes).into())
    }

    /// From the 64 hexadecimal digits that it is shown as.
    pub fn from_hex(text: &str) -> Option<Self> {
        let (digits, rest) = text.as_bytes().as_chunks::<2>();
        let digits: &[[u8; 2]; 32] = digits.try_into().ok().filter(|_| rest.is_empty())?;
        let mut hash = [0; 32];
        for (byte, pair) in hash.iter_mut().zip(digits) {
            let digit = |digit: u8| char::from(digit).to_digit(16);
            *byte = (16 * digit(pair[0])? + digit(pair[1])?) as u8;
        }
        Some(Self(hash))
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
    /// SHA-256 of what defines the BRDF.
    pub content: ContentHash,
    /// The BRDF itself.
    pub brdf: Arc<dyn Brdf>,
}

impl fmt::Debug for OpenBrdf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "OpenBrdf({}, {})", self.notation, self.content)
    }
}

/// A BRDF whose content is known and that is decoded when it is asked for: where a cache knows the content, a table of 35 MB
/// is read and no more.
pub struct IdentifiedBrdf {
    /// The notation it was opened from.
    pub notation: String,
    /// SHA-256 of what defines the BRDF.
    pub content: ContentHash,
    state: State,
}

enum State {
    Open(Arc<dyn Brdf>),
    Later { found: Found, decoded: OnceLock<Arc<dyn Brdf>> },
}

impl IdentifiedBrdf {
    /// Whether it was there when its content was: true for models and networks, false for tables and what is read off another BRDF.
    pub fn is_open(&self) -> bool {
        matches!(self.state, State::Open(_))
    }

    /// The BRDF; a table is decoded, and a model that is read off another BRDF extracted, the first time.
    ///
    /// # Errors
    /// A table with numbers that are none, or without a valid cell; a BRDF that sends no light straight back, and so has no facets.
    pub fn brdf(&self) -> Result<&dyn Brdf, BrdfError> {
        match &self.state {
            State::Open(brdf) => Ok(&**brdf),
            State::Later { found, decoded } => Ok(match decoded.get() {
                Some(brdf) => &**brdf,
                None => {
                    let brdf = found.decode()?;
                    &**decoded.get_or_init(|| brdf)
                }
            }),
        }
    }
}

impl From<OpenBrdf> for IdentifiedBrdf {
    fn from(open: OpenBrdf) -> Self {
        Self { notation: open.notation, content: open.content, state: State::Open(open.brdf) }
    }
}

/// Where a BRDF comes from; nothing is read until it is opened.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum BrdfSource {
    /// The source notation, such as `merl_nbrdf.zip:teflon` or `low_lowmicrofacet_E2.fit:teflon?eta=2.5`.
    Notation(String),
    /// Made by code, as in the embedded study.
    Generated(OpenBrdf),
}

impl BrdfSource {
    /// Checks the notation; whether the file exists is found out by [`BrdfSource::open`].
    pub fn parse(notation: &str) -> Result<Self, BrdfError> {
        Parsed::new(notation)?;
        Ok(Self::Notation(notation.to_owned()))
    }

    /// What it is called in tables and messages.
    pub fn notation(&self) -> &str {
        match self {
            Self::Notation(notation) => notation,
            Self::Generated(open) => &open.notation,
        }
    }

    /// What tells one source from another without opening it.
    pub fn identity(&self) -> String {
        match self {
            Self::Notation(notation) => format!("notation {notation}"),
            Self::Generated(open) => format!("content {}", open.content),
        }
    }

    /// Reads the BRDF. A relative path is tried as given, then below `base`, the data folder, and its known subfolders.
    pub fn open(&self, base: Option<&Path>) -> Result<OpenBrdf, BrdfError> {
        match self {
            Self::Generated(open) => Ok(open.clone()),
            Self::Notation(notation) => {
                let found = Parsed::new(notation)?.found(base)?;
                let (brdf, content) = parallel::join(|| found.decode(), || found.content());
                Ok(OpenBrdf { notation: notation.clone(), content: content?, brdf: brdf? })
            }
        }
    }

    /// The BRDF of [`BrdfSource::open`] without its content hash, which takes longer than decoding a table.
    ///
    /// # Errors
    /// As [`BrdfSource::open`].
    pub fn open_unhashed(&self, base: Option<&Path>) -> Result<Arc<dyn Brdf>, BrdfError> {
        match self {
            Self::Generated(open) => Ok(open.brdf.clone()),
            Self::Notation(notation) => Parsed::new(notation)?.found(base)?.decode(),
        }
    }

    /// The file that [`BrdfSource::open`] would read, of which nothing is read; `None` for a BRDF that was made by code.
    ///
    /// # Errors
    /// A wrong notation, or no such file.
    pub fn locate(&self, base: Option<&Path>) -> Result<Option<PathBuf>, BrdfError> {
        match self {
            Self::Generated(_) => Ok(None),
            Self::Notation(notation) => find(Parsed::new(notation)?.path, base).map(Some),
        }
    }

    /// Reads what tells the BRDF from others, as [`BrdfSource::open`], and puts off decoding a table or extracting a model.
    pub fn identify(&self, base: Option<&Path>) -> Result<IdentifiedBrdf, BrdfError> {
        match self {
            Self::Generated(open) => Ok(open.clone().into()),
            Self::Notation(notation) => {
                let found = Parsed::new(notation)?.found(base)?;
                let content = found.content()?;
                let state = match found {
                    Found::Open(_, brdf) => State::Open(brdf),
                    found => State::Later { found, decoded: OnceLock::new() },
                };
                Ok(IdentifiedBrdf { notation: notation.clone(), content, state })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::Dupuy;

    #[test]
    fn a_hash_is_read_as_it_is_shown() {
        let hash = ContentHash::of(b"vernis");
        let text = hash.to_string();
        assert_eq!(ContentHash::from_hex(&text), Some(hash));
        let cut = text.get(1..).expect("ASCII");
        for wrong in ["", cut, &format!("{text}0"), &format!("g{cut}"), &format!("\u{e9}{}", &text[2..])] {
            assert_eq!(ContentHash::from_hex(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_file_is_located_without_being_read() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("a.fit"), "no fit").expect("writable");
        let locate = |notation: &str| BrdfSource::Notation(notation.to_owned()).locate(Some(folder.path()));
        assert_eq!(locate("a.fit:teflon?eta=2.5").expect("there"), Some(folder.path().join("a.fit")));
        assert!(matches!(locate("b.fit:teflon"), Err(BrdfError::NotFound { .. })));
        assert!(matches!(locate("a.fit"), Err(BrdfError::Notation { .. })));
    }

    /// The extraction is that of the model, its content tells references and models apart, and it waits until it is asked for.
    #[test]
    fn a_model_is_read_off_what_the_notation_names() {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("writable");
        write("a.json", r#"{"model": "ggx", "kd": [0.2, 0.1, 0.1], "f0": [0.1, 0.1, 0.1], "alpha": 0.3}"#);
        write("black.json", r#"{"model": "lambert", "kd": [0, 0, 0]}"#);
        let source = |notation: &str| BrdfSource::parse(notation).expect(notation);
        let open = |notation: &str| source(notation).open(Some(folder.path()));
        let reference = open("a.json").expect("a model");
        let mut contents = vec![reference.content];
        for model in Dupuy::MODELS {
            let notation = format!("a.json?fit={model}");
            let found = open(&notation).expect("reflects");
            let expected = Dupuy::extracted(model, &*reference.brdf).expect("reflects");
            let read_off = found.brdf.as_model().expect("a model");
            assert_eq!(
                (read_off.model(), read_off.parameters()),
                (model, super::super::models::AnalyticBrdf::parameters(&expected))
            );
            let identified = source(&notation).identify(Some(folder.path())).expect("there");
            assert_eq!(identified.content, found.content);
            assert!(identified.brdf().expect("reflects").as_model().is_some_and(|m| m.model() == model));
            contents.push(found.content);
        }
        contents.push(open("a.json?alpha=0.4&fit=dupuy").expect("reflects").content);
        contents.sort();
        contents.dedup();
        assert_eq!(contents.len(), 5);
        // Nothing is extracted before values are asked for.
        let black = source("black.json?fit=dupuy").identify(Some(folder.path())).expect("there");
        for error in [black.brdf().err(), open("black.json?fit=dupuy").err()] {
            let message = error.expect("no light comes back").to_string();
            assert!(message.starts_with("black.json?fit=dupuy: the reference sends no light back"), "{message}");
        }
        assert!(matches!(open("none.json?fit=dupuy"), Err(BrdfError::NotFound { .. })));
    }

    #[test]
    fn a_wrong_notation_says_what_is_allowed() {
        for (notation, expected) in [
            ("teflon", "no extension"),
            ("teflon.vernis", "extension `vernis` is unknown"),
            ("teflon.alta", "a `.alta` is data or a fitted function of ALTA"),
            ("x.brdf", "a `.brdf` is a model in GLSL for BRDF Explorer, or scattered measurements of pbrt-v2"),
            ("x.astm", "ASTM E1392"),
            ("m001.png", "UTIA"),
            ("m001.bin", "UTIA"),
            ("a.bsdf:x", "takes no name"),
            ("a.h5?alpha=1", "no parameters to override"),
            ("merl_nbrdf.zip", "name one"),
            ("merl_nbrdf.zip:", "name one"),
            ("a.binary:teflon", "takes no name"),
            ("a.zip:teflon?eta=1", "no parameters to override"),
            ("a.fit:teflon?eta", "`eta` is not of the form KEY=VALUE"),
            ("a.zip:teflon?fit", "`fit` is not of the form KEY=VALUE"),
            ("a.zip:teflon?fit=ggx", "`fit` is ggx; it must be one of dupuy, dupuy-ggx, dupuy-beckmann"),
            ("a.zip:teflon?fit=dupuy&fit=dupuy", "`fit` is given twice"),
            ("a.zip:teflon?fit=dupuy&eta=1", "no parameters to override"),
            ("a.zip?fit=dupuy", "name one"),
        ] {
            let message = BrdfSource::parse(notation).expect_err(notation).to_string();
            assert!(message.contains(expected) && message.contains("write it as PATH.binary"), "{message}");
        }
    }
}
