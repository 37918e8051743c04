//! Statistics of the ratings themselves: what a panel said, how far it agrees, and what moves it. Sections 4.2 to 5.5
//! of Lavoue et al. 2021 (doi:10.1111/cgf.142636) for any study.
//!
//! [`describe`] makes a [`StudyRecord`], plain data that reports and figures are drawn from; each statistic has its own
//! file and can be used alone.

mod analysis;
pub mod anova;
pub mod box_plot;
mod comparison;
pub mod distribution;
mod error;
pub mod intraclass;
pub mod moments;
pub mod noise;
pub mod opinion;
pub mod parameters;
pub mod record;
pub mod reliability;
pub mod screening;
pub mod sos;
pub mod t_test;

pub use analysis::{Options, describe};
pub use box_plot::BoxPlot;
pub use comparison::{BY_MODEL, BY_MODEL_AND_TYPE};
pub use error::StudyError;
pub use record::StudyRecord;
