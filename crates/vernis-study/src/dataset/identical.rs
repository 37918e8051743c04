//! The score of identical BRDFs: what people say of a reference that is shown as if it were an approximation.
//!
//! It is, of these, the first that a study has:
//!
//! 1. the weighted mean of its rated pairs whose candidate is the reference, or whose method is [`REFERENCE`];
//! 2. the mean of the hidden references in its raw ratings, under the illumination with the most stimuli;
//! 3. what its manifest declares, with the source;
//! 4. a rule: [`ASSUMED_SHARE`] of the way from the worst to the best end of the scale (4.5 of 1 to 5, 87.5 of 0 to 100), for
//!    people seldom give the best grade even to a perfect copy. A scale without a worst end counts from the reference, whose
//!    score is its best end by definition.

use super::RatedPair;
use super::opinions::{REFERENCE, Scores, StudyOpinions};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use vernis_metric::io::counted;
use vernis_metric::math::rating_scale::RatingScale;

/// Where identical BRDFs are assumed, as a share of the way from the worst to the best end of a scale.
pub const ASSUMED_SHARE: f64 = 0.875;

/// The score of identical BRDFs, and how it is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Identical {
    /// A grade, 1 to 5; in a record, on the scale of the study.
    pub score: f64,
    /// How it is known.
    pub basis: Basis,
}

/// How the score of identical BRDFs is known.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "from", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Basis {
    /// Rated pairs of a reference and itself.
    HiddenReferences {
        /// Number of pairs.
        pairs: usize,
    },
    /// Hidden references in the raw ratings.
    RawRatings {
        /// Number of references.
        stimuli: usize,
    },
    /// The study's manifest.
    Declared {
        /// Where the number stands.
        source: String,
    },
    /// [`ASSUMED_SHARE`] of the scale.
    Assumed,
    /// The best end of a scale that counts from the reference.
    BestEnd,
}

impl Default for Identical {
    fn default() -> Self {
        Self::assumed(RatingScale::GRADES)
    }
}

impl Identical {
    /// What the rule says of a scale.
    pub fn assumed(scale: RatingScale) -> Self {
        if scale.is_open() {
            return Self { score: 5.0, basis: Basis::BestEnd };
        }
        Self { score: 1.0 + 4.0 * ASSUMED_SHARE, basis: Basis::Assumed }
    }

    /// The weighted mean of hidden references, as (grade, weight); `None` where there are none.
    pub fn of_hidden_references(rated: impl IntoIterator<Item = (f64, f64)>) -> Option<Self> {
        let add =
            |(sum, weight, pairs): (f64, f64, usize), (grade, w): (f64, f64)| (sum + w * grade, weight + w, pairs + 1);
        let (sum, weight, pairs) = rated.into_iter().fold((0.0, 0.0, 0), add);
        let score = (sum / weight).clamp(1.0, 5.0);
        (pairs > 0 && weight > 0.0).then_some(Self { score, basis: Basis::HiddenReferences { pairs } })
    }

    /// Of the hidden references among rated pairs.
    pub fn of_pairs(pairs: &[RatedPair]) -> Option<Self> {
        let hidden = pairs.iter().filter(|p| p.is_hidden_reference());
        Self::of_hidden_references(hidden.map(|p| (p.mos, p.weight)))
    }

    /// Of the hidden references in raw ratings.
    pub fn of_raw(opinions: &StudyOpinions) -> Option<Self> {
        let Scores::Raw(raw) = &opinions.scores else { return None };
        let mut stimuli: BTreeMap<Option<&str>, usize> = BTreeMap::new();
        for stimulus in &opinions.stimuli {
            *stimuli.entry(stimulus.illumination.as_deref()).or_default() += 1;
        }
        let main = stimuli.iter().max_by_key(|(_, n)| **n).map(|(light, _)| *light)?;
        let mut sums = vec![(0.0, 0.0); opinions.stimuli.len()];
        for j in &raw.judgements {
            let sum = &mut sums[j.stimulus];
            *sum = (sum.0 + opinions.scale.grade(j.score), sum.1 + 1.0);
        }
        let shown = opinions
            .stimuli
            .iter()
            .zip(sums)
            .filter(|(s, sum)| s.is_reference() && s.illumination.as_deref() == main && sum.1 > 0.0);
        let found = Self::of_hidden_references(shown.map(|(_, (sum, n))| (sum / n, 1.0)))?;
        let Basis::HiddenReferences { pairs: stimuli } = found.basis else { return None };
        Some(Self { basis: Basis::RawRatings { stimuli }, ..found })
    }
}

impl RatedPair {
    /// Whether reference and candidate are one BRDF.
    pub fn is_hidden_reference(&self) -> bool {
        self.method == REFERENCE || self.reference.identity() == self.candidate.identity()
    }
}

/// How the score is known, in words.
impl fmt::Display for Basis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::HiddenReferences { pairs } => {
                write!(f, "mean of the study's hidden references, {}", counted(*pairs, "rated pair"))
            }
            Self::RawRatings { stimuli } => write!(f, "mean of the {stimuli} hidden references in the raw ratings"),
            Self::Declared { source } => write!(f, "declared by the study: {source}"),
            Self::Assumed => write!(
                f,
                "assumed, {} % of the way from the worst to the best end of the scale: the study has no hidden reference",
                100.0 * ASSUMED_SHARE
            ),
            Self::BestEnd => f.write_str("the best end of a scale that counts from the reference"),
        }
    }
}
