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

use super::BrdfError;
use super::formats::{archive, extension, fit, materials, model_json, nbrdf, npf, rgl, what_it_is};
use super::found::{Extraction, Found, TableFile};
use super::models::{Dupuy, NamedParameters};
use super::source::ContentHash;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Folders below the data folder in which a relative path is looked for as well.
const SUBFOLDERS: [&str; 6] = ["nbrdf", "published-fits", "bagher2016-npf", "merl", "lavoue2021", "rgl"];

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Kind {
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
pub(super) struct Parsed<'a> {
    notation: &'a str,
    kind: Kind,
    pub path: &'a str,
    material: &'a str,
    overrides: Vec<(&'a str, &'a str)>,
    /// A model that is read off what the rest names.
    fit: Option<&'static str>,
}

/// Of a model that is read off a BRDF, among the keys after the `?`.
const FIT: &str = "fit";

impl<'a> Parsed<'a> {
    pub fn new(notation: &'a str) -> Result<Self, BrdfError> {
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
    pub fn found(&self, base: Option<&Path>) -> Result<Found, BrdfError> {
        let found = self.read(base)?;
        Ok(match self.fit {
            None => found,
            Some(model) => {
                let (notation, reference) = (self.notation.to_owned(), Box::new(found));
                Found::Extraction(Extraction { notation, model, reference })
            }
        })
    }

    /// Reads what the notation names without its `fit`, and decodes it unless it is a table.
    fn read(&self, base: Option<&Path>) -> Result<Found, BrdfError> {
        let path = &find(self.path, base)?;
        let material = self.material;
        Ok(match self.kind {
            Kind::Merl | Kind::Titopo => Found::Table(TableFile::open(self.kind, path)),
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
/// where it names something else. The file is looked for as [`BrdfSource::open`](super::BrdfSource::open) does.
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
pub(super) fn find(path: &str, base: Option<&Path>) -> Result<PathBuf, BrdfError> {
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
    fn the_notation_is_taken_apart() {
        let p = Parsed::new("data/ngan_ward.fit:teflon?model=ward-duer&alpha=.2").expect("valid");
        assert_eq!((p.path, p.material), ("data/ngan_ward.fit", "teflon"));
        assert_eq!(p.overrides, [("model", "ward-duer"), ("alpha", ".2")]);
        let p = Parsed::new("ngan_ward.fit:teflon?alpha=.2&fit=dupuy-ggx").expect("valid");
        assert_eq!((&p.overrides[..], p.fit), (&[("alpha", ".2")][..], Some("dupuy-ggx")));
        let p = Parsed::new("C:/a/teflon.T.titopo").expect("valid");
        assert_eq!((p.path, p.material), ("C:/a/teflon.T.titopo", ""));
    }
}
