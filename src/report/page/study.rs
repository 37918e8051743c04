//! The statistics of ratings as sections of a page.

use super::figures_html;
use crate::panel::StudyRecord;
use crate::report::Figure;
use crate::report::study::{Block, blocks};
use maud::{Markup, html};

/// Text, tables, figures, and a sentence for every figure that the data do not allow.
pub fn body(record: &StudyRecord, figures: &[Figure], missing: &[String]) -> Markup {
    html! {
        (figures_html(figures))
        @if !missing.is_empty() {
            h2 { "Figures that are left out" }
            ul { @for line in missing { li { (line) } } }
        }
        // The first block says who the observers are, which the head of the page does.
        @for block in blocks(record).into_iter().skip(usize::from(record.synthetic)) {
            @match block {
                Block::Heading(heading) => h2 { (heading) },
                Block::Text(words) => p { (words) },
                Block::Table(table) => (table.to_html()),
            }
        }
    }
}

/// What is needed to make the same statistics again.
pub fn provenance(record: &StudyRecord) -> Vec<(String, String)> {
    let mut lines = vec![
        ("ratings".to_owned(), record.command.clone()),
        ("seed of the ratings' statistics".to_owned(), record.seed.to_string()),
    ];
    lines.extend(record.data.iter().map(|(name, hash)| (format!("SHA-256 of {name}"), hash.clone())));
    lines
}
