//! Values on the nodes of a measure.

use super::super::elementary::Lanes;

/// A potential, or anything else with one number a node of a measure: base nodes x value nodes, [`LANES`](super::super::elementary::LANES) nodes to an entry.
pub(super) type Field = Vec<Lanes>;
