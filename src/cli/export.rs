//! Materials of renderers in place of a fit: `vernis fit --export`.

use super::output::{self, Inputs, Replace};
use super::user_error;
use crate::report::OutputFolder;
use anyhow::Result;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use vernis_metric::brdf::models::AnalyticBrdf;
use vernis_metric::fit::export::{Export, Renderer, translate, usual_metrics};
use vernis_metric::io::{Interrupt, Observer, decimals};
use vernis_metric::metric::Metric;
use vernis_metric::metric::registry::Registry;

/// The materials to write, in files beside that of the fit.
pub struct Exports {
    files: Vec<(Renderer, PathBuf, OutputFolder, String)>,
    /// In these the cost of a translation is told.
    metrics: Vec<Arc<dyn Metric>>,
}

impl Exports {
    /// Files called as that of the fit, each with the renderer's extension; found unwritable before the work.
    pub fn beside(
        out: &Path,
        renderers: &[Renderer],
        metric: &Arc<dyn Metric>,
        inputs: &Inputs,
        replace: Replace,
    ) -> Result<Self> {
        let mut files: Vec<(Renderer, PathBuf, OutputFolder, String)> = Vec::new();
        for &renderer in renderers {
            if files.iter().any(|(earlier, ..)| *earlier == renderer) {
                return Err(user_error(format!("--export {renderer} is given twice")));
            }
            let path = out.with_extension(renderer.extension());
            let (folder, name) = output::file(&path, inputs, replace)?;
            files.push((renderer, path, folder, name));
        }
        let metrics =
            if files.is_empty() { Vec::new() } else { usual_metrics(metric.clone(), &Registry::standard()?)? };
        Ok(Self { files, metrics })
    }

    /// The metrics that it needs; none where nothing is exported.
    pub fn metrics(&self) -> Vec<Arc<dyn Metric>> {
        self.metrics.clone()
    }

    /// Whether there is nothing to write.
    pub fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// Writes the material of every renderer, and says what each costs; `fit` says in a line what was fitted.
    pub fn write(
        &self,
        model: &dyn AnalyticBrdf,
        fit: &str,
        interrupt: &Interrupt,
        observer: Observer<'_>,
    ) -> Result<Vec<(Export, String)>> {
        let mut all = Vec::new();
        for (renderer, path, folder, name) in &self.files {
            let found = translate(model, *renderer, &self.metrics, interrupt, observer).map_err(super::fit::named)?;
            folder.write(name, found.text(fit).as_bytes())?;
            let mut lines = format!("{}: {} for {renderer}\n", path.display(), found.kind());
            for cost in &found.costs {
                lines += &format!("  {:12} {:10}", cost.metric.name, decimals(cost.distance, 4));
                lines += &cost.score.map_or("\n".to_owned(), |score| format!("  {score}\n"));
            }
            all.push((found.export(name), lines));
        }
        Ok(all)
    }
}
