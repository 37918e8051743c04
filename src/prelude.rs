//! What most programs need: `use vernis::prelude::*;`.

pub use crate::dataset::Study;
#[cfg(feature = "train")]
pub use crate::experiment::{BenchmarkOptions, TrainOptions, Trained, benchmark, train};
pub use crate::io::{Observer, Progress, silent};
pub use vernis_metric::prelude::*;
