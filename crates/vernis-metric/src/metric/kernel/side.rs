//! One side of a comparison on the lattice: masses, and for every Gaussian of the kernel the coordinates whose squared distance
//! between two sides is the Gaussian's form.
//!
//! Along the base, coordinates are those of eigenvectors; along the value axis a Gaussian is the integral over u of two of half the
//! variance, exp(-(u - x)^2/sigma^2) exp(-(u - y)^2/sigma^2), taken at places u (`plan.rs`).

use super::lanes::{LANES, Lanes, Tap, contract, filter};
use super::memory::Buffer;
use super::plan::{Plan, Step};
use super::splat::masses;
use super::value_axis::ValueAxis;
use crate::metric::graph::{CommonCells, GraphGrid};

/// Gaussians end where they have fallen to exp(-20) = 2e-9.
const REACH: f64 = 20.0;

/// Numbers on entries of [`LANES`] nodes of a value axis x coordinates along the base.
#[derive(Debug, Clone)]
pub(super) struct Field {
    /// Entry e holds the nodes from LANES e on; increasing.
    pub entries: Vec<i64>,
    /// Coordinates along the base.
    pub width: usize,
    pub data: Buffer,
}

impl Field {
    pub fn zeros(entries: Vec<i64>, width: usize) -> Self {
        let data = Buffer::zeros(entries.len() * width);
        Self { entries, width, data }
    }

    /// To be written as a whole.
    fn unspecified(entries: Vec<i64>, width: usize) -> Self {
        let data = Buffer::unspecified(entries.len() * width);
        Self { entries, width, data }
    }

    pub fn entry(&self, slot: usize) -> &[Lanes] {
        &self.data[slot * self.width..][..self.width]
    }

    /// For every entry that either has, both.
    pub fn pairs<'a>(
        &'a self,
        other: &'a Self,
    ) -> impl Iterator<Item = (i64, Option<&'a [Lanes]>, Option<&'a [Lanes]>)> {
        let (mut i, mut j) = (0, 0);
        std::iter::from_fn(move || {
            let (a, b) = (self.entries.get(i), other.entries.get(j));
            let entry = match (a, b) {
                (Some(a), Some(b)) => *a.min(b),
                (Some(entry), None) | (None, Some(entry)) => *entry,
                (None, None) => return None,
            };
            let of_a = (a == Some(&entry)).then(|| self.entry(i));
            let of_b = (b == Some(&entry)).then(|| other.entry(j));
            i += usize::from(of_a.is_some());
            j += usize::from(of_b.is_some());
            Some((entry, of_a, of_b))
        })
    }

    /// self - other.
    pub fn minus(&self, other: &Self) -> Self {
        let mut difference = Self { entries: Vec::new(), width: self.width, data: Buffer::zeros(0) };
        for (entry, a, b) in self.pairs(other) {
            difference.entries.push(entry);
            match (a, b) {
                (Some(a), Some(b)) => {
                    difference.data.extend(a.iter().zip(b).map(|(a, b)| std::array::from_fn(|k| a[k] - b[k])));
                }
                (Some(a), None) => difference.data.extend(a.iter().copied()),
                (None, b) => difference.data.extend(b.unwrap_or_default().iter().map(|b| b.map(|b| -b))),
            }
        }
        difference
    }

    /// Multiplied by a matrix along each base axis, the last first: `shape` before.
    fn multiplied(&self, matrices: [&[f64]; 3], shape: [usize; 3], to: [usize; 3]) -> Self {
        let [n_i, n_o, n_d] = shape;
        let [r_i, r_o, r_d] = to;
        let width = r_i * r_o * r_d;
        let mut out = Self::unspecified(self.entries.clone(), width);
        let (mut one, mut two) = (Buffer::unspecified(n_i * n_o * r_d), Buffer::unspecified(n_i * r_o * r_d));
        for (values, out) in self.data.chunks_exact(self.width).zip(out.data.chunks_exact_mut(out.width)) {
            contract(values, [n_i * n_o, n_d, 1], matrices[2], &mut one);
            contract(&one, [n_i, n_o, r_d], matrices[1], &mut two);
            contract(&two, [1, n_i, r_o * r_d], matrices[0], out);
        }
        out
    }

    fn down(&self, step: &Step) -> Self {
        let base = step.base.each_ref();
        self.multiplied(base.map(|b| &b.down[..]), base.map(|b| b.from), base.map(|b| b.to))
    }

    fn up(&self, step: &Step) -> Self {
        let base = step.base.each_ref();
        self.multiplied(base.map(|b| &b.up[..]), base.map(|b| b.to), base.map(|b| b.from))
    }
}

/// The product of the square roots of the eigenvalues, one a coordinate.
fn roots(step: &Step) -> Vec<f64> {
    let [f, g, h] = step.base.each_ref().map(|base| &base.roots);
    let of_rows = f.iter().flat_map(|f| g.iter().map(move |g| f * g));
    of_rows.flat_map(|fg| h.iter().map(move |h| fg * h)).collect()
}

/// The nodes of an entry.
fn nodes(axis: ValueAxis, entry: i64) -> Lanes {
    std::array::from_fn(|lane| axis.node(entry * LANES as i64 + lane as i64))
}

/// Which entries of `axis` lie within reach of the entries of another.
fn within_reach(from: &[Lanes], axis: ValueAxis, reach: f64) -> Vec<i64> {
    let mut entries: Vec<i64> = Vec::new();
    for nodes in from {
        let first = axis.below(nodes[0] - reach).div_euclid(LANES as i64);
        let last = (axis.below(nodes[LANES - 1] + reach) + 1).div_euclid(LANES as i64);
        let next = entries.last().map_or(first, |last| last + 1);
        entries.extend(first.max(next)..=last);
    }
    entries
}

/// exp(-(to - from)^2/sigma^2).
fn factors(from: f64, to: &Lanes, even: bool, sigma: f64) -> Lanes {
    let inverse = 1.0 / (sigma * sigma);
    let at = |to: f64| (-(to - from) * (to - from) * inverse).exp();
    if !even {
        return to.map(at);
    }
    // The quotients of neighbours are a geometric series.
    let step = to[1] - to[0];
    let mut factor = at(to[0]);
    let mut quotient = (-(2.0 * (to[0] - from) + step) * step * inverse).exp();
    let change = (-2.0 * step * step * inverse).exp();
    std::array::from_fn(|_| {
        let found = factor;
        factor *= quotient;
        quotient *= change;
        found
    })
}

/// Sums along the value axis, exp(-(u - w)^2/sigma^2) from `from` on nodes `of` to entries `to` on nodes `on`; `norms`: of a node there and
/// here.
fn along_values(
    from: &Field,
    of: ValueAxis,
    from_norm: impl Fn(i64) -> f64,
    to: Vec<i64>,
    on: ValueAxis,
    to_norm: impl Fn(i64) -> f64,
    step: &Step,
) -> Field {
    let reach = REACH.sqrt() * step.sigma;
    let places: Vec<Lanes> = from.entries.iter().map(|entry| nodes(of, *entry)).collect();
    let (scales, mut out) = (roots(step), Field::unspecified(to, from.width));
    let mut taps: Vec<Tap> = Vec::new();
    let mut first = 0;
    for (entry, out) in out.entries.iter().zip(out.data.chunks_exact_mut(from.width)) {
        let targets = nodes(on, *entry);
        let (low, high) = (targets[0] - reach, targets[LANES - 1] + reach);
        let distance = targets[1] - targets[0];
        // Nor are they further apart than a series of factors spans without leaving the range of f64.
        let even = distance < 2.0 * step.sigma
            && targets.windows(2).all(|pair| (pair[1] - pair[0] - distance).abs() < 1e-9 * distance);
        while first < places.len() && places[first][LANES - 1] < low {
            first += 1;
        }
        taps.clear();
        for (slot, places) in places.iter().enumerate().skip(first).take_while(|(_, places)| places[0] <= high) {
            for (lane, place) in places.iter().enumerate().filter(|(_, place)| (low..=high).contains(*place)) {
                let norm = from_norm(from.entries[slot] * LANES as i64 + lane as i64);
                let factors = factors(*place, &targets, even, step.sigma).map(|factor| factor * norm);
                taps.push(Tap { entry: slot, lane, factors });
            }
        }
        let norm = std::array::from_fn(|lane| to_norm(entry * LANES as i64 + lane as i64));
        filter(&from.data, &taps, &norm, &scales, out);
    }
    out
}

/// One side, for Gaussians of the plan that follow one another.
#[derive(Debug, Clone)]
pub(super) struct Side {
    /// The first of them.
    first: usize,
    /// Coordinates, one field a Gaussian.
    fields: Vec<Field>,
    /// The masses of the last Gaussian's coordinates along the base.
    last: Field,
}

impl Side {
    /// For all of them. `values`: phi of the values, one a cell of `grid`; cells outside `common` are left out.
    pub fn new(plan: &Plan, values: &[f64], grid: GraphGrid, common: &CommonCells) -> Self {
        let last = masses(plan, values, grid, common);
        Self { first: 0, fields: Vec::new(), last }.extended(plan, plan.steps.len())
    }

    /// The number of Gaussians that it reaches to.
    pub fn count(&self) -> usize {
        self.first + self.fields.len()
    }

    /// The entries of value nodes that have masses.
    pub fn entries(&self) -> &[i64] {
        &self.last.entries
    }

    fn extended(mut self, plan: &Plan, count: usize) -> Self {
        for step in &plan.steps[self.count().min(count)..count] {
            self.last = self.last.down(step);
            let places: Vec<Lanes> = self.last.entries.iter().map(|entry| nodes(plan.values, *entry)).collect();
            let outputs = within_reach(&places, step.outputs, REACH.sqrt() * step.sigma);
            let norm = |output| step.norm(output);
            self.fields.push(along_values(&self.last, plan.values, |_| 1.0, outputs, step.outputs, norm, step));
        }
        self
    }

    /// The Gaussians from there to the first `count`, if there are any.
    pub fn more(&self, plan: &Plan, count: usize) -> Option<Self> {
        let rest = || Self { first: self.count(), fields: Vec::new(), last: self.last.clone() };
        (self.count() < count).then(|| rest().extended(plan, count))
    }

    pub fn field(&self, k: usize) -> &Field {
        &self.fields[k - self.first]
    }
}

/// The sum over the Gaussians of c G D at the nodes of `entries`, given D's coordinates for each: nodes of the value axis x base nodes.
pub(super) fn potential(plan: &Plan, differences: &[Field], entries: &[i64]) -> Field {
    let mut wider: Option<Field> = None;
    for (k, difference) in differences.iter().enumerate().rev() {
        let step = &plan.steps[k];
        let norm = |output| step.norm(output) * step.weight;
        let mut field = along_values(difference, step.outputs, norm, entries.to_vec(), plan.values, |_| 1.0, step);
        if let Some(wider) = wider {
            let terms = wider.up(&plan.steps[k + 1]);
            field.data.as_flattened_mut().iter_mut().zip(terms.data.as_flattened()).for_each(|(a, b)| *a += b);
        }
        wider = Some(field);
    }
    match (wider, plan.steps.first()) {
        (Some(field), Some(step)) => field.up(step),
        _ => Field::zeros(Vec::new(), 0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::kernel::mixture::Kernel;

    /// Two values at one place of the base, wherever between the nodes: |S a - S b|^2/2 is 1 - exp(-s r^2), but for what cubic
    /// interpolation and the narrowest Gaussians miss.
    #[test]
    fn squares_of_coordinates_are_gaussians() {
        let grid = GraphGrid::new(2, 2, 4).unwrap();
        let mut plan = Plan::new(Kernel::Energy, 0.1, grid);
        plan.extend(plan.count(4.0));
        let step = |k: usize| plan.steps[k].sigma;
        let mask = crate::metric::graph::CosineTable::of(
            &crate::brdf::models::Lambert::new([0.5; 3]).unwrap(),
            grid,
            crate::metric::Side::Alone,
        )
        .unwrap();
        let common = mask.common_cells(&mask, "energy").unwrap();
        let side = |w: f64| {
            let mut values = vec![0.5; grid.len()];
            values[5] = w;
            Side::new(&plan, &values, grid, &common)
        };
        let scale = |k: usize| plan.steps[k].weight / plan.mixture(k + 1).terms[k].c;
        for (x, y) in [(0.3, 0.31), (0.301, 0.42), (0.77, 1.9)] {
            let (a, b) = (side(x), side(y));
            for k in 2..plan.steps.len() {
                let difference = a.field(k).minus(b.field(k));
                let squares: f64 = difference.data.as_flattened().iter().map(|x| x * x).sum();
                let expected = -(-0.5 * ((x - y) / step(k)).powi(2)).exp_m1();
                let found = 0.5 * scale(k) * squares;
                assert!(
                    (found - expected).abs() < 0.02 * expected + 1e-9,
                    "{x} {y} {}: {found:e} {expected:e}",
                    step(k)
                );
            }
        }
    }
}
