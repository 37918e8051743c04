//! What goes wrong, as an exception of the package.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::io;
use std::path::Path;
use vernis::dataset::DatasetError;
use vernis::experiment::ExperimentError;
use vernis::report::ReportError;
use vernis_metric::brdf::models::ModelError;
use vernis_metric::brdf::{BrdfError, TableError};
use vernis_metric::fit::FitError;
use vernis_metric::metric::MetricError;
use vernis_metric::metric::learned::ExportedError;

/// One of the exceptions of `vernis._errors`, or one that Python raised.
#[derive(Debug)]
pub enum Fault {
    /// `InputError`, a ValueError: what was given cannot be.
    Input(String),
    /// `UnknownNameError`, a ValueError with the nearest names.
    Unknown { message: String, nearest: Vec<String> },
    /// `NotFoundError`, a FileNotFoundError.
    NotFound(String),
    /// `Error`: a fault of vernis or of the machine.
    Failed(String),
    /// Raised by a function of the caller's.
    Python(PyErr),
}

impl Fault {
    /// The same with what was going on before its message.
    pub fn beneath(self, context: &str) -> Self {
        match self {
            Self::Input(message) => Self::Input(format!("{context}: {message}")),
            Self::NotFound(message) => Self::NotFound(format!("{context}: {message}")),
            Self::Failed(message) => Self::Failed(format!("{context}: {message}")),
            Self::Unknown { message, nearest } => Self::Unknown { message: format!("{context}: {message}"), nearest },
            Self::Python(error) => Self::Python(error),
        }
    }

    fn raise(self, py: Python<'_>) -> PyResult<PyErr> {
        let errors = py.import("vernis._errors")?;
        let named = |class: &str, message: String| -> PyResult<PyErr> {
            Ok(PyErr::from_value(errors.getattr(class)?.call1((message,))?))
        };
        match self {
            Self::Input(message) => named("InputError", message),
            Self::NotFound(message) => named("NotFoundError", message),
            Self::Failed(message) => named("Error", message),
            Self::Unknown { message, nearest } => {
                Ok(PyErr::from_value(errors.getattr("UnknownNameError")?.call1((message, nearest))?))
            }
            Self::Python(error) => Ok(error),
        }
    }
}

impl From<Fault> for PyErr {
    fn from(fault: Fault) -> Self {
        Python::attach(|py| fault.raise(py)).unwrap_or_else(|e| PyRuntimeError::new_err(format!("vernis: {e}")))
    }
}

impl From<PyErr> for Fault {
    fn from(error: PyErr) -> Self {
        Self::Python(error)
    }
}

impl From<BrdfError> for Fault {
    fn from(error: BrdfError) -> Self {
        let message = error.to_string();
        match error {
            BrdfError::NotFound { .. } => Self::NotFound(message),
            BrdfError::Io { cause, .. } if cause.kind() == io::ErrorKind::NotFound => Self::NotFound(message),
            BrdfError::Io { .. } => Self::Failed(message),
            BrdfError::UnknownMaterial { nearest, .. }
            | BrdfError::UnknownField { nearest, .. }
            | BrdfError::UnknownModel { nearest, .. } => Self::Unknown { message, nearest },
            _ => Self::Input(message),
        }
    }
}

impl From<MetricError> for Fault {
    fn from(error: MetricError) -> Self {
        let message = error.to_string();
        match error {
            MetricError::Unknown { nearest, .. } => Self::Unknown { message, nearest },
            MetricError::Shipped { .. } => Self::Failed(message),
            _ => Self::Input(message),
        }
    }
}

impl From<FitError> for Fault {
    fn from(error: FitError) -> Self {
        let message = error.to_string();
        match error {
            FitError::UnknownModel { nearest, .. } | FitError::UnknownRenderer { nearest, .. } => {
                Self::Unknown { message, nearest }
            }
            FitError::Metric(error) => error.into(),
            _ => Self::Input(message),
        }
    }
}

impl From<ExportedError> for Fault {
    fn from(error: ExportedError) -> Self {
        let message = error.to_string();
        match error {
            ExportedError::Read { file, .. } if !Path::new(&file).exists() => Self::NotFound(message),
            _ => Self::Input(message),
        }
    }
}

impl From<ModelError> for Fault {
    fn from(error: ModelError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<TableError> for Fault {
    fn from(error: TableError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<DatasetError> for Fault {
    fn from(error: DatasetError) -> Self {
        let message = error.to_string();
        match error {
            DatasetError::NoDataFolder { .. } | DatasetError::MissingFile { .. } => Self::NotFound(message),
            DatasetError::Unreadable { path, .. } if !path.exists() => Self::NotFound(message),
            DatasetError::UnknownStudy { nearest, .. } => Self::Unknown { message, nearest },
            _ => Self::Input(message),
        }
    }
}

impl From<ExperimentError> for Fault {
    fn from(error: ExperimentError) -> Self {
        let message = error.to_string();
        match error {
            ExperimentError::Study(cause) => (*cause).into(),
            ExperimentError::Open(cause) => (*cause).into(),
            ExperimentError::Unsupported { .. } | ExperimentError::Setting { .. } | ExperimentError::Metric { .. } => {
                Self::Input(message)
            }
            _ => Self::Failed(message),
        }
    }
}

impl From<ReportError> for Fault {
    fn from(error: ReportError) -> Self {
        let message = error.to_string();
        match error {
            ReportError::Unwritable { .. } | ReportError::Lock(_) => Self::Input(message),
            _ => Self::Failed(message),
        }
    }
}
