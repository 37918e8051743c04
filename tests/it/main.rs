//! The integration tests, in one binary.
mod evaluation;
mod report;
