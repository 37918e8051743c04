//! The transportation distance as a metric.

use super::{
    Accuracy, GroundCost, PreparedChannel, SinkhornParameters, TransportError, divergence, divergence_and_gradient,
};
use crate::brdf::Brdf;
use crate::math::parallel;
use crate::metric::graph::{self, ChannelGradients, CosineTable, GraphGrid, GraphMetric, Options, PreparedTable, Tone};
use crate::metric::{Metric, MetricError, PreparedMetric, Properties, Share, Side};
use std::sync::Arc;

/// The debiased Sinkhorn divergence between the graphs of two BRDFs, as one number.
#[derive(Debug, Clone, PartialEq)]
pub struct TransportMetric {
    name: String,
    parameters: SinkhornParameters,
    tone: Tone,
    gamma: f64,
    /// `None`: [`GraphGrid::STUDY`], until told otherwise.
    grid: Option<GraphGrid>,
}

const FAMILY: &str = "ot";
/// The study's best on average: p 2, alpha 0.1, blur (epsilon) 0.05, scaling (s) 0.8, phi t^(1/4), gamma 0.25.
const BEST: (f64, f64, f64) = (0.1, 0.05, 0.8);
const OPTIONS: [&str; 12] =
    ["p", "alpha", "blur", "scaling", "gamma", "phi", "eta", "grid", "accuracy", "kappa", "nodes", "clusters"];

impl TransportMetric {
    /// The metric `ot` of the registry.
    ///
    /// # Errors
    /// None, for its parameters are within their ranges.
    pub fn preset() -> Result<Self, MetricError> {
        Self::named(FAMILY)
    }

    /// The member of the family that `name` describes, such as `ot[p=2,alpha=0.1,blur=0.05,scaling=0.8,gamma=0.25,phi=t^1/4]`;
    /// what is not given is as in [`TransportMetric::preset`]. Accuracy is `coarse`, `fast`, `standard` or
    /// `high`, or `kappa` (value nodes to a blur), `nodes` (base nodes an axis) and `clusters` (of cells) ([`Accuracy`]).
    ///
    /// # Errors
    /// [`MetricError::Unknown`] for another family, [`MetricError::Parameter`] for an unknown option or a value out of range.
    pub fn named(name: &str) -> Result<Self, MetricError> {
        let (family, mut options) = Options::split(name)?;
        if family != FAMILY {
            return Err(MetricError::Unknown { name: name.to_owned(), nearest: vec![FAMILY.to_owned()] });
        }
        let above = |x: f64| x > 0.0 && x.is_finite();
        let cost = match options.number("p", |p| p == 1.0 || p == 2.0, "1 or 2")? {
            Some(1.0) => GroundCost::Distance,
            _ => GroundCost::SquaredDistance,
        };
        let alpha = options
            .number("alpha", above, "a number greater than 0 (the study uses 0.01, 0.05, 0.1, 1)")?
            .unwrap_or(BEST.0);
        let blur = options
            .number("blur", above, "a number greater than 0 (the study uses 0.01, 0.02, 0.05, 0.1)")?
            .unwrap_or(BEST.1);
        let scaling = options
            .number(
                "scaling",
                |s| s > 0.0 && s < 1.0,
                "greater than 0 and less than 1 (the study uses 0.8, 0.9, 0.95, 0.99)",
            )?
            .unwrap_or(BEST.2);
        let parameter = |cause: TransportError| wrong(name, &cause);
        let parameters = SinkhornParameters::new(cost, alpha, blur, scaling).map_err(parameter)?;
        let accuracy = accuracy(name, &mut options, alpha, blur)?;
        let metric = Self {
            name: name.to_owned(),
            parameters: parameters.with_accuracy(accuracy).map_err(parameter)?,
            tone: options.tone()?.unwrap_or(Tone::FourthRoot),
            gamma: options.gamma()?.unwrap_or(0.25),
            grid: options.grid()?,
        };
        options.finish(&OPTIONS)?;
        Ok(metric)
    }

    /// Ground cost, alpha, blur, scaling and accuracy.
    pub fn parameters(&self) -> &SinkhornParameters {
        &self.parameters
    }

    /// The curve that compresses the values of the graph.
    pub fn tone(&self) -> Tone {
        self.tone
    }

    /// The channels of a table (`side`: for errors), ready for this metric and those that differ from it in scaling and gamma
    /// alone.
    ///
    /// # Errors
    /// A table without a valid cell or with values that are too large; parameters that the grid is too fine for.
    pub fn prepare_channels(&self, table: &CosineTable, side: Side) -> Result<[PreparedChannel; 3], MetricError> {
        let channel = |c: usize| {
            let values: Vec<f64> = table.channel(c).iter().map(|t| self.tone.value(*t)).collect();
            PreparedChannel::of(&self.parameters, table.grid(), values, Some(table.valid()))
                .map_err(|cause| self.failed(Some(side), &cause))
        };
        in_parallel(channel)
    }

    /// The divergence of each channel (R, G, B).
    ///
    /// # Errors
    /// No cell in common; channels prepared for a metric that differs in more than scaling and gamma.
    pub fn between(
        &self,
        reference: &[PreparedChannel; 3],
        candidate: &[PreparedChannel; 3],
    ) -> Result<[f64; 3], MetricError> {
        in_parallel(|c| {
            divergence(&self.parameters, &reference[c], &candidate[c]).map_err(|cause| self.failed(None, &cause))
        })
    }

    fn failed(&self, side: Option<Side>, cause: &TransportError) -> MetricError {
        match (side, cause) {
            (Some(side), TransportError::NoValidCell) => MetricError::NoValidCell { side },
            (Some(side), TransportError::NotFinite { .. } | TransportError::ValueTooLarge { .. }) => {
                MetricError::Unusable { side, reason: cause.to_string() }
            }
            // Values far apart take more nodes; two graphs far apart, more steps.
            (side, TransportError::TooManyNodes { .. } | TransportError::TooManySteps { .. }) => {
                let (metric, side) = (self.name.clone(), side.unwrap_or(Side::Pair));
                MetricError::TooWide { metric, side, reason: cause.to_string() }
            }
            _ => MetricError::NotComputed { metric: self.name.clone(), reason: cause.to_string() },
        }
    }
}

fn in_parallel<T: Send>(channel: impl Fn(usize) -> Result<T, MetricError> + Sync) -> Result<[T; 3], MetricError> {
    let (red, (green, blue)) = parallel::join(|| channel(0), || parallel::join(|| channel(1), || channel(2)));
    Ok([red?, green?, blue?])
}

fn wrong(name: &str, cause: &TransportError) -> MetricError {
    match cause {
        TransportError::Parameter { name: parameter, found, allowed } => MetricError::Parameter {
            what: format!("{name}: {parameter}"),
            found: found.to_string(),
            allowed: (*allowed).to_owned(),
        },
        other => MetricError::NotComputed { metric: name.to_owned(), reason: other.to_string() },
    }
}

fn accuracy(name: &str, options: &mut Options<'_>, alpha: f64, blur: f64) -> Result<Accuracy, MetricError> {
    let level = options.take("accuracy").unwrap_or("standard");
    let mut accuracy = Accuracy::named(level, alpha, blur).ok_or_else(|| MetricError::Parameter {
        what: format!("{name}: accuracy"),
        found: level.to_owned(),
        allowed: format!("one of {}", Accuracy::NAMES.join(", ")),
    })?;
    let integer = |range: std::ops::RangeInclusive<f64>| move |x: f64| x.fract() == 0.0 && range.contains(&x);
    if let Some(kappa) = options.number("kappa", integer(1.0..=256.0), "an integer from 1 to 256")? {
        accuracy.values_per_blur = kappa as usize;
    }
    if let Some(nodes) = options.number("nodes", integer(2.0..=720.0), "an integer from 2 to 720")? {
        accuracy.base_nodes = nodes as usize;
    }
    if let Some(clusters) = options.number("clusters", integer(1.0..=50_000.0), "an integer from 1 to 50000")? {
        accuracy.clusters = clusters as usize;
    }
    Ok(accuracy)
}

impl Metric for TransportMetric {
    fn name(&self) -> &str {
        &self.name
    }

    fn properties(&self) -> Properties {
        let p = &self.parameters;
        Properties {
            family: super::FAMILY,
            unit: "1",
            symmetric: true,
            usable_as_loss: true,
            differentiable: true,
            summary: format!(
                "Sinkhorn divergence between graphs, p {}, alpha {}, blur {}, scaling {}, phi {}, gamma {}",
                p.cost().power(),
                p.alpha(),
                p.blur(),
                p.scaling(),
                self.tone,
                self.gamma
            ),
            source: "Lavoué et al. 2021, section 6.1, doi:10.1111/cgf.142636; GeomLoss 0.3.1",
            ..Properties::default()
        }
    }

    fn version(&self) -> &str {
        self.parameters.cost().version()
    }

    graph::metric_methods!();
}

impl GraphMetric for TransportMetric {
    fn grid(&self) -> GraphGrid {
        self.grid.unwrap_or_default()
    }

    fn with_default_grid(&self, grid: GraphGrid) -> Arc<dyn GraphMetric> {
        Arc::new(Self { grid: self.grid.or(Some(grid)), ..self.clone() })
    }

    fn gamma(&self) -> f64 {
        self.gamma
    }

    fn prepare_table(&self, reference: Arc<CosineTable>) -> Result<Box<dyn PreparedTable>, MetricError> {
        let channels = self.prepare_channels(&reference, Side::Reference)?;
        Ok(Box::new(PreparedTransport { metric: self.clone(), table: reference, channels }))
    }
}

/// The masses of the reference.
struct PreparedTransport {
    metric: TransportMetric,
    table: Arc<CosineTable>,
    channels: [PreparedChannel; 3],
}

impl PreparedTransport {
    fn candidate(&self, candidate: &CosineTable) -> Result<[PreparedChannel; 3], MetricError> {
        self.table.common_cells(candidate, &self.metric.name)?;
        self.metric.prepare_channels(candidate, Side::Candidate)
    }
}

impl PreparedTable for PreparedTransport {
    fn channels(&self, candidate: &CosineTable) -> Result<[f64; 3], MetricError> {
        self.metric.between(&self.channels, &self.candidate(candidate)?)
    }

    fn gradients(&self, candidate: &CosineTable) -> Result<ChannelGradients, MetricError> {
        let channels = self.candidate(candidate)?;
        in_parallel(|c| {
            let (value, mut slopes) = divergence_and_gradient(&self.metric.parameters, &self.channels[c], &channels[c])
                .map_err(|cause| self.metric.failed(None, &cause))?;
            let values = candidate.channel(c);
            slopes.iter_mut().zip(values).for_each(|(slope, t)| *slope *= self.metric.tone.derivative(*t));
            Ok((value, slopes))
        })
    }
}
