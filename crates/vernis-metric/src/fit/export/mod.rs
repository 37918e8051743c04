//! From a fit to a renderer: the material that looks like it there, and what the translation costs.
//!
//! A renderer has few models. Where it has the fitted one, [`translate`] gives its exact counterpart; where it has not, the nearest
//! material: the renderer's most flexible model, fitted to the fit. [`Translation::judge`] says how far that is from the fit, in any
//! metric.
//!
//! | renderer | exact | nearest |
//! | --- | --- | --- |
//! | Mitsuba 3 | `lambert`, `principled`, `ggx-conductor` without diffuse part, metals of `ggx` and OpenPBR | `principled` |
//! | pbrt-v4 | `lambert`, `pbrt-conductor`, `pbrt-mix` | `pbrt-mix`; `pbrt-conductor` for conductors |
//! | MaterialX 1.39 | `lambert`, `openpbr`, `openpbr-metal`, `openpbr-dielectric`, metals of `ggx` and `principled` | `openpbr` |
//! | glTF 2.0 | `lambert`, `gltf` | `gltf` |
//!
//! *Exact* means that the formulas are the same. Renderers add what no BRDF here has: spectra made of colours (pbrt), light that facets
//! scatter twice, and layerings of their own (some that render OpenPBR).

mod write;

use super::result_file::by_name;
use super::{FitError, Fitting, MetricUsed};
use crate::brdf::models::{AnalyticBrdf, Gltf, OpenPbrDielectric, OpenPbrMetal, Principled};
use crate::io::{Interrupt, Observer, decimals, nearest};
use crate::math::Rgb;
use crate::metric::{Metric, Score};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// A renderer, or a format that renderers read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Renderer {
    /// Mitsuba 3, a fragment of XML.
    Mitsuba,
    /// pbrt-v4, named materials.
    Pbrt,
    /// MaterialX 1.39, a document with an OpenPBR surface.
    MaterialX,
    /// glTF 2.0, a file with one material.
    Gltf,
}

impl Renderer {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Mitsuba, Self::Pbrt, Self::MaterialX, Self::Gltf];

    /// `mitsuba`, `pbrt`, `materialx` or `gltf`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mitsuba => "mitsuba",
            Self::Pbrt => "pbrt",
            Self::MaterialX => "materialx",
            Self::Gltf => "gltf",
        }
    }

    /// What files of the renderer end in, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Mitsuba => "xml",
            Self::Pbrt => "pbrt",
            Self::MaterialX => "mtlx",
            Self::Gltf => "gltf",
        }
    }
}

impl fmt::Display for Renderer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Renderer {
    type Err = FitError;

    fn from_str(name: &str) -> Result<Self, FitError> {
        Self::ALL.into_iter().find(|renderer| renderer.name() == name).ok_or_else(|| FitError::UnknownRenderer {
            found: name.to_owned(),
            nearest: nearest(name, Self::ALL.map(Self::name)),
        })
    }
}

/// What a translation costs under one metric.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// The metric.
    pub metric: MetricUsed,
    /// Distance between the fit and the material, in the metric's unit.
    pub distance: f64,
    /// The score that the metric predicts for the pair, where it was learned from ratings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub score: Option<Score>,
}

/// A material of a renderer, in place of a model.
#[derive(Clone)]
pub struct Translation {
    /// Where the material is for.
    pub renderer: Renderer,
    /// The material as the renderer evaluates it.
    pub model: Arc<dyn AnalyticBrdf>,
    /// Whether the renderer has the very formula.
    pub exact: bool,
    /// What it costs, in each of the metrics that [`Translation::judge`] was called with.
    pub costs: Vec<Cost>,
}

/// What the file of a fit says of a [`Translation`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Export {
    /// Where the material is for.
    pub renderer: Renderer,
    /// Name of the file, beside that of the fit.
    pub file: String,
    /// Identifier of the model that the renderer evaluates.
    pub model: String,
    /// Its parameters by field.
    pub parameters: Map<String, Value>,
    /// Whether the renderer has the very formula.
    pub exact: bool,
    /// What the translation costs.
    pub costs: Vec<Cost>,
}

/// The material of `renderer` for `model`: the exact counterpart, or the nearest under `loss`.
///
/// An interrupted search gives the best material so far.
///
/// # Errors
/// Those of [`Fitting::run`].
pub fn translate(
    model: &dyn AnalyticBrdf,
    renderer: Renderer,
    loss: &dyn Metric,
    interrupt: &Interrupt,
    observer: Observer<'_>,
) -> Result<Translation, FitError> {
    let exact = counterpart(renderer, model)?;
    let (model, exact) = match exact {
        Some(model) => (model, true),
        None => {
            let fitting =
                Fitting { interrupt: interrupt.clone(), ..Fitting::new(nearest_model(renderer, model), loss) };
            (fitting.run(model, observer)?.model, false)
        }
    };
    Ok(Translation { renderer, model, exact, costs: Vec::new() })
}

impl Translation {
    /// Adds what the translation of `model` costs under `metric`.
    ///
    /// # Errors
    /// Those of the metric.
    pub fn judge(&mut self, model: &dyn AnalyticBrdf, metric: &dyn Metric) -> Result<(), FitError> {
        let measured = metric.prepare(model)?.measure(&*self.model)?;
        self.costs.push(Cost { metric: MetricUsed::of(metric), distance: measured.value, score: measured.score });
        Ok(())
    }

    /// The file of the renderer. `notes` are comments for whoever opens it.
    pub fn text(&self, notes: &[String]) -> String {
        write::text(self.renderer, &*self.model, notes)
    }

    /// The material as a dictionary that `mitsuba.load_dict` takes; `None` for other renderers.
    pub fn mitsuba_dictionary(&self) -> Option<Value> {
        (self.renderer == Renderer::Mitsuba).then(|| write::mitsuba::dictionary(&*self.model))
    }

    /// What it costs, in words: `vernis 0.21, predicted MOS 4.70 of 5, 95 % between 4.30 and 4.90`, one metric after the other.
    pub fn costs_in_words(&self) -> String {
        let of = |cost: &Cost| {
            let distance = format!("{} {}", cost.metric.name, decimals(cost.distance, 4));
            cost.score.map_or(distance.clone(), |score| format!("{distance}, {score}"))
        };
        self.costs.iter().map(of).collect::<Vec<_>>().join("; ")
    }

    /// What the file of a fit says of it; `file` is the name of the material's file.
    pub fn export(&self, file: &str) -> Export {
        Export {
            renderer: self.renderer,
            file: file.to_owned(),
            model: self.model.model().to_owned(),
            parameters: by_name(&*self.model),
            exact: self.exact,
            costs: self.costs.clone(),
        }
    }
}

/// The renderer's model with the very formula of `model`.
fn counterpart(renderer: Renderer, model: &dyn AnalyticBrdf) -> Result<Option<Arc<dyn AnalyticBrdf>>, FitError> {
    let own = |models: &[&str]| models.contains(&model.model());
    let same = || super::Space::of(model.model())?.build(&model.parameters()).map(Some);
    let (diffuse, metal) = (albedo_of_lambert(model), Metal::of(model));
    Ok(match (renderer, diffuse, metal) {
        (Renderer::Mitsuba, _, _) if own(&["lambert", "principled"]) || is_bare_conductor(model) => same()?,
        (Renderer::Pbrt, _, _) if own(&["lambert", "pbrt-conductor", "pbrt-mix"]) => same()?,
        (Renderer::MaterialX, _, _) if own(&["openpbr", "openpbr-metal", "openpbr-dielectric"]) => same()?,
        (Renderer::Gltf, _, _) if own(&["gltf"]) => same()?,
        (Renderer::MaterialX, Some(base_color), _) => Some(Arc::new(OpenPbrDielectric {
            base_color,
            base_diffuse_roughness: 0.0,
            specular_weight: 0.0,
            specular_color: [1.0; 3],
            specular_roughness: 0.3,
            specular_ior: 1.5,
        })),
        (Renderer::Gltf, Some(base_color), _) => {
            Some(Arc::new(Gltf { base_color, metallic: 0.0, roughness: 1.0, ior: 1.5, specular: 0.0 }))
        }
        (Renderer::Mitsuba, _, Some(Metal { base_color, roughness })) => Some(Arc::new(Principled {
            base_color,
            roughness,
            metallic: 1.0,
            specular: 0.5,
            spec_tint: 0.0,
            sheen: 0.0,
            sheen_tint: 0.0,
            flatness: 0.0,
            clearcoat: 0.0,
            clearcoat_gloss: 0.0,
        })),
        (Renderer::MaterialX, _, Some(Metal { base_color, roughness })) => Some(Arc::new(OpenPbrMetal {
            base_color,
            specular_weight: 1.0,
            specular_color: [1.0; 3],
            specular_roughness: roughness,
        })),
        _ => None,
    })
}

/// The model of `renderer` that comes nearest to most others.
fn nearest_model(renderer: Renderer, model: &dyn AnalyticBrdf) -> &'static str {
    match renderer {
        Renderer::Mitsuba => "principled",
        Renderer::Pbrt if is_bare_conductor(model) => "pbrt-conductor",
        Renderer::Pbrt => "pbrt-mix",
        Renderer::MaterialX => "openpbr",
        Renderer::Gltf => "gltf",
    }
}

/// The numbers of the field `name`.
fn field(model: &dyn AnalyticBrdf, name: &str) -> Vec<f64> {
    let (schema, p) = (model.schema(), model.parameters());
    let of = |parameter: &str| parameter == name || parameter.rsplit_once('.').is_some_and(|(field, _)| field == name);
    schema.iter().zip(p).filter(|(parameter, _)| of(&parameter.name)).map(|(_, x)| x).collect()
}

fn colour(model: &dyn AnalyticBrdf, name: &str) -> Option<Rgb> {
    field(model, name).try_into().ok()
}

fn is(model: &dyn AnalyticBrdf, name: &str, value: f64) -> bool {
    field(model, name).iter().all(|x| *x == value)
}

fn albedo_of_lambert(model: &dyn AnalyticBrdf) -> Option<Rgb> {
    (model.model() == "lambert").then(|| colour(model, "kd"))?
}

/// A rough conductor without a diffuse part.
fn is_bare_conductor(model: &dyn AnalyticBrdf) -> bool {
    model.model() == "ggx-conductor" && is(model, "kd", 0.0)
}

/// A metal of GGX facets with Schlick's reflectance and nothing else, which several models can be.
struct Metal {
    base_color: Rgb,
    /// The square root of alpha.
    roughness: f64,
}

impl Metal {
    fn of(model: &dyn AnalyticBrdf) -> Option<Self> {
        let untinted = || is(model, "specular_weight", 1.0) && is(model, "specular_color", 1.0);
        let (colour_field, roughness) = match model.model() {
            "ggx" if is(model, "kd", 0.0) => ("f0", field(model, "alpha").first()?.sqrt()),
            "principled" if is(model, "metallic", 1.0) && is(model, "clearcoat", 0.0) => {
                ("base_color", *field(model, "roughness").first()?)
            }
            "openpbr-metal" if untinted() => ("base_color", *field(model, "specular_roughness").first()?),
            "openpbr" if untinted() && is(model, "base_metalness", 1.0) => {
                ("base_color", *field(model, "specular_roughness").first()?)
            }
            _ => return None,
        };
        Some(Self { base_color: colour(model, colour_field)?, roughness })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::{Ggx, GgxConductor, Lambert};
    use crate::io::silent;
    use crate::math::coordinates::standard_directions;
    use crate::metric::registry::Registry;

    fn translated(model: &dyn AnalyticBrdf, renderer: Renderer) -> Translation {
        let registry = Registry::standard().unwrap();
        let loss = registry.get("D4.Cl").unwrap();
        let mut found = translate(model, renderer, &*loss, &Interrupt::new(), &silent).unwrap();
        found.judge(model, &*loss).unwrap();
        found
    }

    #[test]
    fn an_exact_counterpart_has_the_values_of_the_fit() {
        let metal = Ggx { kd: [0.0; 3], f0: [0.9, 0.6, 0.3], alpha: 0.1 };
        let conductor = GgxConductor { kd: [0.0; 3], eta: [0.2, 0.9, 1.1], k: [3.9, 2.4, 2.2], alpha: 0.2 };
        let paint = Lambert { kd: [0.6, 0.3, 0.1] };
        let cases: [(&dyn AnalyticBrdf, Renderer, &str); 8] = [
            (&metal, Renderer::Mitsuba, "principled"),
            (&metal, Renderer::MaterialX, "openpbr-metal"),
            (&conductor, Renderer::Mitsuba, "ggx-conductor"),
            (&paint, Renderer::Mitsuba, "lambert"),
            (&paint, Renderer::Pbrt, "lambert"),
            (&paint, Renderer::MaterialX, "openpbr-dielectric"),
            (&paint, Renderer::Gltf, "gltf"),
            (
                &OpenPbrMetal {
                    base_color: [0.5; 3],
                    specular_weight: 1.0,
                    specular_color: [1.0; 3],
                    specular_roughness: 0.3,
                },
                Renderer::Mitsuba,
                "principled",
            ),
        ];
        for (model, renderer, expected) in cases {
            let found = translated(model, renderer);
            assert!(found.exact && found.model.model() == expected, "{renderer}: {}", found.model.model());
            for (ti, to, phi) in [(0.1, 0.1, 3.1), (0.6, 0.7, 3.0), (1.2, 0.3, 1.0)] {
                let (wi, wo) = standard_directions(ti, to, phi);
                for (a, b) in model.value(wi, wo).into_iter().zip(found.model.value(wi, wo)) {
                    assert!((a - b).abs() <= 1e-6 * a.abs(), "{} for {renderer}: {a} {b}", model.model());
                }
            }
            assert!(found.costs[0].distance < 1e-5, "{renderer}: {}", found.costs[0].distance);
        }
    }

    /// What has no counterpart is fitted: the cost is what is left, and far below that of a grey. Every renderer is looked at in the
    /// tests of the Python package, where the search has gradients.
    #[test]
    fn the_nearest_material_says_what_it_costs() {
        let plastic = Ggx { kd: [0.05, 0.3, 0.1], f0: [0.04; 3], alpha: 0.15 };
        let grey = Lambert { kd: [0.2; 3] };
        let found = translated(&plastic, Renderer::Gltf);
        let mut worse = Translation { model: Arc::new(grey), costs: Vec::new(), ..found.clone() };
        worse.judge(&plastic, &*Registry::standard().unwrap().get("D4.Cl").unwrap()).unwrap();
        let (cost, of_grey) = (found.costs[0].distance, worse.costs[0].distance);
        assert!(!found.exact && cost > 0.0 && cost < 0.5 * of_grey, "{cost} {of_grey}");
        let export = found.export("a.gltf");
        let again: Export = serde_json::from_str(&serde_json::to_string(&export).unwrap()).unwrap();
        assert_eq!(again, export);
    }

    #[test]
    fn renderers_have_names() {
        for renderer in Renderer::ALL {
            assert_eq!(renderer.name().parse::<Renderer>().unwrap(), renderer);
        }
        let message = "mitsubishi".parse::<Renderer>().unwrap_err().to_string();
        assert!(message.contains("mitsuba, pbrt, materialx, gltf"), "{message}");
    }
}
