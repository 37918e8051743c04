//! The judgement of metrics as sections of a page, and as Markdown.

use super::{SYNTHETIC, figures_html};
use crate::evaluation::records::BenchmarkRecord;
use crate::report::Figure;
use crate::report::image_metrics;
use crate::report::markdown::{code, text};
use crate::report::tables::{self, Table};
use maud::{Markup, html};
use std::fmt::Write;
use vernis_metric::io::counted;

/// Rows of the table of residuals.
const MOST_RESIDUALS: usize = 15;

const HOW_TO_READ: &str = "\
PLCC and SROCC say how linear and how well ordered the \
relation between predictions and ratings is (1 is perfect, 0 is none). Unless a figure says in sample, it is measured on \
materials that neither the metric nor its map to the scale of the ratings has seen. Intervals contain 95 % of the \
resamples of the materials. The mean of folds is that of the PLCC / SROCC that each fold has on its own: a correlation over the rows \
of all folds at once is biased downwards for weak predictors, below 0 for ratings dealt at random, because a fold whose held-out \
ratings are high was trained on ratings that are low on average. Quote a score together with the version of the metric.";

fn how_to_read(record: &BenchmarkRecord) -> String {
    let (worst, best) = (record.scale.worst(), record.scale.best());
    format!(
        "A learned metric predicts a mean opinion score: {best} means that people would not tell the candidate from the reference, \
         {worst} that it looks very different. {HOW_TO_READ}"
    )
}

/// The headline table and how to read it.
pub fn headline(record: &BenchmarkRecord) -> Markup {
    html! {
        @for table in tables::headlines(record) { (table.to_html()) }
        @if let Some(defeat) = tables::defeat(record) { p.banner { (defeat) } }
        p { (how_to_read(record)) }
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
    let mut page = format!("# {}\n\n", text(&title(record)));
    if record.synthetic {
        push(&mut page, format_args!("**{SYNTHETIC}**\n\n"));
    }
    for (name, value) in provenance(record) {
        push(&mut page, format_args!("* {}: {}\n", text(&name), code(&value)));
    }
    for table in tables::headlines(record) {
        push(&mut page, format_args!("\n{}\n", table.to_markdown()));
    }
    if let Some(defeat) = tables::defeat(record) {
        push(&mut page, format_args!("**{}**\n\n", text(&defeat)));
    }
    push(&mut page, format_args!("{}\n", how_to_read(record)));
    for figure in figures {
        let caption = text(&figure.caption);
        push(&mut page, format_args!("\n![{}]({}.png)\n\n{caption}\n", figure.name, figure.name));
    }
    for (heading, table) in sections(record) {
        push(&mut page, format_args!("\n## {heading}\n\n{}", table.to_markdown()));
    }
    if let Some(words) = calibration(record) {
        push(&mut page, format_args!("\n## Intervals of the scores\n\n{words}\n"));
    }
    if !record.did_not_help.is_empty() {
        let items: String = record.did_not_help.iter().map(|line| format!("* {}\n", text(line))).collect();
        push(&mut page, format_args!("\n## What did not help\n\n{items}"));
    }
    if !record.left_out.is_empty() {
        let items: String = record.left_out.iter().map(|line| format!("* {}\n", text(line))).collect();
        push(&mut page, format_args!("\n## What is left out\n\n{items}"));
    }
    page.push_str("\n## Notes on the metrics\n\n");
    for metric in record.metrics.iter().filter(|m| !m.note.is_empty()) {
        push(&mut page, format_args!("* {}: {}\n", text(&metric.name), text(&metric.note)));
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
        ("Metrics on pictures", image_metrics::table(record)),
        ("Metrics on pictures by rows", image_metrics::by_rows(record)),
        ("All metrics", tables::all_metrics(record)),
        ("Differences between metrics", tables::differences(record)),
        ("Which descriptors matter", tables::ablation(record)),
        ("Which descriptors the model relies on", tables::importance(record)),
        ("What more materials would bring", tables::learning_curve(record)),
        ("Where it is wrong", tables::residuals(record, MOST_RESIDUALS)),
        ("Which methods it misjudges", tables::method_residuals(record)),
        ("Triplets of materials", tables::triplets(record)),
    ]
    .into_iter()
    .filter(|(_, table)| !table.rows.is_empty())
    .collect()
}

fn calibration(record: &BenchmarkRecord) -> Option<String> {
    let found = record.calibration?;
    let unseen_method = found.unseen_method.map_or(String::new(), |unseen| {
        format!(
            " Where the method was not seen either, they contained {:.1} % of {}, with a mean width of {} MOS.",
            100.0 * unseen.covered,
            counted(unseen.rows, "rating"),
            record.scale.show(unseen.mean_width)
        )
    });
    Some(format!(
        "Intervals with a nominal coverage of {:.0} % contained {:.1} % of {}; {:.1} % lay below and {:.1} % above. \
         Their mean width is {} MOS.{unseen_method}",
        100.0 * found.nominal,
        100.0 * found.covered,
        counted(found.rows, "held-out rating"),
        100.0 * found.below,
        100.0 * found.above,
        record.scale.show(found.mean_width)
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
                "{}, {} in {} of sisters, {}, {}",
                counted(record.rows, "rated pair"),
                counted(record.materials, "material"),
                counted(record.groups, "group"),
                counted(record.folds, "fold"),
                counted(record.resamples, "resample")
            ),
        ),
    ];
    lines.extend(record.row_sets.iter().map(|set| (format!("rows of {}", set.name), set.methods.join(", "))));
    lines.push(("scale of the ratings".to_owned(), record.scale.to_string()));
    if let Some(identical) = &record.identical {
        let score = record.scale.show(identical.score);
        lines.push(("score of identical BRDFs".to_owned(), format!("{score} ({})", identical.basis)));
    }
    lines.extend(record.versions.iter().map(|(name, version)| (format!("version of {name}"), version.clone())));
    lines.extend(record.data_hashes.iter().map(|(name, hash)| (format!("SHA-256 of {name}"), hash.clone())));
    lines
}
