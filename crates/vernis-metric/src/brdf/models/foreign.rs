//! Parameters and models of other programs: what they are called here, and how to convert them.
//!
//! | there | here |
//! | --- | --- |
//! | `roughness` of Disney, glTF, Unreal | alpha = roughness^2 |
//! | `ior` n | f0 = ((n - 1) / (n + 1))^2 |
//! | `ior` n and `k` of a conductor | f0 = ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2) |
//! | `baseColor`, `metallic` | kd = baseColor (1 - metallic), f0 = 0.04 (1 - metallic) + baseColor metallic |
//! | `specular` of Disney | f0 = 0.08 specular |
//! | exponent n of Blinn-Phong | alpha = sqrt(2 / (n + 2)) |
//!
//! Sources: Burley 2012, *Physically Based Shading at Disney*; the glTF 2.0 specification, appendix B; Walter et al. 2007,
//! doi:10.2312/EGWR/EGSR07/195-206, section 5.2.

/// The model of another program called `name`, in a sentence for a message.
pub(crate) fn model(name: &str) -> Option<String> {
    let sentence = match plain(name).as_str() {
        "disney" | "disneybrdf" | "disneyprincipled" | "principledbsdf" => {
            "it is called principled here, with the parameters of Mitsuba"
        }
        "pbr" | "gltfpbr" | "metallicroughness" | "unreal" | "ue4" => {
            "it is called gltf here: colour, metalness, roughness"
        }
        "standard" | "standardsurface" | "openpbrsurface" | "uber" => {
            "the nearest is openpbr, the base of OpenPBR Surface"
        }
        "diffuse" | "matte" | "lambertian" => "it is called lambert here",
        "phong" => "the nearest is blinn-phong, whose exponent n is about 4 times that of phong",
        "trowbridgereitz" | "tr" | "gtr" | "gtr2" => "it is called ggx here",
        "torrancesparrow" | "microfacet" => "it is ggx or beckmann here, by the distribution of facets",
        "conductor" | "roughconductor" | "metal" => "it is ggx-conductor or beckmann-conductor here",
        "plastic" | "roughplastic" | "coateddiffuse" => {
            "the nearest are ggx-dielectric and openpbr-dielectric, a lobe over a diffuse base"
        }
        "dielectric" | "roughdielectric" => "the nearest for reflection is ggx-dielectric; vernis has no transmission",
        "orennayar" | "roughdiffuse" | "eon" => {
            "it is openpbr-dielectric with specular_weight 0 here, and base_diffuse_roughness is its roughness"
        }
        "wardanisotropic" | "substrate" | "ashikhminshirleyanisotropic" => {
            "vernis has isotropic models only, among them ward and ashikhmin-shirley"
        }
        _ => return None,
    };
    Some(sentence.to_owned())
}

/// The parameter of another program called `name`, for a model with `fields`, in a sentence for a message.
pub(crate) fn parameter(name: &str, fields: &[String]) -> Option<String> {
    // The terms of a sum carry their number.
    let (term, own) = match name.split_once('.') {
        Some((number, rest)) if number.parse::<u32>().is_ok() => (format!("{number}."), rest),
        _ => (String::new(), name),
    };
    let field = |wanted: &str| {
        let numbered =
            |f: &&String| f.split_once('.').is_some_and(|(n, rest)| n.parse::<u32>().is_ok() && rest == wanted);
        let exact = format!("{term}{wanted}");
        fields.iter().find(|f| **f == exact).or_else(|| fields.iter().find(numbered)).map(String::as_str)
    };
    let first = |choices: &[(&str, &str)]| {
        choices.iter().find_map(|(wanted, formula)| Some(format!("{} = {formula}", field(wanted)?)))
    };
    let sentence = match plain(own).as_str() {
        "roughness" | "rough" | "roughnessfactor" | "specularroughness" => first(&[
            ("alpha", "roughness^2 for the roughness of Disney, glTF or Unreal"),
            ("m", "roughness^2 for the roughness of Disney, glTF or Unreal"),
            ("n", "2 / roughness^4 - 2 for the roughness of Disney, glTF or Unreal"),
        ]),
        "glossiness" | "gloss" | "smoothness" => {
            first(&[("alpha", "(1 - glossiness)^2"), ("m", "(1 - glossiness)^2"), ("n", "2 / (1 - glossiness)^4 - 2")])
        }
        "shininess" | "exponent" | "sharpness" | "phongexponent" | "specularexponent" | "ns" => first(&[
            ("n", "the exponent of the half vector"),
            ("alpha", "sqrt(2 / (n + 2)) for an exponent n of Blinn-Phong"),
            ("m", "sqrt(2 / (n + 2)) for an exponent n of Blinn-Phong"),
        ]),
        "alphax" | "alphay" | "alphau" | "alphav" | "anisotropy" | "anisotropic" | "ax" | "ay" => {
            Some(match field("alpha") {
                Some(alpha) => format!("vernis has isotropic models, with one {alpha}"),
                None => "vernis has isotropic models".to_owned(),
            })
        }
        "ior" | "n" | "intior" | "indexofrefraction" | "refractiveindex" => first(&[
            ("eta", "the index of refraction"),
            (
                "f0",
                "((n - 1) / (n + 1))^2 for an index of refraction n, and ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2) for a metal",
            ),
        ]),
        "k" | "kappa" | "extinction" | "absorption" => {
            first(&[("f0", "((n - 1)^2 + k^2) / ((n + 1)^2 + k^2) for an index of refraction n - ik")])
        }
        "f0" | "fresnel" | "fresnel0" | "reflectivity" | "schlick" => first(&[
            ("f0", "the reflectance at normal incidence"),
            ("eta", "(1 + sqrt(f0)) / (1 - sqrt(f0))"),
            ("ks", "the specular albedo"),
        ]),
        "specular" | "specularfactor" | "specularlevel" => first(&[
            (
                "f0",
                "0.08 specular for the specular of Disney, or the colour of the specular reflection at normal incidence",
            ),
            ("ks", "the specular albedo, three linear numbers"),
        ]),
        "specularcolor" | "specularalbedo" | "specularreflectance" | "ks" | "rhos" => {
            first(&[("ks", "the specular albedo"), ("f0", "the reflectance at normal incidence, three linear numbers")])
        }
        "basecolor" | "basecolorfactor" | "metallic" | "metalness" | "metallicfactor" => {
            match (field("kd"), field("f0")) {
                (Some(kd), Some(f0)) => Some(format!(
                    "{kd} = baseColor (1 - metallic) and {f0} = 0.04 (1 - metallic) + baseColor metallic, with a linear baseColor"
                )),
                (Some(kd), None) => Some(format!("{kd} = baseColor (1 - metallic), with a linear baseColor")),
                _ => None,
            }
        }
        "diffuse" | "color" | "colour" | "albedo" | "diffusecolor" | "diffusealbedo" | "diffusereflectance"
        | "reflectance" | "rhod" | "rho" | "kdiffuse" => first(&[("kd", "the diffuse albedo, three linear numbers")]),
        "sheen" | "sheentint" | "clearcoat" | "clearcoatgloss" | "flatness" | "spectint" => {
            Some("of the models, principled alone has it".to_owned())
        }
        "coat" | "subsurface" | "transmission" | "spectrans" | "emission" | "opacity" | "normal" | "thinfilm" => {
            Some("vernis has no model with it".to_owned())
        }
        _ => None,
    };
    // A name of ours, misspelt in case or underscores only, is the business of the nearest names.
    sentence.filter(|_| !fields.iter().any(|f| plain(f) == plain(name)))
}

/// Without case and punctuation: `base_color` is `baseColor`.
fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::{MODELS, schema};
    use crate::io::nearest;

    #[test]
    fn names_of_other_programs_are_converted() {
        let ggx = ["kd", "f0", "alpha"].map(str::to_owned);
        let hint = |name: &str| parameter(name, &ggx).expect(name);
        assert!(hint("roughness").starts_with("alpha = roughness^2"));
        assert!(hint("ior").starts_with("f0 = ((n - 1) / (n + 1))^2"));
        assert!(hint("base_color").contains("kd = baseColor (1 - metallic)"));
        assert!(hint("Metallic").contains("f0 = 0.04"));
        assert!(hint("specular").starts_with("f0 = 0.08 specular"));
        assert!(hint("diffuse").starts_with("kd = "));
        let blinn = ["kd", "ks", "n"].map(str::to_owned);
        assert!(parameter("roughness", &blinn).expect("known").starts_with("n = 2 / roughness^4"));
        let sum = ["1.kd", "1.f0", "1.alpha", "2.ks", "2.alpha"].map(str::to_owned);
        assert!(parameter("2.roughness", &sum).expect("known").starts_with("2.alpha = "));
        assert!(parameter("roughness", &sum).expect("known").starts_with("1.alpha = "));
        // Misspelt names of ours have nearest names.
        for own in ["alhpa", "alfa", "Kd", "eta", "eta_", "F0"] {
            assert_eq!(parameter(own, &["kd", "f0", "alpha", "eta"].map(str::to_owned)), None, "{own}");
        }
    }

    #[test]
    fn models_of_other_programs_are_not_like_ours() {
        for name in ["disney", "unreal", "standard", "oren-nayar", "microfacet", "torrance-sparrow", "plastic"] {
            assert!(model(name).is_some(), "{name}");
            assert!(nearest(name, MODELS).is_empty(), "{name}: {:?}", nearest(name, MODELS));
        }
        for name in MODELS {
            assert_eq!(model(name), None);
            assert!(schema(name).is_ok());
        }
    }
}
