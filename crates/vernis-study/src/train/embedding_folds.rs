//! Learned embeddings inside cross-validation: for each fold learned anew, on references whose material is not held out.
//!
//! Rows of the learned matrix are log-mapped node tables of references, and of other measured materials where there are
//! some; candidates are never learned from. The differences of candidate and reference in the embedding are columns.

use super::TrainError;
use super::embedding::PrincipalComponents;
use super::neural::{Autoencoder, LEAK};
use crate::dataset::Study;
use crate::samples::extraction::NodeTables;
use crate::samples::split::{Fold, SplitError, grouped_folds, method_and_group_folds};
use crate::samples::{Samples, SamplesError};
use ndarray::{Array2, ArrayView1, ArrayView2, Axis, concatenate};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use thiserror::Error;
use vernis_metric::brdf::BrdfSource;
use vernis_metric::descriptor::embedding::{EmbeddingParts, LogSpace, log_map};
use vernis_metric::descriptor::{Cache, Column, DescriptorError, Embedding, Role, Setup, features};
use vernis_metric::light::NodeTable;
use vernis_metric::math::parallel;

/// Coordinates of an embedding.
const DIMENSION: usize = 8;
/// The logarithms that embeddings are learned from.
const SPACE: LogSpace = LogSpace::Opponent;

/// Why the embeddings of the folds could not be learned.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum EmbeddingError {
    #[error(transparent)]
    Descriptor(#[from] DescriptorError),
    #[error(transparent)]
    Train(#[from] TrainError),
    #[error(transparent)]
    Samples(#[from] SamplesError),
    #[error(transparent)]
    Split(#[from] SplitError),
    #[error("embedding {name}: {found} columns do not fit {expected} rows")]
    Shape { name: &'static str, found: usize, expected: usize },
}

/// How an embedding is learned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Learner {
    /// Principal components.
    PrincipalComponents,
    /// A small neural autoencoder.
    Autoencoder,
}

impl Learner {
    /// All learners.
    pub const ALL: [Self; 2] = [Self::PrincipalComponents, Self::Autoencoder];

    /// The name that benchmarks use, such as `pca`.
    pub fn name(self) -> &'static str {
        match self {
            Self::PrincipalComponents => "pca",
            Self::Autoencoder => "autoencoder",
        }
    }

    /// The embedding learned on the rows, which are tables in the logarithms of [`SPACE`].
    fn learn(self, rows: &Array2<f64>, seed: u64) -> Result<Embedding, EmbeddingError> {
        let (components, scale, layers) = match self {
            Self::PrincipalComponents => {
                let count = DIMENSION.min(rows.nrows().saturating_sub(1)).max(1);
                (PrincipalComponents::fit(rows.view(), count)?, 1.0, Vec::new())
            }
            Self::Autoencoder => {
                let found = Autoencoder { code: DIMENSION, ..Autoencoder::default() }.train(rows.view(), seed)?;
                (found.components, found.scale, found.layers)
            }
        };
        let component = |row: ArrayView1<'_, f64>| row.iter().map(|c| (c / scale) as f32).collect();
        Ok(Embedding::new(EmbeddingParts {
            name: self.name().to_owned(),
            space: SPACE,
            mean: components.mean.iter().map(|&m| m as f32).collect(),
            components: components.components.outer_iter().map(component).collect(),
            layers,
            slope: LEAK,
        })?)
    }
}

/// Tables of a study.
pub struct TableBank {
    /// By material: its group and its table.
    references: BTreeMap<String, (String, NodeTable)>,
    /// By row.
    candidates: Vec<NodeTable>,
    /// Measured materials that nobody rated.
    others: Vec<NodeTable>,
}

impl TableBank {
    /// Those of `study`, and those of `others`, which are sampled through the cache.
    pub fn new(
        study: &Study,
        tables: NodeTables,
        others: &[BrdfSource],
        base: Option<&Path>,
        cache: Option<&Cache>,
        setup: &Setup,
    ) -> Result<Self, DescriptorError> {
        let group_of: BTreeMap<&str, &str> =
            study.pairs.iter().map(|p| (p.material.as_str(), p.group.as_str())).collect();
        let grouped = |(material, table): (String, NodeTable)| {
            let group = group_of.get(material.as_str()).map_or_else(|| material.clone(), |g| (*g).to_owned());
            (material, (group, table))
        };
        let table = |source: &BrdfSource| -> Result<NodeTable, DescriptorError> {
            Ok(features(&source.identify(base)?, setup, cache)?.0.table().clone())
        };
        let references = tables.references.into_iter().map(grouped).collect();
        let others = parallel::try_map(others.len(), |k| table(&others[k]))?;
        Ok(Self { references, candidates: tables.candidates, others })
    }

    /// `samples` with columns of an embedding learned without the references of the groups in `held`.
    fn extend(
        &self,
        samples: &Samples,
        held: &BTreeSet<&str>,
        learner: Learner,
        seed: u64,
    ) -> Result<Samples, EmbeddingError> {
        let known =
            self.references.values().filter(|(group, _)| !held.contains(group.as_str())).map(|(_, table)| table);
        let rows: Vec<Vec<f64>> = known.chain(&self.others).map(|table| log_map(table, SPACE)).collect();
        let width = rows.first().map_or(0, Vec::len);
        let flat = rows.concat();
        let shape = |found, expected| EmbeddingError::Shape { name: learner.name(), found, expected };
        let matrix = Array2::from_shape_vec((rows.len(), width), flat).map_err(|_| shape(width, rows.len()))?;
        let embedding = learner.learn(&matrix, seed)?;
        let tables: Vec<&NodeTable> = self.references.values().map(|(_, table)| table).collect();
        let coordinates = parallel::map_items(&tables, |table| embedding.coordinates(table));
        let references: BTreeMap<&str, Vec<f64>> =
            self.references.keys().map(String::as_str).zip(coordinates).collect();
        let rows: Vec<_> = samples.rows().iter().zip(&self.candidates).collect();
        let differences = parallel::map_items(&rows, |(row, table)| -> Vec<f64> {
            let reference = references.get(row.material.as_str());
            let candidate = embedding.coordinates(table);
            candidate.iter().zip(reference.into_iter().flatten()).map(|(c, r)| c - r).collect()
        });
        let dimension = differences.first().map_or(0, Vec::len);
        let flat: Vec<f64> = differences.into_iter().flatten().collect();
        let found = flat.len();
        let added =
            Array2::from_shape_vec((samples.len(), dimension), flat).map_err(|_| shape(found, samples.len()))?;
        let beside = |features: ArrayView2<'_, f64>, added: &Array2<f64>| {
            concatenate(Axis(1), &[features.view(), added.view()]).map_err(|_| shape(dimension, samples.len()))
        };
        let features = beside(samples.features(), &added)?;
        let mut columns = samples.columns().to_vec();
        columns.extend((0..dimension).map(|k| Column {
            name: format!("{}.{k}", learner.name()),
            family: learner.name().to_owned(),
            role: Role::Difference,
        }));
        let extended = Samples::new(columns, samples.rows().to_vec(), features)?.identical_as(samples);
        match samples.swapped() {
            // Exchanged, a difference of coordinates changes its sign.
            Some(swapped) => Ok(extended.with_swapped(beside(swapped, &added.mapv(|d| -d))?)?),
            None => Ok(extended),
        }
    }
}

/// Folds by material, and by method and material, whose columns were learned inside each.
pub struct EmbeddedFolds {
    /// Number of columns, those of the embedding included.
    pub columns: usize,
    /// Folds by material group.
    pub by_material: Vec<Fold>,
    /// Folds by family of methods and material group, where they were asked for.
    pub by_method: Option<Vec<Fold>>,
}

/// The folds of [`crate::samples::split`] with the same numbers (by material, and by material within each method family, where
/// that is asked for) and seed, each with the columns of `samples` and those of an embedding learned on its training side.
pub fn embedded_folds(
    bank: &TableBank,
    samples: &Samples,
    learner: Learner,
    folds: usize,
    method_folds: Option<usize>,
    seed: u64,
) -> Result<EmbeddedFolds, EmbeddingError> {
    let mut found = EmbeddedFolds { columns: 0, by_material: Vec::new(), by_method: None };
    for (k, fold) in grouped_folds(samples, folds, seed)?.iter().enumerate() {
        let extended = bank.extend(samples, &held_groups(fold), learner, seed)?;
        found.columns = extended.columns().len();
        found.by_material.extend(grouped_folds(&extended, folds, seed)?.into_iter().nth(k));
    }
    let Some(method_folds) = method_folds else { return Ok(found) };
    // Each method family is left out with the same groups of materials.
    let mut by_method = Vec::new();
    for fold in &grouped_folds(samples, method_folds, seed)? {
        let held = held_groups(fold);
        let extended = bank.extend(samples, &held, learner, seed)?;
        let of_these = |f: &Fold| f.held_out.rows().iter().all(|r| held.contains(r.group.as_str()));
        by_method.extend(method_and_group_folds(&extended, method_folds, seed)?.into_iter().filter(of_these));
    }
    found.by_method = Some(by_method);
    Ok(found)
}

fn held_groups(fold: &Fold) -> BTreeSet<&str> {
    fold.held_out.rows().iter().map(|r| r.group.as_str()).collect()
}
