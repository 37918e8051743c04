//! What was computed from a BRDF, kept on disk.
//!
//! A file is found by the BRDF's content hash and the setup's id (version, lights, shape), and holds, little-endian:
//! the magic `VERNISC1`, its own key (u32 length, UTF-8), the payload, and the SHA-256 of all that precedes. Operators have the magic
//! `VERNISC2` and end in a CRC-32: where no features are kept, a learned metric reads these 40 MB, and their SHA-256 took a third of the
//! time. Older operators, which end in a SHA-256, are still read. A file that is truncated, damaged, of another key or of another format is never
//! trusted: its content is computed again and the file replaced. Writing goes to a temporary name and is renamed, so that a reader never
//! sees half a file. A folder that cannot be written costs time, not results: the failure comes back as a [`CacheWarning`].

use super::features::{BrdfFeatures, Stored};
use super::setup::Operators;
use super::{DescriptorError, Setup};
use crate::brdf::{ContentHash, IdentifiedBrdf};
use crate::io::{NewFile, read_at_most, write_atomically};
use crate::light::node_table::{NODES, NodeTable};
use crate::light::operator::Operator;
use crate::math::Rgb;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Once};
use std::time::Duration;
use thiserror::Error;

/// How a file ends.
#[derive(Clone, Copy)]
enum Seal {
    Sha256,
    Crc32,
}

impl Seal {
    const ALL: [Self; 2] = [Self::Sha256, Self::Crc32];

    fn magic(self) -> &'static [u8; 8] {
        match self {
            Self::Sha256 => b"VERNISC1",
            Self::Crc32 => b"VERNISC2",
        }
    }

    fn of(self, bytes: &[u8]) -> Vec<u8> {
        match self {
            Self::Sha256 => Sha256::digest(bytes).to_vec(),
            Self::Crc32 => crc32fast::hash(bytes).to_le_bytes().to_vec(),
        }
    }

    fn len(self) -> usize {
        match self {
            Self::Sha256 => 32,
            Self::Crc32 => 4,
        }
    }
}

/// Endings of files that are being written: by this version, and by the first.
const TEMPORARY: [&str; 2] = [NewFile::SUFFIX, ".tmp"];
/// Hundreds of times what features or distances take.
const MOST_BYTES: u64 = 256 << 20;
/// Several times what the operators of any setup take.
const MOST_OPERATOR_BYTES: u64 = 2 << 30;
/// Nobody writes half a megabyte for longer than this.
const LONGEST_WRITE: Duration = Duration::from_secs(3600);

/// A result that could be computed but not kept.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{}: cannot be written ({reason}); the next run computes it again", path.display())]
pub struct CacheWarning {
    /// Where the result should have been kept.
    pub path: PathBuf,
    /// Why it could not be written.
    pub reason: String,
}

/// A folder of computed features.
#[derive(Debug, Clone)]
pub struct Cache {
    folder: PathBuf,
    /// Whether half-written files were removed. It happens before the first file is written: a folder may hold tens of thousands of
    /// files, and a run that only reads should not list them.
    swept: Arc<Once>,
}

impl Cache {
    /// A cache in `folder`, which is created if need be. Errors: the folder neither exists nor can be created.
    pub fn open(folder: &Path) -> Result<Self, DescriptorError> {
        std::fs::create_dir_all(folder)
            .map_err(|e| DescriptorError::CacheFolder { path: folder.to_owned(), reason: e.to_string() })?;
        Ok(Self { folder: folder.to_owned(), swept: Arc::new(Once::new()) })
    }

    /// Where the cache lies unless somebody says otherwise: `$XDG_CACHE_HOME/vernis`, `~/.cache/vernis`, or `.vernis-cache` in the
    /// current folder where neither variable is set.
    pub fn user_folder() -> PathBuf {
        let variable = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
        let base = variable("XDG_CACHE_HOME").or_else(|| variable("HOME").map(|home| home.join(".cache")));
        base.map_or_else(|| PathBuf::from(".vernis-cache"), |base| base.join("vernis"))
    }

    /// Removes what runs that were killed have left half-written.
    fn sweep_up(&self) {
        for entry in std::fs::read_dir(&self.folder).into_iter().flatten().flatten() {
            let name = entry.file_name();
            if !TEMPORARY.iter().any(|ending| name.to_string_lossy().ends_with(ending)) {
                continue;
            }
            let age = entry.metadata().and_then(|m| m.modified()).ok().and_then(|at| at.elapsed().ok());
            if age.is_some_and(|age| age > LONGEST_WRITE) {
                // If it cannot be removed now, the next run tries.
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }

    /// Where the features of a BRDF are kept.
    pub fn path(&self, content: ContentHash, setup: &Setup) -> PathBuf {
        self.folder.join(format!("{content}.{}.features", setup.id()))
    }

    /// The features kept for a content hash, if they are there and whole.
    pub fn load(&self, content: ContentHash, setup: &Setup) -> Option<BrdfFeatures> {
        let bytes = read_at_most(&self.path(content, setup), MOST_BYTES).ok()?;
        let stored = decode_features(payload(&bytes, &key(content, setup))?, setup)?;
        Some(BrdfFeatures::from_stored(stored, setup))
    }

    /// Keeps features under a content hash.
    pub fn store(&self, content: ContentHash, features: &BrdfFeatures, setup: &Setup) -> Result<(), CacheWarning> {
        self.write(
            self.path(content, setup),
            &key(content, setup),
            &encode_features(&features.stored, setup),
            Seal::Sha256,
        )
    }

    /// The features of a BRDF: from the cache, or computed and kept.
    pub fn features(
        &self,
        brdf: &IdentifiedBrdf,
        setup: &Setup,
    ) -> Result<(BrdfFeatures, Option<CacheWarning>), DescriptorError> {
        if let Some(features) = self.load(brdf.content, setup) {
            return Ok((features, None));
        }
        let warning = self.prepare(setup);
        let features = BrdfFeatures::compute(brdf.brdf()?, setup)?;
        let warning = self.store(brdf.content, &features, setup).err().or(warning);
        Ok((features, warning))
    }

    /// Makes the operators of `setup` available, from the cache or by building and keeping them.
    pub fn prepare(&self, setup: &Setup) -> Option<CacheWarning> {
        if setup.has_operators() {
            return None;
        }
        let path = self.folder.join(format!("{}.operators", setup.id()));
        let key = format!("operators {}", setup.id());
        let read = || -> Option<Operators> {
            let bytes = read_at_most(&path, MOST_OPERATOR_BYTES).ok()?;
            let mut reader = Reader(payload(&bytes, &key)?);
            let pictures = decode_operator(&mut reader, setup.lights(), setup.pixels())?;
            let albedo = decode_operator(&mut reader, 1, 2)?;
            reader.0.is_empty().then_some(Operators { pictures, albedo })
        };
        if let Some(operators) = read() {
            setup.set_operators(operators);
            return None;
        }
        let (operators, built) = setup.operators_or_build();
        if !built {
            return None;
        }
        let mut bytes = Vec::new();
        encode_operator(&mut bytes, &operators.pictures);
        encode_operator(&mut bytes, &operators.albedo);
        self.write(path, &key, &bytes, Seal::Crc32).err()
    }

    /// Numbers kept under a key, which names what they are, of what, and in which version.
    pub fn load_values(&self, key: &str) -> Option<Vec<f64>> {
        let bytes = self.load_bytes(key)?;
        let (numbers, rest) = bytes.as_chunks::<8>();
        let numbers: Vec<f64> = numbers.iter().map(|b| f64::from_le_bytes(*b)).collect();
        // What is kept was finite.
        (rest.is_empty() && numbers.iter().all(|x| x.is_finite())).then_some(numbers)
    }

    /// Keeps numbers under a key.
    pub fn store_values(&self, key: &str, values: &[f64]) -> Result<(), CacheWarning> {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.store_bytes(key, &bytes)
    }

    /// What was kept under a key, if it is there and whole.
    pub fn load_bytes(&self, key: &str) -> Option<Vec<u8>> {
        let bytes = read_at_most(&self.values_path(key), MOST_BYTES).ok()?;
        payload(&bytes, key).map(<[u8]>::to_vec)
    }

    /// Keeps bytes under a key, which names what they are, of what, and in which version; at most 256 MB are read again.
    pub fn store_bytes(&self, key: &str, bytes: &[u8]) -> Result<(), CacheWarning> {
        self.write(self.values_path(key), key, bytes, Seal::Sha256)
    }

    fn values_path(&self, key: &str) -> PathBuf {
        self.folder.join(format!("{}.values", ContentHash::of(key.as_bytes())))
    }

    fn write(&self, path: PathBuf, key: &str, payload: &[u8], seal: Seal) -> Result<(), CacheWarning> {
        self.swept.call_once(|| self.sweep_up());
        let mut bytes = seal.magic().to_vec();
        bytes.extend((key.len() as u32).to_le_bytes());
        bytes.extend(key.as_bytes());
        bytes.extend(payload);
        bytes.extend(seal.of(&bytes));
        write_atomically(&path, &bytes).map_err(|e| CacheWarning { path, reason: e.to_string() })
    }
}

fn key(content: ContentHash, setup: &Setup) -> String {
    format!("features {content} {}", setup.id())
}

/// The payload of a whole file with this key.
fn payload<'a>(bytes: &'a [u8], key: &str) -> Option<&'a [u8]> {
    let seal = Seal::ALL.into_iter().find(|seal| bytes.starts_with(seal.magic()))?;
    let (body, found) = bytes.split_at_checked(bytes.len().checked_sub(seal.len())?)?;
    let rest = body.strip_prefix(seal.magic())?;
    let rest = rest.strip_prefix(&(key.len() as u32).to_le_bytes())?.strip_prefix(key.as_bytes())?;
    (seal.of(body) == found).then_some(rest)
}

/// Takes numbers off the front of a payload.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize, T>(&mut self, count: usize, from: impl Fn([u8; N]) -> T) -> Option<Vec<T>> {
        let (front, rest) = self.0.split_at_checked(count.checked_mul(N)?)?;
        self.0 = rest;
        Some(front.as_chunks::<N>().0.iter().map(|c| from(*c)).collect())
    }

    fn count(&mut self) -> Option<usize> {
        self.take(1, u32::from_le_bytes)?.first().map(|v| *v as usize)
    }

    /// Numbers of version 1 are f32.
    fn triples(&mut self, count: usize, setup: &Setup) -> Option<Vec<Rgb>> {
        let count = count.checked_mul(3)?;
        let numbers = match setup.version() {
            1 => self.take(count, |b| f64::from(f32::from_le_bytes(b)))?,
            _ => self.take(count, f64::from_le_bytes)?,
        };
        Some(numbers.as_chunks::<3>().0.to_vec())
    }
}

fn put_floats(bytes: &mut Vec<u8>, values: impl IntoIterator<Item = f32>) {
    values.into_iter().for_each(|v| bytes.extend(v.to_le_bytes()));
}

fn put_triples(bytes: &mut Vec<u8>, values: &[Rgb], setup: &Setup) {
    match setup.version() {
        1 => put_floats(bytes, values.iter().flatten().map(|v| *v as f32)),
        _ => values.iter().flatten().for_each(|v| bytes.extend(v.to_le_bytes())),
    }
}

fn encode_features(stored: &Stored, setup: &Setup) -> Vec<u8> {
    let mut bytes = Vec::new();
    put_triples(&mut bytes, stored.table.values(), setup);
    bytes.extend(stored.table.sampled().iter().map(|s| u8::from(*s)));
    stored.pictures.iter().for_each(|picture| put_triples(&mut bytes, picture, setup));
    stored.albedo.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    bytes
}

fn decode_features(payload: &[u8], setup: &Setup) -> Option<Stored> {
    let mut reader = Reader(payload);
    let values = reader.triples(NODES, setup)?;
    let sampled = reader.take(NODES, |[b]: [u8; 1]| b == 1)?;
    let table = NodeTable::from_parts(values, sampled)?;
    let pictures: Option<Vec<_>> = (0..setup.lights()).map(|_| reader.triples(setup.pixels(), setup)).collect();
    let pictures = pictures.filter(|p| p.iter().flatten().flatten().all(|v| v.is_finite() && *v >= 0.0))?;
    let albedo = reader.take(2, f64::from_le_bytes)?;
    reader.0.is_empty().then_some(Stored { table, pictures, albedo: [albedo[0], albedo[1]] })
}

fn encode_operator(bytes: &mut Vec<u8>, operator: &Operator) {
    bytes.extend((operator.node.len() as u32).to_le_bytes());
    operator.start.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    operator.node.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    put_floats(bytes, operator.weight.iter().copied());
}

fn decode_operator(reader: &mut Reader<'_>, lights: usize, pixels: usize) -> Option<Operator> {
    let entries = reader.count()?;
    let start = reader.take(pixels + 1, u32::from_le_bytes)?;
    let node = reader.take(entries, u16::from_le_bytes)?;
    let weight = reader.take(entries.checked_mul(3 * lights)?, f32::from_le_bytes)?;
    let ordered = start.first() == Some(&0)
        && start.last().map(|s| *s as usize) == Some(entries)
        && start.is_sorted()
        && node.iter().all(|n| (*n as usize) < NODES)
        && weight.iter().all(|w| w.is_finite());
    ordered.then_some(Operator { lights, start, node, weight })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Files of both kinds, one of which older programs wrote for operators too; no damage is overlooked.
    #[test]
    fn what_either_seal_closes_is_read_and_damage_is_found() {
        let folder = tempfile::tempdir().expect("a folder");
        let cache = Cache::open(folder.path()).expect("writable");
        let path = folder.path().join("a.operators");
        for (seal, length) in [(Seal::Sha256, 8 + 4 + 3 + 7 + 32), (Seal::Crc32, 8 + 4 + 3 + 7 + 4)] {
            cache.write(path.clone(), "key", b"payload", seal).expect("written");
            let whole = std::fs::read(&path).expect("there");
            assert_eq!((payload(&whole, "key"), whole.len()), (Some(&b"payload"[..]), length));
            assert_eq!(payload(&whole, "kex"), None);
            for place in 0..whole.len() {
                let mut damaged = whole.clone();
                damaged[place] ^= 1;
                assert_eq!(payload(&damaged, "key"), None, "byte {place}");
                assert_eq!(payload(&whole[..place], "key"), None, "{place} bytes");
            }
        }
    }
}
