//! What meets the outside: bounded reads, atomic writes, sealed results, progress, interruption, and text for messages.

mod files;
mod interrupt;
mod json;
mod progress;
mod sealed;
mod text;

pub use files::{NewFile, read_at_most, write_atomically};
pub use interrupt::Interrupt;
pub use json::unique_keys;
pub use progress::{Observer, Progress, silent};
pub use sealed::{SealError, seal, seal_of, unseal};
pub use text::{counted, decimals, did_you_mean, nearest, number, shown};
