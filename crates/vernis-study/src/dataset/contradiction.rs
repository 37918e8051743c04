//! Inputs that belong together, as a study and its raw ratings, and contradict each other.

use super::opinions::{Scores, StudyOpinions};
use super::{Study, StudyFile};
use std::collections::BTreeMap;

/// Scores of one pair that differ by no more are the same, but for rounding.
const ROUNDING: f64 = 1e-6;
/// Half of the pairs of a study may differ by no more from the means of its raw ratings, in grades: screening moves a mean by
/// less, another study or a scale that is turned round by more.
const MOST_APART: f64 = 1.0;

/// A rated pair: material, method and, where it is one number, its mean score.
pub type Rated<'a> = (&'a str, &'a str, Option<f64>);

/// How `study` and raw ratings that are said to be its own contradict each other; `None` where they do not.
pub fn of_ratings(study: &StudyOpinions, raw: &StudyOpinions) -> Option<String> {
    for stimulus in &raw.stimuli {
        let of_study = study.stimuli.iter().find(|s| s.material == stimulus.material);
        let Some(of_study) = of_study else { continue };
        let stated = |what, found: Option<&str>, known: Option<&str>| match (found, known) {
            (Some(found), Some(known)) if found != known => Some(format!(
                "{what} of material {} is {found} in the ratings and {known} in the study",
                stimulus.material
            )),
            _ => None,
        };
        let group = Some(stimulus.group.as_str()).filter(|group| *group != stimulus.material);
        let differs = stated("the group", group, Some(&of_study.group))
            .or_else(|| stated("the type", stimulus.material_type.as_deref(), of_study.material_type.as_deref()));
        if differs.is_some() {
            return differs;
        }
    }
    let (of_study, of_raw) = (means(study), means(raw));
    let mut apart: Vec<(f64, &(&str, &str), [f64; 2])> = of_raw
        .iter()
        .filter_map(|(pair, &rated)| of_study.get(pair).map(|&mos| ((rated - mos).abs(), pair, [rated, mos])))
        .collect();
    if apart.is_empty() {
        return Some("no pair of material and method is in both".to_owned());
    }
    apart.sort_by(|a, b| a.0.total_cmp(&b.0));
    if apart[apart.len() / 2].0 <= MOST_APART {
        return None;
    }
    let (_, (material, method), [rated, mos]) = apart[apart.len() - 1];
    Some(format!(
        "the scores of half of the {} pairs differ by more than {MOST_APART} grade; {material}, {method} has a mean of {rated:.2} in \
         the ratings and {mos:.2} in the study",
        apart.len()
    ))
}

/// Mean scores, in grades, by material and method, hidden references apart.
fn means(opinions: &StudyOpinions) -> BTreeMap<(&str, &str), f64> {
    let mut sums: BTreeMap<(&str, &str), (f64, f64)> = BTreeMap::new();
    let mut add = |place: usize, score: f64| {
        let Some(stimulus) = opinions.stimuli.get(place).filter(|s| !s.is_reference()) else { return };
        let sum = sums.entry((&stimulus.material, &stimulus.method)).or_default();
        *sum = (sum.0 + score, sum.1 + 1.0);
    };
    match &opinions.scores {
        Scores::Means(means) => means.iter().enumerate().for_each(|(place, &mos)| add(place, mos)),
        Scores::Raw(raw) => raw.judgements.iter().for_each(|j| add(j.stimulus, j.score)),
    }
    sums.into_iter().map(|(pair, (sum, n))| (pair, opinions.scale.grade(sum / n))).collect()
}

/// The first file of the same name whose content differs.
pub fn of_files<'a>(first: impl IntoIterator<Item = (&'a str, &'a str)>, second: &[StudyFile]) -> Option<String> {
    first.into_iter().find_map(|(name, sha256)| {
        let other = second.iter().find(|file| file.name == name)?;
        (other.content.to_string() != sha256).then(|| format!("the content of {name} is another"))
    })
}

/// The first of `rated` that is not among `known`, or has another score there.
pub fn of_pairs<'a>(rated: impl IntoIterator<Item = Rated<'a>>, known: &[Rated<'_>]) -> Option<String> {
    let by_name: BTreeMap<(&str, &str), Vec<Option<f64>>> =
        known.iter().fold(BTreeMap::new(), |mut all, (material, method, mos)| {
            all.entry((*material, *method)).or_insert_with(Vec::new).push(*mos);
            all
        });
    rated.into_iter().find_map(|(material, method, mos)| match by_name.get(&(material, method)) {
        None => Some(format!("it has the pair {material}, {method}, which the study has not")),
        Some(known) => {
            let same = |other: &Option<f64>| match (mos, other) {
                (Some(mos), Some(other)) => (mos - other).abs() <= ROUNDING,
                _ => true,
            };
            let other = known.first().copied().flatten();
            (!known.iter().any(same)).then(|| {
                format!(
                    "the score of {material}, {method} is {} there and {} in the study",
                    mos.unwrap_or_default(),
                    other.unwrap_or_default()
                )
            })
        }
    })
}

/// How the pairs of `kept`, which were extracted from a study, contradict `study`.
pub fn of_studies(kept: &Study, study: &Study) -> Option<String> {
    if kept.short_name() != study.short_name() || kept.synthetic != study.synthetic {
        return Some(format!("it holds the study {}", kept.name));
    }
    let hashes: Vec<(String, String)> = kept.files.iter().map(|f| (f.name.clone(), f.content.to_string())).collect();
    let rated = |study: &Study| -> Vec<(String, String, f64)> {
        study.pairs.iter().map(|p| (p.material.clone(), p.method.clone(), p.mos)).collect()
    };
    let (of_kept, of_study) = (rated(kept), rated(study));
    let known: Vec<Rated<'_>> = of_study.iter().map(|(m, k, mos)| (m.as_str(), k.as_str(), Some(*mos))).collect();
    of_pairs(of_kept.iter().map(|(m, k, mos)| (m.as_str(), k.as_str(), Some(*mos))), &known)
        .or_else(|| {
            let (found, known) = (kept.pairs.len(), study.pairs.len());
            (found != known).then(|| format!("it holds {found} pairs; the study has {known}"))
        })
        .or_else(|| of_files(hashes.iter().map(|(name, sha256)| (name.as_str(), sha256.as_str())), &study.files))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn study(text: &str) -> StudyOpinions {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("s.csv");
        std::fs::write(&path, format!("reference,candidate,mos,material,method,material_type\n{text}")).unwrap();
        StudyOpinions::load(path.to_str().unwrap(), None).unwrap()
    }

    fn raw(text: &str) -> StudyOpinions {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("r.csv");
        std::fs::write(&path, format!("participant,material,method,score,material_type\n{text}")).unwrap();
        StudyOpinions::load_raw(&path).unwrap()
    }

    #[test]
    fn ratings_of_another_study_or_scale_are_noticed() {
        let study = study("a.json,b.json,4.5,m,A,Metal\na.json,c.json,2,m,B,Metal\n");
        let found = |text: &str| of_ratings(&study, &raw(text));
        assert_eq!(found("p,m,A,5,\nq,m,A,4,\np,m,B,1,\nq,m,B,2,\n"), None);
        // A pair that the study lacks is no contradiction.
        assert_eq!(found("p,m,A,5,Metal\nq,m,A,4,Metal\np,n,A,1,\n"), None);
        let turned = found("p,m,A,1,\nq,m,A,2,\np,m,B,5,\nq,m,B,4,\n").unwrap();
        assert!(turned.contains("m, A has a mean of 1.50 in the ratings and 4.50 in the study"), "{turned}");
        assert_eq!(found("p,n,A,1,\nq,n,A,2,\n").unwrap(), "no pair of material and method is in both");
        let typed = found("p,m,A,5,Wood\nq,m,A,4,Wood\n").unwrap();
        assert_eq!(typed, "the type of material m is Wood in the ratings and Metal in the study");
    }

    #[test]
    fn pairs_are_told_apart_by_name_and_score() {
        let known = [("m", "A", Some(3.0)), ("m", "B", None)];
        assert_eq!(of_pairs([("m", "A", Some(3.0)), ("m", "B", Some(1.0))], &known), None);
        let other = of_pairs([("m", "A", Some(3.5))], &known).unwrap();
        assert_eq!(other, "the score of m, A is 3.5 there and 3 in the study");
        assert!(of_pairs([("n", "A", None)], &known).unwrap().contains("the pair n, A, which the study has not"));
    }
}
