//! Metrics, metrics with a reference, and many metrics on one pair.

use crate::brdf::Brdf;
use crate::compute::{long, short};
use crate::fault::Fault;
use crate::function::{array, rgb_array, rows};
use numpy::{PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use vernis::image::metric::Conditions;
use vernis::image::stimulus;
use vernis_metric::descriptor::Cache;
use vernis_metric::io::Count;
use vernis_metric::metric::learned::{FAMILY, LearnedMetric};
use vernis_metric::metric::registry::Registry;
use vernis_metric::metric::{self, Gradient, Measured, MetricError, Nodes, PreparedMetric, PreparedMetrics};

/// Distance; MOS, low and high end of its interval, and worst and best of the scale, where there are any; distances of the channels.
type MeasuredParts = (f64, Option<(f64, f64, f64, f64, f64)>, Option<[f64; 3]>);

/// What every metric says of a pair, or why none does.
type PairParts = (Vec<MeasuredParts>, Option<String>);

/// A handle to a metric.
#[pyclass(frozen, module = "vernis._vernis")]
pub struct Metric {
    pub metric: Arc<dyn metric::Metric>,
}

/// Every metric, those on stimuli among them, which look for mesh and probes in the folder of the variable VERNIS_DATA, and
/// for tables and weights in that of VERNIS_WEIGHTS.
pub fn registry() -> Result<Registry, Fault> {
    let folder = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let conditions = match folder("VERNIS_WEIGHTS") {
        Some(folder) => Conditions::of_folder(&folder).map_err(|e| Fault::Input(e.to_string()))?,
        None => Conditions::default(),
    };
    Ok(stimulus::registry(folder("VERNIS_DATA").as_deref(), conditions)?)
}

#[pymethods]
impl Metric {
    /// By name, or from the file of an exported metric. What learned metrics need is taken from `cache`, or made and kept there; what
    /// could not be kept comes back as warnings.
    #[staticmethod]
    fn named(py: Python<'_>, name: &str, cache: Option<PathBuf>) -> Result<(Self, Vec<String>), Fault> {
        short(py, || {
            let registry = registry()?;
            let metric: Arc<dyn metric::Metric> = if name.ends_with(".json") {
                Arc::new(registry.beside(LearnedMetric::load(Path::new(name))?, Path::new(name)))
            } else {
                registry.get(name)?
            };
            let mut warnings = Vec::new();
            if let Some(folder) = cache.filter(|_| [FAMILY, stimulus::FAMILY].contains(&metric.properties().family)) {
                match Cache::open(&folder) {
                    Ok(cache) => warnings.extend(metric.warm_up(&cache).map(|warning| warning.to_string())),
                    Err(error) => warnings.push(format!("{error}; going on without a cache")),
                }
            }
            Ok((Self { metric }, warnings))
        })
    }

    #[getter]
    fn name(&self) -> &str {
        self.metric.name()
    }

    #[getter]
    fn version(&self) -> &str {
        self.metric.version()
    }

    /// What a user must know of it.
    #[getter]
    fn properties<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        properties(py, &*self.metric)
    }

    fn measure(&self, py: Python<'_>, reference: &Brdf, candidate: &Brdf) -> Result<MeasuredParts, Fault> {
        let found = short(py, || Ok(self.metric.prepare(&*reference.brdf)?.measure(&*candidate.brdf)?));
        Ok(parts(reference.heard(candidate.heard(found))?))
    }

    fn distance(&self, py: Python<'_>, reference: &Brdf, candidate: &Brdf) -> Result<f64, Fault> {
        let found = short(py, || Ok(self.metric.distance(&*reference.brdf, &*candidate.brdf)?));
        reference.heard(candidate.heard(found))
    }

    fn prepare(&self, py: Python<'_>, reference: &Brdf) -> Result<Prepared, Fault> {
        let prepared = short(py, || Ok(self.metric.prepare(&*reference.brdf)?));
        let prepared = reference.heard(prepared)?;
        let nodes = prepared.nodes();
        Ok(Prepared { prepared, nodes })
    }
}

fn properties<'py>(py: Python<'py>, metric: &dyn metric::Metric) -> PyResult<Bound<'py, PyDict>> {
    let (all, properties) = (PyDict::new(py), metric.properties());
    all.set_item("name", metric.name())?;
    all.set_item("version", metric.version())?;
    all.set_item("family", properties.family)?;
    all.set_item("unit", properties.unit)?;
    all.set_item("symmetric", properties.symmetric)?;
    all.set_item("differentiable", properties.differentiable)?;
    all.set_item("usable_as_loss", properties.usable_as_loss)?;
    all.set_item("synthetic", properties.synthetic)?;
    all.set_item("summary", properties.summary)?;
    all.set_item("source", properties.source)?;
    Ok(all)
}

fn parts(found: Measured) -> MeasuredParts {
    let score = found.score.map(|s| (s.mos, s.low, s.high, s.scale.worst(), s.scale.best()));
    (found.value, score, found.channels)
}

/// A metric with its reference.
#[pyclass(frozen, module = "vernis._vernis")]
pub struct Prepared {
    prepared: Box<dyn PreparedMetric>,
    nodes: Option<Arc<Nodes>>,
}

impl Prepared {
    fn nodes(&self) -> Result<&Nodes, Fault> {
        self.nodes.as_deref().ok_or_else(|| MetricError::NoNodes.into())
    }

    fn gradient(&self, values: &[[f64; 3]], as_loss: bool) -> Result<Gradient, Fault> {
        self.nodes()?;
        Ok(if as_loss { self.prepared.loss_gradient_at(values) } else { self.prepared.gradient_at(values) }?)
    }
}

#[pymethods]
impl Prepared {
    /// Name of the layout, and the directions towards light and viewer.
    fn node_directions<'py>(&self, py: Python<'py>) -> Result<(String, Bound<'py, PyAny>, Bound<'py, PyAny>), Fault> {
        let nodes = self.nodes()?;
        py.detach(|| nodes.wi().len());
        Ok((nodes.id().to_owned(), array(py, nodes.wi())?, array(py, nodes.wo())?))
    }

    /// Name of the layout and number of nodes.
    fn node_count(&self) -> Result<(String, usize), Fault> {
        let nodes = self.nodes()?;
        Ok((nodes.id().to_owned(), nodes.len()))
    }

    /// The values of a BRDF on the nodes, as the metric reads it.
    fn evaluate<'py>(&self, py: Python<'py>, brdf: &Brdf) -> Result<Bound<'py, PyAny>, Fault> {
        let nodes = self.nodes()?;
        let values = short(py, || Ok(nodes.evaluate(&*brdf.brdf)));
        Ok(rgb_array(py, &brdf.heard(values)?)?)
    }

    fn measure(&self, py: Python<'_>, candidate: &Brdf) -> Result<MeasuredParts, Fault> {
        let found = short(py, || Ok(self.prepared.measure(&*candidate.brdf)?));
        Ok(parts(candidate.heard(found)?))
    }

    fn distance_at(&self, py: Python<'_>, values: PyReadonlyArray2<'_, f64>) -> Result<f64, Fault> {
        let values = rows(&values, "values")?;
        short(py, || Ok(self.prepared.distance_at(&values)?))
    }

    /// Distances of a batch, on all cores; errors name the member.
    fn distances_at(
        &self,
        py: Python<'_>,
        values: PyReadonlyArray3<'_, f64>,
        progress: Option<Py<PyAny>>,
    ) -> Result<Vec<f64>, Fault> {
        let &[_, nodes, channels] = values.shape() else {
            return Err(Fault::Input("the values of a batch have three axes".to_owned()));
        };
        if channels != 3 || !values.is_c_contiguous() {
            return Err(Fault::Input("values: a C-contiguous array of shape (batch, n, 3) is needed".to_owned()));
        }
        self.prepared.nodes().ok_or(MetricError::NoNodes)?;
        let flat = values.as_slice().map_err(|e| Fault::Input(e.to_string()))?;
        let members: Vec<&[[f64; 3]]> = flat.as_chunks::<3>().0.chunks(nodes.max(1)).collect();
        let done = Count::of(members.len());
        long(py, progress.as_ref(), |observer, _| {
            let distance = |(member, values): (usize, &&[[f64; 3]])| {
                let found = self.prepared.distance_at(values);
                done.one(|progress| observer("distances", progress));
                found.map_err(|e| (member, e))
            };
            let found: Vec<_> = members.par_iter().enumerate().map(distance).collect();
            let found: Result<Vec<f64>, _> = found.into_iter().collect();
            found.map_err(|(member, e)| match Fault::from(e) {
                Fault::Input(message) => Fault::Input(format!("member {member} of the batch: {message}")),
                other => other,
            })
        })
    }

    /// The distance, or, if `as_loss`, what a fit minimises; and its derivatives by the values.
    fn value_and_grad<'py>(
        &self,
        py: Python<'py>,
        values: PyReadonlyArray2<'_, f64>,
        as_loss: bool,
    ) -> Result<(f64, Bound<'py, PyAny>), Fault> {
        let values = rows(&values, "values")?;
        let found = short(py, || self.gradient(&values, as_loss))?;
        Ok((found.value, rgb_array(py, &found.derivatives)?))
    }

    /// The power of the distance that is smooth where both sides agree.
    #[getter]
    fn smooth_power(&self) -> f64 {
        self.prepared.smooth_power()
    }
}

/// What is to be known of every metric that has a name.
#[pyfunction]
pub fn metrics(py: Python<'_>) -> Result<Vec<Bound<'_, PyDict>>, Fault> {
    let registry = registry()?;
    Ok(registry.iter().map(|metric| properties(py, &**metric)).collect::<PyResult<_>>()?)
}

/// Where what was computed before is kept: the folder of the variable VERNIS_CACHE, else that of the user.
#[pyfunction]
pub fn cache_folder() -> PathBuf {
    let named = std::env::var_os("VERNIS_CACHE").filter(|folder| !folder.is_empty());
    named.map_or_else(Cache::user_folder, PathBuf::from)
}

/// The names behind `name`: itself, or the members of a group such as `all-lp`.
#[pyfunction]
pub fn resolve(name: &str) -> Result<Vec<String>, Fault> {
    Ok(registry()?.resolve(name)?.iter().map(|metric| metric.name().to_owned()).collect())
}

/// Candidates of one reference, with their places among the pairs.
struct Job<'a> {
    reference: &'a Brdf,
    candidates: Vec<(usize, &'a Brdf)>,
}

/// What every metric says of the pair at a place, or why none does.
type Scored = (usize, Result<Vec<Measured>, String>);

/// Every metric on every pair; a pair that cannot be compared has a reason instead. Pairs of one reference, which must be the same
/// object, share the work for it.
#[pyfunction]
pub fn distances(
    py: Python<'_>,
    metrics: Vec<Py<Metric>>,
    pairs: Vec<(Py<Brdf>, Py<Brdf>)>,
    progress: Option<Py<PyAny>>,
) -> Result<Vec<PairParts>, Fault> {
    let metrics: Vec<Arc<dyn metric::Metric>> = metrics.iter().map(|metric| metric.get().metric.clone()).collect();
    let mut jobs: Vec<Job<'_>> = Vec::new();
    for (place, (reference, candidate)) in pairs.iter().enumerate() {
        let (reference, candidate) = (reference.get(), (place, candidate.get()));
        match jobs.iter_mut().rev().find(|job| std::ptr::eq(job.reference, reference)) {
            Some(job) => job.candidates.push(candidate),
            None => jobs.push(Job { reference, candidates: vec![candidate] }),
        }
    }
    let done = Count::of(pairs.len());
    long(py, progress.as_ref(), |observer, _| {
        let scored = |job: &Job<'_>| -> Result<Vec<Scored>, Fault> {
            let prepared = PreparedMetrics::new(&metrics, &*job.reference.brdf);
            let prepared = job.reference.heard(Ok(prepared))?;
            let scored = |&(place, candidate): &(usize, &Brdf)| {
                let found = match &prepared {
                    Ok(prepared) => prepared.measure(&*candidate.brdf).map_err(|e| e.to_string()),
                    Err(e) => Err(e.to_string()),
                };
                done.one(|progress| observer("pairs", progress));
                Ok((place, candidate.heard(Ok(found))?))
            };
            job.candidates.par_iter().map(scored).collect()
        };
        let scored: Vec<Vec<_>> = jobs.par_iter().map(scored).collect::<Result<_, Fault>>()?;
        let mut all: Vec<Scored> = scored.into_iter().flatten().collect();
        all.sort_by_key(|(place, _)| *place);
        let told = |found: Result<Vec<Measured>, String>| match found {
            Ok(found) => (found.into_iter().map(parts).collect(), None),
            Err(reason) => (Vec::new(), Some(reason)),
        };
        Ok(all.into_iter().map(|(_, found)| told(found)).collect())
    })
}
