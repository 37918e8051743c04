//! Every combination of the study's transport and kernel distances over a study of ratings.
//!
//! [`StudyTables`] holds the BRDFs, [`compute`] gives the divergences of a group of [`Combination`]s, which [`CombinationRecord`]
//! keeps, and [`judge`] compares all with the ratings. The cost of a combination is that of its last blur: pairs x .05 s x
//! [`Combination::weight`] on a core at alpha .1, blur .05 and coarse accuracy, a fifth of it at alpha .01, twenty times as much at
//! alpha .05, blur .01.

mod combination;
mod judge;
mod run;
mod tables;

pub use combination::{ALPHAS, BLURS, Combination, Family, GAMMAS, POWERS, SCALINGS, Transport};
pub use judge::{Judged, SweepProtocol, SweepRecord, SweepRow, judge};
pub use run::{CombinationRecord, Outcome, PairOutcome, Setting, compute, fingerprint, groups};
pub use tables::StudyTables;
