//! Every combination of the study's transport and kernel distances over a study of ratings.
//!
//! [`StudyTables`] holds the BRDFs, [`compute`] gives the divergences of one [`Combination`], which [`CombinationRecord`]
//! keeps, and [`judge`] compares all with the ratings. Cost: pairs x .3 s x [`Combination::weight`] a combination and core.

mod combination;
mod judge;
mod run;
mod tables;

pub use combination::{ALPHAS, BLURS, Combination, Family, GAMMAS, POWERS, SCALINGS, Transport};
pub use judge::{Judged, SweepProtocol, SweepRecord, SweepRow, judge};
pub use run::{CombinationRecord, Outcome, compute, fingerprint};
pub use tables::StudyTables;
