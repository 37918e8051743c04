//! The difference of two graphs on a lattice, and Gaussian forms of it.

use super::axis::{BaseAxis, Factor, Hat};
use super::mixture::{Mixture, Term};
use super::value_axis::{Place, ValueAxis};
use crate::metric::graph::{CommonCells, GraphGrid};

/// Gaussians of the value axis end where they have fallen to exp(-27) = 2e-12.
const REACH: f64 = 27.0;

/// A Gaussian is not narrowed below this times 1/s, half of its variance.
const LEAST: f64 = 0.25;

/// The variance of a Gaussian along one axis.
struct Narrowed {
    on_lattice: f64,
    /// With what the hats of two points add to it.
    between_points: f64,
}

/// Sizes of a lattice.
#[derive(Debug, Clone, Copy)]
pub(super) struct Resolution {
    /// Nodes along a polar axis: no fewer, and no more where that stays within `size`.
    pub polar: (usize, usize),
    /// Nodes of the lattice, about at most, unless the fewest along every axis are more.
    pub size: usize,
    /// Distance of value nodes.
    pub h: f64,
    /// Value nodes, about at most.
    pub most: usize,
}

/// N (a - b) on a lattice: value nodes x base nodes.
pub(super) struct Lattice {
    base: [BaseAxis; 3],
    values: ValueAxis,
    /// Row-major: value, theta_i, theta_o, phi_d.
    mass: Vec<f64>,
}

impl Lattice {
    /// `a` and `b` are phi of the values, one a cell of `grid`; cells outside `common` are left out.
    pub fn new(
        a: &[f64],
        b: &[f64],
        grid: GraphGrid,
        common: &CommonCells,
        alpha: f64,
        resolution: Resolution,
    ) -> Self {
        let [n_i, n_o, n_d] = grid.shape();
        let cells = || (0..grid.len()).filter(|cell| common.contains(*cell));
        let values = ValueAxis::new(cells().flat_map(|c| [&a[c], &b[c]]), resolution.h, resolution.most);
        let (fewest, most) = resolution.polar;
        let plane = (resolution.size / values.nodes.len()).max(fewest.pow(3));
        let polar = ((plane as f64).cbrt() as usize).clamp(fewest, most);
        let [nodes_i, nodes_o] = [n_i, n_o].map(|cells| cells.min(polar));
        // What the polar axes do not need goes to the azimuth, which has the most cells.
        let nodes_d = n_d.min(plane.min(most.pow(3)) / (nodes_i * nodes_o));
        let base = [(n_i, nodes_i), (n_o, nodes_o), (n_d, nodes_d)].map(|(c, n)| BaseAxis::new(c, n, alpha));
        let [m_i, m_o, m_d] = [0, 1, 2].map(|axis| base[axis].nodes);
        let plane = m_i * m_o * m_d;
        let mut mass = vec![0.0; values.nodes.len() * plane];
        let mut row = RowSplat::new(values.nodes.len(), m_d);
        for i in 0..n_i {
            for o in 0..n_o {
                for (d, hat) in base[2].hats.iter().enumerate() {
                    let cell = (i * n_o + o) * n_d + d;
                    if common.contains(cell) {
                        row.add(0, values.place(a[cell]), *hat);
                        row.add(1, values.place(b[cell]), *hat);
                    }
                }
                let (x, y) = (base[0].hats[i], base[1].hats[o]);
                let places = corners(x, y).map(|(i, o, weight)| ((i * m_o + o) * m_d, weight));
                row.flush(&mut mass, plane, places);
            }
        }
        Self { base, values, mass }
    }

    /// sum over the terms of c <D, G D>, G the Gaussian of the term, D = N (a - b), each Gaussian narrowed by what the hats
    /// add to it.
    pub fn form(&self, mixture: &Mixture) -> f64 {
        mixture.terms.iter().map(|term| self.gaussian(term.s).form(self) * term.c).sum()
    }

    /// sum over the terms of c G D at the nodes.
    pub fn potential(&self, mixture: &Mixture) -> Vec<f64> {
        let mut potential = vec![0.0; self.mass.len()];
        for term in &mixture.terms {
            self.gaussian(term.s).add_potential(self, term.c, &mut potential);
        }
        potential
    }

    /// The slope along the value axis of a potential, at a cell with value `w`.
    pub fn slope(&self, potential: &[f64], cell: [usize; 3], w: f64) -> f64 {
        let [m_i, m_o, m_d] = [0, 1, 2].map(|axis| self.base[axis].nodes);
        let plane = m_i * m_o * m_d;
        let place = self.values.place(w);
        let [x, y, z] = [0, 1, 2].map(|axis| self.base[axis].hats[cell[axis]]);
        let mut rise = 0.0;
        for (i, o, weight) in corners(x, y) {
            for (d, along) in [(z.below, 1.0 - z.t), (z.below + 1, z.t)] {
                let at = (i * m_o + o) * m_d + d;
                let slopes = place.slopes.iter().enumerate();
                rise +=
                    weight * along * slopes.map(|(k, s)| s * potential[(place.first + k) * plane + at]).sum::<f64>();
            }
        }
        rise
    }

    /// The largest distance of neighbouring nodes among the base axes that have fewer nodes than cells; the smallest distance
    /// of cells where none has.
    pub fn resolves(&self) -> f64 {
        let coarse = self.base.iter().filter(|axis| axis.nodes < axis.hats.len()).map(|axis| axis.spacing);
        let cells = self.base.iter().map(|axis| axis.spacing).fold(f64::INFINITY, f64::min);
        coarse.reduce(f64::max).unwrap_or(cells)
    }

    /// No two points are further apart.
    pub fn diameter(&self) -> f64 {
        let base = self.base.iter().map(|axis| (axis.nodes - 1) as f64 * axis.spacing);
        let values = self.values.nodes.last().unwrap_or(&0.0) - self.values.nodes.first().unwrap_or(&0.0);
        base.chain([values]).map(|extent| extent * extent).sum::<f64>().sqrt()
    }

    fn gaussian(&self, s: f64) -> Gaussian {
        let narrowed = self.narrowed(s);
        let base = [0, 1, 2].map(|axis| self.base[axis].factor(narrowed[axis].on_lattice));
        let scale = narrowed.iter().map(|n| (0.5 / s / n.on_lattice).sqrt()).product();
        Gaussian { base, inverse: 0.5 / narrowed[3].on_lattice, scale }
    }

    /// How exp(-s r^2) is spread along each axis, theta_i, theta_o, phi_d, value.
    fn narrowed(&self, s: f64) -> [Narrowed; 4] {
        let added = [0, 1, 2].map(|axis| 2.0 * self.base[axis].spread());
        // Cubic interpolation along the value axis adds no variance.
        [added[0], added[1], added[2], 0.0].map(|added| {
            let on_lattice = (0.5 / s - added).max(LEAST / s);
            Narrowed { on_lattice, between_points: on_lattice + added }
        })
    }

    /// The terms as two points see them through their hats, on average, if they differ in their values alone.
    pub fn seen(&self, terms: &[Term]) -> Vec<Term> {
        let seen = |term: &Term| {
            let narrowed = self.narrowed(term.s);
            let height: f64 = narrowed.iter().map(|n| (0.5 / term.s / n.between_points).sqrt()).product();
            Term { c: term.c * height, s: 0.5 / narrowed[3].between_points }
        };
        terms.iter().map(seen).collect()
    }

    fn shape(&self) -> [usize; 3] {
        [0, 1, 2].map(|axis| self.base[axis].nodes)
    }
}

/// The four nodes of (theta_i, theta_o) around a cell, with weights.
fn corners(x: Hat, y: Hat) -> [(usize, usize, f64); 4] {
    let (u, v) = (1.0 - x.t, 1.0 - y.t);
    [
        (x.below, y.below, u * v),
        (x.below, y.below + 1, u * y.t),
        (x.below + 1, y.below, x.t * v),
        (x.below + 1, y.below + 1, x.t * y.t),
    ]
}

/// The points of one (theta_i, theta_o) on value x phi_d nodes. Both sides are summed apart, so that exchanging them changes
/// nothing but the sign of the difference.
struct RowSplat {
    width: usize,
    sides: [Vec<f64>; 2],
    touched: Vec<bool>,
    list: Vec<usize>,
}

impl RowSplat {
    fn new(values: usize, width: usize) -> Self {
        Self {
            width,
            sides: [(); 2].map(|()| vec![0.0; values * width]),
            touched: vec![false; values],
            list: Vec::new(),
        }
    }

    fn add(&mut self, side: usize, place: Place, along: Hat) {
        for (q, weight) in (place.first..).zip(place.weights) {
            if !self.touched[q] {
                self.touched[q] = true;
                self.list.push(q);
            }
            let at = q * self.width + along.below;
            self.sides[side][at] += weight * (1.0 - along.t);
            self.sides[side][at + 1] += weight * along.t;
        }
    }

    /// Adds the row to the lattice at four places, and empties it.
    fn flush(&mut self, lattice: &mut [f64], plane: usize, places: [(usize, f64); 4]) {
        for q in self.list.drain(..) {
            self.touched[q] = false;
            let range = q * self.width..(q + 1) * self.width;
            let [a, b] = &mut self.sides;
            a[range.clone()].iter_mut().zip(&b[range.clone()]).for_each(|(a, b)| *a -= b);
            for (place, weight) in places.into_iter().filter(|(_, weight)| *weight != 0.0) {
                let at = q * plane + place;
                let nodes = &mut lattice[at..at + self.width];
                nodes.iter_mut().zip(&a[range.clone()]).for_each(|(l, m)| *l += weight * m);
            }
            a[range.clone()].fill(0.0);
            b[range].fill(0.0);
        }
    }
}

/// A Gaussian between the nodes of a lattice: a factor an axis of the base, exp(-inverse dw^2) along the value axis.
struct Gaussian {
    base: [Factor; 3],
    inverse: f64,
    scale: f64,
}

impl Gaussian {
    fn rank(&self) -> usize {
        self.base.iter().map(|f| f.rank).product()
    }

    /// The masses of each value node in the coordinates of the factors: value nodes x rank.
    fn project(&self, lattice: &Lattice) -> Vec<f64> {
        let [m_i, m_o, m_d] = lattice.shape();
        let [f, g, h] = &self.base;
        let plane = m_i * m_o * m_d;
        let mut out = Vec::with_capacity(lattice.values.nodes.len() * self.rank());
        let (mut one, mut two) = (vec![0.0; m_i * m_o * h.rank], vec![0.0; m_i * g.rank * h.rank]);
        let mut three = vec![0.0; self.rank()];
        for mass in lattice.mass.chunks_exact(plane) {
            contract(mass, [m_i * m_o, m_d, 1], h, &mut one);
            contract(&one, [m_i, m_o, h.rank], g, &mut two);
            contract(&two, [1, m_i, g.rank * h.rank], f, &mut three);
            out.extend_from_slice(&three);
        }
        out
    }

    /// The first node that is within reach of node `q`, from below.
    fn first(&self, nodes: &[f64], q: usize) -> usize {
        let reach = (REACH / self.inverse).sqrt();
        nodes[..q].partition_point(|w| *w < nodes[q] - reach)
    }

    fn weight(&self, nodes: &[f64], p: usize, q: usize) -> f64 {
        let d = nodes[p] - nodes[q];
        (-self.inverse * d * d).exp()
    }

    fn form(&self, lattice: &Lattice) -> f64 {
        let nodes = &lattice.values.nodes;
        let projected = self.project(lattice);
        let rank = self.rank();
        let at = |q: usize| &projected[q * rank..(q + 1) * rank];
        let mut sum = 0.0;
        let mut from_below = vec![0.0; rank];
        for q in 0..nodes.len() {
            // Half of the node itself, and all below it.
            from_below.iter_mut().zip(at(q)).for_each(|(f, m)| *f = 0.5 * m);
            for p in self.first(nodes, q)..q {
                let weight = self.weight(nodes, p, q);
                from_below.iter_mut().zip(at(p)).for_each(|(f, m)| *f += weight * m);
            }
            sum += dot(&from_below, at(q));
        }
        2.0 * self.scale * sum
    }

    fn add_potential(&self, lattice: &Lattice, c: f64, potential: &mut [f64]) {
        let nodes = &lattice.values.nodes;
        let projected = self.project(lattice);
        let rank = self.rank();
        let mut spread = projected.clone();
        for q in 0..nodes.len() {
            for p in self.first(nodes, q)..q {
                let weight = self.weight(nodes, p, q);
                for (to, from) in [(q, p), (p, q)] {
                    let source = &projected[from * rank..(from + 1) * rank];
                    spread[to * rank..(to + 1) * rank].iter_mut().zip(source).for_each(|(t, s)| *t += weight * s);
                }
            }
        }
        let [m_i, m_o, m_d] = lattice.shape();
        let [f, g, h] = &self.base;
        let (mut one, mut two) = (vec![0.0; m_i * g.rank * h.rank], vec![0.0; m_i * m_o * h.rank]);
        let mut three = vec![0.0; m_i * m_o * m_d];
        for (row, out) in spread.chunks_exact(rank).zip(potential.chunks_exact_mut(three.len())) {
            expand(row, [1, m_i, g.rank * h.rank], f, &mut one);
            expand(&one, [m_i, m_o, h.rank], g, &mut two);
            expand(&two, [m_i * m_o, m_d, 1], h, &mut three);
            out.iter_mut().zip(&three).for_each(|(o, t)| *o += c * self.scale * t);
        }
    }
}

/// Four sums at a time, added up in a fixed order.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    for (x, y) in a4.0.iter().zip(b4.0) {
        (0..4).for_each(|k| sums[k] += x[k] * y[k]);
    }
    let rest: f64 = a4.1.iter().zip(b4.1).map(|(x, y)| x * y).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// out[x, r, y] = sum_k in[x, k, y] factor[k, r], with shape [x, k, y].
fn contract(values: &[f64], [outer, n, inner]: [usize; 3], factor: &Factor, out: &mut [f64]) {
    let rank = factor.rank;
    out.fill(0.0);
    for (block, out) in values.chunks_exact(n * inner).zip(out.chunks_exact_mut(rank * inner)).take(outer) {
        for (k, row) in factor.values.chunks_exact(rank).enumerate() {
            let source = &block[k * inner..(k + 1) * inner];
            // Most of a lattice is empty: highlights are narrow.
            if source.iter().all(|s| *s == 0.0) {
                continue;
            }
            if inner == 1 {
                out.iter_mut().zip(row).for_each(|(o, f)| *o += source[0] * f);
            } else {
                for (target, f) in out.chunks_exact_mut(inner).zip(row) {
                    target.iter_mut().zip(source).for_each(|(t, s)| *t += f * s);
                }
            }
        }
    }
}

/// out[x, k, y] = sum_r in[x, r, y] factor[k, r]: the transpose of [`contract`].
fn expand(values: &[f64], [outer, n, inner]: [usize; 3], factor: &Factor, out: &mut [f64]) {
    let rank = factor.rank;
    out.fill(0.0);
    for (block, out) in values.chunks_exact(rank * inner).zip(out.chunks_exact_mut(n * inner)).take(outer) {
        for (target, row) in out.chunks_exact_mut(inner).zip(factor.values.chunks_exact(rank)) {
            for (source, f) in block.chunks_exact(inner).zip(row) {
                target.iter_mut().zip(source).for_each(|(t, s)| *t += f * s);
            }
        }
    }
}
