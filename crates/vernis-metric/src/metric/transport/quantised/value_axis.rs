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

use super::super::elementary::{LANES, LARGEST_ARGUMENT, Lanes, exp, fma, ln, max};
use super::band::{Band, Sources};
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
    ///
    /// Out of line: between its calls of sine and cosine, no vector register would keep what the loops around it have there.
    #[inline(never)]
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
