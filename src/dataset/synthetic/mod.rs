//! The embedded study: materials, candidates and ratings made by code, so that a fresh machine without any data can do
//! the whole job. **Its ratings are simulated: scores on it say nothing about people.**
//!
//! [`materials`] are spoilt into [`candidates`]; both are shown on a bumpy ball in a [`studio`]; [`appearance`] says how
//! different the two pictures look; a simulated [`panel`] grades that. Lights, shape, view and colour space are those of
//! no descriptor, so that a metric has to learn the relation like that to human ratings.
//!
//! Cost: about six hundred pictures of thirty thousand evaluations each, in parallel.

pub mod appearance;
mod candidates;
mod materials;
pub mod panel;
mod reflectance;
mod studio;

use super::{Completeness, DatasetError, RatedPair, Study};
use crate::brdf::{BrdfSource, OpenBrdf};
use crate::math::seed;
use appearance::{Difference, Percept, perceive};
use candidates::Candidate;
use materials::NamedMaterial;
use panel::Grades;
use rand::Rng;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Name of the study.
pub const NAME: &str = "synthetic";
/// One line for lists.
pub const TITLE: &str = "embedded synthetic study: simulated observers, says nothing about people";
/// Rated pairs.
pub const PAIRS: usize = 563;
/// Seed of the panel of the study that [`Study::load`] gives.
pub const SEED: u64 = 0;

/// The strengths of candidates come from this stream, whatever the panel's seed.
const CANDIDATE_SEED: u64 = 2021;

/// The study with what a human study does not reveal.
pub struct SyntheticStudy {
    pub study: Study,
    /// The truth behind the ratings, 1 to 5, by pair.
    pub quality: Vec<f64>,
    /// What each of the 30 observers said, by pair.
    pub grades: Vec<Grades>,
}

/// One pair before it is rated.
struct Pair {
    material: usize,
    candidate: Candidate,
    reference: OpenBrdf,
    open: OpenBrdf,
}

/// Makes the study with the panel of observers that `seed` draws. Materials and candidates are always the same.
pub fn generate(seed: u64) -> Result<SyntheticStudy, DatasetError> {
    let all = materials::all();
    let pairs = pairs(&all)?;
    let quality = qualities(&pairs, all.len());
    let grades = panel::grade(&quality, seed);
    let rated = pairs.into_iter().zip(&grades).map(|(p, grades)| rated(&all[p.material], p, grades)).collect();
    let completeness = Completeness { found: quality.len(), known: quality.len() };
    let study = Study { name: NAME.into(), synthetic: true, completeness, files: Vec::new(), pairs: rated };
    Ok(SyntheticStudy { study, quality, grades })
}

fn pairs(all: &[NamedMaterial]) -> Result<Vec<Pair>, DatasetError> {
    let failed = |reason| DatasetError::Synthetic { reason };
    let mut pairs = Vec::new();
    for (i, m) in all.iter().enumerate() {
        let mut rng = seed::stream(CANDIDATE_SEED, "synthetic-candidates", i as u64);
        let others: Vec<&NamedMaterial> = all.iter().filter(|o| o.group != m.group).collect();
        let target = others[rng.random_range(0..others.len())];
        let reference = candidates::Recipe::Material(m.material.clone()).open(m.name).map_err(failed)?;
        for candidate in candidates::of(m, &target.material, &mut rng) {
            let open = candidate.recipe.open(&format!("{}/{}", m.name, candidate.method)).map_err(failed)?;
            pairs.push(Pair { material: i, candidate, reference: reference.clone(), open });
        }
    }
    Ok(pairs)
}

/// Quality of each pair, 1 to 5.
fn qualities(pairs: &[Pair], materials: usize) -> Vec<f64> {
    let studio = studio::Studio::new();
    let look = |brdf: &OpenBrdf| perceive(&studio.picture(brdf.brdf.as_ref()));
    let first: BTreeMap<usize, &OpenBrdf> = pairs.iter().map(|p| (p.material, &p.reference)).collect();
    let references: Vec<Option<Percept>> =
        (0..materials).into_par_iter().map(|i| first.get(&i).map(|r| look(r))).collect();
    pairs
        .par_iter()
        .map(|p| references[p.material].as_ref().map_or(f64::NAN, |r| Difference::between(r, &look(&p.open)).quality()))
        .collect()
}

fn rated(material: &NamedMaterial, pair: Pair, grades: &Grades) -> RatedPair {
    RatedPair {
        reference: BrdfSource::Generated(pair.reference),
        candidate: BrdfSource::Generated(pair.open),
        material: material.name.into(),
        group: material.group.into(),
        method: pair.candidate.method.into(),
        method_family: pair.candidate.family.into(),
        material_type: Some(if material.metal { "Metal" } else { "Dielectric" }.into()),
        mos: panel::mean_opinion(grades),
        weight: 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    #[test]
    #[ignore]
    fn report() {
        let t = Instant::now();
        let s = generate(SEED).unwrap();
        println!("{} pairs in {:?}", s.quality.len(), t.elapsed());
        let mut by: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        for p in &s.study.pairs {
            by.entry(&p.method).or_default().push(p.mos);
        }
        let stat = |v: &[f64]| {
            let m = v.iter().sum::<f64>() / v.len() as f64;
            let sd = (v.iter().map(|x| (x - m).powi(2)).sum::<f64>() / v.len() as f64).sqrt();
            let (lo, hi) = v.iter().fold((9f64, 0f64), |(a, b), &x| (a.min(x), b.max(x)));
            format!("n {} mean {m:.2} sd {sd:.2} range {lo:.2} {hi:.2}", v.len())
        };
        for (k, v) in &by {
            println!("{k:14} {}", stat(v));
        }
        println!("all {}", stat(&s.study.pairs.iter().map(|p| p.mos).collect::<Vec<_>>()));
        let mut by: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        for p in &s.study.pairs {
            by.entry(&p.material).or_default().push(p.mos);
        }
        for (k, v) in &by {
            println!("{k:18} {}", stat(v));
        }
    }
}
