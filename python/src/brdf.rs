//! BRDFs: opened, built, tabulated, or functions.

use crate::compute::short;
use crate::fault::Fault;
use crate::function::{FunctionBrdf, array, directions as vectors, rgb_array};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use vernis_metric::brdf::models::{Field, NamedParameters, names, schema};
use vernis_metric::brdf::{Anchor, BrdfSource, Grid, TabulatedBrdf};
use vernis_metric::io::{did_you_mean, nearest};
use vernis_metric::light::Light;
use vernis_metric::light::sphere::Sphere;

/// Directions that a thread handles at a time.
const CHUNK: usize = 4096;

/// The layout of the lamps of pictures.
const LAMPS: usize = 1;

/// Pixels a side of the largest sphere that is kept: it takes about 70 MB.
const LARGEST_KEPT: usize = 96;

/// A grid as Python has it: kind, cells along each axis, anchor.
type GridParts = (String, [usize; 3], Option<String>);

/// A handle to a BRDF.
#[pyclass(frozen, module = "vernis._vernis")]
pub struct Brdf {
    pub brdf: Arc<dyn vernis_metric::brdf::Brdf>,
    /// What its function raised is asked for after every use.
    pub function: Option<Arc<FunctionBrdf>>,
    /// SHA-256 of what defines it, where that is known.
    pub content: Option<String>,
}

impl Brdf {
    fn of(brdf: Arc<dyn vernis_metric::brdf::Brdf>) -> Self {
        Self { brdf, function: None, content: None }
    }

    /// The result of work with this BRDF, unless its function raised meanwhile.
    pub fn heard<T>(&self, result: Result<T, Fault>) -> Result<T, Fault> {
        match self.function.as_ref().and_then(|f| f.raised()) {
            Some(fault) => Err(fault),
            None => result,
        }
    }
}

#[pymethods]
impl Brdf {
    /// From the source notation.
    #[staticmethod]
    fn open(py: Python<'_>, notation: &str, data: Option<PathBuf>) -> Result<Self, Fault> {
        let open = short(py, || Ok(BrdfSource::parse(notation)?.open(data.as_deref())?))?;
        Ok(Self { brdf: open.brdf, function: None, content: Some(open.content.to_string()) })
    }

    /// A model with its parameters by field.
    #[staticmethod]
    fn model(name: &str, parameters: Vec<(String, Vec<f64>)>) -> Result<Self, Fault> {
        let mut named = NamedParameters::new(name).map_err(|_| unknown_model(name))?;
        for (field, entries) in &parameters {
            let fields: Vec<String> = named.fields().iter().map(|(name, _)| (*name).to_owned()).collect();
            let count = named.fields().iter().find(|(name, _)| name == field).map(|(_, count)| *count);
            named.set(field, entries).map_err(|_| match count {
                Some(allowed) => Fault::Input(format!(
                    "{name}: {field} has {} {}; it must have {allowed}",
                    entries.len(),
                    if entries.len() == 1 { "number" } else { "numbers" }
                )),
                None => {
                    let near = nearest(field, fields.iter().map(String::as_str));
                    let message = format!(
                        "{name} has no parameter `{field}`; {}; its parameters are {}",
                        did_you_mean(&near),
                        fields.join(", ")
                    );
                    Fault::Unknown { message, nearest: near }
                }
            })?;
        }
        if let Some(missing) = named.missing() {
            let all: Vec<&str> = named.fields().into_iter().map(|(field, _)| field).collect();
            return Err(Fault::Input(format!(
                "{name}: the parameter {missing} is missing; its parameters are {}",
                all.join(", ")
            )));
        }
        Ok(Self::of(named.build()?))
    }

    /// A table: one value a cell in the order of the grid, and which cells were measured.
    #[staticmethod]
    fn table(
        py: Python<'_>,
        values: PyReadonlyArray1<'_, f32>,
        valid: PyReadonlyArray1<'_, bool>,
        grid: GridParts,
    ) -> Result<Self, Fault> {
        let grid = parsed(&grid)?;
        let flat = values.as_slice().map_err(|e| Fault::Input(e.to_string()))?;
        let (values, valid) =
            (flat.as_chunks::<3>().0.to_vec(), valid.as_slice().map_err(|e| Fault::Input(e.to_string()))?.to_vec());
        let table = short(py, || Ok(TabulatedBrdf::new(grid, values, valid)?))?;
        Ok(Self::of(Arc::new(table)))
    }

    /// A function of two arrays of directions.
    #[staticmethod]
    fn function(function: Py<PyAny>, signed: bool) -> Self {
        let function = Arc::new(FunctionBrdf::new(function, signed));
        Self { brdf: function.clone(), function: Some(function), content: None }
    }

    /// Values at pairs of directions, NaN where a measurement is missing.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        wi: PyReadonlyArray2<'_, f64>,
        wo: PyReadonlyArray2<'_, f64>,
    ) -> Result<Bound<'py, PyAny>, Fault> {
        let (wi, wo) = (vectors(&wi, "wi")?, vectors(&wo, "wo")?);
        if wi.len() != wo.len() {
            return Err(Fault::Input(format!(
                "wi has {} directions and wo has {}; they must have as many",
                wi.len(),
                wo.len()
            )));
        }
        let values = short(py, || {
            let mut values = vec![[f64::NAN; 3]; wi.len()];
            values.par_chunks_mut(CHUNK).zip(wi.par_chunks(CHUNK).zip(wo.par_chunks(CHUNK))).for_each(
                |(values, (wi, wo))| {
                    let mut found = vec![None; values.len()];
                    self.brdf.eval_batch(wi, wo, &mut found);
                    values.iter_mut().zip(found).for_each(|(value, found)| *value = found.unwrap_or([f64::NAN; 3]));
                },
            );
            Ok(values)
        });
        Ok(rgb_array(py, &self.heard(values)?)?)
    }

    /// The name of the model, if it is one.
    #[getter]
    fn model_name(&self) -> Option<String> {
        self.brdf.as_model().map(|model| model.model().to_owned())
    }

    /// The parameters of the model by field, if it is one.
    #[getter]
    fn parameters(&self) -> Option<Vec<(String, Vec<f64>)>> {
        let fields = Field::all(self.brdf.as_model()?);
        Some(fields.into_iter().map(|field| (field.name, field.values)).collect())
    }

    /// The grid of the table, if it is one.
    #[getter]
    fn grid(&self) -> Option<GridParts> {
        self.brdf.as_table().map(|table| parts(table.grid()))
    }

    /// A sphere under lamps as a PNG file, transparent beside the sphere.
    fn png<'py>(&self, py: Python<'py>, side: usize) -> Result<Bound<'py, PyBytes>, Fault> {
        let picture = short(py, || sphere(side).png(&*self.brdf).map_err(|e| Fault::Input(e.to_string())));
        Ok(PyBytes::new(py, &self.heard(picture)?))
    }

    #[getter]
    fn description(&self) -> Option<String> {
        self.brdf.description()
    }

    #[getter]
    fn content(&self) -> Option<String> {
        self.content.clone()
    }
}

/// The sphere of pictures. It takes seconds to make and then shows any BRDF in milliseconds: the last one stays, unless it is large.
fn sphere(side: usize) -> Arc<Sphere> {
    static LAST: Mutex<Option<(usize, Arc<Sphere>)>> = Mutex::new(None);
    let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
    match &*last {
        Some((kept, sphere)) if *kept == side => sphere.clone(),
        _ => {
            let made = Arc::new(Sphere::new(side, &Light::lamps(LAMPS)));
            if side <= LARGEST_KEPT {
                *last = Some((side, made.clone()));
            }
            made
        }
    }
}

/// That a notation is one and its file is there; nothing is read.
#[pyfunction]
pub fn locate(notation: &str, data: Option<PathBuf>) -> Result<(), Fault> {
    Ok(BrdfSource::parse(notation)?.locate(data.as_deref()).map(drop)?)
}

fn unknown_model(name: &str) -> Fault {
    let near = nearest(name, names());
    let message = format!(
        "unknown model `{name}`; {}; the models are {}, and sums such as ggx+ward",
        did_you_mean(&near),
        names().join(", ")
    );
    Fault::Unknown { message, nearest: near }
}

/// The name of a model, and its parameters: name, unit, bounds, start.
type ModelParts<'py> = (String, Vec<Bound<'py, PyDict>>);

/// Every model.
#[pyfunction]
pub fn models(py: Python<'_>) -> Result<Vec<ModelParts<'_>>, Fault> {
    let mut all = Vec::new();
    for name in names() {
        let mut parameters = Vec::new();
        for p in schema(name)? {
            let entry = PyDict::new(py);
            entry.set_item("name", p.name.as_ref())?;
            entry.set_item("unit", p.unit)?;
            entry.set_item("lower", p.bounds.0)?;
            entry.set_item("upper", p.bounds.1)?;
            entry.set_item("start", p.start)?;
            parameters.push(entry);
        }
        all.push((name.to_owned(), parameters));
    }
    Ok(all)
}

/// The fields of a model, each with how many numbers it has.
#[pyfunction]
pub fn fields(model: &str) -> Result<Vec<(String, usize)>, Fault> {
    let named = NamedParameters::new(model).map_err(|_| unknown_model(model))?;
    Ok(named.fields().into_iter().map(|(name, count)| (name.to_owned(), count)).collect())
}

/// The directions of the cells of a grid.
#[pyfunction]
pub fn directions<'py>(py: Python<'py>, grid: GridParts) -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>), Fault> {
    let grid = parsed(&grid)?;
    let (wi, wo) = short(py, || {
        let all = grid.all_directions();
        Ok((0..grid.len()).map(|cell| all.get(cell)).unzip::<_, _, Vec<_>, Vec<_>>())
    })?;
    Ok((array(py, &wi)?, array(py, &wo)?))
}

fn parsed((kind, shape, anchor): &GridParts) -> Result<Grid, Fault> {
    let [a, b, c] = *shape;
    match (kind.as_str(), anchor.as_deref()) {
        ("half-difference", None) => Ok(Grid::HalfDifference { theta_h: a, theta_d: b, phi_d: c }),
        ("standard", Some("edge")) => Ok(Grid::Standard { theta_i: a, theta_o: b, phi_d: c, anchor: Anchor::Edge }),
        ("standard", Some("centre")) => Ok(Grid::Standard { theta_i: a, theta_o: b, phi_d: c, anchor: Anchor::Centre }),
        (kind, anchor) => Err(Fault::Input(format!("there is no grid {kind} with values at {anchor:?}"))),
    }
}

fn parts(grid: Grid) -> GridParts {
    let (kind, anchor) = match grid {
        Grid::HalfDifference { .. } => ("half-difference", None),
        Grid::Standard { anchor: Anchor::Edge, .. } => ("standard", Some("edge".to_owned())),
        Grid::Standard { anchor: Anchor::Centre, .. } => ("standard", Some("centre".to_owned())),
    };
    (kind.to_owned(), grid.shape(), anchor)
}
