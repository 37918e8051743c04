//! Results kept for a later run, sealed: a line or file that was changed, by hand or by a fault of the disk, is noticed.
//!
//! `{"seal": "SHA-256 of the content's JSON", "content": ...}`. Numbers read back as the same f64, so that the same content has
//! the same seal.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use thiserror::Error;

/// Why kept content cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum SealError {
    #[error("it cannot be read ({0})")]
    Malformed(String),
    #[error("its content does not match its seal")]
    Broken,
}

/// The seal of a content: the hexadecimal SHA-256 of its JSON.
///
/// # Errors
/// A content that JSON cannot hold.
pub fn seal_of(content: &impl Serialize) -> serde_json::Result<String> {
    let digest = Sha256::digest(serde_json::to_vec(content)?);
    Ok(digest.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[derive(Serialize)]
struct Written<'a, T> {
    seal: String,
    content: &'a T,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Read<T> {
    seal: String,
    content: T,
}

/// One line of JSON, without the line break.
///
/// # Errors
/// A content that JSON cannot hold.
pub fn seal(content: &impl Serialize) -> serde_json::Result<String> {
    serde_json::to_string(&Written { seal: seal_of(content)?, content })
}

/// What [`seal`] wrote.
///
/// # Errors
/// [`SealError`].
pub fn unseal<T: Serialize + DeserializeOwned>(text: &[u8]) -> Result<T, SealError> {
    let malformed = |e: serde_json::Error| SealError::Malformed(e.to_string());
    let Read { seal, content } = serde_json::from_slice::<Read<T>>(text).map_err(malformed)?;
    if seal_of(&content).map_err(malformed)? == seal { Ok(content) } else { Err(SealError::Broken) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_changed_is_noticed() {
        let content = (7usize, vec![0.1, 1e-300, 1.0 / 3.0], "text".to_owned());
        let line = seal(&content).unwrap();
        assert_eq!(unseal(line.as_bytes()), Ok(content));
        type Content = (usize, Vec<f64>, String);
        let changed = line.replace("0.1", "0.2");
        assert_eq!(unseal::<Content>(changed.as_bytes()), Err(SealError::Broken));
        assert!(matches!(unseal::<Content>(&line.as_bytes()[..line.len() - 1]), Err(SealError::Malformed(_))));
        assert!(matches!(unseal::<Content>(b"{}"), Err(SealError::Malformed(_))));
    }
}
