//! NBRDF: one small network per material, stored by Keras as HDF5: a file `.h5`, alone or inside a zip archive.
//!
//! f = max(exp(W3 relu(W2 relu(W1 x + b1) + b2) + b3) - 1, 0)
//!
//! x: the half vector (x, y, z) and the difference vector (x, y, z) of the pair of directions turned so that
//! phi_h = 0; W1: 6x21, W2: 21x21, W3: 21x3, stored as `[input][output]`; f: linear RGB, 1/sr, cosine not included.
//! Not reciprocal: the network sees on which side of the half vector the light is.
//! Source: Sztrajman et al. 2021, section 3, doi:10.1111/cgf.14335.
//! Cost: 675 multiplications and three exponentials. Thirty-two pairs go through the layers side by side so that the
//! compiler vectorises over them; every pair sees the same operations in the same order on every path, so that
//! neither the batch nor the instruction set changes a result.

use super::{archive, io_error};
use crate::brdf::{Brdf, BrdfError};
use crate::io::read_at_most;
use crate::math::coordinates::half_and_difference_vectors;
use crate::math::{Rgb, Vec3};
use multiversion::multiversion;
use std::path::Path;

const INPUTS: usize = 6;
const HIDDEN: usize = 21;
const LANES: usize = 32;
/// A network has 19 kB.
pub(super) const MOST_BYTES: u64 = 1 << 20;

/// Sides of the chunks in which a file may store a layer.
const MOST_SIDE: u64 = 4096;
/// Of a weight: with larger ones, sums could exceed the range of f32 and become no numbers.
const LARGEST: f32 = 1e6;

/// A material's network.
#[derive(Debug, Clone)]
pub struct Nbrdf {
    w1: [[f32; HIDDEN]; INPUTS],
    b1: [f32; HIDDEN],
    w2: [[f32; HIDDEN]; HIDDEN],
    b2: [f32; HIDDEN],
    w3: [[f32; 3]; HIDDEN],
    b3: [f32; 3],
}

/// One dense layer over `N` pairs, structure of arrays.
#[inline(always)]
fn dense<const I: usize, const O: usize, const N: usize>(
    x: &[[f32; N]; I],
    w: &[[f32; O]; I],
    b: &[f32; O],
) -> [[f32; N]; O] {
    let mut y = [[0.0; N]; O];
    for (o, y) in y.iter_mut().enumerate() {
        let mut sum = [b[o]; N];
        for i in 0..I {
            for n in 0..N {
                sum[n] += w[i][o] * x[i][n];
            }
        }
        *y = sum;
    }
    y
}

#[inline(always)]
fn relu<const O: usize, const N: usize>(mut y: [[f32; N]; O]) -> [[f32; N]; O] {
    for v in y.as_flattened_mut() {
        *v = v.max(0.0);
    }
    y
}

impl Nbrdf {
    /// The network in the bytes of a Keras HDF5 file; the error says what is missing or misshapen.
    pub fn from_hdf5(bytes: Vec<u8>) -> Result<Self, String> {
        let file = hdf5_pure::File::from_bytes(bytes).map_err(|e| e.to_string())?;
        let read = |name: &str, shape: &[u64]| -> Result<Vec<f32>, String> {
            let dataset = file.dataset(name).map_err(|e| format!("{name}: {e}"))?;
            let found = dataset.shape().map_err(|e| format!("{name}: {e}"))?;
            if found != shape {
                return Err(format!("{name} has shape {found:?}; it must have {shape:?}"));
            }
            // Chunks are unpacked whole, whatever part of them the network takes.
            let chunk = dataset.chunk_shape().map_err(|e| format!("{name}: {e}"))?.unwrap_or_default();
            if chunk.iter().any(|side| *side > MOST_SIDE) {
                return Err(format!("{name} has chunks of shape {chunk:?}; each side must be at most {MOST_SIDE}"));
            }
            let values = dataset.read_f32().map_err(|e| format!("{name}: {e}"))?;
            match values.iter().position(|v| v.is_nan() || v.abs() > LARGEST) {
                Some(k) => {
                    let allowed = format!("finite numbers of at most {LARGEST:e} in magnitude");
                    Err(format!("{name} holds {} at {k}; it must hold {allowed}", values[k]))
                }
                None => Ok(values),
            }
        };
        let (h, i) = (HIDDEN as u64, INPUTS as u64);
        let w1 = read("dense_1/dense_1/kernel:0", &[i, h])?;
        let w2 = read("dense_2/dense_2/kernel:0", &[h, h])?;
        let w3 = read("dense_3/dense_3/kernel:0", &[h, 3])?;
        let b1 = read("dense_1/dense_1/bias:0", &[h])?;
        let b2 = read("dense_2/dense_2/bias:0", &[h])?;
        let b3 = read("dense_3/dense_3/bias:0", &[3])?;
        let hidden = |v: &[f32], row: usize| std::array::from_fn(|o| v[row * HIDDEN + o]);
        Ok(Self {
            w1: std::array::from_fn(|r| hidden(&w1, r)),
            b1: hidden(&b1, 0),
            w2: std::array::from_fn(|r| hidden(&w2, r)),
            b2: hidden(&b2, 0),
            w3: std::array::from_fn(|r| std::array::from_fn(|o| w3[3 * r + o])),
            b3: std::array::from_fn(|o| b3[o]),
        })
    }

    #[inline(always)]
    fn layers<const N: usize>(&self, x: &[[f32; N]; INPUTS]) -> [[f32; N]; 3] {
        let y = relu(dense(x, &self.w1, &self.b1));
        let y = relu(dense(&y, &self.w2, &self.b2));
        dense(&y, &self.w3, &self.b3)
    }
}

/// [`Nbrdf::layers`] of [`LANES`] pairs.
#[multiversion(targets("x86_64+avx2"))]
fn layers_wide(network: &Nbrdf, x: &[[f32; LANES]; INPUTS]) -> [[f32; LANES]; 3] {
    network.layers(x)
}

fn input(wi: Vec3, wo: Vec3) -> [f32; INPUTS] {
    let (h, d) = half_and_difference_vectors(wi, wo);
    [h.x, h.y, h.z, d.x, d.y, d.z].map(|v| v as f32)
}

fn output(wi: Vec3, wo: Vec3, log: [f32; 3]) -> Rgb {
    if wi.z <= 0.0 || wo.z <= 0.0 { [0.0; 3] } else { log.map(|v| (f64::from(v).exp() - 1.0).max(0.0)) }
}

impl Brdf for Nbrdf {
    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        let log = self.layers(&input(wi, wo).map(|v| [v]));
        Some(output(wi, wo, log.map(|v| v[0])))
    }

    fn eval_batch(&self, wi: &[Vec3], wo: &[Vec3], out: &mut [Option<Rgb>]) {
        for ((wi, wo), out) in wi.chunks(LANES).zip(wo.chunks(LANES)).zip(out.chunks_mut(LANES)) {
            let mut x = [[0.0; LANES]; INPUTS];
            for n in 0..out.len() {
                for (row, v) in x.iter_mut().zip(input(wi[n], wo[n])) {
                    row[n] = v;
                }
            }
            let log = layers_wide(self, &x);
            for (n, out) in out.iter_mut().enumerate() {
                *out = Some(output(wi[n], wo[n], [log[0][n], log[1][n], log[2][n]]));
            }
        }
    }
}

/// The network of `material` in the archive at `path`.
pub fn read(path: &Path, material: &str) -> Result<Nbrdf, BrdfError> {
    decode(path, material, archive::member(path, material)?.bytes)
}

/// The network in the bytes of a member; `path` and `material` are for messages.
pub fn decode(path: &Path, material: &str, bytes: Vec<u8>) -> Result<Nbrdf, BrdfError> {
    Nbrdf::from_hdf5(bytes).map_err(|reason| BrdfError::Malformed {
        path: path.to_owned(),
        format: "archive of BRDFs",
        reason: format!("{material}: {reason}"),
    })
}

/// The bytes of a network that is no member of an archive.
pub(in crate::brdf) fn bytes(path: &Path) -> Result<Vec<u8>, BrdfError> {
    read_at_most(path, MOST_BYTES).map_err(io_error(path))
}

/// The network in the bytes of a file of its own, whose name is `path`.
///
/// # Errors
/// Another kind of file, layers of other shapes, numbers that are none.
pub fn decode_file(path: &Path, bytes: Vec<u8>) -> Result<Nbrdf, BrdfError> {
    Nbrdf::from_hdf5(bytes).map_err(|reason| BrdfError::Malformed {
        path: path.to_owned(),
        format: "NBRDF network",
        reason,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::seed::stream;
    use rand::Rng;

    /// Nothing here is multiplied and added in one instruction. On a processor without AVX2 both sides are the same code.
    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let mut random = stream(5, "network layers", 0);
        let mut next = || random.random_range(-1.0..1.0);
        let network = Nbrdf {
            w1: std::array::from_fn(|_| std::array::from_fn(|_| next())),
            b1: std::array::from_fn(|_| next()),
            w2: std::array::from_fn(|_| std::array::from_fn(|_| next())),
            b2: std::array::from_fn(|_| next()),
            w3: std::array::from_fn(|_| std::array::from_fn(|_| next())),
            b3: std::array::from_fn(|_| next()),
        };
        let x = std::array::from_fn(|_| std::array::from_fn(|_| next()));
        let bits = |y: [[f32; LANES]; 3]| y.map(|y| y.map(f32::to_bits));
        assert_eq!(bits(layers_wide(&network, &x)), bits(network.layers(&x)));
    }
}
