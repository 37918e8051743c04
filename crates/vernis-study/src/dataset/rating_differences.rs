//! Where raw ratings and the study that they are said to be of differ, pair by pair. What contradicts it as a whole is in
//! [`super::contradiction`].
//!
//! A study states the mean opinion score of each material and method; raw ratings have a mean of their own. Screening and rounding
//! move a mean a little; a mean that is further off than [`TOLERANCE`] belongs to other people, another scale or another material.

use super::opinions::{Scores, StudyOpinions};
use std::collections::BTreeMap;
use std::fmt;

/// In grades.
pub const TOLERANCE: f64 = 0.25;

/// A material and method on which the two do not agree.
#[derive(Debug, Clone, PartialEq)]
pub struct RatingDifference {
    /// Name of the reference's material.
    pub material: String,
    /// Name of the method.
    pub method: String,
    /// Mean of the ratings, on their scale.
    pub rated: f64,
    /// How many ratings that is the mean of.
    pub ratings: usize,
    /// The score that the study states, on its scale.
    pub stated: f64,
    /// How far apart they are, in grades.
    pub grades: f64,
}

impl fmt::Display for RatingDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { material, method, rated, ratings, stated, .. } = self;
        write!(f, "{material}, {method}: {rated:.2} is the mean of {ratings} ratings, {stated:.2} the study's score")
    }
}

/// What raw ratings and the scores of a study say of the same stimuli.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Checked {
    /// Materials and methods that both have.
    pub common: usize,
    /// Those on which they differ by more than [`TOLERANCE`], furthest first.
    pub differences: Vec<RatingDifference>,
}

/// Compares the ratings `raw` with the scores that `study` states; `None` where the study states none, or `raw` has no ratings.
/// Ratings under all illuminations count together.
pub fn check(study: &StudyOpinions, raw: &StudyOpinions) -> Option<Checked> {
    let (Scores::Means(stated), Scores::Raw(ratings)) = (&study.scores, &raw.scores) else { return None };
    let mut rated: BTreeMap<(&str, &str), (f64, usize)> = BTreeMap::new();
    for judgement in &ratings.judgements {
        let stimulus = raw.stimuli.get(judgement.stimulus)?;
        let (sum, count) = rated.entry((&stimulus.material, &stimulus.method)).or_default();
        (*sum, *count) = (*sum + judgement.score, *count + 1);
    }
    // A study may state a pair twice, under two illuminations.
    let mut scores: BTreeMap<(&str, &str), (f64, usize)> = BTreeMap::new();
    for (stimulus, score) in study.stimuli.iter().zip(stated) {
        let (sum, count) = scores.entry((&stimulus.material, &stimulus.method)).or_default();
        (*sum, *count) = (*sum + score, *count + 1);
    }
    let mut checked = Checked::default();
    for ((material, method), (sum, count)) in scores {
        let Some(&(total, ratings)) = rated.get(&(material, method)) else { continue };
        checked.common += 1;
        let (stated, rated) = (sum / count as f64, total / ratings as f64);
        // A difference of exactly the tolerance is none.
        let grades = (study.scale.grade(stated) - raw.scale.grade(rated)).abs();
        if grades > TOLERANCE + 1e-9 {
            let [material, method] = [material, method].map(str::to_owned);
            checked.differences.push(RatingDifference { material, method, rated, ratings, stated, grades });
        }
    }
    checked.differences.sort_by(|a, b| b.grades.total_cmp(&a.grades));
    Some(checked)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratings_that_are_not_those_of_the_study_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = dir.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let pairs = "reference,candidate,mos,material,method\n\
                     a.binary,b.binary,4.5,chalk,GGX\na.binary,c.binary,3.5,chalk,WARD\nd.binary,e.binary,2,slate,GGX\n";
        let study = StudyOpinions::load(&write("s.csv", pairs).to_string_lossy(), None).unwrap();
        let rows = "participant,material,method,score\n\
                    p,chalk,GGX,1\nq,chalk,GGX,2\np,chalk,WARD,3\nq,chalk,WARD,4\np,basalt,GGX,5\n";
        let raw = StudyOpinions::load_raw(&write("raw.csv", rows)).unwrap();
        let checked = check(&study, &raw).unwrap();
        assert_eq!((checked.common, checked.differences.len()), (2, 1));
        assert_eq!(
            checked.differences[0].to_string(),
            "chalk, GGX: 1.50 is the mean of 2 ratings, 4.50 the study's score"
        );
        assert_eq!(check(&raw, &study), None);
        assert_eq!(check(&study, &study), None);
    }
}
