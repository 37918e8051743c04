//! The nodes of the value axis: fine where many points are, and never many.

use std::collections::BTreeMap;

/// Fine bins have one width up to this many from zero, and grow in proportion to the value beyond: highlights reach 1e5.
const EVEN: f64 = 32768.0;

/// Fine bins: of width h within `EVEN` bins of zero, of relative width 1/EVEN beyond.
#[derive(Debug, Clone, Copy)]
struct Bins {
    h: f64,
}

impl Bins {
    /// The lower edge of a bin.
    fn edge(self, bin: i64) -> f64 {
        let x = bin as f64;
        let even = x.abs().min(EVEN);
        self.h * even.copysign(x) * ((x.abs() - even) / EVEN).exp()
    }

    fn of(self, w: f64) -> i64 {
        let x = w / self.h;
        if x.abs() < EVEN - 1.0 {
            let bin = x.floor() as i64;
            // The quotient may miss an edge by its last digit.
            return bin - i64::from(self.h * bin as f64 > w) + i64::from(self.h * (bin + 1) as f64 <= w);
        }
        let bin = if x.abs() <= EVEN { x } else { (EVEN + EVEN * (x.abs() / EVEN).ln()).copysign(x) };
        let bin = bin.floor() as i64;
        // The logarithm may miss an edge by its last digit.
        if self.edge(bin) > w {
            bin - 1
        } else if self.edge(bin + 1) <= w {
            bin + 1
        } else {
            bin
        }
    }
}

/// A point among four nodes: cubic interpolation takes `weights` of the nodes from `first` on, and `slopes` for its derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    pub first: usize,
    pub weights: [f64; 4],
    pub slopes: [f64; 4],
}

/// Nodes along the value axis, ascending.
#[derive(Debug, Clone)]
pub(super) struct ValueAxis {
    bins: Bins,
    /// The bin whose lower edge is the node.
    node_bins: Vec<i64>,
    pub nodes: Vec<f64>,
    /// For four nodes from each on, 1/prod_(j != k) (x_k - x_j): Lagrange's denominators.
    scales: Vec<[f64; 4]>,
    /// Which node lies at or below each of the first bins, counted from the first node's.
    below: Vec<u32>,
}

/// Bins on either side of zero that are counted in a table.
const NEAR: i64 = 1 << 13;

/// Bins whose node is looked up in a table.
const TABLE: i64 = 1 << 16;

impl ValueAxis {
    /// Nodes at the edges of the bins of width `h` that hold values, and of their neighbours; where these are more than
    /// `most`, neighbouring bins of few values are taken together. They lie at fixed places, multiples of h near zero: a small
    /// change of one value changes no other point's place.
    pub fn new<'a>(values: impl Iterator<Item = &'a f64>, h: f64, most: usize) -> Self {
        let bins = Bins { h };
        let mut counts: BTreeMap<i64, usize> = BTreeMap::new();
        let mut near = vec![0; 2 * NEAR as usize];
        let mut total = 0;
        for &w in values {
            total += 1;
            let bin = bins.of(w);
            match usize::try_from(bin + NEAR).ok().and_then(|bin| near.get_mut(bin)) {
                Some(count) => *count += 1,
                None => *counts.entry(bin).or_default() += 1,
            }
        }
        counts.extend((-NEAR..).zip(near).filter(|(_, count)| *count > 0));
        let node_bins = place(&counts, total, most, bins);
        let nodes: Vec<f64> = node_bins.iter().map(|bin| bins.edge(*bin)).collect();
        let first = node_bins.first().copied().unwrap_or(0);
        let mut below = Vec::new();
        for (node, pair) in node_bins.windows(2).enumerate().take_while(|(_, pair)| pair[0] - first < TABLE) {
            below.resize((pair[1] - first).min(TABLE) as usize, node as u32);
        }
        let scale = |x: &[f64], k: usize| 1.0 / (0..4).filter(|j| *j != k).map(|j| x[k] - x[j]).product::<f64>();
        let scales = nodes.windows(4).map(|x| [0, 1, 2, 3].map(|k| scale(x, k))).collect();
        Self { bins, node_bins, nodes, scales, below }
    }

    /// The place of a value that the axis was made for.
    pub fn place(&self, w: f64) -> Place {
        let bin = self.bins.of(w);
        let known = usize::try_from(bin - self.node_bins[0]).ok().and_then(|bin| self.below.get(bin));
        let below = match known {
            Some(below) => *below as usize,
            None => self.node_bins.partition_point(|node| *node <= bin).saturating_sub(1),
        };
        let first = below.saturating_sub(1).min(self.scales.len() - 1);
        let x = &self.nodes[first..first + 4];
        let [a, b, c, d] = [w - x[0], w - x[1], w - x[2], w - x[3]];
        let scale = &self.scales[first];
        let weights = [b * c * d, a * c * d, a * b * d, a * b * c];
        let slopes = [b * c + b * d + c * d, a * c + a * d + c * d, a * b + a * d + b * d, a * b + a * c + b * c];
        Place {
            first,
            weights: [0, 1, 2, 3].map(|k| weights[k] * scale[k]),
            slopes: [0, 1, 2, 3].map(|k| slopes[k] * scale[k]),
        }
    }
}

/// How much wider than its distance from zero a stretch without a node may be.
const WIDEST: f64 = 0.03;

/// The bins at whose lower edges nodes stand: those of every occupied bin and its neighbours, or, where `most` are not enough,
/// the edges of well occupied ones, and of stretches that hold a share of the points or are wide for their value.
fn place(counts: &BTreeMap<i64, usize>, total: usize, most: usize, bins: Bins) -> Vec<i64> {
    let mut edges: Vec<i64> = Vec::new();
    for edge in counts.keys().flat_map(|bin| bin - 1..bin + 3) {
        if edges.last().is_none_or(|last| *last < edge) {
            edges.push(edge);
        }
    }
    if edges.len() <= most {
        return edges;
    }
    let share = (2 * total).div_ceil(most);
    let mut nodes: Vec<i64> = Vec::with_capacity(most);
    let mut push = |bin: i64| {
        if nodes.last().is_none_or(|last| *last < bin) {
            nodes.push(bin);
        }
    };
    push(edges[0]);
    // The stretch that is being filled: where it began, and what it holds.
    let mut open: Option<(i64, usize)> = None;
    let mut end = 0;
    for (&bin, &count) in counts {
        if let Some((start, held)) = open {
            let (low, high) = (bins.edge(start), bins.edge(bin));
            let wide = high - low > WIDEST * low.abs().max(high.abs()) && high - low > 8.0 * bins.h;
            if held + count > share || wide {
                push(end);
                open = None;
            }
        }
        if open.is_none() {
            push(bin);
        }
        let (start, held) = open.unwrap_or((bin, 0));
        open = Some((start, held + count));
        end = bin + 1;
    }
    push(end);
    push(end + 1);
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_lies_between_its_nodes() {
        let values: Vec<f64> = (0..5000).map(|k| (f64::from(k) * 0.01 - 20.0).sinh() * 1e-3).collect();
        for most in [40_000, 700] {
            let axis = ValueAxis::new(values.iter(), 0.004, most);
            assert!(axis.nodes.is_sorted_by(|a, b| a < b));
            // Stretches that are wide for their value get nodes beyond `most`.
            assert!(axis.nodes.len() < most.max(2000), "{}", axis.nodes.len());
            for &w in &values {
                let place = axis.place(w);
                let nodes = &axis.nodes[place.first..place.first + 4];
                assert!(nodes[0] <= w && w <= nodes[3]);
                // Cubics, and their slopes, are reproduced.
                let cubic = |x: f64| 1.0 + (x - w) * (2.0 + (x - w) * (3.0 + (x - w)));
                let sum = |factors: [f64; 4]| nodes.iter().zip(factors).map(|(x, f)| f * cubic(*x)).sum::<f64>();
                // Wide stretches beside narrow ones cost digits: the cubic is large at far nodes.
                let size = nodes.iter().map(|x| cubic(*x).abs()).fold(1.0, f64::max);
                assert!((sum(place.weights) - 1.0).abs() < 1e-12 * size, "{most}: {w} {}", sum(place.weights));
                assert!((sum(place.slopes) - 2.0).abs() < 1e-9 * size, "{most}: {w} {}", sum(place.slopes));
            }
        }
    }

    #[test]
    fn bins_and_edges_agree() {
        let bins = Bins { h: 0.00625 };
        for bin in [-90_000, -32_768, -7, 0, 1, 32_767, 32_768, 32_769, 400_000] {
            let (low, high) = (bins.edge(bin), bins.edge(bin + 1));
            assert!(low < high);
            assert_eq!((bins.of(low), bins.of(0.5 * (low + high))), (bin, bin));
        }
    }

    #[test]
    fn one_value_has_four_nodes() {
        for w in [0.3, 0.0, -5.0, 1e5] {
            let axis = ValueAxis::new([w; 9].iter(), 0.01, 100);
            assert_eq!((axis.nodes.len(), axis.place(w).first), (4, 0));
        }
    }
}
