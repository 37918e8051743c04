//! Materials as the files that renderers read.
//!
//! Numbers are written so that they read back as they were. Comments are one line each and hold nothing that ends a comment.

use super::{Renderer, by_name};
use crate::brdf::models::AnalyticBrdf;
use crate::io::one_line;
use serde_json::{Map, Value, json};

/// The name of the material in the file.
const NAME: &str = "vernis-material";
const GENERATOR: &str = concat!("vernis ", env!("CARGO_PKG_VERSION"));

/// The file of `renderer` for a model that it has.
pub(super) fn text(renderer: Renderer, model: &dyn AnalyticBrdf, notes: &[String]) -> String {
    let notes: Vec<String> = notes.iter().map(|note| one_line(note).into_owned()).collect();
    match renderer {
        Renderer::Mitsuba => mitsuba::xml(model, &notes),
        Renderer::Pbrt => pbrt(model, &notes),
        Renderer::MaterialX => materialx(model, &notes),
        Renderer::Gltf => gltf(model, &notes),
    }
}

/// A comment of XML, which may not hold two hyphens in a row.
fn xml_comment(notes: &[String]) -> String {
    let safe = |note: &String| note.replace("--", "- -").replace("--", "- -");
    notes.iter().map(|note| format!("<!-- {} -->\n", safe(note))).collect()
}

/// `a, b, c` of a colour, `a` of a number.
fn commas(value: &Value) -> String {
    match value {
        Value::Array(channels) => channels.iter().map(Value::to_string).collect::<Vec<_>>().join(", "),
        number => number.to_string(),
    }
}

pub(super) mod mitsuba {
    use super::*;

    /// The plugin of a model, and its parameters under the plugin's names.
    fn plugin(model: &dyn AnalyticBrdf) -> (&'static str, Map<String, Value>) {
        let mut p = by_name(model);
        match model.model() {
            "lambert" => ("diffuse", Map::from_iter([("reflectance".to_owned(), p["kd"].take())])),
            "ggx-conductor" => {
                p.remove("kd");
                p.insert("distribution".to_owned(), json!("ggx"));
                ("roughconductor", p)
            }
            // `principled` has the same names. Mitsuba drops the lobe of a metal where `specular` is 0.
            _ => {
                if p["specular"] == json!(0.0) && p["metallic"] != json!(0.0) {
                    p["specular"] = json!(1e-6);
                }
                ("principled", p)
            }
        }
    }

    /// As `mitsuba.load_dict` takes it.
    pub(in super::super) fn dictionary(model: &dyn AnalyticBrdf) -> Value {
        let (plugin, parameters) = plugin(model);
        let mut dictionary = Map::from_iter([("type".to_owned(), json!(plugin))]);
        for (name, value) in parameters {
            let value = if value.is_array() { json!({"type": "rgb", "value": value}) } else { value };
            dictionary.insert(name, value);
        }
        Value::Object(dictionary)
    }

    pub(in super::super) fn xml(model: &dyn AnalyticBrdf, notes: &[String]) -> String {
        let (plugin, parameters) = plugin(model);
        let mut text = xml_comment(notes);
        text += &format!("<bsdf version=\"3.0.0\" type=\"{plugin}\" id=\"{NAME}\">\n");
        for (name, value) in parameters {
            let (kind, value) = match &value {
                Value::String(s) => ("string", s.clone()),
                Value::Array(_) => ("rgb", commas(&value)),
                number => ("float", number.to_string()),
            };
            text += &format!("    <{kind} name=\"{name}\" value=\"{value}\"/>\n");
        }
        text + "</bsdf>\n"
    }
}

fn pbrt(model: &dyn AnalyticBrdf, notes: &[String]) -> String {
    let p = by_name(model);
    let rgb = |name: &str, field: &str| format!("\"rgb {name}\" [ {} ]", commas(&p[field]).replace(", ", " "));
    let roughness = |field: &str| format!("\"float roughness\" {} \"bool remaproughness\" false", p[field]);
    let material = |name: &str, kind: &str, rest: &[String]| {
        format!("MakeNamedMaterial \"{name}\" \"string type\" \"{kind}\"\n    {}\n", rest.join("\n    "))
    };
    let mut text: String = notes.iter().map(|note| format!("# {note}\n")).collect();
    text += &match model.model() {
        "lambert" => material(NAME, "diffuse", &[rgb("reflectance", "kd")]),
        "pbrt-conductor" => material(NAME, "conductor", &[rgb("eta", "eta"), rgb("k", "k"), roughness("alpha")]),
        // `pbrt-mix`
        _ => {
            let [diffuse, specular] = ["diffuse", "specular"].map(|part| format!("{NAME}-{part}"));
            material(&diffuse, "diffuse", &[rgb("reflectance", "reflectance")])
                + &material(&specular, "conductor", &[rgb("reflectance", "specular"), roughness("alpha")])
                + &material(
                    NAME,
                    "mix",
                    &[
                        format!("\"string materials\" [ \"{diffuse}\" \"{specular}\" ]"),
                        format!("\"float amount\" {}", p["amount"]),
                    ],
                )
        }
    };
    text
}

fn materialx(model: &dyn AnalyticBrdf, notes: &[String]) -> String {
    let mut p = by_name(model);
    if model.model() == "openpbr-metal" {
        p.insert("base_metalness".to_owned(), json!(1.0));
    }
    let mut text = "<?xml version=\"1.0\"?>\n".to_owned() + &xml_comment(notes);
    text += "<materialx version=\"1.39\" colorspace=\"lin_rec709\">\n";
    text += "  <open_pbr_surface name=\"vernis_surface\" type=\"surfaceshader\">\n";
    for (name, value) in &p {
        let kind = if value.is_array() { "color3" } else { "float" };
        text += &format!("    <input name=\"{name}\" type=\"{kind}\" value=\"{}\"/>\n", commas(value));
    }
    text += "  </open_pbr_surface>\n";
    text += "  <surfacematerial name=\"vernis_material\" type=\"material\">\n";
    text += "    <input name=\"surfaceshader\" type=\"surfaceshader\" nodename=\"vernis_surface\"/>\n";
    text + "  </surfacematerial>\n</materialx>\n"
}

fn gltf(model: &dyn AnalyticBrdf, notes: &[String]) -> String {
    let p = by_name(model);
    let mut colour: Vec<Value> = p["base_color"].as_array().cloned().unwrap_or_default();
    colour.push(json!(1.0));
    let file = json!({
        "asset": {"version": "2.0", "generator": GENERATOR},
        "extensionsUsed": ["KHR_materials_ior", "KHR_materials_specular"],
        "materials": [{
            "name": NAME,
            "pbrMetallicRoughness": {
                "baseColorFactor": colour,
                "metallicFactor": p["metallic"],
                "roughnessFactor": p["roughness"],
            },
            "extensions": {
                "KHR_materials_ior": {"ior": p["ior"]},
                "KHR_materials_specular": {"specularFactor": p["specular"]},
            },
            "extras": {"notes": notes},
        }],
    });
    format!("{file:#}\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::{Gltf, Lambert, PbrtMix, build, schema};

    fn start(id: &str) -> std::sync::Arc<dyn AnalyticBrdf> {
        let p: Vec<f64> = schema(id).unwrap().iter().map(|p| p.start).collect();
        build(id, &p).unwrap()
    }

    #[test]
    fn comments_cannot_end_early() {
        let notes = ["a ---> b\n<bsdf type=\"evil\"/>".to_owned()];
        for (renderer, model) in [(Renderer::Mitsuba, "principled"), (Renderer::MaterialX, "openpbr")] {
            let text = text(renderer, &*start(model), &notes);
            assert_eq!(text.matches("-->").count(), 1, "{text}");
            assert_eq!(text.lines().filter(|l| l.contains("evil")).count(), 1, "{text}");
            assert!(text.lines().find(|l| l.contains("evil")).unwrap().starts_with("<!--"), "{text}");
        }
        let pbrt = text(Renderer::Pbrt, &Lambert { kd: [0.5; 3] }, &notes);
        assert!(pbrt.lines().filter(|l| l.contains("evil")).all(|l| l.starts_with('#')), "{pbrt}");
    }

    #[test]
    fn numbers_read_back_as_they_were() {
        let third = 1.0 / 3.0;
        let model = Gltf { base_color: [third, 0.1, 0.2], metallic: third, roughness: 0.1, ior: 1.4, specular: 0.7 };
        let file: Value = serde_json::from_str(&text(Renderer::Gltf, &model, &[])).unwrap();
        let material = &file["materials"][0];
        assert_eq!(material["pbrMetallicRoughness"]["metallicFactor"].as_f64(), Some(third));
        assert_eq!(material["pbrMetallicRoughness"]["baseColorFactor"], json!([third, 0.1, 0.2, 1.0]));
        let mix = PbrtMix { reflectance: [third; 3], specular: [0.5; 3], amount: 0.25, alpha: 0.1 };
        let pbrt = text(Renderer::Pbrt, &mix, &[]);
        assert!(pbrt.contains("\"rgb reflectance\" [ 0.3333333333333333 0.3333333333333333"), "{pbrt}");
        assert!(pbrt.contains("\"float amount\" 0.25") && pbrt.contains("[ \"vernis-material-diffuse\""), "{pbrt}");
    }

    /// Mitsuba drops the specular lobe of a metal whose `specular` is 0; the model here does not.
    #[test]
    fn a_metal_keeps_its_lobe_in_mitsuba() {
        let p: Vec<f64> = schema("principled").unwrap().iter().map(|p| p.start).collect();
        let with = |metallic: f64| {
            let mut p = p.clone();
            (p[4], p[5]) = (metallic, 0.0);
            mitsuba::dictionary(&*build("principled", &p).unwrap())["specular"].clone()
        };
        assert_eq!((with(0.0), with(1.0)), (json!(0.0), json!(1e-6)));
    }
}
