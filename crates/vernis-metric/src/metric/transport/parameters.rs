//! What a Sinkhorn divergence depends on, checked once, and the way in which it is computed.

use super::{DISTANCE_VERSION, TransportError, VERSION};
use crate::metric::graph::GraphGrid;

/// What it costs to move a unit of mass from x to y, points of the graph (4-D).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum GroundCost {
    /// p = 2: |x - y|^2 / 2; epsilon is blur^2.
    SquaredDistance,
    /// p = 1: |x - y|; epsilon is blur.
    Distance,
}

impl GroundCost {
    /// p, the power of the distance.
    pub fn power(self) -> f64 {
        match self {
            Self::SquaredDistance => 2.0,
            Self::Distance => 1.0,
        }
    }

    /// The version of the divergences under this cost.
    pub fn version(self) -> &'static str {
        match self {
            Self::SquaredDistance => VERSION,
            Self::Distance => DISTANCE_VERSION,
        }
    }
}

/// Alpha in blurs beyond which it takes more clusters.
const LONG_BASE: f64 = 4.0;

/// How finely the graphs are resolved.
///
/// Errors against the exact divergence are below 1 % (and below 0.1 % at [`Accuracy::high`]) where the spacing of the
/// base nodes is at most about 0.6 blur and that of the value nodes at most blur/4; [`Accuracy::standard`] follows
/// from that. An axis with few cells (at most 4/3 of the nodes) keeps them, and is exact; grids of
/// at most 200 kappa cells are summed directly, and are exact.
///
/// Where cells are clustered instead (p = 1, and alpha beyond 20 blurs), errors grow with the number of cells. For p = 1, alpha
/// 0.1 and blur 0.05, on 20 rated pairs of the open study (`experiments/transport/settling.py`): root of the mean square, and the
/// largest, in per cent of the distance W^(1/4); those of the divergence W are four times as large.
///
/// | cells | [`Accuracy::coarse`] | [`Accuracy::fast`] | [`Accuracy::standard`] |
/// | --- | --- | --- | --- |
/// | 13,500, against sums over all | 0.85 (1.33) | 0.49 (0.91) | 0.04 (0.17) |
/// | 364,500, against what 24,000 clusters settle to | 1.37 (3.63) | 0.94 (2.11) | 0.13 (0.36) |
///
/// Nothing exact can be had of 364,500 cells. With alpha 1 and blur 0.1, on four pairs of 13,500 cells, 6,000 clusters settle within
/// 0.2 % of the distance; for p = 2 and alpha beyond 20 blurs they are off by up to 3 % of the divergence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Accuracy {
    /// kappa: value nodes to one blur.
    pub values_per_blur: usize,
    /// Nodes along each of the three base axes.
    pub base_nodes: usize,
    /// Clusters of each graph, at most, where cells are clustered instead. As many cells (for p = 2, up to 4/3 as many) are not clustered,
    /// and sums over them are exact.
    pub clusters: usize,
}

impl Accuracy {
    /// The default: kappa 8 and 4 base nodes an axis at alpha 0.1, blur 0.05. Bases of more than 1,000 nodes take kappa 6,
    /// for the sake of memory.
    pub fn standard(alpha: f64, blur: f64) -> Self {
        let base_nodes = Self::nodes(alpha, blur, 1.5);
        Self {
            values_per_blur: if base_nodes > 10 { 6 } else { 8 },
            base_nodes,
            clusters: Self::clusters(alpha, blur, 5000, 6000),
        }
    }

    /// Half the value nodes of [`Accuracy::standard`] (kappa 4): errors up to 4 %, at less than half the time.
    pub fn fast(alpha: f64, blur: f64) -> Self {
        Self { values_per_blur: 4, clusters: Self::clusters(alpha, blur, 1000, 2000), ..Self::standard(alpha, blur) }
    }

    /// kappa 3 and one base node to a blur: errors up to 2 %, at a fifth of the time or less, for sweeps over many parameters.
    pub fn coarse(alpha: f64, blur: f64) -> Self {
        Self {
            values_per_blur: 3,
            base_nodes: Self::nodes(alpha, blur, 1.0),
            clusters: Self::clusters(alpha, blur, 500, 1000),
        }
    }

    /// The names that [`Accuracy::named`] knows, from the least accurate.
    pub const NAMES: [&str; 4] = ["coarse", "fast", "standard", "high"];

    /// The accuracy of a name, such as `fast` for [`Accuracy::fast`].
    pub fn named(name: &str, alpha: f64, blur: f64) -> Option<Self> {
        let known: [fn(f64, f64) -> Self; 4] = [Self::coarse, Self::fast, Self::standard, Self::high];
        let place = Self::NAMES.iter().position(|other| *other == name)?;
        Some(known[place](alpha, blur))
    }

    /// kappa 16 and 2.5 instead of 1.5 base nodes to a blur: the reference for checks.
    pub fn high(alpha: f64, blur: f64) -> Self {
        Self {
            values_per_blur: 16,
            base_nodes: Self::nodes(alpha, blur, 2.5),
            clusters: Self::clusters(alpha, blur, 12_000, 16_000),
        }
    }

    /// More where the base is long, measured in blurs.
    fn clusters(alpha: f64, blur: f64, on_short: usize, on_long: usize) -> usize {
        if alpha > LONG_BASE * blur { on_long } else { on_short }
    }

    /// Nodes an axis that put `per_blur` of them to one blur; the axis is a little shorter than alpha.
    fn nodes(alpha: f64, blur: f64, per_blur: f64) -> usize {
        // The cast saturates: absurd ratios end at the number of cells, and with the direct method.
        (per_blur * alpha / blur * (1.0 - 1e-9)).ceil() as usize + 1
    }
}

/// Every parameter of the divergence, within its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SinkhornParameters {
    cost: GroundCost,
    alpha: f64,
    blur: f64,
    scaling: f64,
    accuracy: Accuracy,
}

impl SinkhornParameters {
    /// Parameters at the standard accuracy: `alpha` is the length of the base axes (the paper's alpha), `blur` the
    /// length scale below which transport is smoothed (the paper's epsilon), `scaling` the factor from one blur of the
    /// annealing to the next (the paper's s).
    ///
    /// # Errors
    /// [`TransportError::Parameter`] unless alpha and blur are positive and finite and 0 < scaling < 1.
    pub fn new(cost: GroundCost, alpha: f64, blur: f64, scaling: f64) -> Result<Self, TransportError> {
        let positive = |name, found: f64| {
            let allowed = "a number between 1e-6 and 1e6";
            if (1e-6..=1e6).contains(&found) { Ok(()) } else { Err(TransportError::Parameter { name, found, allowed }) }
        };
        positive("alpha", alpha)?;
        positive("blur", blur)?;
        if !(scaling > 0.0 && scaling < 1.0) {
            let allowed = "a number greater than 0 and less than 1";
            return Err(TransportError::Parameter { name: "scaling", found: scaling, allowed });
        }
        Ok(Self { cost, alpha, blur, scaling, accuracy: Accuracy::standard(alpha, blur) })
    }

    /// The same parameters at another accuracy.
    ///
    /// # Errors
    /// [`TransportError::Parameter`] for no value node to a blur, or fewer than two base nodes.
    pub fn with_accuracy(self, accuracy: Accuracy) -> Result<Self, TransportError> {
        let check = |name, found: usize, range: std::ops::RangeInclusive<usize>, allowed| {
            let found_number = found as f64;
            let error = TransportError::Parameter { name, found: found_number, allowed };
            if range.contains(&found) { Ok(()) } else { Err(error) }
        };
        check("values per blur (kappa)", accuracy.values_per_blur, 1..=256, "an integer between 1 and 256")?;
        check("base nodes", accuracy.base_nodes, 2..=usize::MAX, "an integer of at least 2")?;
        check("clusters", accuracy.clusters, 1..=Method::MOST_CLUSTERS, "an integer between 1 and 50000")?;
        Ok(Self { accuracy, ..self })
    }

    /// What it costs to move a unit of mass.
    pub fn cost(&self) -> GroundCost {
        self.cost
    }

    /// Length of the base axes; the graph's base is a box of this edge.
    pub fn alpha(&self) -> f64 {
        self.alpha
    }

    /// Length scale below which transport is smoothed, in units of the graph.
    pub fn blur(&self) -> f64 {
        self.blur
    }

    /// Factor from one blur of the annealing to the next, between 0 and 1.
    pub fn scaling(&self) -> f64 {
        self.scaling
    }

    /// How finely the graphs are resolved.
    pub fn accuracy(&self) -> Accuracy {
        self.accuracy
    }

    /// How the divergence of tables on `grid` is computed.
    ///
    /// # Errors
    /// [`TransportError::TooManyCells`] for squared distances of which cells can be told apart, but no clusters of them.
    pub fn method(&self, grid: GraphGrid) -> Result<Method, TransportError> {
        // Little fewer nodes than cells would be further from some cells than from others, and would save nothing.
        let few = |cells: usize, allowed: usize| cells <= allowed.saturating_mul(4) / 3;
        let Accuracy { values_per_blur, base_nodes, clusters } = self.accuracy;
        let nodes = grid.shape().map(|cells| if few(cells, base_nodes) { cells } else { base_nodes });
        let is_squared = self.cost == GroundCost::SquaredDistance;
        let separable = is_squared
            && self.alpha <= Method::LARGEST_ALPHA_PER_BLUR * self.blur
            && nodes.iter().product::<usize>() <= Method::MOST_BASE_NODES;
        let allowed = if is_squared { clusters.saturating_mul(4) / 3 } else { clusters };
        if separable && grid.len() > Method::FEW_CELLS * values_per_blur {
            Ok(Method::Quantised { spacing: self.blur / values_per_blur as f64, nodes })
        } else if separable || grid.len() <= allowed {
            Ok(Method::Direct)
        } else if is_squared && self.alpha > Method::LARGEST_CLUSTERED_ALPHA_PER_BLUR * self.blur {
            let (alpha, blur) = (self.alpha, self.blur);
            Err(TransportError::TooManyCells { alpha, blur, cells: grid.len(), allowed })
        } else {
            Ok(Method::Clustered { clusters })
        }
    }
}

/// The way in which a divergence is computed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Method {
    /// Masses on a product of base nodes and value nodes (multiples of `spacing`), and separable sums over it.
    Quantised {
        /// Distance between value nodes, in units of the graph.
        spacing: f64,
        /// Base nodes along theta_i, theta_o and phi_d.
        nodes: [usize; 3],
    },
    /// Sums over all pairs of clusters of cells.
    Clustered {
        /// At most so many on each side.
        clusters: usize,
    },
    /// Sums over all pairs of cells.
    Direct,
}

impl Method {
    /// Up to this number of cells times kappa (6 x 6 x 24 at kappa 8, 9 x 9 x 36 at kappa 16) sums over all pairs, which are
    /// exact, take about as long as quantised ones.
    pub const FEW_CELLS: usize = 200;
    /// Beyond it, exp(-cost/epsilon) across the base, up to 3 (alpha/blur)^2/2 = 600 in the exponent, underflows.
    pub const LARGEST_ALPHA_PER_BLUR: f64 = 20.0;
    /// Base nodes of the quantised method, 17^3: the potentials take this times the value nodes times 8 bytes.
    pub const MOST_BASE_NODES: usize = 4_913;
    /// Beyond it, clusters of cells are further from each other than squared distances reach: errors pass a tenth.
    pub const LARGEST_CLUSTERED_ALPHA_PER_BLUR: f64 = 50.0;
    /// As many clusters as may be asked for: their sums take minutes.
    pub const MOST_CLUSTERS: usize = 50_000;
}
