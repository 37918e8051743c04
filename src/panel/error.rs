//! Why a statistic does not exist.

use thiserror::Error;
use vernis_metric::math::correlation::CorrelationError;
use vernis_metric::math::resampling::ResamplingError;

/// Errors of this room.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum StudyError {
    #[error("the number of {what} is {found}; it must be at least {least}")]
    TooFew { what: &'static str, found: usize, least: usize },
    #[error("{what} do not differ, so there is no noise to compare with")]
    NoSpread { what: &'static str },
    #[error("the design is not complete: {participant} did not rate {missing} of {stimuli} stimuli")]
    Incomplete { participant: String, missing: usize, stimuli: usize },
    #[error("factor {factor} has {found} levels; it must have at least 2")]
    OneLevel { factor: String, found: usize },
    #[error("only mean scores are given; raw scores (participant, material, method, score) are needed")]
    NoRawScores,
    #[error("the scale has no worst end, so that nothing is known of how the spread of scores falls towards it")]
    OpenScale,
    #[error("the number of {what} is {found}; it must be {allowed}")]
    Levels { what: &'static str, found: String, allowed: &'static str },
    #[error("{rows} rows leave no degree of freedom for the residual of a model with {parameters} parameters")]
    Saturated { rows: usize, parameters: usize },
    #[error("the effect of {term} cannot be told from others: {empty} combinations of levels have no row")]
    Confounded { term: String, empty: usize },
    #[error("screening rejects all but {left} of {participants} participants; it must leave at least 2")]
    AllRejected { left: usize, participants: usize },
    #[error("{0}")]
    Correlation(#[from] CorrelationError),
    #[error(transparent)]
    Resampling(#[from] ResamplingError),
}

/// Fails where `found` is less than `least`.
pub fn at_least(what: &'static str, found: usize, least: usize) -> Result<(), StudyError> {
    if found < least { Err(StudyError::TooFew { what, found, least }) } else { Ok(()) }
}
