//! Models against each other, and samples of a manifold against their distance: section 5.5 of Lavoue et al. 2021.
//!
//! Of several fits of one model to a material, the one with the best mean opinion score counts. Left out, as in the paper's
//! figures 9 and 10, are samples of a manifold, which are no fits of a model, and models that were not fitted to every material.

use super::{Comparison, MANIFOLD, METHOD, MODEL, STEP};
use crate::evaluation::bootstrap::holm;
use crate::panel::analysis::{Notes, mean};
use crate::panel::error::{StudyError, at_least};
use crate::panel::record::{ManifoldCorrelation, ModelComparison, ModelPair};
use crate::panel::t_test::paired;
use std::collections::{BTreeMap, BTreeSet};
use vernis_metric::math::correlation::{Ranking, pearson, pearson_counted, spearman, spearman_counted};

/// Families of methods that are points of a manifold, or of a path, and no fits of a model: those of the study, of the embedded
/// study, and of `vernis manifold`.
const MANIFOLDS: [&str; 3] = ["GPLVM", "STEPS", "manifold"];

/// The power by which the distances of a manifold's samples grow: c_i = c + d (i/N)^5 r.
const GROWTH: i32 = 5;

/// The better fits, and what is not among them.
pub(super) struct BetterFits {
    pub rows: Vec<usize>,
    /// In words.
    pub left_out: Option<String>,
}

impl Comparison<'_> {
    /// Of `rows`, the one with the best mean opinion score for every material and model, hidden references included; `None`
    /// where no model that was fitted to every material was fitted in several ways.
    pub(super) fn better_fits(&self, rows: &[usize]) -> Option<BetterFits> {
        let fits = |row: &&usize| !self.opinions[**row].stimulus.is_reference();
        let distinct = |rows: &mut dyn Iterator<Item = usize>, of: &str| {
            rows.filter_map(|row| self.level(row, of)).collect::<BTreeSet<_>>().len()
        };
        let material = |row: usize| self.opinions[row].stimulus.material.as_str();
        let materials = rows.iter().filter(fits).map(|&row| material(row)).collect::<BTreeSet<_>>().len();
        let mut fitted: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
        let mut left_out: BTreeMap<&str, String> = BTreeMap::new();
        for &row in rows.iter().filter(fits) {
            let family = self.opinions[row].stimulus.method_family.as_str();
            fitted.entry(family).or_default().insert(material(row));
            if self.is_manifold(row) {
                left_out.insert(family, format!("{family} (samples of a manifold, no fits of a model)"));
            }
        }
        for (family, of) in fitted.iter().filter(|(_, of)| of.len() < materials) {
            let why = || format!("{family} (fitted to {} of {materials} materials)", of.len());
            left_out.entry(family).or_insert_with(why);
        }
        let kept: Vec<usize> = rows
            .iter()
            .copied()
            .filter(|&row| !left_out.contains_key(self.opinions[row].stimulus.method_family.as_str()))
            .collect();
        let of_models = || kept.iter().filter(fits).copied();
        let (models, methods) = (distinct(&mut of_models(), MODEL), distinct(&mut of_models(), METHOD));
        (models < methods).then(|| BetterFits {
            rows: self.best(&kept),
            left_out: (!left_out.is_empty()).then(|| {
                let named: Vec<String> = left_out.into_values().collect();
                format!("Left out, as in figures 9 and 10 of Lavoué et al. 2021: {}", named.join(", "))
            }),
        })
    }

    /// Of `rows`, the one with the best score for every material and model.
    fn best(&self, rows: &[usize]) -> Vec<usize> {
        let mut best: BTreeMap<(&str, &str), usize> = BTreeMap::new();
        for &row in rows {
            let stimulus = &self.opinions[row].stimulus;
            let kept = best.entry((&stimulus.material, &stimulus.method_family)).or_insert(row);
            if self.scale.direction() * (self.mos[row] - self.mos[*kept]) > 0.0 {
                *kept = row;
            }
        }
        best.into_values().collect()
    }

    fn is_manifold(&self, row: usize) -> bool {
        let stimulus = &self.opinions[row].stimulus;
        stimulus.method.starts_with(MANIFOLD) || MANIFOLDS.contains(&stimulus.method_family.as_str())
    }

    /// Paired tests between the models of the box plots; where there are none, between all models but manifolds.
    pub fn models(&self, notes: &mut Notes) -> Option<ModelComparison> {
        let found = self.compare_models(notes);
        notes.keep("comparison of models", found)
    }

    fn compare_models(&self, notes: &mut Notes) -> Result<ModelComparison, StudyError> {
        let (rows, left_out) = match self.better_fits(&self.approximations) {
            Some(better) => (better.rows, better.left_out),
            None => {
                let fits = self.approximations.iter().copied().filter(|&row| !self.is_manifold(row));
                (self.best(&fits.collect::<Vec<_>>()), None)
            }
        };
        let mut scores: BTreeMap<&str, BTreeMap<&str, f64>> = BTreeMap::new();
        for &row in &rows {
            let stimulus = &self.opinions[row].stimulus;
            scores.entry(&stimulus.method_family).or_default().insert(&stimulus.material, self.mos[row]);
        }
        at_least("models", scores.len(), 2)?;
        let average = |model: &str| mean(&scores[model].values().copied().collect::<Vec<_>>()).unwrap_or(f64::NAN);
        let mut models: Vec<&str> = scores.keys().copied().collect();
        let better = |model: &str| self.scale.direction() * average(model);
        models.sort_by(|a, b| better(b).total_cmp(&better(a)).then_with(|| a.cmp(b)));
        let mut tested = Vec::new();
        for (place, a) in models.iter().enumerate() {
            for b in &models[place + 1..] {
                let common = scores[a].iter().filter_map(|(material, x)| Some((*x, *scores[b].get(material)?)));
                let (x, y): (Vec<f64>, Vec<f64>) = common.unzip();
                let test = notes.keep(&format!("paired test of the models {a} and {b}"), paired(&x, &y));
                tested.extend(test.map(|test| ([a, b], test)));
            }
        }
        let corrected = holm(&tested.iter().map(|(_, test)| test.p).collect::<Vec<_>>());
        let pair = |((models, mos), holm_p): (([&&str; 2], _), f64)| ModelPair {
            models: models.map(|model| (**model).to_owned()),
            mos,
            holm_p,
        };
        Ok(ModelComparison {
            models: models.iter().map(|model| (*model).to_owned()).collect(),
            left_out,
            pairs: tested.into_iter().zip(corrected).map(pair).collect(),
        })
    }

    /// How the opinions of a manifold's samples follow their distance from the reference; `None` where there are no such samples.
    pub fn manifold(&self, notes: &mut Notes) -> Option<ManifoldCorrelation> {
        let step = |&row: &usize| Some((row, self.level(row, STEP)?.parse::<u32>().ok().filter(|i| *i > 0)?));
        let samples: Vec<(usize, u32)> = self.approximations.iter().filter_map(step).collect();
        let last = samples.iter().map(|(_, step)| *step).max()?;
        let distances: Vec<f64> =
            samples.iter().map(|(_, step)| (f64::from(*step) / f64::from(last)).powi(GROWTH)).collect();
        let rows: Vec<usize> = samples.iter().map(|(row, _)| *row).collect();
        let mos = self.pick(&rows);
        let both = pearson(&distances, &mos).and_then(|r| Ok((r, spearman(&distances, &mos)?)));
        let (pearson, spearman) =
            notes.keep("distances and opinions of manifold samples", both.map_err(StudyError::from))?;
        let resampled = |statistic: &(dyn Fn(&[u32]) -> Option<f64> + Sync)| {
            let of_samples = |counts: &[u32]| rows.iter().map(|&row| counts[row]).collect::<Vec<_>>();
            self.resamples.as_ref().and_then(|r| r.interval(|counts| statistic(&of_samples(counts))))
        };
        let (by_distance, by_mos) = (Ranking::of(&distances), Ranking::of(&mos));
        Some(ManifoldCorrelation {
            stimuli: rows.len(),
            steps: last as usize,
            pearson,
            spearman,
            pearson_interval: resampled(&|counts| pearson_counted(&distances, &mos, counts).ok()),
            spearman_interval: resampled(&|counts| spearman_counted(&by_distance, &by_mos, counts).ok()),
        })
    }
}
