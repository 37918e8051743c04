//! The stimuli of a study on a page of their own: materials and methods, by any value that is known of a pair, two pictures at a time.

use super::materials::jpeg;
use super::{Head, document};
use crate::report::ReportError;
use crate::report::gallery::{Column, Gallery, Kind, Pair};
use maud::{Markup, PreEscaped, html};
use serde::Serialize;
use std::collections::BTreeSet;

/// The name of the page.
pub const FILE: &str = "gallery.html";

/// Filters, sorting and the dialog; without it the page shows every thumbnail with its rating, each a link to the whole picture.
const SCRIPT: &str = include_str!("gallery.js");

/// What the script needs to know.
#[derive(Serialize)]
struct Data<'a> {
    decimals: usize,
    columns: Vec<DataColumn<'a>>,
    pictures: Vec<DataPicture<'a>>,
    pairs: Vec<DataPair<'a>>,
}

#[derive(Serialize)]
struct DataColumn<'a> {
    name: &'a str,
    what: &'a str,
    /// On the scale of the ratings.
    rated: bool,
}

#[derive(Serialize)]
struct DataPicture<'a> {
    link: &'a str,
    width: usize,
    height: usize,
}

#[derive(Serialize)]
struct DataPair<'a> {
    material: &'a str,
    method: &'a str,
    mos: f64,
    values: Vec<Option<f64>>,
    candidate: usize,
    reference: Option<usize>,
    hidden: Option<usize>,
}

/// The whole page.
///
/// # Errors
/// Data that are no JSON.
pub fn page(gallery: &Gallery) -> Result<String, ReportError> {
    let observers = if gallery.synthetic { " (SYNTHETIC observers)" } else { "" };
    let mut provenance = vec![("study".to_owned(), gallery.study.clone())];
    provenance.extend(gallery.provenance.iter().cloned());
    let title = format!("Stimuli of {}{observers}", gallery.study);
    let head = Head { title, synthetic: gallery.synthetic, provenance };
    let json =
        serde_json::to_string(&data(gallery)).map_err(|e| ReportError::Format { what: FILE, reason: e.to_string() })?;
    let first = html! {
        p { a href="report.html" { "Report on the study" } }
        p { @for line in &gallery.seen { (line) " " } }
        p {
            "Mean opinion scores (MOS) are on the scale from " (gallery.scale) ". Choose a picture to see it beside its reference at full \
             size, with all values that are known of the pair. Full-size pictures are files beside this page: keep the folders together."
        }
    };
    let body = html! {
        (controls(gallery))
        div #gallery { (scenes(gallery)) }
        div #flat .cards .two hidden {}
        (dialog())
        // A name must not end the element.
        script #gallery-data type="application/json" { (PreEscaped(json.replace('<', "\\u003c"))) }
        script { (PreEscaped(SCRIPT)) }
    };
    Ok(document(&head, &first, &body))
}

fn what(column: &Column) -> &str {
    match &column.kind {
        Kind::Predicted => "predicted MOS",
        Kind::Distance => "distance",
        Kind::File(name) => name,
    }
}

fn data(gallery: &Gallery) -> Data<'_> {
    let columns = gallery.columns.iter();
    let pictures = gallery.pictures.iter();
    let values = |pair: &Pair| columns.clone().map(|c| c.values.get(pair.place).copied().flatten()).collect();
    let pairs = gallery.pairs().map(|(scene, pair)| DataPair {
        material: &pair.material,
        method: &pair.method,
        mos: pair.mos,
        values: values(pair),
        candidate: pair.picture,
        reference: scene.reference,
        hidden: scene.hidden_reference,
    });
    Data {
        decimals: gallery.scale.decimals(),
        pairs: pairs.collect(),
        columns: columns
            .clone()
            .map(|c| DataColumn { name: &c.name, what: what(c), rated: c.kind == Kind::Predicted })
            .collect(),
        pictures: pictures.map(|p| DataPicture { link: &p.link, width: p.size[0], height: p.size[1] }).collect(),
    }
}

/// Hidden until the script is there that they need.
fn controls(gallery: &Gallery) -> Markup {
    let names = |id: &str, label: &str, names: BTreeSet<&str>| {
        html! {
            label { (label) " " select id=(id) { option value="" { "all" } @for name in names { option value=(name) { (name) } } } }
        }
    };
    let of_kind = |label: &str, is: &dyn Fn(&Kind) -> bool| {
        let columns: Vec<(usize, &Column)> = gallery.columns.iter().enumerate().filter(|(_, c)| is(&c.kind)).collect();
        html! {
            @if !columns.is_empty() {
                optgroup label=(label) { @for (i, column) in columns { option value=(i) { (column.name) } } }
            }
        }
    };
    let files: BTreeSet<&str> = gallery.columns.iter().filter(|c| matches!(c.kind, Kind::File(_))).map(what).collect();
    html! {
        form #controls hidden {
            (names("material", "Material", gallery.materials()))
            (names("method", "Method", gallery.methods()))
            label {
                "Sort by "
                select #sort {
                    option value="material" { "material" }
                    option value="mos" { "MOS" }
                    (of_kind("predicted MOS", &|kind| *kind == Kind::Predicted))
                    (of_kind("distance", &|kind| *kind == Kind::Distance))
                    @for file in files { (of_kind(file, &|kind| *kind == Kind::File(file.to_owned()))) }
                }
            }
            button #direction type="button" aria-pressed="false" { "reverse order" }
            output #count aria-live="polite" {}
        }
    }
}

fn scenes(gallery: &Gallery) -> Markup {
    let start = |scene: usize| -> usize { gallery.scenes[..scene].iter().map(|before| before.pairs.len()).sum() };
    html! {
        @for (i, scene) in gallery.scenes.iter().enumerate() {
            section.scene {
                h2 { (scene.material) }
                div.cards {
                    @for (picture, words) in [(scene.reference, "reference"), (scene.hidden_reference, "hidden reference")] {
                        @if let Some(picture) = picture {
                            a.card href=(gallery.pictures[picture].link) {
                                (thumbnail(gallery, picture, &format!("{}, {words}", scene.material)))
                                span { (words) }
                            }
                        }
                    }
                    @for (place, pair) in (start(i)..).zip(&scene.pairs) { (card(gallery, pair, place)) }
                }
            }
        }
    }
}

fn card(gallery: &Gallery, pair: &Pair, place: usize) -> Markup {
    html! {
        a.card href=(gallery.pictures[pair.picture].link) data-pair=(place) {
            (thumbnail(gallery, pair.picture, &format!("{}, {}", pair.material, pair.method)))
            span.of { (pair.material) }
            span { (pair.method) }
            span { "MOS " (gallery.scale.show(pair.mos)) }
            span.key {}
        }
    }
}

fn thumbnail(gallery: &Gallery, picture: usize, alt: &str) -> Markup {
    let small = &gallery.pictures[picture].thumbnail;
    let [width, height] = small.size;
    html! { img src=(jpeg(small)) alt=(alt) width=(width) height=(height) data-picture=(picture); }
}

/// Two pictures and a table, which the script fills.
fn dialog() -> Markup {
    html! {
        dialog #pair aria-labelledby="pair-name" {
            div.bar {
                h2 #pair-name {}
                button #previous type="button" { "\u{2190} previous" }
                button #next type="button" { "next \u{2192}" }
                button #close type="button" { "close" }
            }
            label.switch {
                input #hidden type="checkbox";
                " hidden reference: the reference in the camera of the candidate, to compare pixel by pixel"
            }
            div.both { figure #left { figcaption {} } figure #right { figcaption {} } }
            p #alone hidden {
                "The full-size pictures are not where this page looks for them; these are the small ones. Keep the page and the folder of the \
                 stimuli as they were to each other when the page was made."
            }
            div.table role="region" aria-label="values of this pair" tabindex="0" {
                table {
                    caption { "Values of this pair" }
                    thead { tr { th scope="col" { "metric" } th scope="col" { "value" } th scope="col" { "what it is" } } }
                    tbody {}
                }
            }
            p.keys { "Arrow keys: previous and next pair. H: reference or hidden reference. Escape: close." }
        }
    }
}
