//! Who did not look: three checks of a participant.
//!
//! * **Gold**: the part of control questions answered within [`GOLD_TOLERANCE`] grades of the expected score is below
//!   [`GOLD_ACCURACY`] (section 4.2 of Lavoue et al. 2021, doi:10.1111/cgf.142636; what counts as "very different" is
//!   not stated there and is more than one grade here).
//! * **Time**: a mean answer takes less than [`LEAST_SECONDS`] (the same section: 10 s for 10 ratings).
//! * **Outlier**: clause 2.3.1 of annex 2 of ITU-R BT.500-13. With mean u_s, sample standard deviation S_s and kurtosis
//!   b_s = m4/m2^2 of the scores of stimulus s, a participant's score counts in P if it is u_s + c S_s or more, in Q if
//!   u_s - c S_s or less, c = 2 where 2 <= b_s <= 4 and sqrt 20 elsewhere; outlier if (P + Q)/J > 0.05 and
//!   |P - Q|/(P + Q) < 0.3, J the number of stimuli that the participant rated. Stimuli on which all agree count nothing.
//!
//! Outliers are looked for among those who pass the first two. Cost: linear.

use crate::dataset::raw_ratings::RawRatings;
use serde::{Deserialize, Serialize};

/// Least part of correct answers to control questions.
pub const GOLD_ACCURACY: f64 = 0.85;
/// Largest difference of a correct answer from the expected score, in grades.
pub const GOLD_TOLERANCE: f64 = 1.0;
/// Least mean time of an answer.
pub const LEAST_SECONDS: f64 = 1.0;

/// A check that can reject a participant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Criterion {
    /// Too few correct answers to control questions.
    Gold,
    /// Answers that take too little time.
    Time,
    /// Scores far from those of the others (ITU-R BT.500-13).
    Outlier,
}

/// One participant and what the checks say.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Participant {
    /// Name of the participant in the study's files.
    pub name: String,
    /// Number of judgements.
    pub judgements: usize,
    /// Part of the control questions answered correctly; `None` without any.
    pub gold_accuracy: Option<f64>,
    /// Mean time of an answer; `None` where no time was recorded.
    pub seconds: Option<f64>,
    /// P and Q of the outlier check; `None` for who had failed before.
    pub beyond: Option<[usize; 2]>,
    /// Every check that the participant fails.
    pub fails: Vec<Criterion>,
}

/// Checks every participant.
pub fn screen(raw: &RawRatings, stimuli: usize) -> Vec<Participant> {
    let mut checked = careless(raw);
    let looked = |p: usize| checked[p].fails.is_empty();
    let counts = beyond(raw, stimuli, looked);
    for (participant, [above, below]) in checked.iter_mut().zip(counts).filter(|(p, _)| p.fails.is_empty()) {
        participant.beyond = Some([above, below]);
        let (p, q, rated) = (above as f64, below as f64, participant.judgements as f64);
        if p + q > 0.05 * rated && (p - q).abs() < 0.3 * (p + q) {
            participant.fails.push(Criterion::Outlier);
        }
    }
    checked
}

/// A mean that grows value by value.
#[derive(Clone, Default)]
struct Running {
    sum: f64,
    n: usize,
}

impl Running {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.n += 1;
    }

    fn mean(&self) -> Option<f64> {
        (self.n > 0).then(|| self.sum / self.n as f64)
    }
}

/// The gold and time checks.
fn careless(raw: &RawRatings) -> Vec<Participant> {
    let people = raw.participants.len();
    let (mut gold, mut seconds) = (vec![Running::default(); people], vec![Running::default(); people]);
    let mut judgements = vec![0; people];
    for j in &raw.judgements {
        judgements[j.participant] += 1;
        j.seconds.into_iter().for_each(|s| seconds[j.participant].add(s));
    }
    for g in &raw.gold {
        let correct = (g.score - g.expected).abs() <= GOLD_TOLERANCE;
        gold[g.participant].add(f64::from(u8::from(correct)));
        g.seconds.into_iter().for_each(|s| seconds[g.participant].add(s));
    }
    let check = |(i, name): (usize, &String)| {
        let (gold_accuracy, seconds) = (gold[i].mean(), seconds[i].mean());
        let failed = [
            (Criterion::Gold, gold_accuracy.is_some_and(|a| a < GOLD_ACCURACY)),
            (Criterion::Time, seconds.is_some_and(|s| s < LEAST_SECONDS)),
        ];
        let fails = failed.into_iter().filter(|f| f.1).map(|f| f.0).collect();
        Participant { name: name.clone(), judgements: judgements[i], gold_accuracy, seconds, beyond: None, fails }
    };
    raw.participants.iter().enumerate().map(check).collect()
}

/// P and Q of every participant, among the scores of those who `looked`.
fn beyond(raw: &RawRatings, stimuli: usize, looked: impl Fn(usize) -> bool) -> Vec<[usize; 2]> {
    let mut by_stimulus: Vec<Vec<(usize, f64)>> = vec![Vec::new(); stimuli];
    for j in raw.judgements.iter().filter(|j| looked(j.participant)) {
        by_stimulus[j.stimulus].push((j.participant, j.score));
    }
    let mut counts = vec![[0, 0]; raw.participants.len()];
    for scores in by_stimulus.iter().filter(|s| s.len() > 1) {
        let n = scores.len() as f64;
        let mean = scores.iter().map(|s| s.1).sum::<f64>() / n;
        let moment = |power| scores.iter().map(|s| (s.1 - mean).powi(power)).sum::<f64>() / n;
        let (m2, m4) = (moment(2), moment(4));
        if m2 == 0.0 {
            continue;
        }
        let factor = if (2.0..=4.0).contains(&(m4 / (m2 * m2))) { 2.0 } else { 20f64.sqrt() };
        let reach = factor * (m2 * n / (n - 1.0)).sqrt();
        for &(participant, score) in scores {
            counts[participant][0] += usize::from(score >= mean + reach);
            counts[participant][1] += usize::from(score <= mean - reach);
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::raw_ratings::{GoldAnswer, Judgement};

    /// Scores by formula: 40 stimuli of 16 participants, of whom 3 and 7 answer at random.
    fn scores() -> Vec<Vec<f64>> {
        let score = |s: i64, p: i64| {
            let hash = (s * 7919 + p * 104729 + 12345) * (s + 3 * p + 1) % 97;
            let noise = i64::from(hash >= 81) - i64::from(hash < 16);
            if p == 3 || p == 7 { hash % 5 + 1 } else { (1 + s % 5 + noise).clamp(1, 5) }
        };
        (0..40).map(|s| (0..16).map(|p| score(s, p) as f64).collect()).collect()
    }

    fn raw(scores: &[Vec<f64>]) -> RawRatings {
        let participants = (0..scores[0].len()).map(|p| format!("p{p}")).collect();
        let judgement = |stimulus, participant, score| Judgement { participant, stimulus, score, seconds: None };
        let row = |(s, scores): (usize, &Vec<f64>)| -> Vec<Judgement> {
            scores.iter().enumerate().map(|(p, &score)| judgement(s, p, score)).collect()
        };
        RawRatings { participants, judgements: scores.iter().enumerate().flat_map(row).collect(), gold: vec![] }
    }

    #[test]
    fn outliers_agree_with_sureal() {
        // sureal 0.9.0, subject rejection of SubjectiveModel, with numpy.std(ddof=1) as equation 3 of the recommendation
        // has it: 40 (P + Q)/J = [0,1,0,7,0,1,0,8,0,0,0,1,0,1,0,0], |P - Q|/(P + Q) = 3/7 of participant 3 and 0 of
        // 7, so that 7 is rejected. (Its own ddof=0 rejects 3 as well.)
        let screened = screen(&raw(&scores()), 40);
        let found: Vec<usize> = screened.iter().map(|p| p.beyond.unwrap().iter().sum()).collect();
        assert_eq!(found, [0, 1, 0, 7, 0, 1, 0, 8, 0, 0, 0, 1, 0, 1, 0, 0]);
        assert_eq!((screened[3].beyond, screened[7].beyond), (Some([2, 5]), Some([4, 4])));
        let rejected: Vec<usize> = (0..16).filter(|&p| screened[p].fails == [Criterion::Outlier]).collect();
        assert_eq!(rejected, [7]);
    }

    #[test]
    fn wrong_gold_and_haste_are_found() {
        let mut raw = raw(&scores()[..5]);
        for j in raw.judgements.iter_mut().filter(|j| j.participant < 2) {
            j.seconds = Some(if j.participant == 0 { 0.4 } else { 3.0 });
        }
        // Participant 2 is wrong once in 7 (0.857), 4 once in 6 (0.833); a grade off is right.
        for (participant, wrong, questions) in [(2, 1, 7), (4, 1, 6)] {
            let answer =
                |q| GoldAnswer { participant, score: if q < wrong { 3.0 } else { 2.0 }, expected: 1.0, seconds: None };
            raw.gold.extend((0..questions).map(answer));
        }
        let screened = screen(&raw, 5);
        let failing = |c| (0..16).filter(|&p| screened[p].fails.contains(&c)).collect::<Vec<_>>();
        assert_eq!((failing(Criterion::Time), failing(Criterion::Gold)), (vec![0], vec![4]));
        assert_eq!((screened[1].seconds, screened[3].seconds, screened[5].gold_accuracy), (Some(3.0), None, None));
        // Who has failed is not looked at for outliers.
        assert_eq!((screened[0].beyond, screened[1].beyond.is_some()), (None, true));
    }

    #[test]
    fn agreement_of_all_makes_nobody_an_outlier() {
        let screened = screen(&raw(&vec![vec![3.0; 6]; 10]), 10);
        assert!(screened.iter().all(|p| p.fails.is_empty() && p.beyond == Some([0, 0])));
    }
}
