//! Every combination of the study's transport and kernel distances over a study of ratings.
//!
//! [`StudyTables`] holds the BRDFs, [`compute`] gives the divergences of a group of [`Combination`]s, which [`CombinationRecord`]
//! keeps, and [`judge`] compares all with the ratings. Cost of a pair on a core at coarse accuracy, four scalings
//! together: from 0.15 s (alpha 0.01, blur 0.01, t^1/3) to 6 s (alpha 0.1, blur 0.01, log with eta 0.001).

mod combination;
mod job;
mod journal;
mod judge;
mod run;
mod tables;

pub use combination::{ALPHAS, BLURS, Combination, Family, GAMMAS, POWERS, SCALINGS, Transport};
pub use job::{SweepOptions, Swept, sweep};
pub use journal::Journal;
pub use judge::{Judged, SweepProtocol, SweepRecord, SweepRow, judge};
pub use run::{CombinationRecord, Outcome, PairOutcome, Setting, compute, fingerprint, groups};
pub use tables::StudyTables;
