//! What all sides that one metric compares have in common: nodes, and the Gaussians between them.

use super::axis::BaseAxis;
use super::mixture::{Kernel, Mixture, Term};
use super::value_axis::ValueAxis;
use crate::math::eigen;
use crate::metric::graph::GraphGrid;
use ndarray::{Array2, ArrayView2};
use std::f64::consts::FRAC_PI_2;

/// A Gaussian is not narrowed below this times 1/s, half of its variance.
const LEAST: f64 = 0.25;
/// Nodes of a base axis where a kernel's width does not ask for more.
const NODES: usize = 11;
/// Nodes of a base axis to a blur.
const PER_BLUR: f64 = 2.0;
/// Nodes of a base axis at most.
const MOST_NODES: usize = 24;
/// Nodes of the azimuth at most: it gets what the polar axes have no cells for.
const MOST_AZIMUTHS: usize = 40;
/// Value nodes lie alpha/FINENESS, blur/BLURRED or COARSEST apart, whichever is least.
const FINENESS: f64 = 16.0;
/// See [`FINENESS`].
const BLURRED: f64 = 6.0;
/// See [`FINENESS`]: directions alone do not tell how fine the values are.
const COARSEST: f64 = 0.0125;
/// Standard deviation of the narrowest Gaussian in distances of base nodes; [`NARROWEST_IN_VALUE`] where that is wider.
const NARROWEST: f64 = 0.65;
/// The same in distances of value nodes.
const NARROWEST_IN_VALUE: f64 = 1.25;
/// The distance of the places at which a Gaussian's factor is kept along the value axis, in its standard deviation, at most: the
/// trapezium rule then errs by 2 exp(-2 pi^2 (1/2)^2/0.8^2) = 9e-4 of single pairs, of either sign.
const SAMPLED: f64 = 0.8;
/// Eigenvalues below this fraction of the largest are dropped.
const SMALLEST: f64 = 1e-9;

/// The variance of a Gaussian along one base axis.
struct Narrowed {
    on_lattice: f64,
    /// With what the hats of two points add to it.
    between_points: f64,
}

/// From the coordinates of one Gaussian along a base axis to those of the next, wider one: the eigenvectors of its matrix.
#[derive(Debug, Clone)]
pub(super) struct Projection {
    /// to x from.
    pub down: Vec<f64>,
    /// from x to.
    pub up: Vec<f64>,
    pub from: usize,
    pub to: usize,
    /// Square roots of the eigenvalues.
    pub roots: Vec<f64>,
}

/// One Gaussian of the kernel.
#[derive(Debug, Clone)]
pub(super) struct Step {
    /// Of the square of the coordinates' differences.
    pub weight: f64,
    pub sigma: f64,
    pub base: [Projection; 3],
    /// Where the Gaussian's factor is kept.
    pub outputs: ValueAxis,
}

impl Step {
    /// What a Gaussian's factor at a place takes beside exp(-(u - w)^2/sigma^2): the trapezium rule of
    /// integral exp(-(u - x)^2/sigma^2 - (u - y)^2/sigma^2) du = sigma sqrt(pi/2) exp(-(x - y)^2/(2 sigma^2)); 1 where places are too far
    /// apart for that.
    pub fn norm(&self, output: i64) -> f64 {
        let distance = 0.5 * (self.outputs.node(output + 1) - self.outputs.node(output - 1));
        (distance / (self.sigma * FRAC_PI_2.sqrt())).sqrt().min(1.0)
    }
}

/// Nodes and Gaussians.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    kernel: Kernel,
    pub base: [BaseAxis; 3],
    pub values: ValueAxis,
    narrowest: f64,
    pub steps: Vec<Step>,
    /// Coordinates of the last Gaussian, along each base axis: nodes x coordinates.
    reached: [Array2<f64>; 3],
}

impl Plan {
    pub fn new(kernel: Kernel, alpha: f64, grid: GraphGrid) -> Self {
        let (mut h, mut most) = ((alpha / FINENESS).min(COARSEST), NODES);
        if let Kernel::Gaussian { blur } | Kernel::Laplacian { blur } = kernel {
            h = h.min(blur / BLURRED);
            most = ((PER_BLUR * alpha / blur) as usize).saturating_add(1).clamp(NODES, MOST_NODES);
        }
        let [n_i, n_o, n_d] = grid.shape();
        let polar = [n_i, n_o].map(|cells| cells.min(most));
        let azimuths = (most.pow(3) / (polar[0] * polar[1])).min(MOST_AZIMUTHS);
        let base = [(n_i, polar[0]), (n_o, polar[1]), (n_d, azimuths)].map(|(c, n)| BaseAxis::new(c, n, alpha));
        let reached = [0, 1, 2].map(|axis| Array2::eye(base[axis].nodes));
        let narrowest = (NARROWEST * resolves(&base)).max(NARROWEST_IN_VALUE * h);
        Self { kernel, base, values: ValueAxis { h }, narrowest, steps: Vec::new(), reached }
    }

    /// How many Gaussians points up to `size` apart take.
    pub fn count(&self, size: f64) -> usize {
        let base = self.base.iter().map(|axis| ((axis.nodes - 1) as f64 * axis.spacing).powi(2)).sum::<f64>();
        Mixture::count(self.kernel, self.narrowest, (base + size * size).sqrt())
    }

    pub fn mixture(&self, count: usize) -> Mixture {
        Mixture::new(self.kernel, self.narrowest, count)
    }

    /// Adds Gaussians until there are `count`.
    pub fn extend(&mut self, count: usize) {
        let mixture = self.mixture(count);
        for term in &mixture.terms[self.steps.len().min(count)..] {
            let narrowed = self.narrowed(term.s);
            let base = [0, 1, 2].map(|axis| self.project(axis, narrowed[axis].on_lattice));
            let scale: f64 = narrowed.iter().map(|n| (0.5 / term.s / n.on_lattice).sqrt()).product();
            let sigma = (0.5 / term.s).sqrt();
            let doublings = (SAMPLED * sigma / self.values.h).log2().floor().max(0.0);
            let outputs = ValueAxis { h: self.values.h * doublings.exp2() };
            self.steps.push(Step { weight: term.c * scale, sigma, base, outputs });
        }
    }

    fn project(&mut self, axis: usize, variance: f64) -> Projection {
        let (nodes, spacing) = (self.base[axis].nodes, self.base[axis].spacing);
        let gram = Array2::from_shape_fn((nodes, nodes), |(i, j)| {
            let d = i.abs_diff(j) as f64 * spacing;
            (-0.5 * d * d / variance).exp()
        });
        let reached = &mut self.reached[axis];
        let (values, vectors) = eigen::symmetric(reached.t().dot(&gram).dot(reached).view());
        let to = values.iter().take_while(|value| **value > SMALLEST * values[0]).count();
        let vectors = vectors.slice_move(ndarray::s![.., ..to]);
        *reached = reached.dot(&vectors);
        let flat = |matrix: ArrayView2<'_, f64>| matrix.iter().copied().collect();
        Projection {
            down: flat(vectors.t()),
            up: flat(vectors.view()),
            from: vectors.nrows(),
            to,
            roots: values.iter().take(to).map(|value| value.sqrt()).collect(),
        }
    }

    /// How exp(-s r^2) is spread along the base axes.
    fn narrowed(&self, s: f64) -> [Narrowed; 3] {
        [0, 1, 2].map(|axis| {
            let added = 2.0 * self.base[axis].spread();
            let on_lattice = (0.5 / s - added).max(LEAST / s);
            Narrowed { on_lattice, between_points: on_lattice + added }
        })
    }

    /// The terms as two points see them through their hats, on average, if they differ in their values alone. Cubic interpolation
    /// along the value axis adds no variance.
    pub fn seen(&self, terms: &[Term]) -> Vec<Term> {
        let seen = |term: &Term| {
            let height: f64 = self.narrowed(term.s).iter().map(|n| (0.5 / term.s / n.between_points).sqrt()).product();
            Term { c: term.c * height, s: term.s }
        };
        terms.iter().map(seen).collect()
    }
}

/// The largest distance of neighbouring nodes among the base axes that have fewer nodes than cells; the smallest distance of cells
/// where none has.
fn resolves(base: &[BaseAxis; 3]) -> f64 {
    let coarse = base.iter().filter(|axis| axis.nodes < axis.hats.len()).map(|axis| axis.spacing);
    let cells = base.iter().map(|axis| axis.spacing).fold(f64::INFINITY, f64::min);
    coarse.reduce(f64::max).unwrap_or(cells)
}
