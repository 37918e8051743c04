//! `.fit`: parameters published for the MERL materials, one line a material.
//!
//! `name = Aggregate(Lambertian(albedo = [r, g, b]), Model(key = value, ...))`, `#` starts a comment; the text form of the
//! fits that Dupuy's benchmark of BSDF models (bsdfbenchmark/bbm) collects from the papers.
//!
//! | in the file | model | source |
//! | --- | --- | --- |
//! | `NganWard`, `NganWardDuer`, `NganBlinnPhong`, `NganLafortune` | `ward`, `ward-duer`, `blinn-phong`, `lafortune` | Ngan et al. 2005, doi:10.2312/EGWR/EGSR05/117-126 |
//! | `NganCookTorrance`, `NganAshikhminShirley`, `NganHe` | `cook-torrance`, `ashikhmin-shirley`, `he` | the same |
//! | `LowCookTorrance`, `LowAshikhminShirley` | `cook-torrance-dielectric`, `ashikhmin-shirley-dielectric` | Loew et al. 2012 |
//! | `LowMicrofacetFit`, `LowSmooth` | `abc`, `abc-smooth` | Loew et al. 2012, doi:10.1145/2077341.2077350 |
//! | `Bagher` | `sgd` | Bagher et al. 2012, doi:10.1111/j.1467-8659.2012.03147.x |
//!
//! Ngan's albedos belong to data without MERL's channel factors, so they are multiplied by (1, 1.15, 1.66) here.

use super::merl::CHANNEL_FACTORS;
use crate::brdf::BrdfError;
use crate::brdf::models::{FieldError, NamedParameters};
use crate::io::{counted, nearest, read_at_most};
use std::collections::BTreeSet;
use std::path::Path;

/// Far more than the published files of 100 materials have.
const MOST_BYTES: u64 = 16 << 20;

/// How a model of the files maps to ours.
struct Mapping {
    name: &'static str,
    model: &'static str,
    /// Albedos lack MERL's channel factors.
    unscaled: bool,
    /// Ours and theirs.
    fields: &'static [(&'static str, &'static str)],
}

const MAPPINGS: [Mapping; 12] = [
    Mapping { name: "NganWard", model: "ward", unscaled: true, fields: &[("ks", "albedo"), ("alpha", "roughness")] },
    Mapping {
        name: "NganWardDuer",
        model: "ward-duer",
        unscaled: true,
        fields: &[("ks", "albedo"), ("alpha", "roughness")],
    },
    Mapping {
        name: "NganBlinnPhong",
        model: "blinn-phong",
        unscaled: true,
        fields: &[("ks", "albedo"), ("n", "sharpness")],
    },
    Mapping {
        name: "NganLafortune",
        model: "lafortune",
        unscaled: true,
        fields: &[("ks", "albedo"), ("cxy", "Cxy"), ("cz", "Cz"), ("n", "sharpness")],
    },
    Mapping {
        name: "NganCookTorrance",
        model: "cook-torrance",
        unscaled: true,
        // Their `eta` is the reflectance at normal incidence: it stays below 1.
        fields: &[("ks", "albedo"), ("f0", "eta"), ("m", "roughness")],
    },
    Mapping {
        name: "NganAshikhminShirley",
        model: "ashikhmin-shirley",
        unscaled: true,
        fields: &[("ks", "albedo"), ("f0", "fresnelReflectance"), ("n", "sharpness")],
    },
    Mapping {
        name: "NganHe",
        model: "he",
        unscaled: true,
        fields: &[("ks", "albedo"), ("sigma", "roughness"), ("tau", "autocorrelation"), ("eta", "eta")],
    },
    Mapping {
        name: "LowCookTorrance",
        model: "cook-torrance-dielectric",
        unscaled: false,
        fields: &[("ks", "albedo"), ("eta", "eta"), ("m", "roughness")],
    },
    Mapping {
        name: "LowAshikhminShirley",
        model: "ashikhmin-shirley-dielectric",
        unscaled: false,
        // Their `fresnelReflectance` is a refractive index: it stays above 1.
        fields: &[("ks", "albedo"), ("eta", "fresnelReflectance"), ("n", "sharpness")],
    },
    Mapping {
        name: "LowSmooth",
        model: "abc-smooth",
        unscaled: false,
        fields: &[("a", "A"), ("b", "B"), ("c", "C"), ("eta", "eta")],
    },
    Mapping {
        name: "LowMicrofacetFit",
        model: "abc",
        unscaled: false,
        fields: &[("a", "A"), ("b", "B"), ("c", "C"), ("eta", "eta")],
    },
    Mapping {
        name: "Bagher",
        model: "sgd",
        unscaled: false,
        fields: &[
            ("ks", "albedo"),
            ("f0", "eta.0"),
            ("f1", "eta.1"),
            ("alpha", "alpha"),
            ("p", "p"),
            ("kappa", "K"),
            ("lambda", "Lambda"),
            ("c", "c"),
            ("k", "k"),
            ("theta0", "theta0"),
        ],
    },
];

/// The materials of the file, in its order.
pub fn materials(path: &Path) -> Result<Vec<String>, BrdfError> {
    Ok(parse(path)?.into_iter().map(|entry| entry.material).collect())
}

/// The parameters of `material`, not yet checked against the model's bounds.
///
/// # Errors
/// A malformed line, a material given twice, an unknown material, a model without an implementation here, a missing or
/// unknown parameter.
pub fn read(path: &Path, material: &str) -> Result<NamedParameters, BrdfError> {
    let entries = parse(path)?;
    match entries.iter().find(|e| e.material == material) {
        Some(entry) => entry.parameters(path),
        None => Err(BrdfError::UnknownMaterial {
            path: path.to_owned(),
            found: material.to_owned(),
            nearest: nearest(material, entries.iter().map(|e| &e.material)),
        }),
    }
}

/// One line of a file.
#[derive(Debug)]
struct Entry {
    line: usize,
    material: String,
    diffuse: Call,
    model: Call,
}

/// `Name(key = numbers, ...)`; a list of lists `[[..], [..]]` becomes the keys `key.0`, `key.1`.
#[derive(Debug, Default)]
struct Call {
    name: String,
    arguments: Vec<(String, Vec<f64>)>,
}

impl Entry {
    fn parameters(&self, path: &Path) -> Result<NamedParameters, BrdfError> {
        let error = |reason: String| BrdfError::Line { path: path.to_owned(), line: self.line, reason };
        let Some(mapping) = MAPPINGS.iter().find(|m| m.name == self.model.name) else {
            let known = MAPPINGS.map(|m| m.name).join(", ");
            return Err(error(format!("model `{}` is not implemented; implemented are {known}", self.model.name)));
        };
        let mut parameters = NamedParameters::new(mapping.model)
            .map_err(|cause| BrdfError::Model { place: path.display().to_string(), cause })?;
        let mut set = |field: &str, call: &Call, key: &str| {
            let mut entries = call.take(key).map_err(error)?.to_vec();
            if mapping.unscaled && key == "albedo" {
                entries.iter_mut().zip(CHANNEL_FACTORS).for_each(|(e, factor)| *e *= factor);
            }
            parameters.set(field, &entries).map_err(|e| {
                error(match e {
                    FieldError::Unknown => format!("`{field}` is no parameter of {}", mapping.model),
                    FieldError::Entries { allowed } => {
                        format!("`{key}` has {}; it must have {allowed}", counted(entries.len(), "number"))
                    }
                })
            })
        };
        set("kd", &self.diffuse, "albedo")?;
        for (ours, theirs) in mapping.fields {
            set(ours, &self.model, theirs)?;
        }
        let known = |key: &str| mapping.fields.iter().any(|(_, theirs)| *theirs == key);
        if let Some((key, _)) = self.model.arguments.iter().find(|(key, _)| !known(key)) {
            return Err(error(format!("{} has no parameter `{key}`", mapping.name)));
        }
        Ok(parameters)
    }
}

impl Call {
    fn take(&self, key: &str) -> Result<&[f64], String> {
        let found = self.arguments.iter().find(|(k, _)| k == key);
        found.map(|(_, v)| &v[..]).ok_or_else(|| format!("{} lacks the parameter `{key}`", self.name))
    }
}

fn parse(path: &Path) -> Result<Vec<Entry>, BrdfError> {
    let bytes = read_at_most(path, MOST_BYTES).map_err(super::io_error(path))?;
    let text = String::from_utf8(bytes).map_err(|e| {
        let (path, at) = (path.to_owned(), e.utf8_error().valid_up_to());
        BrdfError::Malformed { path, format: "file of fits", reason: format!("byte {at} is no text in UTF-8") }
    })?;
    let mut seen = BTreeSet::new();
    let mut entries = Vec::new();
    for (index, line) in text.lines().enumerate() {
        if line.trim().is_empty() || line.trim_start().starts_with('#') {
            continue;
        }
        let error = |reason| BrdfError::Line { path: path.to_owned(), line: index + 1, reason };
        let entry = Scanner { line, at: 0 }.entry(index + 1).map_err(error)?;
        if !seen.insert(entry.material.clone()) {
            return Err(error(format!("material `{}` is given twice", entry.material)));
        }
        entries.push(entry);
    }
    if entries.is_empty() {
        let reason = "no line with a material".to_owned();
        return Err(BrdfError::Malformed { path: path.to_owned(), format: "file of fits", reason });
    }
    Ok(entries)
}

/// Reads one line from left to right.
struct Scanner<'a> {
    line: &'a str,
    at: usize,
}

impl Scanner<'_> {
    fn entry(&mut self, line: usize) -> Result<Entry, String> {
        let material = self.word()?;
        self.expect('=')?;
        let aggregate = self.word()?;
        if aggregate != "Aggregate" {
            return Err(self.wrong(&format!("`{aggregate}`"), "`Aggregate`"));
        }
        self.expect('(')?;
        let diffuse = self.call()?;
        if diffuse.name != "Lambertian" {
            return Err(self.wrong(&format!("`{}`", diffuse.name), "`Lambertian`"));
        }
        self.expect(',')?;
        let model = self.call()?;
        self.expect(')')?;
        self.skip_spaces();
        match self.peek() {
            None => Ok(Entry { line, material, diffuse, model }),
            Some(c) => Err(self.wrong(&format!("`{c}`"), "the end of the line")),
        }
    }

    fn call(&mut self) -> Result<Call, String> {
        let mut call = Call { name: self.word()?, arguments: Vec::new() };
        self.expect('(')?;
        loop {
            let key = self.word()?;
            self.expect('=')?;
            self.value(&key, &mut call.arguments)?;
            if !self.accept(',') {
                self.expect(')')?;
                return Ok(call);
            }
        }
    }

    fn value(&mut self, key: &str, arguments: &mut Vec<(String, Vec<f64>)>) -> Result<(), String> {
        if !self.accept('[') {
            arguments.push((key.to_owned(), vec![self.number()?]));
            return Ok(());
        }
        if !self.accept('[') {
            arguments.push((key.to_owned(), self.numbers()?));
            return Ok(());
        }
        for row in 0.. {
            arguments.push((format!("{key}.{row}"), self.numbers()?));
            if !self.accept(',') {
                break;
            }
            self.expect('[')?;
        }
        self.expect(']')
    }

    /// Numbers up to and with the closing bracket.
    fn numbers(&mut self) -> Result<Vec<f64>, String> {
        let mut numbers = vec![self.number()?];
        while self.accept(',') {
            numbers.push(self.number()?);
        }
        self.expect(']')?;
        Ok(numbers)
    }

    fn number(&mut self) -> Result<f64, String> {
        let word = self.word()?;
        match word.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(self.wrong(&format!("`{word}`"), "a finite number")),
        }
    }

    fn word(&mut self) -> Result<String, String> {
        self.skip_spaces();
        let rest = &self.line[self.at..];
        let end = rest.find(|c: char| !(c.is_ascii_alphanumeric() || "+-._".contains(c))).unwrap_or(rest.len());
        if end == 0 {
            let found = self.peek().map_or("the end of the line".to_owned(), |c| format!("`{c}`"));
            return Err(self.wrong(&found, "a name or number"));
        }
        self.at += end;
        Ok(rest[..end].to_owned())
    }

    fn accept(&mut self, c: char) -> bool {
        self.skip_spaces();
        let found = self.peek() == Some(c);
        if found {
            self.at += c.len_utf8();
        }
        found
    }

    fn expect(&mut self, c: char) -> Result<(), String> {
        if self.accept(c) {
            return Ok(());
        }
        let found = self.peek().map_or("the end of the line".to_owned(), |c| format!("`{c}`"));
        Err(self.wrong(&found, &format!("`{c}`")))
    }

    fn peek(&self) -> Option<char> {
        self.line[self.at..].chars().next()
    }

    fn skip_spaces(&mut self) {
        let rest = &self.line[self.at..];
        self.at += rest.len() - rest.trim_start().len();
    }

    fn wrong(&self, found: &str, allowed: &str) -> String {
        format!("column {} is {found}; it must be {allowed}", self.at + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse_line(line: &str) -> Result<Entry, String> {
        Scanner { line, at: 0 }.entry(7)
    }

    const WARD: &str = "teflon = Aggregate(Lambertian(albedo = [0.1, 0.2, 0.3]), NganWard(albedo = [1e-2, .02, 0.03], roughness = 0.25))";

    #[test]
    fn a_line_becomes_parameters_with_the_channel_factors_on_ngans_albedos() {
        let parameters = parse_line(WARD).expect("valid line").parameters(Path::new("x.fit")).expect("valid entry");
        let model = parameters.build().expect("within bounds");
        assert_eq!(model.model(), "ward");
        let expected = [0.1, 0.2 * 1.15, 0.3 * 1.66, 0.01, 0.02 * 1.15, 0.03 * 1.66, 0.25];
        assert_eq!(model.parameters(), expected);
    }

    #[test]
    fn lists_of_lists_are_told_apart() {
        let line = "x = Aggregate(Lambertian(albedo = [0, 0, 0]), Bagher(eta = [[1, 2, 3], [4, 5, 6]], K = [7, 8, 9]))";
        let model = parse_line(line).expect("valid line").model;
        let expected = [("eta.0", [1.0, 2.0, 3.0]), ("eta.1", [4.0, 5.0, 6.0]), ("K", [7.0, 8.0, 9.0])];
        assert_eq!(model.arguments, expected.map(|(k, v)| (k.to_owned(), v.to_vec())));
    }

    #[test]
    fn a_malformed_line_says_where_and_what() {
        for (cut, expected) in [
            (WARD.replace("albedo = [0.1, 0.2", "albedo = [0.1 0.2"), "is `0`; it must be `]`"),
            (WARD.replace("0.25", "nan"), "is `nan`; it must be a finite number"),
            (WARD.replace("0.25))", "0.25)"), "is the end of the line; it must be `)`"),
            (format!("{WARD} x"), "is `x`; it must be the end of the line"),
            (WARD.replace("Lambertian", "Lambert"), "is `Lambert`; it must be `Lambertian`"),
        ] {
            let message = parse_line(&cut).expect_err("malformed");
            assert!(message.contains("column") && message.contains(expected), "{message}");
        }
        let entries = [
            (WARD.replace("roughness", "sharpness"), "x.fit:7: NganWard lacks the parameter `roughness`"),
            (WARD.replace("roughness", "eta = 1, roughness"), "x.fit:7: NganWard has no parameter `eta`"),
            (WARD.replace("[1e-2, .02, 0.03]", "[1, 2]"), "x.fit:7: `albedo` has 2 numbers; it must have 3"),
            (
                WARD.replace("NganWard", "NganPhong"),
                "x.fit:7: model `NganPhong` is not implemented; implemented are NganWard,",
            ),
        ];
        for (line, expected) in entries {
            let entry = parse_line(&line).expect("well-formed");
            let message = entry.parameters(Path::new("x.fit")).expect_err("wrong entry").to_string();
            assert!(message.starts_with(expected), "{message}");
        }
    }
}
