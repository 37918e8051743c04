//! From a study's opinions to its record: which statistic is computed on what.

use super::comparison::Comparison;
use super::error::StudyError;
use super::intraclass::{Intraclass, one_way, two_way};
use super::moments::{MeanAndDeviation, Moments};
use super::opinion::Opinion;
use super::record::{Missing, Panel, RatedStimulus, Spread, StudyRecord};
use super::reliability::{expected, split_half};
use super::screening::{Criterion, screen};
use super::sos;
use crate::dataset::opinions::{Scores, StudyOpinions};
use crate::dataset::raw_ratings::RawRatings;
use std::collections::BTreeSet;
use vernis_metric::io::counted;
use vernis_metric::math::rating_scale::RatingScale;

/// What is asked of [`describe`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// What was asked, for the head of the record.
    pub command: String,
    /// Of splits and resamples: the same seed gives the same record.
    pub seed: u64,
    /// Random splits of the panel.
    pub splits: usize,
    /// Bootstrap resamples of materials.
    pub resamples: usize,
    /// Checks of which a failed one rejects a participant.
    pub rejecting: Vec<Criterion>,
}

impl Default for Options {
    /// 100 splits as in Lavoue et al. 2021, 1000 resamples, and the checks that they rejected by: gold and time.
    fn default() -> Self {
        let rejecting = vec![Criterion::Gold, Criterion::Time];
        Self { command: String::new(), seed: 1, splits: 100, resamples: 1000, rejecting }
    }
}

/// Statistics that could not be computed, with the reason.
#[derive(Default)]
pub(super) struct Notes(Vec<Missing>);

impl Notes {
    /// The value, or a note of why it is missing.
    pub fn keep<T>(&mut self, what: &str, result: Result<T, StudyError>) -> Option<T> {
        result.map_err(|e| self.0.push(Missing { what: what.to_owned(), why: e.to_string() })).ok()
    }
}

/// Every statistic that the study allows.
///
/// # Errors
/// Screening that leaves fewer than two participants. A statistic that the study does not allow is no error: the
/// record names it.
pub fn describe(study: &StudyOpinions, options: &Options) -> Result<StudyRecord, StudyError> {
    let mut notes = Notes::default();
    let panel = match &study.scores {
        Scores::Raw(raw) => Some(Kept::of(&raw.clone().in_grades(study.scale), study.stimuli.len(), options)?),
        Scores::Means(_) => None,
    };
    let (opinions, spread) = match (&study.scores, &panel) {
        (Scores::Means(means), _) if study.scale.is_open() => (alone(study, means), Spread::Unknown),
        (Scores::Means(means), _) => (assumed(study, means), ASSUMED),
        (Scores::Raw(_), Some(kept)) => (kept.opinions(study), Spread::Scores),
        (Scores::Raw(_), None) => (Vec::new(), Spread::Scores),
    };
    let comparison = Comparison::new(&opinions, study.scale, spread == Spread::Scores, options, &mut notes);
    let distinct = |of: &dyn Fn(&RatedStimulus) -> String| opinions.iter().map(of).collect::<BTreeSet<_>>().len();
    let materials = distinct(&|o| o.stimulus.material.clone());
    let methods = distinct(&|o| o.stimulus.method.clone());
    let boxes = comparison.boxes();
    let mut record = StudyRecord {
        study: study.name.clone(),
        command: options.command.clone(),
        version: env!("CARGO_PKG_VERSION").into(),
        data: study.files.iter().map(|f| (f.name.clone(), f.content.to_string())).collect(),
        synthetic: study.synthetic,
        scale: study.scale,
        found: study.completeness.found,
        known: study.completeness.known,
        seed: options.seed,
        intervals: intervals(spread, study.scale, &opinions),
        spread,
        materials,
        methods,
        illuminations: comparison.illuminations(),
        panel: panel.as_ref().map(|p| p.panel.clone()),
        split_half: None,
        expected_reliability: None,
        intraclass_one_way: None,
        intraclass_two_way: None,
        sos: None,
        material_types: comparison.material_types(&mut notes),
        illumination: comparison.illumination(&mut notes),
        anova_two_way: comparison.anova_two_way(&mut notes),
        anova_three_way: comparison.anova_three_way(&mut notes),
        models: comparison.models(&mut notes),
        manifold: comparison.manifold(&mut notes),
        boxes,
        missing: Vec::new(),
        opinions: Vec::new(),
    };
    reliability(&mut record, &opinions, panel.as_ref(), study, options, &mut notes);
    record.sos = notes.keep("SOS fit", comparison.sos());
    record.opinions = opinions;
    record.missing = notes.0;
    Ok(record)
}

const ASSUMED: Spread = Spread::NoiseModel { a: sos::ASSUMED_A, raters: sos::ASSUMED_RATERS };

/// How the intervals of single means are computed, in words.
fn intervals(spread: Spread, scale: RatingScale, opinions: &[RatedStimulus]) -> String {
    let equal = opinions.iter().filter(|o| o.opinion.is_unanimous()).count();
    match spread {
        Spread::NoiseModel { a, raters } => format!(
            "ASSUMED, because the study gives only means: variance {a} ({}), {} per stimulus; on each side the wider of \
             Student's t and Wilson's interval, which has a width at the ends of the scale too",
            sos::formula(scale),
            counted(raters, "rater")
        ),
        Spread::Unknown => {
            "The study gives only means, on a scale without a worst end: no spread is assumed.".to_owned()
        }
        Spread::Scores if equal > 0 => format!(
            "Student's t of the scores of each stimulus; Wilson's interval, with the variance of a binomial score, for {} whose scores \
             are all equal",
            counted(equal, "stimulus")
        ),
        Spread::Scores => "Student's t of the scores of each stimulus".to_owned(),
    }
}

fn assumed(study: &StudyOpinions, means: &[f64]) -> Vec<RatedStimulus> {
    let scale = study.scale;
    let of_grade = |grade: f64| Opinion::of_mean(grade, sos::ASSUMED_A, sos::ASSUMED_RATERS).on_scale(scale);
    // The mean itself stays as it was given.
    let opinion = |&mos: &f64| Opinion { mos, ..of_grade(scale.grade(mos)) };
    let rated = study.stimuli.iter().zip(means);
    rated.map(|(s, mos)| RatedStimulus { stimulus: s.clone(), opinion: opinion(mos) }).collect()
}

/// Means of whose spread nothing can be said.
fn alone(study: &StudyOpinions, means: &[f64]) -> Vec<RatedStimulus> {
    let rated = study.stimuli.iter().zip(means);
    rated.map(|(s, mos)| RatedStimulus { stimulus: s.clone(), opinion: Opinion::of_mean_alone(*mos) }).collect()
}

/// Agreement of the panel with itself, or what is expected of it.
fn reliability(
    record: &mut StudyRecord,
    opinions: &[RatedStimulus],
    panel: Option<&Kept>,
    study: &StudyOpinions,
    options: &Options,
    notes: &mut Notes,
) {
    let Some(kept) = panel else {
        let means: Vec<f64> = opinions.iter().map(|o| study.scale.grade(o.opinion.mos)).collect();
        let found = match record.spread {
            Spread::Unknown => Err(StudyError::OpenScale),
            _ => expected(&means, sos::ASSUMED_A, sos::ASSUMED_RATERS),
        };
        record.expected_reliability = notes.keep("expected reliability", found);
        for what in ["rater screening", "split-half agreement", "intra-class correlations"] {
            notes.keep::<()>(what, Err(StudyError::NoRawScores));
        }
        return;
    };
    let split = split_half(&kept.scores, options.splits, options.seed);
    record.split_half = notes.keep("split-half agreement", split);
    record.intraclass_one_way = notes.keep("ICC(1,1) and ICC(1,k)", one_way(&kept.scores));
    record.intraclass_two_way = notes.keep("ICC(2,1) and ICC(2,k)", kept.two_way(study));
}

/// The part of a panel that passed the screening.
struct Kept {
    panel: Panel,
    /// Who is left, and how much each judged.
    names: Vec<(String, usize)>,
    /// Grades by stimulus, in the order of `names` as far as they rated it.
    scores: Vec<Vec<f64>>,
}

impl Kept {
    fn of(raw: &RawRatings, stimuli: usize, options: &Options) -> Result<Self, StudyError> {
        let screened = screen(raw, stimuli);
        let passes = |i: usize| !screened[i].fails.iter().any(|c| options.rejecting.contains(c));
        let left: Vec<usize> = (0..screened.len()).filter(|&i| passes(i) && screened[i].judgements > 0).collect();
        if left.len() < 2 {
            return Err(StudyError::AllRejected { left: left.len(), participants: screened.len() });
        }
        let mut place = vec![None; screened.len()];
        left.iter().enumerate().for_each(|(at, &i)| place[i] = Some(at));
        let mut scores: Vec<Vec<(usize, f64)>> = vec![Vec::new(); stimuli];
        for j in &raw.judgements {
            scores[j.stimulus].extend(place[j.participant].map(|at| (at, j.score)));
        }
        scores.iter_mut().for_each(|s| s.sort_by_key(|(at, _)| *at));
        let scores: Vec<Vec<f64>> = scores.into_iter().map(|s| s.into_iter().map(|(_, x)| x).collect()).collect();
        let each = |numbers: Vec<f64>| MeanAndDeviation::of(&numbers);
        let panel = Panel {
            rejecting: options.rejecting.clone(),
            participants: left.len(),
            judgements: scores.iter().map(Vec::len).sum(),
            judgements_each: each(left.iter().map(|&i| screened[i].judgements as f64).collect()),
            raters_each: each(scores.iter().filter(|s| !s.is_empty()).map(|s| s.len() as f64).collect()),
            screened,
        };
        let names = left.iter().map(|&i| (raw.participants[i].clone(), panel.screened[i].judgements)).collect();
        Ok(Self { panel, names, scores })
    }

    /// Mean opinions of the stimuli that somebody is left for.
    fn opinions(&self, study: &StudyOpinions) -> Vec<RatedStimulus> {
        let rated = study.stimuli.iter().zip(&self.scores);
        rated
            .filter_map(|(s, scores)| {
                let opinion = Opinion::of_scores(scores)?.on_scale(study.scale);
                Some(RatedStimulus { stimulus: s.clone(), opinion })
            })
            .collect()
    }

    /// ICC(2,1) and ICC(2,k), where everybody rated everything.
    fn two_way(&self, study: &StudyOpinions) -> Result<Intraclass, StudyError> {
        let stimuli = study.stimuli.len();
        if let Some((participant, judged)) = self.names.iter().find(|(_, judged)| *judged < stimuli) {
            let (participant, missing) = (participant.clone(), stimuli - judged);
            return Err(StudyError::Incomplete { participant, missing, stimuli });
        }
        two_way(&self.scores)
    }
}

/// Mean opinion scores and sample variances, in grades, of what has at least two scores on `scale`.
pub(super) fn means_and_variances<'a>(
    opinions: impl Iterator<Item = &'a Opinion>,
    scale: RatingScale,
) -> (Vec<f64>, Vec<f64>) {
    let grades = |deviation: f64| if scale.is_grades() { deviation } else { deviation / scale.unit().abs() };
    opinions.filter_map(|o| Some((scale.grade(o.mos), grades(o.deviation?).powi(2)))).unzip()
}

/// Mean of a list that has some value.
pub(super) fn mean(values: &[f64]) -> Option<f64> {
    Moments::of(values).map(|m| m.mean)
}
