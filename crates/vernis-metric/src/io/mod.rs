//! What meets the outside: bounded reads, atomic writes, and text for messages.

mod files;
mod text;

pub use files::{NewFile, read_at_most, write_atomically};
pub use text::{did_you_mean, nearest, shown};
