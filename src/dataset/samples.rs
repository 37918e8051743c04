//! A study as a matrix: one row a rated pair, one column a descriptor.

use ndarray::{Array2, ArrayView1, ArrayView2, Axis};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What a column of the matrix says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Compares candidate with reference; exactly zero for identical BRDFs.
    Difference,
    /// Describes the reference alone.
    Context,
}

/// Name and meaning of one column.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Such as `lights.dE4`; unique.
    pub name: String,
    /// Such as `lights`, the unit of an ablation.
    pub family: String,
    pub role: Role,
}

/// What a row belongs to.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Name of the reference's material.
    pub material: String,
    /// Rows of one group are never on both sides of a split: materials with their sisters.
    pub group: String,
    /// Approximation method as the ratings name it.
    pub method: String,
    /// Methods of one family are left out together: `ABC` with `ABC-OURS`.
    pub method_family: String,
    /// Dielectric or metal, where the study says.
    pub material_type: Option<String>,
    /// Mean opinion score, 1 to 5.
    pub mos: f64,
    /// Training weight, positive.
    pub weight: f64,
}

#[derive(Debug, Clone, PartialEq, Error)]
pub enum SamplesError {
    #[error("{what}: found {found}, expected {expected}")]
    Shape { what: &'static str, found: usize, expected: usize },
    #[error("row {row} ({material}, {method}): {column} is {value}; every descriptor must be finite")]
    NotFinite { row: usize, material: String, method: String, column: String, value: f64 },
    #[error("row {row} ({material}, {method}): {what} is {value}; allowed: {allowed}")]
    Rating { row: usize, material: String, method: String, what: &'static str, value: f64, allowed: &'static str },
}

/// A study as numbers: `features` is rows x columns.
#[derive(Debug, Clone)]
pub struct Samples {
    columns: Vec<Column>,
    rows: Vec<Row>,
    features: Array2<f64>,
}

impl Samples {
    /// Checked: shapes agree, descriptors are finite, scores lie in 1..=5 and weights are positive and finite.
    pub fn new(columns: Vec<Column>, rows: Vec<Row>, features: Array2<f64>) -> Result<Self, SamplesError> {
        let shape = |what, found, expected| {
            if found == expected { Ok(()) } else { Err(SamplesError::Shape { what, found, expected }) }
        };
        shape("rows of the feature matrix", features.nrows(), rows.len())?;
        shape("columns of the feature matrix", features.ncols(), columns.len())?;
        for (i, (row, values)) in rows.iter().zip(features.outer_iter()).enumerate() {
            if let Some((c, &value)) = columns.iter().zip(values).find(|(_, v)| !v.is_finite()) {
                return Err(SamplesError::NotFinite {
                    row: i,
                    material: row.material.clone(),
                    method: row.method.clone(),
                    column: c.name.clone(),
                    value,
                });
            }
            let rating = |what, value, allowed| {
                Err(SamplesError::Rating {
                    row: i,
                    material: row.material.clone(),
                    method: row.method.clone(),
                    what,
                    value,
                    allowed,
                })
            };
            if !(1.0..=5.0).contains(&row.mos) {
                return rating("mos", row.mos, "1 to 5");
            }
            if !(row.weight > 0.0 && row.weight.is_finite()) {
                return rating("weight", row.weight, "greater than 0");
            }
        }
        Ok(Self { columns, rows, features })
    }

    pub fn len(&self) -> usize {
        self.rows.len()
    }

    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Rows x columns.
    pub fn features(&self) -> ArrayView2<'_, f64> {
        self.features.view()
    }

    pub fn column(&self, index: usize) -> ArrayView1<'_, f64> {
        self.features.column(index)
    }

    /// The rows at `indices`, in that order.
    pub fn select_rows(&self, indices: &[usize]) -> Self {
        Self {
            columns: self.columns.clone(),
            rows: indices.iter().map(|&i| self.rows[i].clone()).collect(),
            features: self.features.select(Axis(0), indices),
        }
    }

    /// The columns that `keep` accepts, in their order.
    pub fn select_columns(&self, keep: impl Fn(&Column) -> bool) -> Self {
        let indices: Vec<usize> = (0..self.columns.len()).filter(|&i| keep(&self.columns[i])).collect();
        Self {
            columns: indices.iter().map(|&i| self.columns[i].clone()).collect(),
            rows: self.rows.clone(),
            features: self.features.select(Axis(1), &indices),
        }
    }
}
