//! Each Lp variant as a metric of its own.

use super::block::{Cells, NodeValues, cells, owned_cells, table_on_nodes};
use super::formula::CellFormula;
use super::gradient::gradient;
use super::kernel::Work;
use super::pass::Sums;
use super::variant::{Formula, LpVariant};
use super::{AZIMUTHS, FAMILY, LpDistances, LpReference, POLAR, POLAR_CLAMPED, VERSION};
use crate::brdf::{Brdf, Grid};
use crate::math::Rgb;
use crate::metric::{
    Gradient, Measured, Metric, MetricError, Nodes, PreparedMetric, PreparedShare, Properties, Share, Side,
};
use std::sync::Arc;

/// One Lp variant. It computes only what its formula needs; [`super::LpDistances`] gives all at once.
#[derive(Debug, Clone)]
pub struct LpMetric {
    variant: LpVariant,
    name: String,
}

impl LpMetric {
    /// The metric of one variant.
    pub fn new(variant: LpVariant) -> Self {
        Self { variant, name: variant.to_string() }
    }

    /// Formula, clamping and cube root of this metric.
    pub fn variant(&self) -> LpVariant {
        self.variant
    }

    fn between(&self, reference: &dyn Cells, candidate: &dyn Cells) -> Result<f64, MetricError> {
        let sums = sums_of(reference, candidate, &Work::for_variants([self.variant]))?;
        checked_distance(&sums, self.variant)
    }
}

impl LpMetric {
    /// Polar angles that take part, along each axis.
    fn polar(&self) -> usize {
        if self.variant.clamped { POLAR_CLAMPED } else { POLAR }
    }

    fn nodes(&self) -> Arc<Nodes> {
        let polar = self.polar();
        let id = format!("lp-{polar}x{polar}x{AZIMUTHS}");
        Nodes::shared(&id, |id| {
            Nodes::of_cells(id, Grid::TITOPO, [polar, polar, AZIMUTHS], move |table| table_on_nodes(table, polar))
        })
    }

    fn checked<'a>(&self, values: &'a [Rgb]) -> Result<NodeValues<'a>, MetricError> {
        self.nodes().check(&self.name, values)?;
        Ok(NodeValues::new(values, self.polar()))
    }
}

/// The sums of one candidate.
pub(super) fn sums_of(reference: &dyn Cells, candidate: &dyn Cells, work: &Work) -> Result<Sums, MetricError> {
    Ok(Sums::over(reference, &[candidate], work)?.swap_remove(0))
}

/// The distance, or why there is none.
pub(super) fn checked_distance(sums: &Sums, variant: LpVariant) -> Result<f64, MetricError> {
    if sums.cells(variant) == 0 {
        return Err(MetricError::NoCommonCell { metric: variant.to_string() });
    }
    match sums.distance(variant) {
        value if value.is_finite() => Ok(value),
        value => Err(MetricError::NotFinite { metric: variant.to_string(), value }),
    }
}

impl Metric for LpMetric {
    fn name(&self) -> &str {
        &self.name
    }

    fn properties(&self) -> Properties {
        let LpVariant { formula, clamped, cube_root } = self.variant;
        let clamped = if clamped { ", polar angles below 80 degrees" } else { "" };
        let cube_root = if cube_root { ", of cube roots" } else { "" };
        Properties {
            family: FAMILY,
            unit: self.variant.unit(),
            symmetric: true,
            // The colour coordinates of D6 jump.
            usable_as_loss: formula != Formula::D6,
            differentiable: CellFormula::of(self.variant).is_some(),
            summary: format!("{}{cube_root}{clamped}", formula.summary()),
            source: match formula {
                Formula::Lab => "CIE 15:2018, section 8.2.1, weighted as D6",
                _ => "Lavoue et al. 2021, section 6.1, as computed by the authors' program",
            },
            ..Properties::default()
        }
    }

    fn version(&self) -> &str {
        VERSION
    }

    fn prepare(&self, reference: &dyn Brdf) -> Result<Box<dyn PreparedMetric>, MetricError> {
        Ok(Box::new(Prepared { metric: self.clone(), reference: owned_cells(reference, Side::Reference)? }))
    }

    fn distance(&self, reference: &dyn Brdf, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        self.between(&*cells(reference, Side::Reference)?, &*cells(candidate, Side::Candidate)?)
    }

    fn share(&self) -> Option<Share> {
        Some(Share::new("lp", self.variant, together))
    }
}

struct Prepared {
    metric: LpMetric,
    reference: Box<dyn Cells>,
}

impl PreparedMetric for Prepared {
    fn distance(&self, candidate: &dyn Brdf) -> Result<f64, MetricError> {
        self.metric.between(&*self.reference, &*cells(candidate, Side::Candidate)?)
    }

    fn nodes(&self) -> Option<Arc<Nodes>> {
        Some(self.metric.nodes())
    }

    fn distance_at(&self, values: &[Rgb]) -> Result<f64, MetricError> {
        self.metric.between(&*self.reference, &self.metric.checked(values)?)
    }

    /// The derivatives that [`crate::metric::lp`] lists.
    fn gradient_at(&self, values: &[Rgb]) -> Result<Gradient, MetricError> {
        let values = self.metric.checked(values)?;
        let Some(cell) = CellFormula::of(self.metric.variant) else {
            return Err(MetricError::NoGradient { metric: self.metric.name.clone() });
        };
        gradient(self.metric.variant, cell, self.metric.polar(), &*self.reference, &values)
    }

    fn smooth_power(&self) -> f64 {
        self.metric.variant.formula.smooth_power()
    }
}

/// Any number of variants from one pass.
struct Together {
    variants: Vec<LpVariant>,
    reference: LpReference,
}

fn together(variants: Vec<LpVariant>, reference: &dyn Brdf) -> Result<Box<dyn PreparedShare>, MetricError> {
    Ok(Box::new(Together { variants, reference: LpReference::new(reference)? }))
}

impl PreparedShare for Together {
    fn measure(&self, candidate: &dyn Brdf) -> Result<Vec<Measured>, MetricError> {
        Ok(self.measure_all(&[candidate])?.swap_remove(0))
    }

    fn measure_all(&self, candidates: &[&dyn Brdf]) -> Result<Vec<Vec<Measured>>, MetricError> {
        let measured = |found: &LpDistances| {
            let of = |&variant: &LpVariant| Measured {
                value: found.get(variant),
                channels: found.channels(variant),
                score: None,
            };
            self.variants.iter().map(of).collect()
        };
        let found = LpDistances::of_variants_from(&self.reference, candidates, &self.variants)?;
        Ok(found.iter().map(measured).collect())
    }
}
