//! How well each combination agrees with people: in sample, as the paper reports, and chosen inside the training folds.

use super::combination::{Combination, Family, GAMMAS};
use super::run::{Outcome, Setting};
use crate::dataset::Row;
use crate::evaluation::EvaluationError;
use crate::evaluation::agreement::{Agreement, Predictions, Ratings};
use crate::evaluation::bootstrap::{self, Bootstrapped, Interval};
use crate::evaluation::cross_validation::{cross_validate, in_sample};
use crate::experiment::ExperimentError;
use crate::samples::Samples;
use crate::samples::split::grouped_folds;
use crate::train::lp_baseline::{BestOf, Criterion};
use ndarray::Array2;
use serde::Serialize;
use std::collections::BTreeMap;
use vernis_metric::descriptor::{Column, Role};
use vernis_metric::metric::kernel::FAMILY as ENERGY;
use vernis_metric::metric::transport::FAMILY as TRANSPORT;

/// One figure and its 95 % interval, by bootstrap over groups of materials.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Judged {
    /// The figure, a correlation.
    pub value: f64,
    /// Its 95 % interval.
    pub interval: Interval,
}

/// The agreement of one set of predictions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SweepRow {
    /// The metric's name, or what was chosen among.
    pub name: String,
    /// Pearson's r of the distance, negated, and the MOS; `None` where folds chose several distances, which have no unit in common.
    pub plcc_raw: Option<Judged>,
    /// After the 4-parameter logistic map.
    pub plcc: Judged,
    /// Spearman's rho of the distance, negated, and the MOS.
    pub srocc: Judged,
}

/// All that a sweep found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SweepRecord {
    /// Name of the study.
    pub study: String,
    /// Cells along theta_i, theta_o and phi_d, such as `45x45x180`.
    pub grid: String,
    /// Of the transport distances.
    pub accuracy: String,
    /// Pairs that were compared.
    pub rows: usize,
    /// Rated pairs of the study: more where these are a part of them.
    pub rated: usize,
    /// Folds by material group.
    pub folds: usize,
    /// Bootstrap resamples of materials.
    pub resamples: usize,
    /// Seed of folds and resamples.
    pub seed: u64,
    /// Versions of the program and of each family's numbers, by name.
    pub versions: BTreeMap<String, String>,
    /// Every combination and gamma, logistic map fitted on the rows that are judged; best PLCC first.
    pub in_sample: Vec<SweepRow>,
    /// Out of fold: the combination that is best on the training side of each fold, mapped there.
    pub nested: Vec<SweepRow>,
    /// Combinations that could not be computed, with the reason.
    pub refused: Vec<(String, String)>,
}

/// What a judgement needs beside the divergences.
#[derive(Debug, Clone, Copy)]
pub struct SweepProtocol {
    /// Folds by material group.
    pub folds: usize,
    /// Bootstrap resamples of materials.
    pub resamples: usize,
    /// Seed of folds and resamples.
    pub seed: u64,
}

/// Judges what was computed for the pairs with these `rows`.
///
/// # Errors
/// No combination at all, too few groups for the folds, ratings that are all equal.
pub fn judge(
    study: &str,
    setting: &Setting,
    rows: &[Row],
    outcomes: &[(Combination, Outcome)],
    protocol: SweepProtocol,
) -> Result<SweepRecord, ExperimentError> {
    let SweepProtocol { folds, resamples, seed } = protocol;
    let columns: Vec<(Family, String, Vec<f64>)> = outcomes.iter().flat_map(columns_of).collect();
    if columns.is_empty() {
        return Err(EvaluationError::TooFew { what: "combinations that could be computed", found: 0, least: 1 }.into());
    }
    let samples = samples_of(rows, &columns)?;
    let ratings = Ratings::of(rows);
    let drawn = bootstrap::draw(&ratings, resamples, seed)?;
    let row = |name: &str, predictions: &Predictions| -> Result<SweepRow, ExperimentError> {
        let found = Bootstrapped::of(name, &ratings, predictions, &drawn)?;
        let judged = |figure: fn(&Agreement) -> f64, interval| Judged { value: figure(&found.agreement), interval };
        Ok(SweepRow {
            name: name.to_owned(),
            plcc_raw: found
                .agreement
                .plcc_raw
                .zip(found.intervals.plcc_raw)
                .map(|(value, interval)| Judged { value, interval }),
            plcc: judged(|a| a.plcc, found.intervals.plcc),
            srocc: judged(|a| a.srocc, found.intervals.srocc),
        })
    };
    let mut in_sample_rows = Vec::with_capacity(columns.len());
    for (_, name, _) in &columns {
        in_sample_rows.push(row(name, &in_sample(&samples, name)?)?);
    }
    in_sample_rows.sort_by(|a, b| b.plcc.value.total_cmp(&a.plcc.value).then_with(|| a.name.cmp(&b.name)));
    let split = grouped_folds(&samples, folds, seed)?;
    let mut nested = Vec::new();
    for (label, family) in
        [("best transport", Some(Family::Transport)), ("best energy", Some(Family::Energy)), ("best of all", None)]
    {
        let chosen = |of: &Family| family.is_none_or(|family| family == *of);
        let names: Vec<String> =
            columns.iter().filter(|(f, _, _)| chosen(f)).map(|(_, name, _)| name.clone()).collect();
        if names.is_empty() || (family.is_none() && nested.len() < 2) {
            continue;
        }
        let label = format!("{label} of {}, chosen by PLCC on the training side of each fold", names.len());
        let best = BestOf { columns: names, criterion: Criterion::Plcc };
        nested.push(row(&label, &cross_validate(&samples, &split, &best, seed)?.predictions)?);
    }
    let refused = outcomes.iter().filter_map(|(combination, outcome)| match outcome {
        Outcome::Refused { reason } => Some((combination.to_string(), reason.clone())),
        Outcome::Computed { .. } => None,
    });
    Ok(SweepRecord {
        study: study.to_owned(),
        grid: setting.grid.clone(),
        accuracy: setting.accuracy.clone(),
        rows: rows.len(),
        rated: rows.len(),
        folds,
        resamples,
        seed,
        versions: versions(outcomes),
        in_sample: in_sample_rows,
        nested,
        refused: refused.collect(),
    })
}

/// Versions of the program and of the families that were swept.
fn versions(outcomes: &[(Combination, Outcome)]) -> BTreeMap<String, String> {
    let families = outcomes.iter().map(|(combination, _)| {
        let name = match combination.family() {
            Family::Transport => TRANSPORT,
            Family::Energy => ENERGY,
        };
        (name.to_owned(), combination.version().to_owned())
    });
    families.chain([("vernis".to_owned(), env!("CARGO_PKG_VERSION").to_owned())]).collect()
}

/// The distances of a combination for every gamma.
fn columns_of((combination, outcome): &(Combination, Outcome)) -> Vec<(Family, String, Vec<f64>)> {
    let Outcome::Computed { channels } = outcome else { return Vec::new() };
    let sum = |w: &[f64; 3]| w.iter().map(|w| w.max(0.0)).sum::<f64>();
    let column = |gamma: f64| {
        let distances = channels.iter().map(|w| sum(w).powf(gamma)).collect();
        (combination.family(), combination.with_gamma(gamma), distances)
    };
    GAMMAS.map(column).into()
}

fn samples_of(rows: &[Row], columns: &[(Family, String, Vec<f64>)]) -> Result<Samples, ExperimentError> {
    let features = Array2::from_shape_fn((rows.len(), columns.len()), |(i, j)| columns[j].2[i]);
    let column = |(_, name, _): &(Family, String, Vec<f64>)| Column {
        name: name.clone(),
        family: "sweep".to_owned(),
        role: Role::Difference,
    };
    Ok(Samples::new(columns.iter().map(column).collect(), rows.to_vec(), features)?)
}
