//! The transportation-L^p distance between BRDFs: the debiased Sinkhorn divergence between their graphs, one colour
//! channel at a time.
//!
//! The graph of a channel on N cells is the measure (1/N) sum_i delta_{X_i} with
//!
//!   X = (alpha theta_i/(pi/2), alpha theta_o/(pi/2), alpha phi_d/(2 pi), phi(max(f cos theta_i, 0)))
//!
//! and the divergence of measures a and b, with the cost C of [`GroundCost`], is
//!
//!   OT_epsilon(a, b) - (OT_epsilon(a, a) + OT_epsilon(b, b))/2 = <a, f_ba - f_aa> + <b, g_ab - g_bb>,
//!
//! where the potentials come from the annealed, averaged Sinkhorn iterations of GeomLoss (`annealing.rs`):
//!
//!   f_ba(x) <- keep f_ba(x) - (1 - keep) epsilon ln sum_y b(y) exp((g_ab(y) - C(x, y))/epsilon), and so on.
//!
//! Source: G. Lavoué, N. Bonneel, J.-P. Farrugia, C. Soler, "Perceptual quality of BRDF approximations: dataset and
//! metrics", Computer Graphics Forum 40(2), 2021, doi:10.1111/cgf.142636, section 6.1 (the graph: M. Thorpe et al.,
//! doi:10.1007/s10851-017-0726-4); J. Feydy et al., "Interpolating between optimal transport and MMD using Sinkhorn
//! divergences", AISTATS 2019, and GeomLoss 0.3.1, whose `tensorized` values these are. The study used GeomLoss's
//! multiscale variant, which clusters at random: its last digits belong to a seed.
//!
//! The cost p = 2 is separable, and alpha is about two blurs: a few base nodes and a fine value axis carry the masses
//! (`quantised/measure.rs`), fewer of them while epsilon is large (`quantised/levels.rs`), and sums over all pairs become small products
//! (`quantised/gaussian.rs`). Where that does not hold (p = 1, alpha beyond 20 blurs, more than 4,913 base nodes), cells whose values are
//! nearly equal become a few thousand clusters, and all pairs of these are summed (`clusters/mod.rs`). On small grids every cell is a
//! cluster, whatever the parameters, and the sums are exact.
//!
//! Cells that are invalid on either side are left out on both.

mod annealing;
mod clusters;
mod elementary;
mod metric;
mod parameters;
mod quantised;

pub use metric::TransportMetric;
pub use parameters::{Accuracy, GroundCost, Method, SinkhornParameters};

use crate::math::parallel;
use crate::metric::graph::GraphGrid;
use annealing::Annealing;
use clusters::Graphs;
use elementary::{max, min, range_of};
use quantised::{Lattice, Levels};
use std::borrow::Cow;
use thiserror::Error;

/// Of the numbers for p = 2: it changes when a distance changes by more than rounding, and the golden values in the tests with it.
/// 2 to 4: annealing on coarser nodes while epsilon is large, sums over nodes with mass alone, slow annealings faster. The
/// changelog says by how much each moved values.
pub const VERSION: &str = "4";
/// Of the numbers for p = 1. 5: clusters of cells on grids of more than 4,000 cells. 6: of 2,500 clusters or more, what they settle to.
/// 7: more clusters, 5,000 by default, and fewer of them while epsilon is large. 6 and 7 leave the accuracies `fast` and `coarse` as they were,
/// but for grids of 1,001 to 1,333 and of 501 to 666 cells.
pub const DISTANCE_VERSION: &str = "7";

/// Family of these metrics.
pub const FAMILY: &str = "transport";

/// Why there is no divergence.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum TransportError {
    #[error("{name} is {found}; it must be {allowed}")]
    Parameter { name: &'static str, found: f64, allowed: &'static str },
    #[error(
        "alpha is {alpha} and blur {blur}: squared distances are then summed over all pairs of cells, and the grid has {cells} cells; it must \
         have at most {allowed} cells, or alpha must be at most 50 blurs"
    )]
    TooManyCells { alpha: f64, blur: f64, cells: usize, allowed: usize },
    #[error(
        "the annealing takes {found} steps; it must take at most {allowed}: choose a smaller scaling or a larger blur"
    )]
    TooManySteps { found: f64, allowed: usize },
    #[error("the graph takes {found} nodes; it must take at most {allowed}: compress the values more, or blur more")]
    TooManyNodes { found: usize, allowed: usize },
    #[error("the value of cell {cell} is {found}; at this blur it must be at most {allowed}")]
    ValueTooLarge { cell: usize, found: f64, allowed: f64 },
    #[error("the value of valid cell {cell} is {found}; it must be a finite number")]
    NotFinite { cell: usize, found: f64 },
    #[error("the {what} given cover {found} cells; they must cover the {expected} cells of the grid")]
    Length { what: &'static str, found: usize, expected: usize },
    #[error("the channel has no valid cell")]
    NoValidCell,
    #[error("the two channels have no valid cell in common")]
    NoCommonCell,
    #[error("the two channels were not prepared for the same grid and for these parameters")]
    Mismatch,
}

/// One channel of a BRDF, ready to be compared with many others.
///
/// What is prepared depends on the grid, the values and the method ([`SinkhornParameters::method`]), not on the scaling,
/// and not on the other side, so that metrics can share it.
#[derive(Debug, Clone)]
pub struct PreparedChannel {
    grid: GraphGrid,
    values: Vec<f64>,
    /// `None`: all cells.
    valid: Option<Vec<bool>>,
    method: Method,
    form: Form,
    extents: Extents,
}

/// The channel as its method needs it.
#[derive(Debug, Clone)]
enum Form {
    Quantised(Levels),
    /// Clusters depend on both sides.
    Clusters,
}

impl PreparedChannel {
    /// `values`: phi(max(f cos theta_i, 0)) of the cells of `grid`, row-major in (theta_i, theta_o, phi_d); `valid`: which
    /// of them are measured, all where it is `None`. Invalid cells may hold anything.
    ///
    /// # Errors
    /// [`TransportError::Length`], [`TransportError::NoValidCell`], [`TransportError::NotFinite`]; those of
    /// [`SinkhornParameters::method`]; [`TransportError::ValueTooLarge`] and [`TransportError::TooManyNodes`] where the
    /// values spread over too many blurs.
    pub fn new(
        parameters: &SinkhornParameters,
        grid: GraphGrid,
        values: &[f64],
        valid: Option<&[bool]>,
    ) -> Result<Self, TransportError> {
        Self::of(parameters, grid, values.to_vec(), valid)
    }

    /// [`PreparedChannel::new`] of values that need no copy.
    fn of(
        parameters: &SinkhornParameters,
        grid: GraphGrid,
        values: Vec<f64>,
        valid: Option<&[bool]>,
    ) -> Result<Self, TransportError> {
        let expected = grid.len();
        for (what, found) in [("values", values.len()), ("mask", valid.map_or(expected, <[bool]>::len))] {
            if found != expected {
                return Err(TransportError::Length { what, found, expected });
            }
        }
        // Passes over the cells need not look at a mask that leaves none out.
        let valid = valid.filter(|valid| valid.contains(&false));
        let is_valid = |cell: usize| valid.is_none_or(|valid| valid[cell]);
        if !(0..expected).any(is_valid) {
            return Err(TransportError::NoValidCell);
        }
        if let Some(cell) = (0..expected).find(|&cell| is_valid(cell) && !values[cell].is_finite()) {
            return Err(TransportError::NotFinite { cell, found: values[cell] });
        }
        let method = parameters.method(grid)?;
        let form = Form::new(method, grid, &values, valid)?;
        let extents = Extents::new(grid, &values, valid);
        Ok(Self { grid, values, valid: valid.map(<[bool]>::to_vec), method, form, extents })
    }

    fn is_valid(&self, cell: usize) -> bool {
        self.valid.as_ref().is_none_or(|valid| valid[cell])
    }

    /// The channel without the cells that `other` lacks.
    fn restricted(&self, other: &Self) -> Result<Self, TransportError> {
        let valid: Vec<bool> = (0..self.values.len()).map(|k| self.is_valid(k) && other.is_valid(k)).collect();
        if !valid.contains(&true) {
            return Err(TransportError::NoCommonCell);
        }
        let form = Form::new(self.method, self.grid, &self.values, Some(&valid))?;
        let extents = Extents::new(self.grid, &self.values, Some(&valid));
        Ok(Self { form, extents, valid: Some(valid), values: self.values.clone(), ..*self })
    }
}

impl Form {
    fn new(method: Method, grid: GraphGrid, values: &[f64], valid: Option<&[bool]>) -> Result<Self, TransportError> {
        Ok(match method {
            Method::Quantised { spacing, nodes } => {
                Self::Quantised(Levels::new(Lattice::new(grid, nodes, spacing), values, valid)?)
            }
            Method::Clustered { .. } | Method::Direct => Self::Clusters,
        })
    }
}

/// Smallest and largest coordinates of the points: of the base for alpha = 1, and of the values.
#[derive(Debug, Clone, Copy)]
struct Extents {
    base: [(f64, f64); 3],
    values: (f64, f64),
}

impl Extents {
    fn new(grid: GraphGrid, values: &[f64], valid: Option<&[bool]>) -> Self {
        let [n_i, n_o, n_phi] = grid.shape();
        let union = |a: (f64, f64), b: (f64, f64)| (min(a.0, b.0), max(a.1, b.1));
        let ends_of = |axis: usize, ends: (usize, usize)| (grid.position(axis, ends.0), grid.position(axis, ends.1));
        let values = range_of(values, valid);
        let Some(valid) = valid else {
            let base = [n_i, n_o, n_phi].map(|n| (0, n - 1));
            return Self { base: [0, 1, 2].map(|axis| ends_of(axis, base[axis])), values };
        };
        let mut base = [NOTHING; 3];
        for (row, valid) in valid.chunks_exact(n_phi).enumerate() {
            let mut range = (0..n_phi).filter(|&k| valid[k]);
            let Some(lowest) = range.next() else { continue };
            let highest = range.next_back().unwrap_or(lowest);
            let ends = [(row / n_o, row / n_o), (row % n_o, row % n_o), (lowest, highest)];
            for (axis, (base, ends)) in base.iter_mut().zip(ends).enumerate() {
                *base = union(*base, ends_of(axis, ends));
            }
        }
        Self { base, values }
    }

    /// The lengths of the joint diagonal's change with the largest and with the smallest value of `candidate`: 0 where the
    /// reference's is as far out.
    fn diameter_slopes(&self, candidate: &Self, diameter: f64) -> [f64; 2] {
        let (low, high) = (min(self.values.0, candidate.values.0), max(self.values.1, candidate.values.1));
        let slope = (high - low) / diameter;
        let outermost = [candidate.values.1 > self.values.1, candidate.values.0 < self.values.0];
        [if outermost[0] { slope } else { 0.0 }, if outermost[1] { -slope } else { 0.0 }]
    }

    /// Diagonal of the bounding box of both graphs.
    fn joint_diameter(&self, other: &Self, alpha: f64) -> f64 {
        let length = |a: (f64, f64), b: (f64, f64)| a.1.max(b.1) - a.0.min(b.0);
        let base = self.base.iter().zip(other.base).map(|(&a, b)| (alpha * length(a, b)).powi(2));
        (base.sum::<f64>() + length(self.values, other.values).powi(2)).sqrt()
    }
}

/// The extent of no point.
const NOTHING: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

/// Two channels with the same valid cells, and the epsilons between them.
struct Comparison<'a> {
    reference: Cow<'a, PreparedChannel>,
    candidate: Cow<'a, PreparedChannel>,
    /// The diameter of both and its schedule; `None` where all points of both sides coincide.
    annealing: Option<(f64, Annealing)>,
}

impl<'a> Comparison<'a> {
    fn new(
        parameters: &SinkhornParameters,
        reference: &'a PreparedChannel,
        candidate: &'a PreparedChannel,
    ) -> Result<Self, TransportError> {
        let method = parameters.method(reference.grid)?;
        if candidate.grid != reference.grid || candidate.method != method || reference.method != method {
            return Err(TransportError::Mismatch);
        }
        let (reference, candidate) = if reference.valid == candidate.valid {
            (Cow::Borrowed(reference), Cow::Borrowed(candidate))
        } else {
            (Cow::Owned(reference.restricted(candidate)?), Cow::Owned(candidate.restricted(reference)?))
        };
        let diameter = reference.extents.joint_diameter(&candidate.extents, parameters.alpha());
        // One that is no number is refused by the annealing.
        let annealing = if diameter == 0.0 { None } else { Some((diameter, Annealing::new(parameters, diameter)?)) };
        Ok(Self { reference, candidate, annealing })
    }
}

/// The debiased Sinkhorn divergence of two channels: 0 where they are equal, symmetric, and, but for rounding and the
/// incomplete annealing, not negative (the metrics take max(W, 0)).
///
/// # Errors
/// [`TransportError::Mismatch`] for channels on different grids or prepared for another method,
/// [`TransportError::NoCommonCell`], [`TransportError::TooManySteps`].
pub fn divergence(
    parameters: &SinkhornParameters,
    reference: &PreparedChannel,
    candidate: &PreparedChannel,
) -> Result<f64, TransportError> {
    let pair = Comparison::new(parameters, reference, candidate)?;
    match &pair.annealing {
        Some((_, annealing)) => pair.divergence(parameters, annealing),
        None => Ok(0.0),
    }
}

/// The divergence and its derivative with respect to the values phi(max(f cos theta_i, 0)) of the candidate's cells, 0 at
/// cells that do not take part: the gradient of the very number that is returned, and that [`divergence`] returns.
///
/// Every update of the potentials is differentiated, for they have not converged when the annealing ends, and so are the
/// epsilons, which follow the diameter of both graphs and with it the candidate's largest and smallest value. Cells that share the
/// largest value share its derivative. Where the value itself jumps or has a kink, the derivative is that of one side: where the
/// schedule gains a step, where a cell passes a value node of a quantised graph, and where cells cluster otherwise.
///
/// # Errors
/// Those of [`divergence`].
pub fn divergence_and_gradient(
    parameters: &SinkhornParameters,
    reference: &PreparedChannel,
    candidate: &PreparedChannel,
) -> Result<(f64, Vec<f64>), TransportError> {
    let pair = Comparison::new(parameters, reference, candidate)?;
    let Some((diameter, annealing)) = &pair.annealing else { return Ok((0.0, vec![0.0; pair.candidate.values.len()])) };
    let slopes = pair.reference.extents.diameter_slopes(&pair.candidate.extents, *diameter);
    let stretched = || match slopes == [0.0; 2] {
        true => Ok(None),
        false => {
            pair.divergence(parameters, &annealing.stretched((1.0 + STRETCH).powf(parameters.cost().power()))).map(Some)
        }
    };
    let (found, stretched) = parallel::join(|| pair.divergence_and_gradient(parameters, annealing), stretched);
    let (value, mut gradient) = found?;
    if let Some(stretched) = stretched? {
        let of_diameter = (stretched - value) / (STRETCH * diameter);
        let (low, high) = pair.candidate.extents.values;
        pair.share_out(high, of_diameter * slopes[0], &mut gradient);
        pair.share_out(low, of_diameter * slopes[1], &mut gradient);
    }
    Ok((value, gradient))
}

/// The relative change of the diameter from which the derivative with respect to it is taken. Its error is about as large, and only the
/// part of the gradient that goes by way of the epsilons has it.
const STRETCH: f64 = 1e-4;
/// Values that differ by less than this share of their range are one extreme: mirror images of a cell differ in the last digit.
const SAME: f64 = 1e-9;

impl Comparison<'_> {
    fn graphs(&self, parameters: &SinkhornParameters) -> Graphs<'_> {
        let PreparedChannel { grid, values, valid, .. } = &*self.reference;
        let b = &self.candidate.values;
        Graphs { grid: *grid, a: values, b, valid: valid.as_deref(), alpha: parameters.alpha() }
    }

    /// How many clusters there are at most.
    fn clusters(&self) -> usize {
        match self.reference.method {
            Method::Clustered { clusters } => clusters,
            _ => self.reference.grid.len(),
        }
    }

    fn divergence(&self, parameters: &SinkhornParameters, annealing: &Annealing) -> Result<f64, TransportError> {
        match (&self.reference.form, &self.candidate.form) {
            (Form::Quantised(a), Form::Quantised(b)) => Ok(quantised::divergence(parameters.alpha(), annealing, a, b)),
            (Form::Clusters, Form::Clusters) => {
                Ok(clusters::divergence(parameters, annealing, &self.graphs(parameters), self.clusters()))
            }
            _ => Err(TransportError::Mismatch),
        }
    }

    /// With the epsilons held.
    fn divergence_and_gradient(
        &self,
        parameters: &SinkhornParameters,
        annealing: &Annealing,
    ) -> Result<(f64, Vec<f64>), TransportError> {
        let values = &self.candidate.values;
        let valid = |cell| self.candidate.is_valid(cell);
        match (&self.reference.form, &self.candidate.form) {
            (Form::Quantised(a), Form::Quantised(b)) => {
                Ok(quantised::divergence_and_gradient(parameters.alpha(), annealing, a, b, values, valid))
            }
            (Form::Clusters, Form::Clusters) => {
                let graphs = self.graphs(parameters);
                Ok(clusters::divergence_and_gradient(parameters, annealing, &graphs, self.clusters()))
            }
            _ => Err(TransportError::Mismatch),
        }
    }

    /// Adds `derivative` to the cells of the candidate that have the value `extreme`, in equal parts.
    fn share_out(&self, extreme: f64, derivative: f64, gradient: &mut [f64]) {
        let (low, high) = self.candidate.extents.values;
        let has = |&cell: &usize| {
            self.candidate.is_valid(cell) && (self.candidate.values[cell] - extreme).abs() <= SAME * (high - low)
        };
        let cells: Vec<usize> = (0..gradient.len()).filter(has).collect();
        cells.iter().for_each(|&cell| gradient[cell] += derivative / cells.len() as f64);
    }
}
