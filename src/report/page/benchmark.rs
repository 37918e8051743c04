//! The judgement of metrics as sections of a page, and as Markdown.

use super::{SYNTHETIC, figures_html};
use crate::evaluation::records::BenchmarkRecord;
use crate::report::Figure;
use crate::report::tables::{self, Table};
use maud::{Markup, html};
use std::fmt::Write;

/// Rows of the table of residuals.
const MOST_RESIDUALS: usize = 15;

const HOW_TO_READ: &str = "\
A learned metric predicts a mean opinion score: 5 means that people would not tell the \
candidate from the reference, 1 that it looks very different. PLCC and SROCC say how linear and how well ordered the \
relation between predictions and ratings is (1 is perfect, 0 is none). Unless a figure says in sample, it is measured on \
materials that neither the metric nor its map to the scale of the ratings has seen. Intervals contain 95 % of the \
resamples of the materials. Quote a score together with the version of the metric.";

/// The headline table and how to read it.
pub fn headline(record: &BenchmarkRecord) -> Markup {
    html! {
        (tables::headline(record).to_html())
        p { (HOW_TO_READ) }
    }
}

/// Everything below the headline.
pub fn body(record: &BenchmarkRecord, figures: &[Figure]) -> Markup {
    html! {
        (figures_html(figures))
        @for (heading, table) in sections(record) {
            h2 { (heading) }
            (table.to_html())
        }
        @if let Some(words) = calibration(record) {
            h2 { "Intervals of the scores" }
            p { (words) }
        }
        @if !record.did_not_help.is_empty() {
            h2 { "What did not help" }
            ul { @for line in &record.did_not_help { li { (line) } } }
        }
        @if !record.left_out.is_empty() {
            h2 { "What is left out" }
            ul { @for line in &record.left_out { li { (line) } } }
        }
        h2 { "Notes on the metrics" }
        dl {
            @for metric in record.metrics.iter().filter(|m| !m.note.is_empty()) {
                dt { (metric.name) } dd { (metric.note) }
            }
        }
    }
}

/// The same in Markdown; figures are the PNG files beside it.
pub fn markdown(record: &BenchmarkRecord, figures: &[Figure]) -> String {
    let mut page = format!("# {}\n\n", title(record));
    if record.synthetic {
        push(&mut page, format_args!("**{SYNTHETIC}**\n\n"));
    }
    for (name, value) in provenance(record) {
        push(&mut page, format_args!("* {name}: `{value}`\n"));
    }
    push(&mut page, format_args!("\n{}\n{HOW_TO_READ}\n", tables::headline(record).to_markdown()));
    for figure in figures {
        push(&mut page, format_args!("\n![{}]({}.png)\n\n{}\n", figure.name, figure.name, figure.caption));
    }
    for (heading, table) in sections(record) {
        push(&mut page, format_args!("\n## {heading}\n\n{}", table.to_markdown()));
    }
    if let Some(words) = calibration(record) {
        push(&mut page, format_args!("\n## Intervals of the scores\n\n{words}\n"));
    }
    if !record.did_not_help.is_empty() {
        let items: String = record.did_not_help.iter().map(|line| format!("* {line}\n")).collect();
        push(&mut page, format_args!("\n## What did not help\n\n{items}"));
    }
    if !record.left_out.is_empty() {
        let items: String = record.left_out.iter().map(|line| format!("* {line}\n")).collect();
        push(&mut page, format_args!("\n## What is left out\n\n{items}"));
    }
    page.push_str("\n## Notes on the metrics\n\n");
    for metric in record.metrics.iter().filter(|m| !m.note.is_empty()) {
        push(&mut page, format_args!("* {}: {}\n", metric.name, metric.note));
    }
    page
}

fn push(page: &mut String, words: std::fmt::Arguments<'_>) {
    // Writing to a String cannot fail.
    let _ = page.write_fmt(words);
}

/// The title of the page: metric, observers and study.
pub fn title(record: &BenchmarkRecord) -> String {
    let observers = if record.synthetic { "SYNTHETIC observers" } else { "people" };
    format!("{}: agreement with {observers} on {}", tables::subject(record), record.study)
}

fn sections(record: &BenchmarkRecord) -> Vec<(&'static str, Table)> {
    vec![
        ("All metrics", tables::all_metrics(record)),
        ("Differences between metrics", tables::differences(record)),
        ("Which descriptors matter", tables::ablation(record)),
        ("Which descriptors the model relies on", tables::importance(record)),
        ("What more materials would bring", tables::learning_curve(record)),
        ("Where it is wrong", tables::residuals(record, MOST_RESIDUALS)),
    ]
    .into_iter()
    .filter(|(_, table)| !table.rows.is_empty())
    .collect()
}

fn calibration(record: &BenchmarkRecord) -> Option<String> {
    let found = record.calibration?;
    Some(format!(
        "Intervals with a nominal coverage of {:.0} % contained {:.1} % of {} held-out ratings; {:.1} % lay below and {:.1} % above. \
         Their mean width is {:.2} MOS.",
        100.0 * found.nominal,
        100.0 * found.covered,
        found.rows,
        100.0 * found.below,
        100.0 * found.above,
        found.mean_width
    ))
}

/// What is needed to make the same report again.
pub fn provenance(record: &BenchmarkRecord) -> Vec<(String, String)> {
    let mut lines = vec![
        ("command".to_owned(), record.command.clone()),
        ("seed".to_owned(), record.seed.to_string()),
        ("study".to_owned(), format!("{}{}", record.study, if record.synthetic { " (SYNTHETIC)" } else { "" })),
        (
            "size".to_owned(),
            format!(
                "{} rated pairs, {} materials in {} groups of sisters, {} folds, {} resamples",
                record.rows, record.materials, record.groups, record.folds, record.resamples
            ),
        ),
    ];
    lines.extend(record.versions.iter().map(|(name, version)| (format!("version of {name}"), version.clone())));
    lines.extend(record.data_hashes.iter().map(|(name, hash)| (format!("SHA-256 of {name}"), hash.clone())));
    lines
}
