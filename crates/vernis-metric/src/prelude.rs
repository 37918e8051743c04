//! What most programs need: `use vernis_metric::prelude::*;`.

pub use crate::brdf::models::AnalyticBrdf;
pub use crate::brdf::{Brdf, BrdfSource, Grid, OpenBrdf, TabulatedBrdf};
pub use crate::fit::{Fitted, Fitting};
pub use crate::math::{Rgb, Vec3};
pub use crate::metric::learned::LearnedMetric;
pub use crate::metric::registry::{Distance, Registry, distances};
pub use crate::metric::{Metric, MetricError, PreparedMetric, PreparedMetrics, Score};
