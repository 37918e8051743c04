//! A lock on a folder: one run at a time writes into it, on whatever host, and the others are told who does.
//!
//! The lock is the operating system's, on the file `.vernis-lock` in the folder. It ends with the process that holds it, however
//! that ends; the file that is left then means nothing. The file says who holds the lock: host, process and since when.

use super::read_stream_at_most;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};
use thiserror::Error;

/// The file that is locked.
const NAME: &str = ".vernis-lock";
/// More than who holds a lock takes to say.
const MOST_BYTES: u64 = 1000;
/// How often a file is opened anew that its last holder has just removed.
const ATTEMPTS: usize = 100;

/// Why a folder could not be locked.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum LockError {
    /// Another process has it.
    #[error(
        "{}: another vernis is writing there ({holder}); wait until it ends, or name another folder",
        folder.display()
    )]
    Held { folder: PathBuf, holder: String },
    /// The file of the lock cannot be made.
    #[error("{}: {cause}", path.display())]
    File { path: PathBuf, cause: io::Error },
}

/// A folder into which this process alone writes, until this is dropped.
#[derive(Debug)]
pub struct FolderLock {
    path: PathBuf,
    /// The lock is on this file; closing it ends the lock.
    _file: File,
}

impl FolderLock {
    /// Locks `folder`, which must exist. Where the file system knows no locks, nothing is locked; writing whole files under
    /// temporary names is safe there as well.
    ///
    /// # Errors
    /// [`LockError::Held`] if another process, or this one, has locked it; [`LockError::File`].
    pub fn acquire(folder: &Path) -> Result<Self, LockError> {
        let path = folder.join(NAME);
        let failed = |cause: io::Error| LockError::File { path: path.clone(), cause };
        for _ in 0..ATTEMPTS {
            let mut file = open(&path).map_err(failed)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let said = read_stream_at_most(&file, MOST_BYTES).unwrap_or_default();
                    let said = String::from_utf8_lossy(&said).trim().to_owned();
                    let holder = if said.is_empty() { "it does not say who it is".to_owned() } else { said };
                    return Err(LockError::Held { folder: folder.to_owned(), holder });
                }
                // Where a file system knows no locks.
                Err(TryLockError::Error(_)) => {}
            }
            // Its last holder may have removed it between opening and locking: a lock on that locks nothing.
            if !is_at(&file, &path) {
                continue;
            }
            let written = file.set_len(0).and_then(|()| file.seek(SeekFrom::Start(0)));
            written.and_then(|_| file.write_all(holder().as_bytes())).map_err(failed)?;
            return Ok(Self { path, _file: file });
        }
        Err(failed(io::Error::new(io::ErrorKind::WouldBlock, "other processes make and remove it all the time")))
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        // While it is still locked. Where it cannot be removed, it stays, and means nothing.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Opens or makes the file, and follows no link.
fn open(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(true);
    match options.clone().create_new(true).open(path) {
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
        made => return made,
    }
    match std::fs::symlink_metadata(path) {
        Ok(found) if !found.is_file() => {
            Err(io::Error::new(io::ErrorKind::InvalidInput, "it is in the way of the lock on its folder; remove it"))
        }
        // Removed meanwhile: made again.
        Err(e) if e.kind() == io::ErrorKind::NotFound => options.create_new(true).open(path),
        _ => match options.open(path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => options.create_new(true).open(path),
            opened => opened,
        },
    }
}

/// Whether `path`, which may be a link now, still leads to `file` itself.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |m: std::fs::Metadata| (m.dev(), m.ino());
    match (file.metadata(), std::fs::symlink_metadata(path)) {
        (Ok(opened), Ok(there)) => identity(opened) == identity(there),
        _ => false,
    }
}

/// An open file is not removed here.
#[cfg(not(unix))]
fn is_at(_file: &File, path: &Path) -> bool {
    path.is_file()
}

/// Who this is, in one line.
fn holder() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    format!("host {}, process {}, since {}\n", host(), std::process::id(), utc(seconds))
}

/// The name of this computer or container, where it can be had without asking the operating system for more than a file.
fn host() -> String {
    let file = || read_stream_at_most(File::open("/proc/sys/kernel/hostname").ok()?, MOST_BYTES).ok();
    let text = file().and_then(|bytes| String::from_utf8(bytes).ok());
    let variable = || ["HOSTNAME", "COMPUTERNAME"].iter().find_map(|name| std::env::var(name).ok());
    let name = text.or_else(variable).unwrap_or_default();
    if name.trim().is_empty() { "unknown".to_owned() } else { name.trim().to_owned() }
}

/// Seconds since 1970 as a date and time, by Hinnant's `civil_from_days`.
fn utc(seconds: u64) -> String {
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted / 146_097, shifted % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = year_of_era + 400 * era + u64::from(month <= 2);
    format!("{year}-{month:02}-{day:02} {:02}:{:02}:{:02} UTC", second / 3600, second / 60 % 60, second % 60)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_folder_is_locked_once_and_the_other_is_told_by_whom() {
        let folder = tempfile::tempdir().unwrap();
        let first = FolderLock::acquire(folder.path()).unwrap();
        let error = FolderLock::acquire(folder.path()).unwrap_err().to_string();
        let process = format!("process {}, since 20", std::process::id());
        assert!(error.contains("another vernis is writing there (host ") && error.contains(&process), "{error}");
        drop(first);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        drop(FolderLock::acquire(folder.path()).unwrap());
    }

    /// What a process leaves that was killed.
    #[test]
    fn a_file_without_a_lock_means_nothing() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(NAME), "host gone, process 1, since long ago, and much more of it").unwrap();
        let lock = FolderLock::acquire(folder.path()).unwrap();
        let said = fs::read_to_string(folder.path().join(NAME)).unwrap();
        assert!(said.starts_with("host ") && said.ends_with(" UTC\n") && !said.contains("gone"), "{said}");
        drop(lock);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("target");
        fs::write(&target, "mine").unwrap();
        std::os::unix::fs::symlink(&target, folder.path().join(NAME)).unwrap();
        let error = FolderLock::acquire(folder.path()).unwrap_err().to_string();
        assert!(error.contains(".vernis-lock: it is in the way of the lock"), "{error}");
        assert_eq!(fs::read_to_string(target).unwrap(), "mine");
    }

    #[test]
    fn one_of_many_threads_has_it_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let inside = std::sync::atomic::AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..50 {
                        if let Ok(_lock) = FolderLock::acquire(folder.path()) {
                            assert_eq!(inside.fetch_add(1, std::sync::atomic::Ordering::SeqCst), 0);
                            std::thread::yield_now();
                            inside.fetch_sub(1, std::sync::atomic::Ordering::SeqCst);
                        }
                    }
                });
            }
        });
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        assert_eq!(utc(0), "1970-01-01 00:00:00 UTC");
        assert_eq!(utc(951_827_696), "2000-02-29 12:34:56 UTC");
        assert_eq!(utc(4_102_444_799), "2099-12-31 23:59:59 UTC");
    }
}
