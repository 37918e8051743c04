//! Studies: rated pairs of BRDFs, where they come from, and how they are split.
//!
//! Nothing in this room knows how anything is computed from a BRDF.

pub mod contradiction;
pub mod csv_study;
pub mod csv_table;
mod error;
pub mod fetch;
mod identical;
pub mod inventory;
mod load;
pub mod manifest;
pub mod notice;
pub mod opinions;
pub mod pair_table;
mod published;
pub mod rating_differences;
mod ratings;
pub mod raw_layout;
pub mod raw_ratings;
pub mod scale;
mod study;
pub mod synthetic;
pub mod triplets;
pub mod verify;

pub use error::DatasetError;
pub use identical::{ASSUMED_SHARE, Basis, Identical};
pub use inventory::{StudyStatus, inventory};
pub use scale::DeclaredScale;
pub use study::{Completeness, NamedRows, RatedPair, Row, Study, StudyFile};
