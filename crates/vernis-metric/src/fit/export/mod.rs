//! From a fit to a renderer: the material that looks like it there, and what the translation costs.
//!
//! A renderer has few models. Where it has the fitted one, [`translate`] gives its exact counterpart; where it has not, the nearest
//! material: the renderer's most flexible model, fitted to the fit. [`Translation::costs`] says how far that is from the fit.
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
use crate::metric::learned::FAMILY;
use crate::metric::registry::Registry;
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
    /// What it costs, metric by metric.
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

/// The metrics that a translation is usually told in: that of the fit, the one to fit with, and the one that predicts what people would
/// say, each once.
///
/// # Errors
/// Those of the registry.
pub fn usual_metrics(of_fit: Arc<dyn Metric>, registry: &Registry) -> Result<Vec<Arc<dyn Metric>>, FitError> {
    let mut metrics = vec![of_fit];
    for name in ["vernis-loss", "vernis"] {
        if metrics.iter().all(|metric| metric.name() != name) {
            metrics.push(registry.get(name)?);
        }
    }
    Ok(metrics)
}

/// The material of `renderer` for `model`: the exact counterpart, or the nearest under the first of `metrics` that was learned, whose
/// gradients make the search short. What it costs is told in each of them.
///
/// An interrupted search gives the best material so far.
///
/// # Errors
/// [`FitError::Setting`] where no metric was learned and one is needed; those of [`Fitting::run`] and of the metrics.
pub fn translate(
    model: &dyn AnalyticBrdf,
    renderer: Renderer,
    metrics: &[Arc<dyn Metric>],
    interrupt: &Interrupt,
    observer: Observer<'_>,
) -> Result<Translation, FitError> {
    let (material, exact) = match counterpart(renderer, model)? {
        Some(material) => (material, true),
        None => {
            let learned = metrics.iter().find(|metric| metric.properties().family == FAMILY);
            let loss = learned.ok_or_else(|| FitError::Setting {
                what: "metrics",
                found: metrics.iter().map(|metric| metric.name()).collect::<Vec<_>>().join(", "),
                allowed: "some of which one was learned, such as vernis-loss".to_owned(),
            })?;
            let fitting =
                Fitting { interrupt: interrupt.clone(), ..Fitting::new(nearest_model(renderer, model), &**loss) };
            (fitting.run(model, observer)?.model, false)
        }
    };
    let cost = |metric: &Arc<dyn Metric>| {
        let measured = metric.prepare(model)?.measure(&*material)?;
        Ok(Cost { metric: MetricUsed::of(&**metric), distance: measured.value, score: measured.score })
    };
    let costs = metrics.iter().map(cost).collect::<Result<_, FitError>>()?;
    Ok(Translation { renderer, model: material, exact, costs })
}

impl Translation {
    /// The file of the renderer; `what` says in a line what it stands for, and is a comment beside what the translation costs.
    pub fn text(&self, what: &str) -> String {
        let costs = format!("{}; the translation costs: {}", self.kind(), self.costs_in_words());
        write::text(self.renderer, &*self.model, &[what.to_owned(), costs])
    }

    /// Whether it is exact, in words: `the same formula (ggx-conductor)` or `the nearest principled`.
    pub fn kind(&self) -> String {
        let model = self.model.model();
        if self.exact { format!("the same formula ({model})") } else { format!("the nearest {model}") }
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

    fn translated(model: &dyn AnalyticBrdf, renderer: Renderer) -> Translation {
        let registry = Registry::standard().unwrap();
        let metrics = usual_metrics(registry.get("D4.Cl").unwrap(), &registry).unwrap();
        assert_eq!(metrics.iter().map(|m| m.name()).collect::<Vec<_>>(), ["D4.Cl", "vernis-loss", "vernis"]);
        translate(model, renderer, &metrics, &Interrupt::new(), &silent).unwrap()
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
    /// tests of the Python package.
    #[test]
    fn the_nearest_material_says_what_it_costs() {
        let plastic = Ggx { kd: [0.05, 0.3, 0.1], f0: [0.04; 3], alpha: 0.15 };
        let found = translated(&plastic, Renderer::Gltf);
        let registry = Registry::standard().unwrap();
        for cost in &found.costs {
            let grey = registry.get(&cost.metric.name).unwrap().distance(&plastic, &Lambert { kd: [0.2; 3] }).unwrap();
            assert!(cost.distance < 0.5 * grey, "{}: {} {grey}", cost.metric.name, cost.distance);
            assert_eq!(cost.score.is_some(), cost.metric.name != "D4.Cl");
        }
        assert!(!found.exact && found.costs[0].distance > 0.0);
        let export = found.export("a.gltf");
        let again: Export = serde_json::from_str(&serde_json::to_string(&export).unwrap()).unwrap();
        assert_eq!(again, export);
        // Without a learned metric there is nothing to search under.
        let d4 = [registry.get("D4.Cl").unwrap()];
        let refused = translate(&plastic, Renderer::Gltf, &d4, &Interrupt::new(), &silent).err().unwrap().to_string();
        assert!(refused.contains("metrics is D4.Cl; it must be some of which one was learned"), "{refused}");
        assert!(translate(&Lambert { kd: [0.2; 3] }, Renderer::Gltf, &d4, &Interrupt::new(), &silent).unwrap().exact);
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
