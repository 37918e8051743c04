//! Seeds: every random stream is named, so that the order and number of threads cannot change a result.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};

/// The generator of the stream called `label` (and its `index`) under `seed`.
///
/// Streams of different names are independent; the same three arguments always give the same stream.
pub fn stream(seed: u64, label: &str, index: u64) -> ChaCha8Rng {
    let mut hash = Sha256::new();
    hash.update(seed.to_le_bytes());
    hash.update((label.len() as u64).to_le_bytes());
    hash.update(label.as_bytes());
    hash.update(index.to_le_bytes());
    ChaCha8Rng::from_seed(hash.finalize().into())
}
