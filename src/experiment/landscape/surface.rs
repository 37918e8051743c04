//! The materials of the experiment, and how one parameter changes each of them.
//!
//! f = kd/pi + ks ((1 - w) S(alpha) + w S(alpha_2)), S the specular part of `ggx` with the reflectance f0.
//!
//! kd: diffuse albedo; f0: reflectance at normal incidence; both linear RGB. ks: a factor of both lobes; alpha, alpha_2: their
//! roughness; w: the weight of the second lobe, 0 to 1. All are dimensionless. With ks = 1 and w = 0 it is the model `ggx`.
//!
//! # The range in which people rated
//!
//! Candidates of `lavoue2021-open` are published fits. Over its materials, from the 5th to the 95th percentile:
//!
//! | what | of which fits | range | median |
//! | --- | --- | --- | --- |
//! | alpha of GGX | retro-reflection of the 100 references (Dupuy et al. 2015) | 0.04 to 0.58 | 0.48 |
//! | alpha of Ward | `ngan_ward.fit` | 0.007 to 0.50 | 0.07 |
//! | roughness of Cook-Torrance | `low_cooktorrance_E1.fit` | 0.005 to 0.71 | 0.04 |
//! | largest channel of the diffuse albedo | `bagher_sgd.fit`, `ngan_ward.fit` | 0.005 to 0.32 | 0.09 |
//! | largest channel of the specular albedo | `ngan_cooktorrance.fit` | 0.01 to 0.31, at most 0.98 | 0.10 |
//!
//! Few fits have a lobe sharper than the NBRDF references can hold, so that the range of alpha begins at 0.02. The colours of an
//! approximation seldom turn by more than some 60 degrees. No fit says how large a second lobe may be: half of the specular part is
//! our choice, and so is the whole line from diffuse to specular.

use std::f64::consts::FRAC_1_PI;
use vernis_metric::brdf::Brdf;
use vernis_metric::brdf::models::{AnalyticBrdf, Ggx};
use vernis_metric::math::color::rgb_of_cielab;
use vernis_metric::math::{Rgb, Vec3};

/// A surface of the experiment; the symbols are those of the file's formula.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Diffuse albedo.
    pub kd: Rgb,
    /// Reflectance at normal incidence.
    pub f0: Rgb,
    /// Factor of both lobes.
    pub ks: f64,
    /// Roughness of the first lobe.
    pub alpha: f64,
    /// Weight of the second lobe.
    pub second: f64,
    /// Roughness of the second lobe.
    pub second_alpha: f64,
}

impl Surface {
    /// A surface with one lobe.
    pub const fn ggx(kd: Rgb, f0: Rgb, alpha: f64) -> Self {
        Self { kd, f0, ks: 1.0, alpha, second: 0.0, second_alpha: alpha }
    }

    /// The surface of a parameter vector of the model `ggx`: kd, f0, alpha.
    pub fn of_ggx_parameters(p: &[f64; 7]) -> Self {
        Self::ggx([p[0], p[1], p[2]], [p[3], p[4], p[5]], p[6])
    }

    fn lobe(&self, alpha: f64, wi: Vec3, wo: Vec3) -> Rgb {
        Ggx { kd: [0.0; 3], f0: self.f0, alpha }.value(wi, wo)
    }
}

impl Brdf for Surface {
    fn is_mirror_symmetric(&self) -> bool {
        true
    }

    fn is_reciprocal(&self) -> bool {
        true
    }

    fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return Some([0.0; 3]);
        }
        let (first, w) = (self.lobe(self.alpha, wi, wo), self.second);
        let second = if w > 0.0 { self.lobe(self.second_alpha, wi, wo) } else { [0.0; 3] };
        Some(std::array::from_fn(|c| self.kd[c] * FRAC_1_PI + self.ks * ((1.0 - w) * first[c] + w * second[c])))
    }
}

/// Which part of a surface carries its colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Coloured {
    Diffuse,
    Specular,
}

/// A material of the experiment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// `plastic`, `metal` or `fabric`.
    pub name: &'static str,
    /// CIELAB L*, chroma C* and hue (degrees) of what is coloured.
    colour: [f64; 3],
    coloured: Coloured,
    alpha: f64,
    second_alpha: f64,
}

/// Grey reflectance of the surface of a plastic and of fibres, of an index of refraction of 1.5.
const DIELECTRIC_F0: f64 = 0.04;
/// Diffuse albedo of a metal without its lobe, as a share of its f0: the far end of its mixing.
const OXIDE: f64 = 0.5;

/// A blue plastic, a metal like brass, and a red fabric, each in the middle of what people rated.
///
/// Chromas are so small that every hue lies within the gamut of the primaries.
pub const MATERIALS: [Material; 3] = [
    Material {
        name: "plastic",
        colour: [38.0, 18.0, 270.0],
        coloured: Coloured::Diffuse,
        alpha: 0.1,
        second_alpha: 0.4,
    },
    Material {
        name: "metal",
        colour: [72.0, 25.0, 80.0],
        coloured: Coloured::Specular,
        alpha: 0.15,
        second_alpha: 0.45,
    },
    Material { name: "fabric", colour: [36.0, 18.0, 30.0], coloured: Coloured::Diffuse, alpha: 0.4, second_alpha: 0.1 },
];

/// What a sweep changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parameter {
    /// Roughness of the lobe.
    Alpha,
    /// Luminance of the diffuse albedo; for a metal, of its f0.
    Brightness,
    /// The share t of the specular part: kd (1 - t) + lobe t, with the material at its own t.
    Mixing,
    /// The weight w of a second lobe.
    SecondLobe,
    /// Turn of the colour in CIELAB, at one lightness and chroma, degrees.
    Hue,
}

/// The values along a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Where the material itself is.
    pub reference: f64,
    /// Smallest and largest value within what people rated.
    pub rated: (f64, f64),
    /// Smallest and largest value of a sweep.
    pub whole: (f64, f64),
    /// Smallest and largest value of a landscape.
    pub near: (f64, f64),
    /// Whether equal steps are equal ratios.
    pub logarithmic: bool,
}

impl Parameter {
    /// In the order of tables and figures.
    pub const ALL: [Self; 5] = [Self::Alpha, Self::Brightness, Self::Mixing, Self::SecondLobe, Self::Hue];

    /// The name of the parameter of `material`.
    pub fn name(self, material: &Material) -> &'static str {
        match (self, material.coloured) {
            (Self::Alpha, _) => "alpha",
            (Self::Brightness, Coloured::Diffuse) => "albedo",
            (Self::Brightness, Coloured::Specular) => "f0",
            (Self::Mixing, _) => "mixing",
            (Self::SecondLobe, _) => "second lobe",
            (Self::Hue, _) => "hue",
        }
    }

    /// The unit of its values.
    pub fn unit(self) -> &'static str {
        if self == Self::Hue { "deg" } else { "1" }
    }

    /// Reference and ranges for `material`.
    pub fn span(self, material: &Material) -> Span {
        let metal = material.coloured == Coloured::Specular;
        let span = |reference, rated, whole, near, logarithmic| Span { reference, rated, whole, near, logarithmic };
        match self {
            Self::Alpha => {
                let a = material.alpha;
                span(a, (0.02, 0.6), (0.002, 1.0), (a / 1.5, a * 1.5), true)
            }
            Self::Brightness => {
                let y = material.luminance();
                // The ends bring no channel of any of the three above 1.
                let (rated, whole) = if metal { ((0.1, 0.75), (0.01, 0.75)) } else { ((0.005, 0.32), (0.0005, 0.5)) };
                span(y, rated, whole, (y / 1.5, y * 1.5), true)
            }
            Self::Mixing if metal => span(1.0, (0.0, 1.0), (0.0, 1.0), (0.7, 1.0), false),
            Self::Mixing => span(0.5, (0.0, 1.0), (0.0, 1.0), (0.3, 0.7), false),
            Self::SecondLobe => span(0.0, (0.0, 0.5), (0.0, 1.0), (0.0, 0.3), false),
            Self::Hue => span(0.0, (-60.0, 60.0), (-180.0, 180.0), (-30.0, 30.0), false),
        }
    }
}

impl Material {
    /// The material itself.
    pub fn reference(&self) -> Surface {
        self.turned(0.0)
    }

    /// The material with `parameter` at `value`, of the unit that [`Parameter::unit`] says.
    pub fn with(&self, parameter: Parameter, value: f64) -> Surface {
        let own = self.reference();
        let span = parameter.span(self);
        match parameter {
            Parameter::Alpha => Surface { alpha: value, ..own },
            Parameter::Brightness => {
                let factor = value / span.reference;
                match self.coloured {
                    Coloured::Diffuse => Surface { kd: own.kd.map(|x| factor * x), ..own },
                    Coloured::Specular => Surface { f0: own.f0.map(|x| factor * x), ..own },
                }
            }
            Parameter::Mixing => {
                let kd = match self.coloured {
                    Coloured::Diffuse => own.kd.map(|x| x * (1.0 - value) / (1.0 - span.reference)),
                    Coloured::Specular => own.f0.map(|x| OXIDE * x * (1.0 - value)),
                };
                Surface { kd, ks: value / span.reference, ..own }
            }
            Parameter::SecondLobe => Surface { second: value, ..own },
            Parameter::Hue => self.turned(value),
        }
    }

    /// Luminance of what is coloured.
    fn luminance(&self) -> f64 {
        vernis_metric::math::color::luminance(self.colour_turned(0.0))
    }

    fn colour_turned(&self, degrees: f64) -> Rgb {
        let [lightness, chroma, hue] = self.colour;
        let (sin, cos) = (hue + degrees).to_radians().sin_cos();
        rgb_of_cielab([lightness, chroma * cos, chroma * sin])
    }

    fn turned(&self, degrees: f64) -> Surface {
        let colour = self.colour_turned(degrees);
        let (kd, f0) = match self.coloured {
            Coloured::Diffuse => (colour, [DIELECTRIC_F0; 3]),
            Coloured::Specular => ([0.0; 3], colour),
        };
        Surface { second_alpha: self.second_alpha, ..Surface::ggx(kd, f0, self.alpha) }
    }
}

impl Span {
    /// `count` values from the reference, which is not among them, to `end`, which is the last.
    pub(super) fn steps(&self, from: f64, end: f64, count: usize) -> impl Iterator<Item = f64> + '_ {
        (1..=count).map(move |i| {
            let t = i as f64 / count as f64;
            if i == count {
                end
            } else if self.logarithmic {
                from * (end / from).powf(t)
            } else {
                from + t * (end - from)
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vernis_metric::math::coordinates::standard_directions;

    /// No candidate reflects more than it receives by its colours, and none has a colour below zero.
    #[test]
    fn every_colour_of_every_sweep_lies_within_the_gamut() {
        for material in &MATERIALS {
            for parameter in Parameter::ALL {
                let span = parameter.span(material);
                let ends = [(span.reference, span.whole.0), (span.reference, span.whole.1)];
                for value in ends.into_iter().flat_map(|(from, end)| span.steps(from, end, 60)) {
                    let s = material.with(parameter, value);
                    for x in s.kd.iter().chain(&s.f0) {
                        let name = parameter.name(material);
                        assert!((0.0..=1.0).contains(x), "{} {name} {value}: {s:?}", material.name);
                    }
                    assert!((1e-3..=1.0).contains(&s.alpha) && (0.0..=1.0).contains(&s.second));
                }
                let inside = |(a, b): (f64, f64)| {
                    span.whole.0 <= a && a <= span.reference && span.reference <= b && b <= span.whole.1
                };
                assert!(inside(span.rated) && inside(span.near));
            }
        }
    }

    /// At the reference's own value each parameter leaves the material as it is.
    #[test]
    fn every_line_goes_through_the_material() {
        for material in &MATERIALS {
            for parameter in Parameter::ALL {
                let found = material.with(parameter, parameter.span(material).reference);
                assert_eq!(found, material.reference(), "{} {}", material.name, parameter.name(material));
            }
        }
    }

    #[test]
    fn a_surface_with_one_lobe_is_the_model_ggx() {
        let (kd, f0, alpha) = ([0.1, 0.2, 0.3], [0.04, 0.5, 0.9], 0.2);
        let (surface, model) = (Surface::ggx(kd, f0, alpha), Ggx { kd, f0, alpha });
        let halves = Surface { second: 0.5, ..surface };
        for (ti, to, phi) in [(0.0, 0.3, 0.0), (0.9, 0.4, 3.0), (1.2, 1.3, 2.0)] {
            let (wi, wo) = standard_directions(ti, to, phi);
            let expected = model.value(wi, wo);
            for found in [surface.eval(wi, wo).unwrap(), halves.eval(wi, wo).unwrap()] {
                for c in 0..3 {
                    assert!((found[c] / expected[c] - 1.0).abs() < 1e-14);
                }
            }
        }
    }
}
