//! The report of what a gradient spares in a fit, in Markdown.

use super::markdown;
use super::tables::Table;
use crate::experiment::optimizers::{Comparison, OptimizerRecord, SAME};
use std::collections::BTreeSet;
use vernis_metric::io::counted;

/// The whole report; `command` makes it again.
pub fn markdown(record: &OptimizerRecord, command: &str) -> String {
    let materials: BTreeSet<&str> = record.fits.iter().map(|fit| fit.material.as_str()).collect();
    let metrics: Vec<String> = record.metrics.iter().map(|[name, version]| format!("`{name}` {version}")).collect();
    let mut text = format!(
        "# What does a gradient spare in a fit?\n\n{}\n\n{} of {} were fitted under {}, each by Hooke-Jeeves, the method of the \
         study, and by L-BFGS with the exact gradient, from the same start, with at most {} evaluations each. An evaluation of L-BFGS is a \
         value with its gradient, which costs two to three values. *lower or the same*: fits whose loss by L-BFGS is at most {SAME} above \
         that by Hooke-Jeeves. *after*: evaluations after which L-BFGS was as low as Hooke-Jeeves at its end, as a share of those of \
         Hooke-Jeeves. Under a learned metric L-BFGS begins again from up to two other shapes of the lobe, until a third of the evaluations \
         is spent, and with ten parameters or more from a fit under D9.Cl before; these count. When a search ends, and how many there are, was chosen while looking at this table for 15 references \
         of the open study: what fits of other materials gain may be less.\n\n",
        markdown::code(command),
        counted(materials.len(), "reference"),
        markdown::text(&record.study),
        metrics.join(" and "),
        record.max_evaluations
    );
    text += &summary(record).to_markdown();
    text += "\n## Every fit\n\n";
    let mut table = Table::new(
        "Loss at the end, and evaluations",
        &["metric", "material", "model", "Hooke-Jeeves", "evaluations", "L-BFGS", "evaluations", "as low after"],
    );
    table.rows = record.fits.iter().map(row).collect();
    text + &table.to_markdown()
}

/// One row a metric and model, and one a metric.
pub fn summary(record: &OptimizerRecord) -> Table {
    let mut table = Table::new(
        "Hooke-Jeeves and L-BFGS",
        &[
            "metric",
            "model",
            "fits",
            "mean loss: Hooke-Jeeves",
            "mean loss: L-BFGS",
            "lower or the same",
            "evaluations: Hooke-Jeeves",
            "evaluations: L-BFGS",
            "ratio",
            "after: median",
            "after: at most a third",
        ],
    );
    for [metric, _] in &record.metrics {
        let of_metric: Vec<&Comparison> = record.fits.iter().filter(|fit| fit.metric == *metric).collect();
        let models: BTreeSet<&str> = of_metric.iter().map(|fit| fit.model.as_str()).collect();
        for model in models {
            let fits: Vec<&Comparison> = of_metric.iter().copied().filter(|fit| fit.model == model).collect();
            table.rows.push(summary_row(metric, model, &fits));
        }
        table.rows.push(summary_row(metric, "all", &of_metric));
    }
    table
}

fn summary_row(metric: &str, model: &str, fits: &[&Comparison]) -> Vec<String> {
    let n = fits.len().max(1) as f64;
    let mean = |of: fn(&Comparison) -> f64| fits.iter().map(|fit| of(fit)).sum::<f64>() / n;
    let (direct, gradient) =
        (mean(|fit| fit.hooke_jeeves.evaluations as f64), mean(|fit| fit.lbfgs.evaluations as f64));
    let same = fits.iter().filter(|fit| fit.lbfgs.value <= fit.hooke_jeeves.value + SAME).count();
    let mut shares: Vec<f64> = fits.iter().map(|fit| share(fit).unwrap_or(f64::INFINITY)).collect();
    shares.sort_by(f64::total_cmp);
    let median = shares.get(shares.len() / 2).copied().filter(|share| share.is_finite());
    let third = shares.iter().filter(|share| **share <= 1.0 / 3.0).count();
    vec![
        metric.to_owned(),
        model.to_owned(),
        fits.len().to_string(),
        format!("{:.4}", mean(|fit| fit.hooke_jeeves.value)),
        format!("{:.4}", mean(|fit| fit.lbfgs.value)),
        same.to_string(),
        format!("{direct:.0}"),
        format!("{gradient:.0}"),
        format!("{:.2}", gradient / direct.max(1.0)),
        median.map_or("never".to_owned(), |share| format!("{share:.2}")),
        third.to_string(),
    ]
}

/// Evaluations after which L-BFGS was as low as Hooke-Jeeves, as a share of those of Hooke-Jeeves.
fn share(fit: &Comparison) -> Option<f64> {
    Some(fit.reached_after? as f64 / fit.hooke_jeeves.evaluations.max(1) as f64)
}

fn row(fit: &Comparison) -> Vec<String> {
    vec![
        fit.metric.clone(),
        fit.material.clone(),
        fit.model.clone(),
        format!("{:.4}", fit.hooke_jeeves.value),
        fit.hooke_jeeves.evaluations.to_string(),
        format!("{:.4}", fit.lbfgs.value),
        fit.lbfgs.evaluations.to_string(),
        fit.reached_after.map_or("never".to_owned(), |evaluations| evaluations.to_string()),
    ]
}
