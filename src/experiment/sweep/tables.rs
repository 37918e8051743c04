//! The tables of a study's BRDFs, made once for all combinations.

use crate::dataset::Study;
use crate::experiment::ExperimentError;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use vernis_metric::brdf::BrdfSource;
use vernis_metric::io::{Count, Progress};
use vernis_metric::metric::Side;
use vernis_metric::metric::graph::{CompactTable, CosineTable, GraphGrid};

/// Every distinct BRDF of a study on one grid. As many as fit into the memory given are kept, rounded to f32; the others are
/// made again each time, and rounded all the same, so that the limit changes no result.
pub struct StudyTables {
    sources: Vec<BrdfSource>,
    kept: Vec<CompactTable>,
    /// Reference and candidate of every pair, as places in `sources`.
    pairs: Vec<(usize, usize)>,
    grid: GraphGrid,
    base: Option<PathBuf>,
}

impl StudyTables {
    /// `memory`: bytes for tables; `progress` is told how many of how many are done, from any thread.
    pub fn of(
        study: &Study,
        grid: GraphGrid,
        base: Option<&Path>,
        memory: usize,
        progress: &(dyn Fn(Progress) + Sync),
    ) -> Result<Self, ExperimentError> {
        let mut known: BTreeMap<String, usize> = BTreeMap::new();
        let mut sources: Vec<BrdfSource> = Vec::new();
        let mut number = |source: &BrdfSource| {
            *known.entry(source.identity()).or_insert_with(|| {
                sources.push(source.clone());
                sources.len() - 1
            })
        };
        let pairs: Vec<_> = study.pairs.iter().map(|p| (number(&p.reference), number(&p.candidate))).collect();
        let fits = sources.len().min(memory / CompactTable::bytes(grid));
        let done = Count::of(fits);
        let table = |source: &BrdfSource| {
            let table = make(source, grid, base);
            done.one(progress);
            table
        };
        let kept = sources[..fits].par_iter().map(table).collect::<Result<Vec<_>, _>>()?;
        Ok(Self { sources, kept, pairs, grid, base: base.map(Path::to_owned) })
    }

    /// The cells of the tables.
    pub fn grid(&self) -> GraphGrid {
        self.grid
    }

    /// Number of pairs.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Whether there is no pair.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// The pairs of every reference.
    pub(super) fn by_reference(&self) -> Vec<Vec<usize>> {
        let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        self.pairs.iter().enumerate().for_each(|(index, pair)| groups.entry(pair.0).or_default().push(index));
        groups.into_values().collect()
    }

    /// The table of a pair's reference.
    pub(super) fn reference(&self, index: usize) -> Result<CosineTable, ExperimentError> {
        self.table(self.pairs[index].0)
    }

    /// The table of a pair's candidate.
    pub(super) fn candidate(&self, index: usize) -> Result<CosineTable, ExperimentError> {
        self.table(self.pairs[index].1)
    }

    /// What a pair's BRDFs were opened from.
    pub(super) fn notations(&self, index: usize) -> (String, String) {
        let (reference, candidate) = self.pairs[index];
        (self.sources[reference].identity(), self.sources[candidate].identity())
    }

    fn table(&self, number: usize) -> Result<CosineTable, ExperimentError> {
        match self.kept.get(number) {
            Some(table) => Ok(table.expand()),
            None => Ok(make(&self.sources[number], self.grid, self.base.as_deref())?.expand()),
        }
    }
}

fn make(source: &BrdfSource, grid: GraphGrid, base: Option<&Path>) -> Result<CompactTable, ExperimentError> {
    let brdf = source.open_unhashed(base)?;
    let table = CosineTable::of(&*brdf, grid, Side::Alone);
    let named = |cause| ExperimentError::Table { notation: source.notation().to_owned(), source: Box::new(cause) };
    let table = table.map_err(named)?;
    Ok(CompactTable::new(&table))
}
