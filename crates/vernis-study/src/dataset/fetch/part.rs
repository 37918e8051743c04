//! The file that a download grows in.

use super::super::DatasetError;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Opens or makes the file. A link is not followed: whoever may write into the folder could have put one there, and what it leads
/// to would be cut off and written over.
fn open_without_links(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(true);
    match options.clone().create_new(true).open(path) {
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
        made => return made,
    }
    if !std::fs::symlink_metadata(path)?.is_file() {
        return Err(in_the_way());
    }
    let file = options.open(path)?;
    // A link may have taken its place before it was opened: nothing is written yet.
    if is_itself(&file, path)? { Ok(file) } else { Err(in_the_way()) }
}

fn in_the_way() -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file; it is in the way, remove it")
}

/// Whether `path` is `file`, and no link to it.
#[cfg(unix)]
fn is_itself(file: &File, path: &Path) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    let (opened, there) = (file.metadata()?, std::fs::symlink_metadata(path)?);
    Ok((opened.dev(), opened.ino()) == (there.dev(), there.ino()))
}

#[cfg(not(unix))]
fn is_itself(_file: &File, path: &Path) -> io::Result<bool> {
    Ok(std::fs::symlink_metadata(path)?.is_file())
}

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
            let file = open_without_links(&path)?;
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
