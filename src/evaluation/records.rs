//! What a benchmark found, as plain data: written as JSON and CSV, drawn and tabulated by reports.

use super::agreement::{Agreement, Figure, Figures};
use super::bootstrap::{Difference, Interval};
use super::calibration::Calibration;
use super::cross_validation::FoldRecord;
use super::dependent::DependentCorrelations;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What the judged rows had in common with those that the metric, or its map to MOS, was fitted on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
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

/// Which rows are judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RowSet {
    All,
    /// Without the methods of [`BenchmarkRecord::set_aside`].
    WithoutSetAside,
}

/// What kind of metric a record is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
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
}

/// Agreement on one set of rows, under one split, with 95 % intervals of the bootstrap by material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Judgement {
    pub split: Split,
    pub row_set: RowSet,
    pub rows: usize,
    pub agreement: Agreement,
    pub intervals: Figures<Interval>,
}

/// One metric and how it agrees with people.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MetricRecord {
    pub name: String,
    pub kind: MetricKind,
    /// One line: what it is, what to know of the figures.
    pub note: String,
    pub judgements: Vec<Judgement>,
    /// Of the unseen-material split.
    pub folds: Vec<FoldRecord>,
}

impl MetricRecord {
    pub fn judgement(&self, split: Split, row_set: RowSet) -> Option<&Judgement> {
        self.judgements.iter().find(|j| j.split == split && j.row_set == row_set)
    }
}

/// `a` minus `b` on the same resamples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DifferenceRecord {
    pub a: String,
    pub b: String,
    pub figure: Figure,
    pub split: Split,
    pub row_set: RowSet,
    pub paired: Difference,
    /// Corrected for all comparisons of the same figure, split and rows.
    pub holm_p: f64,
    /// Closed formulas that take rows for independent; for Pearson and Spearman correlations.
    pub cross_check: Option<DependentCorrelations>,
}

/// The metric retrained on fewer, or other, descriptors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AblationRecord {
    /// Such as `without lights` or `only angular`.
    pub name: String,
    /// Descriptors that are left.
    pub columns: usize,
    pub judgements: Vec<Judgement>,
    /// Against the full metric, unseen material, all rows.
    pub plcc_change: Option<Difference>,
    pub srocc_change: Option<Difference>,
}

impl AblationRecord {
    pub fn judgement(&self, split: Split, row_set: RowSet) -> Option<&Judgement> {
        self.judgements.iter().find(|j| j.split == split && j.row_set == row_set)
    }
}

/// What the metric loses, unseen material, all rows, when descriptors are exchanged between rows ([`super::importance`]).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImportanceRecord {
    /// A family of descriptors, or one of them.
    pub name: String,
    /// Descriptors that were exchanged, together.
    pub columns: usize,
    /// Exchanged minus whole.
    pub plcc_change: Option<Difference>,
    pub srocc_change: Option<Difference>,
}

/// Agreement after training on fewer materials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LearningPoint {
    /// Groups of materials that were trained on, the mean over folds.
    pub groups: f64,
    pub judgements: Vec<Judgement>,
}

impl LearningPoint {
    pub fn judgement(&self, split: Split, row_set: RowSet) -> Option<&Judgement> {
        self.judgements.iter().find(|j| j.split == split && j.row_set == row_set)
    }
}

/// A distance and the ratings, with the logistic curve from one to the other, fitted on these very rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CurveRecord {
    pub metric: String,
    pub points: Vec<CurvePoint>,
}

/// One rated pair.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    pub method: String,
    pub distance: f64,
    pub mos: f64,
    /// On the curve.
    pub mapped: f64,
}

/// How far one material's predictions are from its ratings, in MOS.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MaterialResidual {
    pub material: String,
    pub rows: usize,
    /// Mean of predicted minus rated.
    pub bias: f64,
    /// Root mean square of predicted minus rated.
    pub rms: f64,
    /// The method with the largest error, and that error (predicted minus rated).
    pub worst_method: String,
    pub worst_error: f64,
}

/// A rated pair and what metrics, those of [`BenchmarkRecord::headline`] at least, predicted for it without having seen
/// its material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PredictionRecord {
    pub material: String,
    pub group: String,
    pub method: String,
    pub method_family: String,
    /// As rated.
    pub mos: f64,
    /// Predicted MOS by metric.
    pub predicted: BTreeMap<String, f64>,
}

/// Everything that a run of the benchmark found, and how to run it again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BenchmarkRecord {
    pub study: String,
    /// The ratings come from simulated observers.
    pub synthetic: bool,
    pub rows: usize,
    pub materials: usize,
    /// Materials with their sisters counted once.
    pub groups: usize,
    pub folds: usize,
    pub resamples: usize,
    pub seed: u64,
    pub command: String,
    /// Of the program and of whatever else decides the numbers, by name.
    pub versions: BTreeMap<String, String>,
    /// SHA-256 of the inputs, by name.
    pub data_hashes: BTreeMap<String, String>,
    /// Method families left out of [`RowSet::WithoutSetAside`].
    pub set_aside: Vec<String>,
    /// The metrics to show first; the first of them is the one that the run is about.
    pub headline: Vec<String>,
    pub metrics: Vec<MetricRecord>,
    pub differences: Vec<DifferenceRecord>,
    pub ablation: Vec<AblationRecord>,
    /// Families first, then the descriptors that matter most.
    #[serde(default)]
    pub importance: Vec<ImportanceRecord>,
    /// Fewest materials first.
    #[serde(default)]
    pub learning_curve: Vec<LearningPoint>,
    #[serde(default)]
    pub curves: Vec<CurveRecord>,
    pub residuals: Vec<MaterialResidual>,
    pub calibration: Option<Calibration>,
    pub predictions: Vec<PredictionRecord>,
    /// What was tried and did not help, one line each.
    pub did_not_help: Vec<String>,
}

impl BenchmarkRecord {
    pub fn metric(&self, name: &str) -> Option<&MetricRecord> {
        self.metrics.iter().find(|m| m.name == name)
    }

    /// The records of the headline metrics, in that order.
    pub fn headline_metrics(&self) -> Vec<&MetricRecord> {
        self.headline.iter().filter_map(|name| self.metric(name)).collect()
    }
}
