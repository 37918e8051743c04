//! The report of which rebuilt candidates explain the ratings, in Markdown and for a terminal.

use super::markdown;
use super::tables::Table;
use crate::experiment::rebuilt::{Estimate, RebuiltRecord, Verdict, Without, listed};

/// The whole report; `command` makes it again.
pub fn markdown(record: &RebuiltRecord, command: &str) -> String {
    let mut text = format!("# Which rebuilt candidates explain the ratings?\n\n{}\n\n", markdown::code(command));
    if record.synthetic {
        text += "**SYNTHETIC ratings: they come from simulated observers and say nothing about people.**\n\n";
    }
    text += &format!(
        "The BRDFs of this study are reconstructions of what people saw. A judge, the recipe of the metric `vernis`, version {}, learned \
         from all families of methods but one and from all materials but those it was asked about. It predicted the ratings of the \
         family that it had not seen, from candidates rebuilt in several ways. *bias* is the mean of prediction minus rating. D9.Cl \
         learns nothing; its correlation is that of the negated distance.\n\n",
        record.metric_version
    );
    text += &verdicts(&record.verdicts, "rebuilt", record).to_markdown();
    if !record.refits.is_empty() {
        text += "\nThe study does not rebuild the methods of the next table. Their candidates were fitted to the references again, in the \
                 ways that the paper leaves open, under D4.Cl by Hooke-Jeeves or, for rational functions, by quadratic programming. A way \
                 that people saw would be predicted as well as those above, without a large bias.\n\n";
        text += &verdicts(&record.refits, "fitted again", record).to_markdown();
    }
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
    let mut tables = vec![verdicts(&record.verdicts, "rebuilt", record)];
    if !record.refits.is_empty() {
        tables.push(verdicts(&record.refits, "fitted again", record));
    }
    tables.push(without(&record.without));
    tables.iter().map(Table::to_text).collect::<Vec<_>>().join("\n")
}

fn verdicts(verdicts: &[Verdict], how: &str, record: &RebuiltRecord) -> Table {
    let columns = ["way", "used", "rows", "learned from", "judge: PLCC", "judge: SROCC", "judge: bias", "D9.Cl: SROCC"];
    let title = format!(
        "Candidates {how}: predictions of a judge (version {}) that saw neither the family of the method nor the material",
        record.metric_version
    );
    let mut table = Table::new(title, &columns);
    table.rows = verdicts
        .iter()
        .map(|v| {
            let used = if v.used { "used" } else { "" };
            let mut row = vec![format!("{}: {}", v.method, v.assumes), used.to_owned(), v.rows.to_string()];
            row.push(format!("at least {} rows", v.training_rows));
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
                methods => format!("all methods but {}", listed(methods)),
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
