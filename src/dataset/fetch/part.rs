//! The file that a download grows in.

use super::super::DatasetError;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// `<file>.part` beside the place of `<file>`, held by one process at a time.
pub(super) struct Part {
    path: PathBuf,
    file: File,
}

impl Part {
    /// Opens or makes the file for `target`, with the folders that lead there.
    pub(super) fn open(target: &Path) -> Result<Self, DatasetError> {
        let name = target.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let path = target.with_file_name(format!("{name}.part"));
        let open = || -> io::Result<File> {
            std::fs::create_dir_all(target.parent().unwrap_or(Path::new("")))?;
            let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path)?;
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => {
                    Err(io::Error::new(io::ErrorKind::WouldBlock, "another process is receiving it"))
                }
                // Where a file system knows no locks, a second process is found out by the comparison at the end.
                _ => Ok(file),
            }
        };
        match open() {
            Ok(file) => Ok(Self { path, file }),
            Err(cause) => Err(DatasetError::Write { path, cause }),
        }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    fn error(&self) -> impl Fn(io::Error) -> DatasetError {
        |cause| DatasetError::Write { path: self.path.clone(), cause }
    }

    pub(super) fn len(&self) -> Result<u64, DatasetError> {
        self.file.metadata().map(|m| m.len()).map_err(self.error())
    }

    /// Keeps the first `len` bytes; what is appended next follows them.
    pub(super) fn cut(&mut self, len: u64) -> Result<(), DatasetError> {
        let cut = self.file.set_len(len).and_then(|()| self.file.seek(SeekFrom::Start(len)));
        cut.map(|_| ()).map_err(self.error())
    }

    pub(super) fn append(&mut self, bytes: &[u8]) -> Result<(), DatasetError> {
        self.file.write_all(bytes).map_err(|cause| DatasetError::Write { path: self.path.clone(), cause })
    }

    /// Gives the file its final name, once its content is on the disk.
    pub(super) fn rename(&self, target: &Path) -> Result<(), DatasetError> {
        let renamed = self.file.sync_all().and_then(|()| std::fs::rename(&self.path, target));
        renamed.map_err(|cause| DatasetError::Write { path: target.into(), cause })
    }

    /// Leaves no empty file behind.
    pub(super) fn remove_if_empty(&self) {
        if self.len().is_ok_and(|len| len == 0) {
            // That it was not there before is no more than tidiness.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}
