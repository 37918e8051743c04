//! Why a statistic does not exist.

use thiserror::Error;
use vernis_metric::io::counted;
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
    #[error("factor {factor} has {}; it must have at least 2", counted(*found, "level"))]
    OneLevel { factor: String, found: usize },
    #[error("only mean scores are given; raw scores (participant, material, method, score) are needed")]
    NoRawScores,
    #[error("the scale has no worst end, so that nothing is known of how the spread of scores falls towards it")]
    OpenScale,
    #[error("the number of {what} is {found}; it must be {allowed}")]
    Levels { what: &'static str, found: String, allowed: &'static str },
    #[error(
        "no degree of freedom is left for the residual: there are {} for a model with {}",
        counted(*rows, "row"), counted(*parameters, "parameter")
    )]
    Saturated { rows: usize, parameters: usize },
    #[error("the effect of {term} cannot be told from others: {} of levels without a row", counted(*empty, "combination"))]
    Confounded { term: String, empty: usize },
    #[error("screening rejects all but {left} of {}; it must leave at least 2", counted(*participants, "participant"))]
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
