//! The extension module behind the Python package `vernis`.
//!
//! It holds handles and moves numbers; names, checks of arguments, documentation and everything that a reader of Python looks for is in
//! `python/vernis`. Arrays come here as C-contiguous `float64` or `float32`, which the Python side sees to and this side checks again.

mod brdf;
mod compute;
mod export;
mod fault;
mod fit;
mod function;
mod metric;
mod study;

use pyo3::prelude::*;

#[pymodule]
fn _vernis(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add_class::<brdf::Brdf>()?;
    m.add_class::<metric::Metric>()?;
    m.add_class::<metric::Prepared>()?;
    m.add_class::<export::Translation>()?;
    m.add_class::<study::Trained>()?;
    m.add_function(wrap_pyfunction!(brdf::models, m)?)?;
    m.add_function(wrap_pyfunction!(brdf::fields, m)?)?;
    m.add_function(wrap_pyfunction!(brdf::directions, m)?)?;
    m.add_function(wrap_pyfunction!(brdf::locate, m)?)?;
    m.add_function(wrap_pyfunction!(metric::metrics, m)?)?;
    m.add_function(wrap_pyfunction!(metric::distances, m)?)?;
    m.add_function(wrap_pyfunction!(metric::resolve, m)?)?;
    m.add_function(wrap_pyfunction!(metric::cache_folder, m)?)?;
    m.add_function(wrap_pyfunction!(fit::fit, m)?)?;
    m.add_function(wrap_pyfunction!(export::translate, m)?)?;
    m.add_function(wrap_pyfunction!(study::default_study, m)?)?;
    m.add_function(wrap_pyfunction!(study::train, m)?)?;
    m.add_function(wrap_pyfunction!(study::benchmark, m)?)?;
    m.add_function(wrap_pyfunction!(study::main, m)?)
}
