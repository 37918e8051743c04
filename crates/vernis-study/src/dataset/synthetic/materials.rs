//! The references of the embedded study.
//!
//! Their parameters are chosen by hand to spread over what surfaces look like, from chalk to chrome; none is a
//! measurement. No reference is a single lobe of a model that a candidate uses.

use super::reflectance::{Coat, Distribution, Lobe, Material, Retro, Sheen};
use Distribution::{Beckmann, Ggx, LongTail};
use vernis_metric::math::Rgb;

/// A named reference.
#[derive(Debug, Clone)]
pub struct NamedMaterial {
    pub name: &'static str,
    /// Sisters share a group.
    pub group: &'static str,
    pub metal: bool,
    pub material: Material,
}

fn lobe(distribution: Distribution, alpha: f64, f0: Rgb, weight: f64) -> Lobe {
    Lobe { distribution, alpha, f0, fresnel: 1.0, weight }
}

fn bare(kd: Rgb, sigma: f64, lobes: Vec<Lobe>) -> Material {
    Material { kd, sigma, lobes, sheen: None, retro: None, coat: None }
}

/// Reflectance at normal incidence of common dielectrics.
const GLASSY: Rgb = [0.04; 3];

/// A rough body under a weak, wide gloss.
fn matte(kd: Rgb, sigma: f64, alpha: f64) -> Material {
    bare(kd, sigma, vec![lobe(Beckmann, alpha, [0.03; 3], 0.8)])
}

/// A coloured body with a gloss of two widths: a sharp one, and the haze of a surface that is not quite clean.
fn plastic(kd: Rgb, alpha: f64, haze: f64) -> Material {
    bare(kd, 0.1, vec![lobe(Ggx, alpha, GLASSY, 1.0 - haze), lobe(LongTail, (3.0 * alpha).min(0.6), GLASSY, haze)])
}

/// Cloth: a rough body, fibres that catch the light at grazing angles, a little retroreflection.
fn cloth(kd: Rgb, sheen: Rgb, width: f64, retro: f64) -> Material {
    Material {
        sheen: Some(Sheen { colour: sheen, width }),
        retro: Some(Retro { colour: kd.map(|k| k * retro), exponent: 12.0 }),
        ..bare(kd.map(|k| k * (1.0 - retro)), 0.5, vec![lobe(Beckmann, 0.55, [0.04; 3], 0.5)])
    }
}

/// A coloured base under a clear or absorbing coat.
fn lacquer(base: Material, alpha: f64, absorption: Rgb) -> Material {
    Material { coat: Some(Coat { alpha, f0: 0.04, fresnel: 1.0, absorption }), ..base }
}

/// A metal: coloured peak and a haze.
fn metal(f0: Rgb, distribution: Distribution, alpha: f64, haze: f64) -> Material {
    let wide = (4.0 * alpha).min(0.7);
    bare([0.0; 3], 0.0, vec![lobe(distribution, alpha, f0, 0.95 - haze), lobe(LongTail, wide, f0, haze)])
}

/// Flakes in a coloured binder under a coat: two metallic widths over a dim body.
fn flakes(kd: Rgb, f0: Rgb, alpha: f64, coat: f64) -> Material {
    let base = bare(kd, 0.2, vec![lobe(Beckmann, alpha, f0, 0.6), lobe(Ggx, (2.0 * alpha).min(0.7), f0, 0.3)]);
    lacquer(base, coat, [0.0; 3])
}

/// The references, in a fixed order.
pub fn all() -> Vec<NamedMaterial> {
    let dielectrics = matte_and_plastic().into_iter().chain(cloths_and_coats());
    let named = |metal| move |(name, group, material)| NamedMaterial { name, group, metal, material };
    dielectrics.map(named(false)).chain(metals().into_iter().map(named(true))).collect()
}

type Entry = (&'static str, &'static str, Material);

fn matte_and_plastic() -> Vec<Entry> {
    vec![
        ("chalk", "chalk", matte([0.82, 0.81, 0.78], 0.45, 0.5)),
        ("brick", "brick", matte([0.42, 0.16, 0.10], 0.6, 0.45)),
        ("slate", "slate", matte([0.10, 0.11, 0.13], 0.3, 0.28)),
        ("moss", "moss", matte([0.13, 0.22, 0.05], 0.8, 0.6)),
        ("paper", "paper", matte([0.74, 0.73, 0.68], 0.2, 0.35)),
        ("soot", "soot", matte([0.018, 0.018, 0.02], 0.5, 0.5)),
        ("rubber", "rubber", plastic([0.025, 0.025, 0.027], 0.28, 0.35)),
        ("plastic-red", "plastic-red", plastic([0.48, 0.03, 0.03], 0.07, 0.15)),
        ("plastic-green", "plastic-green", plastic([0.05, 0.35, 0.10], 0.14, 0.3)),
        ("plastic-white", "plastic-white", plastic([0.78, 0.78, 0.80], 0.05, 0.1)),
        ("plastic-black", "plastic-black", plastic([0.012, 0.012, 0.012], 0.04, 0.12)),
        ("plastic-yellow", "plastic-yellow", plastic([0.70, 0.52, 0.03], 0.2, 0.4)),
        ("acrylic-violet", "acrylic-violet", plastic([0.16, 0.04, 0.32], 0.03, 0.05)),
        ("porcelain", "porcelain", plastic([0.72, 0.70, 0.64], 0.025, 0.08)),
    ]
}

fn cloths_and_coats() -> Vec<Entry> {
    let body = |kd: Rgb, sigma: f64| matte(kd, sigma, 0.4);
    let walnut = bare([0.22, 0.11, 0.05], 0.3, vec![lobe(Beckmann, 0.25, [0.10, 0.06, 0.03], 0.7)]);
    let pearl = bare(
        [0.5, 0.47, 0.45],
        0.2,
        vec![lobe(Beckmann, 0.18, [0.16, 0.10, 0.13], 0.8), lobe(LongTail, 0.4, [0.06, 0.10, 0.12], 0.6)],
    );
    let sign = Material {
        retro: Some(Retro { colour: [0.40, 0.32, 0.05], exponent: 60.0 }),
        ..plastic([0.30, 0.22, 0.02], 0.08, 0.2)
    };
    vec![
        ("linen", "linen", cloth([0.55, 0.50, 0.40], [0.10, 0.10, 0.09], 0.5, 0.1)),
        ("velvet", "velvet", cloth([0.16, 0.01, 0.02], [0.45, 0.08, 0.10], 0.22, 0.25)),
        ("denim", "denim", cloth([0.05, 0.09, 0.20], [0.10, 0.12, 0.16], 0.4, 0.1)),
        ("peach", "peach", cloth([0.62, 0.32, 0.20], [0.28, 0.22, 0.18], 0.3, 0.2)),
        ("lacquer-red", "lacquer-red", lacquer(body([0.45, 0.05, 0.03], 0.2), 0.02, [0.0, 0.05, 0.08])),
        ("lacquer-black", "lacquer-black", lacquer(body([0.02, 0.02, 0.02], 0.1), 0.03, [0.0; 3])),
        ("amber-varnish", "amber-varnish", lacquer(body([0.60, 0.50, 0.38], 0.3), 0.06, [0.05, 0.25, 0.70])),
        ("walnut", "walnut", lacquer(walnut, 0.2, [0.02, 0.06, 0.12])),
        ("ivory", "ivory", lacquer(body([0.70, 0.64, 0.50], 0.15), 0.1, [0.0, 0.02, 0.06])),
        ("pearl", "pearl", lacquer(pearl, 0.05, [0.0; 3])),
        ("road-sign", "road-sign", sign),
    ]
}

fn metals() -> Vec<Entry> {
    let (gold, copper, silver) = ([1.0, 0.71, 0.29], [0.95, 0.64, 0.54], [0.96, 0.94, 0.90]);
    let (steel, titanium) = ([0.56, 0.57, 0.58], [0.54, 0.50, 0.45]);
    let foil = lacquer(metal(silver, Ggx, 0.15, 0.2), 0.03, [0.10, 0.30, 0.80]);
    vec![
        ("gold-polished", "gold", metal(gold, Ggx, 0.05, 0.08)),
        ("gold-brushed", "gold", metal(gold, Beckmann, 0.22, 0.25)),
        ("copper", "copper", metal(copper, Ggx, 0.12, 0.2)),
        ("silver", "silver", metal(silver, Beckmann, 0.06, 0.15)),
        ("chrome", "chrome", metal([0.55, 0.556, 0.554], Ggx, 0.02, 0.03)),
        ("steel-ground", "steel", metal(steel, LongTail, 0.16, 0.2)),
        (
            "steel-greased",
            "steel-greased",
            lacquer(metal(steel.map(|c| 0.7 * c), Ggx, 0.2, 0.2), 0.05, [0.1, 0.12, 0.2]),
        ),
        ("titanium", "titanium", metal(titanium, Beckmann, 0.15, 0.2)),
        ("aluminium-cast", "aluminium-cast", metal([0.80, 0.81, 0.82], Ggx, 0.4, 0.3)),
        (
            "bronze-aged",
            "bronze-aged",
            Material { kd: [0.05, 0.07, 0.05], ..metal([0.45, 0.33, 0.18], LongTail, 0.2, 0.3) },
        ),
        ("paint-blue", "paint-blue", flakes([0.01, 0.02, 0.08], [0.10, 0.20, 0.55], 0.2, 0.03)),
        ("paint-blue-light", "paint-blue", flakes([0.03, 0.05, 0.14], [0.18, 0.32, 0.65], 0.25, 0.03)),
        ("paint-green", "paint-green", flakes([0.01, 0.06, 0.02], [0.15, 0.45, 0.20], 0.16, 0.05)),
        ("paint-gold", "paint-gold", flakes([0.12, 0.08, 0.02], [0.70, 0.50, 0.20], 0.3, 0.08)),
        ("foil-orange", "foil-orange", foil),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn names_are_unique_and_groups_many() {
        let all = all();
        assert_eq!(all.len(), 40);
        assert_eq!(all.iter().map(|m| m.name).collect::<BTreeSet<_>>().len(), all.len());
        assert_eq!(all.iter().map(|m| m.group).collect::<BTreeSet<_>>().len(), 38);
        assert!(all.iter().filter(|m| m.metal).count() >= 12);
    }
}
