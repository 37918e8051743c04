//! The benchmark: every contender on the same splits, rows and resamples.
//!
//! A contender learns inside the training side of each split; a classical distance has only its logistic map fitted
//! there. Splits are those of [`crate::samples::split`]: by material with its sisters, by method family *and* material, by
//! type of material. Differences are paired with the metric that the run is about; see [`super::bootstrap`].

use super::EvaluationError;
use super::agreement::{Figure, Predictions};
use super::benchmark::{Judged, JudgedMetric, Jury, prediction_records, residuals_by_material};
use super::bootstrap::Interval as Bounds;
use super::calibration::Calibration;
use super::cross_validation::{
    OutOfFold, cross_validate, cross_validate_distance, cross_validate_mean, cross_validate_scores,
    cross_validate_spread, in_sample,
};
use super::importance::{permuted, with_share};
use super::records::{
    AblationRecord, CurvePoint, CurveRecord, DifferenceRecord, ImportanceRecord, LearningPoint, MaterialResidual,
    MethodResidual, MetricKind, MetricRecord, PredictionRecord, Split,
};
use super::triplets::{TripletAgreement, cross_validate_triplets};
use crate::dataset::{NamedRows, Row};
use crate::samples::Samples;
use crate::samples::split::{Fold, grouped_folds, material_type_folds, method_and_group_folds};
use crate::train::Trainer;
use crate::train::trivial::MeanOf;
use vernis_metric::math::correlation::pearson;
use vernis_metric::metric::learned::exported::Interval;

/// Share of ratings that the interval of a score shall hold.
pub const INTERVAL_LEVEL: f64 = 0.95;

/// How a benchmark is run.
#[derive(Debug, Clone)]
pub struct Protocol {
    /// Folds by material group.
    pub folds: usize,
    /// Folds by material group within each family of methods that is left out.
    pub method_folds: usize,
    /// Bootstrap resamples of materials.
    pub resamples: usize,
    /// Seed of folds, training and resamples.
    pub seed: u64,
    /// Method families that the second set of rows leaves out.
    pub set_aside: Vec<String>,
    /// Further sets of rows, by name, that metrics are judged on.
    pub row_sets: Vec<NamedRows>,
    /// The splits that the study supports; [`Split::UnseenMaterial`] is one of them.
    pub splits: Vec<Split>,
    /// Shares of the training materials that the learning curve has; none: there is no curve.
    pub shares: Vec<f64>,
}

/// What a contender knows.
#[non_exhaustive]
pub enum Source<'a> {
    /// Learns from the columns of its samples.
    Trainer(&'a dyn Trainer, &'a Samples),
    /// A column of the samples that holds a distance.
    Distance(&'a Samples),
    /// A mean of ratings.
    Means(MeanOf),
    /// The mean of contenders that were judged before, as an average of their trainers would predict.
    MeanOf(&'a [&'a str]),
}

/// One metric of the benchmark.
pub struct Contender<'a> {
    /// Name of the metric.
    pub name: String,
    /// What kind of metric it is.
    pub kind: MetricKind,
    /// One line: what it is, what to know of the figures.
    pub note: String,
    /// Where its predictions come from.
    pub source: Source<'a>,
}

/// A model retrained with other descriptors. Folds are given, for descriptors may be learned inside each.
pub struct AblationCase {
    /// Such as `without lights` or `only angular`.
    pub name: String,
    /// Number of descriptors that the model takes.
    pub columns: usize,
    /// The rows with these descriptors.
    pub samples: Samples,
    /// Folds by material group.
    pub by_material: Vec<Fold>,
    /// Folds by family of methods and material group; `None` where the study does not support them.
    pub by_method: Option<Vec<Fold>>,
}

impl AblationCase {
    /// The same descriptors in every fold.
    pub fn new(name: &str, samples: Samples, protocol: &Protocol) -> Result<Self, EvaluationError> {
        let by_material = grouped_folds(&samples, protocol.folds, protocol.seed)?;
        let unseen_method = protocol.splits.contains(&Split::UnseenMaterialAndMethod);
        let by_method = unseen_method
            .then(|| method_and_group_folds(&samples, protocol.method_folds, protocol.seed))
            .transpose()?;
        Ok(Self { name: name.to_owned(), columns: samples.columns().len(), samples, by_material, by_method })
    }
}

/// Standard deviations of the members' predictions for rows that they have not seen, in MOS, one a row.
#[derive(Debug, Clone)]
pub struct Spreads {
    /// By members that have not seen the row's material.
    pub unseen_material: Vec<f64>,
    /// By members that have seen neither material nor method; `None` where the study does not support that split.
    pub unseen_method: Option<Vec<f64>>,
}

/// Metrics judged on one study.
pub struct Bench {
    protocol: Protocol,
    samples: Samples,
    jury: Jury,
    judged: Vec<JudgedMetric>,
    predictions: Vec<(String, Split, Predictions)>,
    /// By name, of metrics that are judged by their distances, one a row.
    distances: Vec<(String, Vec<f64>)>,
}

impl Bench {
    /// `samples` names the rows; contenders may see other columns of the same rows.
    pub fn new(protocol: Protocol, samples: &Samples) -> Result<Self, EvaluationError> {
        let aside = protocol.set_aside.clone();
        let is_aside = |row: &Row| aside.contains(&row.method_family);
        let jury = Jury::new(samples.rows(), is_aside, &protocol.row_sets, protocol.resamples, protocol.seed)?;
        Ok(Self {
            protocol,
            samples: samples.clone(),
            jury,
            judged: Vec::new(),
            predictions: Vec::new(),
            distances: Vec::new(),
        })
    }

    /// Runs a contender through every split that it can take part in. Gives the splits that it was not judged on, each with the
    /// reason.
    ///
    /// # Errors
    /// It cannot be judged on unseen materials: it takes no part.
    pub fn judge(&mut self, contender: &Contender<'_>) -> Result<Vec<(Split, EvaluationError)>, EvaluationError> {
        let name = contender.name.as_str();
        let (mut judged, mut predictions, mut failed) = (Vec::new(), Vec::new(), Vec::new());
        let mut folds = Vec::new();
        for split in [Split::UnseenMaterial, Split::UnseenMaterialAndMethod, Split::UnseenMaterialType] {
            let found = self.out_of_fold_of(contender, split).and_then(|found| {
                let Some(found) = found else { return Ok(None) };
                Ok(Some((self.jury.judge(name, split, &found.predictions)?, found)))
            });
            match found {
                Ok(None) => {}
                Ok(Some((of_split, found))) => {
                    judged.extend(of_split);
                    if split == Split::UnseenMaterial {
                        folds = found.folds;
                    }
                    predictions.push((name.to_owned(), split, found.predictions));
                }
                Err(error) if split == Split::UnseenMaterial => return Err(error),
                Err(error) => failed.push((split, error)),
            }
        }
        if let Source::Distance(samples) = &contender.source {
            let of_sample = in_sample(samples, name).and_then(|found| self.jury.judge(name, Split::InSample, &found));
            match of_sample {
                Ok(of_sample) => judged.extend(of_sample),
                Err(error) => failed.push((Split::InSample, error)),
            }
            let column = samples.columns().iter().position(|column| column.name == name);
            self.distances.extend(column.map(|column| (name.to_owned(), samples.column(column).to_vec())));
        }
        self.predictions.extend(predictions);
        let (kind, note) = (contender.kind, contender.note.clone());
        self.judged.push(JudgedMetric { name: name.to_owned(), kind, note, judged, folds });
        Ok(failed)
    }

    /// How what `trainer` learns agrees with triplets whose reference, or a sister of it, it has not seen; `None` without triplets.
    ///
    /// # Errors
    /// A fold on which nothing can be learned.
    pub fn triplets(
        &self,
        trainer: &dyn Trainer,
        samples: &Samples,
    ) -> Result<Option<TripletAgreement>, EvaluationError> {
        let Some(folds) = self.folds(samples, Split::UnseenMaterial)? else { return Ok(None) };
        cross_validate_triplets(samples, &folds, trainer, self.protocol.resamples, self.protocol.seed)
    }

    /// Whether a metric was judged.
    pub fn has(&self, name: &str) -> bool {
        self.judged.iter().any(|judged| judged.name == name)
    }

    /// How the metrics are judged.
    pub fn protocol(&self) -> &Protocol {
        &self.protocol
    }

    /// `None` where the split does not exist in this study, or the contender has nothing to say.
    fn out_of_fold_of(&self, contender: &Contender<'_>, split: Split) -> Result<Option<OutOfFold>, EvaluationError> {
        let seed = self.protocol.seed;
        let samples = match &contender.source {
            Source::Trainer(_, samples) | Source::Distance(samples) => samples,
            Source::Means(_) | Source::MeanOf(_) => &self.samples,
        };
        let Some(folds) = self.folds(samples, split)? else { return Ok(None) };
        Ok(Some(match &contender.source {
            Source::Trainer(trainer, samples) => cross_validate(samples, &folds, *trainer, seed)?,
            Source::Distance(samples) => cross_validate_distance(samples, &folds, &contender.name)?,
            // A mean of the method has nothing to say of a method that it has not seen.
            Source::Means(_) if split == Split::UnseenMaterialAndMethod => return Ok(None),
            Source::Means(means) => cross_validate_mean(&self.samples, &folds, *means)?,
            Source::MeanOf(parts) => {
                let parts: Vec<Vec<f64>> = parts
                    .iter()
                    .map(|part| Ok(self.found(part, split)?.score.clone()))
                    .collect::<Result<_, EvaluationError>>()?;
                cross_validate_scores(&contender.name, &self.samples, &folds, &mean_of(&parts))?
            }
        }))
    }

    fn folds(&self, samples: &Samples, split: Split) -> Result<Option<Vec<Fold>>, EvaluationError> {
        let Protocol { folds, method_folds, seed, .. } = self.protocol;
        if !self.protocol.splits.contains(&split) {
            return Ok(None);
        }
        Ok(match split {
            Split::UnseenMaterial => Some(grouped_folds(samples, folds, seed)?),
            Split::UnseenMaterialAndMethod => Some(method_and_group_folds(samples, method_folds, seed)?),
            Split::UnseenMaterialType => Some(material_type_folds(samples)?),
            Split::InSample => None,
        })
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
        if let Some(by_method) = &case.by_method {
            let unseen = cross_validate(&case.samples, by_method, trainer, seed)?;
            judged.extend(self.jury.judge(&case.name, Split::UnseenMaterialAndMethod, &unseen.predictions)?);
        }
        Ok(self.jury.ablation(&case.name, case.columns, full, &judged))
    }

    /// What `trainer` loses when columns of `samples` are exchanged between rows: each family, then the `most` single ones that
    /// cost it most. The change is against the contender called `against`, the same trainer on the same columns.
    pub fn importance(
        &self,
        trainer: &dyn Trainer,
        against: &str,
        samples: &Samples,
        most: usize,
    ) -> Result<Vec<ImportanceRecord>, EvaluationError> {
        let full = self.find(against)?;
        let Protocol { folds, seed, .. } = self.protocol;
        let folds = grouped_folds(samples, folds, seed)?;
        let columns = samples.columns();
        let mut families: Vec<&str> = Vec::new();
        for column in columns {
            if !families.contains(&column.family.as_str()) {
                families.push(&column.family);
            }
        }
        let mut sets: Vec<(&str, Vec<usize>)> = families
            .iter()
            .map(|&family| (family, (0..columns.len()).filter(|&c| columns[c].family == family).collect()))
            .collect();
        sets.extend(columns.iter().enumerate().map(|(index, column)| (column.name.as_str(), vec![index])));
        let indices: Vec<Vec<usize>> = sets.iter().map(|(_, columns)| columns.clone()).collect();
        let predicted = permuted(samples, &folds, trainer, seed, &indices)?;
        let ratings: Vec<f64> = samples.rows().iter().map(|r| r.mos).collect();
        let left = |p: &Predictions| pearson(&p.mos, &ratings).unwrap_or(0.0);
        let mut single: Vec<usize> = (families.len()..sets.len()).collect();
        single.sort_by(|&a, &b| left(&predicted[a]).total_cmp(&left(&predicted[b])));
        let record = |set: usize| {
            let (name, columns) = &sets[set];
            let judged = self.jury.judge(name, Split::UnseenMaterial, &predicted[set])?;
            let found = self.jury.ablation(name, columns.len(), full, &judged);
            let (plcc_change, srocc_change) = (found.plcc_change, found.srocc_change);
            Ok(ImportanceRecord { name: (*name).to_owned(), columns: columns.len(), plcc_change, srocc_change })
        };
        (0..families.len()).chain(single.into_iter().take(most)).map(record).collect()
    }

    /// Agreement of `trainer` for unseen materials when it is trained on fewer.
    pub fn learning_curve(
        &self,
        trainer: &dyn Trainer,
        samples: &Samples,
    ) -> Result<Vec<LearningPoint>, EvaluationError> {
        let Protocol { folds, seed, .. } = self.protocol;
        let folds = grouped_folds(samples, folds, seed)?;
        let point = |share: f64| {
            let (predictions, groups) = with_share(samples, &folds, trainer, seed, share)?;
            let judged = self.jury.judge(trainer.name(), Split::UnseenMaterial, &predictions)?;
            Ok(LearningPoint { groups, judgements: judged.iter().map(Judged::record).collect() })
        };
        self.protocol.shares.iter().copied().map(point).collect()
    }

    /// The distances of the column called `metric`, the ratings, and the logistic curve between them, fitted on all rows.
    pub fn curve(&self, samples: &Samples, metric: &str) -> Result<CurveRecord, EvaluationError> {
        let Predictions { score, mos, .. } = in_sample(samples, metric)?;
        let point = |((row, score), mapped): ((&Row, f64), f64)| CurvePoint {
            method: row.method.clone(),
            distance: -score,
            mos: row.mos,
            mapped,
        };
        let points = samples.rows().iter().zip(score).zip(mos).map(point).collect();
        Ok(CurveRecord { metric: metric.to_owned(), points })
    }

    /// Differences of every other contender of `others` to `subject`, Holm-corrected.
    pub fn differences(&self, subject: &str, others: &[&str]) -> Result<Vec<DifferenceRecord>, EvaluationError> {
        let pairs: Vec<(&str, &str)> = others.iter().map(|other| (subject, *other)).collect();
        self.jury.differences(&self.judged, &pairs, &[Figure::Plcc, Figure::Srocc])
    }

    /// The record of every contender that was judged, in order.
    pub fn metrics(&self) -> Vec<MetricRecord> {
        self.judged.iter().map(JudgedMetric::record).collect()
    }

    /// Errors of `subject` for unseen materials, by material, the largest root mean square first.
    pub fn residuals(&self, subject: &str) -> Result<Vec<MaterialResidual>, EvaluationError> {
        Ok(residuals_by_material(self.samples.rows(), self.out_of_fold(subject)?))
    }

    /// Errors of `subject` by method: for unseen materials, and for unseen methods too where the study has several.
    pub fn method_residuals(&self, subject: &str) -> Vec<MethodResidual> {
        let of = |split| self.found(subject, split).ok().map(|found| self.jury.residuals_by_method(found, split));
        [Split::UnseenMaterial, Split::UnseenMaterialAndMethod].into_iter().filter_map(of).flatten().collect()
    }

    /// What each metric of `headline` predicted for rows whose material it has not seen, with the distances of all that have any.
    pub fn prediction_records(&self, headline: &[String]) -> Vec<PredictionRecord> {
        let found: Vec<(&str, &Predictions)> = self
            .predictions
            .iter()
            .filter(|(name, split, _)| *split == Split::UnseenMaterial && headline.contains(name))
            .map(|(name, _, predictions)| (name.as_str(), predictions))
            .collect();
        let mut records = prediction_records(self.samples.rows(), &found);
        for (name, distances) in &self.distances {
            records.iter_mut().zip(distances).for_each(|(row, distance)| {
                row.distances.insert(name.clone(), *distance);
            });
        }
        records
    }

    /// How far `members` models of `member` differ on rows that they have not seen, each trained on resampled materials of the training
    /// side of a fold: what the intervals of several metrics may be calibrated with.
    pub fn spreads(&self, member: &dyn Trainer, samples: &Samples, members: usize) -> Result<Spreads, EvaluationError> {
        let seed = self.protocol.seed;
        let of = |split| {
            let folds = self.folds(samples, split)?;
            folds.map(|folds| cross_validate_spread(samples, &folds, member, members, seed)).transpose()
        };
        let Some(unseen_material) = of(Split::UnseenMaterial)? else {
            return Err(EvaluationError::TooFew { what: "rows to calibrate on", found: 0, least: 1 });
        };
        Ok(Spreads { unseen_material, unseen_method: of(Split::UnseenMaterialAndMethod)? })
    }

    /// The interval of a score, calibrated on rows whose material the metric has not seen, and how well such an interval holds: for
    /// each fold's rows it is calibrated on the other folds. The same intervals are held against predictions by models that have not
    /// seen the method either.
    pub fn intervals(&self, subject: &str, spreads: &Spreads) -> Result<(Interval, Calibration), EvaluationError> {
        let Protocol { folds, seed, .. } = self.protocol;
        let folds = grouped_folds(&self.samples, folds, seed)?;
        let score = &self.out_of_fold(subject)?.score;
        let mos: Vec<f64> = self.samples.rows().iter().map(|r| r.mos).collect();
        let residual: Vec<f64> = mos.iter().zip(score).map(|(m, s)| m - s).collect();
        let calibrate = |rows: &[usize]| {
            let pick = |values: &[f64]| rows.iter().map(|&i| values[i]).collect::<Vec<f64>>();
            let found = Interval::calibrate(&pick(&residual), &pick(&spreads.unseen_material), INTERVAL_LEVEL);
            found.ok_or(EvaluationError::TooFew { what: "rows to calibrate on", found: rows.len(), least: 1 })
        };
        // The interval of each row, from the folds that do not hold its material.
        let mut of_row = vec![Interval { level: INTERVAL_LEVEL, factor: 0.0, offset: 0.0 }; mos.len()];
        for fold in &folds {
            let held = fold.held_out.indices();
            let others: Vec<usize> = (0..mos.len()).filter(|i| !held.contains(i)).collect();
            let interval = calibrate(&others)?;
            held.iter().for_each(|&i| of_row[i] = interval);
        }
        let covered = |score: &[f64], spread: &[f64]| {
            let bounds = of_row.iter().zip(score).zip(spread).map(|((interval, score), spread)| {
                let half = interval.factor * (spread + interval.offset);
                let clip = |x: f64| x.clamp(1.0, 5.0);
                Bounds { low: clip(score - half), high: clip(score + half) }
            });
            Calibration::of(&mos, &bounds.collect::<Vec<_>>(), INTERVAL_LEVEL)
        };
        let mut calibration = covered(score, &spreads.unseen_material)?;
        let unseen = self.found(subject, Split::UnseenMaterialAndMethod);
        if let (Some(spread), Ok(unseen)) = (&spreads.unseen_method, unseen) {
            calibration.unseen_method = Some(covered(&unseen.score, spread)?.into());
        }
        let all: Vec<usize> = (0..mos.len()).collect();
        Ok((calibrate(&all)?, calibration))
    }

    /// What `subject` predicts for rows whose material it has not seen.
    pub fn out_of_fold(&self, subject: &str) -> Result<&Predictions, EvaluationError> {
        self.found(subject, Split::UnseenMaterial)
    }

    fn found(&self, name: &str, split: Split) -> Result<&Predictions, EvaluationError> {
        let found = self.predictions.iter().find(|(n, s, _)| n == name && *s == split);
        found.map(|(_, _, predictions)| predictions).ok_or_else(|| self.unknown(name))
    }

    fn find(&self, name: &str) -> Result<&JudgedMetric, EvaluationError> {
        self.judged.iter().find(|m| m.name == name).ok_or_else(|| self.unknown(name))
    }

    fn unknown(&self, name: &str) -> EvaluationError {
        let judged = self.judged.iter().map(|m| m.name.as_str()).collect::<Vec<_>>().join(", ");
        EvaluationError::UnknownMetric { name: name.to_owned(), judged }
    }
}

fn mean_of(parts: &[Vec<f64>]) -> Vec<f64> {
    let n = parts.len() as f64;
    (0..parts.first().map_or(0, Vec::len)).map(|i| parts.iter().map(|p| p[i]).sum::<f64>() / n).collect()
}
