//! From cells to masses on the lattice, and slopes of potentials back at the cells.

use super::lanes::{LANES, Lanes};
use super::plan::Plan;
use super::side::Field;
use super::value_axis::ValueAxis;
use crate::metric::graph::{CommonCells, GraphGrid};

/// The four nodes of (theta_i, theta_o) around a cell, with weights.
fn corners(plan: &Plan, i: usize, o: usize) -> [(usize, f64); 4] {
    let [_, m_o, m_d] = [0, 1, 2].map(|axis| plan.base[axis].nodes);
    let (x, y) = (plan.base[0].hats[i], plan.base[1].hats[o]);
    let at = |i: usize, o: usize| (i * m_o + o) * m_d;
    [
        (at(x.below, y.below), (1.0 - x.t) * (1.0 - y.t)),
        (at(x.below, y.below + 1), (1.0 - x.t) * y.t),
        (at(x.below + 1, y.below), x.t * (1.0 - y.t)),
        (at(x.below + 1, y.below + 1), x.t * y.t),
    ]
}

/// Where each entry of value nodes stands among those that have masses.
struct Slots {
    first: i64,
    slots: Vec<u32>,
}

impl Slots {
    const NONE: u32 = u32::MAX;

    fn of(entries: &[i64]) -> Self {
        let (first, last) = (entries.first().copied().unwrap_or(0), entries.last().copied().unwrap_or(-1));
        let mut slots = vec![Self::NONE; (last - first + 1) as usize];
        entries.iter().zip(0..).for_each(|(entry, slot)| slots[(entry - first) as usize] = slot);
        Self { first, slots }
    }

    /// The number of a node in the entries with masses; those of the next nodes follow.
    #[inline(always)]
    fn at(&self, node: i64) -> usize {
        let node = node - self.first * LANES as i64;
        self.slots[node as usize / LANES] as usize * LANES + node as usize % LANES
    }
}

/// The entries that values touch.
fn touched(axis: ValueAxis, values: impl Iterator<Item = f64> + Clone) -> Vec<i64> {
    let ends = values.clone().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), w| (low.min(w), high.max(w)));
    if ends.0 > ends.1 {
        return Vec::new();
    }
    let entry = |node: i64| node.div_euclid(LANES as i64);
    let first = entry(axis.below(ends.0) - 2);
    let mut marked = vec![false; (entry(axis.below(ends.1) + 3) - first + 1) as usize];
    for w in values {
        let node = axis.below(w) - 1 - first * LANES as i64;
        marked[node as usize / LANES] = true;
        marked[(node as usize + 3) / LANES] = true;
    }
    (first..).zip(marked).filter(|(_, marked)| *marked).map(|(entry, _)| entry).collect()
}

/// N times the masses of one side, by linear (hat) weights along the base and cubic ones along the values.
pub(super) fn masses(plan: &Plan, values: &[f64], grid: GraphGrid, common: &CommonCells) -> Field {
    let [_, n_o, n_d] = grid.shape();
    let all = || (0..grid.len()).filter(|cell| common.contains(*cell)).map(|cell| values[cell]);
    let entries = touched(plan.values, all());
    let slots = Slots::of(&entries);
    let [m_i, m_o, m_d] = [0, 1, 2].map(|axis| plan.base[axis].nodes);
    let mut field = Field::zeros(entries, m_i * m_o * m_d);
    let mut row = Row::new(field.entries.len(), m_d);
    for (line, values) in values.chunks_exact(n_d).enumerate() {
        for (d, (&w, hat)) in values.iter().zip(&plan.base[2].hats).enumerate() {
            if common.contains(line * n_d + d) {
                let place = plan.values.place(w);
                let at = slots.at(place.first);
                row.touch(at);
                row.add(hat.below, at, place.weights.map(|weight| weight * (1.0 - hat.t)));
                row.add(hat.below + 1, at, place.weights.map(|weight| weight * hat.t));
            }
        }
        let corners = corners(plan, line / n_o, line % n_o);
        row.flush(|slot, d, lanes| {
            for (base, weight) in corners {
                let to = &mut field.data[slot * field.width + base + d];
                (0..LANES).for_each(|lane| to[lane] += weight * lanes[lane]);
            }
        });
    }
    field
}

/// The points of one (theta_i, theta_o): nodes of phi_d x value nodes.
struct Row {
    stride: usize,
    data: Vec<f64>,
    touched: Vec<bool>,
    list: Vec<usize>,
}

impl Row {
    fn new(entries: usize, width: usize) -> Self {
        let stride = entries * LANES;
        Self { stride, data: vec![0.0; stride * width], touched: vec![false; entries], list: Vec::new() }
    }

    #[inline(always)]
    fn touch(&mut self, at: usize) {
        for slot in [at / LANES, (at + 3) / LANES] {
            if !self.touched[slot] {
                self.touched[slot] = true;
                self.list.push(slot);
            }
        }
    }

    #[inline(always)]
    fn add(&mut self, d: usize, at: usize, weights: [f64; 4]) {
        let to = &mut self.data[d * self.stride + at..][..4];
        to.iter_mut().zip(weights).for_each(|(to, weight)| *to += weight);
    }

    /// Hands over every entry that was touched, by node of phi_d, and empties it.
    fn flush(&mut self, mut take: impl FnMut(usize, usize, Lanes)) {
        for slot in self.list.drain(..) {
            self.touched[slot] = false;
            for (d, row) in self.data.chunks_exact_mut(self.stride).enumerate() {
                if let Some(lanes) = row[slot * LANES..].first_chunk_mut::<LANES>()
                    && lanes.iter().any(|lane| *lane != 0.0)
                {
                    take(slot, d, *lanes);
                    *lanes = [0.0; LANES];
                }
            }
        }
    }
}

/// For every cell that takes part, in order: the slope along the value axis of a potential on the entries that its values touch.
pub(super) fn slopes(
    plan: &Plan,
    potential: &Field,
    values: &[f64],
    grid: GraphGrid,
    common: &CommonCells,
) -> Vec<(usize, f64)> {
    let [_, n_o, n_d] = grid.shape();
    let (slots, width) = (Slots::of(&potential.entries), potential.width);
    let mut row = Row::new(potential.entries.len(), plan.base[2].nodes);
    let mut found = Vec::with_capacity(common.count());
    for (line, values) in values.chunks_exact(n_d).enumerate() {
        let cells = || (0..n_d).filter(|d| common.contains(line * n_d + d));
        cells().for_each(|d| row.touch(slots.at(plan.values.place(values[d]).first)));
        let corners = corners(plan, line / n_o, line % n_o);
        for slot in row.list.drain(..) {
            row.touched[slot] = false;
            for (d, row) in row.data.chunks_exact_mut(row.stride).enumerate() {
                if let Some(lanes) = row[slot * LANES..].first_chunk_mut::<LANES>() {
                    *lanes = [0.0; LANES];
                    for (base, weight) in corners {
                        let from = &potential.data[slot * width + base + d];
                        (0..LANES).for_each(|lane| lanes[lane] += weight * from[lane]);
                    }
                }
            }
        }
        for d in cells() {
            let (place, hat) = (plan.values.place(values[d]), plan.base[2].hats[d]);
            let at = slots.at(place.first);
            let slope = |d: usize| -> f64 {
                place.slopes.iter().zip(&row.data[d * row.stride + at..]).map(|(slope, p)| slope * p).sum()
            };
            found.push((line * n_d + d, (1.0 - hat.t) * slope(hat.below) + hat.t * slope(hat.below + 1)));
        }
    }
    found
}
