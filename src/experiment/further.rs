//! Metrics of the user's choice that take part in a benchmark beside those that always do: metrics on stimuli, other members of
//! the families of distances.
//!
//! Each is judged as the classical ones are: its logistic map is fitted on the training side of each fold, and its difference to the
//! learned metric is paired. Metrics that were learned from ratings are refused: they may have seen the rows that are judged.

use super::external::ExternalScores;
use super::{ExperimentError, contenders, train};
use crate::dataset::Study;
use crate::evaluation::protocol::{Contender, Source};
use crate::evaluation::records::MetricKind;
use crate::samples::Samples;
use std::fmt;
use std::sync::Arc;
use vernis_image::stimulus;
use vernis_metric::metric::{Metric, learned, lp};

/// Metrics beside those that always take part.
#[derive(Clone, Default)]
pub struct Further {
    metrics: Vec<Arc<dyn Metric>>,
}

impl fmt::Debug for Further {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.metrics.iter().map(|metric| metric.name())).finish()
    }
}

impl Further {
    /// Those of `metrics` that do not take part in the benchmark of `study` anyway.
    ///
    /// # Errors
    /// A metric that was learned from ratings, or whose name another contender has.
    pub fn new(metrics: Vec<Arc<dyn Metric>>, study: &Study) -> Result<Self, ExperimentError> {
        let usual = train::metrics(study)?;
        let taken = contenders::names(&usual);
        let mut kept: Vec<Arc<dyn Metric>> = Vec::new();
        for metric in metrics {
            let name = metric.name();
            let refused = |reason: &str| ExperimentError::Unsupported {
                study: study.name.clone(),
                reason: format!("{name} cannot be judged: {reason}"),
            };
            if metric.properties().family == learned::FAMILY {
                return Err(refused(
                    "it was learned from ratings, perhaps from those that are judged; the benchmark trains its own",
                ));
            }
            let again = usual.iter().chain(&kept).any(|known| known.identity() == metric.identity());
            if again {
                continue;
            }
            if taken.iter().any(|known| known == name) || kept.iter().any(|known| known.name() == name) {
                return Err(refused("another contender has its name"));
            }
            kept.push(metric);
        }
        Ok(Self { metrics: kept })
    }

    /// That no column of a file of distances has the name of one of them.
    pub(super) fn check_beside(&self, scores: Option<&ExternalScores>, study: &Study) -> Result<(), ExperimentError> {
        let columns = || scores.into_iter().flat_map(|scores| &scores.metrics);
        let same = |metric: &&Arc<dyn Metric>| columns().any(|column| column.name.eq_ignore_ascii_case(metric.name()));
        self.metrics.iter().find(same).map_or(Ok(()), |metric| {
            let reason = format!(
                "{} is asked for and is a column of the file of scores; it must be one of the two",
                metric.name()
            );
            Err(ExperimentError::Unsupported { study: study.name.clone(), reason })
        })
    }

    /// The metrics.
    pub fn metrics(&self) -> &[Arc<dyn Metric>] {
        &self.metrics
    }

    /// Each metric, with its distances in `samples`.
    pub(super) fn contenders<'a>(&'a self, samples: &'a Samples) -> impl Iterator<Item = Contender<'a>> {
        self.metrics.iter().map(move |metric| {
            let properties = metric.properties();
            let kind = match properties.family {
                stimulus::FAMILY => MetricKind::Image,
                lp::FAMILY => MetricKind::Lp,
                _ => MetricKind::Graph,
            };
            Contender {
                name: metric.name().to_owned(),
                kind,
                note: properties.summary,
                source: Source::Distance(samples),
            }
        })
    }

    /// What to type for the same metrics.
    pub(super) fn arguments(&self) -> String {
        self.metrics.iter().map(|metric| format!(" --metric '{}'", metric.name())).collect()
    }
}
