//! The embedded study's raw ratings: what its observers said, with what a human study has beside that, and the truth.
//!
//! * The 30 observers of [`super::panel`] grade every pair under the illumination [`STUDIO`]; their means are the
//!   study's MOS.
//! * About a third of the pairs again under [`OVERCAST`], where each is [`OVERCAST_SHIFT`] grades better, never beyond 5.
//! * Each reference as a hidden candidate of itself under both, of quality [`HIDDEN_REFERENCE`] under both.
//! * [`GOLD`] control questions, of which nobody who looks is unsure: quality [`BEYOND`] below 1 and above 5 in turn.
//! * Then [`CARELESS`] participants who answer everything at random and at once, as screening should find.
//!
//! A careful answer takes 4 s (log-normal, 0.4), a careless one 0.3 s. Cost: 40,000 grades.

use super::SyntheticStudy;
use super::candidates::normal;
use super::panel::{OBSERVERS, grade, mean_opinion};
use crate::dataset::opinions::{REFERENCE, Scores, Stimulus, StudyOpinions, of_pair};
use crate::dataset::raw_ratings::{GoldAnswer, Judgement, RawRatings};
use crate::dataset::{Basis, Identical};
use rand::Rng;
use std::collections::BTreeMap;
use vernis_metric::math::seed;

/// The illumination under which the study's MOS were given.
pub const STUDIO: &str = "studio";
/// The other illumination.
pub const OVERCAST: &str = "overcast";
/// How much better a pair is under [`OVERCAST`], in grades.
pub const OVERCAST_SHIFT: f64 = 0.15;
/// Quality of a hidden reference.
pub const HIDDEN_REFERENCE: f64 = 4.75;
/// Control questions.
pub const GOLD: usize = 20;
/// How far control questions lie beyond the ends of the scale, in grades.
pub const BEYOND: f64 = 1.5;
/// Participants who do not look.
pub const CARELESS: usize = 3;

/// Raw ratings and what is behind them.
pub struct Sessions {
    /// Stimuli and raw scores.
    pub opinions: StudyOpinions,
    /// The truth behind the ratings, 1 to 5, by stimulus.
    pub quality: Vec<f64>,
    /// Indices of the participants who do not look.
    pub careless: Vec<usize>,
}

/// Raw ratings of `made`, which `seed` drew.
pub fn simulate(made: &SyntheticStudy, seed: u64) -> Sessions {
    let (stimuli, quality) = stimuli(made);
    let gold: Vec<f64> = (0..GOLD).map(|i| if i % 2 == 0 { 1.0 } else { 5.0 }).collect();
    let obvious: Vec<f64> = gold.iter().map(|e| if *e < 3.0 { e - BEYOND } else { e + BEYOND }).collect();
    // The grades of a pair depend on its place alone, so that those of the study stay as they are.
    let grades = grade(&[quality.as_slice(), &obvious].concat(), seed);
    let mut raw = RawRatings { participants: Vec::new(), judgements: Vec::new(), gold: Vec::new() };
    for participant in 0..OBSERVERS + CARELESS {
        let mut rng = seed::stream(seed, "synthetic-session", participant as u64);
        let careless = participant >= OBSERVERS;
        raw.participants.push(format!("observer-{:02}", participant + 1));
        for (i, by_observer) in grades.iter().enumerate() {
            let score = match by_observer.get(participant) {
                Some(&grade) => f64::from(grade),
                None => f64::from(rng.random_range(1..=5u8)),
            };
            let (typical, spread) = if careless { (0.3f64, 0.2) } else { (4.0, 0.4) };
            let seconds = Some((typical.ln() + spread * normal(&mut rng)).exp());
            match i.checked_sub(stimuli.len()) {
                None => raw.judgements.push(Judgement { participant, stimulus: i, score, seconds }),
                Some(question) => raw.gold.push(GoldAnswer { participant, score, expected: gold[question], seconds }),
            }
        }
    }
    let study = &made.study;
    let opinions = StudyOpinions {
        name: study.name.clone(),
        synthetic: true,
        completeness: study.completeness,
        scale: study.scale,
        files: Vec::new(),
        stimuli,
        scores: Scores::Raw(raw),
    };
    Sessions { opinions, quality, careless: (OBSERVERS..OBSERVERS + CARELESS).collect() }
}

/// The mean of what the observers say of the hidden references under the illumination of the study's MOS.
pub(super) fn identical(made: &SyntheticStudy, seed: u64) -> Identical {
    let (stimuli, quality) = stimuli(made);
    let rated = stimuli.iter().zip(grade(&quality, seed));
    let hidden = rated.filter(|(s, _)| s.is_reference() && s.illumination.as_deref() == Some(STUDIO));
    let means: Vec<f64> = hidden.map(|(_, grades)| mean_opinion(&grades)).collect();
    let stimuli = means.len();
    Identical { score: means.iter().sum::<f64>() / stimuli as f64, basis: Basis::RawRatings { stimuli } }
}

/// What is shown and how good it is, first the study's own pairs in their order.
fn stimuli(made: &SyntheticStudy) -> (Vec<Stimulus>, Vec<f64>) {
    let lit = |stimulus: &Stimulus, light: &str| Stimulus { illumination: Some(light.into()), ..stimulus.clone() };
    let pairs: Vec<(Stimulus, f64)> = made.study.pairs.iter().map(of_pair).zip(made.quality.iter().copied()).collect();
    let hidden = |s: &Stimulus| {
        (s.material.clone(), Stimulus { method: REFERENCE.into(), method_family: REFERENCE.into(), ..s.clone() })
    };
    let references: BTreeMap<String, Stimulus> = pairs.iter().map(|(s, _)| hidden(s)).collect();
    let studio = pairs.iter().map(|(s, q)| (lit(s, STUDIO), *q));
    let mut rng = seed::stream(0, "synthetic-overcast", 0);
    let third: Vec<&(Stimulus, f64)> = pairs.iter().filter(|_| rng.random_range(0..3) == 0).collect();
    let overcast = third.iter().map(|(s, q)| (lit(s, OVERCAST), (q + OVERCAST_SHIFT).min(5.0)));
    let both = references.values().flat_map(|s| [STUDIO, OVERCAST].map(|light| (lit(s, light), HIDDEN_REFERENCE)));
    studio.chain(overcast).chain(both).unzip()
}
