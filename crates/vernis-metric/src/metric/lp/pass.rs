//! The one pass over a reference and its candidates: blocks in parallel rows, added up in a fixed order.
//!
//! What a block of the reference needs alone (cube roots, colour coordinates: a third of the work of a pair) is computed once for all
//! candidates. The sums are those of a pass for each candidate alone, to the last bit. Of BRDFs that are reciprocal and their own mirror
//! images, the block at (theta_i, theta_o) stands for the one at (theta_o, theta_i) too: half of the evaluations and sums.

use super::POLAR_CLAMPED;
use super::block::{Cells, Extent};
use super::formula::Weights;
use super::kernel::{BlockSums, ReferenceSide, Work, Workspace};
use super::variant::{Formula, LpVariant};
use crate::math::parallel;
use crate::metric::MetricError;

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
    /// The sums that `work` asks for, one element a candidate.
    ///
    /// # Errors
    /// The first value that cannot be compared, in the order of the cells and then of the candidates.
    pub fn over(reference: &dyn Cells, candidates: &[&dyn Cells], work: &Work) -> Result<Vec<Self>, MetricError> {
        let row = |i| row(reference, candidates, work, i);
        let rows = parallel::try_map(work.limit, row)?;
        let mut sums = vec![Self::default(); candidates.len()];
        for row in &rows {
            for (sums, row) in sums.iter_mut().zip(row) {
                sums.all.add(&row.all);
                sums.clamped.add(&row.clamped);
            }
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

/// The reference in one extent, read and prepared where a candidate of the block first needs it.
struct Side {
    extent: Extent,
    reference: Box<ReferenceSide>,
    read: bool,
    prepared: bool,
}

impl Side {
    fn new(extent: Extent) -> Self {
        Self { extent, reference: ReferenceSide::new(), read: false, prepared: false }
    }

    /// Before the next block.
    fn forget(&mut self) {
        (self.read, self.prepared) = (false, false);
    }

    fn read(&mut self, cells: &dyn Cells, i: usize, o: usize) -> Result<(), MetricError> {
        if !self.read {
            cells.read(i, o, self.extent, &mut self.reference.block)?;
            self.reference.block.blacken(self.extent);
            self.read = true;
        }
        Ok(())
    }

    fn prepare(&mut self, work: &Work) {
        if !self.prepared {
            self.reference.prepare(self.extent, work);
            self.prepared = true;
        }
    }
}

/// The sums of the row theta_i = `i` degrees, one element a candidate.
fn row(reference: &dyn Cells, candidates: &[&dyn Cells], work: &Work, i: usize) -> Result<Vec<Sums>, MetricError> {
    let mut space = Workspace::new();
    let mut found = vec![Sums::default(); candidates.len()];
    let (mut whole, mut folded) = (Side::new(Extent::WHOLE), Side::new(Extent::FOLDED));
    // For candidates that lack cells of the reference.
    let mut fewer = ReferenceSide::new();
    for o in 0..work.limit {
        whole.forget();
        folded.forget();
        let (weights, of_exchanged) = (Weights::at(i, o), Weights::at(o, i));
        for (sums, candidate) in found.iter_mut().zip(candidates) {
            if o == POLAR_CLAMPED && i < POLAR_CLAMPED {
                sums.clamped = sums.all.clone();
            }
            // One block then stands for (i, o) and (o, i): their sums before the weights are the same.
            let exchangeable = reference.is_exchangeable() && candidate.is_exchangeable();
            if exchangeable && o < i {
                continue;
            }
            let exchanged = exchangeable && o > i;
            let mirrored = reference.is_mirror_symmetric() && candidate.is_mirror_symmetric();
            let side = if mirrored { &mut folded } else { &mut whole };
            let extent = side.extent;
            side.read(reference, i, o)?;
            candidate.read(i, o, extent, &mut space.candidate)?;
            let (count, side) = match space.candidate.mask_within(&side.reference.block, extent) {
                Some(count) => {
                    side.prepare(work);
                    (count, &side.reference)
                }
                None => {
                    fewer.block = side.reference.block.clone();
                    let count = fewer.block.mask(&mut space.candidate, extent);
                    fewer.prepare(extent, work);
                    (count, &fewer)
                }
            };
            sums.all.cells += if exchanged { 2 * count } else { count };
            for (terms, block) in sums.all.terms.iter_mut().zip(space.sums(side, extent, weights.cosine, work)) {
                add(&block, &weights, terms);
                if exchanged {
                    add(&block, &of_exchanged, terms);
                }
            }
        }
    }
    if work.limit <= POLAR_CLAMPED {
        found.iter_mut().for_each(|sums| sums.clamped = sums.all.clone());
    }
    Ok(found)
}

/// Adds the weighted sums of a block to the terms of every formula.
fn add(block: &BlockSums, weights: &Weights, terms: &mut FormulaSums) {
    for formula in Formula::ALL {
        let weight = weights.of(formula);
        for (term, sum) in terms[formula as usize].iter_mut().zip(block.of(formula)) {
            *term += weight * sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Brdf;
    use crate::brdf::models::{Ggx, Ward, WardForm};
    use crate::math::color::cielab;
    use crate::math::seed::stream;
    use crate::math::{Rgb, Vec3};
    use crate::metric::Side;
    use crate::metric::lp::block::{Block, cells, owned_cells};
    use crate::metric::lp::formula::CellFormula;
    use crate::metric::lp::kernel::{STUDY_XYZ, study_lab};
    use crate::metric::lp::{AZIMUTHS, EPSILON, POLAR};
    use rand::Rng;
    use std::f64::consts::PI;

    /// Random values of many sizes, some of them zero, a tenth of the cells missing.
    struct Noise(u64);

    impl Noise {
        fn at(&self, i: usize, o: usize) -> Vec<Option<Rgb>> {
            let mut rng = stream(self.0, "noise", (i * POLAR + o) as u64);
            let mut value = || if rng.random_bool(0.1) { 0.0 } else { 10f64.powf(rng.random_range(-4.0..3.0)) };
            let mut cell = || [value(), value(), value()];
            (0..AZIMUTHS).map(|k| (k % 10 != self.0 as usize).then(&mut cell)).collect()
        }
    }

    impl Cells for Noise {
        fn read(&self, i: usize, o: usize, extent: Extent, block: &mut Block) -> Result<(), MetricError> {
            block.place(&self.at(i, o), extent);
            Ok(())
        }

        fn is_mirror_symmetric(&self) -> bool {
            false
        }
    }

    /// The terms of one cell, channel by channel or by colour coordinate.
    fn plain_terms(variant: LpVariant, r: Rgb, a: Rgb, weights: &Weights) -> [f64; 3] {
        let root = |x: f64| if variant.cube_root { x.cbrt() } else { x };
        let coordinates = |rgb: Rgb| match (CellFormula::of(variant), variant.formula) {
            (Some(_), Formula::D8 | Formula::D9) => rgb.map(|f| (root(f) * weights.cosine + EPSILON).ln()),
            (Some(_), _) => rgb.map(root),
            (None, Formula::D6) => study_lab(rgb, &STUDY_XYZ).map(root),
            (None, _) => cielab(rgb.map(|f| root(PI * f))),
        };
        let (r, a) = (coordinates(r), coordinates(a));
        [0, 1, 2].map(|c| {
            let d = a[c] - r[c];
            let term = match variant.formula {
                Formula::D5 | Formula::D8 => d.abs(),
                Formula::D3 | Formula::D7 => (d * d).cbrt(),
                _ => d * d,
            };
            weights.of(variant.formula) * term
        })
    }

    #[test]
    fn the_fused_pass_agrees_with_the_formulas_cell_by_cell() {
        let (reference, candidate) = (Noise(1), Noise(2));
        let i = 37;
        let work = Work::for_variants(LpVariant::every());
        // Beside candidates that are like it, and that lack other cells.
        let candidates: [&dyn Cells; 3] = [&Noise(3), &candidate, &reference];
        let fused = row(&reference, &candidates, &work, i).unwrap().swap_remove(1);
        assert_eq!(fused, row(&reference, &[&candidate], &work, i).unwrap()[0]);
        for variant in LpVariant::every() {
            let (mut sums, mut count) = ([0.0; 3], 0);
            for o in 0..if variant.clamped { POLAR_CLAMPED } else { POLAR } {
                let weights = Weights::at(i, o);
                for (r, a) in reference.at(i, o).into_iter().zip(candidate.at(i, o)) {
                    let (Some(r), Some(a)) = (r, a) else { continue };
                    count += 1;
                    let terms = plain_terms(variant, r, a, &weights);
                    sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
                }
            }
            assert_eq!(fused.cells(variant), count, "{variant}");
            for (fused, sum) in fused.channels(variant).into_iter().zip(sums) {
                let plain = variant.formula.of_mean(sum / count as f64);
                assert!((fused / plain - 1.0).abs() < 1e-11, "{variant}: {fused} {plain}");
            }
        }
    }

    /// Hides that a BRDF is its own mirror image, and that it is reciprocal.
    struct Whole<B>(B);

    impl<B: Brdf> Brdf for Whole<B> {
        fn eval(&self, wi: Vec3, wo: Vec3) -> Option<Rgb> {
            self.0.eval(wi, wo)
        }
    }

    /// A reference that is read once keeps one of two blocks that are the same.
    #[test]
    fn an_owned_reference_that_is_exchangeable_serves_every_candidate() {
        let ggx = |alpha| Ggx::new([0.2, 0.1, 0.05], [0.04; 3], alpha).unwrap();
        let (owned, whole) =
            (owned_cells(&ggx(0.1), Side::Reference).unwrap(), owned_cells(&Whole(ggx(0.1)), Side::Reference).unwrap());
        assert!(owned.is_exchangeable() && !whole.is_exchangeable());
        let (candidate, other) = (ggx(0.2), Whole(ggx(0.2)));
        let candidates = [&candidate as &dyn Brdf, &other].map(|brdf| cells(brdf, Side::Candidate).unwrap());
        let candidates: Vec<&dyn Cells> = candidates.iter().map(|cells| &**cells).collect();
        let work = Work::for_variants(LpVariant::of_study());
        let expected = Sums::over(&*whole, &candidates, &work).unwrap();
        for (found, expected) in Sums::over(&*owned, &candidates, &work).unwrap().iter().zip(&expected) {
            for variant in LpVariant::of_study() {
                assert_eq!(found.cells(variant), expected.cells(variant));
                let (a, b) = (found.distance(variant), expected.distance(variant));
                assert!((a - b).abs() <= 1e-12 * b, "{variant}: {a} {b}");
            }
        }
    }

    #[test]
    fn folded_and_exchangeable_pairs_have_the_sums_of_whole_ones() {
        let reference = Ggx::new([0.2, 0.1, 0.05], [0.04; 3], 0.1).unwrap();
        let candidate = Ward::new([0.2, 0.1, 0.05], [0.1; 3], 0.15, WardForm::Ward).unwrap();
        let work = Work::for_variants(LpVariant::every());
        let sums = |reference: &dyn Brdf, candidate: &dyn Brdf| {
            let (reference, candidate) =
                (cells(reference, Side::Reference).unwrap(), cells(candidate, Side::Candidate).unwrap());
            Sums::over(&*reference, &[&*candidate], &work).unwrap().remove(0)
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
