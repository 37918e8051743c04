//! Getting the pinned files of a study into a data folder.
//!
//! A file is received under the name `<file>.part` beside its place, compared with the pinned size and SHA-256, and only
//! then renamed: under the final name there is nothing but the published content, whenever the program ends. A `.part`
//! that an earlier run left is continued where the server can do that.
//!
//! A file takes no longer than [`time_for`] says, all attempts together, however slowly a server answers.
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
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::time::{Duration, Instant};
use vernis_metric::io::open_regular;

/// How often a file that ends too early is asked for again.
const ATTEMPTS: u32 = 3;
/// Before the second attempt; twice as long before each further one.
const PAUSE: Duration = Duration::from_millis(200);
/// Largest file of which no size is pinned. All of them are tables of text.
const MOST_BYTES: u64 = 64 << 20;
const PIECE: usize = 1 << 16;
/// What [`time_for`] gives any file.
const LEAST_TIME: Duration = Duration::from_secs(120);
/// The slowest connection for which [`time_for`] suffices: bytes a second.
const SLOWEST: u64 = 250_000;

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

/// The time that a file may take: two minutes, and one second more for every 250 kB of its pinned size.
pub fn time_for(file: &PinnedFile) -> Duration {
    LEAST_TIME + Duration::from_secs(file.bytes.unwrap_or(0) / SLOWEST)
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
    fetch_within(time_for(file), file, data, mirror, replace, progress)
}

/// [`fetch`] in another time than that of [`time_for`].
///
/// # Errors
/// Those of [`fetch`].
pub fn fetch_within(
    time: Duration,
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
    let limit = Limit { end: Instant::now() + time, time };
    let received = receive(file, &address, limit, &mut part, progress).and_then(|bytes| {
        part.rename(&target)?;
        Ok(Outcome::Fetched { bytes })
    });
    if received.is_err() {
        part.remove_if_empty();
    }
    received
}

/// When a file must be here.
#[derive(Clone, Copy)]
struct Limit {
    end: Instant,
    /// For messages.
    time: Duration,
}

impl Limit {
    /// The time that is left, unless it is over.
    fn left(self) -> Result<Duration, String> {
        let left = self.end.saturating_duration_since(Instant::now());
        if left.is_zero() { Err(format!("the {} s for one file are over", self.time.as_secs())) } else { Ok(left) }
    }
}

/// Fills `part` with the published content; how many bytes were received for that.
fn receive(
    file: &PinnedFile,
    address: &Address,
    limit: Limit,
    part: &mut Part,
    progress: &mut dyn FnMut(Transfer),
) -> Result<u64, DatasetError> {
    let earlier = part.len()?;
    if earlier > file.bytes.unwrap_or(MOST_BYTES) {
        part.cut(0)?;
    }
    let resumed = part.len()? > 0;
    let complete = resumed && Some(part.len()?) == file.bytes;
    let mut received = if complete { 0 } else { transfer(file, address, limit, part, progress)? };
    let mut found = measure(part)?;
    if resumed && !found.is_published(file) {
        // What the earlier run left may be of something else.
        part.cut(0)?;
        received += transfer(file, address, limit, part, progress)?;
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
    limit: Limit,
    part: &mut Part,
    progress: &mut dyn FnMut(Transfer),
) -> Result<u64, DatasetError> {
    let mut received = 0;
    let mut attempt = 0;
    loop {
        attempt += 1;
        let end = once(file, address, limit, part, &mut received, progress)?;
        let late = limit.left().err();
        match end {
            End::Whole => return Ok(received),
            End::Early(_) if attempt < ATTEMPTS && late.is_none() => std::thread::sleep(PAUSE * 2u32.pow(attempt - 1)),
            End::Early(reason) => {
                let reason = late.unwrap_or(reason);
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
    limit: Limit,
    part: &mut Part,
    received: &mut u64,
    progress: &mut dyn FnMut(Transfer),
) -> Result<End, DatasetError> {
    let left = match limit.left() {
        Ok(left) => left,
        Err(late) => return Ok(End::Early(late)),
    };
    let mut stream = match open(address, part.len()?, left) {
        Err(_) if limit.left().is_err() => return Ok(End::Early("no answer".into())),
        opened => opened?,
    };
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
        if let Err(late) = limit.left() {
            let whole = whole.is_some_and(|whole| done == whole);
            return Ok(if whole { End::Whole } else { End::Early(late) });
        }
    }
}

/// The content at `address` from byte `from` on, or from an earlier one; a server has `left` to answer.
#[cfg_attr(not(feature = "fetch"), allow(unused_variables, reason = "there are no servers without the feature"))]
fn open(address: &Address, from: u64, left: Duration) -> Result<Stream, DatasetError> {
    let error = |reason: String| DatasetError::Fetch { address: address.to_string(), reason };
    let stream = match address {
        Address::File(path) => open_file(path, from).map_err(|e| error(e.to_string()))?,
        #[cfg(feature = "fetch")]
        Address::Http(url) => http::open(url, from, left).map_err(error)?,
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
    let mut file = open_regular(path)?;
    let whole = file.metadata()?.len();
    let start = if from <= whole { from } else { 0 };
    file.seek(SeekFrom::Start(start))?;
    Ok(Stream { start, whole: Some(whole), bytes: Box::new(file) })
}
