//! The kernel distances as metrics.

use super::divergence::{Channels, Comparison, DIRECT, Pair, Setting};
use super::mixture::Kernel;
use super::{FAMILY, VERSION};
use crate::brdf::Brdf;
use crate::math::parallel;
use crate::metric::graph::{self, ChannelGradients, CosineTable, GraphGrid, GraphMetric, Options, PreparedTable, Tone};
use crate::metric::{Metric, MetricError, PreparedMetric, Properties, Share};
use std::sync::Arc;

/// Energy distance, Gaussian or Laplacian MMD between the graphs of two BRDFs.
#[derive(Debug, Clone, PartialEq)]
pub struct KernelMetric {
    name: String,
    setting: Setting,
    gamma: f64,
    /// `None`: [`GraphGrid::STUDY`], until told otherwise.
    grid: Option<GraphGrid>,
}

const FAMILIES: [&str; 3] = ["energy", "mmd-gaussian", "mmd-laplacian"];
/// Below, the value axis takes too many nodes; above, there is nothing left of the values.
const ALPHA: (f64, f64) = (1e-3, 100.0);
const BLUR: (f64, f64) = (1e-3, 1e3);
/// The MMD's default, the blur of the study's best transport distance.
const DEFAULT_BLUR: f64 = 0.05;

impl KernelMetric {
    /// The metrics of the registry: the study's best energy distance (phi t^(1/3), alpha 0.1, gamma 0.25), and both MMD with
    /// the same parameters and blur 0.05.
    pub fn presets() -> [Self; 3] {
        let kernels =
            [Kernel::Energy, Kernel::Gaussian { blur: DEFAULT_BLUR }, Kernel::Laplacian { blur: DEFAULT_BLUR }];
        [0, 1, 2].map(|k| Self {
            name: FAMILIES[k].to_owned(),
            setting: Setting { kernel: kernels[k], alpha: 0.1, tone: Tone::Cbrt },
            gamma: 0.25,
            grid: None,
        })
    }

    /// The member of a family that `name` describes, such as `energy[phi=log:eta=0.01,alpha=0.05]`; what is not given is as in
    /// the preset.
    ///
    /// # Errors
    /// [`MetricError::Unknown`] for another family, [`MetricError::Parameter`] for an unknown option or a value out of range.
    pub fn named(name: &str) -> Result<Self, MetricError> {
        let (family, mut options) = Options::split(name)?;
        let preset = Self::presets().into_iter().find(|preset| preset.name == family);
        let mut metric = preset.ok_or_else(|| MetricError::Unknown {
            name: name.to_owned(),
            nearest: FAMILIES.map(str::to_owned).into(),
        })?;
        let within = |key: &str, (low, high): (f64, f64), options: &mut Options<'_>| {
            options.number(key, |x| (low..=high).contains(&x), &format!("{low} to {high}"))
        };
        metric.name = name.to_owned();
        if let Some(alpha) = within("alpha", ALPHA, &mut options)? {
            metric.setting.alpha = alpha;
        }
        if let Some(tone) = options.tone()? {
            metric.setting.tone = tone;
        }
        if let Some(gamma) = options.gamma()? {
            metric.gamma = gamma;
        }
        metric.grid = options.grid()?;
        let mut known = vec!["phi", "eta", "alpha", "gamma", "grid"];
        if let Kernel::Gaussian { blur } | Kernel::Laplacian { blur } = &mut metric.setting.kernel {
            known.push("blur");
            if let Some(given) = within("blur", BLUR, &mut options)? {
                *blur = given;
            }
        }
        options.finish(&known)?;
        Ok(metric)
    }

    /// The channels of a table, ready for this metric and those that differ from it in gamma alone.
    ///
    /// # Errors
    /// A table without a valid cell.
    pub fn prepare_channels(&self, table: Arc<CosineTable>) -> Result<PreparedChannels, MetricError> {
        let channels = self.channels_of(&table)?;
        Ok(PreparedChannels { table, channels })
    }

    fn channels_of(&self, table: &CosineTable) -> Result<Channels, MetricError> {
        let own = table.common_cells(table, &self.name)?;
        let planes = [0, 1, 2].map(|c| table.channel(c));
        let direct = own.count() <= DIRECT;
        Ok(Channels::new(self.setting, &planes, table.grid(), own, direct))
    }

    /// The divergence of each channel (R, G, B).
    ///
    /// # Errors
    /// No cell in common; tables on different grids.
    pub fn between(&self, reference: &PreparedChannels, candidate: &PreparedChannels) -> Result<[f64; 3], MetricError> {
        self.pairs(reference.borrowed(), candidate.borrowed(), |_, pair| pair.divergence())
    }

    fn pairs<T: Send>(
        &self,
        reference: (&CosineTable, &Channels),
        candidate: (&CosineTable, &Channels),
        of: impl Fn(usize, &Pair<'_>) -> T + Sync,
    ) -> Result<[T; 3], MetricError> {
        let common = reference.0.common_cells(candidate.0, &self.name)?;
        let direct = common.count() <= DIRECT;
        let comparison = Comparison::new(reference.1, candidate.1, &common, direct);
        let channel = |c: usize| of(c, &comparison.pair(c));
        let (red, (green, blue)) = parallel::join(|| channel(0), || parallel::join(|| channel(1), || channel(2)));
        Ok([red, green, blue])
    }
}

impl Metric for KernelMetric {
    fn name(&self) -> &str {
        &self.name
    }

    fn properties(&self) -> Properties {
        let Setting { kernel, alpha, tone } = self.setting;
        let family = match kernel {
            Kernel::Energy => "energy distance between graphs".to_owned(),
            Kernel::Gaussian { blur } => format!("Gaussian MMD between graphs, blur {blur}"),
            Kernel::Laplacian { blur } => format!("Laplacian MMD between graphs, blur {blur}"),
        };
        Properties {
            family: FAMILY,
            unit: "1",
            symmetric: true,
            usable_as_loss: true,
            differentiable: true,
            summary: format!("{family}, phi {tone}, alpha {alpha}, gamma {}", self.gamma),
            source: "Lavoué et al. 2021, section 6.1, doi:10.1111/cgf.142636; Feydy et al. 2019, arXiv:1810.08278",
            ..Properties::default()
        }
    }

    fn version(&self) -> &str {
        VERSION
    }

    graph::metric_methods!();
}

impl GraphMetric for KernelMetric {
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
        let reference = self.prepare_channels(reference)?;
        Ok(Box::new(PreparedKernel { metric: self.clone(), reference }))
    }
}

/// The three channels of one side.
#[derive(Debug, Clone)]
pub struct PreparedChannels {
    table: Arc<CosineTable>,
    channels: Channels,
}

impl PreparedChannels {
    fn borrowed(&self) -> (&CosineTable, &Channels) {
        (&self.table, &self.channels)
    }
}

struct PreparedKernel {
    metric: KernelMetric,
    reference: PreparedChannels,
}

impl PreparedTable for PreparedKernel {
    fn channels(&self, candidate: &CosineTable) -> Result<[f64; 3], MetricError> {
        let channels = self.metric.channels_of(candidate)?;
        self.metric.pairs(self.reference.borrowed(), (candidate, &channels), |_, pair| pair.divergence())
    }

    fn gradients(&self, candidate: &CosineTable) -> Result<ChannelGradients, MetricError> {
        let channels = self.metric.channels_of(candidate)?;
        let of = |c: usize, pair: &Pair<'_>| (pair.divergence(), pair.gradient(candidate.channel(c)));
        self.metric.pairs(self.reference.borrowed(), (candidate, &channels), of)
    }
}
