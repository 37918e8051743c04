//! Studies by name, and from files.

use super::manifest::{self, Manifest};
use super::{DatasetError, DeclaredScale, Study, csv_study, published, synthetic};
use std::path::Path;
use vernis_metric::io::nearest;

impl Study {
    /// Loads a study by name (`lavoue2021`, `lavoue2021-open`, `synthetic`) or from a CSV file, whose columns
    /// `datasets/README.md` describes.
    ///
    /// `data` is the folder that holds a published study's files as its manifest lists them; the other studies do not
    /// need it here. Sources of a published study are paths in that folder: BRDFs are opened later, one by one, with
    /// `BrdfSource::open(data)`.
    ///
    /// # Errors
    /// An unknown name, a missing or malformed file, or a study without a usable pair. A study that is only partly at
    /// hand loads; see [`Study::completeness`].
    pub fn load(name_or_path: &str, data: Option<&Path>) -> Result<Self, DatasetError> {
        Self::load_on(name_or_path, data, None)
    }

    /// As [`Study::load`]; `scale` is that of a CSV file's ratings. Without one it is 1 to 5, or what the name of the column
    /// says: `jod`, `dmos`.
    ///
    /// # Errors
    /// Those of [`Study::load`]; a scale for a study that declares its own.
    pub fn load_on(
        name_or_path: &str,
        data: Option<&Path>,
        scale: Option<DeclaredScale>,
    ) -> Result<Self, DatasetError> {
        Self::check_scale(name_or_path, scale)?;
        if name_or_path == synthetic::NAME {
            return Ok(synthetic::generate(synthetic::SEED)?.study);
        }
        if manifest::NAMES.contains(&name_or_path) {
            return published::load(&Manifest::embedded(name_or_path)?, data);
        }
        let path = Path::new(name_or_path);
        if path.is_file() || path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")) {
            return csv_study::load(path, scale);
        }
        Err(Self::unknown(name_or_path))
    }

    /// The study where none is named: the open one, or the embedded one where the files of the open one are not here, with what is
    /// missing.
    ///
    /// # Errors
    /// Those of [`Study::load`]: files that are here and wrong are no reason to go on with other ratings.
    pub fn open_or_embedded(data: Option<&Path>) -> Result<(Self, Option<DatasetError>), DatasetError> {
        match Self::load(manifest::OPEN, data) {
            Ok(study) => Ok((study, None)),
            Err(
                missing @ (DatasetError::NoDataFolder { .. }
                | DatasetError::MissingFile { .. }
                | DatasetError::NoPairs { .. }),
            ) => Ok((Self::load(synthetic::NAME, data)?, Some(missing))),
            Err(wrong) => Err(wrong),
        }
    }

    /// The rated pairs of a study that is rebuilt from open files, with the references of its manifest and other `candidates`: those of
    /// methods that the manifest may not rebuild.
    ///
    /// # Errors
    /// Those of [`Study::load`]; a study that is not rebuilt; a method without a rating.
    pub fn load_rebuilt(
        name: &str,
        candidates: Vec<manifest::Candidate>,
        data: Option<&Path>,
    ) -> Result<Self, DatasetError> {
        if !manifest::NAMES.contains(&name) {
            return Err(Self::unknown(name));
        }
        published::load(&Manifest::embedded(name)?.with_candidates(candidates)?, data)
    }

    /// That no scale is given for a study that is known by name: it declares its own.
    ///
    /// # Errors
    /// A scale for such a study, or a manifest that cannot be read.
    pub(super) fn check_scale(name: &str, given: Option<DeclaredScale>) -> Result<(), DatasetError> {
        let own = if name == synthetic::NAME {
            DeclaredScale::MOS
        } else if manifest::NAMES.contains(&name) {
            Manifest::embedded(name)?.rated.scale
        } else {
            return Ok(());
        };
        match given {
            Some(_) => Err(DatasetError::ScaleDeclared { study: name.into(), scale: own.allowed() }),
            None => Ok(()),
        }
    }

    /// That there is no study `name`, with the nearest one there is.
    pub fn unknown(name: &str) -> DatasetError {
        let known = Self::known();
        DatasetError::UnknownStudy { name: name.into(), known: known.join(", "), nearest: nearest(name, &known) }
    }

    /// Names of the studies that need no file of the user's own.
    pub fn known() -> Vec<&'static str> {
        manifest::NAMES.iter().copied().chain([synthetic::NAME]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_study_is_told_its_nearest_name() {
        let message = Study::load("lavoue2021-opne", None).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(message.contains("did you mean lavoue2021-open"), "{message}");
        assert!(message.contains("synthetic"), "{message}");
    }
}
