//! The squared kernel distance of one channel, and its gradient.

use super::direct::Points;
use super::lattice::{Lattice, Resolution};
use super::mixture::{Kernel, Mixture, Term};
use crate::metric::graph::{CommonCells, GraphGrid, Tone};

/// How a channel is compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Setting {
    pub kernel: Kernel,
    pub alpha: f64,
    pub tone: Tone,
}

/// Nodes along each polar axis.
const POLAR: (usize, usize) = (12, 24);
/// Nodes of the lattice, about: more along the base where fewer values are.
const SIZE: usize = 1_000_000;
/// The value nodes lie alpha/FINENESS apart,
const FINENESS: f64 = 16.0;
/// or blur/BLURRED,
const BLURRED: f64 = 6.0;
/// or as far as this, whichever is least: directions alone do not tell how fine the values are.
const COARSEST: f64 = 0.0125;
/// Value nodes; limits the memory of a channel to about 70 MB.
const MOST_VALUES: usize = 2400;
/// Standard deviation of the narrowest Gaussian, in the distance of nodes that the lattice resolves.
const NARROWEST: f64 = 0.35;
/// The same, in the distance of value nodes.
const NARROWEST_IN_VALUE: f64 = 0.25;
/// Up to so many cells, all pairs are summed.
pub(super) const DIRECT: usize = 4000;

/// Both sides of one channel, toned.
pub(super) struct Pair<'a> {
    grid: GraphGrid,
    common: &'a CommonCells,
    tone: Tone,
    form: Form,
}

enum Form {
    Direct(Points),
    Lattice(Box<OnLattice>),
}

impl<'a> Pair<'a> {
    /// `reference` and `candidate` are f cos theta_i, one a cell. `direct` sums over all pairs of cells.
    pub fn new(
        setting: Setting,
        reference: &[f64],
        candidate: &[f64],
        grid: GraphGrid,
        common: &'a CommonCells,
        direct: bool,
    ) -> Self {
        let Setting { kernel, alpha, tone } = setting;
        let toned = |plane: &[f64]| plane.iter().map(|t| tone.value(*t)).collect::<Vec<f64>>();
        let (a, b) = (toned(reference), toned(candidate));
        let form = match direct {
            true => Form::Direct(Points::new(kernel, alpha, &a, &b, grid, common)),
            false => Form::Lattice(Box::new(OnLattice::new(kernel, alpha, a, b, grid, common))),
        };
        Self { grid, common, tone, form }
    }

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

/// The difference of both sides on a lattice, and what the lattice does not resolve.
struct OnLattice {
    a: Vec<f64>,
    b: Vec<f64>,
    mixture: Mixture,
    lattice: Lattice,
    remainder: Remainder,
}

impl OnLattice {
    fn new(kernel: Kernel, alpha: f64, a: Vec<f64>, b: Vec<f64>, grid: GraphGrid, common: &CommonCells) -> Self {
        let mut h = (alpha / FINENESS).min(COARSEST);
        if let Kernel::Gaussian { blur } | Kernel::Laplacian { blur } = kernel {
            h = h.min(blur / BLURRED);
        }
        let resolution = Resolution { polar: POLAR, size: SIZE, h, most: MOST_VALUES };
        let lattice = Lattice::new(&a, &b, grid, common, alpha, resolution);
        let mixture =
            Mixture::new(kernel, (NARROWEST * lattice.resolves()).max(NARROWEST_IN_VALUE * h), lattice.diameter());
        let remainder = Remainder::new(&mixture, &lattice.seen(&mixture.terms));
        Self { a, b, mixture, lattice, remainder }
    }

    /// N^2 times the squared distance.
    fn sum(&self, cells: impl Iterator<Item = usize>) -> f64 {
        let (mut own, mut shift) = (0.0, 0.0);
        for (a, b) in cells.map(|cell| (self.a[cell], self.b[cell])) {
            own += self.remainder.at((a - b).abs()).0;
            shift += a - b;
        }
        // Both sides have the same base: only the values have different means.
        0.5 * self.lattice.form(&self.mixture) + own + self.mixture.tail * shift * shift
    }

    /// The derivatives of [`OnLattice::sum`] with respect to the candidate's values.
    fn slopes(&self, grid: GraphGrid, common: &CommonCells) -> Vec<(usize, f64)> {
        let [_, n_o, n_d] = grid.shape();
        let potential = self.lattice.potential(&self.mixture);
        let shift: f64 = cells(grid, common).map(|cell| self.a[cell] - self.b[cell]).sum();
        let slope = |cell: usize| {
            let (a, b) = (self.a[cell], self.b[cell]);
            let place = [cell / (n_o * n_d), cell / n_d % n_o, cell % n_d];
            let own = self.remainder.at((a - b).abs()).1;
            let own = if a == b { 0.0 } else { own * (b - a).signum() };
            (cell, own - self.lattice.slope(&potential, place, b) - 2.0 * self.mixture.tail * shift)
        };
        cells(grid, common).map(slope).collect()
    }
}

/// What the lattice does not resolve of the pair that one cell of both sides forms, tabulated.
struct Remainder {
    step: f64,
    /// Value and slope at multiples of the step.
    nodes: Vec<(f64, f64)>,
    /// The value further away.
    far: f64,
}

/// Intervals of the table.
const INTERVALS: usize = 512;
/// Where the remainder has become constant, in standard deviations of the narrowest term.
const FAR: f64 = 7.0;

impl Remainder {
    /// `seen` are the terms of the mixture as such a pair sees them.
    fn new(mixture: &Mixture, seen: &[Term]) -> Self {
        let narrowest = seen.first().map_or(1.0, |t| (0.5 / t.s).sqrt());
        let step = FAR * narrowest / INTERVALS as f64;
        let nodes: Vec<_> = (0..=INTERVALS).map(|k| mixture.remainder(seen, k as f64 * step)).collect();
        let far = nodes[INTERVALS].0;
        Self { step, nodes, far }
    }

    /// Value and slope of the cubic through both at the nodes (Hermite).
    fn at(&self, r: f64) -> (f64, f64) {
        let x = r / self.step;
        let below = x as usize;
        if below >= INTERVALS {
            return (self.far, 0.0);
        }
        let t = x - below as f64;
        let ((v0, s0), (v1, s1)) = (self.nodes[below], self.nodes[below + 1]);
        let (d0, d1) = (s0 * self.step, s1 * self.step);
        let (c2, c3) = (3.0 * (v1 - v0) - 2.0 * d0 - d1, 2.0 * (v0 - v1) + d0 + d1);
        let value = v0 + t * (d0 + t * (c2 + t * c3));
        let slope = (d0 + t * (2.0 * c2 + 3.0 * t * c3)) / self.step;
        (value, slope)
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

    fn divergence(setting: Setting, a: &CosineTable, b: &CosineTable, direct: bool) -> f64 {
        let common = a.common_cells(b, "energy").unwrap();
        Pair::new(setting, a.channel(0), b.channel(0), a.grid(), &common, direct).divergence()
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
            let found = Pair::new(near, &black, &values, grid, &common, direct).divergence();
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
            let at = |values: &[f64]| Pair::new(setting, a.channel(0), values, grid, &common, direct);
            let gradient = at(b.channel(0)).gradient(b.channel(0));
            let largest = gradient.iter().fold(0.0f64, |m, g| m.max(g.abs()));
            for cell in (0..grid.len()).step_by(37) {
                let step = 1e-6 * b.channel(0)[cell];
                let moved = |by: f64| {
                    let mut values = b.channel(0).to_vec();
                    values[cell] += by;
                    at(&values).divergence()
                };
                let difference = (moved(step) - moved(-step)) / (2.0 * step);
                let error = (gradient[cell] - difference).abs();
                assert!(error < 1e-4 * largest, "{direct} {kernel:?} {cell}: {} {difference}", gradient[cell]);
            }
        }
    }
}
