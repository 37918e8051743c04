//! The threads of rayon's pool, started one after the other, so that a machine that cannot hold them all says so.
//!
//! Otherwise they start at the pool's first use, which panics where they cannot, and a thread that finds no memory while it starts ends
//! the whole process. So each is started where there is room for it, after the one before has come to wait for work.

use rayon::{ThreadBuilder, ThreadPoolBuilder};
use std::io;
use std::num::NonZeroUsize;
use std::sync::OnceLock;
use std::sync::mpsc::channel;
use thiserror::Error;

/// Bytes of address space that must be free before a thread is started: its stack, and what all threads together ask for while
/// they start. It is more than any size that the C library serves from its heap (32 MiB at most), so that the system is asked.
const ROOM: usize = 64 << 20;

/// The machine cannot hold so many worker threads.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{threads} cannot be started ({cause})")]
pub struct ThreadsError {
    /// How many.
    threads: String,
    /// What the system says.
    cause: String,
}

/// Starts the threads of rayon's global pool: as many as `asked`, else as the variable `RAYON_NUM_THREADS` says, else one per core. The
/// first call counts; later ones only say again how it went.
///
/// # Errors
/// If not all of them can be started; then the pool cannot be used, and panics.
pub fn start_threads(asked: Option<NonZeroUsize>) -> Result<(), ThreadsError> {
    static STARTED: OnceLock<Result<(), ThreadsError>> = OnceLock::new();
    STARTED.get_or_init(|| start(asked)).clone()
}

fn start(asked: Option<NonZeroUsize>) -> Result<(), ThreadsError> {
    let pool = ThreadPoolBuilder::new().num_threads(asked.map_or(0, NonZeroUsize::get));
    let (ready, is_ready) = channel();
    let started = move |_| {
        // Where nobody listens any more, one of the others could not be started.
        let _ = ready.send(());
    };
    let start_one = |thread: ThreadBuilder| {
        room()?;
        std::thread::Builder::new().spawn(|| thread.run())?;
        is_ready.recv().map_err(io::Error::other)
    };
    pool.start_handler(started).spawn_handler(start_one).build_global().map_err(|cause| ThreadsError {
        threads: asked.map_or_else(
            || "the worker threads (one per core, or as many as RAYON_NUM_THREADS says)".to_owned(),
            |n| format!("{n} worker threads"),
        ),
        cause: cause.to_string(),
    })
}

/// Whether [`ROOM`] can be had now.
fn room() -> io::Result<()> {
    let mut room: Vec<u8> = Vec::new();
    let found = room.try_reserve_exact(ROOM);
    // Otherwise the compiler may leave out memory that nobody uses.
    std::hint::black_box(&room);
    found.map_err(|_| io::Error::new(io::ErrorKind::OutOfMemory, "too little memory is left"))
}
