//! Small pictures of references and their candidates, with what was rated and what was predicted.

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
    /// Mean opinion score, as rated.
    pub mos: f64,
    /// As predicted without having seen the material.
    pub predicted: Option<f64>,
}

/// One section a material, in the order given; the first `open` are unfolded.
pub fn section(materials: &[Material], open: usize, light: &str, scale: RatingScale) -> Markup {
    let on = if scale.is_grades() { "1 to 5".to_owned() } else { scale.to_string() };
    html! {
        @if !materials.is_empty() {
            h2 { "Materials" }
            p {
                "A sphere under " (light) ", all at the same exposure. Rated and predicted mean opinion scores are on the \
                 scale from " (on) "; the materials with the largest errors of the metric come first."
            }
            @for (i, material) in materials.iter().enumerate() {
                details.material open[i < open] {
                    summary {
                        (material.name)
                        @if let Some(error) = material.error { " (off by " (scale.show(error)) ")" }
                    }
                    div.spheres {
                        (sphere(&material.reference, &format!("{}, reference", material.name)))
                        @for candidate in &material.candidates { (of_candidate(material, candidate, scale)) }
                    }
                }
            }
        }
    }
}

fn of_candidate(material: &Material, candidate: &Candidate, scale: RatingScale) -> Markup {
    let predicted = candidate.predicted.map_or(String::new(), |p| format!(", predicted {}", scale.show(p)));
    let words = format!("{}: rated {}{predicted}", candidate.method, scale.show(candidate.mos));
    let alt = format!("{}, {}", material.name, candidate.method);
    html! { div { img src=(data(&candidate.picture)) alt=(alt) width="64" height="64"; (words) } }
}

fn sphere(picture: &[u8], words: &str) -> Markup {
    html! { div { img src=(data(picture)) alt=(words) width="64" height="64"; "reference" } }
}

fn data(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(png))
}
