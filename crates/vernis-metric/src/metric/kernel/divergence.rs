//! The squared kernel distance of one channel, and its gradient.

use super::direct::Points;
use super::lanes::{LANES, squares};
use super::mixture::{Kernel, Mixture, Term};
use super::plan::Plan;
use super::side::{Field, Side, potential};
use super::splat::slopes;
use crate::math::parallel;
use crate::metric::graph::{CommonCells, GraphGrid, Tone};
use std::borrow::Cow;

/// How a channel is compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Setting {
    pub kernel: Kernel,
    pub alpha: f64,
    pub tone: Tone,
}

/// Up to so many cells, all pairs are summed.
pub(super) const DIRECT: usize = 4000;

/// One side of one channel.
#[derive(Debug, Clone)]
pub(super) struct Channel {
    /// phi of the values, one a cell.
    values: Vec<f64>,
    /// None for few cells.
    side: Option<Side>,
}

/// All channels of one side.
#[derive(Debug, Clone)]
pub(super) struct Channels {
    setting: Setting,
    grid: GraphGrid,
    plan: Plan,
    own: CommonCells,
    pub channels: Vec<Channel>,
}

impl Channels {
    /// `planes` are f cos theta_i of each channel, one a cell of `grid`, `own` the cells that are measured. `direct` leaves the lattice
    /// out.
    pub fn new(setting: Setting, planes: &[&[f64]], grid: GraphGrid, own: CommonCells, direct: bool) -> Self {
        let mut plan = Plan::new(setting.kernel, setting.alpha, grid);
        let toned = |plane: &[f64]| plane.iter().map(|t| setting.tone.value(*t)).collect::<Vec<f64>>();
        let values = parallel::map(planes.len(), |c| toned(planes[c]));
        if !direct {
            let of_cells =
                |values: &Vec<f64>| cells(grid, &own).fold(0.0f64, |most, cell| most.max(values[cell].abs()));
            // No two sides are further apart than twice the larger of both.
            plan.extend(plan.count(2.0 * values.iter().map(of_cells).fold(0.0, f64::max)));
        }
        let side = |c: usize| (!direct).then(|| Side::new(&plan, &values[c], grid, &own));
        let sides = parallel::map(values.len(), side);
        let channels = values.into_iter().zip(sides).map(|(values, side)| Channel { values, side }).collect();
        Self { setting, grid, plan, own, channels }
    }
}

/// What the channels of a comparison share.
pub(super) struct Comparison<'a> {
    setting: Setting,
    grid: GraphGrid,
    common: &'a CommonCells,
    sides: [&'a Channels; 2],
    /// None where all pairs are summed.
    lattice: Option<(&'a Plan, Mixture, Remainder)>,
}

impl<'a> Comparison<'a> {
    /// Of the cells in `common`. `direct` sums over all pairs of cells.
    pub fn new(reference: &'a Channels, candidate: &'a Channels, common: &'a CommonCells, direct: bool) -> Self {
        let longer = if candidate.plan.steps.len() > reference.plan.steps.len() { candidate } else { reference };
        let lattice = (!direct).then(|| {
            let mixture = longer.plan.mixture(longer.plan.steps.len());
            let remainder = Remainder::new(&mixture, &longer.plan.seen(&mixture.terms));
            (&longer.plan, mixture, remainder)
        });
        let Channels { setting, grid, .. } = *reference;
        Self { setting, grid, common, sides: [reference, candidate], lattice }
    }

    pub fn pair(&self, channel: usize) -> Pair<'_> {
        let [a, b] = self.sides.map(|side| &side.channels[channel]);
        let Setting { kernel, alpha, .. } = self.setting;
        let form = match &self.lattice {
            None => Form::Direct(Points::new(kernel, alpha, &a.values, &b.values, self.grid, self.common)),
            Some((plan, mixture, remainder)) => {
                let side = |channels: &'a Channels| {
                    let channel = &channels.channels[channel];
                    match &channel.side {
                        Some(side) if channels.own.count() == self.common.count() => {
                            Fields { side: Cow::Borrowed(side), more: side.more(plan, plan.steps.len()) }
                        }
                        _ => {
                            let side = Cow::Owned(Side::new(plan, &channel.values, self.grid, self.common));
                            Fields { side, more: None }
                        }
                    }
                };
                let sides = self.sides.map(side);
                Form::Lattice(Box::new(OnLattice { a: &a.values, b: &b.values, sides, plan, mixture, remainder }))
            }
        };
        Pair { grid: self.grid, common: self.common, tone: self.setting.tone, form }
    }
}

/// Both sides of one channel.
pub(super) struct Pair<'a> {
    grid: GraphGrid,
    common: &'a CommonCells,
    tone: Tone,
    form: Form<'a>,
}

enum Form<'a> {
    Direct(Points),
    Lattice(Box<OnLattice<'a>>),
}

impl Pair<'_> {
    /// 1/2 <a - b, K (a - b)>.
    pub fn divergence(&self) -> f64 {
        let n = self.common.count() as f64;
        let sum = match &self.form {
            Form::Direct(points) => points.sum(),
            Form::Lattice(lattice) => lattice.sum(cells(self.grid, self.common)),
        };
        // A form of positive kernels: below zero by rounding alone. `max` would hide a NaN.
        let divergence = sum / (n * n);
        if divergence < 0.0 { 0.0 } else { divergence }
    }

    /// The derivatives of [`Pair::divergence`] with respect to the candidate's f cos theta_i, which is given, one a cell; 0
    /// for cells that take no part.
    pub fn gradient(&self, candidate: &[f64]) -> Vec<f64> {
        let n = self.common.count() as f64;
        let mut gradient = vec![0.0; self.grid.len()];
        let slopes = match &self.form {
            Form::Direct(points) => points.slopes(),
            Form::Lattice(lattice) => lattice.slopes(self.grid, self.common),
        };
        for (cell, slope) in slopes {
            gradient[cell] = slope * self.tone.derivative(candidate[cell]) / (n * n);
        }
        gradient
    }
}

fn cells(grid: GraphGrid, common: &CommonCells) -> impl Iterator<Item = usize> + '_ {
    (0..grid.len()).filter(|cell| common.contains(*cell))
}

/// A side with the Gaussians of the other's plan, which may be more.
struct Fields<'a> {
    side: Cow<'a, Side>,
    more: Option<Side>,
}

impl Fields<'_> {
    fn field(&self, k: usize) -> &Field {
        match &self.more {
            Some(more) if k >= self.side.count() => more.field(k),
            _ => self.side.field(k),
        }
    }

    fn entries(&self) -> &[i64] {
        self.side.entries()
    }
}

/// Both sides on the lattice, and what the lattice does not resolve.
struct OnLattice<'a> {
    a: &'a [f64],
    b: &'a [f64],
    sides: [Fields<'a>; 2],
    plan: &'a Plan,
    mixture: &'a Mixture,
    remainder: &'a Remainder,
}

impl OnLattice<'_> {
    /// N^2 times the squared distance.
    fn sum(&self, cells: impl Iterator<Item = usize>) -> f64 {
        let (mut own, mut shift) = (0.0, 0.0);
        for (a, b) in cells.map(|cell| (self.a[cell], self.b[cell])) {
            own += self.remainder.value((a - b).abs());
            shift += a - b;
        }
        let [a, b] = &self.sides;
        let form = |(k, step): (usize, &super::plan::Step)| {
            let zeros = vec![[0.0; LANES]; a.field(k).width];
            let entries = a.field(k).pairs(b.field(k));
            let of_entry =
                |(_, a, b): (i64, Option<&[_]>, Option<&[_]>)| squares(a.unwrap_or(&zeros), b.unwrap_or(&zeros));
            step.weight * entries.map(of_entry).sum::<f64>()
        };
        let form: f64 = self.plan.steps.iter().enumerate().map(form).sum();
        // Both sides have the same base: only the values have different means.
        0.5 * form + own + self.mixture.tail * shift * shift
    }

    /// The derivatives of [`OnLattice::sum`] with respect to the candidate's values.
    fn slopes(&self, grid: GraphGrid, common: &CommonCells) -> Vec<(usize, f64)> {
        let [a, b] = &self.sides;
        let differences: Vec<_> = (0..self.plan.steps.len()).map(|k| a.field(k).minus(b.field(k))).collect();
        let potential = potential(self.plan, &differences, b.entries());
        let shift: f64 = cells(grid, common).map(|cell| self.a[cell] - self.b[cell]).sum();
        let mut found = slopes(self.plan, &potential, self.b, grid, common);
        for (cell, slope) in &mut found {
            let (a, b) = (self.a[*cell], self.b[*cell]);
            let own = if a == b { 0.0 } else { self.remainder.slope((a - b).abs()) * (b - a).signum() };
            *slope = own - *slope - 2.0 * self.mixture.tail * shift;
        }
        found
    }
}

/// What the lattice does not resolve of the pair that one cell of both sides forms, tabulated.
struct Remainder {
    /// Intervals a unit of length.
    per_unit: f64,
    /// The cubic of each interval, in powers of the way through it.
    cubics: Vec<[f64; 4]>,
    /// The value further away.
    far: f64,
}

/// Intervals of the table.
const INTERVALS: usize = 512;
/// Where the remainder has become constant, in standard deviations of the narrowest term.
const FAR: f64 = 7.0;

impl Remainder {
    /// `seen` are the terms of the mixture as such a pair sees them. The cubic takes value and slope at both ends (Hermite).
    fn new(mixture: &Mixture, seen: &[Term]) -> Self {
        let narrowest = seen.first().map_or(1.0, |t| (0.5 / t.s).sqrt());
        let step = FAR * narrowest / INTERVALS as f64;
        let nodes: Vec<_> = (0..=INTERVALS).map(|k| mixture.remainder(seen, k as f64 * step)).collect();
        let cubic = |ends: &[(f64, f64)]| {
            let ((v0, s0), (v1, s1)) = (ends[0], ends[1]);
            let (d0, d1) = (s0 * step, s1 * step);
            [v0, d0, 3.0 * (v1 - v0) - 2.0 * d0 - d1, 2.0 * (v0 - v1) + d0 + d1]
        };
        Self { per_unit: 1.0 / step, cubics: nodes.windows(2).map(cubic).collect(), far: nodes[INTERVALS].0 }
    }

    /// The cubic of the interval that holds r, and the way through it; none further away.
    #[inline(always)]
    fn at(&self, r: f64) -> Option<(&[f64; 4], f64)> {
        let x = r * self.per_unit;
        self.cubics.get(x as usize).map(|cubic| (cubic, x - (x as usize) as f64))
    }

    #[inline(always)]
    fn value(&self, r: f64) -> f64 {
        self.at(r).map_or(self.far, |([c0, c1, c2, c3], t)| c0 + t * (c1 + t * (c2 + t * c3)))
    }

    #[inline(always)]
    fn slope(&self, r: f64) -> f64 {
        self.at(r).map_or(0.0, |([_, c1, c2, c3], t)| (c1 + t * (2.0 * c2 + 3.0 * t * c3)) * self.per_unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Brdf;
    use crate::brdf::models::{BlinnPhong, Ggx, Lambert, Ward, WardForm};
    use crate::metric::Side;
    use crate::metric::graph::CosineTable;

    const ENERGY: Setting = Setting { kernel: Kernel::Energy, alpha: 0.1, tone: Tone::Cbrt };

    fn ggx(kd: f64, f0: f64, alpha: f64) -> Box<dyn Brdf> {
        Box::new(Ggx::new([kd; 3], [f0; 3], alpha).unwrap())
    }

    fn lambert(kd: f64) -> Box<dyn Brdf> {
        Box::new(Lambert::new([kd; 3]).unwrap())
    }

    fn table(brdf: &dyn Brdf, grid: &str) -> CosineTable {
        CosineTable::of(brdf, grid.parse().unwrap(), Side::Reference).unwrap()
    }

    fn channels(setting: Setting, plane: &[f64], grid: GraphGrid, own: &CommonCells, direct: bool) -> Channels {
        Channels::new(setting, &[plane], grid, own.clone(), direct)
    }

    fn divergence(setting: Setting, a: &CosineTable, b: &CosineTable, direct: bool) -> f64 {
        let common = a.common_cells(b, "energy").unwrap();
        let sides = [a, b].map(|side| channels(setting, side.channel(0), side.grid(), &common, direct));
        Comparison::new(&sides[0], &sides[1], &common, direct).pair(0).divergence()
    }

    /// Direct sums over all pairs, by an independent program in C with f64, GGX (kd, f0, alpha) of the golden file.
    #[test]
    fn agrees_with_sums_over_all_pairs_of_the_study_grid() {
        let a = table(&*ggx(0.2, 0.04, 0.1), "45x45x180");
        let b = table(&*ggx(0.2, 0.04, 0.12), "45x45x180");
        let found = divergence(ENERGY, &a, &b, false);
        assert!((found / 1.4453284107e-5 - 1.0).abs() < 2e-3, "{found}");
    }

    #[test]
    fn the_direct_sum_is_the_definition() {
        // As above, 6x6x24: rough GGX, GGX beside Blinn-Phong.
        let found =
            divergence(ENERGY, &table(&*ggx(0.2, 0.04, 0.1), "6x6x24"), &table(&*ggx(0.2, 0.04, 0.12), "6x6x24"), true);
        assert!((found / 1.9153028985e-5 - 1.0).abs() < 1e-9, "{found}");
        let blinn = BlinnPhong::new([0.05; 3], [0.08; 3], 40.0).unwrap();
        let found = divergence(ENERGY, &table(&*ggx(0.05, 0.04, 0.3), "6x6x24"), &table(&blinn, "6x6x24"), true);
        assert!((found / 6.5114747572e-3 - 1.0).abs() < 1e-9, "{found}");
    }

    #[test]
    fn the_lattice_agrees_with_the_direct_sum() {
        let ward = Ward::new([0.01; 3], [0.9; 3], 0.22, WardForm::Ward).unwrap();
        type Named = (&'static str, Box<dyn Brdf>, Box<dyn Brdf>);
        let pairs: [Named; 6] = [
            ("rougher", ggx(0.2, 0.04, 0.1), ggx(0.2, 0.04, 0.12)),
            ("metal", ggx(0.01, 0.9, 0.02), ggx(0.01, 0.9, 0.03)),
            ("near", ggx(0.2, 0.1, 0.2), ggx(0.2, 0.1, 0.2002)),
            ("diffuse", lambert(0.2), lambert(0.3)),
            ("nearly diffuse", lambert(0.2), lambert(0.2001)),
            ("ward", ggx(0.0, 1.0, 0.2), Box::new(ward)),
        ];
        let settings = [
            ENERGY,
            Setting { tone: Tone::FourthRoot, ..ENERGY },
            Setting { alpha: 1.0, ..ENERGY },
            Setting { kernel: Kernel::Laplacian { blur: 0.05 }, ..ENERGY },
            Setting { kernel: Kernel::Gaussian { blur: 0.05 }, ..ENERGY },
        ];
        for (name, a, b) in &pairs {
            let (a, b) = (table(a.as_ref(), "10x10x32"), table(b.as_ref(), "10x10x32"));
            for setting in settings {
                let exact = divergence(setting, &a, &b, true);
                let found = divergence(setting, &a, &b, false);
                let most = if matches!(setting.kernel, Kernel::Laplacian { .. }) { 0.03 } else { 0.01 };
                assert!((found / exact - 1.0).abs() < most, "{name} {setting:?}: {found:e} {exact:e}");
            }
        }
    }

    #[test]
    fn a_shift_of_one_value_costs_its_length() {
        // Two Diracs (all cells black but for the candidate's constant): E = |shift| less the spread of the base.
        for direct in [true, false] {
            let near = Setting { alpha: 1e-3, tone: Tone::Linear, kernel: Kernel::Energy };
            let values = vec![0.25; 4 * 4 * 16];
            let grid: GraphGrid = "4x4x16".parse().unwrap();
            let a = table(&*lambert(0.5), "4x4x16");
            let common = a.common_cells(&a, "energy").unwrap();
            let black = vec![0.0; values.len()];
            let sides = [&black, &values].map(|plane| channels(near, plane, grid, &common, direct));
            let found = Comparison::new(&sides[0], &sides[1], &common, direct).pair(0).divergence();
            assert!((found / 0.25 - 1.0).abs() < 5e-3, "{found}");
        }
    }

    #[test]
    fn identical_is_zero_and_order_does_not_matter() {
        let (a, b) = (table(&*ggx(0.1, 0.04, 0.3), "20x20x40"), table(&*ggx(0.2, 0.04, 0.2), "20x20x40"));
        assert_eq!(divergence(ENERGY, &a, &a, false), 0.0);
        assert_eq!(divergence(ENERGY, &a, &a, true), 0.0);
        let (ab, ba) = (divergence(ENERGY, &a, &b, false), divergence(ENERGY, &b, &a, false));
        assert!((ab / ba - 1.0).abs() < 1e-12);
    }

    /// The lattice's value is smooth but where a value crosses a node; steps stay clear of that.
    #[test]
    fn gradients_are_those_of_the_value() {
        let grid: GraphGrid = "5x6x16".parse().unwrap();
        let a = table(&*ggx(0.2, 0.04, 0.3), "5x6x16");
        let b = table(&*ggx(0.15, 0.05, 0.35), "5x6x16");
        let common = a.common_cells(&b, "energy").unwrap();
        let kernels = [Kernel::Energy, Kernel::Gaussian { blur: 0.05 }, Kernel::Laplacian { blur: 0.05 }];
        for (direct, kernel) in [true, false].into_iter().flat_map(|d| kernels.map(|k| (d, k))) {
            let setting = Setting { kernel, ..ENERGY };
            let side = |plane: &[f64]| channels(setting, plane, grid, &common, direct);
            let reference = side(a.channel(0));
            let candidate = side(b.channel(0));
            let gradient = Comparison::new(&reference, &candidate, &common, direct).pair(0).gradient(b.channel(0));
            let largest = gradient.iter().fold(0.0f64, |m, g| m.max(g.abs()));
            for cell in (0..grid.len()).step_by(37) {
                let step = 1e-6 * b.channel(0)[cell];
                let moved = |by: f64| {
                    let mut values = b.channel(0).to_vec();
                    values[cell] += by;
                    Comparison::new(&reference, &side(&values), &common, direct).pair(0).divergence()
                };
                let difference = (moved(step) - moved(-step)) / (2.0 * step);
                let error = (gradient[cell] - difference).abs();
                assert!(error < 1e-4 * largest, "{direct} {kernel:?} {cell}: {} {difference}", gradient[cell]);
            }
        }
    }
}
