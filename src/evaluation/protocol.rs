//! The benchmark: every contender on the same splits, rows and resamples.
//!
//! A contender learns inside the training side of each split; a classical distance has only its logistic map fitted
//! there. Splits are those of [`crate::dataset::split`]: by material with its sisters, by method family *and* material, by
//! type of material. Differences are paired with the metric that the run is about; see [`super::bootstrap`].

use super::EvaluationError;
use super::agreement::{Figure, Predictions};
use super::benchmark::{JudgedMetric, Jury, prediction_records, residuals_by_material};
use super::bootstrap::Interval as Bounds;
use super::calibration::Calibration;
use super::cross_validation::{
    OutOfFold, cross_validate, cross_validate_distance, cross_validate_mean, cross_validate_spread, in_sample,
};
use super::records::{
    AblationRecord, DifferenceRecord, MaterialResidual, MetricKind, MetricRecord, PredictionRecord, Split,
};
use crate::dataset::samples::Samples;
use crate::dataset::split::{Fold, grouped_folds, material_type_folds, method_and_group_folds};
use crate::metric::learned::exported::Interval;
use crate::train::Trainer;
use crate::train::trivial::MeanOf;

/// Share of ratings that the interval of a score shall hold.
pub const INTERVAL_LEVEL: f64 = 0.95;

/// How a benchmark is run.
#[derive(Debug, Clone)]
pub struct Protocol {
    /// Folds by material group.
    pub folds: usize,
    /// Bootstrap resamples of materials.
    pub resamples: usize,
    pub seed: u64,
    /// Method families that the second set of rows leaves out.
    pub set_aside: Vec<String>,
}

/// What a contender knows.
pub enum Source<'a> {
    /// Learns from the columns of its samples.
    Trainer(&'a dyn Trainer, &'a Samples),
    /// A column of the samples that holds a distance.
    Distance(&'a Samples),
    /// A mean of ratings.
    Means(MeanOf),
}

/// One metric of the benchmark.
pub struct Contender<'a> {
    pub name: String,
    pub kind: MetricKind,
    pub note: String,
    pub source: Source<'a>,
}

/// A model retrained with other descriptors. Folds are given, for descriptors may be learned inside each.
pub struct AblationCase {
    pub name: String,
    pub columns: usize,
    pub samples: Samples,
    pub by_material: Vec<Fold>,
    pub by_method: Vec<Fold>,
}

impl AblationCase {
    /// The same descriptors in every fold.
    pub fn new(name: &str, samples: Samples, protocol: &Protocol) -> Result<Self, EvaluationError> {
        let by_material = grouped_folds(&samples, protocol.folds, protocol.seed)?;
        let by_method = method_and_group_folds(&samples, protocol.folds, protocol.seed)?;
        Ok(Self { name: name.to_owned(), columns: samples.columns().len(), samples, by_material, by_method })
    }
}

/// Metrics judged on one study.
pub struct Bench {
    protocol: Protocol,
    samples: Samples,
    jury: Jury,
    judged: Vec<JudgedMetric>,
    predictions: Vec<(String, Predictions)>,
}

impl Bench {
    /// `samples` names the rows; contenders may see other columns of the same rows.
    pub fn new(protocol: Protocol, samples: &Samples) -> Result<Self, EvaluationError> {
        let aside = protocol.set_aside.clone();
        let jury =
            Jury::new(samples.rows(), |row| aside.contains(&row.method_family), protocol.resamples, protocol.seed)?;
        Ok(Self { protocol, samples: samples.clone(), jury, judged: Vec::new(), predictions: Vec::new() })
    }

    /// Runs a contender through every split that it can take part in.
    pub fn judge(&mut self, contender: &Contender<'_>) -> Result<(), EvaluationError> {
        let Protocol { folds, seed, .. } = self.protocol;
        let samples = match &contender.source {
            Source::Trainer(_, samples) | Source::Distance(samples) => samples,
            Source::Means(_) => &self.samples,
        };
        let run = |folds: &[Fold]| -> Result<OutOfFold, EvaluationError> {
            match &contender.source {
                Source::Trainer(trainer, samples) => cross_validate(samples, folds, *trainer, seed),
                Source::Distance(samples) => cross_validate_distance(samples, folds, &contender.name),
                Source::Means(means) => cross_validate_mean(&self.samples, folds, *means),
            }
        };
        let main = run(&grouped_folds(samples, folds, seed)?)?;
        let mut judged = self.jury.judge(&contender.name, Split::UnseenMaterial, &main.predictions)?;
        // A mean of the method has nothing to say of a method that it has not seen.
        if !matches!(contender.source, Source::Means(_)) {
            if families(samples) > 1 {
                let found = run(&method_and_group_folds(samples, folds, seed)?)?;
                judged.extend(self.jury.judge(&contender.name, Split::UnseenMaterialAndMethod, &found.predictions)?);
            }
            if types(samples) > 1 {
                let found = run(&material_type_folds(samples)?)?;
                judged.extend(self.jury.judge(&contender.name, Split::UnseenMaterialType, &found.predictions)?);
            }
        }
        if let Source::Distance(samples) = &contender.source {
            let found = in_sample(samples, &contender.name)?;
            judged.extend(self.jury.judge(&contender.name, Split::InSample, &found)?);
        }
        self.predictions.push((contender.name.clone(), main.predictions));
        self.judged.push(JudgedMetric {
            name: contender.name.clone(),
            kind: contender.kind,
            note: contender.note.clone(),
            judged,
            folds: main.folds,
        });
        Ok(())
    }

    /// Retrains `trainer` on other descriptors; the change is against the contender called `against`, which must be the
    /// same trainer on all of its descriptors.
    pub fn ablate(
        &self,
        case: &AblationCase,
        trainer: &dyn Trainer,
        against: &str,
    ) -> Result<AblationRecord, EvaluationError> {
        let full = self.find(against)?;
        let seed = self.protocol.seed;
        let main = cross_validate(&case.samples, &case.by_material, trainer, seed)?;
        let mut judged = self.jury.judge(&case.name, Split::UnseenMaterial, &main.predictions)?;
        let unseen = cross_validate(&case.samples, &case.by_method, trainer, seed)?;
        judged.extend(self.jury.judge(&case.name, Split::UnseenMaterialAndMethod, &unseen.predictions)?);
        Ok(self.jury.ablation(&case.name, case.columns, full, &judged))
    }

    /// Differences of every other contender of `others` to `subject`, Holm-corrected.
    pub fn differences(&self, subject: &str, others: &[&str]) -> Result<Vec<DifferenceRecord>, EvaluationError> {
        let pairs: Vec<(&str, &str)> = others.iter().map(|other| (subject, *other)).collect();
        self.jury.differences(&self.judged, &pairs, &[Figure::Plcc, Figure::Srocc])
    }

    pub fn metrics(&self) -> Vec<MetricRecord> {
        self.judged.iter().map(JudgedMetric::record).collect()
    }

    pub fn residuals(&self, subject: &str) -> Result<Vec<MaterialResidual>, EvaluationError> {
        Ok(residuals_by_material(self.samples.rows(), self.out_of_fold(subject)?))
    }

    pub fn prediction_records(&self, headline: &[String]) -> Vec<PredictionRecord> {
        let found: Vec<(&str, &Predictions)> = self
            .predictions
            .iter()
            .filter(|(name, _)| headline.contains(name))
            .map(|(name, predictions)| (name.as_str(), predictions))
            .collect();
        prediction_records(self.samples.rows(), &found)
    }

    /// The interval of a score, calibrated on rows that the metric has not seen, and how well such an interval holds: for
    /// each fold's rows it is calibrated on the other folds.
    pub fn intervals(
        &self,
        subject: &str,
        member: &dyn Trainer,
        samples: &Samples,
        members: usize,
    ) -> Result<(Interval, Calibration), EvaluationError> {
        let Protocol { folds, seed, .. } = self.protocol;
        let folds = grouped_folds(samples, folds, seed)?;
        let score = &self.out_of_fold(subject)?.score;
        let spread = cross_validate_spread(samples, &folds, member, members, seed)?;
        let mos: Vec<f64> = samples.rows().iter().map(|r| r.mos).collect();
        let residual: Vec<f64> = mos.iter().zip(score).map(|(m, s)| m - s).collect();
        let calibrate = |rows: &[usize]| {
            let pick = |values: &[f64]| rows.iter().map(|&i| values[i]).collect::<Vec<f64>>();
            Interval::calibrate(&pick(&residual), &pick(&spread), INTERVAL_LEVEL).ok_or(EvaluationError::TooFew {
                what: "rows to calibrate on",
                found: rows.len(),
                least: 1,
            })
        };
        let mut bounds = vec![Bounds { low: 0.0, high: 0.0 }; mos.len()];
        for fold in &folds {
            let held = fold.held_out.indices();
            let others: Vec<usize> = (0..mos.len()).filter(|i| !held.contains(i)).collect();
            let interval = calibrate(&others)?;
            for &i in held {
                let half = interval.factor * (spread[i] + interval.offset);
                let clip = |x: f64| x.clamp(1.0, 5.0);
                bounds[i] = Bounds { low: clip(score[i] - half), high: clip(score[i] + half) };
            }
        }
        let all: Vec<usize> = (0..mos.len()).collect();
        Ok((calibrate(&all)?, Calibration::of(&mos, &bounds, INTERVAL_LEVEL)?))
    }

    /// What `subject` predicts for rows whose material it has not seen.
    pub fn out_of_fold(&self, subject: &str) -> Result<&Predictions, EvaluationError> {
        let found = self.predictions.iter().find(|(name, _)| name == subject);
        found.map(|(_, predictions)| predictions).ok_or_else(|| self.unknown(subject))
    }

    fn find(&self, name: &str) -> Result<&JudgedMetric, EvaluationError> {
        self.judged.iter().find(|m| m.name == name).ok_or_else(|| self.unknown(name))
    }

    fn unknown(&self, name: &str) -> EvaluationError {
        let judged = self.judged.iter().map(|m| m.name.as_str()).collect::<Vec<_>>().join(", ");
        EvaluationError::UnknownMetric { name: name.to_owned(), judged }
    }
}

fn families(samples: &Samples) -> usize {
    samples.rows().iter().map(|r| &r.method_family).collect::<std::collections::BTreeSet<_>>().len()
}

fn types(samples: &Samples) -> usize {
    samples.rows().iter().filter_map(|r| r.material_type.as_ref()).collect::<std::collections::BTreeSet<_>>().len()
}
