//! Gaussian sums along the value axis, in the log domain: where the time goes.
//!
//! With G_q/epsilon and V(p, q) of the source ([`super::gaussian`]), at every value node r of the target,
//!
//!   F_r = max_q (G_q - (w_q - w_r)^2/2)/epsilon,   S(p, r) = e^(F_r) sum_q exp((G_q - (w_q - w_r)^2/2)/epsilon - F_r) V(p, q)
//!
//! Three things make this cheaper than all pairs (q, r).
//!
//! *Band.* Terms whose exponent lies more than 34 + (largest base cost)/epsilon below F_r, less than 2e-15 of the sum, are left
//! out. The argument of the maximum grows with r (the cost is convex), and so do the ends of the band: what lies
//! outside the bands of the ends of an interval of targets is left out between them. S > 0 wherever c is a measure, for the
//! largest exponent is 0 and base costs are limited (`Method::LARGEST_ALPHA_PER_BLUR`).
//!
//! *Interpolation.* Divided by a Gaussian and an exponential in r, the sum over an interval of targets is
//! sum_q m_q e^(a_q x) with -1 <= x <= 1, m_q of one sign wherever V is, and a_q within an interval of length
//! A = (length of the sources' band) (length of the targets' interval)/(2 epsilon). Its interpolation in m Chebyshev nodes
//! is wrong by at most 2 (A/2)^m/m! of sum_q m_q. Intervals are halved until m nodes are enough and cheaper, or 8
//! targets are left, which are summed one by one. Early in the annealing a few nodes carry the whole axis.
//!
//! *Products.* Of eight neighbouring sources, exponentials are products of powers ([`Sources::factors`]).
//!
//! Source of the estimate: L. N. Trefethen, "Approximation Theory and Approximation Practice", theorem 8.2 and chapter 5
//! (barycentric formula), doi:10.1137/1.9781611975949.
//!
//! Cost, for P base nodes, Q source and R target nodes: at most Q R (1/4 exponential + P multiplications), P being the base nodes
//! with mass at a value where no others are asked for.

use super::elementary::{LANES, LARGEST_ARGUMENT, Lanes, exp, fma, ln, max};
use super::gaussian::{Gaussian, Nodes, Sink, Spread};
use super::measure::Measure;
use std::f64::consts::PI;
use std::ops::Range;

/// Numbers of Chebyshev nodes, and the largest A at which 2 (A/2)^m/m! stays below 1e-11.
const NODES: [(usize, f64); 6] = [(8, 0.29), (16, 2.67), (24, 6.6), (32, 11.3), (40, 16.4), (48, 21.8)];

/// Interpolation must save this share of the multiplications.
const WORTHWHILE: f64 = 0.8;

/// Sums from all value nodes of `source` to `nodes` of `target`. `ROWS`: base nodes whose sums stay in registers.
#[inline(always)]
pub(super) fn gather<const FUSED: bool, const ROWS: usize>(
    kernel: &Gaussian,
    source: &Measure,
    spread: &Spread,
    target: &Measure,
    nodes: Nodes,
    sink: Sink,
) {
    let all: Vec<u32> = (0..kernel.base_len() as u32).collect();
    let sources = Sources::new::<FUSED>(kernel, &source.values, &spread.level);
    let mut axis = Axis { kernel, sources: &sources, spread, target, nodes, all: &all, sink };
    let (mut band, mut chebyshev) = (Band::default(), Interpolation::default());
    // Intervals of targets, with the sources that can matter to them.
    let mut waiting = vec![(0..target.values.len(), 0..source.values.len())];
    while let Some((targets, sources)) = waiting.pop() {
        if targets.len() == 1 {
            axis.sum_tile::<FUSED, ROWS>(targets.start, sources, &mut band);
            continue;
        }
        let interval = axis.interval::<FUSED>(&targets, sources, &mut band);
        if let Some(count) = interval.nodes(kernel, targets.len()) {
            axis.interpolate::<FUSED, ROWS>(targets, &interval, count, &mut band, &mut chebyshev);
        } else {
            let middle = targets.start + targets.len() / 2;
            waiting.push((middle..targets.end, interval.sources.clone()));
            waiting.push((targets.start..middle, interval.sources));
        }
    }
}

/// Everything that the sums of one softmin share.
struct Axis<'a> {
    kernel: &'a Gaussian,
    sources: &'a Sources<'a>,
    spread: &'a Spread,
    target: &'a Measure,
    nodes: Nodes,
    all: &'a [u32],
    sink: Sink<'a>,
}

/// An interval of targets and what is known at its ends.
struct Interval {
    /// Entries of sources that matter to the targets.
    sources: Range<usize>,
    /// The multiples of h between the first and the last of them.
    reach: f64,
    /// Middle and half length, in h.
    middle: f64,
    half: f64,
    /// F at both ends.
    tops: [f64; 2],
}

impl Interval {
    /// How many Chebyshev nodes it takes, where interpolation is worth while for this many entries of targets.
    fn nodes(&self, kernel: &Gaussian, entries: usize) -> Option<usize> {
        let spread = self.reach * 2.0 * self.half * kernel.neighbour_cost;
        let (count, _) = NODES.into_iter().find(|&(_, largest)| spread <= largest)?;
        let (sources, targets, nodes) = ((self.sources.len() * LANES) as f64, (entries * LANES) as f64, count as f64);
        (nodes * (sources + targets) < WORTHWHILE * sources * targets).then_some(count)
    }

    /// The logarithm of the Gaussian and exponential that the sums are divided by: F at both ends, above F between.
    #[inline(always)]
    fn gauge<const FUSED: bool>(&self, kernel: &Gaussian, r: f64) -> f64 {
        let distance = r - self.middle;
        let [first, last] = self.tops;
        let slope = if self.half > 0.0 { 0.5 * (last - first) / self.half } else { 0.0 };
        let level = 0.5 * (first + last) + kernel.neighbour_cost * self.half * self.half;
        fma::<FUSED>(fma::<FUSED>(-kernel.neighbour_cost, distance, slope), distance, level)
    }
}

/// Chebyshev nodes, the sums there, and the way from them to a tile of targets.
#[derive(Default)]
struct Interpolation {
    places: Vec<f64>,
    /// Barycentric weights.
    weights: Vec<f64>,
    /// The base nodes that any target has.
    base: Vec<u32>,
    /// The sums, divided by the gauge: entries of nodes x base nodes.
    sums: Vec<Lanes>,
    /// What each node contributes to the eight targets of a tile.
    band: Band,
}

impl<'a> Axis<'a> {
    /// The base nodes of a tile of targets.
    fn base(&self, tile: usize) -> &'a [u32] {
        match self.nodes {
            Nodes::All => self.all,
            Nodes::Support => self.target.support.at(tile),
        }
    }

    /// Sums one tile of eight targets.
    #[inline(always)]
    fn sum_tile<const FUSED: bool, const ROWS: usize>(&mut self, tile: usize, sources: Range<usize>, band: &mut Band) {
        let base = self.base(tile);
        if base.is_empty() {
            return;
        }
        let top = band.find::<FUSED>(self.kernel, self.sources, sources, &self.target.values[tile]);
        band.sum_rows::<FUSED, ROWS>(&self.spread.values, self.kernel.base_len(), base);
        self.take::<FUSED>(tile, base, &band.sums, &top);
    }

    /// The band of an interval of targets, from those of its ends.
    #[inline(always)]
    fn interval<const FUSED: bool>(&self, targets: &Range<usize>, sources: Range<usize>, band: &mut Band) -> Interval {
        let values = &self.target.values[targets.clone()];
        let (first, last) = (values[0][0], values[values.len() - 1][LANES - 1]);
        let mut ends = [last; LANES];
        ends[0] = first;
        let tops = band.maxima::<FUSED>(self.kernel, self.sources, sources.clone(), &ends);
        let matters =
            |entry: usize, end: usize| band.largest[entry - sources.start][end] >= tops[end] - self.kernel.cut;
        let start = sources.clone().find(|&entry| matters(entry, 0)).unwrap_or(sources.start);
        let end = (start..sources.end).rev().find(|&entry| matters(entry, 1)).unwrap_or(start) + 1;
        Interval {
            reach: self.sources.values[end - 1][LANES - 1] - self.sources.values[start][0],
            sources: start..end,
            middle: 0.5 * (first + last),
            half: 0.5 * (last - first),
            tops: [tops[0], tops[1]],
        }
    }

    /// Sums an interval of targets by way of `count` Chebyshev nodes.
    #[inline(always)]
    fn interpolate<const FUSED: bool, const ROWS: usize>(
        &mut self,
        targets: Range<usize>,
        interval: &Interval,
        count: usize,
        band: &mut Band,
        nodes: &mut Interpolation,
    ) {
        let (kernel, groups) = (self.kernel, count / LANES);
        nodes.place(interval, count);
        nodes.base.clear();
        targets.clone().for_each(|tile| nodes.base.extend_from_slice(self.base(tile)));
        nodes.base.sort_unstable();
        nodes.base.dedup();
        nodes.sums.resize(kernel.base_len() * groups, [0.0; LANES]);
        for (group, r) in nodes.places.as_chunks().0.iter().enumerate() {
            let top = band.find::<FUSED>(kernel, self.sources, interval.sources.clone(), r);
            let mut scale = [0.0; LANES];
            for lane in 0..LANES {
                scale[lane] = exp::<FUSED>(top[lane] - interval.gauge::<FUSED>(kernel, r[lane]));
            }
            band.sum_rows::<FUSED, ROWS>(&self.spread.values, kernel.base_len(), &nodes.base);
            let sums = &mut nodes.sums[group * kernel.base_len()..][..kernel.base_len()];
            for (&p, sum) in nodes.base.iter().zip(&band.sums) {
                (0..LANES).for_each(|lane| sums[p as usize][lane] = sum[lane] * scale[lane]);
            }
        }
        for tile in targets {
            let (base, r) = (self.base(tile), &self.target.values[tile]);
            nodes.reach(r);
            let mut gauge = [0.0; LANES];
            (0..LANES).for_each(|lane| gauge[lane] = interval.gauge::<FUSED>(kernel, r[lane]));
            nodes.band.sum_rows::<FUSED, ROWS>(&nodes.sums, kernel.base_len(), base);
            self.take::<FUSED>(tile, base, &nodes.band.sums, &gauge);
        }
    }

    /// Hands the sums e^top sum of the targets of `tile`, at base nodes `base`, to the sink.
    #[inline(always)]
    fn take<const FUSED: bool>(&mut self, tile: usize, base: &[u32], sums: &[Lanes], top: &Lanes) {
        // Arrays by value: behind references, which might overlap, the loops over lanes would not become vector code.
        let top = *top;
        let (epsilon, first) = (self.kernel.epsilon, tile * self.kernel.base_len());
        let places = base.iter().map(|&p| first + p as usize);
        match &mut self.sink {
            Sink::Potential { potential, keep } => {
                let keep = *keep;
                for (at, &sum) in places.zip(sums) {
                    let mut updated = potential[at];
                    for lane in 0..LANES {
                        let logarithm = top[lane] + ln::<FUSED>(max(sum[lane], f64::MIN_POSITIVE));
                        updated[lane] = keep * updated[lane] - (1.0 - keep) * (epsilon * logarithm);
                    }
                    potential[at] = updated;
                }
            }
            Sink::Sum { sum: out, potential } => {
                for (at, &sum) in places.zip(sums) {
                    let mut scaled = potential[at];
                    for lane in 0..LANES {
                        let exponent = top[lane] + scaled[lane] / epsilon;
                        // More can only stand where there is no mass.
                        let exponent = if exponent < LARGEST_ARGUMENT { exponent } else { LARGEST_ARGUMENT };
                        scaled[lane] = sum[lane] * exp::<FUSED>(exponent);
                    }
                    out[at] = scaled;
                }
            }
        }
    }
}

impl Interpolation {
    /// Chebyshev nodes of the first kind in `interval`, and their barycentric weights.
    fn place(&mut self, interval: &Interval, count: usize) {
        let angle = |node: usize| PI * (node as f64 + 0.5) / count as f64;
        self.places.clear();
        self.places.extend((0..count).map(|node| interval.middle + interval.half * angle(node).cos()));
        self.weights.clear();
        self.weights.extend((0..count).map(|node| if node % 2 == 0 { angle(node).sin() } else { -angle(node).sin() }));
        self.band.entries.clear();
        self.band.entries.extend(0..count / LANES);
    }

    /// The barycentric formula at the targets `r`.
    #[inline(always)]
    fn reach(&mut self, r: &Lanes) {
        /// In place of a distance of zero, it gives all the weight to the node.
        const AT_NODE: f64 = 1e-200;
        let mut total = [0.0; LANES];
        self.band.factors.clear();
        for (&place, &weight) in self.places.iter().zip(&self.weights) {
            let mut factor = [0.0; LANES];
            for lane in 0..LANES {
                let distance = r[lane] - place;
                factor[lane] = weight / if distance == 0.0 { AT_NODE } else { distance };
                total[lane] += factor[lane];
            }
            self.band.factors.push(factor);
        }
        for factor in &mut self.band.factors {
            (0..LANES).for_each(|lane| factor[lane] /= total[lane]);
        }
    }
}

/// The sources of eight targets.
#[derive(Default)]
struct Band {
    /// The largest exponents of every entry looked at.
    largest: Vec<Lanes>,
    /// Entries that take part.
    entries: Vec<usize>,
    /// exp(exponent - F) of every source node of these.
    factors: Vec<Lanes>,
    /// The sums of every base node that was asked for.
    sums: Vec<Lanes>,
}

/// The value nodes of the source.
struct Sources<'a> {
    /// Multiples of h.
    values: &'a [Lanes],
    /// G/epsilon.
    level: &'a [Lanes],
    /// a_j of every entry, and L/epsilon, in [`Sources::factors`]; `None` where the nodes are not neighbours, or a_j falls far.
    rises: Vec<Lanes>,
    peaks: Vec<Option<f64>>,
}

impl<'a> Sources<'a> {
    /// Limits of -ln a_j, |ln d_r| and -ln b_r, so that no product of them leaves the range of numbers.
    const DEEPEST: f64 = 100.0;
    const STEEPEST: f64 = 20.0;
    const FARTHEST: f64 = 400.0;

    #[inline(always)]
    fn new<const FUSED: bool>(kernel: &Gaussian, values: &'a [Lanes], level: &'a [Lanes]) -> Self {
        let (mut rises, mut peaks): (Vec<Lanes>, _) =
            (Vec::with_capacity(values.len()), Vec::with_capacity(values.len()));
        for (q, level) in values.iter().zip(level) {
            let peak = level.iter().copied().fold(f64::NEG_INFINITY, max);
            let mut rise = [0.0; LANES];
            for lane in 0..LANES {
                let step = lane as f64;
                rise[lane] = fma::<FUSED>(-kernel.neighbour_cost * step, step, level[lane] - peak);
            }
            let neighbours = q[LANES - 1] - q[0] == (LANES - 1) as f64;
            peaks.push((neighbours && rise.iter().all(|&rise| rise > -Self::DEEPEST)).then_some(peak));
            rises.push(rise);
        }
        for rise in rises.as_flattened_mut() {
            *rise = exp::<FUSED>(*rise);
        }
        Self { values, level, rises, peaks }
    }

    /// exp((G_q - (w_q - w_r)^2/2)/epsilon - F_r) of the nodes q of `entry`, for eight targets r in order; `highest`: the largest F_r.
    ///
    /// Of neighbours, w_q = w_0 + j h, it is a_j b_r d_r^j, which takes two exponentials instead of eight:
    ///
    ///   a_j = exp((G_q - (j h)^2/2 - L)/epsilon),   b_r = exp((L - (w_0 - w_r)^2/2)/epsilon - F_r),   d_r = exp(-(w_0 - w_r) h/epsilon),
    ///
    /// L being the largest G_q.
    #[inline(always)]
    fn factors<const FUSED: bool>(
        &self,
        kernel: &Gaussian,
        entry: usize,
        r: &Lanes,
        top: &Lanes,
        highest: f64,
    ) -> [Lanes; LANES] {
        let (cost, q) = (kernel.neighbour_cost, &self.values[entry]);
        let mut factors = [[0.0; LANES]; LANES];
        let far = max((q[0] - r[0]).abs(), (q[0] - r[LANES - 1]).abs());
        match self.peaks[entry] {
            Some(peak) if 2.0 * cost * far < Self::STEEPEST && highest - peak + cost * far * far < Self::FARTHEST => {
                let (mut power, mut ratio) = ([0.0; LANES], [0.0; LANES]);
                for lane in 0..LANES {
                    let distance = q[0] - r[lane];
                    power[lane] = exp::<FUSED>(fma::<FUSED>(-cost * distance, distance, peak - top[lane]));
                }
                for lane in 0..LANES {
                    ratio[lane] = exp::<FUSED>(-2.0 * cost * (q[0] - r[lane]));
                }
                for (factor, rise) in factors.iter_mut().zip(&self.rises[entry]) {
                    for lane in 0..LANES {
                        factor[lane] = rise * power[lane];
                    }
                    for lane in 0..LANES {
                        power[lane] *= ratio[lane];
                    }
                }
            }
            _ => {
                for ((factor, &q), &level) in factors.iter_mut().zip(q).zip(&self.level[entry]) {
                    for lane in 0..LANES {
                        factor[lane] = exp::<FUSED>(exponent::<FUSED>(kernel, q, level, r[lane]) - top[lane]);
                    }
                }
            }
        }
        factors
    }
}

/// (G_q - (w_q - w_r)^2/2)/epsilon for the multiples q and r of h.
#[inline(always)]
fn exponent<const FUSED: bool>(kernel: &Gaussian, q: f64, level: f64, r: f64) -> f64 {
    let distance = q - r;
    fma::<FUSED>(-kernel.neighbour_cost * distance, distance, level)
}

impl Band {
    /// F at the targets `r`; `largest` is filled.
    #[inline(always)]
    fn maxima<const FUSED: bool>(
        &mut self,
        kernel: &Gaussian,
        of: &Sources,
        sources: Range<usize>,
        r: &Lanes,
    ) -> Lanes {
        let mut top = [f64::NEG_INFINITY; LANES];
        self.largest.clear();
        for (q, level) in of.values[sources.clone()].iter().zip(&of.level[sources]) {
            let mut largest = [f64::NEG_INFINITY; LANES];
            for (&q, &level) in q.iter().zip(level) {
                for lane in 0..LANES {
                    largest[lane] = max(exponent::<FUSED>(kernel, q, level, r[lane]), largest[lane]);
                }
            }
            (0..LANES).for_each(|lane| top[lane] = max(top[lane], largest[lane]));
            self.largest.push(largest);
        }
        top
    }

    /// Finds the band of the targets `r` among the entries `sources`, and returns F.
    #[inline(always)]
    fn find<const FUSED: bool>(&mut self, kernel: &Gaussian, of: &Sources, sources: Range<usize>, r: &Lanes) -> Lanes {
        let top = self.maxima::<FUSED>(kernel, of, sources.clone(), r);
        let highest = top.into_iter().fold(f64::NEG_INFINITY, max);
        self.entries.clear();
        self.factors.clear();
        for (entry, largest) in sources.zip(&self.largest) {
            if (0..LANES).any(|lane| largest[lane] >= top[lane] - kernel.cut) {
                self.entries.push(entry);
                self.factors.extend_from_slice(&of.factors::<FUSED>(kernel, entry, r, &top, highest));
            }
        }
        top
    }

    /// The sums of the base nodes `base` of `values`, entries x `stride` base nodes, into `sums`.
    #[inline(always)]
    fn sum_rows<const FUSED: bool, const ROWS: usize>(&mut self, values: &[Lanes], stride: usize, base: &[u32]) {
        self.sums.clear();
        let (groups, rest) = base.as_chunks();
        for base in groups {
            let sums = self.sums_of::<FUSED, ROWS>(values, stride, base);
            self.sums.extend_from_slice(&sums);
        }
        // The last few take as long as ROWS of them: each addition waits for the one before it.
        if let Some(&last) = rest.last() {
            let mut padded = [last; ROWS];
            padded[..rest.len()].copy_from_slice(rest);
            let sums = self.sums_of::<FUSED, ROWS>(values, stride, &padded);
            self.sums.extend_from_slice(&sums[..rest.len()]);
        }
    }

    /// The sums of `ROWS` base nodes.
    #[inline(always)]
    fn sums_of<const FUSED: bool, const ROWS: usize>(
        &self,
        values: &[Lanes],
        stride: usize,
        base: &[u32; ROWS],
    ) -> [Lanes; ROWS] {
        let mut sums = [[0.0; LANES]; ROWS];
        let (blocks, _) = self.factors.as_chunks::<LANES>();
        for (&entry, factors) in self.entries.iter().zip(blocks) {
            let values = &values[entry * stride..][..stride];
            let values: [&Lanes; ROWS] = base.map(|p| &values[p as usize]);
            for node in 0..LANES {
                for row in 0..ROWS {
                    for lane in 0..LANES {
                        sums[row][lane] = fma::<FUSED>(values[row][node], factors[node][lane], sums[row][lane]);
                    }
                }
            }
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::graph::GraphGrid;
    use crate::metric::transport::lattice::Lattice;

    /// Two exponentials and products of them against eight exponentials, from the middle of a band to its end.
    #[test]
    fn factors_of_neighbours_are_exponentials() {
        let lattice = Lattice::new(GraphGrid::new(9, 9, 36).unwrap(), [4; 3], 0.05 / 3.0);
        let kernel = Gaussian::new(&lattice, 0.1, 0.05 * 0.05);
        let nodes = |first: f64, step: f64| std::array::from_fn(|lane| first + step * lane as f64);
        let values: [Lanes; 3] = [nodes(-40.0, 1.0), nodes(3.0, 1.0), nodes(17.0, 2.0)];
        let level: [Lanes; 3] = [nodes(-20.0, 0.5), nodes(-3.0, 0.7), nodes(-2.0, -0.1)];
        let sources = Sources::new::<PLAIN>(&kernel, &values, &level);
        assert_eq!(sources.peaks.iter().map(Option::is_some).collect::<Vec<_>>(), [true, true, false]);
        for r in [nodes(2.0, 1.0), nodes(-30.0, 1.5), nodes(21.0, -2.5)] {
            let mut band = Band::default();
            let top = band.maxima::<PLAIN>(&kernel, &sources, 0..3, &r);
            let highest = top.into_iter().fold(f64::NEG_INFINITY, max);
            for entry in 0..3 {
                let factors = sources.factors::<PLAIN>(&kernel, entry, &r, &top, highest);
                for (node, lane) in (0..LANES).flat_map(|node| (0..LANES).map(move |lane| (node, lane))) {
                    let distance = values[entry][node] - r[lane];
                    let expected = (level[entry][node] - kernel.neighbour_cost * distance * distance - top[lane]).exp();
                    let found = factors[node][lane];
                    assert!((found / expected - 1.0).abs() < 1e-12, "{entry} {node} {lane}: {found:e} {expected:e}");
                }
            }
        }
    }

    #[test]
    fn levels_that_fall_too_far_take_exponentials_of_their_own() {
        let lattice = Lattice::new(GraphGrid::new(9, 9, 36).unwrap(), [4; 3], 0.05 / 3.0);
        let kernel = Gaussian::new(&lattice, 0.1, 0.05 * 0.05);
        let values: [Lanes; 1] = [std::array::from_fn(|lane| lane as f64)];
        for (last, smooth) in [(-90.0, true), (-200.0, false), (f64::NEG_INFINITY, false)] {
            let mut level = [[0.0; LANES]];
            level[0][LANES - 1] = last;
            assert_eq!(Sources::new::<PLAIN>(&kernel, &values, &level).peaks[0].is_some(), smooth, "{last}");
        }
    }

    const PLAIN: bool = false;
}
