//! The report as one self-contained HTML page (no network, light and dark, readable on a phone) and as Markdown.

use super::Figure;
use super::tables::{self, Table, escape};
use crate::evaluation::records::BenchmarkRecord;
use std::fmt::Write;

/// Rows of the table of residuals.
const MOST_RESIDUALS: usize = 15;

const HOW_TO_READ: &str = "\
A learned metric gives a predicted mean opinion score: 5 means that people would not tell the \
candidate from the reference, 1 that it looks very different. PLCC and SROCC say how straight and how well ordered the \
relation between predictions and ratings is (1 is perfect, 0 is none); every figure is measured on materials that the \
metric, and its map to the scale of the ratings, have not seen, unless it says in sample. Intervals hold 95 % of \
resamples of the materials. Quote a score together with the version of the metric.";

const SYNTHETIC: &str =
    "SYNTHETIC observers: these ratings were simulated by a program. Nothing here says how people see.";

const STYLE: &str = "
:root { color-scheme: light dark; --ink: #1c1c1c; --paper: #fdfdfc; --faint: #6b6b6b; --line: #d9d9d6; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e6e3; --paper: #171717; --faint: #a0a09c; --line: #3a3a38; }
}
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 64rem; padding: 1rem; color: var(--ink); background: var(--paper);
  font: 16px/1.55 system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: .5rem 0; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .6rem; }
p { max-width: 46rem; }
code { font: .88em ui-monospace, Consolas, monospace; overflow-wrap: anywhere; }
.banner { padding: .7rem 1rem; border: 2px solid #d55e00; border-radius: .4rem; font-weight: 700; }
.table, figure { overflow-x: auto; margin: 0 0 1.2rem; }
table { border-collapse: collapse; font-size: .86rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; color: var(--faint); padding: 0 0 .4rem; }
th, td { padding: .3rem .6rem; border-bottom: 1px solid var(--line); text-align: right; white-space: nowrap; }
th { font-weight: 600; }
th:first-child { text-align: left; position: sticky; left: 0; background: var(--paper); }
figure svg { display: block; width: 100%; min-width: 40rem; height: auto; border-radius: .4rem; }
figcaption { color: var(--faint); font-size: .9rem; max-width: 46rem; padding-top: .4rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1rem; font-size: .9rem; }
.provenance { font-size: .8rem; line-height: 1.4; margin-bottom: 1.4rem; }
dt { color: var(--faint); } dd { margin: 0; overflow-wrap: anywhere; }
";

/// The page, figures inline.
pub fn html(record: &BenchmarkRecord, figures: &[Figure]) -> String {
    let title = escape(&title(record));
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n"
    );
    if record.synthetic {
        push(&mut page, format_args!("<p class=\"banner\">{SYNTHETIC}</p>\n"));
    }
    page.push_str("<dl class=\"provenance\">\n");
    for (name, value) in provenance(record) {
        push(&mut page, format_args!("<dt>{}</dt><dd><code>{}</code></dd>\n", escape(&name), escape(&value)));
    }
    page.push_str("</dl>\n");
    page.push_str(&tables::headline(record).to_html());
    push(&mut page, format_args!("<p>{}</p>\n", escape(HOW_TO_READ)));
    for figure in figures {
        let (svg, caption) = (inline_svg(&figure.svg, &figure.caption), escape(&figure.caption));
        push(&mut page, format_args!("<figure>{svg}<figcaption>{caption}</figcaption></figure>\n"));
    }
    for (heading, table) in sections(record) {
        push(&mut page, format_args!("<h2>{heading}</h2>\n{}", table.to_html()));
    }
    if let Some(words) = calibration(record) {
        push(&mut page, format_args!("<h2>Intervals of the scores</h2>\n<p>{}</p>\n", escape(&words)));
    }
    if !record.did_not_help.is_empty() {
        let items: String = record.did_not_help.iter().map(|line| format!("<li>{}</li>\n", escape(line))).collect();
        push(&mut page, format_args!("<h2>What did not help</h2>\n<ul>\n{items}</ul>\n"));
    }
    page.push_str("<h2>Notes on the metrics</h2>\n<dl>\n");
    for metric in record.metrics.iter().filter(|m| !m.note.is_empty()) {
        push(&mut page, format_args!("<dt>{}</dt><dd>{}</dd>\n", escape(&metric.name), escape(&metric.note)));
    }
    page.push_str("</dl>\n</body>\n</html>\n");
    page
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

fn title(record: &BenchmarkRecord) -> String {
    let observers = if record.synthetic { "SYNTHETIC observers" } else { "people" };
    format!("{}: agreement with {observers} on {}", tables::subject(record), record.study)
}

fn sections(record: &BenchmarkRecord) -> Vec<(&'static str, Table)> {
    vec![
        ("All metrics", tables::all_metrics(record)),
        ("Differences between metrics", tables::differences(record)),
        ("Which descriptors matter", tables::ablation(record)),
        ("Where it is wrong", tables::residuals(record, MOST_RESIDUALS)),
    ]
    .into_iter()
    .filter(|(_, table)| !table.rows.is_empty())
    .collect()
}

fn calibration(record: &BenchmarkRecord) -> Option<String> {
    let found = record.calibration?;
    Some(format!(
        "Intervals that promise {:.0} % held {:.1} % of {} held-out ratings; {:.1} % lay below and {:.1} % above. \
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
fn provenance(record: &BenchmarkRecord) -> Vec<(String, String)> {
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

/// An SVG file as an element of the page, named by its caption.
fn inline_svg(svg: &str, caption: &str) -> String {
    let element = svg.find("<svg").map_or(svg, |at| &svg[at..]);
    element.replacen("<svg", &format!("<svg role=\"img\" aria-label=\"{}\"", escape(caption)), 1)
}
