//! One notation for a BRDF, used by every subcommand and every study.
//!
//! | notation | what |
//! | --- | --- |
//! | `alum-bronze.binary` | a MERL table |
//! | `teflon.T.titopo`, `teflon.T.titopoh` | a Titopo table |
//! | `chm_orange_rgb.bsdf` | a measurement of the RGL database, isotropic and in RGB |
//! | `teflon.h5` | an NBRDF network |
//! | `merl_nbrdf.zip:teflon`, `BRDFDatabase.zip:teflon` | any of these in an archive |
//! | `ngan_ward.fit:teflon`, `ngan_ward.fit:teflon?model=ward-duer&alpha=0.2` | a published fit, with overrides |
//! | `npf.bin:teflon` | tabulated factors |
//! | `ward.json`, `ward.json?ks=0.1,0.1,0.1` | a model (or a sum of models) and its parameters, with overrides |
//! | `merl_nbrdf.zip:teflon?fit=dupuy-ggx`, `alum-bronze.binary?fit=dupuy` | what is read off any of these without a search |
//!
//! An override sets a field of the model that is evaluated, so `kd` and `ks` are the final albedos. `model` reads the same
//! parameters as another model of the same fields.
//!
//! `fit` names a model that the BRDF before it gives directly: `dupuy`, `dupuy-ggx` or `dupuy-beckmann`
//! ([`Dupuy::from_retroreflection`]); `vernis fit --model` makes the same model. The content is the content of the BRDF before it with
//! the name of the model and the version of the extraction. An extraction takes some milliseconds, and is put off until values are
//! asked for.

use super::formats::{archive, extension, fit, materials, merl, model_json, nbrdf, npf, rgl, titopo, what_it_is};
use super::models::{Dupuy, NamedParameters};
use super::{Brdf, BrdfError};
use sha2::{Digest, Sha256};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// Folders below the data folder in which a relative path is looked for as well.
const SUBFOLDERS: [&str; 6] = ["nbrdf", "published-fits", "bagher2016-npf", "merl", "lavoue2021", "rgl"];

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

/// The bytes of a file, or of a member of an archive, whose size and header are those of a table.
struct TableFile {
    kind: Kind,
    /// For messages.
    path: PathBuf,
    bytes: Vec<u8>,
}

impl TableFile {
    fn open(kind: Kind, path: &Path) -> Result<Self, BrdfError> {
        let bytes = if kind == Kind::Merl { merl::bytes(path) } else { titopo::bytes(path) }?;
        Ok(Self { kind, path: path.to_owned(), bytes })
    }

    /// Of bytes that were unpacked already.
    fn new(kind: Kind, path: PathBuf, bytes: Vec<u8>) -> Result<Self, BrdfError> {
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
enum Found {
    Open(ContentHash, Arc<dyn Brdf>),
    Table(TableFile),
    Extraction(Extraction),
}

impl Found {
    fn content(&self) -> ContentHash {
        match self {
            Self::Open(content, _) => *content,
            Self::Table(file) => file.content(),
            Self::Extraction(extraction) => extraction.content(),
        }
    }

    fn decode(&self) -> Result<Arc<dyn Brdf>, BrdfError> {
        match self {
            Self::Open(_, brdf) => Ok(brdf.clone()),
            Self::Table(file) => file.decode(),
            Self::Extraction(extraction) => extraction.decode(),
        }
    }
}

/// A model that is read off another BRDF.
struct Extraction {
    /// For messages.
    notation: String,
    /// One of [`Dupuy::MODELS`].
    model: &'static str,
    reference: Box<Found>,
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
                let (brdf, content) = rayon::join(|| found.decode(), || found.content());
                Ok(OpenBrdf { notation: notation.clone(), content, brdf: brdf? })
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
            Self::Notation(notation) => Parsed::new(notation)?.decoded(base),
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
                let content = found.content();
                let state = match found {
                    Found::Open(_, brdf) => State::Open(brdf),
                    found => State::Later { found, decoded: OnceLock::new() },
                };
                Ok(IdentifiedBrdf { notation: notation.clone(), content, state })
            }
        }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Merl,
    Titopo,
    Rgl,
    Network,
    Archive,
    Fits,
    Factors,
    Json,
}

impl Kind {
    fn of(path: &str) -> Option<Self> {
        Some(match extension(Path::new(path)).as_str() {
            "binary" => Self::Merl,
            "titopo" | "titopoh" => Self::Titopo,
            "bsdf" => Self::Rgl,
            "h5" => Self::Network,
            "zip" => Self::Archive,
            "fit" => Self::Fits,
            "bin" => Self::Factors,
            "json" => Self::Json,
            _ => return None,
        })
    }

    fn has_materials(self) -> bool {
        matches!(self, Self::Archive | Self::Fits | Self::Factors)
    }

    fn has_parameters(self) -> bool {
        matches!(self, Self::Fits | Self::Json)
    }
}

/// The parts of a notation.
struct Parsed<'a> {
    notation: &'a str,
    kind: Kind,
    path: &'a str,
    material: &'a str,
    overrides: Vec<(&'a str, &'a str)>,
    /// A model that is read off what the rest names.
    fit: Option<&'static str>,
}

/// Of a model that is read off a BRDF, among the keys after the `?`.
const FIT: &str = "fit";

impl<'a> Parsed<'a> {
    fn new(notation: &'a str) -> Result<Self, BrdfError> {
        let error = |reason: String| BrdfError::Notation { notation: notation.to_owned(), reason };
        let (place, query) = match notation.split_once('?') {
            Some((place, query)) => (place, Some(query)),
            None => (notation, None),
        };
        // A colon belongs to the path unless what precedes it is a collection.
        let split = place.rsplit_once(':').filter(|(path, _)| Kind::of(path).is_some());
        let (path, material) = split.map_or((place, None), |(path, material)| (path, Some(material)));
        let Some(kind) = Kind::of(path) else {
            return Err(error(match extension(Path::new(path)) {
                none if none.is_empty() => "the file name has no extension".to_owned(),
                other => match what_it_is(&other) {
                    Some(known) => format!("a `.{other}` is {known}"),
                    None => format!("the extension `{other}` is unknown"),
                },
            }));
        };
        let material = match (kind.has_materials(), material) {
            (true, None | Some("")) => {
                let other =
                    if kind == Kind::Factors { " (a `.bin` of UTIA is another format and cannot be read)" } else { "" };
                return Err(error(format!("`{path}` holds many materials, name one{other}")));
            }
            (false, Some(_)) => return Err(error(format!("`{path}` holds one material, it takes no name"))),
            (_, material) => material.unwrap_or_default(),
        };
        let assignment =
            |part: &'a str| part.split_once('=').ok_or_else(|| error(format!("`{part}` is not of the form KEY=VALUE")));
        let pairs: Vec<(&str, &str)> = query.map_or(Ok(Vec::new()), |q| q.split('&').map(assignment).collect())?;
        let (fits, overrides): (Vec<_>, Vec<_>) = pairs.into_iter().partition(|(key, _)| *key == FIT);
        if !overrides.is_empty() && !kind.has_parameters() {
            return Err(error(format!("`{path}` holds no parameters to override")));
        }
        let fit = match fits[..] {
            [] => None,
            [(_, model)] => Some(extracted_model(model).map_err(error)?),
            _ => return Err(error(format!("`{FIT}` is given twice"))),
        };
        Ok(Self { notation, kind, path, material, overrides, fit })
    }

    /// What the notation names; nothing but a model and its parameters is computed.
    fn found(&self, base: Option<&Path>) -> Result<Found, BrdfError> {
        let found = self.read(base)?;
        Ok(match self.fit {
            None => found,
            Some(model) => {
                let (notation, reference) = (self.notation.to_owned(), Box::new(found));
                Found::Extraction(Extraction { notation, model, reference })
            }
        })
    }

    /// [`Parsed::found`] and decoded; the bytes of a MERL table are not kept.
    fn decoded(&self, base: Option<&Path>) -> Result<Arc<dyn Brdf>, BrdfError> {
        match (self.kind, self.fit) {
            (Kind::Merl, None) => Ok(Arc::new(merl::read(&find(self.path, base)?)?)),
            _ => self.found(base)?.decode(),
        }
    }

    /// Reads what the notation names without its `fit`, and decodes it unless it is a table.
    fn read(&self, base: Option<&Path>) -> Result<Found, BrdfError> {
        let path = &find(self.path, base)?;
        let material = self.material;
        Ok(match self.kind {
            Kind::Merl | Kind::Titopo => Found::Table(TableFile::open(self.kind, path)?),
            Kind::Rgl => {
                let bytes = rgl::bytes(path)?;
                Found::Open(ContentHash::of(&bytes), Arc::new(rgl::decode(path, &bytes)?))
            }
            Kind::Network => {
                let bytes = nbrdf::bytes(path)?;
                Found::Open(ContentHash::of(&bytes), Arc::new(nbrdf::decode_file(path, bytes)?))
            }
            Kind::Archive => {
                let archive::Member { name, bytes } = archive::member(path, material)?;
                match Kind::of(&name) {
                    Some(kind @ (Kind::Merl | Kind::Titopo)) => {
                        let place = PathBuf::from(format!("{}:{name}", path.display()));
                        Found::Table(TableFile::new(kind, place, bytes)?)
                    }
                    Some(Kind::Rgl) => {
                        let place = PathBuf::from(format!("{}:{name}", path.display()));
                        Found::Open(ContentHash::of(&bytes), Arc::new(rgl::decode(&place, &bytes)?))
                    }
                    _ => Found::Open(ContentHash::of(&bytes), Arc::new(nbrdf::decode(path, material, bytes)?)),
                }
            }
            Kind::Factors => {
                let row = npf::row(path, material)?;
                Found::Open(npf::content(&row), Arc::new(npf::decode(path, material, &row)?))
            }
            Kind::Fits => self.model(fit::read(path, material)?)?,
            Kind::Json => self.model(model_json::read(path)?)?,
        })
    }

    /// The model of `parameters` after the overrides.
    fn model(&self, mut parameters: NamedParameters) -> Result<Found, BrdfError> {
        for (key, value) in &self.overrides {
            if *key == "model" {
                parameters = self.read_as(&parameters, value)?;
                continue;
            }
            let entries: Option<Vec<f64>> = value.split(',').map(|v| v.trim().parse().ok()).collect();
            model_json::set(&mut parameters, self.notation, key, &entries.unwrap_or_default(), value)?;
        }
        let model = parameters.build().map_err(|cause| BrdfError::Model { place: self.notation.to_owned(), cause })?;
        Ok(Found::Open(ContentHash::of(parameters.canonical().as_bytes()), model))
    }

    fn read_as(&self, parameters: &NamedParameters, model: &str) -> Result<NamedParameters, BrdfError> {
        let fields = |p: &NamedParameters| p.fields().iter().map(|(f, _)| *f).collect::<Vec<_>>().join(", ");
        let other = model_json::for_model(self.notation, model)?;
        parameters.with_model(model).ok_or_else(|| BrdfError::Field {
            place: self.notation.to_owned(),
            field: "model".to_owned(),
            found: format!("{model} ({})", fields(&other)),
            allowed: format!("a model with the fields of {} ({})", parameters.model(), fields(parameters)),
        })
    }
}

/// A model that can be read off a BRDF, by its name.
fn extracted_model(name: &str) -> Result<&'static str, String> {
    let found = Dupuy::MODELS.into_iter().find(|model| *model == name);
    found.ok_or_else(|| format!("`{FIT}` is {name}; it must be one of {}", Dupuy::MODELS.join(", ")))
}

/// The materials of the collection that `notation` names as a whole, such as `merl_nbrdf.zip` or `npf.bin`, sorted; `None`
/// where it names something else. The file is looked for as [`BrdfSource::open`] does.
///
/// # Errors
/// A file that is missing or no collection of its kind.
pub fn collection(notation: &str, base: Option<&Path>) -> Result<Option<Vec<String>>, BrdfError> {
    match Kind::of(notation) {
        Some(kind) if kind.has_materials() => materials(&find(notation, base)?).map(Some),
        _ => Ok(None),
    }
}

/// The first place where the file exists.
fn find(path: &str, base: Option<&Path>) -> Result<PathBuf, BrdfError> {
    let mut tried = vec![PathBuf::from(path)];
    if let (Some(base), true) = (base, Path::new(path).is_relative()) {
        tried.push(base.join(path));
        tried.extend(SUBFOLDERS.iter().map(|folder| base.join(folder).join(path)));
    }
    // What is there and no regular file is found last, and refused by name when it is opened.
    match tried.iter().find(|p| p.is_file()).or_else(|| tried.iter().find(|p| p.exists())) {
        Some(found) => Ok(found.clone()),
        None => Err(BrdfError::NotFound { path: path.to_owned(), tried }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn the_notation_is_taken_apart() {
        let p = Parsed::new("data/ngan_ward.fit:teflon?model=ward-duer&alpha=.2").expect("valid");
        assert_eq!((p.path, p.material), ("data/ngan_ward.fit", "teflon"));
        assert_eq!(p.overrides, [("model", "ward-duer"), ("alpha", ".2")]);
        let p = Parsed::new("ngan_ward.fit:teflon?alpha=.2&fit=dupuy-ggx").expect("valid");
        assert_eq!((&p.overrides[..], p.fit), (&[("alpha", ".2")][..], Some("dupuy-ggx")));
        let p = Parsed::new("C:/a/teflon.T.titopo").expect("valid");
        assert_eq!((p.path, p.material), ("C:/a/teflon.T.titopo", ""));
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
