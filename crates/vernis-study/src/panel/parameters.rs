//! How many parameters the models of the study have, as section 5.5 of Lavoue et al. 2021 (doi:10.1111/cgf.142636) counts them.
//!
//! These are the paper's numbers, for three colour channels, and not those of the models of this program, which may be written
//! with fewer or more.

/// A model of the study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ModelParameters {
    /// The family of methods that the study's ratings have it under.
    pub family: &'static str,
    /// The name of the model.
    pub model: &'static str,
    /// `None`: the model is not parametric.
    pub parameters: Option<u32>,
    /// What the number leaves out; empty where it says all.
    pub note: &'static str,
}

const fn model(family: &'static str, model: &'static str, parameters: u32) -> ModelParameters {
    ModelParameters { family, model, parameters: Some(parameters), note: "" }
}

/// The nine models of the study's figures 9 and 10, those with the fewest parameters first.
pub const OF_STUDY: [ModelParameters; 9] = [
    model("BLINN-PHONG", "Blinn-Phong", 7),
    model("WARD", "Ward", 7),
    model("ABC", "ABC", 8),
    model("BECKMAN", "Beckmann", 8),
    ModelParameters { note: "and a tabulated distribution, about 6 KB in all", ..model("DUPUY", "Dupuy et al.", 8) },
    model("GGX", "GGX", 8),
    model("LAFORTUNE", "Lafortune", 9),
    model("SGD", "SGD", 33),
    ModelParameters {
        family: "BAGHER",
        model: "Bagher et al.",
        parameters: None,
        note: "not parametric: tabulated functions",
    },
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::manifest::{Manifest, NAMES};

    #[test]
    fn the_numbers_are_those_of_the_paper() {
        // "The Beckmann model has 8 parameters, while GGX has 8, ABC 8, Ward 7, Lafortune 9, Dupuy et al. 8, Blinn-Phong 7, SGD 33."
        let expected = [
            ("Beckmann", 8),
            ("GGX", 8),
            ("ABC", 8),
            ("Ward", 7),
            ("Lafortune", 9),
            ("Dupuy et al.", 8),
            ("Blinn-Phong", 7),
            ("SGD", 33),
        ];
        let found = |name: &str| OF_STUDY.iter().find(|m| m.model == name).and_then(|m| m.parameters);
        for (name, parameters) in expected {
            assert_eq!(found(name), Some(parameters), "{name}");
        }
        let without: Vec<&str> = OF_STUDY.iter().filter(|m| m.parameters.is_none()).map(|m| m.model).collect();
        assert_eq!((OF_STUDY.len(), without), (expected.len() + 1, vec!["Bagher et al."]));
    }

    #[test]
    fn the_families_are_those_of_the_ratings() {
        let manifest = Manifest::embedded(NAMES[0]).unwrap();
        let known: Vec<&str> = manifest.rated.methods.iter().map(|m| m.family.as_str()).collect();
        for model in OF_STUDY {
            assert!(known.contains(&model.family), "{} is not among {known:?}", model.family);
        }
    }
}
