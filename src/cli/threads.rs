//! The worker threads of the program, started one after the other, so that a machine that cannot hold them all says so.

use super::user_error;
use anyhow::Result;
use rayon::{ThreadBuilder, ThreadPoolBuilder};
use std::io::{Error, ErrorKind};
use std::sync::mpsc::channel;

/// Beyond the cores of any one machine; far more threads than cores take minutes to start.
const MOST: usize = 1024;

/// Bytes of address space that must be free before a thread is started: its stack, and what all threads together ask for while
/// they start. It is more than any size that the C library serves from its heap (32 MiB at most), so that the system is asked.
const ROOM: usize = 64 << 20;

/// Starts the worker threads, which otherwise start at their first use and end the program where they cannot.
///
/// A thread that finds no memory while it starts ends the program with a message of its own. So each is started where there is
/// room for it, after the one before has come to wait for work.
///
/// # Errors
/// If `asked` is 0 or above [`MOST`], or if not all threads can be started.
pub(super) fn start(asked: Option<usize>) -> Result<()> {
    let mut pool = ThreadPoolBuilder::new();
    let mut what = "the worker threads (one per core)".to_owned();
    if let Some(n) = asked {
        if !(1..=MOST).contains(&n) {
            return Err(user_error(format!("--threads is {n}; it must be 1 to {MOST}")));
        }
        pool = pool.num_threads(n);
        what = format!("{n} worker threads");
    }
    let (ready, is_ready) = channel();
    let start = |thread: ThreadBuilder| {
        room()?;
        let mut builder = std::thread::Builder::new();
        if let Some(name) = thread.name() {
            builder = builder.name(name.to_owned());
        }
        builder.spawn(|| thread.run())?;
        is_ready.recv().map_err(Error::other)
    };
    let started = move |_| {
        // Where nobody listens any more, one of the others could not be started.
        let _ = ready.send(());
    };
    let pool = pool.start_handler(started).spawn_handler(start);
    pool.build_global().map_err(|e| anyhow::anyhow!("{what} cannot be started ({e}); ask for fewer with --threads"))
}

/// Whether [`ROOM`] can be had now.
fn room() -> std::io::Result<()> {
    let mut room: Vec<u8> = Vec::new();
    let found = room.try_reserve_exact(ROOM);
    // Otherwise the compiler may leave out memory that nobody uses.
    std::hint::black_box(&room);
    found.map_err(|_| Error::new(ErrorKind::OutOfMemory, "too little memory is left"))
}
