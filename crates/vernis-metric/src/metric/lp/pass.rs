//! The one pass over two BRDFs: blocks in parallel rows, added up in a fixed order.

use super::block::{Cells, Extent};
use super::kernel::{BlockSums, Work, Workspace};
use super::variant::{Formula, LpVariant};
use super::{EPSILON, POLAR, POLAR_CLAMPED};
use crate::metric::MetricError;
use rayon::prelude::*;

/// One entry a channel (or L*, a*, b*), for every formula.
type FormulaSums = [[f64; 3]; Formula::ALL.len()];

/// The summed terms of every formula over a range of polar angles, and the cells they come from.
#[derive(Debug, Clone, Default, PartialEq)]
struct RangeSums {
    /// Cells that are valid in both BRDFs.
    cells: u64,
    /// By form: as it is, cube root.
    terms: [FormulaSums; 2],
}

impl RangeSums {
    fn add(&mut self, other: &Self) {
        self.cells += other.cells;
        let terms = self.terms.iter_mut().flatten().flatten();
        terms.zip(other.terms.iter().flatten().flatten()).for_each(|(a, b)| *a += b);
    }
}

/// Sums over all polar angles and over those below 80 degrees.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Sums {
    all: RangeSums,
    clamped: RangeSums,
}

impl Sums {
    /// The sums that `work` asks for.
    pub fn over(reference: &dyn Cells, candidate: &dyn Cells, work: &Work) -> Result<Self, MetricError> {
        let row = |i| row(reference, candidate, work, i);
        let rows: Vec<Self> = (0..work.limit).into_par_iter().map(row).collect::<Result<_, _>>()?;
        let mut sums = Self::default();
        for row in &rows {
            sums.all.add(&row.all);
            sums.clamped.add(&row.clamped);
        }
        Ok(sums)
    }

    /// Cells that took part in `variant`.
    pub fn cells(&self, variant: LpVariant) -> u64 {
        self.range(variant).cells
    }

    /// The distance, of all channels together.
    pub fn distance(&self, variant: LpVariant) -> f64 {
        let [x, y, z] = self.terms(variant);
        variant.formula.of_mean((x + y + z) / self.cells(variant) as f64)
    }

    /// The distance of each channel alone.
    pub fn channels(&self, variant: LpVariant) -> [f64; 3] {
        self.terms(variant).map(|sum| variant.formula.of_mean(sum / self.cells(variant) as f64))
    }

    fn range(&self, variant: LpVariant) -> &RangeSums {
        if variant.clamped { &self.clamped } else { &self.all }
    }

    fn terms(&self, variant: LpVariant) -> [f64; 3] {
        self.range(variant).terms[usize::from(variant.cube_root)][variant.formula as usize]
    }
}

/// The sums of the row theta_i = `i` degrees.
fn row(reference: &dyn Cells, candidate: &dyn Cells, work: &Work, i: usize) -> Result<Sums, MetricError> {
    let mut space = Workspace::new();
    let mut sums = Sums::default();
    let mirrored = reference.is_mirror_symmetric() && candidate.is_mirror_symmetric();
    let extent = if mirrored { Extent::FOLDED } else { Extent::WHOLE };
    for o in 0..work.limit {
        if o == POLAR_CLAMPED && i < POLAR_CLAMPED {
            sums.clamped = sums.all.clone();
        }
        reference.read(i, o, extent, &mut space.reference)?;
        candidate.read(i, o, extent, &mut space.candidate)?;
        let weights = Weights::at(i, o);
        sums.all.cells += space.reference.mask(&mut space.candidate, extent);
        for (terms, block) in sums.all.terms.iter_mut().zip(space.sums(extent, weights.cosine, work)) {
            weights.add(&block, terms);
        }
    }
    if work.limit <= POLAR_CLAMPED {
        sums.clamped = sums.all.clone();
    }
    Ok(sums)
}

/// The weights of the formulas, which depend on the polar angles alone.
struct Weights {
    cos_i: f64,
    cos_o: f64,
    sin_o: f64,
    /// c(theta_i, theta_o) of D7, D8 and D9.
    cosine: f64,
}

impl Weights {
    fn at(i: usize, o: usize) -> Self {
        let degrees = |index: usize| index as f64 * (90.0 / POLAR as f64);
        let (sin_o, cos_o) = degrees(o).to_radians().sin_cos();
        let cos_i = degrees(i).to_radians().cos();
        Self { cos_i, cos_o, sin_o, cosine: (cos_i * cos_o).max(EPSILON) }
    }

    fn add(&self, block: &BlockSums, terms: &mut FormulaSums) {
        let cbrt_of_square = |x: f64| (x * x).cbrt();
        let terms_of = |formula| match formula {
            Formula::D1 => (1.0, &block.square),
            Formula::D2 => (self.cos_i * self.cos_i, &block.square),
            Formula::D3 => (cbrt_of_square(self.cos_i), &block.root),
            Formula::D4 => (self.cos_o * self.sin_o, &block.square),
            Formula::D5 => (1.0, &block.absolute),
            Formula::D6 => (self.cos_o * self.cos_i, &block.study_lab),
            Formula::D7 => (cbrt_of_square(self.cosine), &block.root),
            Formula::D8 => (1.0, &block.log),
            Formula::D9 => (1.0, &block.log_square),
            Formula::Lab => (self.cos_o * self.cos_i, &block.lab),
        };
        for formula in Formula::ALL {
            let (weight, sums) = terms_of(formula);
            for (term, sum) in terms[formula as usize].iter_mut().zip(sums) {
                *term += weight * sum;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Brdf;
    use crate::brdf::models::{Ggx, Ward, WardForm};
    use crate::math::{Rgb, Vec3};
    use crate::metric::lp::block::cells;

    /// Hides that a BRDF is its own mirror image.
    struct Whole<B>(B);

    impl<B: Brdf> Brdf for Whole<B> {
        fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
            self.0.eval(wi, wo)
        }
    }

    #[test]
    fn folded_pairs_have_the_sums_of_whole_ones() {
        let reference = Ggx::new([0.2, 0.1, 0.05], [0.04; 3], 0.1).unwrap();
        let candidate = Ward::new([0.2, 0.1, 0.05], [0.1; 3], 0.15, WardForm::Ward).unwrap();
        let work = Work::for_variants(LpVariant::every());
        let sums = |reference: &dyn Brdf, candidate: &dyn Brdf| {
            let (reference, candidate) =
                (cells(reference, "reference").unwrap(), cells(candidate, "candidate").unwrap());
            Sums::over(&*reference, &*candidate, &work).unwrap()
        };
        let folded = sums(&reference, &candidate);
        for whole in [sums(&Whole(reference), &Whole(candidate)), sums(&reference, &Whole(candidate))] {
            for variant in LpVariant::every() {
                assert_eq!(folded.cells(variant), whole.cells(variant));
                let (a, b) = (folded.distance(variant), whole.distance(variant));
                assert!((a - b).abs() <= 1e-12 * b, "{variant}: {a} {b}");
            }
        }
    }
}
