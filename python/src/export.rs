//! Materials of renderers in place of a model.

use crate::brdf::Brdf;
use crate::compute::long;
use crate::fault::Fault;
use crate::metric::Metric;
use pyo3::prelude::*;
use std::sync::Arc;
use vernis_metric::fit::FitError;
use vernis_metric::fit::export::{self, Renderer};

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

    /// The file of the renderer, with comments.
    fn text(&self, notes: Vec<String>) -> String {
        self.translation.text(&notes)
    }

    /// The dictionary for `mitsuba.load_dict` as JSON.
    fn dictionary(&self) -> Option<String> {
        self.translation.mitsuba_dictionary().map(|dictionary| dictionary.to_string())
    }
}

/// The material of `renderer` for a model: the exact counterpart, or the nearest under `loss`; its cost in each of `judges`.
#[pyfunction]
pub fn translate(
    py: Python<'_>,
    brdf: &Brdf,
    renderer: &str,
    loss: &Metric,
    judges: Vec<PyRef<'_, Metric>>,
    progress: Option<Py<PyAny>>,
) -> Result<Translation, Fault> {
    let renderer: Renderer = renderer.parse().map_err(|e: FitError| Fault::from(e))?;
    let loss = loss.metric.clone();
    let judges: Vec<_> = judges.iter().map(|judge| judge.metric.clone()).collect();
    let Some(model) = brdf.brdf.as_model() else {
        return Err(Fault::Input("only models can be translated to a renderer; fit one first".to_owned()));
    };
    long(py, progress.as_ref(), |observer, interrupt| {
        let mut translation = export::translate(model, renderer, &*loss, interrupt, observer)?;
        for judge in &judges {
            translation.judge(model, &**judge)?;
        }
        Ok(Translation { translation })
    })
}
