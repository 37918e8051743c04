//! The id of a setup: which version of the descriptors, under which lights, on which shape.
//!
//! ```text
//! v2-lamps-sphere                                    lights and shape defined by code
//! v1-probe-035d24e3e978589f-mesh-61d113fe98d8e7e4    a light probe and a mesh, by the first 16 digits of their SHA-256
//! ```
//!
//! Exported metrics, extracted studies and caches carry it. A file finds its setup by the id ([`Setup::find`]): an old version
//! stays in the code as long as a file can name it.

use super::DescriptorError;
use super::setup::{DescriptorOptions, Lights, Setup, ShapeChoice, VERSION};
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// Versions of the descriptors that this program computes.
const VERSIONS: [u32; 2] = [1, VERSION];
/// Hexadecimal digits of a file's hash.
pub(super) const DIGITS: usize = 16;

/// The parts of an id.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SetupId {
    /// Version of the descriptors, see [`VERSION`].
    pub version: u32,
    /// Of the light probe, where lights are not defined by code.
    pub probe: Option<String>,
    /// Of the mesh, where the shape is not the sphere.
    pub mesh: Option<String>,
}

impl fmt::Display for SetupId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let part = |kind: &str, hash: &Option<String>, code: &str| match hash {
            Some(hash) => format!("{kind}-{hash}"),
            None => code.to_owned(),
        };
        write!(f, "v{}-{}-{}", self.version, part("probe", &self.probe, "lamps"), part("mesh", &self.mesh, "sphere"))
    }
}

impl FromStr for SetupId {
    type Err = DescriptorError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let parsed = || {
            let (version, rest) = text.strip_prefix('v')?.split_once('-')?;
            let (probe, rest) = match rest.strip_prefix("lamps-") {
                Some(rest) => (None, rest),
                None => {
                    let (hash, rest) = rest.strip_prefix("probe-")?.split_once('-')?;
                    (Some(hash.to_owned()), rest)
                }
            };
            let mesh = if rest == "sphere" { None } else { Some(rest.strip_prefix("mesh-")?.to_owned()) };
            let is_hash = |h: &String| h.len() == DIGITS && h.bytes().all(|b| b.is_ascii_hexdigit());
            let whole = [&probe, &mesh].into_iter().flatten().all(is_hash);
            let version = version.parse().ok().filter(|version| *version > 0)?;
            whole.then_some(Self { version, probe, mesh })
        };
        parsed().ok_or_else(|| DescriptorError::UnknownSetup { id: text.to_owned(), known: known() })
    }
}

impl SetupId {
    /// The parts of an id whose descriptors this program computes.
    ///
    /// # Errors
    /// [`DescriptorError::UnknownSetup`], [`DescriptorError::NewerSetup`].
    pub fn known(text: &str) -> Result<Self, DescriptorError> {
        let id: Self = text.parse()?;
        match id.version {
            version if VERSIONS.contains(&version) => Ok(id),
            found if found > VERSION => Err(DescriptorError::NewerSetup { found, newest: VERSION }),
            _ => Err(DescriptorError::UnknownSetup { id: text.to_owned(), known: known() }),
        }
    }
}

/// The ids that there are, for messages.
fn known() -> String {
    let ids = VERSIONS.map(|version| {
        let by_code = SetupId { version, probe: None, mesh: None };
        format!("{by_code}, and v{version}-probe-HASH-mesh-HASH with a light probe, a mesh, or both")
    });
    ids.join("; ")
}

impl Setup {
    /// The setup that `id` names. Probe and mesh of `options` are used where the id asks for them, and left alone elsewhere.
    ///
    /// # Errors
    /// [`DescriptorError::UnknownSetup`], [`DescriptorError::NewerSetup`]; [`DescriptorError::MissingFile`] or
    /// [`DescriptorError::OtherFile`] where the id asks for a probe or a mesh that `options` do not name; files that cannot be read.
    pub fn find(id: &str, options: &DescriptorOptions) -> Result<Arc<Self>, DescriptorError> {
        let wanted = SetupId::known(id)?;
        let missing = |kind: &str, hash: &str, option| DescriptorError::MissingFile {
            what: format!("the {kind} whose SHA-256 begins with {hash}"),
            option,
        };
        let lights = match (&wanted.probe, &options.lights) {
            (None, _) => Lights::Lamps,
            (Some(_), named @ Lights::Probe(_)) => named.clone(),
            (Some(hash), Lights::Lamps) => return Err(missing("light probe", hash, "--lights FILE.hdr")),
        };
        let shape = match (&wanted.mesh, &options.shape) {
            (None, _) => ShapeChoice::Sphere,
            (Some(_), named @ ShapeChoice::Mesh(_)) => named.clone(),
            (Some(hash), ShapeChoice::Sphere) => return Err(missing("mesh", hash, "--shape FILE.ply")),
        };
        let options = DescriptorOptions { lights: lights.clone(), shape: shape.clone() };
        let setup = Self::of_version(wanted.version, &options)?;
        let found: SetupId = setup.id().parse()?;
        if let (Lights::Probe(path), Some(found), Some(wanted)) = (&lights, &found.probe, &wanted.probe)
            && found != wanted
        {
            let (found, wanted) = (found.clone(), wanted.clone());
            return Err(DescriptorError::OtherFile { path: path.clone(), kind: "light probe", found, wanted });
        }
        if let (ShapeChoice::Mesh(path), Some(found), Some(wanted)) = (&shape, &found.mesh, &wanted.mesh)
            && found != wanted
        {
            let (found, wanted) = (found.clone(), wanted.clone());
            return Err(DescriptorError::OtherFile { path: path.clone(), kind: "mesh", found, wanted });
        }
        Ok(setup)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_read_as_they_are_written() {
        for id in
            ["v1-lamps-sphere", "v1-probe-035d24e3e978589f-sphere", "v12-probe-035d24e3e978589f-mesh-61d113fe98d8e7e4"]
        {
            assert_eq!(id.parse::<SetupId>().unwrap().to_string(), id);
        }
        for id in [
            "",
            "v1",
            "v0-lamps-sphere",
            "v1-lamps",
            "v1-probe-035d-sphere",
            "v1-lamps-mesh-xyz",
            "lamps-sphere",
            "v1-lamps-sphere-x",
        ] {
            let message = id.parse::<SetupId>().unwrap_err().to_string();
            assert!(message.contains("this program knows v1-lamps-sphere, and"), "{message}");
        }
    }

    #[test]
    fn a_setup_is_found_by_its_id() {
        let find = |id: &str| Setup::find(id, &DescriptorOptions::default());
        assert_eq!(find("v2-lamps-sphere").unwrap().id(), Setup::standard().id());
        assert_eq!(find("v1-lamps-sphere").unwrap().version(), 1);
        assert_eq!(
            find("v3-lamps-sphere").unwrap_err().to_string(),
            "the descriptors are of version 3; this program knows up to version 2: update vernis"
        );
        let message = find("v1-probe-035d24e3e978589f-sphere").unwrap_err().to_string();
        assert!(message.contains("begins with 035d24e3e978589f; name it with --lights"), "{message}");
    }
}
