//! Getting the pinned files of a study into a data folder.
//!
//! A file is received under the name `<file>.part` beside its place, compared with the pinned size and SHA-256, and only
//! then renamed: under the final name there is nothing but the published content, whenever the program ends. A `.part`
//! that an earlier run left is continued where the server can do that.
//!
//! Memory: one piece of 64 KiB, whatever the file. Disk: never more than the pinned size of a file.

mod address;
#[cfg(feature = "fetch")]
mod http;
mod part;

pub use address::{Address, Mirror};

use super::DatasetError;
use super::manifest::PinnedFile;
use super::verify::{Checked, FileState, Measured};
use part::Part;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::time::Duration;

/// How often a file that ends too early is asked for again.
const ATTEMPTS: u32 = 3;
/// Before the second attempt; twice as long before each further one.
const PAUSE: Duration = Duration::from_millis(200);
/// Largest file of which no size is pinned. All of them are tables of text.
const MOST_BYTES: u64 = 64 << 20;
const PIECE: usize = 1 << 16;

/// What became of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The published content was there already; nothing was read from elsewhere.
    Present,
    /// A part of the published content was there, and was left.
    Extract,
    /// Received: all of its bytes, or those that an earlier run had not received.
    Fetched {
        /// Bytes received in this call.
        bytes: u64,
    },
}

/// How far a transfer is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Transfer {
    /// Bytes of the file that are here, including those of an earlier run.
    pub done: u64,
    /// Size of the whole file, where it is known.
    pub whole: Option<u64>,
}

/// Content that is read from its byte `start` on.
struct Stream {
    start: u64,
    /// Size of the content from byte 0, where it is known.
    whole: Option<u64>,
    bytes: Box<dyn Read>,
}

/// Brings `file` into the folder `data`, from the mirror if there is one, else from where the manifest says.
///
/// A file that is there with another content is left and is an error, unless `replace`: then, and only after the new
/// content has been received and found right, it gives way to it.
///
/// # Errors
/// [`DatasetError::Content`] when the content is not the published one, [`DatasetError::Fetch`] when it cannot be had,
/// [`DatasetError::Write`] when it cannot be stored. What was in the folder before stays.
pub fn fetch(
    file: &PinnedFile,
    data: &Path,
    mirror: Option<&Mirror>,
    replace: bool,
    progress: &mut dyn FnMut(Transfer),
) -> Result<Outcome, DatasetError> {
    let there = Checked::of(file, data, &mut |_| ());
    match there.state {
        FileState::AsPublished => return Ok(Outcome::Present),
        FileState::Extract if !replace => return Ok(Outcome::Extract),
        _ => {}
    }
    if let (false, Some(problem)) = (replace, there.problem(file, data)) {
        return Err(problem);
    }
    let address = Address::of(file, mirror)?;
    let target = data.join(&file.path);
    let mut part = Part::open(&target)?;
    let received = receive(file, &address, &mut part, progress).and_then(|bytes| {
        part.rename(&target)?;
        Ok(Outcome::Fetched { bytes })
    });
    if received.is_err() {
        part.remove_if_empty();
    }
    received
}

/// Fills `part` with the published content; how many bytes were received for that.
fn receive(
    file: &PinnedFile,
    address: &Address,
    part: &mut Part,
    progress: &mut dyn FnMut(Transfer),
) -> Result<u64, DatasetError> {
    let earlier = part.len()?;
    if earlier > file.bytes.unwrap_or(MOST_BYTES) {
        part.cut(0)?;
    }
    let resumed = part.len()? > 0;
    let complete = resumed && Some(part.len()?) == file.bytes;
    let mut received = if complete { 0 } else { transfer(file, address, part, progress)? };
    let mut found = measure(part)?;
    if resumed && !found.is_published(file) {
        // What the earlier run left may be of something else.
        part.cut(0)?;
        received += transfer(file, address, part, progress)?;
        found = measure(part)?;
    }
    if found.is_published(file) {
        return Ok(received);
    }
    part.cut(0)?;
    Err(found.unlike(address, file))
}

fn measure(part: &Part) -> Result<Measured, DatasetError> {
    Measured::of(part.path(), &mut |_| ())
        .map_err(|e| DatasetError::Unreadable { path: part.path().into(), reason: e.to_string() })
}

/// Why an attempt ended.
enum End {
    Whole,
    /// Before its end, for the reason given.
    Early(String),
}

/// Receives what `part` lacks, in several attempts if need be; how many bytes came.
fn transfer(
    file: &PinnedFile,
    address: &Address,
    part: &mut Part,
    progress: &mut dyn FnMut(Transfer),
) -> Result<u64, DatasetError> {
    let mut received = 0;
    let mut attempt = 0;
    loop {
        attempt += 1;
        match once(file, address, part, &mut received, progress)? {
            End::Whole => return Ok(received),
            End::Early(_) if attempt < ATTEMPTS => std::thread::sleep(PAUSE * 2u32.pow(attempt - 1)),
            End::Early(reason) => {
                let done = part.len()?;
                let whole = file.bytes.map_or_else(String::new, |b| format!(" of {b}"));
                let reason = format!("ended after {done}{whole} bytes ({reason}); the same command goes on from there");
                return Err(DatasetError::Fetch { address: address.to_string(), reason });
            }
        }
    }
}

/// One attempt.
fn once(
    file: &PinnedFile,
    address: &Address,
    part: &mut Part,
    received: &mut u64,
    progress: &mut dyn FnMut(Transfer),
) -> Result<End, DatasetError> {
    let mut stream = open(address, part.len()?)?;
    let whole = file.bytes.or(stream.whole);
    let most = file.bytes.unwrap_or(MOST_BYTES);
    let too_much = |found: String| DatasetError::Content {
        place: address.to_string(),
        found,
        allowed: file.bytes.map_or(format!("it must have at most {most} bytes"), |b| format!("it must have {b} bytes")),
    };
    if let Some(found) = stream.whole.filter(|w| *w > most || file.bytes.is_some_and(|b| b != *w)) {
        return Err(too_much(format!("has {found} bytes")));
    }
    part.cut(stream.start)?;
    let mut done = stream.start;
    let mut piece = [0; PIECE];
    loop {
        progress(Transfer { done, whole });
        let n = match stream.bytes.read(&mut piece) {
            Ok(n) => n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
            Err(e) => return Ok(End::Early(e.to_string())),
        };
        if n == 0 {
            let early = whole.is_some_and(|whole| done < whole);
            return Ok(if early { End::Early("the content stops".into()) } else { End::Whole });
        }
        done += n as u64;
        *received += n as u64;
        if done > most {
            part.cut(0)?;
            return Err(too_much(format!("has more than {most} bytes")));
        }
        part.append(&piece[..n])?;
    }
}

/// The content at `address` from byte `from` on, or from an earlier one.
fn open(address: &Address, from: u64) -> Result<Stream, DatasetError> {
    let error = |reason: String| DatasetError::Fetch { address: address.to_string(), reason };
    let stream = match address {
        Address::File(path) => open_file(path, from).map_err(|e| error(e.to_string()))?,
        #[cfg(feature = "fetch")]
        Address::Http(url) => http::open(url, from).map_err(error)?,
        #[cfg(not(feature = "fetch"))]
        Address::Http(_) => {
            let reason = "this vernis was built without the feature `fetch`; the mirror must be a folder";
            return Err(error(reason.into()));
        }
    };
    if stream.start > from {
        return Err(error(format!("the answer begins at byte {}; it must begin at {from} or before", stream.start)));
    }
    Ok(stream)
}

fn open_file(path: &Path, from: u64) -> io::Result<Stream> {
    let whole = std::fs::metadata(path)?;
    if !whole.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"));
    }
    let whole = whole.len();
    let start = if from <= whole { from } else { 0 };
    let mut file = File::open(path)?;
    file.seek(SeekFrom::Start(start))?;
    Ok(Stream { start, whole: Some(whole), bytes: Box::new(file) })
}
