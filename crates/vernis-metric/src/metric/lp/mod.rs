//! The 36 Lp metrics of Lavoué et al. 2021, as the authors' program computes them, and a correct CIELAB beside them:
//! all of them in one pass over two BRDFs.
//!
//! With f_r and f_a (1/sr, linear RGB) the reference and the candidate at theta_i, theta_o = 0, 1 ... 89 degrees and
//! phi_d = 0, 1 ... 359 degrees, d = f_a - f_r, c = max(cos theta_i cos theta_o, 1e-3),
//! l = ln((f_r c + 1e-3)/(f_a c + 1e-3)), and mean = the sum over all cells *and channels*, divided by the number of
//! cells alone (90 * 90 * 360 when nothing is masked):
//!
//! | name | distance                      | name | distance                                          |
//! |------|-------------------------------|------|---------------------------------------------------|
//! | D1   | sqrt(mean d^2)                | D6   | sqrt(mean (dL^2 + da^2 + db^2) cos theta_o cos theta_i) |
//! | D2   | sqrt(mean (d cos theta_i)^2)  | D7   | mean cbrt((d c)^2)                                |
//! | D3   | sqrt(mean cbrt((d cos theta_i)^2)) | D8 | mean abs(l)                                     |
//! | D4   | sqrt(mean d^2 cos theta_o sin theta_o) | D9 | sqrt(mean l^2)                              |
//! | D5   | mean abs(d)                   | lab  | as D6, with the CIELAB of the CIE                 |
//!
//! `.Cl` (clamped) keeps the polar angles 0 to 79 degrees of both directions. `.CR` replaces f_r and f_a by their cube
//! roots before everything else; in D6 the program takes, instead, the (signed) cube root of L, a and b.
//!
//! Source: G. Lavoué, N. Bonneel, J.-P. Farrugia, C. Soler, "Perceptual quality of BRDF approximations: dataset and
//! metrics", Computer Graphics Forum 40(2), 2021, doi:10.1111/cgf.142636, section 6.1. The published correlations
//! come from the authors' program, which differs from the printed formulas, and so do we: D3, D7 and D9 use the roots
//! above instead of outer cube roots; N does not count the channels; D6 is not CIELAB (`kernel::study_lab` lists the
//! defects). `lab` is the CIELAB of the radiance factor pi f, so that a perfect white diffuser has L* = 100; its cube
//! root is that of the radiance factor.
//!
//! Cells that are invalid in either BRDF are left out: of the sums, and of the number by which they are divided. BRDFs
//! that are not tables on [`Grid::TITOPO`](crate::brdf::Grid::TITOPO) are evaluated at its cells: tables in f32, as they
//! are stored, everything else in f64.
//!
//! *Gradients* ([`PreparedMetric::gradient_at`](crate::metric::PreparedMetric::gradient_at)) are with respect to the candidate's values
//! at these cells, which are the nodes: 90 * 90 * 360 of them, clamped 80 * 80 * 360. D1 to D5 and D7 to D9 have one in all forms;
//! the colour differences have none. Where a formula has no derivative the gradient takes 0: |d| and cbrt(d^2) where both sides are
//! equal, the cube root of a black candidate, the outer root of a distance of 0. In every other place it is exact.
//!
//! Cost: one pass over 2 x 35 MB, about 50 roots and 6 logarithms a cell; rows of theta_i run in parallel and are
//! added up in order, so that the result has the same bits for any number of threads.

mod block;
mod elementary;
mod formula;
mod gradient;
mod kernel;
mod metric;
mod pass;
mod variant;

pub(crate) use formula::{CellFormula, Weights};
pub use metric::LpMetric;
pub use variant::{Formula, LpVariant, NotAnLpVariant};

use crate::brdf::Brdf;
use crate::metric::{MetricError, Side};
use block::Cells;
use kernel::Work;
use pass::Sums;

/// Of the numbers: it changes when a distance changes by more than rounding, and the golden values in the tests with it.
/// 2: BRDFs that are no tables are evaluated in f64.
pub const VERSION: &str = "2";

/// Family of these metrics.
pub const FAMILY: &str = "lp";

/// Cells along each polar angle, one degree apart.
pub(crate) const POLAR: usize = 90;
/// Cells along each polar angle that the clamped variants keep.
pub(crate) const POLAR_CLAMPED: usize = 80;
/// Cells along the azimuth difference, one degree apart.
pub(crate) const AZIMUTHS: usize = 360;
/// Keeps logarithms and the cosine weight away from zero.
const EPSILON: f64 = 1e-3;

/// A reference that has been evaluated, to be compared with many candidates: 24 MB for a reciprocal formula, 93 MB for a network,
/// 38 MB for a table.
pub struct LpReference {
    cells: Box<dyn Cells>,
}

impl LpReference {
    /// # Errors
    /// [`MetricError::Unusable`] where the BRDF has a value that is negative or not finite.
    pub fn new(reference: &dyn Brdf) -> Result<Self, MetricError> {
        Ok(Self { cells: block::owned_cells(reference, Side::Reference)? })
    }
}

/// Every Lp distance between two BRDFs.
#[derive(Debug, Clone, PartialEq)]
pub struct LpDistances {
    sums: Sums,
}

impl LpDistances {
    /// All variants, in one pass.
    ///
    /// # Errors
    /// [`MetricError::Unusable`] where a BRDF has a value that is negative or not finite,
    /// [`MetricError::NoCommonCell`] when no cell below 80 degrees is valid in both, [`MetricError::NotFinite`] when a
    /// sum overflows.
    pub fn between(reference: &dyn Brdf, candidate: &dyn Brdf) -> Result<Self, MetricError> {
        Self::of_variants(reference, candidate, LpVariant::every())
    }

    /// The 36 of the study alone, in one pass; errors as [`LpDistances::between`].
    pub fn of_study_between(reference: &dyn Brdf, candidate: &dyn Brdf) -> Result<Self, MetricError> {
        Self::of_variants(reference, candidate, LpVariant::of_study())
    }

    /// As [`LpDistances::of_study_between`], with a reference that is read once for many candidates.
    pub fn of_study_from(reference: &LpReference, candidate: &dyn Brdf) -> Result<Self, MetricError> {
        let variants: Vec<LpVariant> = LpVariant::of_study().collect();
        Ok(Self::of_variants_from(reference, &[candidate], &variants)?.swap_remove(0))
    }

    /// As [`LpDistances::of_study_from`] for several candidates in one pass, computing only what `variants` need; the values of others
    /// are unspecified.
    fn of_variants_from(
        reference: &LpReference,
        candidates: &[&dyn Brdf],
        variants: &[LpVariant],
    ) -> Result<Vec<Self>, MetricError> {
        let cells = candidates.iter().map(|candidate| block::cells(*candidate, Side::Candidate));
        let cells: Vec<Box<dyn Cells + '_>> = cells.collect::<Result<_, _>>()?;
        Self::of_cells(&*reference.cells, &cells.iter().map(|cells| &**cells).collect::<Vec<_>>(), variants)
    }

    fn of_variants(
        reference: &dyn Brdf,
        candidate: &dyn Brdf,
        variants: impl Iterator<Item = LpVariant>,
    ) -> Result<Self, MetricError> {
        let (reference, candidate) =
            (block::cells(reference, Side::Reference)?, block::cells(candidate, Side::Candidate)?);
        Ok(Self::of_cells(&*reference, &[&*candidate], &variants.collect::<Vec<_>>())?.swap_remove(0))
    }

    fn of_cells(
        reference: &dyn Cells,
        candidates: &[&dyn Cells],
        variants: &[LpVariant],
    ) -> Result<Vec<Self>, MetricError> {
        let checked = |sums: Sums| {
            for &variant in variants {
                metric::checked_distance(&sums, variant)?;
            }
            Ok(Self { sums })
        };
        let sums = Sums::over(reference, candidates, &Work::for_variants(variants.iter().copied()))?;
        sums.into_iter().map(checked).collect()
    }

    /// The distance of one variant.
    pub fn get(&self, variant: LpVariant) -> f64 {
        self.sums.distance(variant)
    }

    /// The distance called `name`, such as `D9.Cl`.
    pub fn by_name(&self, name: &str) -> Result<f64, NotAnLpVariant> {
        name.parse().map(|variant| self.get(variant))
    }

    /// The distance of each channel alone (R, G, B); `None` for colour differences, which have none.
    ///
    /// The sums of the channels add up to that of [`LpDistances::get`]: D1^2 is the sum of the three D1^2, D5 that of
    /// the three D5.
    pub fn channels(&self, variant: LpVariant) -> Option<[f64; 3]> {
        variant.formula.has_channels().then(|| self.sums.channels(variant))
    }

    /// The study's 36 distances, in the order of [`LpVariant::of_study`].
    pub fn of_study(&self) -> impl Iterator<Item = (LpVariant, f64)> {
        LpVariant::of_study().map(|variant| (variant, self.get(variant)))
    }

    /// The cells that took part in `variant`: 90 * 90 * 360 (clamped 80 * 80 * 360) when nothing is masked.
    pub fn cells(&self, variant: LpVariant) -> u64 {
        self.sums.cells(variant)
    }
}
