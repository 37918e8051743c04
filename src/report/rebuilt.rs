//! The report of which rebuilt candidates explain the ratings, in Markdown and for a terminal.

use super::markdown;
use super::tables::Table;
use crate::experiment::rebuilt::{Estimate, RebuiltRecord, Verdict, Without};

/// The whole report; `command` makes it again.
pub fn markdown(record: &RebuiltRecord, command: &str) -> String {
    let mut text = format!("# Which rebuilt candidates explain the ratings?\n\n{}\n\n", markdown::code(command));
    if record.synthetic {
        text += "**SYNTHETIC ratings: they come from simulated observers and say nothing about people.**\n\n";
    }
    text += "The BRDFs of this study are reconstructions of what people saw. A judge, the recipe of the metric `vernis`, learned from all \
             methods but one and from all materials but those it was asked about. It predicted the ratings of the method that it had not \
             seen, from candidates rebuilt in several ways. *bias* is the mean of prediction minus rating. D9.Cl learns nothing; its \
             correlation is that of the negated distance.\n\n";
    text += &verdicts(&record.verdicts).to_markdown();
    text += "\nThe ways marked *used* were chosen with these ratings. The table below says what that can do to the headline: the metric's \
             agreement on unseen materials when the rows of such methods take part in nothing, neither in training nor in judging.\n\n";
    text += &without(&record.without).to_markdown();
    text + &format!(
        "\nRecipe version {}, {} folds by material, 95 % intervals from {} resamples of materials, seed {}.\n",
        record.metric_version, record.folds, record.resamples, record.seed
    )
}

/// The two tables for a terminal.
pub fn text(record: &RebuiltRecord) -> String {
    format!("{}\n{}", verdicts(&record.verdicts).to_text(), without(&record.without).to_text())
}

fn verdicts(verdicts: &[Verdict]) -> Table {
    let columns = ["way to rebuild", "used", "rows", "judge: PLCC", "judge: SROCC", "judge: bias", "D9.Cl: SROCC"];
    let mut table = Table::new("Predictions of a judge that saw neither the method nor the material", &columns);
    table.rows = verdicts
        .iter()
        .map(|v| {
            let used = if v.used { "used" } else { "" };
            let mut row = vec![format!("{}: {}", v.method, v.assumes), used.to_owned(), v.rows.to_string()];
            row.extend([v.plcc, v.srocc, v.bias, v.untrained_srocc].map(cell));
            row
        })
        .collect();
    table
}

fn without(found: &[Without]) -> Table {
    let mut table = Table::new("Agreement of the metric out of fold", &["rows of", "rows", "PLCC", "SROCC"]);
    table.rows = found
        .iter()
        .map(|w| {
            let label = match w.methods.as_slice() {
                [] => "all methods".to_owned(),
                methods => format!("all methods but {}", methods.join(" and ")),
            };
            vec![label, w.rows.to_string(), cell(w.plcc), cell(w.srocc)]
        })
        .collect();
    table
}

fn cell(estimate: Estimate) -> String {
    match (estimate.value, estimate.interval) {
        (Some(value), Some(interval)) => format!("{value:.3} [{:.3}, {:.3}]", interval.low, interval.high),
        (Some(value), None) => format!("{value:.3}"),
        (None, _) => "-".to_owned(),
    }
}
