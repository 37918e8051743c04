//! Names and roles of the numbers that a comparison gives.

use serde::{Deserialize, Serialize};

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
    /// Whether the column compares the two BRDFs or describes the reference.
    pub role: Role,
}
