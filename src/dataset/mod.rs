//! Studies: rated pairs of BRDFs, where they come from, and how they are split.
//!
//! Nothing in this room knows how anything is computed from a BRDF.

pub mod samples;
pub mod split;

use crate::brdf::BrdfSource;

/// Candidates of the study, by the name that the ratings use for the method.
#[derive(Clone)]
pub struct RatedPair {
    pub reference: BrdfSource,
    pub candidate: BrdfSource,
    /// The reference's material: what folds are grouped by, after sisters are joined.
    pub material: String,
    /// The approximation method, such as `SGD` or `GPLVM_APPROX.3`.
    pub method: String,
    /// Mean opinion score, 1 (very poor) to 5 (excellent).
    pub mos: f64,
    /// Weight of the row in training, 0 excluded.
    pub weight: f64,
}

/// A study: pairs that people (or simulated observers) rated.
#[derive(Clone)]
pub struct Study {
    pub name: String,
    /// Ratings come from simulated observers; every output says so.
    pub synthetic: bool,
    pub pairs: Vec<RatedPair>,
}
