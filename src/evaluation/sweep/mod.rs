//! Every combination of the study's transport and kernel distances over a study of ratings.
//!
//! [`StudyTables`] holds the BRDFs, [`compute`] gives the divergences of a group of [`Combination`]s, which [`CombinationRecord`]
//! keeps, and [`judge`] compares all with the ratings. Cost of a pair on a core at coarse accuracy: .1 s for the masses of a group,
//! and for each combination its [`Combination::weight`] times .01 s at alpha .1, blur .05, half of that at alpha .01, twenty times as
//! much at alpha .05, blur .01.

mod combination;
mod judge;
mod run;
mod tables;

pub use combination::{ALPHAS, BLURS, Combination, Family, GAMMAS, POWERS, SCALINGS, Transport};
pub use judge::{Judged, SweepProtocol, SweepRecord, SweepRow, judge};
pub use run::{CombinationRecord, Outcome, PairOutcome, Setting, compute, fingerprint, groups};
pub use tables::StudyTables;
