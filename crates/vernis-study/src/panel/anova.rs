//! Which factors, and which combinations of them, move a mean: factorial analysis of variance with all interactions.
//!
//!   SS(T) = RSS(terms that do not contain T) - RSS(the same and T),   F = (SS(T)/df(T)) / (RSS(all)/df(residual))
//!
//! RSS: residual sum of squares of a least-squares fit; a term is a set of factors, and contains T if T is a part of
//! it; df: how much the rank of the design grows. These are **Type II** sums of squares (Yates 1934,
//! doi:10.1080/01621459.1934.10502686; Langsrud 2003, doi:10.1023/A:1023260610025), which numbers of rows that differ
//! between cells do not confound, and which do not depend on a coding. In a balanced design Types I, II and III agree;
//! the highest interaction is the same in II and III always. Cells without a row are allowed: they cost degrees of
//! freedom of the interactions.
//!
//! Rows of one cell (one combination of levels) share their design, so that fits run on cell means with weights and
//! the spread within cells is added. Cost: 2^factors fits of (cells)^3 flops.

use super::distribution::f_upper;
use super::error::StudyError;
use super::moments::{Moments, negligible};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use vernis_metric::math::least_squares::Span;

/// A factor and its level in each row.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor<'a> {
    /// Name of the factor.
    pub name: &'a str,
    /// Its level in each row.
    pub levels: Vec<&'a str>,
}

/// One line of the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Term {
    /// Names of its factors.
    pub factors: Vec<String>,
    /// Type II.
    pub sum_of_squares: f64,
    /// Degrees of freedom.
    pub freedom: usize,
    /// F, the ratio of mean squares.
    pub f: f64,
    /// Probability of so large an F if the term has no effect.
    pub p: f64,
    /// Part of the variance that other terms leave: SS/(SS + RSS).
    pub partial_eta_squared: f64,
}

/// An analysis of variance with all interactions and Type II sums of squares.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Anova {
    /// Always `II`.
    pub sums_of_squares: String,
    /// Number of rows.
    pub rows: usize,
    /// Combinations of levels, and how many of them have no row.
    pub cells: usize,
    /// Combinations of levels that have no row.
    pub empty_cells: usize,
    /// Main effects first.
    pub terms: Vec<Term>,
    /// RSS of the model with all terms, in squared units of the response.
    pub residual_sum_of_squares: f64,
    /// Degrees of freedom of the residual.
    pub residual_freedom: usize,
}

impl Anova {
    /// The line of the term of exactly these factors, in any order.
    pub fn term(&self, factors: &[&str]) -> Option<&Term> {
        let wanted: BTreeSet<&str> = factors.iter().copied().collect();
        self.terms.iter().find(|t| t.factors.iter().map(String::as_str).collect::<BTreeSet<_>>() == wanted)
    }
}

/// A combination of levels: its place of each factor, and its rows.
struct Cell {
    levels: Vec<usize>,
    weight: f64,
    mean: f64,
}

/// Analyses `response`; every factor has as many levels as there are rows.
pub fn anova(response: &[f64], factors: &[Factor]) -> Result<Anova, StudyError> {
    let mut sizes = Vec::new();
    let mut places = Vec::new();
    for factor in factors {
        let distinct: BTreeSet<&str> = factor.levels.iter().copied().collect();
        if distinct.len() < 2 {
            return Err(StudyError::OneLevel { factor: factor.name.into(), found: distinct.len() });
        }
        let index: BTreeMap<&str, usize> = distinct.into_iter().zip(0..).collect();
        places.push(factor.levels.iter().map(|l| index[l]).collect::<Vec<_>>());
        sizes.push(index.len());
    }
    let (cells, within) = cells(response, &places);
    let fit = |terms: &[u32]| fit(&cells, &sizes, terms);
    let all: Vec<u32> = (1..1 << factors.len()).collect();
    let (unexplained, parameters) = fit(&all);
    let residual = within + unexplained;
    let saturated = StudyError::Saturated { rows: response.len(), parameters };
    let residual_freedom = response.len().checked_sub(parameters).filter(|&d| d > 0).ok_or(saturated)?;
    let squares: f64 = response.iter().map(|y| y * y).sum();
    if negligible(residual, squares.sqrt()) {
        return Err(StudyError::NoSpread { what: "rows of a cell" });
    }

    let combinations: usize = sizes.iter().product();
    let mut ordered = all.clone();
    ordered.sort_by_key(|term| (term.count_ones(), *term));
    let line = |term: u32| {
        let mut others: Vec<u32> = all.iter().copied().filter(|other| other & term != term).collect();
        let (without, rank_without) = fit(&others);
        others.push(term);
        let (with, rank) = fit(&others);
        let (sum_of_squares, freedom) = ((without - with).max(0.0), rank - rank_without);
        let factors: Vec<String> =
            (0..factors.len()).filter(|i| term & (1 << i) != 0).map(|i| factors[i].name.to_owned()).collect();
        if freedom == 0 {
            return Err(StudyError::Confounded { term: factors.join(" x "), empty: combinations - cells.len() });
        }
        let f = (sum_of_squares / freedom as f64) / (residual / residual_freedom as f64);
        let p = f_upper(f, freedom as f64, residual_freedom as f64);
        Ok(Term {
            factors,
            sum_of_squares,
            freedom,
            f,
            p: p.ok_or(StudyError::NoSpread { what: "rows of a cell" })?,
            partial_eta_squared: sum_of_squares / (sum_of_squares + residual),
        })
    };
    Ok(Anova {
        sums_of_squares: "II".into(),
        rows: response.len(),
        cells: combinations,
        empty_cells: combinations - cells.len(),
        terms: ordered.into_iter().map(line).collect::<Result<_, _>>()?,
        residual_sum_of_squares: residual,
        residual_freedom,
    })
}

/// The cells that have rows, and the sum of squares within them.
fn cells(response: &[f64], places: &[Vec<usize>]) -> (Vec<Cell>, f64) {
    let mut rows: BTreeMap<Vec<usize>, Vec<f64>> = BTreeMap::new();
    for (row, &y) in response.iter().enumerate() {
        rows.entry(places.iter().map(|p| p[row]).collect()).or_default().push(y);
    }
    let mut within = 0.0;
    let mut cells = Vec::new();
    for (levels, values) in rows {
        let Some(Moments { n, mean, variance }) = Moments::of(&values) else { continue };
        within += variance.unwrap_or(0.0) * (n as f64 - 1.0);
        cells.push(Cell { levels, weight: (n as f64).sqrt(), mean });
    }
    (cells, within)
}

/// Weighted residual sum of squares of the cell means, and rank, of the model with an intercept and `terms`, which are
/// bit sets of factors.
fn fit(cells: &[Cell], sizes: &[usize], terms: &[u32]) -> (f64, usize) {
    let mut span = Span::default();
    span.add(&cells.iter().map(|c| c.weight).collect::<Vec<_>>());
    for &term in terms {
        let of: Vec<usize> = (0..sizes.len()).filter(|i| term & (1 << i) != 0).collect();
        let combinations: usize = of.iter().map(|&i| sizes[i]).product();
        let place = |cell: &Cell| of.iter().fold(0, |at, &i| at * sizes[i] + cell.levels[i]);
        for combination in 0..combinations {
            let indicator = |c: &Cell| if place(c) == combination { c.weight } else { 0.0 };
            span.add(&cells.iter().map(indicator).collect::<Vec<_>>());
        }
    }
    let means: Vec<f64> = cells.iter().map(|c| c.weight * c.mean).collect();
    (span.residual_sum_of_squares(&means), span.rank())
}

#[cfg(test)]
mod tests;
