//! Which loss is better by which judge, paired over materials.
//!
//! For a judge's values a and b of the fits under a loss and under a baseline, of one material and model,
//!
//!   d = 200 (a - b) / (a + b) per cent for distances (0 where both are 0), d = a - b for opinion scores:
//!
//! distances of different materials differ by orders of magnitude, and d is the same with any unit. d_m is the mean over the
//! models, reported is the mean over materials, with the share of materials on which the loss is better. Intervals and
//! p-values are those of [`crate::evaluation::bootstrap`], materials drawn with replacement; p is corrected for all fair
//! comparisons with one baseline (Holm). The p-value of n materials is never below 2^(1 - n), that of a sign test on which all
//! agree: a handful of materials decides nothing, however alike they are.
//!
//! A comparison is fair where the judge is neither the loss nor the baseline.

use super::run::FitRecord;
use super::{Loss, OPINION};
use crate::evaluation::EvaluationError;
use crate::evaluation::bootstrap::{Difference, Interval, MIN_RESAMPLES, holm};
use crate::experiment::ExperimentError;
use std::collections::{BTreeMap, BTreeSet};
use vernis_metric::math::resampling::places;

/// Corrected p-values below this count as a difference.
const SIGNIFICANCE: f64 = 0.05;

/// What can be said of a loss.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The loss is better, with a corrected p below 0.05.
    Better,
    /// The loss is worse, with a corrected p below 0.05.
    Worse,
    /// The corrected p is 0.05 or more.
    Undecided,
    /// The judge is the loss or the baseline.
    NotFair,
}

/// A loss against a baseline by one judge.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Name of the judge.
    pub judge: String,
    /// The loss that is compared.
    pub loss: Loss,
    /// The loss that it is compared with.
    pub baseline: Loss,
    /// Per cent, or opinion scores for the judge `mos`; p is corrected where the comparison is fair.
    pub difference: Difference,
    /// Materials on which the loss is better, and their interval.
    pub wins: usize,
    /// The 95 % interval of `wins`, in materials.
    pub wins_interval: Interval,
    /// What the corrected p allows to say.
    pub verdict: Verdict,
}

/// The fits of all materials.
pub struct Judged {
    materials: Vec<String>,
    models: Vec<String>,
    losses: Vec<Loss>,
    judges: Vec<String>,
    values: BTreeMap<(usize, String, Loss), BTreeMap<String, f64>>,
}

impl Judged {
    /// From the records of each material.
    ///
    /// # Errors
    /// Fewer than two materials.
    pub fn new(records: &[Vec<FitRecord>]) -> Result<Self, ExperimentError> {
        if records.len() < 2 {
            let (what, found) = ("finished materials of the experiment", records.len());
            return Err(EvaluationError::TooFew { what, found, least: 2 }.into());
        }
        let (mut models, mut judges, mut losses) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
        let mut values = BTreeMap::new();
        for (m, record) in records.iter().enumerate().flat_map(|(m, all)| all.iter().map(move |r| (m, r))) {
            models.insert(record.fit.model.clone());
            losses.insert(record.loss);
            judges.extend(record.judged.keys().cloned());
            values.insert((m, record.fit.model.clone(), record.loss), record.judged.clone());
        }
        let material = |all: &Vec<FitRecord>| all.first().map(|r| r.material.clone()).unwrap_or_default();
        Ok(Self {
            materials: records.iter().map(material).collect(),
            models: models.into_iter().collect(),
            losses: losses.into_iter().collect(),
            judges: judges.into_iter().collect(),
            values,
        })
    }

    /// Names of the materials.
    pub fn materials(&self) -> &[String] {
        &self.materials
    }

    /// Identifiers of the models.
    pub fn models(&self) -> &[String] {
        &self.models
    }

    /// The losses, sorted.
    pub fn losses(&self) -> &[Loss] {
        &self.losses
    }

    /// Names, sorted.
    pub fn judges(&self) -> &[String] {
        &self.judges
    }

    /// Every loss of `losses` against `baseline` by every judge, on average over `models`; judge by judge.
    ///
    /// # Errors
    /// Too few resamples; a fit without a value.
    pub fn against(
        &self,
        baseline: Loss,
        losses: &[Loss],
        models: &[String],
        resamples: usize,
        seed: u64,
    ) -> Result<Vec<Comparison>, ExperimentError> {
        if resamples < MIN_RESAMPLES {
            let what = "resamples of a bootstrap";
            return Err(EvaluationError::TooFew { what, found: resamples, least: MIN_RESAMPLES }.into());
        }
        let draws = draws(self.materials.len(), resamples, seed);
        let mut all = Vec::new();
        for judge in &self.judges {
            for &loss in losses.iter().filter(|loss| **loss != baseline) {
                let mut differences = Vec::with_capacity(self.materials.len());
                for m in 0..self.materials.len() {
                    differences.push(self.difference(m, judge, loss, baseline, models)?);
                }
                all.push(comparison(judge, loss, baseline, &differences, &draws)?);
            }
        }
        decide(&mut all);
        Ok(all)
    }

    /// d_m.
    fn difference(
        &self,
        m: usize,
        judge: &str,
        loss: Loss,
        baseline: Loss,
        models: &[String],
    ) -> Result<f64, ExperimentError> {
        let value = |model: &String, loss: Loss| {
            let found = self.values.get(&(m, model.clone(), loss)).and_then(|v| v.get(judge));
            found.copied().ok_or_else(|| EvaluationError::UnknownMetric {
                name: format!("{judge} of {model} under {} for {}", loss.name(), self.materials[m]),
                judged: self.judges.join(", "),
            })
        };
        let mut sum = 0.0;
        for model in models {
            let (a, b) = (value(model, loss)?, value(model, baseline)?);
            sum += if judge == OPINION { a - b } else { relative(a, b) };
        }
        Ok(sum / models.len().max(1) as f64)
    }
}

/// 200 (a - b) / (a + b), for a, b not negative.
fn relative(a: f64, b: f64) -> f64 {
    if a + b > 0.0 { 200.0 * (a - b) / (a + b) } else { 0.0 }
}

/// Places of the materials in each resample.
fn draws(materials: usize, resamples: usize, seed: u64) -> Vec<Vec<usize>> {
    (0..resamples as u64).map(|index| places(materials, seed, "material-bootstrap", index).collect()).collect()
}

fn comparison(
    judge: &str,
    loss: Loss,
    baseline: Loss,
    differences: &[f64],
    draws: &[Vec<usize>],
) -> Result<Comparison, ExperimentError> {
    let better = |d: f64| if judge == OPINION { d > 0.0 } else { d < 0.0 };
    let mean = |places: &mut dyn Iterator<Item = usize>| -> f64 {
        places.map(|m| differences[m]).sum::<f64>() / differences.len() as f64
    };
    let none = || EvaluationError::TooFew { what: "resamples of a bootstrap", found: 0, least: MIN_RESAMPLES };
    let replicates = draws.iter().map(|draw| mean(&mut draw.iter().copied())).collect();
    let mut difference = Difference::of(mean(&mut (0..differences.len())), replicates).ok_or_else(none)?;
    difference.p = difference.p.max(0.5f64.powf(differences.len() as f64 - 1.0));
    let wins = |draw: &Vec<usize>| draw.iter().filter(|m| better(differences[**m])).count() as f64;
    Ok(Comparison {
        judge: judge.to_owned(),
        loss,
        baseline,
        difference,
        wins: differences.iter().filter(|d| better(**d)).count(),
        wins_interval: Interval::percentile(draws.iter().map(wins).collect()).ok_or_else(none)?,
        verdict: if [loss.name(), baseline.name()].contains(&judge) { Verdict::NotFair } else { Verdict::Undecided },
    })
}

/// Says of the fair comparisons what their corrected p-values allow.
fn decide(all: &mut [Comparison]) {
    let fair: Vec<usize> = (0..all.len()).filter(|&i| all[i].verdict != Verdict::NotFair).collect();
    let corrected = holm(&fair.iter().map(|&i| all[i].difference.p).collect::<Vec<_>>());
    for (i, p) in fair.into_iter().zip(corrected) {
        all[i].difference.p = p;
        if p < SIGNIFICANCE {
            let more = all[i].difference.difference > 0.0;
            all[i].verdict = if more == (all[i].judge == OPINION) { Verdict::Better } else { Verdict::Worse };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;
    use vernis_metric::math::seed;

    /// Differences of `n` materials around `mean`, evenly within +-`spread`.
    fn around(mean: f64, spread: f64, n: usize) -> Vec<f64> {
        let mut rng = seed::stream(1, "test", 0);
        (0..n).map(|_| mean + rng.random_range(-spread..spread)).collect()
    }

    fn compared(judge: &str, loss: Loss, differences: &[f64]) -> Comparison {
        let draws = draws(differences.len(), 1000, 1);
        let mut one = [comparison(judge, loss, Loss::Square, differences, &draws).unwrap()];
        decide(&mut one);
        one[0].clone()
    }

    #[test]
    fn relative_differences_do_not_depend_on_the_unit() {
        assert_eq!(relative(0.0, 0.0), 0.0);
        for unit in [1e-6, 1.0, 1e6] {
            assert!((relative(3.0 * unit, unit) - 100.0).abs() < 1e-12, "{unit}");
        }
        assert_eq!(relative(1.0, 3.0), -relative(3.0, 1.0));
    }

    #[test]
    fn what_is_there_is_found_and_what_is_not_stays_undecided() {
        let better = compared("energy", Loss::Blended, &around(-20.0, 30.0, 30));
        assert_eq!(better.verdict, Verdict::Better);
        assert!(better.difference.interval.contains(better.difference.difference));
        // The interval of the mean of 30 uniform numbers: about 1.96 * 60 / sqrt(12 * 30) on either side.
        let width = better.difference.interval.high - better.difference.interval.low;
        assert!((width - 12.4).abs() < 3.0, "{width}");
        assert!(better.wins_interval.contains(better.wins as f64));
        assert_eq!(compared("energy", Loss::Blended, &around(0.0, 30.0, 30)).verdict, Verdict::Undecided);
        assert_eq!(compared("energy", Loss::Blended, &around(-20.0, 1.0, 4)).verdict, Verdict::Undecided);
        // More is better of opinion scores alone.
        assert_eq!(compared(OPINION, Loss::Blended, &around(-0.2, 0.3, 30)).verdict, Verdict::Worse);
    }

    #[test]
    fn a_judge_that_was_the_loss_or_the_baseline_decides_nothing() {
        let differences = around(-20.0, 1.0, 30);
        assert_eq!(compared("D9.Cl", Loss::Logarithm, &differences).verdict, Verdict::NotFair);
        assert_eq!(compared("D4.Cl", Loss::Logarithm, &differences).verdict, Verdict::NotFair);
        assert_eq!(compared("D9.Cl", Loss::CubeRoot, &differences).verdict, Verdict::Better);
    }
}
