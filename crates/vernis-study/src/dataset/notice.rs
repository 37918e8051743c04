//! What a reader of files has to say that is no error, such as between which signs it found the fields of a table.
//!
//! A library has no terminal: a program that has one listens, once, with [`listen`]; without a listener nothing is said.

use std::sync::OnceLock;

static LISTENER: OnceLock<fn(&str)> = OnceLock::new();

/// Calls `listener` with each notice from now on, one line of text. The first listener of a process stays.
pub fn listen(listener: fn(&str)) {
    // A second listener is a mistake that costs nobody a result.
    let _ = LISTENER.set(listener);
}

/// Tells whoever listens.
pub fn tell(text: &str) {
    if let Some(listener) = LISTENER.get() {
        listener(text);
    }
}
