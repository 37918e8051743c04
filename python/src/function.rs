//! A BRDF that is a Python function of arrays of directions.

use crate::fault::Fault;
use numpy::{IntoPyArray, PyArray1, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::sync::{Mutex, PoisonError};
use vernis_metric::brdf::Brdf;
use vernis_metric::math::{Rgb, Vec3};

/// A function `(wi, wo) -> values` of float64 arrays of shape (n, 3). What it raises is kept until [`FunctionBrdf::raised`] asks for it;
/// until then every further value counts as missing.
pub struct FunctionBrdf {
    function: Py<PyAny>,
    /// Components below zero are colours outside the gamut of the primaries.
    signed: bool,
    raised: Mutex<Option<Fault>>,
}

impl FunctionBrdf {
    /// `function` hands back a C-contiguous float64 array of shape (n, 3): the Python side sees to it.
    pub fn new(function: Py<PyAny>, signed: bool) -> Self {
        Self { function, signed, raised: Mutex::new(None) }
    }

    /// What the function has raised since the last time, if anything.
    pub fn raised(&self) -> Option<Fault> {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn has_raised(&self) -> bool {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    fn values(&self, wi: &[Vec3], wo: &[Vec3]) -> Result<Vec<Rgb>, Fault> {
        Python::attach(|py| {
            let found = self.function.call1(py, (array(py, wi)?, array(py, wo)?))?;
            let found: PyReadonlyArray2<'_, f64> = found.extract(py)?;
            let values = rows(&found, "the values of a function")?;
            if values.len() != wi.len() {
                return Err(Fault::Input(format!(
                    "the function gave {} values for {} directions",
                    values.len(),
                    wi.len()
                )));
            }
            let wrong = values.iter().position(|rgb| rgb.iter().any(|v| !v.is_finite() || (*v < 0.0 && !self.signed)));
            match wrong {
                Some(k) => Err(Fault::Input(format!(
                    "the function gave {:?} for wi {}, wo {}; each value must be finite and not negative",
                    values[k],
                    shown(wi[k]),
                    shown(wo[k])
                ))),
                None => Ok(values),
            }
        })
    }
}

fn shown(w: Vec3) -> String {
    format!("[{:.4}, {:.4}, {:.4}]", w.x, w.y, w.z)
}

impl Brdf for FunctionBrdf {
    fn is_signed(&self) -> bool {
        self.signed
    }

    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        let mut out = [None];
        self.eval_batch(&[wi], &[wo], &mut out);
        out[0]
    }

    fn eval_batch(&self, wi: &[Vec3], wo: &[Vec3], out: &mut [Option<Rgb>]) {
        out.fill(None);
        if self.has_raised() {
            return;
        }
        let above: Vec<usize> = (0..wi.len()).filter(|&k| wi[k].z > 0.0 && wo[k].z > 0.0).collect();
        let of = |w: &[Vec3]| above.iter().map(|&k| w[k]).collect::<Vec<_>>();
        let found = if above.is_empty() { Ok(Vec::new()) } else { self.values(&of(wi), &of(wo)) };
        match found {
            Ok(values) => {
                out.fill(Some([0.0; 3]));
                above.iter().zip(values).for_each(|(&k, value)| out[k] = Some(value));
            }
            Err(fault) => {
                self.raised.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(fault);
            }
        }
    }
}

/// Directions as an array of shape (n, 3).
pub fn array<'py>(py: Python<'py>, w: &[Vec3]) -> PyResult<Bound<'py, PyAny>> {
    let flat: Vec<f64> = w.iter().flat_map(|w| [w.x, w.y, w.z]).collect();
    shaped(flat.into_pyarray(py), &[w.len(), 3])
}

/// Values as an array of shape (n, 3).
pub fn rgb_array<'py>(py: Python<'py>, values: &[Rgb]) -> PyResult<Bound<'py, PyAny>> {
    shaped(values.as_flattened().to_vec().into_pyarray(py), &[values.len(), 3])
}

fn shaped<'py>(flat: Bound<'py, PyArray1<f64>>, shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    Ok(flat.reshape(shape)?.into_any())
}

/// The rows of an array of shape (n, 3). `what` is named in errors.
pub fn rows(array: &PyReadonlyArray2<'_, f64>, what: &str) -> Result<Vec<Rgb>, Fault> {
    let shape = array.shape();
    if !array.is_c_contiguous() || shape[1] != 3 {
        return Err(Fault::Input(format!(
            "{what}: an array of shape {shape:?} came; it must be C-contiguous and of shape (n, 3)"
        )));
    }
    let flat = array.as_slice().map_err(|e| Fault::Input(format!("{what}: {e}")))?;
    Ok(flat.as_chunks::<3>().0.to_vec())
}

/// The same as directions.
pub fn directions(array: &PyReadonlyArray2<'_, f64>, what: &str) -> Result<Vec<Vec3>, Fault> {
    Ok(rows(array, what)?.into_iter().map(|[x, y, z]| Vec3::new(x, y, z)).collect())
}
