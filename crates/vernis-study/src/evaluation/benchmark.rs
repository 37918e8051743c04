//! Judges many metrics on the same rows and the same resamples.
//!
//! ```text
//! let jury = Jury::new(samples.rows(), |row| row.method_family == "NPF", &study.row_sets()?, DEFAULT_RESAMPLES, seed)?;
//! let mut verdict = jury.judge("D9.Cl", Split::UnseenMaterial, &out_of_fold.predictions)?;
//! verdict.extend(jury.judge("D9.Cl", Split::InSample, &in_sample(..)?)?);
//! ```
//!
//! Cost: about 30 ms a metric, split and set of rows for 2000 resamples of 500 rows on two threads.

use super::EvaluationError;
use super::agreement::{Figure, FoldMeans, Predictions, Ratings};
use super::bootstrap::{self, Bootstrapped, Resamples, holm};
use super::cross_validation::FoldRecord;
use super::dependent::DependentCorrelations;
use super::records::{
    AblationRecord, DifferenceRecord, Judgement, MaterialResidual, MethodResidual, MetricKind, MetricRecord,
    PredictionRecord, RowSet, Split,
};
use crate::dataset::{NamedRows, Row};
use std::collections::BTreeMap;
use vernis_metric::math::correlation::{pearson, spearman};
use vernis_metric::math::resampling::mean;

/// The rows of a study with their resamples, drawn once so that all metrics are judged on the same.
pub struct Jury {
    rows: Vec<Row>,
    benches: Vec<Bench>,
}

/// One set of rows.
struct Bench {
    row_set: RowSet,
    indices: Vec<usize>,
    ratings: Ratings,
    resamples: Resamples,
}

/// How one metric agrees with one set of rows; pairs with others of the same jury, split and rows.
#[derive(Debug, Clone)]
pub struct Judged {
    split: Split,
    row_set: RowSet,
    predictions: Predictions,
    bootstrapped: Bootstrapped,
    fold_means: Option<FoldMeans>,
}

impl Judged {
    /// The agreement as plain data.
    pub fn record(&self) -> Judgement {
        Judgement {
            split: self.split,
            row_set: self.row_set.clone(),
            rows: self.predictions.mos.len(),
            agreement: self.bootstrapped.agreement,
            intervals: self.bootstrapped.intervals,
            fold_means: self.fold_means,
        }
    }
}

/// One metric before it becomes a record.
#[derive(Debug, Clone)]
pub struct JudgedMetric {
    /// Name of the metric.
    pub name: String,
    /// What kind of metric it is.
    pub kind: MetricKind,
    /// One line: what it is, what to know of the figures.
    pub note: String,
    /// Its agreement, by split and set of rows.
    pub judged: Vec<Judged>,
    /// Its folds of the unseen-material split.
    pub folds: Vec<FoldRecord>,
}

impl JudgedMetric {
    /// The metric and its agreement as plain data.
    pub fn record(&self) -> MetricRecord {
        MetricRecord {
            version: None,
            name: self.name.clone(),
            kind: self.kind,
            note: self.note.clone(),
            judgements: self.judged.iter().map(Judged::record).collect(),
            folds: self.folds.clone(),
        }
    }

    fn find(&self, split: Split, row_set: &RowSet) -> Option<&Judged> {
        self.judged.iter().find(|j| j.split == split && j.row_set == *row_set)
    }
}

impl Jury {
    /// Errors of `predictions` by method, on the resamples of all rows.
    pub fn residuals_by_method(&self, predictions: &Predictions, split: Split) -> Vec<MethodResidual> {
        let all = self.benches.iter().find(|bench| bench.row_set == RowSet::All);
        all.map_or_else(Vec::new, |all| residuals_by_method(&self.rows, predictions, split, &all.resamples))
    }

    /// `set_aside` says which rows [`RowSet::WithoutSetAside`] leaves out, `named` which rows each [`RowSet::Named`] has. A set that
    /// would have no row, or all, does not exist.
    pub fn new(
        rows: &[Row],
        set_aside: impl Fn(&Row) -> bool,
        named: &[NamedRows],
        resamples: usize,
        seed: u64,
    ) -> Result<Self, EvaluationError> {
        let those = |keep: &dyn Fn(&Row) -> bool| (0..rows.len()).filter(|&i| keep(&rows[i])).collect::<Vec<usize>>();
        let mut sets = vec![(RowSet::WithoutSetAside, those(&|row| !set_aside(row)))];
        sets.extend(named.iter().map(|set| (RowSet::Named(set.name.clone()), those(&|row| set.has(row)))));
        sets.retain(|(_, kept)| !kept.is_empty() && kept.len() < rows.len());
        sets.insert(0, (RowSet::All, (0..rows.len()).collect()));
        let benches = sets
            .into_iter()
            .map(|(row_set, indices)| {
                let ratings = Ratings::of(indices.iter().map(|&i| &rows[i]));
                let resamples = bootstrap::draw(&ratings, resamples, seed)?;
                Ok(Bench { row_set, indices, ratings, resamples })
            })
            .collect::<Result<_, EvaluationError>>()?;
        Ok(Self { rows: rows.to_vec(), benches })
    }

    /// Judges `predictions`, one a row of the study, on each set of rows.
    pub fn judge(&self, metric: &str, split: Split, predictions: &Predictions) -> Result<Vec<Judged>, EvaluationError> {
        let (found, expected) = (predictions.score.len().min(predictions.mos.len()), self.rows.len());
        if found != expected {
            return Err(EvaluationError::Lengths { what: "predictions of a metric", found, expected });
        }
        let judge = |bench: &Bench| {
            let predictions = predictions.select(&bench.indices);
            let bootstrapped = Bootstrapped::of(metric, &bench.ratings, &predictions, &bench.resamples)?;
            let fold_means = FoldMeans::of(&bench.ratings, &predictions);
            Ok(Judged { split, row_set: bench.row_set.clone(), predictions, bootstrapped, fold_means })
        };
        self.benches.iter().map(judge).collect()
    }

    /// Each pair (a, b) of names in each of `figures`, under every split and set of rows that both were judged on;
    /// Holm-corrected over the pairs of the same figure, split and set of rows.
    pub fn differences(
        &self,
        metrics: &[JudgedMetric],
        pairs: &[(&str, &str)],
        figures: &[Figure],
    ) -> Result<Vec<DifferenceRecord>, EvaluationError> {
        let find = |name: &str| {
            metrics.iter().find(|m| m.name == name).ok_or_else(|| EvaluationError::UnknownMetric {
                name: name.to_owned(),
                judged: metrics.iter().map(|m| m.name.as_str()).collect::<Vec<_>>().join(", "),
            })
        };
        let pairs: Vec<(&JudgedMetric, &JudgedMetric)> =
            pairs.iter().map(|&(a, b)| Ok((find(a)?, find(b)?))).collect::<Result<_, EvaluationError>>()?;
        let mut records = Vec::new();
        for split in Split::ALL {
            for bench in &self.benches {
                for &figure in figures {
                    let family: Vec<DifferenceRecord> =
                        pairs.iter().filter_map(|(a, b)| difference(a, b, figure, split, bench)).collect();
                    let corrected = holm(&family.iter().map(|r| r.paired.p).collect::<Vec<f64>>());
                    records.extend(
                        family.into_iter().zip(corrected).map(|(record, holm_p)| DifferenceRecord { holm_p, ..record }),
                    );
                }
            }
        }
        Ok(records)
    }

    /// The metric retrained on `columns` descriptors, against the full one.
    pub fn ablation(&self, name: &str, columns: usize, full: &JudgedMetric, ablated: &[Judged]) -> AblationRecord {
        let of_all = |j: &&Judged| j.split == Split::UnseenMaterial && j.row_set == RowSet::All;
        let change = |figure| {
            let full = full.find(Split::UnseenMaterial, &RowSet::All)?;
            ablated.iter().find(of_all)?.bootstrapped.difference(&full.bootstrapped, figure)
        };
        AblationRecord {
            name: name.to_owned(),
            columns,
            judgements: ablated.iter().map(Judged::record).collect(),
            plcc_change: change(Figure::Plcc),
            srocc_change: change(Figure::Srocc),
        }
    }
}

/// One difference, its p-value not yet corrected; `None` where either metric was not judged so.
fn difference(
    a: &JudgedMetric,
    b: &JudgedMetric,
    figure: Figure,
    split: Split,
    bench: &Bench,
) -> Option<DifferenceRecord> {
    let (judged_a, judged_b) = (a.find(split, &bench.row_set)?, b.find(split, &bench.row_set)?);
    let paired = judged_a.bootstrapped.difference(&judged_b.bootstrapped, figure)?;
    let between = match figure {
        Figure::PlccRaw => pearson(judged_a.predictions.raw()?, judged_b.predictions.raw()?).ok(),
        Figure::Plcc => pearson(&judged_a.predictions.mos, &judged_b.predictions.mos).ok(),
        Figure::Srocc => spearman(&judged_a.predictions.score, &judged_b.predictions.score).ok(),
        Figure::Krocc | Figure::Rmse | Figure::WithinMaterialSrocc => None,
    };
    let value = |judged: &Judged| judged.bootstrapped.agreement.get(figure);
    let (value_a, value_b) = (value(judged_a)?, value(judged_b)?);
    let cross_check = between
        .and_then(|between| DependentCorrelations::compare(value_a, value_b, between, judged_a.predictions.mos.len()));
    Some(DifferenceRecord {
        a: a.name.clone(),
        b: b.name.clone(),
        figure,
        split,
        row_set: bench.row_set.clone(),
        paired,
        holm_p: paired.p,
        cross_check,
    })
}

/// Errors of `predictions` by material, the largest root mean square first.
pub fn residuals_by_material(rows: &[Row], predictions: &Predictions) -> Vec<MaterialResidual> {
    let mut materials: BTreeMap<&str, Vec<(&str, f64)>> = BTreeMap::new();
    for (row, mos) in rows.iter().zip(&predictions.mos) {
        materials.entry(&row.material).or_default().push((&row.method, mos - row.mos));
    }
    let mut residuals: Vec<MaterialResidual> = materials
        .into_iter()
        .map(|(material, errors)| {
            let n = errors.len() as f64;
            let worst = errors.iter().fold(errors[0], |a, &b| if b.1.abs() > a.1.abs() { b } else { a });
            MaterialResidual {
                material: material.to_owned(),
                rows: errors.len(),
                bias: errors.iter().map(|e| e.1).sum::<f64>() / n,
                rms: (errors.iter().map(|e| e.1 * e.1).sum::<f64>() / n).sqrt(),
                worst_method: worst.0.to_owned(),
                worst_error: worst.1,
            }
        })
        .collect();
    residuals.sort_by(|a, b| b.rms.total_cmp(&a.rms));
    residuals
}

/// Errors of `predictions` by method, in the order of their names; intervals from `resamples` of groups of materials.
pub fn residuals_by_method(
    rows: &[Row],
    predictions: &Predictions,
    split: Split,
    resamples: &Resamples,
) -> Vec<MethodResidual> {
    let errors: Vec<f64> = rows.iter().zip(&predictions.mos).map(|(row, mos)| mos - row.mos).collect();
    let mut methods: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (index, row) in rows.iter().enumerate() {
        methods.entry(&row.method).or_default().push(index);
    }
    let residual = |(method, of_method): (&str, Vec<usize>)| {
        let n = of_method.len() as f64;
        MethodResidual {
            method: method.to_owned(),
            split,
            rows: of_method.len(),
            bias: of_method.iter().map(|&row| errors[row]).sum::<f64>() / n,
            interval: resamples.interval(|counts| mean(&errors, &of_method, counts)),
            rms: (of_method.iter().map(|&row| errors[row] * errors[row]).sum::<f64>() / n).sqrt(),
        }
    };
    methods.into_iter().map(residual).collect()
}

/// What each of the named metrics predicted for each row.
pub fn prediction_records(rows: &[Row], metrics: &[(&str, &Predictions)]) -> Vec<PredictionRecord> {
    rows.iter()
        .enumerate()
        .map(|(i, row)| PredictionRecord {
            material: row.material.clone(),
            group: row.group.clone(),
            method: row.method.clone(),
            method_family: row.method_family.clone(),
            mos: row.mos,
            predicted: metrics
                .iter()
                .filter_map(|(name, predictions)| Some(((*name).to_owned(), *predictions.mos.get(i)?)))
                .collect(),
            distances: BTreeMap::new(),
        })
        .collect()
}
