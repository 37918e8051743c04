//! Files: never more read than a format has a use for, never half a file left behind.

use std::fs::{File, FileType};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Opens a regular file to be read. Folders, devices, FIFOs and sockets are refused before they are opened: reading one may
/// never end, or wait for ever.
///
/// # Errors
/// What the operating system says, or what it is instead of a regular file.
pub fn open_regular(path: &Path) -> io::Result<File> {
    only_regular(std::fs::metadata(path)?.file_type())?;
    let file = File::open(path)?;
    // Somebody may have put another one in its place meanwhile.
    only_regular(file.metadata()?.file_type())?;
    Ok(file)
}

fn only_regular(found: FileType) -> io::Result<()> {
    if found.is_file() {
        return Ok(());
    }
    Err(io::Error::new(io::ErrorKind::InvalidInput, format!("it is a {}; it must be a regular file", name_of(found))))
}

#[cfg(unix)]
fn name_of(found: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    match () {
        () if found.is_dir() => "folder",
        () if found.is_fifo() => "FIFO",
        () if found.is_socket() => "socket",
        () if found.is_symlink() => "link",
        () => "device",
    }
}

#[cfg(not(unix))]
fn name_of(found: FileType) -> &'static str {
    if found.is_dir() { "folder" } else { "device or link" }
}

/// The bytes of a regular file of at most `most` bytes. Every file that the program is given is read by this function, or through
/// [`open_regular`] piece by piece.
///
/// # Errors
/// What the operating system says, that it is no regular file ([`open_regular`]), or that there is more: nothing beyond is read.
pub fn read_at_most(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = open_regular(path)?;
    let size = file.metadata()?.len();
    if size > most { Err(too_large(size, most)) } else { read_stream_at_most(file, most) }
}

/// The text of a regular file, as [`read_at_most`] reads it.
///
/// # Errors
/// Those of [`read_at_most`], and a content that is not UTF-8.
pub fn read_text_at_most(path: &Path, most: u64) -> io::Result<String> {
    String::from_utf8(read_at_most(path, most)?).map_err(|e| {
        io::Error::new(io::ErrorKind::InvalidData, format!("it is not text in UTF-8 ({})", e.utf8_error()))
    })
}

/// What a stream, such as standard input, gives to its end: at most `most` bytes.
///
/// # Errors
/// What the operating system says, or that there is more: nothing beyond is read.
pub fn read_stream_at_most(stream: impl Read, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    stream.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { Err(too_large(most + 1, most)) } else { Ok(bytes) }
}

fn too_large(found: u64, most: u64) -> io::Error {
    let message = format!("it has at least {found} bytes; it must have at most {most}");
    io::Error::new(io::ErrorKind::FileTooLarge, message)
}

/// A file that is being written under a temporary name in the folder of its target, and takes the target's name as a whole.
/// Dropped before that, it leaves nothing behind.
///
/// The temporary name begins with a dot and is unique across processes, hosts and containers that share the folder.
pub struct NewFile {
    out: BufWriter<NamedTempFile>,
    target: PathBuf,
}

impl NewFile {
    /// # Errors
    /// No file can be made in the folder of `target`.
    pub fn create(target: &Path) -> io::Result<Self> {
        let folder = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let name = target.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        // Names of files are limited to 255 bytes; that of the target may be near it.
        let start: String = name.chars().take(40).collect();
        let (prefix, suffix) = (format!(".{start}."), Self::SUFFIX);
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(suffix);
        // As any other file of the user's, not readable by its owner alone.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = builder.tempfile_in(folder)?;
        Ok(Self { out: BufWriter::with_capacity(1 << 18, file), target: target.to_owned() })
    }

    /// The ending of temporary names.
    pub const SUFFIX: &str = ".partial";

    /// Gives the file its name; what was called so before is replaced.
    ///
    /// # Errors
    /// The rest cannot be written, or the target cannot be replaced; it is then as it was.
    pub fn finish(self) -> io::Result<()> {
        let file = self.out.into_inner().map_err(io::IntoInnerError::into_error)?;
        file.as_file().sync_all()?;
        file.persist(&self.target).map_err(|e| e.error)?;
        Ok(())
    }
}

impl Write for NewFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// Writes a whole file: a reader, or a crash, meets the old file or the new one and never a part.
///
/// # Errors
/// What the operating system says; the old file is then as it was.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = NewFile::create(path)?;
    file.write_all(bytes)?;
    file.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_file_is_replaced_whole_and_nothing_else_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.json");
        write_atomically(&path, b"one").unwrap();
        let mut second = NewFile::create(&path).unwrap();
        second.write_all(b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"one");
        second.finish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        drop(NewFile::create(&path).unwrap());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_failure_leaves_the_old_file_and_no_remains() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("taken")).unwrap();
        fs::write(folder.path().join("taken/old"), b"old").unwrap();
        assert!(write_atomically(&folder.path().join("taken"), b"new").is_err());
        assert!(write_atomically(&folder.path().join("missing/file"), b"new").is_err());
        assert_eq!(fs::read(folder.path().join("taken/old")).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn names_near_the_limit_can_be_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("n".repeat(255));
        write_atomically(&path, b"long").unwrap();
        assert_eq!(fs::read(path).unwrap(), b"long");
    }

    #[cfg(unix)]
    #[test]
    fn files_have_the_permissions_of_any_other() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("plain"), b"").unwrap();
        write_atomically(&folder.path().join("whole"), b"").unwrap();
        let mode = |name: &str| fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
        assert_eq!(mode("whole"), mode("plain"));
    }

    #[test]
    fn no_more_is_read_than_allowed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ten");
        fs::write(&path, [0; 10]).unwrap();
        assert_eq!(read_at_most(&path, 10).unwrap().len(), 10);
        let error = read_at_most(&path, 9).unwrap_err();
        assert!(error.to_string().contains("at least 10 bytes; it must have at most 9"), "{error}");
    }

    #[test]
    fn a_stream_ends_at_its_limit() {
        assert_eq!(read_stream_at_most(&[1u8; 9][..], 9).unwrap(), [1; 9]);
        let error = read_stream_at_most(io::repeat(0), 100).unwrap_err().to_string();
        assert!(error.contains("at least 101 bytes; it must have at most 100"), "{error}");
    }

    #[test]
    fn text_must_be_text() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a"), b"\xff").unwrap();
        let error = read_text_at_most(&folder.path().join("a"), 9).unwrap_err().to_string();
        assert!(error.contains("not text in UTF-8"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_file_is_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |path: &Path| read_at_most(path, 1 << 20).unwrap_err().to_string();
        assert_eq!(refused(folder.path()), "it is a folder; it must be a regular file");
        for device in ["/dev/zero", "/dev/null"] {
            assert_eq!(refused(Path::new(device)), "it is a device; it must be a regular file");
        }
        let fifo = folder.path().join("fifo");
        assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
        assert_eq!(refused(&fifo), "it is a FIFO; it must be a regular file");
        // Through a link, it is what the link leads to.
        std::os::unix::fs::symlink("/dev/zero", folder.path().join("link")).unwrap();
        assert_eq!(refused(&folder.path().join("link")), "it is a device; it must be a regular file");
    }
}
