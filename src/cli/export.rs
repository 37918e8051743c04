//! Materials of renderers in place of a fit: `vernis fit --export`.

use super::output::{self, Inputs, Replace};
use super::{user_error, workspace};
use crate::report::OutputFolder;
use anyhow::Result;
use std::path::Path;
use std::sync::Arc;
use vernis_metric::brdf::models::AnalyticBrdf;
use vernis_metric::fit::export::{Export, Renderer, Translation, translate};
use vernis_metric::io::{Interrupt, Observer, decimals};
use vernis_metric::metric::Metric;
use vernis_metric::metric::learned::FAMILY;

/// The metric whose distance makes the nearest material, where the loss of the fit is not learned itself.
const LOSS: &str = "vernis-loss";

/// The materials to write, in files beside that of the fit.
pub struct Exports {
    files: Vec<(Renderer, OutputFolder, String)>,
    loss: Arc<dyn Metric>,
    /// In these the cost of a translation is told: that of the fit, and the one that predicts what people would say.
    judges: Vec<Arc<dyn Metric>>,
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
        let mut files: Vec<(Renderer, OutputFolder, String)> = Vec::new();
        for &renderer in renderers {
            if files.iter().any(|(earlier, ..)| *earlier == renderer) {
                return Err(user_error(format!("--export {renderer} is given twice")));
            }
            let (folder, name) = output::file(&out.with_extension(renderer.extension()), inputs, replace)?;
            files.push((renderer, folder, name));
        }
        let learned = |name: &str| workspace::one_metric(name, &Default::default());
        let loss = if metric.properties().family == FAMILY { metric.clone() } else { learned(LOSS)? };
        let mut judges = vec![metric.clone()];
        if metric.name() != workspace::DEFAULT_METRIC {
            judges.push(learned(workspace::DEFAULT_METRIC)?);
        }
        Ok(Self { files, loss, judges })
    }

    /// The metrics that it needs beside that of the fit; none where nothing is exported.
    pub fn metrics(&self) -> Vec<Arc<dyn Metric>> {
        let all = self.judges.iter().chain([&self.loss]).cloned();
        if self.files.is_empty() { Vec::new() } else { all.collect() }
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
        for (renderer, folder, name) in &self.files {
            let mut found = translate(model, *renderer, &*self.loss, interrupt, observer).map_err(super::fit::named)?;
            for judge in &self.judges {
                found.judge(model, &**judge).map_err(super::fit::named)?;
            }
            let kind = kind(&found);
            let costs = found.costs_in_words();
            let notes = [fit.to_owned(), format!("{kind}; the translation costs: {costs}")];
            folder.write(name, found.text(&notes).as_bytes())?;
            let mut lines = format!("{renderer}: {kind}, {}\n", folder.path().join(name).display());
            for cost in &found.costs {
                lines += &format!("  {:12} {:10}", cost.metric.name, decimals(cost.distance, 4));
                lines += &cost.score.map_or("\n".to_owned(), |score| format!("  {score}\n"));
            }
            all.push((found.export(name), lines));
        }
        Ok(all)
    }
}

fn kind(translation: &Translation) -> String {
    let model = translation.model.model();
    if translation.exact { format!("the same formula, as {model}") } else { format!("the nearest {model}") }
}
