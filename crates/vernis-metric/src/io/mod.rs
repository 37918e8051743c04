//! What meets the outside: bounded reads, atomic writes, locks of folders, sealed results, progress, interruption, worker threads,
//! and text for messages.

mod files;
mod interrupt;
mod json;
mod lock;
mod progress;
mod sealed;
mod text;
mod threads;

pub use files::{NewFile, open_regular, read_at_most, read_stream_at_most, read_text_at_most, write_atomically};
pub use interrupt::Interrupt;
pub use json::unique_keys;
pub use lock::{FolderLock, LockError};
pub use progress::{Count, Observer, Progress, silent};
pub use sealed::{SealError, seal, seal_of, unseal};
pub use text::{counted, decimals, did_you_mean, for_terminal, nearest, number, one_line, shown};
pub use threads::{ThreadsError, start_threads};
