//! The value nodes of a source that matter to eight targets, and what each contributes: the innermost loops.

use super::super::elementary::{LANES, Lanes, exp, fma, max};
use super::gaussian::Gaussian;
use std::ops::Range;

/// The sources of eight targets.
#[derive(Default)]
pub(super) struct Band {
    /// The largest exponents of every entry looked at.
    pub largest: Vec<Lanes>,
    /// Entries that take part.
    pub entries: Vec<usize>,
    /// exp(exponent - F) of every source node of these.
    pub factors: Vec<Lanes>,
    /// The sums of every base node that was asked for.
    pub sums: Vec<Lanes>,
}

/// The value nodes of the source.
pub(super) struct Sources<'a> {
    /// Multiples of h.
    pub values: &'a [Lanes],
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
    pub fn new<const FUSED: bool>(kernel: &Gaussian, values: &'a [Lanes], level: &'a [Lanes]) -> Self {
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
    pub fn maxima<const FUSED: bool>(
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
    pub fn find<const FUSED: bool>(
        &mut self,
        kernel: &Gaussian,
        of: &Sources,
        sources: Range<usize>,
        r: &Lanes,
    ) -> Lanes {
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
    pub fn sum_rows<const FUSED: bool, const ROWS: usize>(&mut self, values: &[Lanes], stride: usize, base: &[u32]) {
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
    use super::super::lattice::Lattice;
    use super::*;
    use crate::metric::graph::GraphGrid;

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
