//! Materials of renderers in place of a model.

use crate::brdf::Brdf;
use crate::compute::long;
use crate::fault::Fault;
use crate::metric::Metric;
use pyo3::prelude::*;
use std::sync::Arc;
use vernis_metric::fit::FitError;
use vernis_metric::fit::export::{self, Renderer};
use vernis_metric::metric::registry::Registry;

/// Name and version of a metric, the distance, and the predicted score with its interval.
type CostParts = (String, String, f64, Option<(f64, f64, f64)>);

/// A handle to a material.
#[pyclass(frozen, module = "vernis._vernis")]
pub struct Translation {
    translation: export::Translation,
}

#[pymethods]
impl Translation {
    /// The material as the renderer evaluates it.
    #[getter]
    fn brdf(&self) -> Brdf {
        let brdf: Arc<dyn vernis_metric::brdf::Brdf> = self.translation.model.clone();
        Brdf { brdf, function: None, content: None }
    }

    #[getter]
    fn exact(&self) -> bool {
        self.translation.exact
    }

    #[getter]
    fn costs(&self) -> Vec<CostParts> {
        let of = |cost: &export::Cost| {
            let score = cost.score.map(|s| (s.mos, s.low, s.high));
            (cost.metric.name.clone(), cost.metric.version.clone(), cost.distance, score)
        };
        self.translation.costs.iter().map(of).collect()
    }

    #[getter]
    fn costs_in_words(&self) -> String {
        self.translation.costs_in_words()
    }

    /// The file of the renderer; `what` is a comment.
    fn text(&self, what: &str) -> String {
        self.translation.text(what)
    }

    /// What the name of such a file ends in, with the dot.
    #[getter]
    fn extension(&self) -> String {
        format!(".{}", self.translation.renderer.extension())
    }

    /// The dictionary for `mitsuba.load_dict` as JSON.
    fn dictionary(&self) -> Option<String> {
        self.translation.mitsuba_dictionary().map(|dictionary| dictionary.to_string())
    }
}

/// The material of `renderer` for a model: the exact counterpart, or the nearest; its cost in `metric` and in the usual ones.
#[pyfunction]
pub fn translate(
    py: Python<'_>,
    brdf: &Brdf,
    renderer: &str,
    metric: &Metric,
    progress: Option<Py<PyAny>>,
) -> Result<Translation, Fault> {
    let renderer: Renderer = renderer.parse().map_err(|e: FitError| Fault::from(e))?;
    let metrics = export::usual_metrics(metric.metric.clone(), &Registry::standard()?)?;
    let Some(model) = brdf.brdf.as_model() else {
        return Err(Fault::Input("only models can be translated to a renderer; fit one first".to_owned()));
    };
    long(py, progress.as_ref(), |observer, interrupt| {
        Ok(Translation { translation: export::translate(model, renderer, &metrics, interrupt, observer)? })
    })
}
