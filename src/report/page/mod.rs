//! Reports as one self-contained HTML page: no network, light and dark, readable on a phone.

pub mod benchmark;
pub mod gallery;
pub mod materials;
pub mod study;

use super::Figure;
use maud::{DOCTYPE, Markup, PreEscaped, html};

pub(super) const SYNTHETIC: &str =
    "SYNTHETIC observers: these ratings were simulated by a program. Nothing here says how people see.";

const STYLE: &str = include_str!("style.css");
/// Makes the columns of tables sortable, and says in words which tables are wider than the page; without it the page lacks nothing
/// else, and a shadow shows what is wider.
const SCRIPT: &str = include_str!("sort.js");

/// What stands around the contents of a page.
pub struct Head {
    /// The title of the page.
    pub title: String,
    /// Ratings come from simulated observers; the page says so.
    pub synthetic: bool,
    /// What is needed to make the page again: names and values.
    pub provenance: Vec<(String, String)>,
}

/// A whole page: the head, `first` before the provenance, and `body`.
pub fn document(head: &Head, first: &Markup, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                link rel="icon" href="data:,";
                title { (head.title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (head.title) }
                @if head.synthetic { p.banner { (SYNTHETIC) } }
                (first)
                details.provenance {
                    summary { "How this page was made" }
                    dl {
                        @for (name, value) in &head.provenance { dt { (name) } dd { code { (value) } } }
                    }
                }
                (body)
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    page.into_string()
}

/// Figures, as drawings inside the page.
pub(super) fn figures_html(figures: &[Figure]) -> Markup {
    html! {
        @for figure in figures {
            figure id=(figure.name) {
                (inline_svg(&figure.svg, &figure.caption))
                figcaption {
                    (figure.caption) " "
                    a href={ (figure.name) ".svg" } { "SVG" } " "
                    a href={ (figure.name) ".png" } { "PNG" }
                }
            }
        }
    }
}

/// The files beside the page that hold what it shows.
pub fn files(names: &[&str]) -> Markup {
    html! {
        @if !names.is_empty() {
            h2 { "The numbers behind the page" }
            ul { @for name in names { li { a href=(name) { (name) } } } }
        }
    }
}

/// An SVG file as an element of the page, named by its caption.
fn inline_svg(svg: &str, caption: &str) -> Markup {
    let element = svg.find("<svg").map_or(svg, |at| &svg[at..]);
    let label = html! { (caption) }.into_string();
    PreEscaped(element.replacen("<svg", &format!("<svg role=\"img\" aria-label=\"{label}\""), 1))
}
