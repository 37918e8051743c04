//! What a benchmark found, as plain data: written as JSON and CSV, drawn and tabulated by reports.

use super::agreement::{Agreement, Figure, Figures, FoldMeans};
use super::bootstrap::{Difference, Interval};
use super::calibration::Calibration;
use super::cross_validation::FoldRecord;
use super::dependent::DependentCorrelations;
use super::triplets::TripletAgreement;
use crate::dataset::{Identical, NamedRows};
use serde::{Deserialize, Serialize};
use std::borrow::Borrow;
use std::collections::BTreeMap;
use vernis_metric::math::rating_scale::RatingScale;

/// What the judged rows had in common with those that the metric, or its map to MOS, was fitted on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Split {
    /// Everything: fitted on the very rows that are judged.
    InSample,
    /// Neither the material nor a sister was seen.
    UnseenMaterial,
    /// Neither the material nor the family of the approximation method was seen.
    UnseenMaterialAndMethod,
    /// Trained on dielectrics and judged on metals, and the other way round.
    UnseenMaterialType,
}

impl Split {
    /// All splits, those with unseen rows first.
    pub const ALL: [Self; 4] =
        [Self::UnseenMaterial, Self::UnseenMaterialAndMethod, Self::UnseenMaterialType, Self::InSample];

    /// For headings.
    pub fn label(self) -> &'static str {
        match self {
            Self::InSample => "in sample",
            Self::UnseenMaterial => "unseen material",
            Self::UnseenMaterialAndMethod => "unseen material and method",
            Self::UnseenMaterialType => "unseen material type",
        }
    }
}

/// Which rows are judged. In files it is one word or name: `all`, `without-set-aside`, or the name of a set of
/// [`BenchmarkRecord::row_sets`].
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
#[non_exhaustive]
pub enum RowSet {
    /// Every row of the study.
    All,
    /// Without the methods of [`BenchmarkRecord::set_aside`].
    WithoutSetAside,
    /// The set of [`BenchmarkRecord::row_sets`] of this name.
    Named(String),
}

impl From<String> for RowSet {
    fn from(name: String) -> Self {
        let [all, without] = NamedRows::RESERVED;
        match name {
            name if name == all => Self::All,
            name if name == without => Self::WithoutSetAside,
            name => Self::Named(name),
        }
    }
}

impl From<RowSet> for String {
    fn from(rows: RowSet) -> Self {
        let [all, without] = NamedRows::RESERVED;
        match rows {
            RowSet::All => all.to_owned(),
            RowSet::WithoutSetAside => without.to_owned(),
            RowSet::Named(name) => name,
        }
    }
}

/// What kind of metric a record is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum MetricKind {
    /// Learned from ratings.
    Learned,
    /// An ordinary regression on the same descriptors.
    Baseline,
    /// One fixed Lp distance.
    Lp,
    /// One fixed transport or kernel distance between graphs.
    Graph,
    /// The Lp distance that is best on the training side of each fold.
    NestedBestLp,
    /// Knows nothing of appearance: the mean of the method, and the like.
    Trivial,
    /// Distances that were computed elsewhere and read from a file.
    External,
    /// A metric on pictures of both BRDFs.
    Image,
}

impl MetricKind {
    /// Whether ratings taught it more than a map to their scale, or the choice of a distance.
    pub fn is_learned(self) -> bool {
        matches!(self, Self::Learned | Self::Baseline)
    }
}

/// Agreement on one set of rows, under one split, with 95 % intervals of the bootstrap by material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Judgement {
    /// What the metric, or its map, had seen.
    pub split: Split,
    /// Which rows were judged.
    pub row_set: RowSet,
    /// Number of rows that were judged.
    pub rows: usize,
    /// The six figures.
    pub agreement: Agreement,
    /// The 95 % interval of each figure.
    pub intervals: Figures<Interval>,
    /// Means of the correlations of each fold, which are not biased for weak predictors as those over all rows are; `None` in
    /// sample, and in records of before they were kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fold_means: Option<FoldMeans>,
}

fn judgement<'a>(judgements: &'a [Judgement], split: Split, row_set: &RowSet) -> Option<&'a Judgement> {
    judgements.iter().find(|j| j.split == split && j.row_set == *row_set)
}

/// One metric and how it agrees with people.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MetricRecord {
    /// Name of the metric.
    pub name: String,
    /// Version of its numbers. `None` for models and baselines that are judged here alone, and in records of before there were
    /// versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub version: Option<String>,
    /// What kind of metric it is.
    pub kind: MetricKind,
    /// One line: what it is, what to know of the figures.
    pub note: String,
    /// Its agreement, by split and set of rows.
    pub judgements: Vec<Judgement>,
    /// Of the unseen-material split.
    pub folds: Vec<FoldRecord>,
}

impl MetricRecord {
    /// The agreement under `split` on `row_set`, if it was judged so.
    pub fn judgement(&self, split: Split, row_set: impl Borrow<RowSet>) -> Option<&Judgement> {
        judgement(&self.judgements, split, row_set.borrow())
    }
}

/// `a` minus `b` on the same resamples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DifferenceRecord {
    /// Name of the first metric.
    pub a: String,
    /// Name of the second metric, which is subtracted.
    pub b: String,
    /// The figure that is compared.
    pub figure: Figure,
    /// What the metrics, or their maps, had seen.
    pub split: Split,
    /// Which rows were judged.
    pub row_set: RowSet,
    /// Difference, 95 % interval and uncorrected p.
    pub paired: Difference,
    /// Corrected for all comparisons of the same figure, split and rows.
    pub holm_p: f64,
    /// Closed formulas that take rows for independent; for Pearson and Spearman correlations.
    pub cross_check: Option<DependentCorrelations>,
}

/// The model of [`BenchmarkRecord::retrained`] on fewer, or other, descriptors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AblationRecord {
    /// Such as `without lights` or `only angular`.
    pub name: String,
    /// Descriptors that are left.
    pub columns: usize,
    /// Its agreement, by split and set of rows.
    pub judgements: Vec<Judgement>,
    /// Against the same model with all of its descriptors, unseen material, all rows.
    pub plcc_change: Option<Difference>,
    /// Change of Spearman's rho against the same, unseen material, all rows.
    pub srocc_change: Option<Difference>,
}

impl AblationRecord {
    /// The agreement under `split` on `row_set`, if it was judged so.
    pub fn judgement(&self, split: Split, row_set: impl Borrow<RowSet>) -> Option<&Judgement> {
        judgement(&self.judgements, split, row_set.borrow())
    }
}

/// What the model of [`BenchmarkRecord::retrained`] loses, unseen material, all rows, when descriptors are exchanged between rows
/// ([`super::importance`]).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImportanceRecord {
    /// A family of descriptors, or one of them.
    pub name: String,
    /// Descriptors that were exchanged, together.
    pub columns: usize,
    /// Exchanged minus whole.
    pub plcc_change: Option<Difference>,
    /// Change of Spearman's rho, exchanged minus whole.
    pub srocc_change: Option<Difference>,
}

/// Agreement of the model of [`BenchmarkRecord::retrained`] after training on fewer materials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LearningPoint {
    /// Groups of materials that were trained on, the mean over folds.
    pub groups: f64,
    /// The agreement, by split and set of rows.
    pub judgements: Vec<Judgement>,
}

impl LearningPoint {
    /// The agreement under `split` on `row_set`, if it was judged so.
    pub fn judgement(&self, split: Split, row_set: impl Borrow<RowSet>) -> Option<&Judgement> {
        judgement(&self.judgements, split, row_set.borrow())
    }
}

/// A distance and the ratings, with the logistic curve from one to the other, fitted on these very rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CurveRecord {
    /// Name of the metric.
    pub metric: String,
    /// The rated pairs.
    pub points: Vec<CurvePoint>,
}

/// One rated pair.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Name of the approximation method.
    pub method: String,
    /// The metric's distance, in its unit.
    pub distance: f64,
    /// Mean opinion score as rated.
    pub mos: f64,
    /// On the curve.
    pub mapped: f64,
}

/// How far one material's predictions are from its ratings, in points of the scale.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MaterialResidual {
    /// Name of the material.
    pub material: String,
    /// Rated pairs of the material.
    pub rows: usize,
    /// Mean of predicted minus rated.
    pub bias: f64,
    /// Root mean square of predicted minus rated.
    pub rms: f64,
    /// The method with the largest error, and that error (predicted minus rated).
    pub worst_method: String,
    /// The error of that method, in MOS.
    pub worst_error: f64,
}

/// How far the predictions for one method's candidates are from their ratings, in the unit of the scale.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MethodResidual {
    /// Name of the method.
    pub method: String,
    /// What the predictions had not seen.
    pub split: Split,
    /// Rated pairs of the method.
    pub rows: usize,
    /// Mean of predicted minus rated.
    pub bias: f64,
    /// Its 95 % interval, by bootstrap over materials.
    pub interval: Option<Interval>,
    /// Root mean square of predicted minus rated.
    pub rms: f64,
}

/// A rated pair and what metrics, those of [`BenchmarkRecord::headline`] at least, predicted for it without having seen
/// its material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PredictionRecord {
    /// Name of the reference's material.
    pub material: String,
    /// The material with its sisters.
    pub group: String,
    /// Name of the approximation method.
    pub method: String,
    /// Methods of one family are left out together.
    pub method_family: String,
    /// As rated.
    pub mos: f64,
    /// Predicted MOS by metric.
    pub predicted: BTreeMap<String, f64>,
    /// Distances by metric, in the unit of each, the larger the worse: of every metric that was judged by its distances. Empty in
    /// records of before they were kept.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub distances: BTreeMap<String, f64>,
}

/// Everything that a run of the benchmark found, and how to run it again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BenchmarkRecord {
    /// Name of the study.
    pub study: String,
    /// The ratings come from simulated observers.
    pub synthetic: bool,
    /// The scale of every score, error and width here.
    #[serde(default)]
    pub scale: RatingScale,
    /// The score of identical BRDFs; `None` in records of before it was estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub identical: Option<Identical>,
    /// Rated pairs.
    pub rows: usize,
    /// Reference materials.
    pub materials: usize,
    /// Materials with their sisters counted once.
    pub groups: usize,
    /// Folds by material group.
    pub folds: usize,
    /// Bootstrap resamples of materials.
    pub resamples: usize,
    /// Seed of folds, training and resamples.
    pub seed: u64,
    /// The command that runs the benchmark again.
    pub command: String,
    /// Of the program and of whatever else decides the numbers, by name.
    pub versions: BTreeMap<String, String>,
    /// SHA-256 of the inputs, by name.
    pub data_hashes: BTreeMap<String, String>,
    /// Method families left out of [`RowSet::WithoutSetAside`].
    pub set_aside: Vec<String>,
    /// The rows of each [`RowSet::Named`]; none in studies that declare none, and in records of before there were any.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub row_sets: Vec<NamedRows>,
    /// The metrics to show first; the first of them is the one that the run is about.
    pub headline: Vec<String>,
    /// Every metric and its agreement.
    pub metrics: Vec<MetricRecord>,
    /// Paired differences between metrics.
    pub differences: Vec<DifferenceRecord>,
    /// The model that ablation, importance and learning curve train again, with all of its descriptors one of `metrics`.
    #[serde(default = "retrained_before")]
    pub retrained: String,
    /// That model on other descriptors.
    pub ablation: Vec<AblationRecord>,
    /// Families first, then the descriptors that matter most.
    #[serde(default)]
    pub importance: Vec<ImportanceRecord>,
    /// Fewest materials first.
    #[serde(default)]
    pub learning_curve: Vec<LearningPoint>,
    /// Distances and ratings of single metrics, with their logistic curves.
    #[serde(default)]
    pub curves: Vec<CurveRecord>,
    /// Errors by material, the largest root mean square first.
    pub residuals: Vec<MaterialResidual>,
    /// Errors by method, of predictions that had not seen the material, and of those that had not seen the method either.
    #[serde(default)]
    pub method_residuals: Vec<MethodResidual>,
    /// How well the intervals of the scores hold.
    pub calibration: Option<Calibration>,
    /// Agreement of the exported metrics, and of those that learn from triplets otherwise, with triplets whose reference they have not
    /// seen. Empty where the study has no triplets, and in records of before they were judged.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub triplets: Vec<TripletAgreement>,
    /// Predictions by rated pair.
    pub predictions: Vec<PredictionRecord>,
    /// What was tried and did not help, one line each.
    pub did_not_help: Vec<String>,
    /// What the study does not support, or what failed, one sentence each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<String>,
}

/// Records of vernis 0.1.0 do not name the model that they retrained; it was always this one.
fn retrained_before() -> String {
    "nystroem-ridge".to_owned()
}

impl BenchmarkRecord {
    /// One of its scores on `scale`.
    pub fn restated(&self, score: f64, scale: RatingScale) -> f64 {
        if self.scale == scale { score } else { scale.score(self.scale.grade(score)) }
    }

    /// The model of the ablation with all of its descriptors.
    pub fn retrained_metric(&self) -> Option<&MetricRecord> {
        self.metric(&self.retrained)
    }

    /// The sets of rows that metrics were judged on, all rows first, then the named ones; without that which sets methods aside.
    pub fn named_row_sets(&self) -> Vec<RowSet> {
        std::iter::once(RowSet::All).chain(self.row_sets.iter().map(|set| RowSet::Named(set.name.clone()))).collect()
    }

    /// What tables call a set of rows.
    pub fn rows_in_words(&self, row_set: &RowSet) -> String {
        match row_set {
            RowSet::All => "all rows".to_owned(),
            RowSet::WithoutSetAside => format!("without {}", self.set_aside.join(", ")),
            RowSet::Named(name) => name.clone(),
        }
    }

    /// The record of the metric called `name`.
    pub fn metric(&self, name: &str) -> Option<&MetricRecord> {
        self.metrics.iter().find(|m| m.name == name)
    }

    /// The records of the headline metrics, in that order.
    pub fn headline_metrics(&self) -> Vec<&MetricRecord> {
        self.headline.iter().filter_map(|name| self.metric(name)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_of_rows_are_one_word_or_a_name_in_files() {
        let named = RowSet::Named("six published methods".into());
        for (set, text) in [
            (RowSet::All, "\"all\""),
            (RowSet::WithoutSetAside, "\"without-set-aside\""),
            (named, "\"six published methods\""),
        ] {
            assert_eq!(serde_json::to_string(&set).unwrap(), text);
            assert_eq!(serde_json::from_str::<RowSet>(text).unwrap(), set);
        }
    }
}
