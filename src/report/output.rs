//! A folder for results: found unwritable before the work, and never left with half a file.

use super::ReportError;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use vernis_metric::io::{FolderLock, NewFile, write_atomically};

/// A folder that could be written to when it was created.
#[derive(Debug, Clone)]
pub struct OutputFolder {
    path: PathBuf,
    /// Of a folder that was claimed; held, and never looked at.
    _lock: Option<Arc<FolderLock>>,
}

impl OutputFolder {
    /// Creates the folder where it is missing and tries a file in it; what it already holds is left alone.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self, ReportError> {
        let path = path.into();
        let probe = || {
            let mut file = NewFile::create(&path.join("probe"))?;
            file.write_all(b"vernis")?;
            file.flush()
        };
        fs::create_dir_all(&path)
            .and_then(|()| probe())
            .map_err(|source| ReportError::Unwritable { path: path.clone(), source })?;
        Ok(Self { path, _lock: None })
    }

    /// The same for a folder whose files belong together: no other process can claim it before this is dropped.
    ///
    /// # Errors
    /// Those of [`OutputFolder::create`]; [`ReportError::Lock`], which says who has claimed it.
    pub fn claim(path: impl Into<PathBuf>) -> Result<Self, ReportError> {
        let folder = Self::create(path)?;
        let lock = FolderLock::acquire(&folder.path).map_err(ReportError::Lock)?;
        Ok(Self { _lock: Some(Arc::new(lock)), ..folder })
    }

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the file called `name` and returns its path. The bytes go to a temporary file that then takes the
    /// name, so that a reader, or a crash, meets the old file or the new one and never a part.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, ReportError> {
        let path = self.path.join(name);
        write_atomically(&path, bytes).map_err(|source| ReportError::Write { path: path.clone(), source })?;
        Ok(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writes_whole_files_and_leaves_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let folder = OutputFolder::create(dir.path().join("a/b")).unwrap();
        folder.write("x.txt", b"one").unwrap();
        let path = folder.write("x.txt", b"two").unwrap();
        assert_eq!(fs::read(path).unwrap(), b"two");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_claimed_folder_is_claimed_once() {
        let dir = tempfile::tempdir().unwrap();
        let first = OutputFolder::claim(dir.path()).unwrap();
        let error = OutputFolder::claim(dir.path()).unwrap_err().to_string();
        assert!(error.contains("another vernis is writing there (host "), "{error}");
        // A single file beside its results harms nobody.
        OutputFolder::create(dir.path()).unwrap().write("x", b"x").unwrap();
        drop(first);
        OutputFolder::claim(dir.path()).unwrap();
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_path_through_a_file_is_found_unwritable_at_once() {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("file"), b"").unwrap();
        let error = OutputFolder::create(dir.path().join("file/results")).unwrap_err().to_string();
        assert!(error.contains("file/results: cannot write there"), "{error}");
    }

    #[test]
    fn a_failed_write_keeps_the_old_file() {
        let dir = tempfile::tempdir().unwrap();
        let folder = OutputFolder::create(dir.path()).unwrap();
        // A folder that holds something cannot be replaced by a file.
        fs::create_dir(dir.path().join("taken")).unwrap();
        fs::write(dir.path().join("taken/old"), b"old").unwrap();
        assert!(matches!(folder.write("taken", b"new"), Err(ReportError::Write { .. })));
        assert_eq!(fs::read(dir.path().join("taken/old")).unwrap(), b"old");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }
}
