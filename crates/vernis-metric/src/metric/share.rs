//! Work that several metrics do together.
//!
//! All Lp distances come from one pass over a pair; all metrics on graphs read the same tables. A metric that has such work in
//! common with others hands out a [`Share`]: a key that says what is shared, its own part, and the function that prepares any
//! number of parts at once. [`PreparedMetrics`] groups the shares of one key. Nothing here knows which metrics there are, and a
//! metric of another crate shares its passes in the same way:
//!
//! ```
//! use vernis_metric::brdf::Brdf;
//! use vernis_metric::metric::{Measured, MetricError, PreparedShare, Share};
//!
//! /// How often a metric of this family counts the pass.
//! struct Part(f64);
//!
//! struct Together(Vec<Part>);
//!
//! impl PreparedShare for Together {
//!     fn measure(&self, _candidate: &dyn Brdf) -> Result<Vec<Measured>, MetricError> {
//!         let pass = 1.0; // one pass over the pair for all parts
//!         Ok(self.0.iter().map(|part| Measured::distance(part.0 * pass)).collect())
//!     }
//! }
//!
//! fn prepare(parts: Vec<Part>, _reference: &dyn Brdf) -> Result<Box<dyn PreparedShare>, MetricError> {
//!     Ok(Box::new(Together(parts)))
//! }
//!
//! let share = Share::new("my pass", Part(2.0), prepare);
//! assert_eq!(share.key().name(), "my pass");
//! ```

use super::{Measured, Metric, MetricError, PreparedMetric};
use crate::brdf::Brdf;
use std::any::{Any, TypeId};
use std::sync::Arc;

/// What tells the groups of metrics that are prepared together: the type of their parts, and a name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShareKey {
    part: TypeId,
    name: String,
}

impl ShareKey {
    /// Such as `lp`, or `graph 45x45x180`.
    pub fn name(&self) -> &str {
        &self.name
    }
}

type Part = Box<dyn Any + Send + Sync>;
type Prepare = Box<dyn Fn(Vec<Part>, &dyn Brdf) -> PreparedResult>;

/// What preparing several parts with a reference gives.
pub type PreparedResult = Result<Box<dyn PreparedShare>, MetricError>;

/// The part of one metric in work that it has in common with others.
pub struct Share {
    key: ShareKey,
    part: Part,
    prepare: Prepare,
}

impl Share {
    /// `name` says what is shared; metrics whose parts are of one type and whose names are equal are prepared by one call of
    /// `prepare`, which gets all parts and gives as many numbers in the same order.
    pub fn new<P: Any + Send + Sync>(
        name: impl Into<String>,
        part: P,
        prepare: fn(Vec<P>, &dyn Brdf) -> PreparedResult,
    ) -> Self {
        let typed = move |parts: Vec<Part>, reference: &dyn Brdf| {
            // Equal keys mean equal types.
            let parts = parts.into_iter().filter_map(|part| part.downcast::<P>().ok()).map(|part| *part).collect();
            prepare(parts, reference)
        };
        let key = ShareKey { part: TypeId::of::<P>(), name: name.into() };
        Self { key, part: Box::new(part), prepare: Box::new(typed) }
    }

    /// What tells shares that are prepared together.
    pub fn key(&self) -> &ShareKey {
        &self.key
    }
}

/// Several metrics whose reference is fixed.
pub trait PreparedShare: Send + Sync {
    /// One result a part, in their order.
    ///
    /// # Errors
    /// Those of [`PreparedMetric::distance`].
    fn measure(&self, candidate: &dyn Brdf) -> Result<Vec<Measured>, MetricError>;

    /// [`PreparedShare::measure`] of every candidate; a share whose candidates have work in common does it once.
    ///
    /// # Errors
    /// Those of [`PreparedShare::measure`], of any of the candidates.
    fn measure_all(&self, candidates: &[&dyn Brdf]) -> Result<Vec<Vec<Measured>>, MetricError> {
        candidates.iter().map(|candidate| self.measure(*candidate)).collect()
    }
}

/// The places of metrics that are prepared together, in the order of their first member; a metric that shares nothing is a group
/// of its own.
pub fn groups(metrics: &[Arc<dyn Metric>]) -> Vec<Vec<usize>> {
    let mut groups: Vec<(Option<ShareKey>, Vec<usize>)> = Vec::new();
    for (place, metric) in metrics.iter().enumerate() {
        let key = metric.share().map(|share| share.key);
        match groups.iter_mut().find(|(known, _)| key.is_some() && *known == key) {
            Some((_, places)) => places.push(place),
            None => groups.push((key, vec![place])),
        }
    }
    groups.into_iter().map(|(_, places)| places).collect()
}

/// Many metrics with one reference, each piece of shared work done once: once for the reference, once a candidate.
pub struct PreparedMetrics {
    names: Vec<String>,
    groups: Vec<(Vec<usize>, Prepared)>,
}

enum Prepared {
    Alone(Box<dyn PreparedMetric>),
    Together(Box<dyn PreparedShare>),
}

impl PreparedMetrics {
    /// # Errors
    /// The first of [`Metric::prepare`], or of the functions that prepare shares.
    pub fn new(metrics: &[Arc<dyn Metric>], reference: &dyn Brdf) -> Result<Self, MetricError> {
        let prepare = |places: Vec<usize>| {
            let mut shares: Vec<Share> = places.iter().filter_map(|&place| metrics[place].share()).collect();
            let prepared = match shares.pop() {
                Some(last) => {
                    let mut parts: Vec<Part> = shares.into_iter().map(|share| share.part).collect();
                    parts.push(last.part);
                    Prepared::Together((last.prepare)(parts, reference)?)
                }
                None => Prepared::Alone(metrics[places[0]].prepare(reference)?),
            };
            Ok((places, prepared))
        };
        let names = metrics.iter().map(|metric| metric.name().to_owned()).collect();
        Ok(Self { names, groups: groups(metrics).into_iter().map(prepare).collect::<Result<_, MetricError>>()? })
    }

    /// One result a metric, in their order, each a finite number.
    ///
    /// # Errors
    /// Those of [`PreparedMetric::distance`]; [`MetricError::NotFinite`], [`MetricError::NotComputed`] where a share gives fewer
    /// numbers than it has parts.
    pub fn measure(&self, candidate: &dyn Brdf) -> Result<Vec<Measured>, MetricError> {
        self.measure_all(&[candidate]).map(|mut found| found.swap_remove(0))
    }

    /// [`PreparedMetrics::measure`] of every candidate, each to the last bit; what they have in common is computed once. Memory: all
    /// candidates at once.
    ///
    /// # Errors
    /// Those of [`PreparedMetrics::measure`], of any of the candidates.
    pub fn measure_all(&self, candidates: &[&dyn Brdf]) -> Result<Vec<Vec<Measured>>, MetricError> {
        let mut found: Vec<Vec<Option<Measured>>> = vec![vec![None; self.names.len()]; candidates.len()];
        for (places, prepared) in &self.groups {
            let of_group = match prepared {
                Prepared::Alone(metric) => {
                    candidates.iter().map(|candidate| Ok(vec![metric.measure(*candidate)?])).collect()
                }
                Prepared::Together(share) => share.measure_all(candidates),
            };
            for (found, of_group) in found.iter_mut().zip(of_group?) {
                places.iter().zip(of_group).for_each(|(&place, measured)| found[place] = Some(measured));
            }
        }
        found.into_iter().map(|found| self.checked(found)).collect()
    }

    fn checked(&self, found: Vec<Option<Measured>>) -> Result<Vec<Measured>, MetricError> {
        let checked = |(found, name): (Option<Measured>, &String)| match found {
            Some(measured) => match measured.numbers().find(|number| !number.is_finite()) {
                None => Ok(measured),
                Some(value) => Err(MetricError::NotFinite { metric: name.clone(), value }),
            },
            None => Err(MetricError::NotComputed {
                metric: name.clone(),
                reason: "the pass that it shares with others gave no number for it".to_owned(),
            }),
        };
        found.into_iter().zip(&self.names).map(checked).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::Lambert;
    use crate::metric::Properties;
    use std::cell::Cell;

    // Each test has a thread of its own, on which everything here runs.
    thread_local! {
        static PREPARED: Cell<usize> = const { Cell::new(0) };
        static PASSES: Cell<usize> = const { Cell::new(0) };
    }

    /// A metric that knows of the pass only through its share.
    struct Scaled(String, f64);

    struct Together(Vec<f64>, f64);

    fn albedo(brdf: &dyn Brdf) -> f64 {
        let up = crate::math::Vec3::new(0.0, 0.0, 1.0);
        brdf.eval(up, up).map_or(0.0, |value| value[0])
    }

    impl PreparedShare for Together {
        fn measure(&self, candidate: &dyn Brdf) -> Result<Vec<Measured>, MetricError> {
            PASSES.set(PASSES.get() + 1);
            let difference = (albedo(candidate) - self.1).abs();
            Ok(self.0.iter().map(|scale| Measured::distance(scale * difference)).collect())
        }
    }

    fn prepare(parts: Vec<f64>, reference: &dyn Brdf) -> Result<Box<dyn PreparedShare>, MetricError> {
        PREPARED.set(PREPARED.get() + 1);
        Ok(Box::new(Together(parts, albedo(reference))))
    }

    impl Metric for Scaled {
        fn name(&self) -> &str {
            &self.0
        }

        fn version(&self) -> &str {
            "1"
        }

        fn properties(&self) -> Properties {
            Properties { unit: "1/sr", symmetric: true, ..Properties::default() }
        }

        fn prepare(&self, _reference: &dyn Brdf) -> Result<Box<dyn PreparedMetric>, MetricError> {
            Err(MetricError::NotComputed { metric: self.0.clone(), reason: "only together".to_owned() })
        }

        fn share(&self) -> Option<Share> {
            Some(Share::new("albedo", self.1, prepare))
        }
    }

    #[test]
    fn metrics_of_another_crate_share_one_pass_and_keep_their_order() {
        let registry = crate::metric::registry::Registry::standard().unwrap();
        let scaled = |scale: f64| Arc::new(Scaled(format!("x{scale}"), scale)) as Arc<dyn Metric>;
        let metrics = [scaled(3.0), registry.get("D5").unwrap(), scaled(1.0), registry.get("D1").unwrap(), scaled(2.0)];
        assert_eq!(groups(&metrics), [vec![0, 2, 4], vec![1, 3]]);
        let [a, b] = [0.1, 0.4].map(|albedo| Lambert::new([albedo; 3]).unwrap());
        let prepared = PreparedMetrics::new(&metrics, &a).unwrap();
        for round in 1..3 {
            let found = prepared.measure(&b).unwrap();
            let difference = 0.3 / std::f64::consts::PI;
            for (place, scale) in [(0, 3.0), (2, 1.0), (4, 2.0)] {
                assert!((found[place].value - scale * difference).abs() < 1e-15);
            }
            assert!((found[1].value - metrics[1].distance(&a, &b).unwrap()).abs() < 1e-12);
            assert_eq!((PREPARED.get(), PASSES.get()), (1, round));
        }
        assert!(prepared.measure(&a).unwrap().iter().all(|m| m.value == 0.0));
    }

    #[test]
    fn a_number_that_is_none_is_an_error_with_the_name_of_the_metric() {
        let metrics = [Arc::new(Scaled("bad".to_owned(), f64::NAN)) as Arc<dyn Metric>];
        let white = Lambert::new([0.5; 3]).unwrap();
        let error = PreparedMetrics::new(&metrics, &white).unwrap().measure(&white).unwrap_err();
        assert!(error.to_string().starts_with("bad: the distance is NaN"), "{error}");
    }
}
