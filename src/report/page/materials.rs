//! Small pictures of references and their candidates, with what was rated and what was predicted.

use crate::report::gallery::{Gallery, Thumbnail};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, html};
use vernis_metric::math::rating_scale::RatingScale;

/// A material of a study.
pub struct Material {
    /// Name of the material.
    pub name: String,
    /// Of the reference, a PNG file.
    pub reference: Vec<u8>,
    /// Stimuli of the reference, where they are rendered: in its own camera, and in that of the candidates.
    pub stimuli: [Option<Thumbnail>; 2],
    /// Its approximations.
    pub candidates: Vec<Candidate>,
    /// Root mean square of predicted minus rated, where a metric predicted.
    pub error: Option<f64>,
}

/// An approximation of a material.
pub struct Candidate {
    /// Name of the approximation method.
    pub method: String,
    /// A PNG file.
    pub picture: Vec<u8>,
    /// The stimulus, where it is rendered.
    pub stimulus: Option<Thumbnail>,
    /// Mean opinion score, as rated.
    pub mos: f64,
    /// As predicted without having seen the material.
    pub predicted: Option<f64>,
}

/// One section a material, in the order given; the first `open` are unfolded. `gallery` is where the stimuli beside the spheres are from.
pub fn section(
    materials: &[Material],
    open: usize,
    light: &str,
    scale: RatingScale,
    gallery: Option<&Gallery>,
) -> Markup {
    let on = if scale.is_grades() { "1 to 5".to_owned() } else { scale.to_string() };
    html! {
        @if !materials.is_empty() {
            h2 { "Materials" }
            p {
                "A sphere under " (light) ", all at the same exposure. Rated and predicted mean opinion scores are on the \
                 scale from " (on) "; the materials with the largest errors of the metric come first."
            }
            @if let Some(gallery) = gallery {
                p {
                    "Beside each sphere is its stimulus, as people would see it. "
                    @for line in &gallery.seen { (line) " " }
                    a href=(super::gallery::FILE) { "The gallery" }
                    " shows the stimuli at full size, two at a time."
                }
            }
            @for (i, material) in materials.iter().enumerate() {
                details.material open[i < open] {
                    summary {
                        (material.name)
                        @if let Some(error) = material.error { " (off by " (scale.show(error)) ")" }
                    }
                    div.spheres {
                        (of_reference(material))
                        @for candidate in &material.candidates { (of_candidate(material, candidate, scale)) }
                    }
                }
            }
        }
    }
}

fn of_reference(material: &Material) -> Markup {
    let [own, hidden] = &material.stimuli;
    html! {
        (cell(&material.reference, own.as_ref(), &format!("{}, reference", material.name), "reference"))
        @if let Some(hidden) = hidden {
            div {
                (stimulus(hidden, &format!("{}, hidden reference, stimulus", material.name)))
                br;
                "hidden reference"
            }
        }
    }
}

fn of_candidate(material: &Material, candidate: &Candidate, scale: RatingScale) -> Markup {
    let predicted = candidate.predicted.map_or(String::new(), |p| format!(", predicted {}", scale.show(p)));
    let words = format!("{}: rated {}{predicted}", candidate.method, scale.show(candidate.mos));
    let alt = format!("{}, {}", material.name, candidate.method);
    cell(&candidate.picture, candidate.stimulus.as_ref(), &alt, &words)
}

/// A sphere, the stimulus where there is one, and `words`.
fn cell(sphere: &[u8], rendered: Option<&Thumbnail>, alt: &str, words: &str) -> Markup {
    let png = format!("data:image/png;base64,{}", STANDARD.encode(sphere));
    html! {
        div {
            @if let Some(rendered) = rendered { (stimulus(rendered, &format!("{alt}, stimulus"))) }
            img.sphere src=(png) alt=(alt) width="64" height="64";
            @if rendered.is_some() { br; }
            (words)
        }
    }
}

fn stimulus(thumbnail: &Thumbnail, alt: &str) -> Markup {
    let [width, height] = thumbnail.size;
    html! { img.stimulus src=(jpeg(thumbnail)) alt=(alt) width=(width) height=(height); }
}

/// A thumbnail inside the page.
pub(super) fn jpeg(thumbnail: &Thumbnail) -> String {
    format!("data:image/jpeg;base64,{}", STANDARD.encode(&thumbnail.jpeg))
}
