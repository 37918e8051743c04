//! The embedded study: materials, candidates and ratings made by code, so that a fresh machine without any data can do
//! the whole job. **Its ratings are simulated: scores on it say nothing about people.**
//!
//! `materials` are spoilt into `candidates`; both are shown on a bumpy ball in a `studio`; [`appearance`] says
//! how different the two pictures look; a simulated [`panel`] grades that. Lights, shape, view and colour space are
//! those of no descriptor, so that a metric has to learn the relation like that to human ratings.
//!
//! Cost: about four hundred pictures of thirty thousand evaluations each, in parallel.

pub mod appearance;
mod candidates;
mod materials;
pub mod panel;
mod reflectance;
pub mod sessions;
mod studio;

use super::{Completeness, DatasetError, Identical, RatedPair, Study};
use appearance::{Difference, Percept, perceive};
use candidates::Candidate;
use materials::NamedMaterial;
use panel::Grades;
use rand::Rng;
use std::collections::BTreeMap;
use vernis_metric::brdf::{BrdfSource, OpenBrdf};
use vernis_metric::math::parallel;
use vernis_metric::math::rating_scale::RatingScale;
use vernis_metric::math::seed;

/// Name of the study.
pub const NAME: &str = "synthetic";
/// One line for lists.
pub const TITLE: &str = "embedded synthetic study: simulated observers, says nothing about people";
/// Rated pairs.
pub const PAIRS: usize = 349;
/// Seed of the panel of the study that [`Study::load`] gives.
pub const SEED: u64 = 0;

/// The strengths of candidates come from this stream, whatever the panel's seed.
const CANDIDATE_SEED: u64 = 2021;

/// The study with what a human study does not reveal.
pub struct SyntheticStudy {
    /// The study as any other is loaded.
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
    let study = Study {
        name: NAME.into(),
        synthetic: true,
        completeness,
        scale: RatingScale::GRADES,
        identical: Identical::default(),
        files: Vec::new(),
        pairs: rated,
    };
    let mut made = SyntheticStudy { study, quality, grades };
    made.study.identical = sessions::identical(&made, seed);
    Ok(made)
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
    let references: Vec<Option<Percept>> = parallel::map(materials, |i| first.get(&i).map(|r| look(r)));
    parallel::map_items(pairs, |p| {
        references[p.material].as_ref().map_or(f64::NAN, |r| Difference::between(r, &look(&p.open)).quality())
    })
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
    use std::sync::LazyLock;

    static STUDY: LazyLock<SyntheticStudy> = LazyLock::new(|| generate(SEED).expect("the embedded study"));

    fn mean(v: &[f64]) -> f64 {
        v.iter().sum::<f64>() / v.len() as f64
    }

    fn deviation(v: &[f64]) -> f64 {
        mean(&v.iter().map(|x| (x - mean(v)).powi(2)).collect::<Vec<_>>()).sqrt()
    }

    fn correlation(a: &[f64], b: &[f64]) -> f64 {
        let products: Vec<f64> = a.iter().zip(b).map(|(x, y)| (x - mean(a)) * (y - mean(b))).collect();
        mean(&products) / (deviation(a) * deviation(b))
    }

    fn scores() -> Vec<f64> {
        STUDY.study.pairs.iter().map(|p| p.mos).collect()
    }

    #[test]
    fn the_study_is_marked_whole_and_valid() {
        let study = &STUDY.study;
        assert!(study.synthetic && study.completeness.is_whole());
        assert_eq!(study.pairs.len(), PAIRS);
        study.validate(10).unwrap();
        assert_eq!(study.groups(), 38);
        // What its observers say of references of quality 4.75, on a scale that ends at 5.
        assert!((4.3..4.75).contains(&study.identical.score), "{:?}", study.identical);
    }

    #[test]
    fn ratings_spread_like_those_of_people() {
        let mos = scores();
        // The human study's rated pairs have mean 3.4, standard deviation 0.96 and range 1.0 to 4.8.
        assert!((2.8..3.6).contains(&mean(&mos)), "{}", mean(&mos));
        assert!((0.9..1.2).contains(&deviation(&mos)), "{}", deviation(&mos));
        assert!(mos.iter().any(|&m| m < 1.5) && mos.iter().any(|&m| m > 4.7));
    }

    #[test]
    fn the_panel_recovers_the_truth_up_to_its_noise() {
        let r = correlation(&scores(), &STUDY.quality);
        assert!((0.97..0.9999).contains(&r), "{r}");
        // Split halves agree about as those of people do (0.964 in the human study).
        let half = |from: usize| -> Vec<f64> {
            STUDY
                .grades
                .iter()
                .map(|g| mean(&g[from..from + 15].iter().map(|&x| f64::from(x)).collect::<Vec<_>>()))
                .collect()
        };
        let halves = correlation(&half(0), &half(15));
        assert!((0.93..0.99).contains(&halves), "{halves}");
    }

    #[test]
    fn steps_towards_another_material_look_worse_the_longer_they_are() {
        let mut by_material: BTreeMap<&str, BTreeMap<&str, f64>> = BTreeMap::new();
        for (p, &q) in STUDY.study.pairs.iter().zip(&STUDY.quality).filter(|(p, _)| p.method_family == "STEPS") {
            by_material.entry(&p.material).or_default().insert(&p.method, q);
        }
        assert_eq!(by_material.len(), 40);
        for (material, q) in by_material {
            assert!(q["STEP.1"] > q["STEP.2"], "{material}: {q:?}");
        }
    }

    #[test]
    fn content_does_not_depend_on_the_panel_and_ratings_do() {
        // One thread here, all of them there: the number of threads changes nothing.
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let other = one.install(|| generate(SEED + 1)).unwrap();
        let content = |s: &SyntheticStudy| -> Vec<_> {
            let hash = |b: &BrdfSource| match b {
                BrdfSource::Generated(open) => open.content,
                _ => panic!("everything is generated"),
            };
            s.study.pairs.iter().map(|p| (hash(&p.reference), hash(&p.candidate))).collect()
        };
        assert_eq!(content(&other), content(&STUDY));
        assert_eq!(other.quality, STUDY.quality);
        assert_ne!(other.grades, STUDY.grades);
        let distinct: std::collections::BTreeSet<_> = content(&STUDY).into_iter().map(|(_, c)| c).collect();
        assert_eq!(distinct.len(), PAIRS);
    }
}
