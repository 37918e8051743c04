//! Tensors of a file of weights, by name: PyTorch checkpoints (by the crate `pytorch-reader`, which `burn-store` uses) and
//! safetensors.
//!
//! A network says which tensors it needs. A file must have all of them, in their shapes, as finite 32-bit or 64-bit numbers, and no
//! others but those that the network knows and leaves aside. Tensors are looked at by name and shape before their numbers are read,
//! so that memory follows from the network and not from the file; a safetensors file is read whole, and has at most
//! [`MOST_BYTES`] bytes.

use crate::metric::weights::{MOST_BYTES, WeightsError};
use pytorch_reader::{DType, PytorchReader};
use safetensors::{Dtype, SafeTensors};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use vernis_metric::io::{read_at_most, shown};

/// Names in messages are cut here.
const LONGEST_NAME: usize = 80;

/// A tensor that a network needs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Wanted {
    /// Its name in the file.
    pub name: String,
    /// Its shape, outermost first.
    pub shape: Vec<usize>,
}

impl Wanted {
    pub(super) fn new(name: impl Into<String>, shape: impl Into<Vec<usize>>) -> Self {
        Self { name: name.into(), shape: shape.into() }
    }
}

/// The tensors of a network, row by row.
pub(super) struct Tensors(BTreeMap<String, Vec<f32>>);

impl Tensors {
    /// Takes a tensor that was asked for; each can be taken once.
    pub(super) fn take(&mut self, name: &str) -> Vec<f32> {
        self.0.remove(name).unwrap_or_else(|| unreachable!("{name} is not among the tensors that were asked for"))
    }
}

/// What a file says of its tensors before their numbers are read.
struct Found {
    name: String,
    shape: Vec<usize>,
    /// Bytes of a number, or the name of another type.
    width: Result<usize, String>,
}

/// Reads the tensors of `wanted` from the file at `path`. Names that `left_aside` accepts may be there too.
pub(super) fn read(path: &Path, wanted: &[Wanted], left_aside: fn(&str) -> bool) -> Result<Tensors, WeightsError> {
    let wrong = |reason: String| WeightsError::new(path, reason);
    if path.extension().is_some_and(|ending| ending == "safetensors") {
        let bytes = read_at_most(path, MOST_BYTES).map_err(|e| wrong(e.to_string()))?;
        let file = SafeTensors::deserialize(&bytes).map_err(|e| wrong(format!("it is no safetensors file: {e}")))?;
        let found = file.iter().map(|(name, view)| {
            let width = match view.dtype() {
                Dtype::F32 => Ok(4),
                Dtype::F64 => Ok(8),
                other => Err(format!("{other:?}")),
            };
            Found { name: name.to_owned(), shape: view.shape().to_vec(), width }
        });
        return collect(path, found.collect(), wanted, left_aside, |name| {
            file.tensor(name).map(|view| view.data().to_vec()).map_err(|e| e.to_string())
        });
    }
    let file = PytorchReader::new(path).map_err(|e| wrong(format!("it is no PyTorch checkpoint: {e}")))?;
    let all = file.tensors();
    let found = all.values().map(|tensor| {
        let width = match tensor.dtype() {
            DType::F32 => Ok(4),
            DType::F64 => Ok(8),
            other => Err(format!("{other:?}")),
        };
        Found { name: tensor.name.clone(), shape: tensor.shape().to_vec(), width }
    });
    collect(path, found.collect(), wanted, left_aside, |name| match all.get(name) {
        Some(tensor) => tensor.read().map_err(|e| e.to_string()),
        None => Err("it is gone".to_owned()),
    })
}

/// Checkpoints of a training hold the tensors of the network here, and others beside it.
const NESTED: &str = "state_dict.";
/// Networks that were trained on many graphics cards have this before every name.
const PARALLEL: &str = "module.";

fn collect(
    path: &Path,
    found: Vec<Found>,
    wanted: &[Wanted],
    left_aside: fn(&str) -> bool,
    read: impl Fn(&str) -> Result<Vec<u8>, String>,
) -> Result<Tensors, WeightsError> {
    let wrong = |reason: String| WeightsError::new(path, reason);
    let mut prefix = String::new();
    for part in [NESTED, PARALLEL] {
        if found.iter().any(|tensor| tensor.name.starts_with(&(prefix.clone() + part))) {
            prefix += part;
        }
    }
    let by_name: BTreeMap<&str, &Found> =
        found.iter().filter_map(|tensor| Some((tensor.name.strip_prefix(&prefix)?, tensor))).collect();
    let shape = |shape: &[usize]| match shape {
        [] => "a single number".to_owned(),
        _ => shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(" x "),
    };
    let names: BTreeSet<&str> = wanted.iter().map(|tensor| tensor.name.as_str()).collect();
    if let Some(extra) = by_name.keys().find(|name| !names.contains(*name) && !left_aside(name)) {
        let extra = shown(extra, LONGEST_NAME);
        return Err(wrong(format!("tensor {extra} is none of this network's; it has {} tensors", wanted.len())));
    }
    let mut tensors = BTreeMap::new();
    for Wanted { name, shape: allowed } in wanted {
        let Some(tensor) = by_name.get(name.as_str()) else {
            return Err(wrong(format!("there is no tensor {name} of {}", shape(allowed))));
        };
        if &tensor.shape != allowed {
            let (found, allowed) = (shape(&tensor.shape), shape(allowed));
            return Err(wrong(format!("tensor {name} is {found}; it must be {allowed}")));
        }
        let width = tensor.width.clone().map_err(|found| {
            wrong(format!("tensor {name} has numbers of type {found}; they must be of type F32 or F64"))
        })?;
        let bytes = read(&tensor.name).map_err(|reason| wrong(format!("tensor {name} cannot be read: {reason}")))?;
        let values = numbers(&bytes, width);
        let count: usize = allowed.iter().product();
        if values.len() != count {
            return Err(wrong(format!("tensor {name} has {} numbers; it must have {count}", values.len())));
        }
        if let Some(at) = values.iter().position(|v| !v.is_finite()) {
            return Err(wrong(format!("number {at} of tensor {name} is {}; it must be finite", values[at])));
        }
        tensors.insert(name.clone(), values);
    }
    Ok(Tensors(tensors))
}

/// Little-endian numbers of 4 or 8 bytes.
fn numbers(bytes: &[u8], width: usize) -> Vec<f32> {
    if width == 4 {
        return bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    }
    let wide = |b: &[u8]| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]) as f32;
    bytes.chunks_exact(8).map(wide).collect()
}
