//! Files that metrics need and vernis may not ship: weights of networks and the table of LAB2000HL. The user names a folder that has
//! them.
//!
//! [`WEIGHTS_FILES`] lists every file with its name in that folder, its origin and its published checksum. [`Weights`] is a folder;
//! metrics read a file of it at first use and keep it.

use super::lab2000hl::Lab2000HlTable;
use sha2::{Digest, Sha256};
#[cfg(feature = "networks")]
use std::any::Any;
#[cfg(feature = "networks")]
use std::collections::BTreeMap;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
#[cfg(feature = "networks")]
use std::sync::Arc;
use std::sync::{Mutex, PoisonError};
use thiserror::Error;
use vernis_metric::io::open_regular;

/// Bytes of the largest file that is read; the largest published one, VGG-16, has half as many.
pub const MOST_BYTES: u64 = 1 << 30;

/// A file that metrics need.
#[derive(Debug, PartialEq, Eq)]
pub struct WeightsFile {
    /// Its name in the folder, which is that of the published file.
    pub name: &'static str,
    /// The name of a safetensors file with the same tensors, which is read where the published file is not there.
    pub safetensors: Option<&'static str>,
    /// What it holds.
    pub content: &'static str,
    /// Metrics that need it.
    pub metrics: &'static [&'static str],
    /// Where a user gets it.
    pub origin: &'static str,
    /// Its licence.
    pub licence: &'static str,
    /// Its size in bytes, where it is known.
    pub bytes: Option<u64>,
    /// Its size in words.
    pub size: &'static str,
    /// The SHA-256 of the published file in hexadecimal digits, or the first of them that are known.
    pub sha256: Option<&'static str>,
}

const LPIPS_WHEEL: &str = "the wheel `lpips` 0.1.4 on PyPI, a ZIP archive, folder lpips/weights/v0.1";
const ST_LPIPS_WHEEL: &str =
    "the wheel `stlpips-pytorch` 0.0.2 on PyPI, a ZIP archive, folder stlpips_pytorch/weights/vST0.0";

/// Every file, in the order of lists.
pub const WEIGHTS_FILES: &[WeightsFile] = &[
    WeightsFile {
        name: Lab2000HlTable::FILE,
        safetensors: None,
        content: "the table of LAB2000HL: for b* = -128 to 128, for a* = -128 to 128, a and b as little-endian 32-bit numbers",
        metrics: &["cid", "icid", "icid-octave"],
        origin: "the table in the authors' MATLAB program of iCID, written in this form",
        licence: "none stated",
        bytes: Some(528_392),
        size: "528,392 bytes",
        sha256: None,
    },
    WeightsFile {
        name: "alex_shift_tolerant.pth",
        safetensors: Some("alex_shift_tolerant.safetensors"),
        content: "ST-LPIPS on AlexNet, complete",
        metrics: &["st-lpips-alex"],
        origin: ST_LPIPS_WHEEL,
        licence: "BSD-2-Clause",
        bytes: Some(9_899_296),
        size: "9,899,296 bytes",
        sha256: Some("b356b382f96010f77d085ee8343ecd9fd322d0a56e8de2b2d0549fafcad8b9ee"),
    },
    WeightsFile {
        name: "vgg_shift_tolerant.pth",
        safetensors: Some("vgg_shift_tolerant.safetensors"),
        content: "ST-LPIPS on VGG-16, complete",
        metrics: &["st-lpips-vgg"],
        origin: ST_LPIPS_WHEEL,
        licence: "BSD-2-Clause",
        bytes: Some(58_907_298),
        size: "58,907,298 bytes",
        sha256: Some("44597da68f49c1837c100ff52299050f274d102eb102e5837178c79be6f0e250"),
    },
    WeightsFile {
        name: "alex.pth",
        safetensors: Some("alex.safetensors"),
        content: "linear layers of LPIPS 0.1 for AlexNet",
        metrics: &["lpips-alex"],
        origin: LPIPS_WHEEL,
        licence: "BSD-2-Clause",
        bytes: Some(6_009),
        size: "6,009 bytes",
        sha256: Some("df73285e35b22355a2df87cdb6b70b343713b667eddbda73e1977e0c860835c0"),
    },
    WeightsFile {
        name: "vgg.pth",
        safetensors: Some("vgg.safetensors"),
        content: "linear layers of LPIPS 0.1 for VGG-16",
        metrics: &["lpips-vgg"],
        origin: LPIPS_WHEEL,
        licence: "BSD-2-Clause",
        bytes: Some(7_289),
        size: "7,289 bytes",
        sha256: Some("a78928a0af1e5f0fcb1f3b9e8f8c3a2a5a3de244d830ad5c1feddc79b8432868"),
    },
    WeightsFile {
        name: "squeeze.pth",
        safetensors: Some("squeeze.safetensors"),
        content: "linear layers of LPIPS 0.1 for SqueezeNet 1.1",
        metrics: &["lpips-squeeze"],
        origin: LPIPS_WHEEL,
        licence: "BSD-2-Clause",
        bytes: Some(10_811),
        size: "10,811 bytes",
        sha256: Some("4a5350f23600cb79923ce65bb07cbf57dca461329894153e05a1346bd531cf76"),
    },
    WeightsFile {
        name: "alexnet-owt-7be5be79.pth",
        safetensors: Some("alexnet-owt-7be5be79.safetensors"),
        content: "AlexNet of torchvision (features.0 to features.10)",
        metrics: &["lpips-alex"],
        origin: "torchvision, weights AlexNet_Weights.IMAGENET1K_V1, kept under this name",
        licence: "BSD-3-Clause",
        bytes: None,
        size: "about 244 MB",
        sha256: Some("7be5be79"),
    },
    WeightsFile {
        name: "vgg16-397923af.pth",
        safetensors: Some("vgg16-397923af.safetensors"),
        content: "VGG-16 of torchvision (features.0 to features.28)",
        metrics: &["lpips-vgg"],
        origin: "torchvision, weights VGG16_Weights.IMAGENET1K_V1, kept under this name",
        licence: "BSD-3-Clause",
        bytes: None,
        size: "about 553 MB",
        sha256: Some("397923af"),
    },
    WeightsFile {
        name: "squeezenet1_1-b8a52dc0.pth",
        safetensors: Some("squeezenet1_1-b8a52dc0.safetensors"),
        content: "SqueezeNet 1.1 of torchvision (features.0 to features.12)",
        metrics: &["lpips-squeeze"],
        origin: "torchvision, weights SqueezeNet1_1_Weights.IMAGENET1K_V1, kept under this name",
        licence: "BSD-3-Clause",
        bytes: None,
        size: "about 5 MB",
        sha256: Some("b8a52dc0"),
    },
    WeightsFile {
        name: "model_best.pth.tar",
        safetensors: Some("model_best.safetensors"),
        content: "MatSim: ResNet-34 (new_model) and its embedding (fc)",
        metrics: &["matsim"],
        origin: "the authors' repository mlagunas/material-appearance-similarity on GitHub, \"model weights\" in its README",
        licence: "GPL-2.0, that of the repository",
        bytes: None,
        size: "at least 85 MB",
        sha256: None,
    },
];

impl WeightsFile {
    /// The file called `name`.
    pub fn named(name: &str) -> Option<&'static Self> {
        WEIGHTS_FILES.iter().find(|file| file.name == name)
    }

    /// What a folder has of this file.
    ///
    /// # Errors
    /// What the operating system says of the file that is there.
    pub fn state(&self, folder: &Path) -> io::Result<WeightsState> {
        let Some(path) = self.find(folder) else { return Ok(WeightsState::Missing) };
        let (bytes, sha256) = fingerprint(&path)?;
        let expected = self.sha256.filter(|_| path.ends_with(self.name));
        Ok(match expected {
            Some(expected) if sha256.starts_with(expected) && self.bytes.is_none_or(|n| n == bytes) => {
                WeightsState::AsPublished { path }
            }
            Some(_) => WeightsState::Different { path, sha256 },
            None => WeightsState::Unchecked { path, sha256 },
        })
    }

    /// The published file in a folder, or else the safetensors file with the same tensors.
    pub fn find(&self, folder: &Path) -> Option<PathBuf> {
        let names = std::iter::once(self.name).chain(self.safetensors);
        names.map(|name| folder.join(name)).find(|path| path.exists())
    }

    /// Its names, for messages.
    pub fn names(&self) -> String {
        match self.safetensors {
            Some(other) => format!("{} (or {other})", self.name),
            None => self.name.to_owned(),
        }
    }
}

/// What a folder has of a [`WeightsFile`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WeightsState {
    /// Nothing.
    Missing,
    /// The published content.
    AsPublished {
        /// The file.
        path: PathBuf,
    },
    /// A file whose published checksum is not known.
    Unchecked {
        /// The file.
        path: PathBuf,
        /// Its SHA-256.
        sha256: String,
    },
    /// Another content than the published one.
    Different {
        /// The file.
        path: PathBuf,
        /// Its SHA-256.
        sha256: String,
    },
}

/// Bytes and SHA-256 of a file of at most [`MOST_BYTES`], read piece by piece.
fn fingerprint(path: &Path) -> io::Result<(u64, String)> {
    let mut file = open_regular(path)?;
    let found = file.metadata()?.len();
    if found > MOST_BYTES {
        let message = format!("it has {found} bytes; a file of weights may have at most {MOST_BYTES}");
        return Err(io::Error::new(io::ErrorKind::InvalidData, message));
    }
    let mut hasher = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    let mut bytes = 0;
    loop {
        match file.read(&mut buffer)? {
            0 => break,
            n => {
                hasher.update(&buffer[..n]);
                bytes += n as u64;
            }
        }
    }
    Ok((bytes, format!("{:x}", hasher.finalize())))
}

/// A folder with weights, and the networks that were read from it.
pub struct Weights {
    folder: PathBuf,
    #[cfg(feature = "networks")]
    networks: Mutex<BTreeMap<&'static str, Arc<dyn Any + Send + Sync>>>,
    notes: Mutex<Vec<String>>,
}

impl std::fmt::Debug for Weights {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Weights").field("folder", &self.folder).finish_non_exhaustive()
    }
}

impl Weights {
    /// The files of a folder.
    ///
    /// # Errors
    /// [`WeightsError`]: it is no folder.
    pub fn in_folder(folder: &Path) -> Result<Self, WeightsError> {
        if !folder.is_dir() {
            return Err(WeightsError::new(folder, "it is no folder; it must be the name of one"));
        }
        Ok(Self {
            folder: folder.to_owned(),
            #[cfg(feature = "networks")]
            networks: Mutex::default(),
            notes: Mutex::default(),
        })
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whether the folder has all files of these names.
    pub fn has(&self, names: &[&str]) -> bool {
        names.iter().all(|name| WeightsFile::named(name).is_some_and(|file| file.find(&self.folder).is_some()))
    }

    /// What tells the content of files of these names from any other: their SHA-256; empty for what is not there.
    pub fn contents(&self, names: &[&str]) -> String {
        let sha256 = |name: &&str| {
            let path = WeightsFile::named(name)?.find(&self.folder)?;
            Some(fingerprint(&path).ok()?.1)
        };
        names.iter().map(|name| sha256(name).unwrap_or_default()).collect::<Vec<_>>().join(" ")
    }

    /// What a user should know of the files that were read, such as that one is not the published one.
    pub fn notes(&self) -> Vec<String> {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The network called `name`, which `load` reads at the first call; later calls share it.
    #[cfg(feature = "networks")]
    pub(super) fn network<T: Any + Send + Sync>(
        &self,
        name: &'static str,
        load: impl FnOnce() -> Result<T, WeightsError>,
    ) -> Result<Arc<T>, WeightsError> {
        let mut networks = self.networks.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(Ok(kept)) = networks.get(name).map(|kept| kept.clone().downcast::<T>()) {
            return Ok(kept);
        }
        let network = Arc::new(load()?);
        networks.insert(name, network.clone());
        Ok(network)
    }

    /// The path of a file that is there, with a note where it is not the published one.
    #[cfg(feature = "networks")]
    pub(super) fn checked(&self, file: &WeightsFile) -> Result<PathBuf, WeightsError> {
        let wrong = |path: &Path, error: io::Error| WeightsError::new(path, error);
        let path = file
            .find(&self.folder)
            .ok_or_else(|| WeightsError::new(&self.folder.join(file.name), "there is no such file"))?;
        match file.state(&self.folder).map_err(|error| wrong(&path, error))? {
            WeightsState::Different { path, sha256 } => {
                let published = file.sha256.unwrap_or_default();
                let dots = if published.len() < 64 { "..." } else { "" };
                self.notes.lock().unwrap_or_else(PoisonError::into_inner).push(format!(
                    "{} is not the published file: its SHA-256 is {sha256}; that of the published file is {published}{dots}",
                    path.display()
                ));
            }
            WeightsState::Missing | WeightsState::AsPublished { .. } | WeightsState::Unchecked { .. } => {}
        }
        Ok(path)
    }
}

/// Why a file of weights cannot be used.
#[derive(Debug, Error)]
#[error("{}: {reason}", path.display())]
pub struct WeightsError {
    /// The file.
    pub path: PathBuf,
    /// Which tensor, what was found, and what is allowed.
    pub reason: String,
}

impl WeightsError {
    pub(super) fn new(path: &Path, reason: impl ToString) -> Self {
        Self { path: path.to_owned(), reason: reason.to_string() }
    }
}
