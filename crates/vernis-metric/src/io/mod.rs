//! What meets the outside: bounded reads, atomic writes, sealed results, progress, and text for messages.

mod files;
mod progress;
mod sealed;
mod text;

pub use files::{NewFile, read_at_most, write_atomically};
pub use progress::{Observer, Progress, silent};
pub use sealed::{SealError, seal, seal_of, unseal};
pub use text::{counted, did_you_mean, nearest, shown};
