//! How well predictions agree with mean opinion scores, in six figures.
//!
//! * `plcc_raw`: Pearson's r of the metric's own values, before any map to the scale of the ratings, and the MOS; missing where
//!   the values of different rows are those of different metrics, whose units do not go together;
//! * `plcc`, `rmse`: Pearson's r and root mean square error (in MOS) after the 4-parameter logistic map of
//!   [`vernis_metric::math::logistic`], fitted on rows that are not judged (ITU-T P.1401, 2020);
//! * `srocc`, `krocc`: Spearman's rho and Kendall's tau-b of the metric's score and the MOS;
//! * `within_material_srocc`: mean over materials of Spearman's rho among the candidates of one material, over the
//!   materials with at least [`MIN_ROWS_PER_MATERIAL`] rows whose ratings are not all equal. A metric that gives all
//!   candidates of a material the same score orders nothing there, and counts as 0.
//!
//! Beside the figures over all rows at once stand [`FoldMeans`], the means of what each fold has on its own. Correlations over the
//! rows of all folds are biased downwards for weak predictors: where the held-out ratings of a fold are high, those that it was
//! trained on are low on average, and so are its predictions. Within a fold there is no such shift.
//!
//! Scores grow with quality (a distance enters negated), so that 1 is perfect and a sign is never dropped. Rows are
//! not weighted. Cost: O(n log n) once, then O(n log n) with a small constant for every resample.

use super::EvaluationError;
use crate::dataset::Row;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use vernis_metric::math::correlation::{
    CorrelationError, Ranking, kendall_counted, pearson, pearson_counted, rmse_counted, spearman, spearman_counted,
};
use vernis_metric::math::resampling::rows_by_name;

/// Fewer candidates of a material have no meaningful order.
pub const MIN_ROWS_PER_MATERIAL: usize = 3;

/// Fewer rows of a fold have no meaningful correlation.
pub const MIN_ROWS_PER_FOLD: usize = 3;

/// One of the figures of [`Figures`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Figure {
    /// Pearson's r of the metric's own values, unmapped, and the MOS.
    PlccRaw,
    /// Pearson's r after the logistic map.
    Plcc,
    /// Spearman's rho.
    Srocc,
    /// Kendall's tau-b.
    Krocc,
    /// Root mean square error after the logistic map, in MOS.
    Rmse,
    /// Mean over materials of Spearman's rho among the candidates of one material.
    WithinMaterialSrocc,
}

impl Figure {
    /// All figures, in the order of the fields of [`Figures`].
    pub const ALL: [Self; 6] =
        [Self::PlccRaw, Self::Plcc, Self::Srocc, Self::Krocc, Self::Rmse, Self::WithinMaterialSrocc];

    /// How tables and axes call it.
    pub fn label(self) -> &'static str {
        match self {
            Self::PlccRaw => "raw PLCC",
            Self::Plcc => "PLCC",
            Self::Srocc => "SROCC",
            Self::Krocc => "KROCC",
            Self::Rmse => "RMSE",
            Self::WithinMaterialSrocc => "within-material SROCC",
        }
    }
}

/// Something for each figure: its value, its interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Figures<T> {
    /// For Pearson's r of the metric's own values, unmapped, and the MOS; `None` where they are those of different metrics.
    pub plcc_raw: Option<T>,
    /// For Pearson's r after the logistic map.
    pub plcc: T,
    /// For Spearman's rho.
    pub srocc: T,
    /// For Kendall's tau-b.
    pub krocc: T,
    /// For the root mean square error after the logistic map, in MOS.
    pub rmse: T,
    /// `None` where no material has enough rows.
    pub within_material_srocc: Option<T>,
}

/// The values of the figures.
pub type Agreement = Figures<f64>;

impl<T: Copy> Figures<T> {
    /// The entry of `figure`; `None` where it is missing.
    pub fn get(&self, figure: Figure) -> Option<T> {
        match figure {
            Figure::PlccRaw => self.plcc_raw,
            Figure::Plcc => Some(self.plcc),
            Figure::Srocc => Some(self.srocc),
            Figure::Krocc => Some(self.krocc),
            Figure::Rmse => Some(self.rmse),
            Figure::WithinMaterialSrocc => self.within_material_srocc,
        }
    }
}

impl Agreement {
    /// Agreement of `predictions` with `ratings`; fails where either is constant.
    pub fn of(ratings: &Ratings, predictions: &Predictions) -> Result<Self, EvaluationError> {
        let counts = vec![1; ratings.len()];
        Prepared::new(ratings, predictions)?
            .agreement(&counts)
            .map_err(|source| EvaluationError::Correlation { what: "agreement of predictions (first) and MOS", source })
    }
}

/// What a metric says of each row.
#[derive(Debug, Clone, PartialEq)]
pub struct Predictions {
    /// What the rows are ordered by, larger is better; a distance enters negated.
    pub score: Vec<f64>,
    /// The score mapped to a mean opinion score.
    pub mos: Vec<f64>,
    /// The metric's own values, unmapped.
    pub raw: Raw,
    /// The fold that held each row out; empty where nothing was held out.
    pub fold: Vec<usize>,
}

/// A metric's own values, larger is better, before any map to the scale of the ratings.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Raw {
    /// They are the scores.
    Score,
    /// The score is a mapped value, and these are the unmapped ones.
    Values(Vec<f64>),
    /// Rows have values of different metrics, which have no unit in common.
    Mixed,
}

impl Predictions {
    /// Of a metric whose own values are its scores, for rows that were not held out by folds.
    pub fn new(score: Vec<f64>, mos: Vec<f64>) -> Self {
        Self { score, mos, raw: Raw::Score, fold: Vec::new() }
    }

    /// The metric's own values; `None` where they are those of different metrics.
    pub fn raw(&self) -> Option<&[f64]> {
        match &self.raw {
            Raw::Score => Some(&self.score),
            Raw::Values(values) => Some(values),
            Raw::Mixed => None,
        }
    }

    /// The predictions of the rows at `indices`, in that order.
    pub fn select(&self, indices: &[usize]) -> Self {
        let pick = |values: &[f64]| indices.iter().map(|&i| values[i]).collect();
        let raw = match &self.raw {
            Raw::Values(values) => Raw::Values(pick(values)),
            other => other.clone(),
        };
        let fold = if self.fold.is_empty() { Vec::new() } else { indices.iter().map(|&i| self.fold[i]).collect() };
        Self { score: pick(&self.score), mos: pick(&self.mos), raw, fold }
    }
}

/// Means over the folds of the correlations that each fold has on its own.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FoldMeans {
    /// Folds that count: those with [`MIN_ROWS_PER_FOLD`] rows or more whose ratings are not all equal.
    pub folds: usize,
    /// Of Pearson's r after the logistic map; a fold whose predictions are all equal counts as 0.
    pub plcc: f64,
    /// Of Spearman's rho; a fold whose scores are all equal counts as 0.
    pub srocc: f64,
}

impl FoldMeans {
    /// `None` where nothing was held out, or no fold counts.
    pub fn of(ratings: &Ratings, predictions: &Predictions) -> Option<Self> {
        let mut rows: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        predictions.fold.iter().enumerate().for_each(|(row, &fold)| rows.entry(fold).or_default().push(row));
        let (mut folds, mut plcc, mut srocc) = (0, 0.0, 0.0);
        for rows in rows.values().filter(|rows| rows.len() >= MIN_ROWS_PER_FOLD) {
            let pick = |values: &[f64]| rows.iter().map(|&i| values[i]).collect::<Vec<f64>>();
            let rated = pick(&ratings.mos);
            if !all_equal(&rated) {
                folds += 1;
                // The ratings differ, so only equal predictions have no correlation.
                plcc += pearson(&pick(&predictions.mos), &rated).unwrap_or(0.0);
                srocc += spearman(&pick(&predictions.score), &rated).unwrap_or(0.0);
            }
        }
        (folds > 0).then(|| Self { folds, plcc: plcc / folds as f64, srocc: srocc / folds as f64 })
    }
}

/// What people said, and what each row belongs to.
#[derive(Debug, Clone)]
pub struct Ratings {
    mos: Vec<f64>,
    ranking: Ranking,
    /// Rows of each material, by name.
    materials: Vec<Vec<usize>>,
    /// Rows of each group of sister materials, by name: what is resampled together.
    groups: Vec<Vec<usize>>,
}

impl Ratings {
    /// The scores of `rows`, grouped by material and by sister materials.
    pub fn of<'a>(rows: impl IntoIterator<Item = &'a Row>) -> Self {
        let rows: Vec<&Row> = rows.into_iter().collect();
        let mos: Vec<f64> = rows.iter().map(|row| row.mos).collect();
        let ranking = Ranking::of(&mos);
        let materials = rows_by_name(rows.iter().map(|row| row.material.as_str()));
        let groups = rows_by_name(rows.iter().map(|row| row.group.as_str()));
        Self { mos, ranking, materials, groups }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.mos.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.mos.is_empty()
    }

    /// Mean opinion scores, 1 to 5, one a row.
    pub fn mos(&self) -> &[f64] {
        &self.mos
    }

    /// Rows of each group of sister materials.
    pub fn groups(&self) -> &[Vec<usize>] {
        &self.groups
    }
}

/// Ratings and predictions ranked once, to be judged under many multiplicities.
pub(super) struct Prepared<'a> {
    ratings: &'a Ratings,
    predictions: &'a Predictions,
    ranking: Ranking,
    /// A row and Spearman's rho of each material that has one.
    within: Vec<(usize, f64)>,
}

impl<'a> Prepared<'a> {
    pub(super) fn new(ratings: &'a Ratings, predictions: &'a Predictions) -> Result<Self, EvaluationError> {
        for (what, found) in
            [("scores of a metric", predictions.score.len()), ("predicted MOS of a metric", predictions.mos.len())]
        {
            if found != ratings.len() {
                return Err(EvaluationError::Lengths { what, found, expected: ratings.len() });
            }
        }
        let raw = match &predictions.raw {
            Raw::Values(values) => values.as_slice(),
            Raw::Score | Raw::Mixed => &[],
        };
        if !raw.is_empty() && raw.len() != ratings.len() {
            let (what, found) = ("unmapped values of a metric", raw.len());
            return Err(EvaluationError::Lengths { what, found, expected: ratings.len() });
        }
        for values in [&predictions.score[..], &predictions.mos, raw] {
            if let Some(row) = values.iter().position(|v| !v.is_finite()) {
                let source = CorrelationError::NotFinite { side: "first", row, value: values[row] };
                return Err(EvaluationError::Correlation { what: "predictions of a metric", source });
            }
        }
        let within = ratings
            .materials
            .iter()
            .filter(|rows| rows.len() >= MIN_ROWS_PER_MATERIAL)
            .filter_map(|rows| {
                let pick = |values: &[f64]| rows.iter().map(|&i| values[i]).collect::<Vec<f64>>();
                match spearman(&pick(&predictions.score), &pick(&ratings.mos)) {
                    Ok(rho) => Some((rows[0], rho)),
                    Err(CorrelationError::Constant { side: "first" }) if !all_equal(&pick(&ratings.mos)) => {
                        Some((rows[0], 0.0))
                    }
                    Err(_) => None,
                }
            })
            .collect();
        Ok(Self { ratings, predictions, ranking: Ranking::of(&predictions.score), within })
    }

    /// Agreement where row i counts `counts[i]` times; rows of one material have the same count.
    pub(super) fn agreement(&self, counts: &[u32]) -> Result<Agreement, CorrelationError> {
        let mos = &self.ratings.mos;
        Ok(Agreement {
            plcc_raw: self.predictions.raw().map(|raw| pearson_counted(raw, mos, counts)).transpose()?,
            plcc: pearson_counted(&self.predictions.mos, mos, counts)?,
            srocc: spearman_counted(&self.ranking, &self.ratings.ranking, counts)?,
            krocc: kendall_counted(&self.ranking, &self.ratings.ranking, counts)?,
            rmse: rmse_counted(&self.predictions.mos, mos, counts)?,
            within_material_srocc: self.within_material_srocc(counts),
        })
    }

    fn within_material_srocc(&self, counts: &[u32]) -> Option<f64> {
        let (sum, materials) = self.within.iter().fold((0.0, 0.0), |(sum, n), &(row, rho)| {
            let count = f64::from(counts[row]);
            (sum + count * rho, n + count)
        });
        (materials > 0.0).then(|| sum / materials)
    }
}

fn all_equal(values: &[f64]) -> bool {
    values.iter().all(|&v| v == values[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn row(material: &str, mos: f64) -> Row {
        Row {
            material: material.into(),
            group: material.into(),
            method: "SGD".into(),
            method_family: "SGD".into(),
            material_type: None,
            mos,
            weight: 1.0,
        }
    }

    fn ratings(rows: &[(&str, f64)]) -> Ratings {
        let rows: Vec<Row> = rows.iter().map(|&(material, mos)| row(material, mos)).collect();
        Ratings::of(&rows)
    }

    #[test]
    fn a_monotone_score_orders_perfectly_whatever_its_scale() {
        let ratings = ratings(&[("a", 1.0), ("a", 2.5), ("a", 4.0), ("b", 3.0), ("b", 4.5)]);
        let score: Vec<f64> = ratings.mos().iter().map(|m| m.powi(5) - 9.0).collect();
        let found = Agreement::of(&ratings, &Predictions::new(score, ratings.mos().to_vec())).unwrap();
        assert_eq!((found.srocc, found.krocc, found.rmse), (1.0, 1.0, 0.0));
        assert!((found.plcc - 1.0).abs() < 1e-15 && found.plcc_raw.unwrap() < 0.95);
        assert_eq!(found.within_material_srocc, Some(1.0));
    }

    #[test]
    fn within_material_order_counts_materials_of_three_rows_or_more() {
        // a: reversed, -1; b: in order, 1; c: one score for all, 0; d: two rows, left out; e: equal ratings, left out.
        let rows = [("a", 1.0), ("a", 2.0), ("a", 3.0), ("b", 1.0), ("b", 2.0), ("b", 3.0)];
        let rows =
            [&rows[..], &[("c", 1.0), ("c", 2.0), ("c", 3.0), ("d", 1.0), ("d", 2.0)], &[("e", 2.0); 3]].concat();
        let ratings = ratings(&rows);
        let score = vec![3.0, 2.0, 1.0, 1.0, 2.0, 3.0, 2.0, 2.0, 2.0, 2.0, 1.0, 1.0, 2.0, 3.0];
        let predictions = Predictions::new(score.clone(), score);
        let found = Agreement::of(&ratings, &predictions).unwrap().within_material_srocc;
        assert_eq!(found, Some(0.0));
        let prepared = Prepared::new(&ratings, &predictions).unwrap();
        assert_eq!(prepared.within.len(), 3);
        // Counting b twice: (-1 + 2 + 0) / 4.
        let counts = [1, 1, 1, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1];
        let found = prepared.agreement(&counts).unwrap().within_material_srocc.unwrap();
        assert!((found - 0.25).abs() < 1e-15);
    }

    #[test]
    fn no_material_with_three_rows_has_no_within_figure() {
        let ratings = ratings(&[("a", 1.0), ("b", 2.0), ("c", 3.0)]);
        let predictions = Predictions::new(vec![1.0, 3.0, 2.0], vec![1.0, 3.0, 2.0]);
        assert_eq!(Agreement::of(&ratings, &predictions).unwrap().within_material_srocc, None);
    }

    #[test]
    fn raw_is_of_what_was_not_mapped() {
        let ratings = ratings(&[("a", 1.0), ("a", 2.5), ("b", 4.0), ("b", 3.0)]);
        let own = vec![-9.0, -3.0, -1.0, -2.0];
        let of = |raw| {
            let predictions = Predictions { raw, ..Predictions::new(ratings.mos().to_vec(), ratings.mos().to_vec()) };
            Agreement::of(&ratings, &predictions.select(&[0, 1, 2, 3]))
        };
        let found = of(Raw::Values(own.clone())).unwrap();
        assert_eq!((found.plcc_raw, found.srocc), (Some(pearson(&own, ratings.mos()).unwrap()), 1.0));
        assert_eq!(of(Raw::Score).unwrap().plcc_raw, Some(1.0));
        // Values of several metrics have no correlation in common, and everything else has.
        let mixed = of(Raw::Mixed).unwrap();
        assert_eq!((mixed.plcc_raw, mixed.get(Figure::PlccRaw), mixed.srocc), (None, None, 1.0));
        assert!(of(Raw::Values(vec![f64::NAN; 4])).is_err());
    }

    #[test]
    fn fold_means_are_means_of_what_each_fold_has_alone() {
        // Fold 0 in order, fold 1 reversed, fold 2 constant predictions, fold 3 two rows, fold 4 equal ratings.
        let rows = [1.0, 2.0, 3.0, 1.0, 2.0, 4.0, 1.0, 2.0, 3.0, 1.0, 2.0, 2.0, 2.0, 2.0].map(|mos| ("a", mos));
        let ratings = ratings(&rows);
        let score = vec![1.0, 2.0, 3.0, 9.0, 8.0, 6.0, 5.0, 5.0, 5.0, 1.0, 2.0, 1.0, 2.0, 3.0];
        let fold = vec![0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 4, 4, 4];
        let predictions = Predictions { fold, ..Predictions::new(score.clone(), score) };
        let found = FoldMeans::of(&ratings, &predictions).unwrap();
        assert!(found.folds == 3 && found.plcc.abs() < 1e-15 && found.srocc.abs() < 1e-15, "{found:?}");
        let first = predictions.select(&[0, 1, 2, 6, 7, 8]);
        assert_eq!(first.fold, [0, 0, 0, 2, 2, 2]);
        assert_eq!(FoldMeans::of(&ratings, &Predictions { fold: vec![], ..predictions }), None);
    }

    #[test]
    fn constant_ratings_or_predictions_are_refused() {
        let predictions = Predictions::new(vec![1.0, 3.0, 2.0], vec![1.0, 3.0, 2.0]);
        let error = Agreement::of(&ratings(&[("a", 2.0), ("b", 2.0), ("c", 2.0)]), &predictions).unwrap_err();
        assert!(error.to_string().contains("all values of the second list are equal"), "{error}");
        let constant = Predictions::new(vec![0.0; 3], vec![2.0; 3]);
        let error = Agreement::of(&ratings(&[("a", 2.0), ("b", 1.0), ("c", 2.0)]), &constant).unwrap_err();
        assert!(error.to_string().contains("all values of the first list are equal"), "{error}");
    }
}
