//! Correlations and ranks.
